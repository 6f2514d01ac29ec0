# SPDX-License-Identifier: MIT
"""What an integrator is given for one segment, as one flat array that compiled kernels read by name.

Kernels import this module as ``of``: ``p[of.MASS]`` is the mass of the problem p.

Within a segment all commands are constant. Everything is in principal axes (the body's, turned so that the tensor is
diagonal): I₁ ≤ I₂ ≤ I₃, torques τ and arms r. The motion is

    I ω' = τ_b + Rᵀ τ_w + vee(M R) + r × RᵀF − c_ω ω − ω × I ω,    q' = ½ q ⊗ ω,
    x' = v,    v' = g_w + R g_b + F/m − c_v v

with g_w = gravity + F_w/m [m/s², world], g_b = F_b/m [m/s², principal], M = Σ r F_wᵀ (r principal, F world), c_v = c/m
and F the pull of the string (motion/string.py) on its knot at r.

Translation is split into a reference that has a closed form and what is added to it (motion/variables.py), so that an
integrator computes no more than it must. Without a string the reference is what g_w and c_v do from the start on, with
one it is the even motion of the string's free end.
"""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit
from . import body as of_body
from . import loads as of_loads

MOMENTS = 0  # (3,) principal moments [kg m²]
TORQUE_BODY = 3  # (3,) τ_b [N m]
TORQUE_WORLD = 6  # (3,) τ_w [N m]
MOMENT = 9  # (9,) M row by row [N m]
ACCELERATION_BODY = 18  # (3,) g_b [m/s²]
ACCELERATION_ADDED = 21  # (3,) constant world acceleration of the added motion [m/s²]
DAMPING_LINEAR = 24  # c_v [1/s]
DAMPING_ANGULAR = 25  # c_ω [N m s]
GYROSCOPIC = 26  # 1, or 0 to drop ω × Iω
HAS_WORLD_TORQUE = 27  # 1 when τ_w or M isn't zero: only then is R needed
TRANSLATES = 28  # 1 when there is an added motion, so that translation must be integrated
START_POSITION = 29  # (3,) x at the segment's start
REFERENCE_VELOCITY = 32  # (3,) of the reference at the segment's start [m/s]
REFERENCE_ACCELERATION = 35  # (3,) [m/s²]
REFERENCE_DAMPING = 38  # [1/s]
START_VELOCITY_ADDED = 39  # (3,) added velocity at the segment's start [m/s]
PRINCIPAL_AXES = 42  # (9,) P row by row: body = P principal
PRINCIPAL_QUATERNION = 51  # (4,) the same as a quaternion xyzw
MASS = 55  # [kg]
LENGTH = 56  # ℓ, what a displacement error is measured by [m]
HAS_STRING = 57  # 1 when a string is tied
STIFFNESS = 58  # k [N/m]
STRING_DAMPING = 59  # c [N s/m]
REST_LENGTH = 60  # [m]
BILATERAL = 61  # 1 when the string pushes too; always so for rest length 0, where it can't
ATTACH = 62  # (3,) r of the knot [m, principal]
STRING_START = 65  # (3,) COM minus free end at the segment's start [m, world]
HAND_VELOCITY = 68  # (3,) of the free end [m/s, world]
SIZE = 71


# Where the numbers of a tied string stand in its row.
KNOT = 0  # (3,) [mesh coordinates]
ORIGIN = 3  # (3,) of the free end's way [m, world]
TARGET = 6  # (3,) [m, world]
K, C, REST, PUSHES = 9, 10, 11, 12
STRING = 13


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def begin_body(
    p: np.ndarray,
    body: np.ndarray,
    gravity: np.ndarray,
    linear_damping: float,
    angular_damping: float,
    gyroscopic: float,
) -> None:
    """Fill p with what is the same in every segment of a body (BODY,): all but loads, string and start."""
    p[:] = 0.0
    for k in range(3):
        p[MOMENTS + k] = body[of_body.MOMENTS + k]
        p[REFERENCE_ACCELERATION + k] = gravity[k]
    for k in range(9):
        p[PRINCIPAL_AXES + k] = body[of_body.AXES + k]
    for k in range(4):
        p[PRINCIPAL_QUATERNION + k] = body[of_body.QUATERNION + k]
    p[DAMPING_LINEAR] = linear_damping / body[of_body.MASS]
    p[DAMPING_ANGULAR] = angular_damping
    p[GYROSCOPIC] = gyroscopic
    p[REFERENCE_DAMPING] = p[DAMPING_LINEAR]
    p[MASS] = body[of_body.MASS]
    p[LENGTH] = body[of_body.LENGTH]


@njit(cache=True, error_model="numpy", allocates=False)
def begin_problem(p: np.ndarray, loads: np.ndarray, row: np.ndarray) -> None:
    """Complete the body's part p with loads and the start, as far as they go without a string."""
    P, mass = PRINCIPAL_AXES, p[MASS]
    turns, pushes = False, False
    for k in range(3):
        torque, force = 0.0, 0.0
        for j in range(3):
            torque += p[P + 3 * j + k] * loads[of_loads.TORQUE_BODY + j]
            force += p[P + 3 * j + k] * loads[of_loads.FORCE_BODY + j]
            moment = 0.0
            for i in range(3):
                moment += p[P + 3 * i + k] * loads[of_loads.MOMENT + 3 * i + j]
            p[MOMENT + 3 * k + j] = moment
            turns = turns or loads[of_loads.MOMENT + 3 * k + j] != 0.0
        p[TORQUE_BODY + k] = torque
        p[ACCELERATION_BODY + k] = force / mass
        p[TORQUE_WORLD + k] = loads[of_loads.TORQUE_WORLD + k]
        turns = turns or loads[of_loads.TORQUE_WORLD + k] != 0.0
        pushes = pushes or loads[of_loads.FORCE_BODY + k] != 0.0
        p[START_POSITION + k] = row[k]
        p[REFERENCE_VELOCITY + k] = row[7 + k]
        p[REFERENCE_ACCELERATION + k] += loads[of_loads.FORCE_WORLD + k] / mass
    p[HAS_WORLD_TORQUE] = 1.0 if turns else 0.0
    p[TRANSLATES] = 1.0 if pushes else 0.0


@njit(cache=True, error_model="numpy", allocates=False)
def begin_string(
    p: np.ndarray, body: np.ndarray, string: np.ndarray, begin_ns: int, end_ns: int, row: np.ndarray, now_ns: int
) -> None:
    """Complete the problem p with a tied string (STRING,) whose free end goes from origin to target
    between these times.
    """
    seconds, ends = (end_ns - begin_ns) * 1e-9, now_ns >= end_ns
    x, y, z = of_body.arm(body, string[KNOT], string[KNOT + 1], string[KNOT + 2])
    P = PRINCIPAL_AXES
    for k in range(3):
        hand = 0.0 if ends else (string[TARGET + k] - string[ORIGIN + k]) / seconds
        free_end = string[TARGET + k] if ends else string[ORIGIN + k] + ((now_ns - begin_ns) * 1e-9) * hand
        p[REFERENCE_VELOCITY + k] = hand
        p[START_VELOCITY_ADDED + k] = row[7 + k] - hand
        p[ACCELERATION_ADDED + k] = p[REFERENCE_ACCELERATION + k] - p[DAMPING_LINEAR] * hand
        p[REFERENCE_ACCELERATION + k] = 0.0
        p[ATTACH + k] = p[P + k] * x + p[P + 3 + k] * y + p[P + 6 + k] * z
        p[STRING_START + k] = row[k] - free_end
        p[HAND_VELOCITY + k] = hand
    p[REFERENCE_DAMPING] = 0.0
    p[TRANSLATES] = 1.0
    p[HAS_STRING] = 1.0
    p[STIFFNESS] = string[K]
    p[STRING_DAMPING] = string[C]
    p[REST_LENGTH] = string[REST]
    p[BILATERAL] = 1.0 if string[PUSHES] != 0.0 or string[REST] == 0.0 else 0.0
