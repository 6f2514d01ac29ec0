# SPDX-License-Identifier: MIT
"""What an integrator is given for one segment, as one flat array that compiled kernels read by name.

Within a segment all commands are constant. Everything is in principal axes (the body's, turned so that the tensor is
diagonal): I₁ ≤ I₂ ≤ I₃, torques τ and arms r. The motion is

    I ω' = τ_b + Rᵀ τ_w + vee(M R) − c_ω ω − ω × I ω,    q' = ½ q ⊗ ω,
    x' = v,    v' = g_w + R g_b − c_v v

with g_w = gravity + F_w/m [m/s², world], g_b = F_b/m [m/s², principal], M = Σ r F_wᵀ (r principal, F world), c_v = c/m.
"""

from __future__ import annotations

import numpy as np

from .body import Body
from .loads import LoadSum
from .state import State

MOMENTS = 0  # (3,) principal moments [kg m²]
TORQUE_BODY = 3  # (3,) τ_b [N m]
TORQUE_WORLD = 6  # (3,) τ_w [N m]
MOMENT = 9  # (9,) M row by row [N m]
ACCELERATION_BODY = 18  # (3,) g_b [m/s²]
ACCELERATION_WORLD = 21  # (3,) g_w [m/s²]
DAMPING_LINEAR = 24  # c_v [1/s]
DAMPING_ANGULAR = 25  # c_ω [N m s]
GYROSCOPIC = 26  # 1, or 0 to drop ω × Iω
HAS_WORLD_TORQUE = 27  # 1 when τ_w or M isn't zero: only then is R needed
HAS_BODY_FORCE = 28  # 1 when translation depends on attitude or velocity, so that it has no closed form
START_POSITION = 29  # (3,) x at the segment's start
START_VELOCITY = 32  # (3,) v at the segment's start
PRINCIPAL_AXES = 35  # (9,) P row by row: body = P principal
PRINCIPAL_QUATERNION = 44  # (4,) the same as a quaternion xyzw
SIZE = 48


def make_problem(
    body: Body, loads: LoadSum, gravity, linear_damping: float, angular_damping: float, gyroscopic: bool, state: State
) -> np.ndarray:
    """The segment's problem (SIZE,) for a body under summed loads from a state on."""
    P = body.principal_axes
    p = np.zeros(SIZE)
    p[MOMENTS : MOMENTS + 3] = body.principal_moments
    p[TORQUE_BODY : TORQUE_BODY + 3] = _to_principal(P, loads.torque_body)
    p[TORQUE_WORLD : TORQUE_WORLD + 3] = loads.torque_world
    moment = np.stack([_to_principal(P, loads.moment[:, k]) for k in range(3)], axis=1)
    p[MOMENT : MOMENT + 9] = moment.ravel()
    p[ACCELERATION_BODY : ACCELERATION_BODY + 3] = _to_principal(P, loads.force_body) / body.mass
    p[ACCELERATION_WORLD : ACCELERATION_WORLD + 3] = np.asarray(gravity) + loads.force_world / body.mass
    p[DAMPING_LINEAR] = linear_damping / body.mass
    p[DAMPING_ANGULAR] = angular_damping
    p[GYROSCOPIC] = float(gyroscopic)
    p[HAS_WORLD_TORQUE] = float(loads.torque_world.any() or loads.moment.any())
    p[HAS_BODY_FORCE] = float(bool(loads.force_body.any() or linear_damping))
    p[START_POSITION : START_POSITION + 3] = state.position
    p[START_VELOCITY : START_VELOCITY + 3] = state.linear_velocity
    p[PRINCIPAL_AXES : PRINCIPAL_AXES + 9] = P.ravel()
    p[PRINCIPAL_QUATERNION : PRINCIPAL_QUATERNION + 4] = body.principal_quaternion
    return p


def _to_principal(P, vector) -> np.ndarray:
    return P[0] * vector[0] + P[1] * vector[1] + P[2] * vector[2]
