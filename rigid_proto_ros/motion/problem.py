# SPDX-License-Identifier: MIT
"""What an integrator is given for one segment: the problem p, a record, what acts by it, and the variables y.

Within a segment all commands are constant. Everything is in principal axes (the body's, turned so that the tensor is
diagonal): I₁ ≤ I₂ ≤ I₃, torques τ and arms r. The motion is

    I ω' = τ_b + Rᵀ τ_w + vee(M R) + r × RᵀF − c_ω ω − ω × (I ω + h) − h',    q' = ½ q ⊗ ω,
    x' = v,    v' = g_w + R g_b + F/m − c_v v

with g_w = gravity + F_w/m [m/s², world], g_b = F_b/m [m/s², principal], M = Σ r F_wᵀ (r principal, F world), c_v = c/m
and F the pull of the string (motion/string.py) on its knot at r. h is the momentum of a flywheel relative to the body,
which within a segment grows evenly: h = h₀ + t h'.

Translation is split into a reference that has a closed form and what is added to it, so that an integrator computes no
more than it must, and the reference has no error to accumulate: under a constant acceleration g and damping c, x = x₀ +
t (v₀ φ₁(ct) + t g φ₂(ct)) with φ₁(z) = (1 − e⁻ᶻ)/z and φ₂(z) = (z − 1 + e⁻ᶻ)/z². Damping is linear, so what a
body-fixed force adds obeys u' = R g_b − c u whatever the reference does. Without a string the reference is what g_w and
c_v do from the start on, with one it is the even motion of the string's free end.

The variables y of a segment: attitude q xyzw of the principal axes (principal to world), ω in principal axes, the added
displacement and velocity, what the hand has worked and the string's damper has heated since the segment's start [J],
and the time since then, which only the flywheel asks for.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..base.arithmetic import expm1
from ..base.compilation import njit, record_type
from ..base.rotation import multiply, norm, rotate, rotate_inverse
from ..base.vectors import FloatArray, Quaternion, StateRow, Vector
from . import body as of_body
from . import loads as of_loads
from .body import BodyRow
from .string import KNOT, NO_DIRECTION, ORIGIN, PUSHES, REST, TARGET, C, K, free_end_at

PROBLEM = record_type(
    [
        ("moments", np.float64, 3),  # principal moments [kg m²]
        ("torque_body", np.float64, 3),  # τ_b [N m]
        ("torque_world", np.float64, 3),  # τ_w [N m]
        ("moment", np.float64, 9),  # M row by row [N m]
        ("acceleration_body", np.float64, 3),  # g_b [m/s²]
        ("acceleration_added", np.float64, 3),  # constant world acceleration of the added motion [m/s²]
        ("damping_linear", np.float64),  # c_v [1/s]
        ("damping_angular", np.float64),  # c_ω [N m s]
        ("gyroscopic", np.float64),  # 1, or 0 to drop ω × Iω
        ("has_world_torque", np.bool_),  # when τ_w or M isn't zero: only then is R needed
        ("translates", np.bool_),  # when there is an added motion, so that translation must be integrated
        ("start_position", np.float64, 3),  # x at the segment's start
        ("reference_velocity", np.float64, 3),  # of the reference at the segment's start [m/s]
        ("reference_acceleration", np.float64, 3),  # [m/s²]
        ("reference_damping", np.float64),  # [1/s]
        ("start_velocity_added", np.float64, 3),  # added velocity at the segment's start [m/s]
        ("principal_axes", np.float64, 9),  # P row by row: body = P principal
        ("principal_quaternion", np.float64, 4),  # the same as a quaternion xyzw
        ("mass", np.float64),  # [kg]
        ("length", np.float64),  # ℓ, what a displacement error is measured by [m]
        ("has_string", np.bool_),  # when a string is tied
        ("stiffness", np.float64),  # k [N/m]
        ("string_damping", np.float64),  # c [N s/m]
        ("rest_length", np.float64),  # [m]
        ("bilateral", np.bool_),  # when the string pushes too; always so for rest length 0, where it can't
        ("attach", np.float64, 3),  # r of the knot [m, principal]
        ("string_start", np.float64, 3),  # COM minus free end at the segment's start [m, world]
        ("hand_velocity", np.float64, 3),  # of the free end [m/s, world]
        ("has_rotor", np.bool_),  # when there is a flywheel
        ("rotor", np.float64, 3),  # h at the segment's start [N m s]
        ("rotor_torque", np.float64, 3),  # h' [N m]
    ]
)


Variables = NDArray[np.float64]
"""(VARIABLES,): variables y of a segment."""


@njit(error_model="numpy", allocates=False, forceinline=True)
def begin_body(p: np.record, body: BodyRow, environment: np.record, gyroscopic: float) -> None:
    """Fill p, a record of zeros, with what is the same in every segment of a body (BODY,): all but loads, string and
    start. environment: a record with gravity (3,) [m/s², world], linear_damping [N s/m] and angular_damping [N m s].
    """
    for k in range(3):
        p.moments[k] = body[of_body.MOMENTS + k]
        p.reference_acceleration[k] = environment.gravity[k]
    for k in range(9):
        p.principal_axes[k] = body[of_body.AXES + k]
    for k in range(4):
        p.principal_quaternion[k] = body[of_body.QUATERNION + k]
    p.damping_linear = environment.linear_damping / body[of_body.MASS]
    p.damping_angular = environment.angular_damping
    p.gyroscopic = gyroscopic
    p.reference_damping = p.damping_linear
    p.mass = body[of_body.MASS]
    p.length = body[of_body.LENGTH]


@njit(error_model="numpy", allocates=False)
def begin_problem(p: np.record, loads: FloatArray, row: StateRow) -> None:
    """Complete the body's part p with the sums of loads and the start, as far as they go without a string."""
    P, mass = p.principal_axes, p.mass
    turns, pushes = False, False
    for k in range(3):
        torque, force = 0.0, 0.0
        for j in range(3):
            torque += P[3 * j + k] * loads[of_loads.TORQUE_BODY + j]
            force += P[3 * j + k] * loads[of_loads.FORCE_BODY + j]
            moment = 0.0
            for i in range(3):
                moment += P[3 * i + k] * loads[of_loads.MOMENT + 3 * i + j]
            p.moment[3 * k + j] = moment
            turns = turns or loads[of_loads.MOMENT + 3 * k + j] != 0.0
        p.torque_body[k] = torque
        p.acceleration_body[k] = force / mass
        p.torque_world[k] = loads[of_loads.TORQUE_WORLD + k]
        turns = turns or loads[of_loads.TORQUE_WORLD + k] != 0.0
        pushes = pushes or loads[of_loads.FORCE_BODY + k] != 0.0
        p.start_position[k] = row[k]
        p.reference_velocity[k] = row[7 + k]
        p.reference_acceleration[k] += loads[of_loads.FORCE_WORLD + k] / mass
    p.has_world_torque = turns
    p.translates = pushes


@njit(error_model="numpy", allocates=False)
def begin_string(
    p: np.record, body: BodyRow, string: FloatArray, begin_ns: int, end_ns: int, row: StateRow, now_ns: int
) -> None:
    """Complete the problem p with a tied string (STRING,) whose free end goes from origin to target
    between these times.
    """
    free_end, hand = free_end_at(now_ns, string[ORIGIN:], string[TARGET:], begin_ns, end_ns)
    x, y, z = of_body.arm(body, string[KNOT], string[KNOT + 1], string[KNOT + 2])
    P = p.principal_axes
    for k in range(3):
        p.reference_velocity[k] = hand[k]
        p.start_velocity_added[k] = row[7 + k] - hand[k]
        p.acceleration_added[k] = p.reference_acceleration[k] - p.damping_linear * hand[k]
        p.reference_acceleration[k] = 0.0
        p.attach[k] = P[k] * x + P[3 + k] * y + P[6 + k] * z
        p.string_start[k] = row[k] - free_end[k]
        p.hand_velocity[k] = hand[k]
    p.reference_damping = 0.0
    p.translates = True
    p.has_string = True
    p.stiffness = string[K]
    p.string_damping = string[C]
    p.rest_length = string[REST]
    p.bilateral = string[PUSHES] != 0.0 or string[REST] == 0.0


@njit(error_model="numpy", allocates=False)
def begin_rotor(p: np.record, h: Vector, torque: Vector) -> None:
    """Complete the problem p with a flywheel: its momentum h at the segment's start and its rate, in body axes."""
    P = p.principal_axes
    for k in range(3):
        p.rotor[k] = P[k] * h[0] + P[3 + k] * h[1] + P[6 + k] * h[2]
        p.rotor_torque[k] = P[k] * torque[0] + P[3 + k] * torque[1] + P[6 + k] * torque[2]
    p.has_rotor = True


# What acts beside the string, as the equations of motion take it. q xyzw takes principal to world axes, w = ω is in
# principal axes, u is the added velocity in world axes.


@njit(error_model="numpy", allocates=False)
def _torque_of_the_world(q: Quaternion, p: np.record) -> Vector:
    """Rᵀτ_w + vee(M R)."""
    W, M = p.torque_world, p.moment
    x, y, z = rotate_inverse(*q, W[0], W[1], W[2])
    # Row i of M R is Rᵀ times row i of M; vee takes (M R)₁₂ − (M R)₂₁ and so on, counted from 0.
    _, m01, m02 = rotate_inverse(*q, M[0], M[1], M[2])
    m10, _, m12 = rotate_inverse(*q, M[3], M[4], M[5])
    m20, m21, _ = rotate_inverse(*q, M[6], M[7], M[8])
    return x + (m12 - m21), y + (m20 - m02), z + (m01 - m10)


# What most motions need of the torque is little, and inlined; whether LLVM would do so by itself depends on the order
# in which functions are compiled.


@njit(error_model="numpy", allocates=False, forceinline=True)
def undamped_torque(q: Quaternion, p: np.record) -> Vector:
    """Torque of the loads about the COM in principal axes: τ_b + Rᵀτ_w + vee(M R)."""
    tx, ty, tz = p.torque_body[0], p.torque_body[1], p.torque_body[2]
    if p.has_world_torque:
        x, y, z = _torque_of_the_world(q, p)
        tx, ty, tz = tx + x, ty + y, tz + z
    return tx, ty, tz


@njit(error_model="numpy", allocates=False, forceinline=True)
def torque(q: Quaternion, w: Vector, p: np.record) -> Vector:
    """Torque of loads and damping about the COM in principal axes: τ_b + Rᵀτ_w + vee(M R) − c_ω ω."""
    tx, ty, tz = undamped_torque(q, p)
    c = p.damping_angular
    return tx - c * w[0], ty - c * w[1], tz - c * w[2]


@njit(error_model="numpy", allocates=False, forceinline=True)
def acceleration(q: Quaternion, u: Vector, p: np.record) -> Vector:
    """u' without the string's part (world axes): its constant part, R g_b and −c_v u."""
    own, added, c = p.acceleration_body, p.acceleration_added, p.damping_linear
    ax, ay, az = rotate(*q, own[0], own[1], own[2])
    return ax + (added[0] - c * u[0]), ay + (added[1] - c * u[1]), az + (added[2] - c * u[2])


# Where the variables stand in their row.
ATTITUDE = 0  # (4,)
SPIN = 4  # (3,)
DISPLACEMENT = 7  # (3,)
VELOCITY = 10  # (3,)
HAND_WORK = 13
HEAT = 14
TIME = 15
VARIABLES = 16

MAX_SPEED = 1e100
"""|x|, |v| or |ω| beyond this is a runaway: squares of it still fit a double, and nothing physical is near."""


@njit(error_model="numpy", allocates=False)
def is_good(y: Variables) -> bool:
    """Whether variables y are finite and no runaway."""
    size = 0.0
    for j in range(4, 13):
        size += abs(y[j])
    # Negated sense, so that NaN counts as a runaway.
    return size <= MAX_SPEED and math.isfinite(y[0] + y[1] + y[2] + y[3])


@njit(error_model="numpy", allocates=False)
def damping_functions(z: float) -> tuple[float, float]:
    """φ₁(z) = (1 − e⁻ᶻ)/z and φ₂(z) = (z − 1 + e⁻ᶻ)/z², z ≥ 0, to rounding."""
    if z == 0.0:
        return 1.0, 0.5
    if z < 0.5:
        # φ₂ = Σ (−z)ᵏ/(k + 2)!; 14 terms leave 0.5¹⁴/16! = 3e-18.
        phi2 = 0.0
        for k in range(13, -1, -1):
            phi2 = (1.0 - z * phi2) / (k + 2.0)
        return 1.0 - z * phi2, phi2
    phi1 = -expm1(-z) / z
    return phi1, (1.0 - phi1) / z


@njit(error_model="numpy", allocates=False)
def to_variables(row: StateRow, p: np.record, y: Variables) -> None:
    """State row (13,) to variables y (VARIABLES,) at the start of the segment with problem p."""
    P, Q = p.principal_axes, p.principal_quaternion
    y[0], y[1], y[2], y[3] = multiply(row[3], row[4], row[5], row[6], Q[0], Q[1], Q[2], Q[3])
    for k in range(3):
        y[SPIN + k] = P[k] * row[10] + P[3 + k] * row[11] + P[6 + k] * row[12]
        y[DISPLACEMENT + k] = 0.0
        y[VELOCITY + k] = p.start_velocity_added[k]
    y[HAND_WORK] = 0.0
    y[HEAT] = 0.0
    y[TIME] = 0.0


_TO_NEAREST = 6755399441055744.0  # 1.5·2⁵²


@njit(error_model="numpy", allocates=False)
def later(time: float, h: float) -> float:
    """time + h [s], whole nanoseconds each, ≥ 0: rounded to these, so that no error adds up over steps."""
    return (((time + h) * 1e9 + _TO_NEAREST) - _TO_NEAREST) * 1e-9


@njit(error_model="numpy", allocates=False)
def to_row(y: Variables, p: np.record, elapsed: float, row: StateRow) -> None:
    """Variables y (VARIABLES,), ``elapsed`` seconds after the segment's start, to a state row (13,)."""
    P, Q = p.principal_axes, p.principal_quaternion
    c = p.reference_damping
    phi1, phi2 = damping_functions(c * elapsed)
    for k in range(3):
        g = p.reference_acceleration[k]
        v = p.reference_velocity[k]
        row[k] = p.start_position[k] + (elapsed * (v * phi1 + elapsed * g * phi2) + y[DISPLACEMENT + k])
        row[7 + k] = v + (elapsed * phi1 * (g - c * v) + y[VELOCITY + k])
        row[10 + k] = P[3 * k] * y[4] + P[3 * k + 1] * y[5] + P[3 * k + 2] * y[6]
    row[3], row[4], row[5], row[6] = multiply(y[0], y[1], y[2], y[3], -Q[0], -Q[1], -Q[2], Q[3])


@njit(error_model="numpy", allocates=False)
def to_good_row(y: Variables, p: np.record, elapsed: float, row: StateRow, limit: float) -> bool:
    """``to_row``; returns whether no number of the row is beyond ``limit`` or no number at all."""
    to_row(y, p, elapsed, row)
    good = True
    for k in range(13):
        good = good and abs(row[k]) <= limit
    return good


# The equations of motion in principal axes, as integrators evaluate them, with the string's force. q and w as above, d
# and u are the added displacement and velocity in world axes. ``taut`` says whether the string's law of tension holds;
# where it changes is found by integrators/string_law.py.


@njit(error_model="numpy", allocates=False)
def parts_of(y: Variables) -> tuple[Quaternion, Vector, Vector, Vector]:
    """q, ω, d and u of the variables y."""
    return (y[0], y[1], y[2], y[3]), (y[4], y[5], y[6]), (y[7], y[8], y[9]), (y[10], y[11], y[12])


@njit(error_model="numpy", allocates=False, forceinline=True)
def angular_acceleration(w: Vector, t: Vector, p: np.record) -> Vector:
    """Euler's equations in principal axes: ω' = I⁻¹(τ − ω × Iω); without the gyroscopic term I⁻¹τ."""
    A, B, C, g = p.moments[0], p.moments[1], p.moments[2], p.gyroscopic
    return (
        (t[0] - g * (C - B) * w[1] * w[2]) / A,
        (t[1] - g * (A - C) * w[2] * w[0]) / B,
        (t[2] - g * (B - A) * w[0] * w[1]) / C,
    )


@njit(error_model="numpy", allocates=False)
def rotor_momentum(time: float, p: np.record) -> Vector:
    """h, ``time`` seconds into the segment."""
    h, rate = p.rotor, p.rotor_torque
    return h[0] + time * rate[0], h[1] + time * rate[1], h[2] + time * rate[2]


@njit(error_model="numpy", allocates=False)
def _torque_of_rotor(w: Vector, time: float, p: np.record) -> Vector:
    """−ω × h − h'; without the gyroscopic term −h'."""
    (a, b, c), rate, g = rotor_momentum(time, p), p.rotor_torque, p.gyroscopic
    return (
        g * (w[2] * b - w[1] * c) - rate[0],
        g * (w[0] * c - w[2] * a) - rate[1],
        g * (w[1] * a - w[0] * b) - rate[2],
    )


@njit(error_model="numpy", allocates=False)
def knot(q: Quaternion, w: Vector, d: Vector, u: Vector, p: np.record) -> tuple[Vector, Vector]:
    """From the free end to the knot, a, and its rate a', world axes."""
    r, start = p.attach, p.string_start
    bx, by, bz = rotate(*q, r[0], r[1], r[2])
    vx, vy, vz = rotate(*q, w[1] * r[2] - w[2] * r[1], w[2] * r[0] - w[0] * r[2], w[0] * r[1] - w[1] * r[0])
    a = start[0] + d[0] + bx, start[1] + d[1] + by, start[2] + d[2] + bz
    return a, (u[0] + vx, u[1] + vy, u[2] + vz)


@njit(error_model="numpy", allocates=False)
def string_pull(
    q: Quaternion, w: Vector, d: Vector, u: Vector, p: np.record, taut: bool
) -> tuple[Vector, Vector, float, float]:
    """Force on the knot (world axes), torque about the COM (principal axes), power of the hand, power lost in the
    damper.
    """
    a, v = knot(q, w, d, u, p)
    k, c, rest = p.stiffness, p.string_damping, p.rest_length
    if rest == 0.0:
        fx, fy, fz = -k * a[0] - c * v[0], -k * a[1] - c * v[1], -k * a[2] - c * v[2]
        heat = c * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    else:
        length = norm(*a)
        if not taut or length < NO_DIRECTION * rest:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0
        nx, ny, nz = a[0] / length, a[1] / length, a[2] / length
        rate = nx * v[0] + ny * v[1] + nz * v[2]
        tension = k * (length - rest) + c * rate
        fx, fy, fz = -tension * nx, -tension * ny, -tension * nz
        heat = c * rate * rate
    r, hand = p.attach, p.hand_velocity
    bx, by, bz = rotate_inverse(*q, fx, fy, fz)
    about_com = r[1] * bz - r[2] * by, r[2] * bx - r[0] * bz, r[0] * by - r[1] * bx
    return (fx, fy, fz), about_com, fx * hand[0] + fy * hand[1] + fz * hand[2], heat


@njit(error_model="numpy", allocates=False, forceinline=True)
def accelerations(
    q: Quaternion, w: Vector, d: Vector, u: Vector, time: float, p: np.record, taut: bool
) -> tuple[Vector, Vector, float, float]:
    """ω' (principal axes), u' (world axes), power of the hand, power lost in the string's damper, for a unit q,
    ``time`` seconds into the segment.

    I ω' = τ − ω × (Iω + h) − h', without the gyroscopic term τ − h'; u' is what ``acceleration`` gives and the string's
    F/m.
    """
    tx, ty, tz = torque(q, w, p)
    if p.has_rotor:
        x, y, z = _torque_of_rotor(w, time, p)
        tx, ty, tz = tx + x, ty + y, tz + z
    if not p.translates:
        return angular_acceleration(w, (tx, ty, tz), p), (0.0, 0.0, 0.0), 0.0, 0.0
    ax, ay, az = acceleration(q, u, p)
    work, heat = 0.0, 0.0
    if p.has_string:
        force, about_com, work, heat = string_pull(q, w, d, u, p, taut)
        ax, ay, az = ax + force[0] / p.mass, ay + force[1] / p.mass, az + force[2] / p.mass
        tx, ty, tz = tx + about_com[0], ty + about_com[1], tz + about_com[2]
    return angular_acceleration(w, (tx, ty, tz), p), (ax, ay, az), work, heat


@njit(error_model="numpy", allocates=False)
def stretch(y: Variables, p: np.record) -> tuple[float, float]:
    """x = l − rest length, and its rate, of variables y; (1, 0) for a string whose law never changes."""
    if p.bilateral or not p.has_string:
        return 1.0, 0.0
    a, v = knot(*parts_of(y), p)
    length = norm(*a)
    if length == 0.0:
        return -p.rest_length, 0.0
    return length - p.rest_length, (a[0] * v[0] + a[1] * v[1] + a[2] * v[2]) / length


@njit(error_model="numpy", allocates=False)
def tension_margin(y: Variables, p: np.record) -> float:
    """min(k x, k x + c x'): positive exactly while the string pulls."""
    x, rate = stretch(y, p)
    spring = p.stiffness * x
    return float(min(spring, spring + p.string_damping * rate))
