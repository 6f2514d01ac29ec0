# SPDX-License-Identifier: MIT
"""The string of a flight: how a hand ties, moves and releases it, and what a change of parameters or body does to it.

flight: a record (simulation/flight.py); scene: the parameters (simulation/record.py). Functions that may refuse return
False, with the reason, and leave the string as it was.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import copy_numbers, local_numbers, njit
from ..base.rotation import rotate
from ..base.vectors import FloatArray, StateRow, Triangles, Vector3
from ..motion.body import AXES, BODY_SCALE, COM, INERTIA, LENGTH, MASS, MAX_ACCELERATION, MOMENTS, BodyRow, arm
from ..motion.integrators.auto import FASTEST
from ..motion.integrators.string_law import APPROACH
from ..motion.state import to_body_axes
from ..motion.string import (
    KNOT,
    ORIGIN,
    PUSHES,
    RAMP_NS,
    REST,
    STRING,
    TARGET,
    C,
    K,
    effective_mass,
    energy_of,
    free_end_at,
    least_span,
    length_of,
    most_yielding,
    span_of,
    spring_of,
)
from ..motion.surface import nearest_point
from . import refusals as rf
from .flight import NEVER
from .refusals import refuse

CLEAR_S = 4e-9
"""[s] Some of the shortest steps."""

ALIKE = 2.0**-40
"""Part of its size by which two bodies' numbers may differ by rounding, made in two ways."""

MESH_AXES, OF_BODY, OF_WORLD = 0.0, 1.0, 2.0
"""Coordinates of the point at which a command ties the string: of the mesh, from the COM in body axes, or of the
world.
"""


@njit(error_model="numpy", allocates=False)
def follows(parameter: int, value: float, most: float, rate: float, refusal: np.record) -> bool:
    """Whether an integrator that chooses its own steps can follow a parameter of RATES. most: the value that gives the
    rate FASTEST [1/s or rad/s].
    """
    if rate > FASTEST and value > most:
        return refuse(refusal, rf.RATE, parameter, value, most, rate)
    return True


@njit(error_model="numpy", allocates=False)
def follows_rates(scene: np.record, body: BodyRow, tied: bool, knot: Vector3, refusal: np.record) -> bool:
    """Whether an integrator that chooses its own steps can follow the damping, and the string if one is tied at
    ``knot`` (3,) [mesh coordinates].
    """
    if scene.integrator != rf.AUTO:
        return True
    mass, least = body[MASS], body[MOMENTS]
    linear, angular = scene.linear_damping, scene.angular_damping
    if not follows(rf.LINEAR_DAMPING, linear, mass * FASTEST, linear / mass, refusal):
        return False
    if not follows(rf.ANGULAR_DAMPING, angular, least * FASTEST, angular / least, refusal):
        return False
    if not tied:
        return True
    x, y, z = arm(body, knot[0], knot[1], knot[2])
    P, M, frequency = AXES, MOMENTS, scene.string_frequency
    a = body[P] * x + body[P + 3] * y + body[P + 6] * z
    b = body[P + 1] * x + body[P + 4] * y + body[P + 7] * z
    c = body[P + 2] * x + body[P + 5] * y + body[P + 8] * z
    yields = most_yielding(mass, body[M], body[M + 1], body[M + 2], a, b, c)
    # No point shows more than the whole mass.
    stiffness = mass * frequency * frequency if frequency > 0.0 else scene.string_stiffness
    swing = math.sqrt(stiffness * yields)
    if frequency > 0.0:
        good = follows(rf.STRING_FREQUENCY, frequency, FASTEST / math.sqrt(mass * yields), swing, refusal)
    else:
        good = follows(rf.STRING_STIFFNESS, stiffness, FASTEST * FASTEST / yields, swing, refusal)
    damping, ratio = 2.0 * math.sqrt(stiffness * mass) * yields, scene.string_damping_ratio
    most = FASTEST / damping if damping > 0.0 else math.inf
    return good and follows(rf.STRING_DAMPING_RATIO, ratio, most, ratio * damping, refusal)


@njit(error_model="numpy", allocates=False)
def begins_clear(
    scene: np.record, body: BodyRow, row: StateRow, knot: Vector3, end: Vector3, refusal: np.record
) -> bool:
    """Whether an integrator that chooses its own steps can begin with a string tied at ``knot`` (3,) [mesh coordinates]
    with its free end at ``end`` (3,) [m, world]: one that pushes has a direction where the knot is away from the free
    end, and stays so for CLEAR_S.
    """
    rest, frequency = scene.string_rest_length, scene.string_frequency
    if scene.integrator != rf.AUTO or rest == 0.0 or not scene.string_bilateral:
        return True
    rx, ry, rz = arm(body, knot[0], knot[1], knot[2])
    distance = length_of(*span_of(rx, ry, rz, row, end[0], end[1], end[2]))
    x, y, z = row[10], row[11], row[12]
    vx, vy, vz = rotate(row[3], row[4], row[5], row[6], y * rz - z * ry, z * rx - x * rz, x * ry - y * rx)
    speed = abs(vx + row[7]) + abs(vy + row[8]) + abs(vz + row[9])
    square = frequency * frequency if frequency > 0.0 else scene.string_stiffness / body[MASS]
    moves = CLEAR_S * (speed + CLEAR_S * square * rest)
    if distance > least_span(rx, ry, rz, row, rest) and moves <= APPROACH * distance:
        return True
    return refuse(refusal, rf.AT_FREE_END, 0, end[0], end[1], end[2])


@njit(error_model="numpy", allocates=False)
def _take_spring(scene: np.record, flight: np.record, mass: float) -> None:
    """Compute stiffness and damping of the tied string from the parameters and ``mass`` [kg] or, if that is 0, from the
    present effective mass of the body.
    """
    string, body, rest = flight.string, flight.body, scene.string_rest_length
    if mass == 0.0:
        rx, ry, rz = arm(body, string[KNOT], string[KNOT + 1], string[KNOT + 2])
        (ex, ey, ez), _ = _free_end(flight)
        span = span_of(rx, ry, rz, flight.row, ex, ey, ez)
        mass = effective_mass(body, rx, ry, rz, flight.row, span, rest)
    flight.string_mass = mass
    string[K], string[C] = spring_of(mass, scene.string_stiffness, scene.string_frequency, scene.string_damping_ratio)
    string[REST], string[PUSHES] = rest, 1.0 if scene.string_bilateral else 0.0


@njit(error_model="numpy", allocates=False)
def _free_end(flight: np.record) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Position and velocity of the free end now."""
    string = flight.string
    return free_end_at(flight.now_ns, string[ORIGIN:], string[TARGET:], flight.string_begin_ns, flight.string_end_ns)


@njit(error_model="numpy", allocates=False)
def string_energy(flight: np.record) -> float:
    """Present energy of the string [J]; 0 without a string."""
    if not flight.tied:
        return 0.0
    string = flight.string
    rx, ry, rz = arm(flight.body, string[KNOT], string[KNOT + 1], string[KNOT + 2])
    (ex, ey, ez), _ = _free_end(flight)
    return energy_of(span_of(rx, ry, rz, flight.row, ex, ey, ez), string[K], string[REST], string[PUSHES] != 0.0)


@njit(error_model="numpy", allocates=False)
def _will_release(flight: np.record, timeout_ns: int) -> None:
    """Note that a target came now, after which the string is released on timeout; 0 for no timeout."""
    flight.string_last_ns = flight.now_ns
    flight.string_release_ns = flight.now_ns + timeout_ns if timeout_ns != 0 else NEVER


@njit(error_model="numpy", allocates=False)
def tie(scene: np.record, flight: np.record, target: Vector3, timeout_ns: int, mass: float) -> None:
    """Tie the string where it is to be tied, its free end at ``target`` (3,) [m, world] at once. mass: as for
    ``_take_spring``.
    """
    string = flight.string
    for k in range(3):
        string[KNOT + k] = flight.string_attach[k]
        string[ORIGIN + k] = string[TARGET + k] = target[k]
    flight.tied = True
    flight.string_begin_ns = flight.string_end_ns = flight.now_ns
    _will_release(flight, timeout_ns)
    _take_spring(scene, flight, mass)


@njit(error_model="numpy", allocates=False)
def _lead(flight: np.record, target: Vector3, timeout_ns: int) -> None:
    """Move the free end to another target (3,) in the time since the last one, but at most RAMP_NS."""
    string, now_ns = flight.string, flight.now_ns
    (ex, ey, ez), _ = _free_end(flight)
    string[ORIGIN], string[ORIGIN + 1], string[ORIGIN + 2] = ex, ey, ez
    for k in range(3):
        string[TARGET + k] = target[k]
    flight.string_begin_ns = now_ns
    flight.string_end_ns = now_ns + min(now_ns - flight.string_last_ns, RAMP_NS)
    _will_release(flight, timeout_ns)


@njit(error_model="numpy", allocates=False)
def _pulls_within_limits(flight: np.record, refusal: np.record) -> bool:
    """Whether the string's pull stays within MAX_ACCELERATION. Both ends of the free end's path count, not only its
    current position.
    """
    string = flight.string
    rx, ry, rz = arm(flight.body, string[KNOT], string[KNOT + 1], string[KNOT + 2])
    farthest = 0.0
    for end in (TARGET, ORIGIN):
        x, y, z = span_of(rx, ry, rz, flight.row, string[end], string[end + 1], string[end + 2])
        farthest = max(farthest, abs(x), abs(y), abs(z))
    frequency = math.sqrt(string[K] / flight.string_mass)
    if frequency * frequency * farthest <= MAX_ACCELERATION:
        return True
    return refuse(refusal, rf.PULL, 0, string[TARGET], string[TARGET + 1], string[TARGET + 2])


@njit(error_model="numpy", allocates=False)
def _restore(flight: np.record, string: FloatArray, tied: bool, times: tuple[int, int, int, int], mass: float) -> None:
    """Undo a change of the string."""
    copy_numbers(string, flight.string)
    flight.tied, flight.string_mass = tied, mass
    flight.string_begin_ns, flight.string_end_ns = times[0], times[1]
    flight.string_last_ns, flight.string_release_ns = times[2], times[3]


@njit(error_model="numpy", allocates=False)
def _times(flight: np.record) -> tuple[int, int, int, int]:
    return flight.string_begin_ns, flight.string_end_ns, flight.string_last_ns, flight.string_release_ns


@njit(error_model="numpy", allocates=False)
def move_string(scene: np.record, flight: np.record, target: Vector3, refusal: np.record) -> bool:
    """Move the free end to ``target`` (3,) [m, world], and tie the string if it isn't tied."""
    before = local_numbers(STRING)
    copy_numbers(flight.string, before)
    tied, times, mass = flight.tied, _times(flight), flight.string_mass
    if tied:
        _lead(flight, target, flight.string_timeout_ns)
    else:
        if not follows_rates(scene, flight.body, True, flight.string_attach, refusal):
            return False
        if not begins_clear(scene, flight.body, flight.row, flight.string_attach, target, refusal):
            return False
        tie(scene, flight, target, flight.string_timeout_ns, 0.0)
    if _pulls_within_limits(flight, refusal):
        return True
    _restore(flight, before, tied, times, mass)
    return False


@njit(error_model="numpy", allocates=False)
def mesh_point_of(axes: float, point: Vector3, flight: np.record, found: Vector3) -> None:
    """Write a point (3,) in these axes into ``found`` (3,) in mesh coordinates."""
    x, y, z, body, row = point[0], point[1], point[2], flight.body, flight.row
    if axes == OF_WORLD:
        x, y, z = to_body_axes(row, x - row[0], y - row[1], z - row[2])
    if axes != MESH_AXES:
        c, s = COM, BODY_SCALE
        x, y, z = (x + body[c]) / body[s], (y + body[c + 1]) / body[s + 1], (z + body[c + 2]) / body[s + 2]
    found[0], found[1], found[2] = x, y, z


@njit(error_model="numpy", allocates=False)
def move_knot(
    scene: np.record,
    flight: np.record,
    axes: float,
    point: Vector3,
    vertices: FloatArray,
    triangles: Triangles,
    refusal: np.record,
) -> bool:
    """Move the knot to the point of the surface nearest to ``point`` (3,) in these axes; a tied string stays tied, and
    its stiffness and damping are computed anew. Without triangles the point itself is taken.
    """
    attach, before = local_numbers(3), local_numbers(STRING)
    mesh_point_of(axes, point, flight, attach)
    if triangles.shape[0] > 0:
        foot = local_numbers(3)
        nearest_point(vertices, triangles, attach, foot)
        copy_numbers(foot, attach)
    if flight.tied:
        end = local_numbers(3)
        (end[0], end[1], end[2]), _ = _free_end(flight)
        if not follows_rates(scene, flight.body, True, attach, refusal):
            return False
        if not begins_clear(scene, flight.body, flight.row, attach, end, refusal):
            return False
        copy_numbers(flight.string, before)
        mass = flight.string_mass
        copy_numbers(attach, flight.string[KNOT : KNOT + 3])
        _take_spring(scene, flight, 0.0)
        if not _pulls_within_limits(flight, refusal):
            _restore(flight, before, True, _times(flight), mass)
            return False
    copy_numbers(attach, flight.string_attach)
    return True


@njit(error_model="numpy", allocates=False)
def same_vector(a: Vector3, b: Vector3) -> bool:
    """Whether all three numbers are the same."""
    return bool(a[0] == b[0] and a[1] == b[1] and a[2] == b[2])


@njit(error_model="numpy", allocates=False)
def _alike(a: BodyRow, b: BodyRow) -> bool:
    """Whether two bodies (BODY,) are the same but for rounding: which of two ways made their numbers doesn't count."""
    length, inertia = ALIKE * (a[LENGTH] + abs(a[COM]) + abs(a[COM + 1]) + abs(a[COM + 2])), ALIKE * a[MOMENTS + 2]
    same = bool(abs(a[MASS] - b[MASS]) <= ALIKE * a[MASS])
    for k in range(3):
        same = same and abs(a[COM + k] - b[COM + k]) <= length and a[BODY_SCALE + k] == b[BODY_SCALE + k]
    for k in range(9):
        same = same and abs(a[INERTIA + k] - b[INERTIA + k]) <= inertia
    return same


@njit(error_model="numpy", allocates=False)
def change_string(old: np.record, new: np.record, flight: np.record, old_body: BodyRow) -> None:
    """Apply changed parameters or a changed body. A change of ``string.attached`` itself ties or releases the string.
    The flight has the new body and timeout already.
    """
    same_knot = same_vector(old.string_attach, new.string_attach)
    if not same_knot:
        copy_numbers(new.string_attach, flight.string_attach)
    if new.string_attached != old.string_attached:
        flight.tied = False
        if new.string_attached:
            tie(new, flight, new.string_target, 0, 0.0)
        return
    if not flight.tied:
        return
    copy_numbers(flight.string_attach, flight.string[KNOT : KNOT + 3])
    timeout_ns, holds = flight.string_timeout_ns, new.string_attached
    if not same_vector(old.string_target, new.string_target):
        # One that parameters tie has no timeout.
        _lead(flight, new.string_target, 0 if holds else timeout_ns)
    if old.string_timeout != new.string_timeout and not (holds and flight.string_release_ns == NEVER):
        release_ns = max(flight.string_last_ns + timeout_ns, flight.now_ns)
        flight.string_release_ns = release_ns if timeout_ns != 0 else NEVER
    same = same_knot and old.string_stiffness == new.string_stiffness and old.string_frequency == new.string_frequency
    same = same and old.string_damping_ratio == new.string_damping_ratio
    same = same and old.string_rest_length == new.string_rest_length and old.string_bilateral == new.string_bilateral
    # Each change of parameters makes a new body, mostly with the same numbers.
    if not (same and _alike(old_body, flight.body)):
        _take_spring(new, flight, 0.0)
