# SPDX-License-Identifier: MIT
"""Many flights in one compiled call: ``Simulation.advance`` for bodies whose commands are all known beforehand.

Segments begin and end where the simulation's do, the problem of each is made by the same operations in the same order, and
the same compiled kernels step it: so every state has the simulation's bits, and no Python is left between two segments. It
carries wrenches, pokes, impulses and their timeouts; a string, rays and parameter changes in flight are the simulation's.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
from numba import boolean, float64, int64, types
from numba.core.errors import NumbaExperimentalFeatureWarning

from . import batch_body as b
from . import problem as pr
from .acting import NEVER
from .compilation import njit
from .integrators import control as ctl
from .integrators import motion_series, taylor
from .integrators.auto import ANY_LOADS, FREE, STEADY, STIFF, TURNING_LOADS, kind_of_segment
from .integrators.integrator import MAX_SPEED
from .integrators.series_steps import rows
from .integrators.stiff_steps import STAGE_ROWS
from .loads import FORCE_BODY, FORCE_WORLD, LOADS_SIZE, MAX_ACCELERATION, MOMENT, TORQUE_BODY, TORQUE_WORLD
from .motion import STORED, to_good_row, to_variables
from .quantities import STATE, begin, which_is_met

# Integers of a command.
AT_NS, DURATION_NS, KIND = range(3)
"""DURATION_NS −1: as long as the setting for pokes says."""
HELD, PULSE, IMPULSE, CLEAR = range(4)

# Numbers of a command's load.
LOAD_AXES = 0
WORLD_AXES, BODY_AXES, NORMAL_AXES = 0.0, 1.0, 2.0
HAS_POINT = 1
POINT = 2  # (3,) [mesh coordinates]
FORCE = 5  # (3,) [N, or N s]
TORQUE = 8  # (3,) [N m, or N m s]
NORMAL = 11  # (3,) inward, of the unscaled mesh
LOAD = 14

AUTO, ONE_EXACT_STEP, FIXED_STEPS = range(3)
"""How an integrator steps."""

_STEADY, _FREE, _FIXED, _TAYLOR, _SERIES, _STIFF, _ASLEEP = range(7)

# That functions as values are experimental is no news for users: a test holds every state to the simulation's bits.
warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning)

STEPS = types.FunctionType(int64(float64[::1], float64[::1], float64, int64))
"""A kernel (y, p, h, n), handed over by its address: it is the machine code that a simulation calls, and compiled only if
it is used."""
ADAPTIVE_STEPS = types.FunctionType(
    int64(float64[::1], float64[::1], float64[::1], float64[::1], float64[:, ::1], int64, boolean)
)
"""A kernel (y, p, control, following, workspace, span_ns, look)."""
KERNELS = types.Tuple((STEPS, STEPS, STEPS, ADAPTIVE_STEPS, ADAPTIVE_STEPS, ADAPTIVE_STEPS))
"""What the methods above call."""


@njit(cache=True, error_model="numpy")
def _arm(load, body, r):
    """From the COM to the point of attack (3,) [m, body axes]."""
    for k in range(3):
        r[k] = load[POINT + k] * body[b.BODY_SCALE + k] - body[b.COM + k] if load[HAS_POINT] != 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def _own_force(load, body, f):
    """The force (3,) in body axes, of a load whose axes turn with the body."""
    if load[LOAD_AXES] == NORMAL_AXES:
        x = load[NORMAL] / body[b.BODY_SCALE]
        y = load[NORMAL + 1] / body[b.BODY_SCALE + 1]
        z = load[NORMAL + 2] / body[b.BODY_SCALE + 2]
        size = math.sqrt(x * x + y * y + z * z)
        f[0], f[1], f[2] = load[FORCE] * (x / size), load[FORCE] * (y / size), load[FORCE] * (z / size)
    else:
        f[0], f[1], f[2] = load[FORCE], load[FORCE + 1], load[FORCE + 2]


@njit(cache=True, error_model="numpy")
def _bound(x, y, z):
    return 1.7320508075688772 * max(abs(x), abs(y), abs(z))


@njit(cache=True, error_model="numpy")
def _within_magnitude(load, body, r):
    _arm(load, body, r)
    force = _bound(load[FORCE], load[FORCE + 1], load[FORCE + 2])
    torque = _bound(load[TORQUE], load[TORQUE + 1], load[TORQUE + 2])
    if load[HAS_POINT] != 0.0:
        torque += _bound(r[0], r[1], r[2]) * force
    return force / body[b.MASS] <= MAX_ACCELERATION and torque / body[b.MOMENTS] <= MAX_ACCELERATION


@njit(cache=True, error_model="numpy")
def _add(load, body, r, f, sums):
    """Add a load's share to the sums (LOADS_SIZE,)."""
    _arm(load, body, r)
    t = TORQUE
    if load[LOAD_AXES] == WORLD_AXES:
        for k in range(3):
            sums[FORCE_WORLD + k] += load[FORCE + k]
            sums[TORQUE_WORLD + k] += load[t + k]
            if load[HAS_POINT] != 0.0:
                for j in range(3):
                    sums[MOMENT + 3 * k + j] += r[k] * load[FORCE + j]
        return
    _own_force(load, body, f)
    x, y, z = load[t], load[t + 1], load[t + 2]
    if load[HAS_POINT] != 0.0:
        x += r[1] * f[2] - r[2] * f[1]
        y += r[2] * f[0] - r[0] * f[2]
        z += r[0] * f[1] - r[1] * f[0]
    for k in range(3):
        sums[FORCE_BODY + k] += f[k]
    sums[TORQUE_BODY] += x
    sums[TORQUE_BODY + 1] += y
    sums[TORQUE_BODY + 2] += z


@njit(cache=True, error_model="numpy")
def _matrix(row, R):
    x, y, z, w = row[3], row[4], row[5], row[6]
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@njit(cache=True, error_model="numpy")
def _impulse(load, body, row, r, f, R):
    """v⁺ = v + J/m, ω⁺ = ω + I⁻¹(H + r × J), in place."""
    _matrix(row, R)
    tx, ty, tz = load[TORQUE], load[TORQUE + 1], load[TORQUE + 2]
    if load[LOAD_AXES] == WORLD_AXES:
        jx, jy, jz = load[FORCE], load[FORCE + 1], load[FORCE + 2]
        for k in range(3):
            f[k] = R[0, k] * jx + R[1, k] * jy + R[2, k] * jz
        hx = R[0, 0] * tx + R[1, 0] * ty + R[2, 0] * tz
        hy = R[0, 1] * tx + R[1, 1] * ty + R[2, 1] * tz
        hz = R[0, 2] * tx + R[1, 2] * ty + R[2, 2] * tz
    else:
        _own_force(load, body, f)
        hx, hy, hz = tx, ty, tz
        jx = R[0, 0] * f[0] + R[0, 1] * f[1] + R[0, 2] * f[2]
        jy = R[1, 0] * f[0] + R[1, 1] * f[1] + R[1, 2] * f[2]
        jz = R[2, 0] * f[0] + R[2, 1] * f[1] + R[2, 2] * f[2]
    if load[HAS_POINT] != 0.0:
        _arm(load, body, r)
        hx, hy, hz = (
            hx + (r[1] * f[2] - r[2] * f[1]),
            hy + (r[2] * f[0] - r[0] * f[2]),
            hz + (r[0] * f[1] - r[1] * f[0]),
        )
    if jx != 0.0 or jy != 0.0 or jz != 0.0:
        row[7] += jx / body[b.MASS]
        row[8] += jy / body[b.MASS]
        row[9] += jz / body[b.MASS]
    if hx != 0.0 or hy != 0.0 or hz != 0.0:
        P = b.AXES
        for k in range(3):
            turned = body[P + k] * hx + body[P + 3 + k] * hy + body[P + 6 + k] * hz
            f[k] = turned / body[b.MOMENTS + k]
        for k in range(3):
            row[10 + k] += body[P + 3 * k] * f[0] + body[P + 3 * k + 1] * f[1] + body[P + 3 * k + 2] * f[2]


@njit(cache=True, error_model="numpy")
def _problem_of_body(body, settings, gyroscopic, p):
    """As ``problem.problem_of_body``."""
    p[:] = 0.0
    for k in range(3):
        p[pr.MOMENTS + k] = body[b.MOMENTS + k]
        p[pr.REFERENCE_ACCELERATION + k] = settings[b.GRAVITY + k]
    for k in range(9):
        p[pr.PRINCIPAL_AXES + k] = body[b.AXES + k]
    for k in range(4):
        p[pr.PRINCIPAL_QUATERNION + k] = body[b.QUATERNION + k]
    p[pr.DAMPING_LINEAR] = settings[b.LINEAR_DAMPING] / body[b.MASS]
    p[pr.DAMPING_ANGULAR] = settings[b.ANGULAR_DAMPING]
    p[pr.GYROSCOPIC] = gyroscopic
    p[pr.REFERENCE_DAMPING] = p[pr.DAMPING_LINEAR]
    p[pr.MASS] = body[b.MASS]
    p[pr.LENGTH] = body[b.LENGTH]


@njit(cache=True, error_model="numpy")
def _any(values, at):
    return values[at] != 0.0 or values[at + 1] != 0.0 or values[at + 2] != 0.0


@njit(cache=True, error_model="numpy")
def _method(stepping, p, y):
    """Which kernel steps a segment with problem p from variables y on."""
    if stepping == ONE_EXACT_STEP:
        return _FREE
    if stepping == FIXED_STEPS:
        return _FIXED
    kind = kind_of_segment(p, y)
    if kind == STEADY:
        return _STEADY
    if kind == FREE:
        return _FREE
    if kind == TURNING_LOADS:
        return _TAYLOR
    if kind == STIFF:
        return _STIFF
    return _SERIES if kind == ANY_LOADS else _ASLEEP


@njit(cache=True, error_model="numpy")
def _commit(method, kernels, y, p, control, following, room, step_ns, span_ns):
    """Commit full steps within ``span_ns``; how far that came [ns], or −1 when one failed."""
    if method == _FIXED:
        wanted = span_ns // step_ns
        if wanted <= 0:
            return 0
        done = kernels[_FIXED](y, p, step_ns * 1e-9, wanted)
        return done * step_ns if done == wanted else -1
    if method == _TAYLOR:
        advanced = kernels[_TAYLOR](y, p, control, following, room[0], span_ns, False)
    elif method == _SERIES:
        advanced = kernels[_SERIES](y, p, control, following, room[1], span_ns, False)
    elif method == _STIFF:
        advanced = kernels[_STIFF](y, p, control, following, room[2], span_ns, False)
    else:
        return 0
    return -1 if control[ctl.FAILED] != 0.0 else int(advanced)


@njit(cache=True, error_model="numpy")
def _reach(method, kernels, y, p, control, following, room, rest_ns):
    """One step of ``rest_ns`` in y, a copy; whether it was good."""
    h = rest_ns * 1e-9
    if method == _ASLEEP:
        return True
    if method == _STEADY:
        return kernels[_STEADY](y, p, h, 1) == 1
    if method == _FREE:
        return kernels[_FREE](y, p, h, 1) == 1
    if method == _FIXED:
        return kernels[_FIXED](y, p, h, 1) == 1
    if method == _TAYLOR:
        return kernels[_TAYLOR](y, p, control, following, room[0], rest_ns, True) == rest_ns
    if method == _STIFF:
        return kernels[_STIFF](y, p, control, following, room[2], rest_ns, True) == rest_ns
    return kernels[_SERIES](y, p, control, following, room[1], rest_ns, True) == rest_ns


@njit(cache=True, error_model="numpy")
def fly(settings, times, body, gyroscopic, stepping, kernels, commands, loads, looks_ns, stops, context, states):
    """One flight: fills states (m, STATE) at looks_ns (m,) ascending, each before what acts at that very time.

    settings (SETTINGS,), times (TIMES,), body (BODY,): core/batch_body.py. commands (n, 3) in the order in which they act
    and loads (n, LOAD). stops (k, 3): the flight ends at the first look at which one holds. context: core/quantities.py,
    filled here. Returns how many looks it reached, and which stop held or −1; 0 looks: the simulation must say what is wrong.
    """
    count = commands.shape[0]
    r, f, R, sums = np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros(LOADS_SIZE)
    for c in range(count):
        if commands[c, KIND] != CLEAR and not _within_magnitude(loads[c], body, r):
            return 0, -1
    row, start = np.zeros(STATE), np.zeros(STATE)
    if not b.initial_row(settings, row):
        return 0, -1
    begin(body[b.MASS], body[b.INERTIA : b.INERTIA + 9], settings[b.GRAVITY : b.GRAVITY + 3], row, context)
    p, y, trial = np.zeros(pr.SIZE), np.zeros(STORED), np.zeros(STORED)
    control, following = np.zeros(ctl.SIZE), np.zeros(STORED)
    degree = times[b.DEGREE]
    room = (
        np.zeros((degree + 1, taylor.COLUMNS)),
        np.zeros((rows(degree), motion_series.COLUMNS)),
        np.zeros((STAGE_ROWS, STORED)),
    )
    common = np.zeros(pr.SIZE)
    _problem_of_body(body, settings, gyroscopic, common)
    pulses, ends_ns = np.zeros(count, np.int64), np.zeros(count, np.int64)
    running, held, held_end_ns, before_held, pending = 0, -1, NEVER, 0, 0
    start_ns, committed_ns, method, fresh = 0, 0, _ASLEEP, True
    for look in range(looks_ns.shape[0]):
        while True:
            if fresh:
                # A new segment: loads summed in the order in which they began to act.
                fresh = False
                sums[:] = 0.0
                for k in range(running + 1):
                    if held >= 0 and k == before_held:
                        _add(loads[held], body, r, f, sums)
                    if k < running:
                        _add(loads[pulses[k]], body, r, f, sums)
                start[:] = row
                p[:] = common
                pr.begin_problem(p, sums, row)
                y[:] = 0.0
                to_variables(row, p, y)
                method = _method(stepping, p, y)
                control[:] = 0.0
                control[ctl.ACCURACY], control[ctl.DEGREE] = settings[b.ACCURACY], degree
                committed_ns = start_ns
            event_ns = commands[pending, AT_NS] if pending < count else NEVER
            if held >= 0:
                event_ns = min(event_ns, held_end_ns)
            for k in range(running):
                event_ns = min(event_ns, ends_ns[k])
            until_ns = min(event_ns, looks_ns[look])
            advanced = _commit(
                method, kernels, y, p, control, following, room, times[b.STEP_NS], until_ns - committed_ns
            )
            if advanced < 0:
                return 0, -1
            committed_ns += advanced
            if until_ns == start_ns:
                row[:] = start
            else:
                trial[:] = y
                rest_ns = until_ns - committed_ns
                if rest_ns > 0 and not _reach(method, kernels, trial, p, control, following, room, rest_ns):
                    return 0, -1
                if not to_good_row(trial, p, (until_ns - start_ns) * 1e-9, row, MAX_SPEED):
                    return 0, -1
            if event_ns >= looks_ns[look]:
                break
            # What ends, then what begins; then a new segment.
            if held >= 0 and held_end_ns <= event_ns:
                held = -1
            kept, kept_before_held = 0, 0
            for k in range(running):
                if ends_ns[k] > event_ns:
                    pulses[kept], ends_ns[kept] = pulses[k], ends_ns[k]
                    kept += 1
                    if k < before_held:
                        kept_before_held += 1
            running, before_held = kept, kept_before_held
            while pending < count and commands[pending, AT_NS] == event_ns:
                kind = commands[pending, KIND]
                load = loads[pending]
                if kind == IMPULSE:
                    _impulse(load, body, row, r, f, R)
                elif kind == PULSE:
                    duration_ns = commands[pending, DURATION_NS]
                    pulses[running] = pending
                    ends_ns[running] = event_ns + (times[b.POKE_NS] if duration_ns < 0 else duration_ns)
                    running += 1
                else:
                    held = -1
                    if kind == CLEAR:
                        running = 0
                    elif _any(load, FORCE) or _any(load, TORQUE):
                        held, before_held = pending, running
                        timeout_ns = times[b.TIMEOUT_NS]
                        held_end_ns = event_ns + timeout_ns if timeout_ns else NEVER
                pending += 1
            start_ns, fresh = event_ns, True
        states[look] = row
        stop = which_is_met(stops, row, context)
        if stop >= 0:
            return look + 1, stop
    return looks_ns.shape[0], -1
