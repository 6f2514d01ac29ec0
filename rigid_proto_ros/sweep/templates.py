# SPDX-License-Identifier: MIT
"""What rows have in common, found once: mesh constants, integrator, and the script as arrays for the
compiled batch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError, MeshError
from ..motion.frames import Frame, parse_frame
from ..motion.integrators import check_supported, integrator_named
from ..motion.integrators.integrator import (
    ANGULAR_DAMPING,
    NO_GYROSCOPIC_TERM,
    STRING,
    Integrator,
    needs_of_load,
)
from ..motion.integrators.taylor_adaptive import degree_for
from ..motion.loads import LOAD, Load, resolve_load
from ..scene.command_codec import ScriptCommand
from ..scene.parameters import Parameters
from ..scene.scenario import BodyMesh, nanoseconds
from ..simulation import batch_body as bb
from ..simulation import flight as fl
from ..simulation.commands import WrenchCommand

FAST = {
    "scale": (bb.SCALE, 3),
    "mass": (bb.BODY_MASS, 1),
    "density": (bb.DENSITY, 1),
    "explicit_inertia.mass": (bb.GIVEN_MASS, 1),
    "explicit_inertia.center_of_mass": (bb.GIVEN_CENTER, 3),
    "explicit_inertia.tensor": (bb.GIVEN_TENSOR, 6),
    "gravity": (bb.GRAVITY, 3),
    "linear_damping": (bb.LINEAR_DAMPING, 1),
    "angular_damping": (bb.ANGULAR_DAMPING, 1),
    "initial.position": (bb.POSITION, 3),
    "initial.orientation_xyzw": (bb.ORIENTATION, 4),
    "initial.linear_velocity": (bb.VELOCITY, 3),
    "initial.angular_velocity": (bb.ANGULAR_VELOCITY, 3),
    "accuracy": (bb.ACCURACY, 1),
    "string.attach": (bb.STRING_ATTACH, 3),
    "string.target": (bb.STRING_TARGET, 3),
    "string.stiffness": (bb.STRING_STIFFNESS, 1),
    "string.frequency": (bb.STRING_FREQUENCY, 1),
    "string.damping_ratio": (bb.STRING_DAMPING_RATIO, 1),
    "string.rest_length": (bb.STRING_REST_LENGTH, 1),
}
"""Parameters that are numbers of a row of settings: where they stand, how many they are."""

TIMES = {"step": bb.STEP_NS, "poke_duration": bb.POKE_NS}
"""Parameters that are whole nanoseconds of a row, at least one."""

MAX_COMMANDS = 2000
"""Of a script in the compiled batch; longer ones are rare, and rows of them are the simulation's."""


class NotBatchable(Exception):
    """The compiled batch can't fly the row; the simulation can, or knows why not."""


@dataclass(frozen=True)
class Script:
    """Commands in the order in which they act: numbers (n, COMMAND) and loads (n, LOAD) of simulation/flight.py
    and motion/loads.py.
    """

    commands: np.ndarray
    loads: np.ndarray


def settings_of(parameters: Parameters) -> np.ndarray:
    """The row of settings (SETTINGS,) of parameters."""
    row, values = np.zeros(bb.SETTINGS), parameters.named()
    for name, (at, count) in FAST.items():
        value = np.ravel(np.asarray(values[name], dtype=float))
        row[at : at + count] = np.repeat(value, 3) if name == "scale" and len(value) == 1 else value
    return row


def times_of(parameters: Parameters) -> np.ndarray:
    """The row of times (TIMES,) of parameters."""
    row = np.zeros(bb.TIMES, np.int64)
    row[bb.STEP_NS] = max(1, nanoseconds(parameters.step))
    row[bb.POKE_NS] = max(1, nanoseconds(parameters.poke_duration))
    row[bb.TIMEOUT_NS] = nanoseconds(parameters.wrench_timeout)
    row[bb.DEGREE] = degree_for(parameters.accuracy)
    return row


def constants_of(parameters: Parameters, body_mesh: BodyMesh | None) -> np.ndarray:
    """What of the mesh and the model doesn't change with a row's settings (CONSTANTS,); raises
    NotBatchable, InputError.
    """
    row = np.zeros(bb.CONSTANTS)
    model = parameters.inertia_model
    row[bb.GYROSCOPIC] = float(parameters.gyroscopic)
    row[bb.TIED], row[bb.BILATERAL] = float(parameters.string.attached), float(parameters.string.bilateral)
    if body_mesh is not None:
        row[bb.HAS_SURFACE] = 1.0
        row[bb.EXTENT : bb.EXTENT + 3] = body_mesh.surface.extent
    if model == "explicit":
        row[bb.MODEL] = bb.EXPLICIT
        return row
    if body_mesh is None:
        raise NotBatchable
    moments = body_mesh.moments.moments(model)
    try:
        row[bb.SOLID_MEASURE] = body_mesh.moments.moments("solid").measure
    except MeshError:
        row[bb.SOLID_MEASURE] = np.nan
    row[bb.MODEL] = bb.SHELL if model == "shell" else bb.ORDINARY
    row[bb.MEASURE] = moments.measure
    places = moments if parameters.inertia_model_com == "model" else body_mesh.moments.moments("solid")
    row[bb.REFERENCE : bb.REFERENCE + 3] = places.reference
    row[bb.CENTER : bb.CENTER + 3] = places.center
    row[bb.CENTER_LOW : bb.CENTER_LOW + 3] = places.center_low
    row[bb.SECOND : bb.SECOND + 6] = moments.second
    return row


def checked_integrator(parameters: Parameters, loads: list[Load]) -> Integrator:
    """The integrator, if it supports these loads; raises NotBatchable."""
    if parameters.string.attached and parameters.initial.string_mass:
        raise NotBatchable
    integrator = integrator_named(parameters.integrator)
    needs = set().union(*map(needs_of_load, loads))
    if not parameters.gyroscopic:
        needs.add(NO_GYROSCOPIC_TERM)
    if parameters.angular_damping:
        needs.add(ANGULAR_DAMPING)
    if parameters.string.attached:
        needs.add(STRING)
    try:
        check_supported(integrator, frozenset(needs))
    except InputError:
        raise NotBatchable from None
    return integrator


class LoadResolver:
    """Resolves the frames of one mesh's commands, each once."""

    def __init__(self, parameters: Parameters, body_mesh: BodyMesh | None) -> None:
        self._contacts = dict(parameters.contacts)
        self._surface = body_mesh.surface if body_mesh else None
        self._known: dict[str, tuple] = {}

    def frame(self, text: str) -> tuple[Frame, Load]:
        """The frame, and a load of no force that acts there; raises InputError, or NotBatchable for a ray."""
        if text not in self._known:
            frame = parse_frame(text, set(self._contacts))
            if frame.point[0] == "ray":
                raise NotBatchable
            nothing = (0.0, 0.0, 0.0)
            load = resolve_load(frame, nothing, nothing, None, self._surface, self._contacts, None)
            if len(self._known) > 100_000:
                self._known.clear()
            self._known[text] = (frame, load)
        return self._known[text]

    def numbers(self, command: ScriptCommand) -> tuple[list[int], np.ndarray, Load | None]:
        """A command's integers, its load's numbers, and what the integrator has to support of it."""
        if command.kind == "clear_wrench":
            return [command.t_ns, -1, fl.CLEAR, fl.NO_SLOT], np.zeros(LOAD), None
        if command.kind not in ("wrench", "poke"):
            raise NotBatchable
        frame, resolved = self.frame(command.frame_id)
        own = WrenchCommand(
            command.kind == "wrench", frame, command.force, command.torque, command.t_ns, command.frame_id
        )
        load = Load(resolved.axes, resolved.mesh_point, command.force, command.torque, resolved.mesh_normal)
        integers = [command.t_ns, own.duration_ns, own.flight_kind, own.slot]
        return integers, load.row, None if frame.impulse else load


def script_of(commands: list[ScriptCommand], resolver: LoadResolver) -> tuple[Script, list[Load]]:
    """Commands, in order of time, as arrays, and the loads that the integrator has to support; raises
    NotBatchable, InputError.
    """
    if len(commands) > MAX_COMMANDS:
        raise NotBatchable
    ordered = [resolver.numbers(command) for command in commands]
    integers = np.array([row for row, _, _ in ordered], np.int64).reshape(-1, fl.COMMAND)
    loads = np.array([row for _, row, _ in ordered]).reshape(-1, LOAD)
    return Script(integers, loads), [load for _, _, load in ordered if load is not None]
