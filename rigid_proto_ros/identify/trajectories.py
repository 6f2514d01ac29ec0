# SPDX-License-Identifier: MIT
"""Many bodies through one shooting segment in one compiled call: the same flight that simulations,
replays and sweeps advance with.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.compilation import copy_numbers, copy_record, exported, local_matrix, local_numbers, new_record, njit
from ..base.rotation import rotate_inverse
from ..base.simd import aligned
from ..base.vectors import BoolArray, FloatArray, IntArray, Records
from ..mass.closed_form import given_mass
from ..motion.body import BodyRow, fill_body
from ..motion.integrators.stepping import ROOM
from ..motion.problem import PROBLEM, VARIABLES
from ..simulation import flight as fl
from ..simulation.commands import NO_SLOT
from ..simulation.flight import EVENT, FLIGHT, LOAD_ROW
from ..simulation.record import EXPLICIT, SCENE, begin_with_body, explicit_tensor
from ..simulation.refusals import AUTO, REFUSAL

ACCURACY = 1e-11
"""Local error rate: differences over steps of 2e-6 then keep five digits, more than an estimate needs."""

# A row of what is known at a sample: the state (13,), and
STATE = 13
SPECIFIC_FORCE = 13  # (3,) at the COM: acceleration without gravity [m/s², body axes]
ANGULAR_ACCELERATION = 16  # (3,) [rad/s², body axes]
SAMPLE = 19


@dataclass(frozen=True)
class Wrenches:
    """What acts in a segment: times (c, 3) and loads (c, LOAD) as simulation/flight.py takes them, from
    the segment's start.
    """

    commands: IntArray
    loads: FloatArray

    @cached_property
    def edges_ns(self) -> IntArray:
        """When loads begin and end, ascending."""
        return np.sort(np.concatenate([self.commands[:, 0], self.commands[:, 0] + self.commands[:, 1]]))


def blank_scenes(count: int) -> Records:
    """Scenes (count,), SCENE, of a body given by numbers, all of them 0, without ballast, string or mesh."""
    scenes = np.zeros(count, SCENE)
    scenes["scale"], scenes["inertia_model"], scenes["integrator"] = 1.0, EXPLICIT, AUTO
    scenes["step"], scenes["accuracy"], scenes["gyroscopic"] = 0.001, ACCURACY, True
    scenes["initial_orientation_xyzw"][:, 3] = 1.0
    return scenes


@njit(error_model="numpy", allocates=False)
def _make_body(scene: np.record, body: BodyRow) -> bool:
    """Fill the row of a body (BODY,); one that breaks A + B >= C may be met on the way to one that doesn't."""
    given, com, inertia = local_matrix(3, 3), local_numbers(3), local_matrix(3, 3)
    moments, axes = local_numbers(3), local_matrix(3, 3)
    explicit_tensor(scene, given)
    mass, center = scene.explicit_inertia_mass, scene.explicit_inertia_center_of_mass
    given_mass(mass, center, given, scene.scale, scene.ballast[:0], com, inertia, moments, axes)
    fill_body(mass, com, inertia, moments, axes, scene.scale, body)
    return bool(moments[0] > 0.0 and math.isfinite(moments[2]) and mass > 0.0)


@exported(
    *([SCENE], "f8[:,:]", "i8[:]", "i8[:,:]", "f8[:,:]", [FLIGHT], [LOAD_ROW], [EVENT], "f8[:]", [PROBLEM], "f8[:]"),
    *(REFUSAL, "f8[:,:,:]", "i8[:]"),
    nogil=True,
)
def fly_samples(
    scenes: Records,
    starts: FloatArray,
    times_ns: IntArray,
    commands: IntArray,
    loads: FloatArray,
    flights: Records,
    rows: Records,
    events: Records,
    room: FloatArray,
    problem: Records,
    variables: FloatArray,
    refusal: np.record,
    samples: FloatArray,
    good: IntArray,
) -> None:
    """Each of scenes (n,), SCENE, from its start (13,) through times_ns (m,) ascending from 0: samples (n, m, SAMPLE);
    good (n,) whether it came through. flights (2,): the first one zeros; rows: with room for all commands.
    """
    count, flight = commands.shape[0], flights[1]
    for i in range(scenes.shape[0]):
        good[i] = 0
        copy_record(flights[0], flight)
        if not (_make_body(scenes[i], flight.body) and begin_with_body(scenes[i], flight, refusal)):
            continue
        copy_numbers(starts[i], flight.row)
        copy_numbers(flight.row, flight.start)
        for c in range(count):
            row = rows[c]
            row.at_ns, row.duration_ns, row.kind, row.slot = commands[c, 0], commands[c, 1], commands[c, 2], NO_SLOT
            copy_numbers(loads[c], row.load)
        flight.due_end = count
        fl.begin_segment(flight, rows, room)
        good[i] = 1
        for k in range(times_ns.shape[0]):
            if fl.fly(flight, rows, events, room, times_ns[k]) != fl.REACHED:
                good[i] = 0
                break
            sample = samples[i, k]
            copy_numbers(flight.row, sample[:STATE])
            rates = fl.accelerations_now(flight, problem, variables)
            g, q = scenes[i].gravity, sample[3:7]
            felt = rotate_inverse(q[0], q[1], q[2], q[3], rates[0] - g[0], rates[1] - g[1], rates[2] - g[2])
            for j in range(3):
                sample[SPECIFIC_FORCE + j], sample[ANGULAR_ACCELERATION + j] = felt[j], rates[3 + j]


def fly_rows(
    scenes: Records, starts: FloatArray, times_ns: IntArray, wrenches: Wrenches
) -> tuple[FloatArray, BoolArray]:
    """Samples (n, m, SAMPLE) of each body in ``scenes`` (n,), SCENE, from its start (13,) at times_ns (m,) ascending
    from 0, and whether it came through (n,).
    """
    samples = np.empty((len(scenes), len(times_ns), SAMPLE))
    good, count = np.zeros(len(scenes), np.int64), len(wrenches.commands)
    rows, events = np.zeros(count + 1, LOAD_ROW), np.zeros(4 * count + 8, EVENT)
    fly_samples(
        scenes,
        starts,
        times_ns,
        wrenches.commands,
        wrenches.loads,
        np.zeros(2, FLIGHT),
        rows,
        events,
        aligned(ROOM),
        np.zeros(1, PROBLEM),
        np.zeros(VARIABLES),
        new_record(REFUSAL),
        samples,
        good,
    )
    return samples, good == 1
