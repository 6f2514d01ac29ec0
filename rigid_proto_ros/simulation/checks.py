# SPDX-License-Identifier: MIT
"""What a setup's body and integrator can take: commands are refused before they act where that is known."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..base.errors import CommandRefused
from ..base.rotation import transposed_times
from ..base.vectors import Vector
from ..motion.integrators import check_supported
from ..motion.integrators.auto import FASTEST
from ..motion.integrators.integrator import NO_GYROSCOPIC_TERM, STRING, needs_of_load
from ..motion.loads import Load, light_row, resolve_load
from ..motion.problem import ENVIRONMENT_NEEDS
from ..motion.state import State
from ..motion.string import most_yielding
from .commands import Command, MoveString, ThrusterCommand, WrenchCommand
from .setup import Setup


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
        check_supported(setup.integrator, needs_of_load(thruster.load(1.0)))


def load_row(command: WrenchCommand, setup: Setup, state: State | None) -> bytes:
    """The row of the command's load; raises CommandRefused where body or integrator can't take it."""
    frame, force, torque, body = command.frame, command.force, command.torque, setup.body
    if setup.integrator.supports_loads or frame.impulse:
        row = light_row(frame, force, torque, body)
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
    if rate > FASTEST:
        accepted = f"at most {most:.3g} {unit}".rstrip()
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
