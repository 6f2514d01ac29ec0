# SPDX-License-Identifier: MIT
"""Mouse, trackpad and touch on the body: a drag pulls on a string, a click pokes, a shift-click pushes."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from ..scene.command_codec import MESH_FRAME, ScriptCommand
from ..scene.scenario import Scenario
from .drawn_poses import DrawnPose, DrawnPoses
from .hand_commands import HandCommands
from .scene_loader import SceneLoader

HOLD_S = 0.2
"""A still hand says again where it is, for the string lets go ``string.timeout`` after the last word; sooner where that
is short.
"""

SAME_TICK_S = 0.012
"""[s] Between the last target and the release. The node takes messages at least every 10 ms, and those that it takes
together act by kind: the release would act first, and the target would tie the string again. Where that happens all the
same, the release is sent again. While time stands still they go as one list.
"""

POKE_TRAVEL = 0.3
"""Body sizes a second: what the suggested poke gives the body."""

MODIFIERS: tuple[Any, ...] = (None, "shift")
"""With which keys a click is heard, as viser names them."""

POKE, PUSH = "Poke along the view", "Push inward"


@dataclass
class Tools:
    """What the panel says about the pointer. force [N], usual_force: one that suits the body; click: POKE or PUSH, for
    pages without a shift key.

    at_com: the string pulls at the centre of mass and not at the grabbed point. frequency [rad/s]: how hard, scaled by
    the effective mass; 0 leaves the node's stiffness.
    """

    force: float = 1.0
    usual_force: float = 1.0
    click: str = POKE
    at_com: bool = False
    frequency: float = 8.0


@dataclass
class _Drag:
    client_id: int
    target: np.ndarray
    view: DrawnPose
    last_target_s: float
    ended: bool = False


class Pointer:
    """Turns pointer events of any page into commands. One string, so one drag at a time: the first page has it."""

    def __init__(self, hand: HandCommands, scenes: SceneLoader, drawn_poses: DrawnPoses, tools: Tools) -> None:
        self._hand = hand
        self._scenes = scenes
        self._drawn_poses = drawn_poses
        self._tools = tools
        self._drag: _Drag | None = None
        self._knot_by_message = False
        self._loose_after = np.zeros(0)
        self._release_heard = False

    @property
    def dragging(self) -> bool:
        """Whether somebody holds the string."""
        return self._drag is not None and not self._drag.ended

    def attach(self, node: Any) -> None:
        """React to the pointer on this node of the picture."""
        for modifier in MODIFIERS:
            node.on_click(modifier=modifier)(self._on_click)
        node.on_drag("left")(self._on_drag)

    def attach_com(self, node: Any) -> None:
        """The same for the mark of the centre of mass, which can lie where there is no body: a click acts there."""

        async def clicked(event: viser.SceneNodePointerEvent[Any]) -> None:
            if event.ray_direction is not None:
                self.click_com(event.ray_direction)

        for modifier in MODIFIERS:
            node.on_click(modifier=modifier)(clicked)

    def string_event(self, kind: str, content: Mapping[str, Any]) -> None:
        """An event of the string, whoever caused it."""
        if kind == "string_attach":
            # The parameter ``string.attach`` doesn't say any more where the knot is.
            self._knot_by_message = True
        elif kind == "string_release":
            self._release_heard = True
        elif self._release_heard and np.array_equal(content.get("point", 0.0), self._loose_after):
            self._hand.do(ScriptCommand(0, "string_release"))  # our last target acted after the release

    # Click

    async def _on_click(self, event: viser.SceneNodePointerEvent[Any]) -> None:
        seen = self._drawn_poses.usual(time.monotonic())
        if seen is not None and event.ray_origin is not None and event.ray_direction is not None:
            push = (event.modifier == "shift") != (self._tools.click == PUSH)
            self.click(event.ray_origin, event.ray_direction, seen, push)

    def click(self, ray_origin: Iterable[float], ray_direction: Iterable[float], seen: DrawnPose, push: bool) -> bool:
        """Poke where the ray of the picture meets the body as it was ``seen``; whether it meets it."""
        scenario = self._scenes.scenario
        if scenario is None:
            return False
        body, surface = scenario.setup.body, scenario.setup.surface
        direction = _unit(ray_direction)
        if surface is None:
            self._poke("world@com", self._tools.force * direction)
            return True
        origin = body.mesh_point(_three(seen.body_point(ray_origin)))
        hit = surface.ray_hit(origin, seen.body_direction(direction) / body.scale)
        if hit is None:
            return False
        point = "point/" + ",".join(repr(float(x)) for x in hit[0])
        if push:
            self._poke(f"normal@{point}", (self._tools.force, 0.0, 0.0))
        else:
            self._poke(f"world@{point}", self._tools.force * direction)
        return True

    def click_com(self, ray_direction: Iterable[float]) -> None:
        """Poke at the centre of mass, along the view."""
        self._poke("world@com", self._tools.force * _unit(ray_direction))

    def _poke(self, frame_id: str, force: Iterable[float]) -> None:
        self._hand.do(ScriptCommand(0, "poke", frame_id, _three(force)))

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
        scenario = self._scenes.scenario
        if scenario is None or self.dragging:
            return
        body, surface = scenario.setup.body, scenario.setup.surface
        now = time.monotonic()
        seen = self._drawn_poses.of_point(start, now, surface, body)
        if seen is None:
            return
        commands: list[ScriptCommand] = []
        frequency = self._tools.frequency
        if frequency > 0.0 and scenario.parameters.string.frequency != frequency:
            commands.append(_set("string.frequency", frequency))
        if self._tools.at_com or surface is None:
            aside = 1e-6 * surface.extent if surface is not None else np.zeros(3)
            commands += self._tie_to(body.mesh_point((0.0, 0.0, 0.0)), aside)
        else:
            point = body.mesh_point(_three(seen.body_point(start)))
            commands.append(ScriptCommand(0, "string_attach", MESH_FRAME, point=_three(point)))
            self._knot_by_message = True
        self._drag = _Drag(client_id, seen.world_point(end), seen, now)
        self._loose_after = np.zeros(0)
        self._hand.do(*commands, _target(self._drag))

    def _tie_to(self, point: np.ndarray, aside: np.ndarray) -> list[ScriptCommand]:
        """The knot at a point that isn't on the surface: only the parameter can say so."""
        if not self._knot_by_message:
            return [_set("string.attach", list(_three(point)))]
        # A parameter that keeps its value changes nothing, so it takes a step aside first.
        self._knot_by_message = False
        return [_set("string.attach", list(_three(knot))) for knot in (point + aside, point)]

    def pull(self, end: Iterable[float]) -> None:
        """Move the string's free end."""
        drag = self._drag
        if drag is not None and not drag.ended:
            drag.target = drag.view.world_point(end)
            self._hand.do(_target(drag))

    def hold(self) -> None:
        """To be called often: a hand that doesn't move goes on holding."""
        drag, scenario = self._drag, self._scenes.scenario
        if drag is None or drag.ended or scenario is None or self._hand.paused:
            return
        timeout_s = float(scenario.parameters.string.timeout)
        hold_s = min(HOLD_S, timeout_s / 3.0) if timeout_s > 0.0 else HOLD_S
        if time.monotonic() >= drag.last_target_s + hold_s:
            self._hand.do(_target(drag))

    def let_go(self) -> None:
        """Release the string."""
        drag = self._drag
        if drag is None or drag.ended:
            return
        drag.ended = True
        if self._hand.paused:
            self._release(drag)
            return
        self._loose_after, self._release_heard = drag.target, False
        wait_s = max(0.0, drag.last_target_s + SAME_TICK_S - time.monotonic())
        asyncio.get_running_loop().call_later(wait_s, self._release, drag)

    def left(self, client_id: int) -> None:
        """A page has gone, perhaps without a word: a string that it held would be held for ever."""
        if self._drag is not None and self._drag.client_id == client_id:
            self.let_go()

    def _release(self, drag: _Drag) -> None:
        self._hand.do(ScriptCommand(0, "string_release"))
        if self._drag is drag:
            self._drag = None


def _target(drag: _Drag) -> ScriptCommand:
    drag.last_target_s = time.monotonic()
    return ScriptCommand(0, "string_target", "world", point=_three(drag.target))


def _unit(direction: Iterable[float]) -> np.ndarray:
    vector = np.array(list(direction), dtype=float)
    return vector / np.linalg.norm(vector)


def _set(name: str, value: object) -> ScriptCommand:
    return ScriptCommand(0, "set", changes={name: value})


def _three(point: Iterable[float]) -> tuple[float, float, float]:
    x, y, z = (float(coordinate) for coordinate in point)
    return x, y, z


def suggested_force(scenario: Scenario, size: float) -> float:
    """A poke [N] that gives the body a part of its size a second: two digits are enough."""
    duration_s = float(scenario.parameters.poke_duration)
    return float(f"{POKE_TRAVEL * size * scenario.setup.body.mass / duration_s:.2g}")
