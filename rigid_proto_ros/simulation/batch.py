# SPDX-License-Identifier: MIT
"""Simulation of many scenes that differ in numbers alone, in one compiled call that releases the GIL: flights and
measures.

A scene whose mesh must be looked at again, or that is refused, gives no result: the caller then runs the simulation,
which handles it or reports the error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.compilation import copy_numbers, copy_record, exported, new_record, njit
from ..base.simd import aligned
from ..base.vectors import FloatArray, IntArray, Records
from ..motion.integrators.stepping import ROOM
from . import flight as fl
from .commands import CLEAR
from .flight import EVENT, FLIGHT, LOAD_ROW
from .quantities import CONTEXT, STATE, begin_context, measure_flight, state_of
from .record import MESH, SCENE, begin
from .refusals import REFUSAL


@dataclass
class Batch:
    """rows (n,): SCENE. mesh: MESH of all of them. commands (n or 1, c): LOAD_ROW, resolved loads, in the order in
    which they act.
    """

    rows: Records
    mesh: np.record
    commands: Records


@dataclass
class Results:
    """Results of a batch. status (n,): 1 done, 0 the simulation must run the row. measured (n, k). floors (n,
    FLOOR_KINDS): error floors due to rounding (simulation/flight.py).
    """

    status: IntArray
    measured: FloatArray
    floors: FloatArray


def new_results(rows: int, measures: int) -> Results:
    """Results with the values of rows without a result: status 0, NaN, no error floors."""
    unknown, floors = np.full((rows, measures), np.nan), np.zeros((rows, fl.FLOOR_KINDS))
    return Results(np.zeros(rows, np.int64), unknown, floors)


@njit(error_model="numpy", allocates=False)
def _fly_row(
    scene: np.record,
    mesh: np.record,
    due: Records,
    sample_ns: IntArray,
    flight: np.record,
    loads: Records,
    events: Records,
    room: FloatArray,
    refusal: np.record,
    context: FloatArray,
    states: FloatArray,
) -> bool:
    """Simulate a scene: fills states (m, STATE) at the ascending times sample_ns (m,), before events at those same
    times, and the context (simulation/quantities.py). flight: a record of zeros. Returns False when the simulation must
    run the scene.
    """
    if not begin(scene, mesh, flight, refusal):
        return False
    for c in range(due.shape[0]):
        if due[c].kind < CLEAR and fl.takes(flight, due[c].kind, due[c].load) != fl.DONE:
            return False
        copy_record(due[c], loads[c])
    state_of(scene, flight, states[0])
    begin_context(states[0], context)
    fl.begin_segment(flight, loads, room)
    for sample in range(sample_ns.shape[0]):
        while flight.due_end < due.shape[0] and due[flight.due_end].at_ns < sample_ns[sample]:
            flight.due_end += 1
        if fl.fly(flight, loads, events, room, sample_ns[sample]) != fl.REACHED:
            return False
        state_of(scene, flight, states[sample])
    return True


@exported(
    *([SCENE], MESH, [LOAD_ROW], "i8", [SCENE], MESH, [LOAD_ROW], "i8", "b1", "i8[:]", "f8[:,:]"),
    *("i8[:]", "f8[:,:]", "f8[:,:]", [FLIGHT], [LOAD_ROW], [EVENT], "f8[:]", REFUSAL, "f8[:]", "f8[:,:]", "f8[:,:]"),
    nogil=True,
)
def fly_scenes(
    rows: Records,
    mesh: np.record,
    commands: Records,
    command_step: int,
    references: Records,
    reference_mesh: np.record,
    reference_commands: Records,
    reference_step: int,
    has_references: bool,
    sample_ns: IntArray,
    measures: FloatArray,
    status: IntArray,
    measured: FloatArray,
    floors: FloatArray,
    flights: Records,
    loads: Records,
    events: Records,
    room: FloatArray,
    refusal: np.record,
    context: FloatArray,
    states: FloatArray,
    others: FloatArray,
) -> None:
    """Simulate all scenes of a batch, each together with the same one of the references if there are any. The commands
    of all scenes follow each other, so many for each; with a step of 0 all have the same. flights (2,): the first one
    zeros.
    """
    flight, count, other = flights[1], commands.shape[0], reference_commands.shape[0]
    if command_step != 0:
        count = command_step
    if reference_step != 0:
        other = reference_step
    for i in range(status.shape[0]):
        if has_references:
            copy_record(flights[0], flight)
            first = i * reference_step
            due = reference_commands[first : first + other]
            scene = references[i]
            if not _fly_row(
                scene, reference_mesh, due, sample_ns, flight, loads, events, room, refusal, context, others
            ):
                continue
        copy_record(flights[0], flight)
        first = i * command_step
        due = commands[first : first + count]
        if not _fly_row(rows[i], mesh, due, sample_ns, flight, loads, events, room, refusal, context, states):
            continue
        status[i] = 1
        copy_numbers(flight.floors, floors[i])
        fl.note_floors(flight, floors[i])
        measure_flight(measures, states, others, sample_ns, context, measured[i])


def fly_rows(
    batch: Batch,
    references: Batch | None,
    sample_ns: IntArray,
    measures: FloatArray,
) -> Results:
    """Simulate all rows, each with its reference if there are any; rows that can't be simulated here have status 0.

    sample_ns (m,) ascending, measures (j, MEASURE): see simulation/quantities.py.
    """
    sides = (batch, batch if references is None else references)
    results = new_results(len(batch.rows), len(measures))
    most = max(side.commands.shape[1] for side in sides) + 1
    flown: Any = fly_scenes
    arguments: list[Any] = []
    for side in sides:
        step = side.commands.shape[1] if len(side.commands) > 1 else 0
        arguments += [side.rows, side.mesh, np.ascontiguousarray(side.commands).reshape(-1), step]
    loads, events = np.zeros(most, LOAD_ROW), np.zeros(4 * most + 4, EVENT)
    states, others = (np.zeros((len(sample_ns), STATE)) for _ in range(2))
    flown(
        *arguments,
        references is not None,
        sample_ns,
        measures,
        results.status,
        results.measured,
        results.floors,
        np.zeros(2, FLIGHT),
        loads,
        events,
        aligned(ROOM),
        new_record(REFUSAL),
        np.zeros(CONTEXT),
        states,
        others,
    )
    return results
