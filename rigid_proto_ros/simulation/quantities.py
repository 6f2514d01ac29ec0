# SPDX-License-Identifier: MIT
"""Scalar quantities of a flight by name, and measures of a flight.

A quantity is a function of a state row (STATE,) and of a context row (CONTEXT,). A state row holds the state, the
string's energy, and the mass, tensor, gravity and flywheel of that moment, since a script may change them in flight.
The context is the state, energy and angular momentum at time 0. A measure is a row (MEASURE,): a kind, the number of a
quantity or difference, and the kind's parameters. It reduces the states at the sample times to one number.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.arithmetic import inverse_tangent_of
from ..base.compilation import copy_numbers, exported, njit
from ..base.rotation import norm, rotate
from ..base.vectors import Attitude, FloatArray, IntArray
from ..motion.body import INERTIA as BODY_INERTIA
from ..motion.body import MASS as BODY_MASS
from ..motion.state import angular_momentum, kinetic_energy
from .flight import FLIGHT, rotor_momentum
from .record import SCENE
from .string_control import string_energy

QUANTITIES = {
    "position.x": "m",
    "position.y": "m",
    "position.z": "m",
    "orientation.x": "",
    "orientation.y": "",
    "orientation.z": "",
    "orientation.w": "",
    "velocity.x": "m/s",
    "velocity.y": "m/s",
    "velocity.z": "m/s",
    "spin.x": "rad/s",
    "spin.y": "rad/s",
    "spin.z": "rad/s",
    "speed": "m/s",
    "spin": "rad/s",
    "distance": "m",
    "turned": "rad",
    "kinetic_energy": "J",
    "potential_energy": "J",
    "energy": "J",
    "energy_drift": "",
    "angular_momentum": "N m s",
    "momentum_turned": "rad",
}
"""Units by name; ``spin.x`` is in body axes, the rest of a state in world axes. ``distance`` and ``turned`` are
relative to the initial state, ``energy_drift`` is |E − E₀|/|E₀|, ``momentum_turned`` the angle between L and L₀;
E₀ and L₀ stay those of the initial body and gravity.
"""

NAMES = tuple(QUANTITIES)
SPEED, SPIN, DISTANCE, TURNED, KINETIC, POTENTIAL, ENERGY, DRIFT, MOMENTUM, MOMENTUM_TURNED = range(13, 23)

DIFFERENCES = {"attitude": "rad", "position": "m", "velocity": "m/s", "spin": "rad/s"}
"""Differences between two states; velocities and spins are compared in world axes."""

STRING_ENERGY, MASS, INERTIA, GRAVITY, ROTOR, STATE = 13, 14, 15, 24, 27, 30
"""Where a state row has, after the state (13,), the string's energy [J], the mass [kg], the tensor (9,) about the
centre of mass in body axes [kg m²], gravity (3,) [m/s², world] and the flywheel's momentum (3,) [N m s, body axes]; and
its length.
"""

START, START_ENERGY, START_MOMENTUM, CONTEXT = 0, 13, 14, 17


@njit(error_model="numpy", allocates=False)
def _momentum(row: FloatArray) -> tuple[float, float, float]:
    return angular_momentum(row, row[INERTIA : INERTIA + 9], row[ROTOR : ROTOR + 3])


@njit(error_model="numpy", allocates=False)
def _kinetic(row: FloatArray) -> float:
    return kinetic_energy(row, row[MASS], row[INERTIA : INERTIA + 9])


@njit(error_model="numpy", allocates=False)
def _potential(row: FloatArray) -> float:
    g = GRAVITY
    fallen = row[g] * row[0] + row[g + 1] * row[1] + row[g + 2] * row[2]
    return float(row[STRING_ENERGY] - row[MASS] * fallen)


@exported("f8[:]", "f8[:]", returns="f8")
def attitude_angle(a: Attitude, b: Attitude) -> float:
    """Angle of the rotation from attitude a (4,) to b (4,), xyzw [rad, 0 to π]."""
    w = a[3] * b[3] + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    x = a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1]
    y = a[3] * b[1] + a[0] * b[2] - a[1] * b[3] - a[2] * b[0]
    z = a[3] * b[2] - a[0] * b[1] + a[1] * b[0] - a[2] * b[3]
    return 2.0 * inverse_tangent_of(norm(x, y, z), abs(w))


@exported(SCENE, FLIGHT, "f8[:]")
def state_of(scene: np.record, flight: np.record, row: FloatArray) -> None:
    """Fill a state row (STATE,) with the present state of a flight and what is in force with it."""
    body = flight.body
    copy_numbers(flight.row, row[:13])
    row[STRING_ENERGY], row[MASS] = string_energy(flight), body[BODY_MASS]
    copy_numbers(body[BODY_INERTIA : BODY_INERTIA + 9], row[INERTIA : INERTIA + 9])
    copy_numbers(scene.gravity, row[GRAVITY : GRAVITY + 3])
    row[ROTOR], row[ROTOR + 1], row[ROTOR + 2] = rotor_momentum(flight, flight.now_ns)


@exported("f8[:]", "f8[:]")
def begin_context(row: FloatArray, context: FloatArray) -> None:
    """Fill the context (CONTEXT,) from the state row (STATE,) at time 0. Energy and angular momentum of a body that has
    none are NaN, and so is their drift.
    """
    copy_numbers(row[:13], context[START : START + 13])
    energy, (lx, ly, lz) = _kinetic(row) + _potential(row), _momentum(row)
    context[START_ENERGY] = energy if energy != 0.0 else math.nan
    spins = lx != 0.0 or ly != 0.0 or lz != 0.0
    context[START_MOMENTUM] = lx if spins else math.nan
    context[START_MOMENTUM + 1], context[START_MOMENTUM + 2] = ly, lz


@exported("i8", "f8[:]", "f8[:]", returns="f8")
def quantity(code: int, row: FloatArray, context: FloatArray) -> float:
    """The quantity NAMES[code] of a state row (STATE,)."""
    if code < 13:
        return float(row[code])
    if code == SPEED:
        return norm(row[7], row[8], row[9])
    if code == SPIN:
        return norm(row[10], row[11], row[12])
    if code == DISTANCE:
        return norm(row[0] - context[START], row[1] - context[START + 1], row[2] - context[START + 2])
    if code == TURNED:
        return attitude_angle(context[START + 3 : START + 7], row[3:7])
    if code == KINETIC:
        return _kinetic(row)
    if code == POTENTIAL:
        return _potential(row)
    if code == ENERGY:
        return _kinetic(row) + _potential(row)
    if code == DRIFT:
        start = context[START_ENERGY]
        return float(abs(_kinetic(row) + _potential(row) - start) / abs(start))
    lx, ly, lz = _momentum(row)
    if code == MOMENTUM:
        return norm(lx, ly, lz)
    ax, ay, az = context[START_MOMENTUM], context[START_MOMENTUM + 1], context[START_MOMENTUM + 2]
    across = norm(ly * az - lz * ay, lz * ax - lx * az, lx * ay - ly * ax)
    return inverse_tangent_of(across, lx * ax + ly * ay + lz * az)


@exported("i8", "f8[:]", "f8[:]", returns="f8")
def difference(code: int, a: FloatArray, b: FloatArray) -> float:
    """The difference number ``code`` of DIFFERENCES between two state rows."""
    if code == 0:
        return attitude_angle(a[3:7], b[3:7])
    if code == 1:
        return norm(a[0] - b[0], a[1] - b[1], a[2] - b[2])
    if code == 2:
        return norm(a[7] - b[7], a[8] - b[8], a[9] - b[9])
    ax, ay, az = rotate(a[3], a[4], a[5], a[6], a[10], a[11], a[12])
    bx, by, bz = rotate(b[3], b[4], b[5], b[6], b[10], b[11], b[12])
    return norm(ax - bx, ay - by, az - bz)


# Measures of a flight

FINAL, LARGEST, SMALLEST, FIRST, FLIPS, DIFFERENCE = range(6)
KIND, CODE, A, B, C, D, MEASURE = range(7)
"""Columns of a measure. FIRST: the quantity is above (A = 1) or below (A = −1) the limit B. FLIPS: A is the margin, B
to D the axis in the body; all zero for the axis of the initial spin.
"""


@njit(error_model="numpy", allocates=False)
def count_flips(measure: FloatArray, states: FloatArray, context: FloatArray) -> float:
    """Number of flips of a body axis: the cosine to its initial direction falls below −margin, then exceeds margin, ...

    The margin (hysteresis) avoids repeated counts of an axis that is nearly perpendicular. NaN without an axis.
    """
    x, y, z = measure[B], measure[C], measure[D]
    if x == 0.0 and y == 0.0 and z == 0.0:
        x, y, z = context[START + 10], context[START + 11], context[START + 12]
    size = norm(x, y, z)
    if not size > 0.0:
        return math.nan
    s = START
    ax, ay, az = rotate(context[s + 3], context[s + 4], context[s + 5], context[s + 6], x / size, y / size, z / size)
    flips, side = 0, 1.0
    for k in range(states.shape[0]):
        q = states[k]
        bx, by, bz = rotate(q[3], q[4], q[5], q[6], x / size, y / size, z / size)
        if side * (ax * bx + ay * by + az * bz) < -measure[A]:
            side = -side
            flips += 1
    return float(flips)


@njit(error_model="numpy", allocates=False)
def _extreme(measure: FloatArray, states: FloatArray, context: FloatArray) -> float:
    sign = 1.0 if measure[KIND] == LARGEST else -1.0
    found = sign * quantity(int(measure[CODE]), states[0], context)
    for k in range(1, states.shape[0]):
        found = max(found, sign * quantity(int(measure[CODE]), states[k], context))
    return sign * found


@njit(error_model="numpy", allocates=False)
def _first(measure: FloatArray, states: FloatArray, context: FloatArray) -> int:
    """Index of the first sample at which the condition of a measure holds, or −1."""
    for k in range(states.shape[0]):
        if measure[A] * (quantity(int(measure[CODE]), states[k], context) - measure[B]) > 0.0:
            return k
    return -1


@exported("f8[:,:]", "f8[:,:]", "f8[:,:]", "i8[:]", "f8[:]", "f8[:]")
def measure_flight(
    measures: FloatArray,
    states: FloatArray,
    others: FloatArray,
    sample_ns: IntArray,
    context: FloatArray,
    out: FloatArray,
) -> None:
    """Fill out (k,) with the measures (k, MEASURE) of a flight.

    states, others (m, STATE): states of the flight and of its reference at sample_ns (m,). An event that didn't happen
    gives NaN.
    """
    last = states.shape[0] - 1
    for j in range(measures.shape[0]):
        measure = measures[j]
        kind, code = int(measure[KIND]), int(measure[CODE])
        out[j] = math.nan
        if kind == FINAL:
            out[j] = quantity(code, states[last], context)
        elif kind in (LARGEST, SMALLEST):
            out[j] = _extreme(measure, states, context)
        elif kind == FIRST:
            first = _first(measure, states, context)
            if first >= 0:
                out[j] = sample_ns[first] * 1e-9
        elif kind == FLIPS:
            out[j] = count_flips(measure, states, context)
        else:
            out[j] = difference(code, states[last], others[last])
