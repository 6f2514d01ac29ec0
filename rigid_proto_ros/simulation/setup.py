# SPDX-License-Identifier: MIT
"""What flies: the numbers of a scene (simulation/record.py) with its mesh, its contacts and its thrusters, checked; and
what its body and integrator can take: commands are refused before they act where that is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..base.compilation import new_record, place_of
from ..base.errors import CommandRefused, InputError, TensorError
from ..base.vectors import Points, StateRow, Triangles, Vector, Vector3
from ..mass import INERTIA_MODELS
from ..mass.properties import scale_vector
from ..mass.tensor import check_tensor
from ..mass.walls import refused_walls
from ..motion.body import LENGTH, Body
from ..motion.integrators import INTEGRATORS, check_supported
from ..motion.integrators.integrator import Integrator
from ..motion.loads import STRING, needs_of_load, packed_load, unresolved
from ..motion.surface import Surface
from . import refusals as rf
from .commands import IMPULSE, Command, MoveString, ThrusterCommand, WrenchCommand
from .effects import check_load
from .flight import FLIGHT
from .record import EXPLICIT, MESH, begin, out_of_bounds
from .refusals import REFUSAL, needs_in, refused_command
from .thrusters import Thruster

NO_POINTS: Points = np.zeros((0, 3))
NO_TRIANGLES: Triangles = np.zeros((0, 3), np.int64)

Provider = Callable[[str, Vector3], np.record]
"""MESH with the moments of the model of this name at a scale (3,); raises MeshError."""


@dataclass(frozen=True, eq=False)
class Setup:
    """scene: a record SCENE, and mesh: a record MESH, neither ever modified. surface: of the mesh, or None.
    mesh_sha256: equal values mean the same mesh, so that at equal scales a change of COM moves the COM and not the
    mesh. contacts: mesh coordinates by name. thrusters: by name, in its order. flight: FLIGHT at time 0, before its
    first segment, ``integers`` its memory and ``initial`` (13,) its state row. warnings: about the tensor.
    """

    scene: np.record
    mesh: np.record
    surface: Surface | None
    mesh_sha256: str
    contacts: Mapping[str, Vector]
    thrusters: Mapping[str, Thruster]
    flight: np.record
    integers: memoryview
    initial: StateRow
    body: Body
    integrator: Integrator
    warnings: tuple[str, ...] = ()

    @property
    def gravity(self) -> Vector3:
        """(3,) [m/s², world]."""
        gravity: Vector3 = self.scene.gravity
        return gravity

    @property
    def inertia_model(self) -> str:
        """How mass is distributed: one of INERTIA_MODELS."""
        return INERTIA_MODELS[self.scene.inertia_model]

    def stays_in_place_of(self, before: Setup) -> bool:
        """Whether it has the same mesh at the same size, which then stays where it is when the COM moves within it."""
        return self.mesh_sha256 == before.mesh_sha256 and bool((self.scene.scale == before.scene.scale).all())

    @property
    def length(self) -> float:
        """Half the diagonal of the mesh's box as scaled, by which displacement errors are measured; 1 m without a
        mesh.
        """
        return float(self.body.row[LENGTH])

    @property
    def vertices(self) -> Points:
        """Of the surface (n, 3); none without a mesh."""
        return NO_POINTS if self.surface is None else self.surface.vertices

    @property
    def triangles(self) -> Triangles:
        """Of the surface (m, 3); none without a mesh."""
        return NO_TRIANGLES if self.surface is None else self.surface.triangles


_INTEGRATORS = tuple(INTEGRATORS.values())
_INTEGRATOR, _CODE = place_of(FLIGHT, "integrator") // 8, place_of(REFUSAL, "code") // 8


def _numbers_of(field: str) -> slice:
    """Where a field of FLIGHT is in its memory."""
    first = place_of(FLIGHT, field) // 8
    return slice(first, first + FLIGHT[field].itemsize // 8)


_BODY, _ROW = _numbers_of("body"), _numbers_of("row")


def make_setup(
    scene: np.record,
    mesh: np.record | None = None,
    surface: Surface | None = None,
    mesh_sha256: str = "",
    contacts: Mapping[str, Vector] | None = None,
    thrusters: Mapping[str, Thruster] | None = None,
    provide: Provider | None = None,
    mesh_name: str = "",
) -> Setup:
    """The setup of a scene; raises InputError or one of its family where there is none. provide: where ``mesh``
    lacks the moments of a model that the scene needs.
    """
    mesh = new_record(MESH) if mesh is None else mesh
    # By their memory: fields of records by name take several times as long.
    memory, noted = np.zeros(FLIGHT.itemsize // 8), np.zeros(REFUSAL.itemsize // 8, np.int64)
    flight: np.record = np.ndarray(1, FLIGHT, memory)[0]
    refusal: np.record = np.ndarray(1, REFUSAL, noted)[0]
    while not begin(scene, mesh, flight, refusal):
        if noted[_CODE] != rf.NO_MOMENTS:
            raise _refused_scene(scene, refusal, mesh_name)
        if provide is None:
            raise InputError("mesh", "a mesh is needed, unless inertia_model is explicit")
        mesh = provide(INERTIA_MODELS[refusal.detail], scene.scale)
    warnings = _tensor_warnings(scene, refusal, mesh_name) if noted[_CODE] == rf.TENSOR else ()
    integers, body, initial = memory.view(np.int64).data, memory[_BODY], memory[_ROW]
    integrator = _INTEGRATORS[integers[_INTEGRATOR]]
    own = (contacts or {}, thrusters or {}, flight, integers, initial, Body(body), integrator, warnings)
    return Setup(scene, mesh, surface, mesh_sha256, *own)


def _refused_scene(scene: np.record, refusal: np.record, mesh_name: str) -> InputError:
    code = refusal.code
    if code == rf.OUT_OF_BOUNDS:
        return out_of_bounds(scene, refusal.detail)
    if code == rf.SCALE:
        try:
            scale_vector(scene.scale.tolist())
        except InputError as error:
            return error
    if code == rf.MASS:
        return InputError("mass", float(refusal.numbers[0]), "density * volume within 1e-300 .. 1e300 kg")
    if code == rf.WALLS:
        return refused_walls(*refusal.numbers.tolist())
    if code == rf.ORIENTATION:
        accepted = "four finite numbers x, y, z, w, not all zero"
        return InputError("initial.orientation_xyzw", scene.initial_orientation_xyzw.tolist(), accepted)
    if code == rf.TENSOR:
        try:
            _tensor_warnings(scene, refusal, mesh_name)
        except TensorError as error:
            return error
    return refused_command(refusal)


def _tensor_warnings(scene: np.record, refusal: np.record, mesh_name: str) -> tuple[str, ...]:
    """Warnings about the tensor of a scene; raises TensorError."""
    inertia = refusal.tensor.reshape(3, 3)
    if scene.inertia_model == EXPLICIT:
        with_ballast = "" if refusal.given else " with ballast"
        return check_tensor(inertia, source=f"explicit_inertia.tensor{with_ballast}")
    model = INERTIA_MODELS[scene.inertia_model]
    try:
        return check_tensor(inertia, source=f"{model} model of {mesh_name}")
    except TensorError as error:
        raise TensorError(f"inertia_model {model}", f"{mesh_name}: {error.received}", error.accepted) from None


# What its body and integrator can take


def check_command(command: Command, setup: Setup) -> bytes:
    """The row of a command's load (LOAD,), resolved on a body of this setup; empty for a ray's, whose point is known
    when it acts, and for what is no load. Raises CommandRefused for what a body of this setup can't take.
    """
    if isinstance(command, WrenchCommand):
        return _load_row(command, setup)
    if isinstance(command, MoveString):
        check_supported(setup.integrator, frozenset({STRING}))
    if isinstance(command, ThrusterCommand):
        check_thrust(command.forces, setup)
    return b""


def packed_of(command: WrenchCommand, setup: Setup) -> tuple[bytes, float]:
    """Row and weight of a command's load (``packed_load``), computed once: it may act many times. Raises
    CommandRefused.
    """
    packed, contacts = command.packed, setup.contacts
    if packed is None or packed[2] is not contacts:
        packed = (*packed_load(command.frame, command.force, command.torque, contacts), contacts)
        command.packed = packed
    return packed[:2]


def _load_row(command: WrenchCommand, setup: Setup) -> bytes:
    row, weight = packed_of(command, setup)
    # What most commands are, in a fraction of the time.
    if weight <= setup.body.light and (setup.integrator.supports_loads or command.frame.impulse):
        return row
    refusal, found = new_record(REFUSAL), bytearray(row)
    load = np.frombuffer(found)
    if not check_load(setup.flight, setup.mesh, setup.vertices, setup.triangles, command.flight_kind, load, refusal):
        raise refused_load(refusal, command, setup)
    return b"" if command.frame.point[0] == "ray" else bytes(found)


def refused_load(refusal: np.record, command: Command, setup: Setup) -> CommandRefused:
    """The error that says why a command was refused."""
    if refusal.code == rf.UNRESOLVED and isinstance(command, WrenchCommand):
        return unresolved(refusal.detail, command.frame, len(setup.vertices))
    return refused_command(refusal)


def check_thrust(forces: tuple[float, ...], setup: Setup) -> None:
    """Raises CommandRefused unless there is a force [N] for each thruster that body and integrator can take."""
    thrusters = setup.thrusters
    if len(forces) != len(thrusters):
        names = ", ".join(thrusters) or "none is declared by thrusters.<name>"
        accepted = f"{len(thrusters)} numbers, one a thruster ({names})"
        raise CommandRefused("thrusters", "thrusters", f"{len(forces)} numbers", accepted)
    if not all(map(math.isfinite, forces)):
        raise CommandRefused("nonfinite", "thrusters", list(forces), "finite numbers")
    needs, refusal = 0, new_record(REFUSAL)
    for thruster, force in zip(thrusters.values(), forces, strict=True):
        # As of an impulse, whose magnitude alone is checked: a thruster that is off now may be on later.
        load = thruster.load(thruster.within(force)).row
        if not check_load(setup.flight, setup.mesh, setup.vertices, setup.triangles, IMPULSE, load, refusal):
            raise refused_command(refusal)
        needs |= needs_of_load(thruster.load(1.0).row)
    check_supported(setup.integrator, needs_in(needs))
