# SPDX-License-Identifier: MIT
"""What acts on the body, followed from the node's event lines: the string, and the forces to be drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..motion.loads import Load, resolve_load
from ..motion.state import State
from ..motion.string import Tied
from ..scene.scenario import Scenario, nanoseconds
from ..simulation.commands import (
    ClearWrench,
    Command,
    MoveString,
    ReleaseString,
    ThrusterCommand,
    TieString,
    WrenchCommand,
)
from ..simulation.flight import NO_SLOT
from ..simulation.setup import Setup
from ..simulation.string_control import StringControl

SHOWN_AT_LEAST_NS = 800_000_000
"""[ns, of a body that flies in real time] A poke is over before a page has drawn it twice; its arrow
stays this long.
"""

SHORTEST, LONGEST = 0.3, 1.0
"""Arrow lengths in body sizes: that of a vanishing and of an infinite force."""


@dataclass(frozen=True)
class Hit:
    """The last poke: where it attacks (3,) [m, world], the unit direction of its force (3,) [world], its strength as
    text, and its age, 0 as it begins and 1 when it is forgotten.
    """

    point: np.ndarray
    direction: np.ndarray
    text: str
    age: float


@dataclass(frozen=True)
class _FollowedLoad:
    held: bool
    slot: int
    load: Load
    text: str
    began_ns: int
    until_ns: int


class FollowedLoads:
    """Follows one run. Stiffness and arrows come from the state that the page knew then, near to the node's own."""

    def __init__(self) -> None:
        self._control: StringControl | None = None
        self._acting: list[_FollowedLoad] = []

    def begin(self, setup: Setup, state: State) -> None:
        """A reset, or the first look at a node: string and loads as its parameters say."""
        self._control = StringControl(setup, state)
        self._acting = []
        if setup.in_flight is None:
            return
        for going in setup.in_flight.loads:
            if going.load is not None:
                until_ns = going.ends_ns(setup.wrench_timeout_ns)
                text = _strength_text(going.load.force, False)
                self._acting.append(_FollowedLoad(going.held, going.slot, going.load, text, going.began_ns, until_ns))
        timeout_ns = setup.in_flight.thrusters_last_ns + (setup.wrench_timeout_ns or 1 << 62)
        for number, (name, thruster) in enumerate(setup.thrusters.items()):
            push = setup.in_flight.thrusters.get(name)
            if push is not None and push.force:
                text = _strength_text((push.force,), False)
                self._acting.append(_FollowedLoad(True, -1 - number, thruster.load(push.force), text, 0, timeout_ns))

    @property
    def string(self) -> Tied | None:
        """The string as it is."""
        return None if self._control is None else self._control.tied

    def changed(self, old: Scenario, new: Scenario, state: State) -> None:
        """Parameters changed."""
        if self._control is not None:
            self._control.change(old.setup, new.setup, state)

    def event(self, command: Command, time_ns: int, scenario: Scenario, state: State) -> None:
        """A command acted when ``state`` was the last one known; raises InputError where it can't be followed."""
        if self._control is None:
            return
        at = State(time_ns, state.row)
        if isinstance(command, TieString):
            self._control.tie_at(command, scenario.setup, at)
        elif isinstance(command, MoveString):
            self._control.move(command, scenario.setup, at)
        elif isinstance(command, ReleaseString):
            self._control.release()
        elif isinstance(command, ClearWrench):
            self._acting = []
        elif isinstance(command, WrenchCommand):
            self._load(command, time_ns, scenario, at)
        elif isinstance(command, ThrusterCommand):
            self._thrust(command, time_ns, scenario.setup)

    def _thrust(self, command: ThrusterCommand, time_ns: int, setup: Setup) -> None:
        """What they were told to push with, without their least on-time."""
        self._acting = [acting for acting in self._acting if acting.slot >= NO_SLOT]
        until_ns = time_ns + (setup.wrench_timeout_ns or 1 << 62)
        for number, (thruster, force) in enumerate(zip(setup.thrusters.values(), command.forces, strict=True)):
            if within := thruster.within(force):
                text = _strength_text((within,), False)
                load = thruster.load(within)
                self._acting.append(_FollowedLoad(True, -1 - number, load, text, time_ns, until_ns))

    def _load(self, command: WrenchCommand, time_ns: int, scenario: Scenario, state: State) -> None:
        setup, frame, held = scenario.setup, command.frame, command.held
        load = resolve_load(
            frame, command.force, command.torque, setup.body, setup.surface, dict(setup.contacts), state
        )
        if command.slot != NO_SLOT:
            self._acting = [acting for acting in self._acting if acting.slot != command.slot]
        if held:
            lasting_ns = setup.wrench_timeout_ns or 1 << 62
        elif frame.duration_s is None:
            lasting_ns = 0 if frame.impulse else setup.poke_duration_ns
        else:
            lasting_ns = nanoseconds(frame.duration_s)
        if not load.is_zero:
            # Simulated time runs as fast as it is told to, eyes don't.
            seen_ns = round(SHOWN_AT_LEAST_NS * (scenario.parameters.real_time_factor or 1.0))
            until_ns = time_ns + (lasting_ns if held else max(lasting_ns, seen_ns))
            text = _strength_text(command.force, frame.impulse)
            self._acting.append(_FollowedLoad(held, command.slot, load, text, time_ns, until_ns))

    def string_ends(self, setup: Setup, state: State) -> tuple[np.ndarray, np.ndarray] | None:
        """Knot and free end (3,) in the world, or None."""
        tied = self.string
        if self._control is None or tied is None:
            return None
        if tied.release_ns is not None and state.time_ns >= tied.release_ns:
            self._control.release()
            return None
        state = _not_before(tied, state)
        hand = tied.free_end(state.time_ns)
        return hand + tied.span(setup.body, state), hand

    @property
    def slack_length(self) -> float:
        """How long [m] the string is where its ends are nearer than that; 0 of one that pushes, too."""
        tied = self.string
        return 0.0 if tied is None or tied.bilateral else tied.rest_length

    def string_energy(self, setup: Setup, state: State) -> float:
        """What the string holds [J]."""
        tied = self.string
        return 0.0 if tied is None else tied.potential_energy(setup.body, _not_before(tied, state))

    def arrows(self, setup: Setup, state: State, size: float) -> list[tuple[np.ndarray, np.ndarray]]:
        """Point of attack and drawn vector (3,) [m, world] of each force; ``size`` is the body's.

        An arrow ends at the point where the force attacks. Its length grows with the force, without end but bounded: it
        is half-way at what moves the body by its own size within a second from rest.
        """
        self._acting = [acting for acting in self._acting if acting.until_ns > state.time_ns]
        arrows = []
        middling = setup.body.mass * 2.0 * size
        for acting in self._acting:
            point, force, strength = _attack(acting.load, setup, state)
            if strength > 0.0:
                length = size * (SHORTEST + (LONGEST - SHORTEST) * strength / (strength + middling))
                vector = force * (length / strength)
                arrows.append((point - vector, vector))
        return arrows

    def hit(self, setup: Setup, state: State) -> Hit | None:
        """The last poke that pushes, while its arrow is shown."""
        for acting in reversed(self._acting):
            if acting.held or acting.until_ns <= state.time_ns:
                continue
            point, force, strength = _attack(acting.load, setup, state)
            if strength > 0.0:
                age = (state.time_ns - acting.began_ns) / (acting.until_ns - acting.began_ns)
                return Hit(point, force / strength, acting.text, max(0.0, age))
        return None


def _attack(load: Load, setup: Setup, state: State) -> tuple[np.ndarray, np.ndarray, float]:
    """Point of attack (3,) [m, world], force (3,) [world] and its size."""
    force = state.rotation @ load.force_body(setup.body, state)
    return state.position + state.rotation @ load.arm(setup.body), force, float(np.linalg.norm(force))


def _strength_text(force: Sequence[float], impulse: bool) -> str:
    return f"{float(np.linalg.norm(force)):.3g} {'N s' if impulse else 'N'}"


def _not_before(tied: Tied, state: State) -> State:
    """A target may be heard before the first state after it."""
    return State(max(state.time_ns, tied.begin_ns), state.row)
