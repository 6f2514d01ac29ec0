# SPDX-License-Identifier: MIT
"""What the page knows of the body by the node's states and events: its state, what acts on it, and its ghost."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..motion.state import State
from ..scene.command_codec import command_of_event, frame_names
from ..scene.scenario import Scenario
from .followed_loads import FollowedLoads
from .history import SCENE_GRACE_S, History
from .page_ghost import PageGhost
from .rewind import core_row
from .scene_loader import SceneLoader
from .status import Announcements


class NodeFollower:
    """Follows one node. state: the last one heard.

    on_event(kind, content) is told of each event before what it means for the loads, of a reset after the new
    beginning; on_begin() of each beginning: a reset, the first state of a node, or another node under its name.
    """

    def __init__(
        self,
        target: str,
        scenes: SceneLoader,
        history: History,
        announcements: Announcements,
        on_event: Callable[[str, Any], None],
        on_begin: Callable[[], None],
    ) -> None:
        self.state: State | None = None
        self.acting = FollowedLoads()
        self.ghost = PageGhost(target, announcements.say_once)
        self._target = target
        self._scenes = scenes
        self._history = history
        self._announcements = announcements
        self._on_event = on_event
        self._on_begin = on_begin
        self._events: deque[dict[str, Any]] = deque()
        self._newest: tuple[int, np.ndarray] | None = None
        self._scene_due_s: float | None = None
        self._odd_line_said = False

    @property
    def waiting(self) -> bool:
        """Whether events wait for the scene that they belong to."""
        return bool(self._events)

    def forget(self) -> None:
        """What happens from now on isn't heard."""
        self.state = None
        self._events.clear()
        self._newest = self._scene_due_s = None

    def receive(self, states: Sequence[tuple[int, np.ndarray]], lines: Sequence[str]) -> None:
        """States (time_ns, row (13,) in world axes) and event lines, as they came."""
        self._events.extend(event for line in lines if (event := self._event(line)) is not None)
        for time_ns, row in states:
            self._history.state(time_ns, row[:7], row[7:])
        if states:
            self._newest = states[-1]

    def _event(self, line: str) -> dict[str, Any] | None:
        """A line of ``~/events``, kept; None for one that is none, which anybody may publish."""
        try:
            self._history.event(line)
            return dict(json.loads(line))
        except InputError as error:
            self._odd_line(error)
            return None

    def _odd_line(self, error: Exception) -> None:
        if not self._odd_line_said:
            self._odd_line_said = True
            self._announcements.say(f"Lines of {self._target}/events can't be read; the first: {error}")

    def follow(self, scenario: Scenario, now_s: float) -> None:
        """Take up events in their order, then the newest state; a reset, and another mesh, once the scene is known that
        begins with it, which comes on another topic.
        """
        while self._events:
            kind, content = self._events[0]["kind"], self._events[0]["content"]
            if kind == "reset" or (kind == "set" and "mesh" in content):
                if self._scene_due_s is None:
                    self._scene_due_s = now_s + SCENE_GRACE_S
                if (
                    kind == "reset"
                    and self._newest is not None
                    and self.state is not None
                    and self._newest[0] >= self.state.time_ns
                ):
                    self._newest = None  # from before it
                if now_s < self._scene_due_s or self._scenes.busy:
                    return
                self._scene_due_s = None
            self._take_up(self._events.popleft(), self._scenes.scenario or scenario)
        if self._newest is not None:
            time_ns, row = self._newest
            self._newest = None
            another = self.state is None or time_ns < self.state.time_ns
            self.state = State(time_ns, core_row(row))
            if another:
                self._begin(self._scenes.scenario or scenario, self.state)

    def _begin(self, scenario: Scenario, state: State) -> None:
        self.acting.begin(scenario.setup, state)
        self.ghost.begin(scenario, state)
        self._announcements.begin_anew()
        self._on_begin()

    def changed(self, old: Scenario, new: Scenario) -> None:
        """Parameters changed."""
        if self.state is not None:
            self.acting.changed(old, new, self.state)
            self.ghost.changed(new, self.state)

    def _take_up(self, event: Mapping[str, Any], scenario: Scenario) -> None:
        kind, content = event["kind"], event["content"]
        if kind == "reset":
            self.state = State(0, scenario.setup.initial)
            self._begin(scenario, self.state)
        elif kind == "set" and isinstance(content, dict):
            self._scenes.string_changed(content)
        self._on_event(kind, content)
        if self.state is not None:
            try:
                self._act(kind, content, event["time_ns"], self._scenes.scenario or scenario, self.state)
            except (ArithmeticError, LookupError, TypeError, ValueError) as error:
                self._odd_line(InputError("event", str(event)[:80], f"the content of its kind ({error!r})"))

    def _act(self, kind: str, content: dict[str, Any], time_ns: int, scenario: Scenario, state: State) -> None:
        """What acted on the body acts on what is drawn beside it; what can't be followed is said."""
        try:
            frames = frame_names(scenario.parameters, self._target)
            command = command_of_event(kind, content, scenario.setup.contacts, frames)
            if command is not None:
                self.acting.event(command, time_ns, scenario, state)
            self.ghost.take(time_ns, kind, content)
        except InputError as error:
            self._announcements.say_once(f"The picture doesn't show this {kind.replace('_', ' ')}: {error}")

    def ghost_row(self, scenario: Scenario, looking_at: int | None) -> tuple[np.ndarray | None, np.ndarray]:
        """The ghost's state (13,), and its COM (3,) in scaled mesh coordinates: the future that a rewind left, or the
        scene's own ghost, which isn't shown while somebody is ``looking_at`` a moment.
        """
        own = scenario.setup.body.center_of_mass
        left = self._history.ghost
        if left is not None:
            return left.at(looking_at or self._history.span[1]), own
        row = None if looking_at is not None or self.state is None else self.ghost.row(self.state.time_ns)
        center_of_mass = self.ghost.center_of_mass
        return (None, own) if row is None or center_of_mass is None else (row, center_of_mass)
