# SPDX-License-Identifier: MIT
"""Mouse, trackpad and touch on the body: a drag pulls on a string, a click pokes, a shift-click pushes."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..command_codec import MESH_FRAME
from ..scenario import Scenario
from .ros_link import RosLink
from .sighting import DrawnPose, Sightings

KNOT_LEAD_S = 0.01
"""The first target follows the knot by this much: the node ties the string where the knot was when the target came."""

HOLD_S = 0.2
"""A still hand says again where it is, for the string lets go ``string.timeout`` after the last word; sooner where that is
short."""

SAME_TICK_S = 0.03
"""Commands this far apart aren't taken in the same tick, where they act by kind and bytes: a release would act before a
target, and the target would tie the string again."""

POKE_TRAVEL = 0.3
"""Body sizes a second: what the suggested poke gives the body."""

POKE, PUSH = "Poke along the view", "Push inward"


@dataclass
class Tools:
    """What the panel says about the pointer. force [N]; click: POKE or PUSH, for pages without a shift key.

    at_com: the string pulls at the centre of mass and not at the grabbed point. frequency [rad/s]: how hard, scaled by the
    effective mass; 0 leaves the node's stiffness.
    """

    force: float = 1.0
    click: str = POKE
    at_com: bool = False
    frequency: float = 8.0


class Flown(Protocol):
    """What the pointer needs to know of the body in flight."""

    scenario: Scenario | None
    row: np.ndarray | None


@dataclass
class _Drag:
    client_id: int
    target: np.ndarray
    view: DrawnPose
    last_target_s: float
    ended: bool = False


class Pointer:
    """Turns pointer events of any page into commands. One string, so one drag at a time: the first page has it."""

    def __init__(self, link: RosLink, flown: Flown, sightings: Sightings, tools: Tools) -> None:
        self._link = link
        self._flown = flown
        self._sightings = sightings
        self._tools = tools
        self._drag: _Drag | None = None
        self._knot_by_message = False

    @property
    def dragging(self) -> bool:
        """Whether somebody holds the string."""
        return self._drag is not None and not self._drag.ended

    def attach(self, node) -> None:
        """React to the pointer on this node of the picture."""
        for modifier in (None, "shift"):
            node.on_click(modifier=modifier)(self._on_click)
        node.on_drag("left")(self._on_drag)

    def attach_com(self, node) -> None:
        """The same for the mark of the centre of mass, which can lie where there is no body: a click acts there."""

        async def clicked(event) -> None:
            self.click_com(event.ray_direction)

        for modifier in (None, "shift"):
            node.on_click(modifier=modifier)(clicked)

    def knot_moved(self) -> None:
        """Somebody published ~/string/attach: the parameter ``string.attach`` doesn't say any more where the knot is."""
        self._knot_by_message = True

    # Click

    async def _on_click(self, event) -> None:
        scenario, seen = self._flown.scenario, self._sightings.usual(time.monotonic())
        if scenario is None or seen is None:
            return
        push = (event.modifier == "shift") != (self._tools.click == PUSH)
        self.click(event.ray_origin, event.ray_direction, seen, push)

    def click(self, ray_origin, ray_direction, seen: DrawnPose, push: bool) -> bool:
        """Poke where the ray of the picture meets the body as it was ``seen``; whether it meets it."""
        scenario = self._flown.scenario
        body, surface = scenario.setup.body, scenario.setup.surface
        direction = np.asarray(ray_direction, dtype=float)
        direction = direction / np.linalg.norm(direction)
        if surface is None:
            self._link.wrench("poke", "world@com", tuple(self._tools.force * direction))
            return True
        origin = body.mesh_point(seen.body_point(ray_origin))
        hit = surface.ray_hit(origin, seen.body_direction(direction) / body.scale)
        if hit is None:
            return False
        point = "point/" + ",".join(repr(float(x)) for x in hit[0])
        if push:
            self._link.wrench("poke", f"normal@{point}", (self._tools.force, 0.0, 0.0))
        else:
            self._link.wrench("poke", f"world@{point}", tuple(self._tools.force * direction))
        return True

    def click_com(self, ray_direction) -> None:
        """Poke at the centre of mass, along the view."""
        direction = np.asarray(ray_direction, dtype=float)
        self._link.wrench("poke", "world@com", tuple(self._tools.force * direction / np.linalg.norm(direction)))

    # Drag

    async def _on_drag(self, event) -> None:
        if event.phase == "start":
            self.grab(event.client_id, event.start_position, event.end_position)
        elif self._drag is not None and event.client_id == self._drag.client_id:
            if event.phase == "update":
                self.pull(event.end_position)
            else:
                self.let_go()

    def grab(self, client_id: int, start, end) -> None:
        """Tie the string where the body was grabbed; the first target follows."""
        scenario = self._flown.scenario
        if scenario is None or self.dragging:
            return
        body, surface = scenario.setup.body, scenario.setup.surface
        now = time.monotonic()
        seen = self._sightings.of_point(start, now, surface, body)
        if seen is None:
            return
        frequency = self._tools.frequency
        if frequency > 0.0 and scenario.values["string.frequency"] != frequency:
            self._link.schedule(f"{{t: 0, set: {{string.frequency: {frequency!r}}}}}")
        wait_s = KNOT_LEAD_S
        if self._tools.at_com or surface is None:
            aside = 1e-6 * surface.extent if surface is not None else np.zeros(3)
            wait_s += self._tie_to(body.mesh_point(np.zeros(3)), aside)
        else:
            point = body.mesh_point(seen.body_point(start))
            self._link.point("string/attach", MESH_FRAME, point)
            self._knot_by_message = True
        self._drag = _Drag(client_id, seen.world_point(end), seen, now)
        asyncio.get_running_loop().call_later(wait_s, self._send_target)

    def _tie_to(self, point, aside) -> float:
        """The knot at a point that isn't on the surface: only the parameter can say so. Returns after how long [s] it is there."""
        if not self._knot_by_message:
            self._set_knot(point)
            return 0.0
        # A parameter that keeps its value changes nothing, so it takes a step aside first; in an earlier tick, for the order
        # of two changes in one isn't that of their arrival.
        self._knot_by_message = False
        self._set_knot(point + aside)
        asyncio.get_running_loop().call_later(SAME_TICK_S, self._set_knot, point)
        return SAME_TICK_S

    def _set_knot(self, point) -> None:
        numbers = ", ".join(repr(float(x)) for x in point)
        self._link.schedule(f"{{t: 0, set: {{string.attach: [{numbers}]}}}}")

    def pull(self, end) -> None:
        """Move the string's free end."""
        if self.dragging:
            self._drag.target = self._drag.view.world_point(end)
            self._send_target()

    def hold(self) -> None:
        """To be called often: a hand that doesn't move goes on holding."""
        if self.dragging:
            timeout_s = self._flown.scenario.values["string.timeout"]
            hold_s = min(HOLD_S, timeout_s / 3.0) if timeout_s > 0.0 else HOLD_S
            if time.monotonic() >= self._drag.last_target_s + hold_s:
                self._send_target()

    def _send_target(self) -> None:
        if self.dragging:
            self._drag.last_target_s = time.monotonic()
            self._link.point("string/target", "world", self._drag.target)

    def let_go(self) -> None:
        """Release the string, once the last target is taken."""
        if self.dragging:
            drag = self._drag
            drag.ended = True
            wait_s = max(0.0, drag.last_target_s + SAME_TICK_S - time.monotonic())
            asyncio.get_running_loop().call_later(wait_s, self._release, drag)

    def _release(self, drag: _Drag) -> None:
        self._link.call("string/release")
        if self._drag is drag:
            self._drag = None


def suggested_force(scenario: Scenario, size: float) -> float:
    """A poke [N] that gives the body a part of its size a second: two digits are enough."""
    duration_s = scenario.values["poke_duration"]
    return float(f"{POKE_TRAVEL * size * scenario.setup.body.mass / duration_s:.2g}")
