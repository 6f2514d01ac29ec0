# SPDX-License-Identifier: MIT
"""What an integrator is given for one segment, as one flat array that compiled kernels read by name.

Within a segment all commands are constant. Everything is in principal axes (the body's, turned so that the tensor is
diagonal): I₁ ≤ I₂ ≤ I₃, torques τ and arms r. The motion is

    I ω' = τ_b + Rᵀ τ_w + vee(M R) + r × RᵀF − c_ω ω − ω × I ω,    q' = ½ q ⊗ ω,
    x' = v,    v' = g_w + R g_b + F/m − c_v v

with g_w = gravity + F_w/m [m/s², world], g_b = F_b/m [m/s², principal], M = Σ r F_wᵀ (r principal, F world), c_v = c/m and
F the pull of the string (core/string.py) on its knot at r.

Translation is split into a reference that has a closed form and what is added to it (core/motion.py), so that an
integrator carries no more than it must. Without a string the reference is what g_w and c_v do from the start on, with one
it is the even motion of the string's free end.
"""

from __future__ import annotations

import numpy as np

from .body import Body
from .loads import LoadSum
from .state import State
from .string import Tied

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


def make_problem(
    body: Body,
    loads: LoadSum,
    gravity,
    linear_damping: float,
    angular_damping: float,
    gyroscopic: bool,
    state: State,
    string: Tied | None = None,
    length: float = 1.0,
) -> np.ndarray:
    """The segment's problem (SIZE,) for a body under summed loads, and a string if tied, from a state on."""
    P = body.principal_axes
    p = np.zeros(SIZE)
    p[MOMENTS : MOMENTS + 3] = body.principal_moments
    p[TORQUE_BODY : TORQUE_BODY + 3] = _to_principal(P, loads.torque_body)
    p[TORQUE_WORLD : TORQUE_WORLD + 3] = loads.torque_world
    moment = np.stack([_to_principal(P, loads.moment[:, k]) for k in range(3)], axis=1)
    p[MOMENT : MOMENT + 9] = moment.ravel()
    p[ACCELERATION_BODY : ACCELERATION_BODY + 3] = _to_principal(P, loads.force_body) / body.mass
    p[DAMPING_LINEAR] = linear_damping / body.mass
    p[DAMPING_ANGULAR] = angular_damping
    p[GYROSCOPIC] = float(gyroscopic)
    p[HAS_WORLD_TORQUE] = float(loads.torque_world.any() or loads.moment.any())
    p[TRANSLATES] = float(bool(loads.force_body.any()) or string is not None)
    p[START_POSITION : START_POSITION + 3] = state.position
    p[PRINCIPAL_AXES : PRINCIPAL_AXES + 9] = P.ravel()
    p[PRINCIPAL_QUATERNION : PRINCIPAL_QUATERNION + 4] = body.principal_quaternion
    p[MASS] = body.mass
    p[LENGTH] = length
    acceleration = np.asarray(gravity) + loads.force_world / body.mass
    if string is None:
        p[REFERENCE_VELOCITY : REFERENCE_VELOCITY + 3] = state.linear_velocity
        p[REFERENCE_ACCELERATION : REFERENCE_ACCELERATION + 3] = acceleration
        p[REFERENCE_DAMPING] = p[DAMPING_LINEAR]
    else:
        hand = string.hand_velocity(state.time_ns)
        p[REFERENCE_VELOCITY : REFERENCE_VELOCITY + 3] = hand
        p[START_VELOCITY_ADDED : START_VELOCITY_ADDED + 3] = state.linear_velocity - hand
        p[ACCELERATION_ADDED : ACCELERATION_ADDED + 3] = acceleration - p[DAMPING_LINEAR] * hand
        p[HAS_STRING] = 1.0
        p[STIFFNESS] = string.stiffness
        p[STRING_DAMPING] = string.damping
        p[REST_LENGTH] = string.rest_length
        p[BILATERAL] = float(string.bilateral or string.rest_length == 0.0)
        p[ATTACH : ATTACH + 3] = _to_principal(P, string.arm(body))
        p[STRING_START : STRING_START + 3] = state.position - string.free_end(state.time_ns)
        p[HAND_VELOCITY : HAND_VELOCITY + 3] = hand
    return p


def _to_principal(P, vector) -> np.ndarray:
    return P[0] * vector[0] + P[1] * vector[1] + P[2] * vector[2]
