# SPDX-License-Identifier: MIT
"""The page: what all browsers show, and what they do to the body.

Everything here runs on viser's event loop, so nothing needs a lock. While no browser is connected the loop sleeps and
the link to ROS hears nothing. The page makes its parts, hands each what it needs, and draws what they know.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from ..base.errors import InputError
from ..motion.state import State
from ..scene.scenario import Scenario
from .body_tab import BodyTab
from .controls import Controls
from .drawn_poses import DrawnPose, DrawnPoses
from .follower import NodeFollower
from .history import History
from .keys import Keyboard, add_keys
from .lesson_folder import LessonFolder
from .node_control import NodeControl
from .panel import Panel
from .past_view import PastView
from .pointer import Pointer, Tools, suggested_force
from .readout_panel import ReadoutPanel
from .rewind import core_row
from .ros_link import RosLink
from .scene_loader import SceneLoader
from .scene_view import SceneView
from .session_tab import SessionTab
from .show_tab import ShowTab
from .side_by_side import SideBySide, names
from .situation import SituationControl
from .status import ENDED, Announcements, Status
from .upload_button import UploadButton

FRAME_S = 0.02
"""[s] Between two looks at what the node has said."""

GRACE_S = 2.0
"""[s] After the last browser left: a page that is loaded anew finds its history."""

COMPARED = "true_or_box_tensor"
"""The lesson that shows a body and its ghost."""


class Page:
    """Follows one node.

    address: of this page. lesson: name of the bundled scene that it was started with, or empty. anew: the flight begins
    anew when the first browser is there to see it.
    """

    def __init__(
        self, server: viser.ViserServer, target: str, address: str, lesson: str = "", anew: bool = False
    ) -> None:
        self.server = server
        self.loop = server.get_event_loop()
        self._begin_anew = anew
        self.announcements = Announcements(server)
        # The node, and what is known of it.
        self.link = RosLink(target, self.deliver, self._on_scene, self._on_diagnostics)
        self._status_of = Status(self.link.target)
        self.node = NodeControl(self.link, lambda text: self.announcements.say(text), self._refused)
        self.scenes = SceneLoader(self.loop, self._on_loaded, self._unshown)
        self.history = History(target.strip("/"), lambda: self._upload.attachments())
        self.follower = NodeFollower(
            self.link.target, self.scenes, self.history, self.announcements, self._on_event, self._on_begin
        )
        # The picture, and the hand in it.
        self.view = SceneView(server)
        self._com: Any = None
        self.drawn_poses = DrawnPoses()
        self.tools = Tools()
        self.pointer = Pointer(self.node.hand, self.scenes, self.drawn_poses, self.tools)
        # The past, and other beginnings.
        self.past_view = PastView(self.node, self.history, self.scenes)
        self.situations = SituationControl(
            self.node, self.history, self.past_view, self.announcements, self.pointer.let_go
        )
        self._make_panel(address)
        self.lessons.show_lesson_named(lesson)
        keyboard = Keyboard(self.node, self.past_view, self.situations, self.view, self.announcements)
        add_keys(server.gui, keyboard)
        self._open = asyncio.Event()
        self._slow_due_s = 0.0
        server.on_client_connect(self._on_connect)
        server.on_client_disconnect(self._on_disconnect)

    def _make_panel(self, address: str) -> None:
        gui, announcements = self.server.gui, self.announcements
        self._controls = Controls(gui, self.node.set, lambda text: self.announcements.say(text))
        self._readouts = ReadoutPanel(self.server)
        self._status = gui.add_markdown("")
        self.side_by_side = SideBySide(gui, lambda: self.lessons.fly_lesson(COMPARED))
        tabs = gui.add_tab_group()
        self._panel = Panel(
            gui, tabs, self._controls, self.tools, self.node, self.past_view, self.situations, announcements
        )
        self.body_tab = BodyTab(gui, tabs, self._controls, self.scenes, self.node, announcements)
        self.session_tab = SessionTab(
            gui,
            tabs,
            address,
            self.history,
            self.past_view,
            self.situations,
            announcements,
            lambda scene, script: self.lessons.fly(scene, script),
        )
        show_tab = ShowTab(gui, tabs, self.view, announcements, lambda name: self.lessons.did(f"show {name}"))
        self.lessons = LessonFolder(
            gui,
            self._panel.play_tab,
            self.scenes,
            self.situations,
            announcements,
            show_tab.show,
            self.view.body.label_contacts,
        )
        self._upload = UploadButton(
            self.server,
            self.body_tab.upload_place,
            self.scenes,
            self.situations,
            announcements,
            self.body_tab.show_verdict,
        )

    def deliver(self, function: Callable[..., object], *arguments: object) -> None:
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
        """Leave ROS, the node as it was before the past was shown, and nothing on the disk."""
        self.past_view.close()
        self.link.close()
        self._upload.close()

    def show_ended(self) -> None:
        """What stands on the page when its server ends: browsers show what was sent last for as long as
        they are open.
        """
        self._status.content = ENDED
        self.server.flush()

    def follow_link(self, link: str) -> None:
        """Take the node where a link leads, once a page is open."""
        self._begin_anew = False

        async def following() -> None:
            await self.scenes.known()  # before that nobody would see a refusal
            await self.session_tab.open_link(link)

        self._following = self.loop.create_task(following())

    # Browsers come and go

    async def _on_connect(self, _: viser.ClientHandle) -> None:
        if not self._open.is_set():
            self._status_of.received(time.monotonic())  # it has time to be heard
            self.link.listen()
            self._open.set()

    async def _on_disconnect(self, client: viser.ClientHandle) -> None:
        self.pointer.left(client.client_id)
        await asyncio.sleep(GRACE_S)
        if not self.server.get_clients() and self._open.is_set():
            self._open.clear()
            self.pointer.let_go()
            self.past_view.resume()
            self.link.stop_listening()
            # What happens from now on isn't heard: the memory of the flight ends here.
            self.follower.forget()
            self.history.forget()
            self.drawn_poses.forget()
            self.view.trails.forget()
            self._readouts.restart()
            self.scenes.forget()

    # What the node says

    def _on_scene(self, text: str) -> None:
        self.history.scene(text)
        self.scenes.load(text)

    def _unshown(self, error: InputError) -> None:
        self.announcements.say(f"The node's scene can't be shown: {error}")

    def _on_loaded(self, old: Scenario | None, scenario: Scenario) -> None:
        another = self.situations.another_body
        if self.view.set_body(scenario, zoom=another):
            self.drawn_poses.forget()
            self.pointer.attach(self.view.body.mesh)
            another = True
        if self.view.body.com is not self._com:
            self._com = self.view.body.com
            self.pointer.attach_com(self._com)
        if old is not None:
            self.follower.changed(old, scenario)
            self.lessons.changed(old, scenario)
        self.body_tab.changed(scenario, another)
        self._upload.flies(str(scenario.parameters.mesh))
        self._controls.update(scenario.parameters.named())
        self.situations.another_body = False
        if another:
            self.tools.usual_force = self.tools.force = suggested_force(scenario, 2.0 * self.view.radius)
            self._panel.show_force()
        if self._begin_anew:
            self._begin_anew = False
            self.past_view.reset()

    def _on_diagnostics(self, values: dict[str, str]) -> None:
        self.node.diagnostics = values
        self._status_of.report(values, time.monotonic())
        self._set_paused(values.get("state") == "paused")

    def _set_paused(self, paused: bool) -> None:
        self._panel.show_state(paused)
        self.node.on_paused(paused)

    def _refused(self, reason: str) -> None:
        self.announcements.say(f"Refused: {reason}")
        self._controls.show_again()

    def _on_event(self, kind: str, content: Any) -> None:
        if kind == "reset":
            self.node.hand.forget()
            self.view.trails.forget()
            if self.past_view.moment_ns is None:
                self.view.origin = np.zeros(3)
        elif kind == "pause":
            self._set_paused(bool(content.get("data")))
        elif kind.startswith("string_"):
            self.pointer.string_event(kind, content)
        self.lessons.acted(kind)

    def _on_begin(self) -> None:
        self.side_by_side.restart()
        self._readouts.restart()

    # Every frame

    def tick(self, now_s: float) -> None:
        """Take what the node has said and draw it."""
        received = self.link.take()
        self.follower.receive(received.states, received.events)
        for time_ns, row in received.states:
            self.view.trails.add(time_ns, row)
        if received.states:
            self._status_of.received(now_s)
        if self.scenes.scenario is not None:
            self.follower.follow(self.scenes.scenario, now_s)
            if self.follower.state is not None:
                self.lessons.watched([time_ns for time_ns, _ in received.states])
                self._draw(now_s, self.scenes.scenario, self.follower.state)
        self.pointer.hold()
        if now_s >= self._slow_due_s:
            self._slow_due_s = now_s + 1.0
            self._every_second(now_s)

    def _draw(self, now_s: float, scenario: Scenario, present: State) -> None:
        state, setup, view, acting = self._shown_state(present), scenario.setup, self.view, self.follower.acting
        looking_at = self.past_view.moment_ns
        looking = looking_at is not None
        left = self.history.ghost is not None
        ghost, com = self.follower.ghost_row(scenario, looking_at)
        view.follow(state.position, held=self.pointer.dragging)
        with self.server.atomic():
            view.place(state.row, now_s)
            view.place_surroundings(bool(np.any(setup.gravity)))
            view.body.look_again(now_s)
            view.draw_trails(now_s, state.time_ns, scenario)
            ends = None if looking else acting.string_ends(setup, state)
            view.show_string(ends, acting.slack_length, setup.gravity)
            view.show_loads([] if looking else acting.arrows(setup, state, 2.0 * view.radius))
            view.show_hit(None if looking else acting.hit(setup, state))
            momentum, spin = state.angular_momentum(setup.body.inertia), state.angular_velocity
            scales = view.show_motion(state.position, momentum, spin)
            view.show_ghost(ghost, com, names(scenario, left))
            began_ns = None if left else self.follower.ghost.began_ns
            self.side_by_side.show(now_s, scenario, state, ghost, began_ns)
        self.drawn_poses.add(DrawnPose(now_s, state.position, state.orientation_xyzw, view.origin.copy(), view.unit))
        stretched = 0.0 if looking else acting.string_energy(setup, state)
        self._readouts.show(now_s, scenario, state, stretched, scales, self.side_by_side.angle)

    def _shown_state(self, present: State) -> State:
        moment_ns = self.past_view.moment_ns
        if moment_ns is not None:
            row = self.history.row(moment_ns)
            if row is not None:
                return State(self.history.simulated_ns(moment_ns), core_row(row))
        return present

    def _every_second(self, now_s: float) -> None:
        self.session_tab.every_second()
        status = self._status_of.text(now_s, self.announcements.activity)
        if self._status.content != status:
            self._status.content = status
