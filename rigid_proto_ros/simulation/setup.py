# SPDX-License-Identifier: MIT
"""Everything that parameters decide about the motion, already checked and in the core's own types; and what its body
and integrator can take: commands are refused before they act where that is known.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from decimal import ROUND_DOWN, Context
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.errors import CommandRefused
from ..base.rotation import length, transposed_times
from ..base.vectors import Records, StateRow, Vector
from ..motion.body import LENGTH, Body
from ..motion.integrators import check_supported
from ..motion.integrators.auto import FASTEST
from ..motion.integrators.integrator import (
    NO_GYROSCOPIC_TERM,
    STRING,
    Integrator,
    needs_of_load,
)
from ..motion.integrators.series_steps import degree_for
from ..motion.integrators.stepping import method_table, workspace_size
from ..motion.loads import Load, light_row, resolve_load
from ..motion.problem import ENVIRONMENT_NEEDS, Environment, begin_body
from ..motion.state import State
from ..motion.string import StringSettings, most_yielding
from ..motion.surface import Surface
from .commands import Command, MoveString, ThrusterCommand, WrenchCommand
from .flight import FLIGHT
from .thrusters import Thruster


class FlightStart(NamedTuple):
    """flight (1,): a record FLIGHT (simulation/flight.py), and its memory as integers. methods: the integrator's table.
    room: of the largest workspace [doubles].
    """

    flight: Records
    integers: memoryview
    methods: Records
    room: int


@dataclass(frozen=True)
class Setup(Environment):
    """geometry: equal values mean the same mesh at the same size, so that a change of COM moves the COM and not the
    mesh. contacts: mesh coordinates by name. wrench_timeout_ns 0 holds for ever. accuracy: local error rate for
    integrators that choose their own steps. initial (13,): the state row at time 0. initial_string_mass [kg]: from what
    stiffness and damping follow of a string that is tied at time 0; 0 for the effective mass of the body as it is then.
    thrusters: by name, in its order.
    """

    body: Body
    inertia_model: str
    surface: Surface | None
    geometry: tuple[object, ...]
    contacts: Mapping[str, tuple[float, float, float]]
    integrator: Integrator
    step_ns: int
    wrench_timeout_ns: int
    poke_duration_ns: int
    initial: StateRow
    accuracy: float = 1e-9
    string: StringSettings = StringSettings()
    initial_string_mass: float = 0.0
    thrusters: Mapping[str, Thruster] = field(default_factory=dict)

    @property
    def length(self) -> float:
        """Half the diagonal of the mesh's box as scaled, by which displacement errors are measured; 1 m
        without a mesh.
        """
        if self.surface is None:
            return 1.0
        diagonal = self.surface.extent * self.body.scale
        return 0.5 * length(diagonal)

    @cached_property
    def flight_start(self) -> FlightStart:
        """What flights under this setup begin with."""
        start, degree = np.zeros(1, FLIGHT), degree_for(self.accuracy)
        flight = start[0]
        flight.row[:] = flight.start[:] = self.initial
        flight.body[:] = self.body.row
        flight.body[LENGTH] = self.length
        begin_body(flight.common, flight.body, self.environment, float(self.gyroscopic))
        flight.accuracy, flight.degree, flight.step_ns = self.accuracy, degree, self.step_ns
        flight.timeout_ns, flight.poke_ns = self.wrench_timeout_ns, self.poke_duration_ns
        flight.chooses = self.integrator.chooses
        # None yet: the first that adapts its steps gets a clean workspace, as every other does.
        flight.method = -1
        methods = method_table(self.integrator, degree)
        integers = start.view(np.uint8).view(np.int64).data
        return FlightStart(start, integers, methods, workspace_size(methods))

    @cached_property
    def needs_of_thrusters(self) -> frozenset[str]:
        """What thrusters ask of the integrator."""
        loads = [thruster.load(1.0) for thruster in self.thrusters.values()]
        return frozenset().union(*map(needs_of_load, loads))


# What its body and integrator can take


def check_command(command: Command, setup: Setup) -> bytes:
    """The row of a command's load, empty for what is none or is found only when it acts; raises CommandRefused for
    what a body of this setup can't take.
    """
    if isinstance(command, WrenchCommand):
        row = load_row(command, setup, None)
        return b"" if command.frame.point[0] == "ray" else row
    if isinstance(command, MoveString):
        check_supported(setup.integrator, frozenset({STRING}))
    if isinstance(command, ThrusterCommand):
        check_thrust(command.forces, setup)
    return b""


def check_thrust(forces: tuple[float, ...], setup: Setup) -> None:
    """Raises CommandRefused unless there is a force [N] for each thruster that body and integrator can take."""
    thrusters = setup.thrusters
    if len(forces) != len(thrusters):
        names = ", ".join(thrusters) or "none is declared by thrusters.<name>"
        accepted = f"{len(thrusters)} numbers, one a thruster ({names})"
        raise CommandRefused("thrusters", "thrusters", f"{len(forces)} numbers", accepted)
    if not all(map(math.isfinite, forces)):
        raise CommandRefused("nonfinite", "thrusters", list(forces), "finite numbers")
    for thruster, force in zip(thrusters.values(), forces, strict=True):
        thruster.load(thruster.within(force)).check_magnitude(setup.body)
    check_supported(setup.integrator, setup.needs_of_thrusters)


def load_row(command: WrenchCommand, setup: Setup, state: State | None) -> bytes:
    """The row of the command's load; raises CommandRefused where body or integrator can't take it."""
    frame, force, torque, body = command.frame, command.force, command.torque, setup.body
    if setup.integrator.supports_loads or frame.impulse:
        row = light_row(frame, force, torque, body, setup.contacts)
        if row:
            return row
    load = resolve_load(frame, force, torque, body, setup.surface, setup.contacts, state)
    load.check_magnitude(body)
    check_load_supported(command, load, setup)
    return load.packed


def check_load_supported(command: WrenchCommand, load: Load, setup: Setup) -> None:
    """Raises CommandRefused (``integrator``) where the setup's integrator doesn't support the command's load."""
    # An impulse acts at once: the integrator never sees it.
    if not (setup.integrator.supports_loads or command.frame.impulse):
        check_supported(setup.integrator, needs_of_load(load))


def check_start(setup: Setup) -> None:
    """Raises CommandRefused where the integrator can't take the parameters, or the string that is tied at time 0."""
    tied = setup.string.attached
    check_supported(setup.integrator, needs_of(setup, (), tied))
    check_rates(setup, setup.string.attach if tied else None)


def check_rates(setup: Setup, knot: Vector | None) -> None:
    """Raises CommandRefused (``integrator``) where damping, or a string tied at ``knot`` (mesh coordinates), is faster
    than an integrator that chooses its own steps can follow.
    """
    if not setup.integrator.chooses:
        return
    mass, moments = setup.body.mass, setup.body.principal_moments.tolist()
    _check_rate("linear_damping", setup.linear_damping, mass * FASTEST, "N s/m", setup.linear_damping / mass)
    _check_rate(
        "angular_damping", setup.angular_damping, moments[0] * FASTEST, "N m s", setup.angular_damping / moments[0]
    )
    if knot is None:
        return
    string = setup.string
    yields = most_yielding(mass, *moments, *transposed_times(setup.body.principal_axes, setup.body.point(knot)))
    # No point shows more than the whole mass.
    stiffness = mass * string.frequency * string.frequency if string.frequency > 0.0 else string.stiffness
    swing = math.sqrt(stiffness * yields)
    if string.frequency > 0.0:
        _check_rate("string.frequency", string.frequency, FASTEST / math.sqrt(mass * yields), "rad/s", swing)
    else:
        _check_rate("string.stiffness", string.stiffness, FASTEST * FASTEST / yields, "N/m", swing)
    damping = 2.0 * math.sqrt(stiffness * mass) * yields
    most = FASTEST / damping if damping > 0.0 else math.inf
    _check_rate("string.damping_ratio", string.damping_ratio, most, "", string.damping_ratio * damping)


def _check_rate(parameter: str, value: float, most: float, unit: str, rate: float) -> None:
    """most: the value that gives the rate FASTEST [1/s or rad/s]."""
    if rate > FASTEST and value > most:
        # Three digits, which rounded up would be refused themselves.
        digits = Context(prec=3, rounding=ROUND_DOWN).create_decimal_from_float(most)
        accepted = f"at most {float(digits):g} {unit}".rstrip()
        why = f"auto follows rates up to {FASTEST:g} /s, and this is one of {rate:.3g} /s"
        raise CommandRefused("integrator", parameter, value, f"{accepted} for this body: {why}")


def needs_of(setup: Setup, loads: Iterable[Load], tied: bool) -> frozenset[str]:
    """What the scene asks of its integrator."""
    needs = {need for name, need in ENVIRONMENT_NEEDS.items() if getattr(setup, name)}
    for load in loads:
        needs |= needs_of_load(load)
    if not setup.gyroscopic:
        needs.add(NO_GYROSCOPIC_TERM)
    if tied:
        needs.add(STRING)
    return frozenset(needs)
