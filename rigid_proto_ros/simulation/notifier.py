# SPDX-License-Identifier: MIT
"""What a simulation tells its observer: the body, what acts on it, the string, and what the motion is doing."""

from __future__ import annotations

import numpy as np

from ..motion.loads import Load
from ..motion.string import StringState
from .observables import Observables
from .observer import (
    AccuracyFloor,
    Applied,
    BodyChanged,
    BodySnapshot,
    Effort,
    LoadBegan,
    LoadEnded,
    Logged,
    Observer,
    ShownLoad,
    ShownString,
    StatusChanged,
    StringChanged,
)
from .setup import Setup

COST_PERIOD_NS = 50_000_000
"""[ns, simulated] How often observers are told what the motion has cost, and how far it is held to its accuracy."""


class EventNotifier:
    """Tells one observer, and only what it listens to."""

    def __init__(self, observer: Observer) -> None:
        self.start_over()
        self.watch_for(observer)

    def watch_for(self, observer: Observer) -> None:
        """Tell this observer from now on, and no other."""
        self.observer = observer
        self._told: dict[str, str] = {}
        self._told_floor = ""
        takes = observer.takes
        self.shows_loads = LoadBegan in takes
        self.wants_loads = not takes.isdisjoint((Applied, LoadBegan, LoadEnded))
        self.ignores_commands = not self.wants_loads and Logged not in takes
        self._shows_status = StatusChanged in takes
        self._shows_cost = not takes.isdisjoint((AccuracyFloor, Effort))
        self._shows_string = StringChanged in takes

    def start_over(self) -> None:
        """Simulated time starts again at 0: nothing has been told of it."""
        self._told, self._told_floor = {}, ""
        self._told_string: StringState | None = None
        self._next_cost_ns = 0

    def introduce(self, readings: Observables) -> None:
        """Tell an observer that comes in flight about the body, what acts on it and the string."""
        self.body(readings)
        self.loads(readings)
        self.string(readings)

    def loads(self, readings: Observables) -> None:
        """What acts already."""
        if self.shows_loads:
            for acting in readings.acting:
                self.load_began(readings, acting.load_id, acting.shown_kind, acting.load)

    def body(self, readings: Observables) -> None:
        """The body as it is now."""
        self.observer.on(BodyChanged(readings.time_ns, snapshot(readings.setup)))

    def status(self, readings: Observables, paused: bool) -> None:
        """What the body is doing, where that changed since it was last told; from time to time what that costs."""
        if self._shows_cost and readings.time_ns >= self._next_cost_ns:
            self.cost(readings)
        if not self._shows_status:
            return
        motion = "paused" if paused else "sleeping" if readings.at_rest else "flying"
        tracks = {"motion": motion, "method": readings.choice}
        string = readings.string
        if string is not None:
            slack = not string.bilateral and string.stretch(readings.setup.body, readings.state) < 0.0
            tracks["string"] = "slack" if slack else "taut"
        elif "string" in self._told:
            tracks["string"] = "loose"
        for track, value in tracks.items():
            if self._told.get(track) != value:
                self._told[track] = value
                self.observer.on(StatusChanged(readings.time_ns, track, value))

    def cost(self, readings: Observables) -> None:
        """What the motion has cost, and what has held it to less than its accuracy."""
        if not self._shows_cost:
            return
        self._next_cost_ns = readings.time_ns + COST_PERIOD_NS
        self.observer.on(Effort(readings.time_ns, readings.steps, readings.force_evaluations))
        floor = readings.accuracy_floor
        if floor != self._told_floor:
            self._told_floor = floor
            self.observer.on(AccuracyFloor(readings.time_ns, floor))

    def load_began(self, readings: Observables, load_id: int, kind: str, load: Load) -> None:
        """A load begins to act; ``kind`` is wrench, poke, impulse or thruster."""
        if self.shows_loads:
            shown = _shown_load(kind, load, readings.setup)
            self.observer.on(LoadBegan(readings.time_ns, load_id, shown))

    def string(self, readings: Observables) -> None:
        """The string, where it changed since it was last told."""
        tied = readings.string
        if tied is self._told_string:
            return
        self._told_string = tied
        if not self._shows_string:
            return
        shown = None if tied is None else _shown_string(tied, readings.setup)
        self.observer.on(StringChanged(readings.time_ns, shown))


def snapshot(setup: Setup) -> BodySnapshot:
    """The body of a setup as observers are told of it."""
    body = setup.body
    return BodySnapshot(
        body.mass,
        body.center_of_mass,
        body.inertia,
        body.scale,
        setup.gravity,
        setup.inertia_model,
        setup.integrator.name,
        setup.gyroscopic,
    )


def _shown_load(kind: str, load: Load, setup: Setup) -> ShownLoad:
    axes = "world" if load.axes == "world" else "body"
    force = np.asarray(load.force) if axes == "world" else load.own_force(setup.body)
    return ShownLoad(kind, axes, load.arm(setup.body), force, np.asarray(load.torque))


def _shown_string(tied: StringState, setup: Setup) -> ShownString:
    arm = np.asarray(tied.arm(setup.body))
    ends = (tied.origin, tied.target, tied.begin_ns, tied.end_ns)
    return ShownString(arm, *ends, tied.stiffness, tied.damping, tied.rest_length, tied.bilateral)
