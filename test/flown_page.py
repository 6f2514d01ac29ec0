# SPDX-License-Identifier: MIT
"""The page without a browser and without ROS: its own callbacks on one end, a simulation in the node's place on the other."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Callable

import numpy as np
from flights import EventLines
from viser._messages import GuiUpdateMessage
from workbench_page import bare_page

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.base.rotation import rotate
from rigid_proto_ros.messages.session_messages import read_string
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.scene.command_codec import core_command, of_message, string_attach, string_target
from rigid_proto_ros.scene.scenario import Scenario, make_scenario, nanoseconds
from rigid_proto_ros.scene.script import (
    expand_schedule,
    expand_script,
    read_schedule,
)
from rigid_proto_ros.scene.yaml_text import load_plain_yaml
from rigid_proto_ros.simulation.commands import Change, WrenchCommand
from rigid_proto_ros.simulation.simulation import Simulation
from rigid_proto_ros.workbench.drawn_poses import DrawnPose
from rigid_proto_ros.workbench.ros_link import Received, SimulatedTimes

PATIENCE_S = 60.0
PERIOD_NS = 10_000_000


class FlownLink:
    """For RosLink: a body that flies as far as it is told to, and takes what the page says as the node does.

    rows: every state published since the last reset, (time_ns, 13 numbers in world axes).
    """

    def __init__(self, target, deliver, on_scene, on_diagnostics) -> None:
        self.target = target
        self.times = SimulatedTimes()
        self._deliver, self._on_scene, self._on_diagnostics = deliver, on_scene, on_diagnostics
        self._log = EventLines()
        self.scenario: Scenario = make_scenario({})
        self.simulation = Simulation(self.scenario.setup, self._log)
        self.rows: list[tuple[int, np.ndarray]] = []
        self.refused: list[str] = []
        self.received = 0
        self._told = self._lists = 0
        self._heard = Received()

    # The page's side

    def listen(self) -> None:
        self._say_scene()

    def stop_listening(self) -> None:
        pass

    def close(self) -> None:
        pass

    def take(self) -> Received:
        heard, self._heard = self._heard, Received()
        return heard

    def wrench(self, topic, frame_id, force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0)) -> None:
        frame = parse_frame(frame_id, self.scenario.setup.contacts, "world", "rigid_body")
        force, torque = tuple(map(float, force)), tuple(map(float, torque))
        self._submit(WrenchCommand(topic == "wrench", frame, force, torque, 0, frame_id))

    def point(self, topic, frame_id, point) -> None:
        read = string_attach if topic == "string/attach" else string_target
        self._submit(read(0, frame_id, tuple(float(x) for x in point)))

    def schedule(self, entry: str) -> None:
        for command in expand_script([load_plain_yaml(entry, "entry")]):
            self.command(command)

    def send(self, topic: str, data: bytes) -> None:
        if topic != "schedule":
            self.command(of_message(topic, data))
            return
        entries = read_schedule(read_string(data, topic))
        self._lists += 1
        for number, command in enumerate(expand_schedule(entries)):
            self.command(command, (self._lists, number) if isinstance(entries, list) else None)

    def command(self, command, listed=None) -> None:
        own = core_command(command, command.t_ns, self.scenario.setup.contacts, self._change, ("world", "rigid_body"))
        self._submit(own, command.t_ns, listed)

    def call(self, service, data=None, done=None) -> None:
        if service == "reset":
            self._log.timed.clear()
            self._told = 0
            self.simulation.reset(self.scenario.setup)
            self.rows.clear()
            self._publish()
        elif service == "string/release":
            self._submit(core_command(*expand_script([{"t": 0, "string": "release"}]), 0, (), self._change))
        elif service in ("pause", "step"):
            self.simulation.log("pause", {"data": bool(data)})
        if done is not None:
            self._deliver(done, True, "")

    def set_parameters(self, changes, done=None) -> None:
        try:
            scenario = self.scenario.with_changes(changes)
            self.simulation.check_change(scenario.setup)
        except InputError as error:
            self.refused.append(str(error))
            if done is not None:
                self._deliver(done, False, str(error))
            return
        self.scenario = scenario
        self._say_scene()
        self.simulation.submit(Change(dict(changes), lambda: scenario.setup))
        if done is not None:
            self._deliver(done, True, "")

    # The body's side

    def fly(self, seconds: float) -> None:
        """Carry the body on, a state every PERIOD_NS."""
        end_ns = self.simulation.time_ns + nanoseconds(seconds)
        while self.simulation.time_ns < end_ns:
            next_ns = (self.simulation.time_ns // PERIOD_NS + 1) * PERIOD_NS
            self.simulation.advance(min(next_ns, end_ns))
            assert not self.simulation.failure
            self._publish()

    def report(self) -> None:
        """What /diagnostics says."""
        self._deliver(self._on_diagnostics, {"state": "flying", "commands_received": str(self.received)})

    def _publish(self) -> None:
        state = self.simulation.state
        row = np.array([*state.row[:10], *rotate(*state.row[3:7], *state.row[10:13])])
        self.rows.append((self.simulation.time_ns, row))
        self._heard.events.extend(line for _, line in self._log.timed[self._told :])
        self._told = len(self._log.timed)
        self._heard.states.append(self.rows[-1])

    def _submit(self, command, at_ns=None, listed=None) -> None:
        self.received += 1
        self.simulation.submit(command, at_ns, listed)
        self.report()

    def _change(self, changes):
        self.scenario = self.scenario.with_changes(changes)
        self._say_scene()
        return self.scenario.setup

    def _say_scene(self) -> None:
        self._deliver(self._on_scene, self.scenario.text)


class PageInProcess:
    """A page with its server, in this process. ``do`` runs a function on the page's thread. said: what it says in its corner."""

    def __init__(self, lesson: str = "", anew: bool = False) -> None:
        from rigid_proto_ros.rerun_view.ports import LOOPBACK, any_free_port
        from rigid_proto_ros.workbench.page import Page
        from rigid_proto_ros.workbench.server import make_server

        self.server = make_server(LOOPBACK, any_free_port(), lambda link: None)
        self.page: Page = self.do(lambda: Page(self.server, "/rigid_body", "http://here", lesson, anew))
        self.said: list[str] = []
        self.page.announcements.say = self.said.append
        self.running = asyncio.run_coroutine_threadsafe(self.page.run(), self.page.loop)

    def end(self) -> None:
        """As the page's process ends."""
        from rigid_proto_ros.workbench.server import stop_server

        if not self.running.cancelled():
            self.running.cancel()
            stop_server(self.server)
            self.page.close()

    def do(self, function: Callable):
        async def done():
            found = function()
            return await found if asyncio.iscoroutine(found) else found

        return asyncio.run_coroutine_threadsafe(done(), self.server.get_event_loop()).result(PATIENCE_S)

    def until(self, condition: Callable[[], object], what: str):
        deadline = time.monotonic() + PATIENCE_S
        while not (found := self.do(condition)):
            assert time.monotonic() < deadline, f"no {what}; said {self.said}"
            time.sleep(0.005)
        return found


class FlownPage(PageInProcess):
    """A user at the page, by its own callbacks. All times are simulated."""

    def __init__(self, lesson: str = "", anew: bool = False) -> None:
        from rigid_proto_ros.live.warm_up import warm_up

        warm_up(make_scenario({}).setup)  # compiled on the page's thread, kernels would let its socket time out
        super().__init__(lesson, anew)
        self.link: FlownLink = self.page.link
        self._socket = bare_page(self.server.get_port())
        self.browser = self._socket.__enter__()
        self.until(lambda: self.page.scenes.scenario is not None, "scene")
        self.fly(0.0)

    def end(self) -> None:
        self._socket.__exit__(None, None, None)
        super().end()

    # What a user does

    def fly(self, seconds: float) -> list[tuple[int, np.ndarray]]:
        """Watch for so long; the states since the last reset."""

        def fly() -> None:
            self.link.fly(seconds)
            if seconds == 0.0:
                self.link._publish()

        self.do(fly)
        self.wait_until_still()
        return self.link.rows

    def wait_until_still(self) -> None:
        """Until the page shows what the body does, under the parameters in force."""

        def shown() -> bool:
            page, link = self.page, self.link
            at = (
                page.follower.state is not None
                and page.follower.state.time_ns == link.rows[-1][0]
                and not page.follower.waiting
            )
            return at and not page.scenes.busy and page.scenes.scenario.parameters == link.scenario.parameters

        self.until(shown, "page that has heard all")

    def widget(self, label: str):
        """An input, a button or a button group by its label."""
        found = [w for w in self._widgets() if getattr(w, "label", None) == label]
        assert len(found) == 1, f"{len(found)} inputs are called {label!r}"
        return found[0]

    def _widgets(self):
        return self.server.gui._gui_input_handle_from_uuid.values()

    def set(self, label: str, value) -> None:
        """Write, move, switch or choose."""
        widget = self._usable(label)
        if hasattr(widget, "options"):
            assert value in widget.options, f"{label}: {widget.options}"
        self._update(widget, value)

    def press(self, label: str, of: str = "") -> None:
        """A button; ``of`` a group."""
        self._update(self._usable(of or label), label if of else True)

    def _usable(self, label: str):
        widget = self.widget(label)
        assert widget.visible and not getattr(widget, "disabled", False), label
        return widget

    def _update(self, widget, value) -> None:
        """As a browser says it; until the page has done what it means."""

        async def update() -> None:
            (client,) = self.server.get_clients()
            message = GuiUpdateMessage(widget._impl.uuid, {"value": value})
            await self.server.gui._handle_gui_updates(client, message)
            await asyncio.sleep(0.01)

        self.do(update)
        self.until(lambda: not (self.page.announcements.activity or self.page.node.busy), "node that has taken it")
        self.wait_until_still()

    def pick(self, title: str) -> None:
        """A lesson of the list."""
        self.set("Lesson", title)
        self.wait_until_still()

    def click(self, mesh_point, direction=None) -> None:
        """Click on the body, as it is drawn, where it has this point; direction of the view (3,) [world]."""
        state, body = self.page.follower.state, self.page.scenes.scenario.setup.body
        view = self.page.view
        seen = DrawnPose(0.0, state.position, state.orientation_xyzw, view.origin.copy(), view.unit)
        point = state.position + state.rotation @ body.point(tuple(mesh_point))
        direction = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
        eye = (point - 3.0 * view.radius * direction - view.origin) / view.unit
        assert self.do(lambda: self.page.pointer.click(eye, direction, seen, push=False)), "a click beside the body"

    def grab(self, mesh_point) -> np.ndarray:
        """Press on the body at this point; where that is (3,) [world]."""
        state, body, view = self.page.follower.state, self.page.scenes.scenario.setup.body, self.page.view
        place = state.position + state.rotation @ body.point(tuple(mesh_point))
        drawn = (place - view.origin) / view.unit
        self.do(lambda: self.page.pointer.grab(1, drawn, drawn))
        return place

    def pull(self, place) -> None:
        """Move the pointer to a place (3,) [world]."""
        view = self.page.view
        self.do(lambda: self.page.pointer.pull((np.asarray(place) - view.origin) / view.unit))

    def let_go(self) -> None:
        def let_go() -> None:
            self.page.pointer.let_go()
            self.link.fly(0.01)  # the last target acts before the release comes

        self.do(let_go)
        self.until(lambda: self.page.pointer._drag is None, "hand that lets go")

    def reset(self) -> None:
        self.press("Reset", of="Simulation")


def numbers(text: str) -> list[float]:
    return [float(x) for x in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text)]
