# SPDX-License-Identifier: MIT
"""The page: what all browsers show, and what they do to the body.

Everything here runs on viser's event loop, so nothing needs a lock. While no browser is connected the loop sleeps and the
link to ROS hears nothing.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections import deque
from collections.abc import Awaitable
from typing import Any

import numpy as np
import viser

from ..base.errors import InputError
from ..motion.state import State
from ..scene.command_codec import command_of_event, frame_names
from ..scene.scenario import Scenario
from .acting import Acting
from .body_tab import BodyTab
from .controls import Controls, ParameterSetter
from .hand_commands import HandCommands
from .history import SCENE_GRACE_S, History
from .keys import add_keys
from .panel import Panel
from .pointer import Pointer, Tools, suggested_force
from .readout_panel import ReadoutPanel
from .rewind import Rewind, core_row
from .ros_link import RosLink
from .scene_loader import SceneLoader
from .scene_view import SceneView
from .session_tab import SessionTab
from .shadow import Shadow
from .show_tab import ShowTab
from .side_by_side import SideBySide, names
from .sighting import DrawnPose, Sightings
from .situation import Situation, bring_about
from .status import ENDED, Status
from .upload_button import UploadButton

FRAME_S = 0.02
"""[s] Between two looks at what the node has said."""

GRACE_S = 2.0
"""[s] After the last browser left: a page that is loaded anew finds its history."""

COMPARED = "true_or_box_tensor"
"""The lesson that shows a body and its ghost."""

LEASH = 0.2
"""Body sizes that the body may fly from the picture's middle before the picture follows."""


class Page:
    """Follows one node. state: the last one heard.

    address: of this page. lesson: name of the bundled scene that it was started with, or empty. anew: the flight begins
    anew when the first browser is there to see it.
    """

    def __init__(
        self, server: viser.ViserServer, target: str, address: str, lesson: str = "", anew: bool = False
    ) -> None:
        self.server = server
        self.address = address
        self.loop = server.get_event_loop()
        self.state: State | None = None
        self.tools = Tools()
        self.usual_force = 1.0
        self.follow = True
        self.paused = False
        self.history = self._new_history(target)
        self.looking_at: int | None = None
        self.looking_from: int | None = None
        self._paused_before_looking = False
        self.diagnostics: dict[str, str] = {}
        self.link = RosLink(target, self.deliver, self._on_scene, self._on_diagnostics)
        self._scenes = SceneLoader(self.loop, self._take_on, self._unshown)
        self.view = SceneView(server)
        self._com: Any = None
        self.sightings = Sightings()
        self.acting = Acting()
        self.shadow = Shadow(self._ghost_refuses)
        self.hand = HandCommands(self.link, lambda: self.paused)
        self.pointer = Pointer(self.hand, self, self.sightings, self.tools)
        self._setter = ParameterSetter(self.hand.set_parameters, self._refused)
        self._controls = Controls(server.gui, self._setter.set, lambda text: self.say(text))
        self._readouts = ReadoutPanel(server)
        self._status = server.gui.add_markdown("")
        self.side_by_side = SideBySide(server.gui, lambda: self._session.fly_lesson(COMPARED))
        tabs = server.gui.add_tab_group()
        self._panel = Panel(self, self._controls, tabs)
        self.body_tab = BodyTab(self, self._controls, tabs)
        self._session = SessionTab(self, tabs, self._panel.play_tab)
        self.show_tab = ShowTab(self, tabs)
        self._upload = UploadButton(self)
        add_keys(self)
        self._session.show_lesson_named(lesson)
        self._open = asyncio.Event()
        self._known = asyncio.Event()
        self._another_body = True
        self._doing = ""
        self._odd_line_said = False
        self._refusals_said: set[str] = set()
        self._begin_anew = anew
        self._events: deque[dict] = deque()
        self._newest: tuple[int, np.ndarray] | None = None
        self._reset_due_s: float | None = None
        self._status_of = Status(self.link.target)
        self._slow_due_s = 0.0
        server.on_client_connect(self._on_connect)
        server.on_client_disconnect(self._on_disconnect)

    @property
    def scenario(self) -> Scenario | None:
        """The parameters in force, as the node said last; None before it has."""
        return self._scenes.scenario

    def deliver(self, function, *arguments) -> None:
        """Run a function on the page's thread soon; from any thread."""
        try:
            self.loop.call_soon_threadsafe(function, *arguments)
        except RuntimeError:
            pass  # the loop has ended

    async def run(self) -> None:
        """Follow the node for as long as the server runs."""
        try:
            while True:
                await self._open.wait()
                started = time.monotonic()
                self.tick(started)
                await asyncio.sleep(max(0.002, started + FRAME_S - time.monotonic()))
        except asyncio.CancelledError:
            self._open.clear()  # the browsers that go now are no reason to do anything: close is
            raise

    def close(self) -> None:
        """Leave ROS, the node as it was before somebody looked back, and nothing on the disk."""
        if self.looking_at is not None:
            self.link.call("pause", self._paused_before_looking)
        self.link.close()
        self._upload.close()

    def show_ended(self) -> None:
        """The last word: browsers show what was sent last for as long as they are open."""
        self._status.content = ENDED
        self.server.flush()

    # Browsers come and go

    async def _on_connect(self, client: viser.ClientHandle) -> None:
        if not self._open.is_set():
            self._status_of.heard(time.monotonic())  # it has time to be heard
            self.link.listen()
            self._open.set()

    async def _on_disconnect(self, client: viser.ClientHandle) -> None:
        await asyncio.sleep(GRACE_S)
        if not self.server.get_clients() and self._open.is_set():
            self._open.clear()
            self.pointer.let_go()
            self.resume_after_looking()
            self.link.stop_listening()
            # What happens from now on isn't heard: the memory of the flight ends here.
            self.state = None
            self._events.clear()
            self._newest = self._reset_due_s = None
            self.history = self._new_history(self.link.target)
            self.sightings.forget()
            self.view.trails.forget()
            self._readouts.restart()
            self._scenes.forget()
            self._known.clear()  # somebody may change it meanwhile, and a link sets what differs from it

    # What the tabs ask for

    def set(self, changes) -> None:
        """Set parameters of the node."""
        self._setter.set(changes)

    @property
    def busy(self) -> bool:
        """Whether something that was asked for here isn't done yet."""
        return bool(self._doing) or self._setter.busy

    def call(self, service: str, data: bool | None = None) -> None:
        """Call a service; a failure is said on the page."""
        if service == "reset":
            self.resume_after_looking()
        if service == "step" or (service == "pause" and not data):
            self.hand.go_on()
        self.link.call(service, data, lambda successful, message: None if successful else self.say(message))

    def _set_paused(self, paused: bool) -> None:
        self.paused = paused
        self._panel.show_state(paused)
        if not paused:
            self.hand.go_on()

    def pause(self, paused: bool) -> None:
        """Stop or resume simulated time."""
        self.call("pause", paused)

    def centre(self) -> None:
        """The picture's middle is where the body is."""
        if self.state is not None:
            self.view.origin = self.state.position.copy()

    def new_body(self) -> None:
        """Another body comes: what fits it is found anew."""
        self._another_body = True

    async def known(self) -> None:
        """Wait until the node's scene is known."""
        await self._known.wait()

    async def doing(self, what: str, work: Awaitable) -> None:
        """Await work that takes a while, saying so; a refusal is said on the page and not raised."""
        self._doing = what
        try:
            await work
        except InputError as error:
            self.say(str(error))
        finally:
            self._doing = ""

    async def bring_about(self, situation: Situation, rewind: Rewind | None = None) -> None:
        """Take the node into a situation; raises InputError."""
        self.pointer.let_go()
        paused = self._paused_before_looking if self.looking_at is not None else self.paused

        def before_reset() -> None:
            self.history.rewinding(rewind)
            if rewind is None:
                self.history.forget_ghost()
                self.end_looking()  # the past was another body's

        def received() -> int:
            return int(self.diagnostics.get("commands_received", 0))

        try:
            await bring_about(self.link, situation, paused, received, before_reset)
        except InputError:
            self.history.rewinding(None)
            self.resume_after_looking()
            raise
        self.paused = paused
        self.end_looking()

    def follow_link(self, link: str) -> None:
        """Bring the node where a link leads, once a page is open."""

        self._begin_anew = False

        async def following() -> None:
            await self.known()  # before that nobody would see a refusal
            await self._session.open_link(link)

        self._following = self.loop.create_task(following())

    def say(self, text: str) -> None:
        """A line to all pages."""
        for client in self.server.get_clients().values():
            client.add_notification("Workbench", text, auto_close_seconds=10.0)

    # Looking back

    def look_at(self, from_ns: int, back_s: float) -> None:
        """Show the body as it was, the node paused meanwhile."""
        if self.looking_at is None:
            self._paused_before_looking = self.paused
            self.looking_from = from_ns
            self.pause(True)
        self.looking_at = max(from_ns - round(back_s * 1e9), self.history.span[0])

    @property
    def step_s(self) -> float:
        """[s] What ``~/step`` and the keys for steps go on by: one publication period."""
        return 0.01 if self.scenario is None else 1.0 / float(self.scenario.parameters.publish_rate)

    def look_by(self, seconds: float) -> None:
        """Look further back, or less far with a negative number."""
        self._session.look_by(seconds)

    async def go_on_from_here(self) -> None:
        """Take the node to the moment that is looked at, and let time go on from there."""
        await self._session.go_on_from_here()

    def run_after_looking(self) -> None:
        """Time goes on after this look back, though it stood still before."""
        self._paused_before_looking = False

    def resume_after_looking(self) -> None:
        """Back to now, running or paused as it was."""
        if self.looking_at is not None:
            self.pause(self._paused_before_looking)
        self.end_looking()

    def end_looking(self) -> None:
        """Show what is."""
        self.looking_at = self.looking_from = None
        self._session.show_now()

    # What the node says

    def _new_history(self, target: str) -> History:
        return History(target.strip("/"), lambda: self._upload.attachments())

    def _on_scene(self, text: str) -> None:
        self.history.scene(text)
        self._scenes.load(text)

    def _unshown(self, error: InputError) -> None:
        self.say(f"The node's scene can't be shown: {error}")

    def _take_on(self, old: Scenario | None, scenario: Scenario) -> None:
        if self.view.set_body(scenario, zoom=self._another_body):
            self.sightings.forget()
            self.pointer.attach(self.view.body)
            self._another_body = True
        if self.view.com is not self._com:
            self._com = self.view.com
            self.pointer.attach_com(self._com)
        if old is not None and self.state is not None:
            self.acting.changed(old, scenario, self.state)
            self.shadow.changed(scenario, self.state)
        self.body_tab.changed(scenario, self._another_body)
        self._upload.flies(str(scenario.parameters.mesh))
        self._controls.update(scenario.parameters.named())
        if self._another_body:
            self._another_body = False
            self.usual_force = self.tools.force = suggested_force(scenario, 2.0 * self.view.radius)
            self._panel.show_force()
        self._known.set()
        if self._begin_anew:
            self._begin_anew = False
            self.call("reset")

    def _on_diagnostics(self, values: dict[str, str]) -> None:
        self.diagnostics = values
        self._status_of.report(values, time.monotonic())
        self._set_paused(values.get("state") == "paused")

    def _refused(self, reason: str) -> None:
        self.say(f"Refused: {reason}")
        self._controls.show_again()

    # Every frame

    def tick(self, now_s: float) -> None:
        """Take what the node has said and draw it."""
        heard = self.link.take()
        self._events.extend(event for line in heard.events if (event := self._event(line)) is not None)
        for time_ns, row in heard.states:
            self.history.state(time_ns, row[:7], row[7:])
            self.view.trails.add(time_ns, row)
        if self.scenario is not None:
            self._follow(heard.states, now_s)
            if self.state is not None:
                self._draw(now_s)
        if heard.states:
            self._status_of.heard(now_s)
        self.pointer.hold()
        if now_s >= self._slow_due_s:
            self._slow_due_s = now_s + 1.0
            self._every_second(now_s)

    def _follow(self, states: list, now_s: float) -> None:
        """Events in their order, then the newest state; a reset once the scene that it begins with is known, which comes on
        another topic."""
        if states:
            self._newest = states[-1]
        while self._events:
            if self._events[0]["kind"] == "reset":
                if self._reset_due_s is None:
                    self._reset_due_s = now_s + SCENE_GRACE_S
                if self._newest is not None and self.state is not None and self._newest[0] >= self.state.time_ns:
                    self._newest = None  # from before it
                if now_s < self._reset_due_s or self._scenes.busy:
                    return
                self._reset_due_s = None
            self._hear(self._events.popleft())
        if self._newest is not None:
            time_ns, row = self._newest
            self._newest = None
            another = self.state is None or time_ns < self.state.time_ns
            self.state = State(time_ns, core_row(row))
            if another:
                self._begin(self.state)

    def _begin(self, state: State) -> None:
        """A reset, the first look at a node, or another node under its name."""
        self.acting.begin(self.scenario.setup, state)
        self.shadow.begin(self.scenario, state)
        self._refusals_said.clear()
        self.side_by_side.restart()
        self._readouts.restart()

    def _event(self, line: str) -> dict | None:
        """A line of ``~/events``, kept; None for one that is none, which anybody may publish."""
        try:
            self.history.event(line)
            return json.loads(line)
        except InputError as error:
            self._odd_line(error)
            return None

    def _odd_line(self, error: Exception) -> None:
        if not self._odd_line_said:
            self._odd_line_said = True
            self.say(f"Lines of {self.link.target}/events are passed over, the first: {error}")

    def _hear(self, event: dict) -> None:
        kind = event["kind"]
        if kind == "reset":
            self.hand.forget()
            self.state = State(0, self.scenario.setup.initial)
            self._begin(self.state)
            self.view.trails.forget()
            if self.looking_at is None:
                self.view.origin = np.zeros(3)
        elif kind == "pause":
            self._set_paused(bool(event["content"].get("data")))
        elif kind == "string_attach":
            self.pointer.knot_moved()
        elif kind == "set" and isinstance(event["content"], dict):
            self._scenes.string_changed(event["content"])
        if self.state is not None:
            try:
                self._act(kind, event["content"], event["time_ns"])
            except (ArithmeticError, LookupError, TypeError, ValueError) as error:
                self._odd_line(InputError("event", str(event)[:80], f"the content of its kind ({error!r})"))

    def _act(self, kind: str, content: dict, time_ns: int) -> None:
        """What acted on the body acts on what is drawn beside it; what can't be followed is said."""
        try:
            frames = frame_names(self.scenario.parameters, self.link.target)
            command = command_of_event(kind, content, self.scenario.setup.contacts, frames)
            if command is not None:
                self.acting.event(command, time_ns, self.scenario, self.state)
        except InputError as error:
            self._say_once(f"The picture doesn't show this {kind.replace('_', ' ')}: {error}")
            return
        if command is not None:
            try:
                self.shadow.event(command, time_ns)
            except InputError as error:
                self._ghost_refuses(str(error))

    def _ghost_refuses(self, reason: str) -> None:
        self._say_once(f"The ghost doesn't take part: {reason}")

    def _say_once(self, text: str) -> None:
        """A line to all pages, not again before the next reset."""
        if text not in self._refusals_said:
            self._refusals_said.add(text)
            self.say(text)

    def _draw(self, now_s: float) -> None:
        state, setup, view = self._shown_state(), self.scenario.setup, self.view
        size = 2.0 * view.radius
        if self.follow and not self.pointer.dragging:
            self._lead_back(state.position, LEASH * size)
        looking = self.looking_at is not None
        ghost, com = self._ghost_row(looking)
        with self.server.atomic():
            view.place(state.row, now_s)
            view.place_surroundings(bool(np.any(setup.gravity)))
            view.look_again(now_s)
            view.draw_trails(now_s, state.time_ns, self.scenario)
            view.show_string(None if looking else self.acting.string_ends(setup, state))
            view.show_loads([] if looking else self.acting.arrows(setup, state, size))
            view.show_hit(None if looking else self.acting.hit(setup, state))
            momentum, spin = state.angular_momentum(setup.body.inertia), state.angular_velocity
            scales = view.show_motion(state.position, momentum, spin)
            view.show_ghost(ghost, com, names(self.scenario, self.history.ghost is not None)[:2])
            self.side_by_side.show(now_s, self.scenario, state, ghost, self.history.ghost is not None)
        self.sightings.drew(DrawnPose(now_s, state.position, state.orientation_xyzw, view.origin.copy(), view.unit))
        stretched = 0.0 if looking else self.acting.string_energy(setup, state)
        self._readouts.show(now_s, self.scenario, state, stretched, scales, self.side_by_side.angle)

    def _ghost_row(self, looking: bool) -> tuple[np.ndarray | None, np.ndarray]:
        """The ghost's state, and its COM in scaled mesh coordinates: the future that was left, or the scene's own ghost."""
        own = self.scenario.setup.body.center_of_mass
        shadow = None if looking else self.shadow.row(self.state.time_ns)
        left = self.history.ghost
        if left is not None:
            return left.at(self.looking_at or self.history.span[1]), own
        return (None, own) if shadow is None else (shadow, self.shadow.center_of_mass)

    def _shown_state(self) -> State:
        if self.looking_at is not None:
            row = self.history.row(self.looking_at)
            if row is not None:
                return State(self.history.simulated_ns(self.looking_at), core_row(row))
        return self.state

    def _lead_back(self, position, leash: float) -> None:
        away = position - self.view.origin
        distance = float(np.linalg.norm(away))
        if distance > leash:
            self.view.origin = self.view.origin + away * (1.0 - leash / distance)

    def _every_second(self, now_s: float) -> None:
        self._session.every_second()
        status = self._status_of.text(now_s, self._doing)
        if self._status.content != status:
            self._status.content = status
