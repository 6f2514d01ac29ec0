# SPDX-License-Identifier: MIT
"""Many bodies through one shooting segment in one compiled call: the same flight that simulations,
replays and sweeps advance with.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numba import from_dtype, int64, types

from ..base.compilation import njit
from ..base.records import copy_numbers
from ..base.rotation import quaternion_of_axes, rotate_inverse
from ..mass.tensor import principal_axes_kernel
from ..motion import body as of_body
from ..motion import loads as ld
from ..motion.integrators.auto import AUTO
from ..motion.integrators.series_steps import degree_for
from ..motion.integrators.stepping import METHOD, method_table, provide_kernel, workspace_size
from ..motion.problem import ENVIRONMENT, begin_body
from ..simulation import flight as fl
from ..simulation.commands import NO_SLOT

ACCURACY = 1e-11
"""Local error rate: differences over steps of 1e-5 then keep five digits, more than an estimate needs."""

# A row of a body to fly: what of it varies.
MASS = 0
COM = 1  # (3,) [m, tracked frame]
INERTIA = 4  # (9,) [kg m²]
GRAVITY = 13  # (3,) [m/s²]
LINEAR_DAMPING, ANGULAR_DAMPING = 16, 17
START = 18  # (13,) state of the COM at the segment's start
FLOWN = 31

# A row of what is known at a sample.
STATE = 0  # (13,)
SPECIFIC_FORCE = 13  # (3,) at the COM: acceleration without gravity [m/s², body axes]
ANGULAR_ACCELERATION = 16  # (3,) [rad/s², body axes]
SAMPLE = 19

DONE = -1


@dataclass(frozen=True)
class Wrenches:
    """What acts in a segment: times (c, 3) and loads (c, LOAD) as simulation/flight.py takes them, from
    the segment's start.
    """

    commands: np.ndarray
    loads: np.ndarray

    @cached_property
    def edges_ns(self) -> np.ndarray:
        """When loads begin and end, ascending."""
        return np.sort(np.concatenate([self.commands[:, 0], self.commands[:, 0] + self.commands[:, 1]]))


@njit(cache=True, error_model="numpy")
def _make_body(flown: np.ndarray, body: np.ndarray) -> bool:
    """Fill ``body`` (BODY,) from a row; whether a body can have it."""
    inertia = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            inertia[i, j] = flown[INERTIA + 3 * i + j]
    moments, axes = principal_axes_kernel(inertia)
    body[of_body.MASS] = flown[MASS]
    quaternion_of_axes(axes, body[of_body.QUATERNION : of_body.QUATERNION + 4])
    for k in range(3):
        body[of_body.COM + k] = flown[COM + k]
        body[of_body.MOMENTS + k] = moments[k]
        body[of_body.BODY_SCALE + k] = 1.0
        for j in range(3):
            body[of_body.INERTIA + 3 * k + j] = inertia[k, j]
            body[of_body.AXES + 3 * k + j] = axes[k, j]
    body[of_body.LENGTH] = 1.0
    return bool(moments[0] > 0.0 and np.isfinite(moments[2]) and flown[MASS] > 0.0)


@njit(cache=True, error_model="numpy")
def _rates(flown: np.ndarray, body: np.ndarray, sums: np.ndarray, row: np.ndarray, sample: np.ndarray) -> None:
    """What an accelerometer at the COM feels, and ω', from the loads that act: both from the equations of motion."""
    qx, qy, qz, qw = row[3], row[4], row[5], row[6]
    wx, wy, wz = row[10], row[11], row[12]
    W, B, T, U, M = ld.FORCE_WORLD, ld.FORCE_BODY, ld.TORQUE_WORLD, ld.TORQUE_BODY, ld.MOMENT
    c, d = flown[LINEAR_DAMPING], flown[ANGULAR_DAMPING]
    force = (sums[W] - c * row[7], sums[W + 1] - c * row[8], sums[W + 2] - c * row[9])
    fx, fy, fz = rotate_inverse(qx, qy, qz, qw, force[0], force[1], force[2])
    m = flown[MASS]
    sample[SPECIFIC_FORCE] = (fx + sums[B]) / m
    sample[SPECIFIC_FORCE + 1] = (fy + sums[B + 1]) / m
    sample[SPECIFIC_FORCE + 2] = (fz + sums[B + 2]) / m
    tx, ty, tz = rotate_inverse(qx, qy, qz, qw, sums[T], sums[T + 1], sums[T + 2])
    _, m01, m02 = rotate_inverse(qx, qy, qz, qw, sums[M], sums[M + 1], sums[M + 2])
    m10, _, m12 = rotate_inverse(qx, qy, qz, qw, sums[M + 3], sums[M + 4], sums[M + 5])
    m20, m21, _ = rotate_inverse(qx, qy, qz, qw, sums[M + 6], sums[M + 7], sums[M + 8])
    I = of_body.INERTIA
    lx = body[I] * wx + body[I + 1] * wy + body[I + 2] * wz
    ly = body[I + 3] * wx + body[I + 4] * wy + body[I + 5] * wz
    lz = body[I + 6] * wx + body[I + 7] * wy + body[I + 8] * wz
    tx += sums[U] + (m12 - m21) - d * wx - (wy * lz - wz * ly)
    ty += sums[U + 1] + (m20 - m02) - d * wy - (wz * lx - wx * lz)
    tz += sums[U + 2] + (m01 - m10) - d * wz - (wx * ly - wy * lx)
    x, y, z = of_body.angular_acceleration(body, tx, ty, tz)
    sample[ANGULAR_ACCELERATION], sample[ANGULAR_ACCELERATION + 1], sample[ANGULAR_ACCELERATION + 2] = x, y, z


def _fly_all(
    flown: np.ndarray,
    times_ns: np.ndarray,
    commands: np.ndarray,
    loads: np.ndarray,
    degree: int,
    tables: tuple,
    samples: np.ndarray,
    good: np.ndarray,
) -> int:
    """Each row of flown (n, FLOWN) through times_ns (m,) ascending from 0: samples (n, m, SAMPLE); good (n,) whether it
    came through. tables: methods, one flight, loads with room for all commands, events and workspace, as
    simulation/flight.py takes them.

    Returns DONE, or the number of the method that must be compiled first.
    """
    methods, flights, rows, events, room = tables
    count, flight = commands.shape[0], flights[0]
    body, environment = np.zeros(of_body.BODY), np.zeros(1, ENVIRONMENT)[0]
    for i in range(flown.shape[0]):
        own = flown[i]
        good[i] = 0
        if not _make_body(own, body):
            continue
        fl.begin_flight(flight)
        flight.method, flight.chooses, flight.step_ns = -1, True, 1_000_000
        flight.timeout_ns, flight.poke_ns = 0, 0
        copy_numbers(own[START:], flight.row)
        copy_numbers(flight.row, flight.start)
        copy_numbers(body, flight.body)
        for k in range(3):
            environment.gravity[k] = own[GRAVITY + k]
        environment.linear_damping, environment.angular_damping = own[LINEAR_DAMPING], own[ANGULAR_DAMPING]
        begin_body(flight.common, body, environment, 1.0)
        flight.accuracy, flight.degree = ACCURACY, degree
        for c in range(count):
            row = rows[c]
            row.at_ns, row.duration_ns, row.kind, row.slot = commands[c, 0], commands[c, 1], commands[c, 2], NO_SLOT
            copy_numbers(loads[c], row.load)
        flight.due_end = count
        fl.begin_segment(flight, rows, methods, room)
        good[i] = 1
        for k in range(times_ns.shape[0]):
            came = fl.fly(flight, rows, events, methods, room, times_ns[k])
            if came == fl.NO_KERNEL:
                return int(flight.method)
            if came != fl.REACHED:
                good[i] = 0
                break
            copy_numbers(flight.row, samples[i, k, :13])
            _rates(own, body, flight.sums, flight.row, samples[i, k])
    return DONE


@cache
def _compiled() -> tuple[Callable[..., int], np.ndarray, int]:
    """``_fly_all`` compiled, or loaded from the cache, the table of the methods, and the degree of their series."""
    flat, table, cube = types.float64[:, ::1], types.int64[:, ::1], types.float64[:, :, ::1]
    records = tuple(from_dtype(kind)[::1] for kind in (METHOD, fl.FLIGHT, fl.LOAD_ROW, fl.EVENT))
    tables = types.Tuple((*records, types.float64[::1]))
    signature = int64(flat, types.int64[::1], table, flat, int64, tables, cube, types.int64[::1])
    degree = degree_for(ACCURACY)
    methods = method_table(AUTO, degree)
    return njit(signature, cache=True, nogil=True, error_model="numpy")(_fly_all), methods, degree


def fly_rows(flown: np.ndarray, times_ns: np.ndarray, wrenches: Wrenches) -> tuple[np.ndarray, np.ndarray]:
    """Samples (n, m, SAMPLE) of each row of ``flown`` (n, FLOWN) at times_ns (m,) ascending from 0, and
    whether it came through (n,).
    """
    kernel, methods, degree = _compiled()
    samples = np.empty((len(flown), len(times_ns), SAMPLE))
    good = np.zeros(len(flown), np.int64)
    count, room = len(wrenches.commands), np.zeros(max(1, workspace_size(methods)))
    rows, events = np.zeros(count + 1, fl.LOAD_ROW), np.zeros(4 * count + 8, fl.EVENT)
    tables = methods, np.zeros(1, fl.FLIGHT), rows, events, room
    while True:
        wanted = kernel(flown, times_ns, wrenches.commands, wrenches.loads, degree, tables, samples, good)
        if wanted == DONE:
            return samples, good == 1
        provide_kernel(AUTO, methods, wanted)
