# SPDX-License-Identifier: MIT
"""Mouse, trackpad and touch on the body: a drag pulls on a string, a click pokes, a shift-click pushes.

What a user points at is what a browser drew, some moments before the message came here: so poses are remembered.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from ..base.rotation import matrix_from_quaternion
from ..base.vectors import Attitude, Vector3
from ..scene.scenario import Scenario
from ..simulation.setup import Setup
from .flight import Entry, Flight

USUAL_DELAY_S = 0.06
"""From a pose sent to a pointer message that saw it: a window of 1/60 s each way, a frame, and the way itself."""

HOLD_S = 0.2
"""A still hand repeats its target, since the string is released ``string.timeout`` after the last one; more often where
that is short, or passes quickly.
"""

FREQUENCY = 8.0
"""[rad/s] Of a string whose scene has none, on the effective mass: light and heavy bodies respond alike."""

POKE_TRAVEL = 0.3
"""Body sizes a second: what the suggested poke gives the body."""

MODIFIERS: tuple[Any, ...] = (None, "shift")
"""With which keys a click is heard, as viser names them."""


@dataclass(frozen=True)
class DrawnPose:
    """time_s: by the monotonic clock. The picture shows the world point ``origin`` (3,) at its middle, ``unit`` metres
    as one. setup: of the body that is drawn."""

    time_s: float
    position: Vector3
    orientation_xyzw: Attitude
    origin: Vector3
    unit: float
    setup: Setup

    def world_point(self, drawn_point: Iterable[float]) -> Vector3:
        """A point of the picture (3,) in the world [m]."""
        return self.origin + self.unit * np.array(list(drawn_point), float)

    def body_point(self, drawn_point: Iterable[float]) -> Vector3:
        """A point of the picture (3,) in metres from the COM, body axes."""
        return (self.world_point(drawn_point) - self.position) @ matrix_from_quaternion(self.orientation_xyzw)

    def body_direction(self, direction: Iterable[float]) -> Vector3:
        """A direction of the picture (3,) in body axes."""
        return np.array(list(direction), float) @ matrix_from_quaternion(self.orientation_xyzw)


@dataclass
class _Drag:
    client_id: int
    target: Vector3
    view: DrawnPose
    last_target_s: float


class Pointer:
    """Turns pointer events of any page into commands. One string, so one drag at a time: the first page has it.

    force [N]: of a click; usual_force: one that suits the body.
    """

    def __init__(self, flight: Flight) -> None:
        self.force = self.usual_force = 1.0
        self._flight = flight
        self._poses: deque[DrawnPose] = deque()
        self._drag: _Drag | None = None

    @property
    def dragging(self) -> bool:
        """Whether somebody holds the string."""
        return self._drag is not None

    def drawn(self, pose: DrawnPose) -> None:
        """A pose went to the pages; the last one that is old enough to be seen by now is kept with those after it."""
        self._poses.append(pose)
        while len(self._poses) > 1 and self._poses[1].time_s <= pose.time_s - USUAL_DELAY_S:
            self._poses.popleft()

    def forget_poses(self) -> None:
        """Another body, or another run: earlier poses mean nothing."""
        self._poses.clear()

    def _seen(self, now_s: float) -> DrawnPose | None:
        """The pose that an event arriving now has most likely seen."""
        return next(
            (pose for pose in reversed(self._poses) if pose.time_s <= now_s - USUAL_DELAY_S),
            self._poses[0] if self._poses else None,
        )

    def attach(self, node: Any) -> None:
        """React to the pointer on this node of the picture."""
        for modifier in MODIFIERS:
            node.on_click(modifier=modifier)(self._on_click)
        node.on_drag("left")(self._on_drag)

    def attach_com(self, node: Any) -> None:
        """The same for the mark of the centre of mass, which can lie where there is no body: a click acts there, and a
        drag ties the string to the body beside it.
        """
        node.on_drag("left")(self._on_drag)

        async def clicked(event: viser.SceneNodePointerEvent[Any]) -> None:
            if event.ray_direction is not None:
                direction = np.array(event.ray_direction, dtype=float)
                self._flight.do({"force": numbers(self.force * direction / np.linalg.norm(direction))})

        for modifier in MODIFIERS:
            node.on_click(modifier=modifier)(clicked)

    # Click

    async def _on_click(self, event: viser.SceneNodePointerEvent[Any]) -> None:
        seen = self._seen(time.monotonic())
        if seen is not None and event.ray_origin is not None and event.ray_direction is not None:
            self.click(event.ray_origin, event.ray_direction, seen, event.modifier == "shift")

    def click(self, ray_origin: Iterable[float], ray_direction: Iterable[float], seen: DrawnPose, push: bool) -> bool:
        """Poke where the ray of the picture meets the body as it was ``seen``; whether it meets it."""
        body, surface, force = seen.setup.body, seen.setup.surface, self.force
        direction = np.array(list(ray_direction), dtype=float)
        direction /= np.linalg.norm(direction)
        if surface is None:
            self._flight.do({"force": numbers(force * direction)})
            return True
        origin = body.mesh_point(numbers(seen.body_point(ray_origin)))
        hit = surface.ray_hit(origin, seen.body_direction(direction) / body.scale)
        if hit is None:
            return False
        at = {"point": numbers(hit)}
        self._flight.do({"at": at, "push": force} if push else {"at": at, "force": numbers(force * direction)})
        return True

    # Drag

    async def _on_drag(self, event: viser.SceneNodeDragEvent[Any]) -> None:
        if event.phase == "start":
            self.grab(event.client_id, event.start_position, event.end_position)
        elif self._drag is not None and event.client_id == self._drag.client_id:
            if event.phase == "update":
                self.pull(event.end_position)
            else:
                self.let_go()

    def grab(self, client_id: int, start: Iterable[float], end: Iterable[float]) -> None:
        """Tie the string where the body was grabbed, and take its free end to the pointer."""
        if self.dragging or self._flight.refuses_in_past():
            return
        now = time.monotonic()
        seen = self._seen(now)
        if seen is None:
            return
        body, surface = seen.setup.body, seen.setup.surface
        entries: list[Entry] = []
        if self._flight.scenario.parameters.string.frequency <= 0.0:
            entries.append({"set": {"string.frequency": FREQUENCY}})
        point = (0.0, 0.0, 0.0) if surface is None else numbers(seen.body_point(start))
        entries.append({"string": {"attach": numbers(body.mesh_point(point))}})
        self._drag = _Drag(client_id, seen.world_point(end), seen, now)
        self._flight.do(*entries, _target(self._drag))

    def pull(self, end: Iterable[float]) -> None:
        """Move the string's free end."""
        if self._drag is not None:
            self._drag.target = self._drag.view.world_point(end)
            self._flight.do(_target(self._drag))

    def hold(self) -> None:
        """To be called often: repeats the target of a hand that doesn't move."""
        drag = self._drag
        if drag is None or self._flight.paused:
            return
        parameters = self._flight.scenario.parameters
        timeout_s = float(parameters.string.timeout) / (float(parameters.real_time_factor) or 1.0)
        hold_s = min(HOLD_S, timeout_s / 3.0) if timeout_s > 0.0 else HOLD_S
        if time.monotonic() >= drag.last_target_s + hold_s:
            self._flight.do(_target(drag))

    def let_go(self) -> None:
        """Release the string."""
        if self._drag is not None:
            self._drag = None
            self._flight.do({"string": "release"})

    def forget(self) -> None:
        """The string is no longer there: a hand that still drags holds nothing."""
        self._drag = None

    def left(self, client_id: int) -> None:
        """A page has gone, perhaps without a word: a string that it held would be held for ever."""
        if self._drag is not None and self._drag.client_id == client_id:
            self.let_go()


def _target(drag: _Drag) -> Entry:
    drag.last_target_s = time.monotonic()
    return {"string": {"target": numbers(drag.target)}}


def numbers(values: Iterable[float]) -> list[float]:
    """Plain numbers, as a script entry has them."""
    return [float(value) for value in values]


def suggested_force(scenario: Scenario, size: float) -> float:
    """A poke [N] that gives the body a part of its size a second: two digits are enough."""
    duration_s = float(scenario.parameters.poke_duration)
    return float(f"{POKE_TRAVEL * size * scenario.setup.body.mass / duration_s:.2g}")
