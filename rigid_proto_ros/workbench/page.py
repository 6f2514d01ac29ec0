# SPDX-License-Identifier: MIT
"""The page: what all browsers show, and what they do to the body.

Everything here runs on viser's event loop, so nothing needs a lock. While no browser is connected the loop sleeps and the
link to ROS hears nothing.
"""

from __future__ import annotations

import asyncio
import json
import time

import numpy as np
import viser

from ..core.errors import InputError
from ..core.rotation import rotate_inverse
from ..core.state import State
from ..scenario import Scenario, make_scenario
from ..scene_file import read_scene_text
from .acting import Acting
from .pointer import Pointer, Tools
from .ros_link import RosLink
from .scene_view import SceneView
from .sighting import DrawnPose, Sightings

FRAME_S = 0.02
"""[s] Between two looks at what the node has said."""

LEASH = 1.0
"""Body sizes that the body may fly from the picture's middle before the picture follows."""

POKE_TRAVEL = 0.3
"""Body sizes a second: what the suggested poke gives the body."""


class Page:
    """Follows one node. state: the last one heard; scenario: the parameters in force, as the node said last."""

    def __init__(self, server: viser.ViserServer, target: str) -> None:
        self.server = server
        self.loop = server.get_event_loop()
        self.scenario: Scenario | None = None
        self.state: State | None = None
        self.tools = Tools()
        self.follow = True
        self.link = RosLink(target, self.deliver, self._on_scene, self._on_diagnostics)
        self.view = SceneView(server)
        self.sightings = Sightings()
        self.acting = Acting()
        self.pointer = Pointer(self.link, self, self.sightings, self.tools)
        self._open = asyncio.Event()
        self._scene_text = ""
        self._loading: asyncio.Task | None = None
        server.on_client_connect(self._on_connect)
        server.on_client_disconnect(self._on_disconnect)

    def deliver(self, function, *arguments) -> None:
        """Run a function on the page's thread soon; from any thread."""
        try:
            self.loop.call_soon_threadsafe(function, *arguments)
        except RuntimeError:
            pass  # the loop has ended

    async def run(self) -> None:
        """Follow the node for as long as the server runs."""
        while True:
            await self._open.wait()
            started = time.monotonic()
            self.tick(started)
            await asyncio.sleep(max(0.002, started + FRAME_S - time.monotonic()))

    # Pages come and go

    async def _on_connect(self, client: viser.ClientHandle) -> None:
        self.link.listen()
        self._open.set()

    async def _on_disconnect(self, client: viser.ClientHandle) -> None:
        if not self.server.get_clients():
            self._open.clear()
            self.pointer.let_go()
            self.link.stop_listening()
            self.state = None
            self.sightings.forget()

    # What the node says

    def _on_scene(self, text: str) -> None:
        self._scene_text = text
        if self._loading is None:
            self._loading = self.loop.create_task(self._load_scene())

    async def _load_scene(self) -> None:
        """Take on what the node flies; a big mesh is read beside the loop."""
        try:
            while (text := self._scene_text) and (self.scenario is None or text != self._loaded_text):
                values = read_scene_text(text).values
                scenario = await asyncio.to_thread(self._scenario, values)
                self._loaded_text = text
                self._take_on(scenario)
        except InputError as error:
            self.say(f"The node's scene can't be shown: {error}")
        finally:
            self._loading = None

    def _scenario(self, values) -> Scenario:
        present = self.scenario
        if present is None or present.values.keys() != values.keys():
            return make_scenario(values)
        changes = {name: value for name, value in values.items() if present.values[name] != value}
        return present.with_changes(changes)

    def _take_on(self, scenario: Scenario) -> None:
        old, self.scenario = self.scenario, scenario
        if self.view.set_body(scenario):
            self.sightings.forget()
            self.pointer.attach(self.view.body)
        if old is None:
            self.tools.force = suggested_force(scenario, 2.0 * self.view.radius)
        elif self.state is not None:
            self.acting.changed(old, scenario, self.state)

    def _on_diagnostics(self, values: dict[str, str]) -> None:
        self.diagnostics = values

    def say(self, text: str) -> None:
        """A line to all pages."""
        for client in self.server.get_clients().values():
            client.add_notification("Workbench", text, auto_close_seconds=8.0)

    # Every frame

    def tick(self, now_s: float) -> None:
        """Take what the node has said and draw it."""
        heard = self.link.take()
        scenario = self.scenario
        if scenario is None:
            return
        for line in heard.events:
            self._hear(json.loads(line))
        if heard.states:
            time_ns, row = heard.states[-1]
            first = self.state is None
            self.state = State(time_ns, body_row(row))
            if first:
                self.acting.begin(scenario.setup, self.state)
        if self.state is not None:
            self._draw(now_s)
        self.pointer.hold()

    def _hear(self, event: dict) -> None:
        if self.state is None:
            return
        if event["kind"] == "reset":
            self.acting.begin(self.scenario.setup, State(0, self.scenario.setup.initial))
        elif event["kind"] == "string_attach":
            self.pointer.knot_moved()
        self.acting.event(event, self.scenario, self.state)

    def _draw(self, now_s: float) -> None:
        state, setup, view = self.state, self.scenario.setup, self.view
        size = 2.0 * view.radius
        if self.follow and not self.pointer.dragging:
            self._lead_back(state.position, LEASH * size)
        with self.server.atomic():
            view.place(state.row)
            view.place_grid()
            view.show_string(self.acting.string_ends(setup, state))
            view.show_loads(self.acting.arrows(setup, state, size))
            momentum, spin = state.angular_momentum(setup.body.inertia), state.angular_velocity
            view.show_momentum(state.position, _direction(momentum, 0.8 * size), _direction(spin, 0.8 * size))
        self.sightings.drew(DrawnPose(now_s, state.position, state.orientation_xyzw, view.origin.copy(), view.unit))

    def _lead_back(self, position, leash: float) -> None:
        away = position - self.view.origin
        distance = float(np.linalg.norm(away))
        if distance > leash:
            self.view.origin = self.view.origin + away * (1.0 - leash / distance)


def body_row(row: np.ndarray) -> np.ndarray:
    """A state with ω in world axes (13,), as the topics have it, with ω in body axes."""
    return np.concatenate([row[:10], rotate_inverse(*row[3:7], *row[10:13])])


def suggested_force(scenario: Scenario, size: float) -> float:
    """A poke [N] that moves the body by a part of its size in a second: two digits are enough."""
    values = scenario.values
    force = POKE_TRAVEL * size * scenario.setup.body.mass / values["poke_duration"]
    return float(f"{force:.2g}")


def _direction(vector: np.ndarray, length: float) -> np.ndarray:
    size = float(np.linalg.norm(vector))
    return vector * (length / size) if size > 0.0 else np.zeros(3)
