# SPDX-License-Identifier: MIT
"""The page's logic, with a socket for a browser and a stand-in for the link to ROS: what the node is told, and when."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from flown_page import PageInProcess
from workbench_page import bare_page

viser = pytest.importorskip("viser", reason="viser is not installed: no interactive page")
pytest.importorskip("rclpy", reason="rclpy is not installed: no link to ROS")

from rigid_proto_ros.scene.offline import read_scene
from rigid_proto_ros.workbench import node_control
from rigid_proto_ros.workbench import page as page_module
from rigid_proto_ros.workbench.node_control import ParameterSetter
from rigid_proto_ros.workbench.ros_link import Received, SimulatedTimes

PATIENCE_S = 60.0
STEP_NS = 100_000_000


class StandIn:
    """For RosLink: a node that takes whatever it is told, at once. told: what it was, in order."""

    def __init__(self, target, deliver, on_scene, on_diagnostics) -> None:
        self.target = target
        self.times = SimulatedTimes()
        self.told: list[tuple] = []
        self.taken = True
        self.values: dict = {}
        self._deliver, self._on_scene = deliver, on_scene
        self._heard = Received()

    def listen(self) -> None:
        self.told.append(("listen",))
        self._say_scene()

    def _say_scene(self) -> None:
        self._deliver(self._on_scene, read_scene("t_handle", self.values).text)

    def stop_listening(self) -> None:
        self.told.append(("stop_listening",))

    def say(self, states=(), events=()) -> None:
        """On the page's thread: what the page hears at its next look."""
        self._heard.states.extend(states)
        self._heard.events.extend(events)

    def take(self) -> Received:
        heard, self._heard = self._heard, Received()
        return heard

    def call(self, service, data=None, done=None) -> None:
        self.told.append((service, data))
        if done is not None:
            self._deliver(done, True, "")

    def set_parameters(self, changes, done=None) -> None:
        self.told.append(("set", dict(changes)))
        if self.taken:
            self.values |= changes
            self._say_scene()
        self._deliver(done, self.taken, "" if self.taken else "not that")

    def close(self) -> None:
        self.told.append(("close",))


class Desk(PageInProcess):
    """A page with a stand-in for its link."""

    @property
    def link(self) -> StandIn:
        return self.page.link

    def fly(self, seconds: float = 2.0, begin_s: float = 0.0) -> None:
        """Let the page hear of a flight up to there."""
        row = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *[0.0] * 6])
        first, last = (round(t * 1e9 / STEP_NS) for t in (begin_s, seconds))
        states = [(k * STEP_NS, row) for k in range(first, last + 1)]
        self.until(lambda: self.page.scenes.scenario is not None, "scene")
        self.do(lambda: self.link.say(states))
        self.until(lambda: self.page.history.span[1] == states[-1][0], "flight")

    def input(self, label: str):
        inputs = self.server.gui._gui_input_handle_from_uuid.values()
        (found,) = [handle for handle in inputs if getattr(handle, "label", None) == label]
        return found

    def drag(self, socket, label: str, value) -> None:
        """Move an input as a browser says it."""
        import msgspec.msgpack

        update = {"type": "GuiUpdateMessage", "uuid": self.input(label)._impl.uuid, "updates": {"value": value}}
        socket.send(msgspec.msgpack.encode(update))

    def past_view(self, socket) -> None:
        """A page scrubs one second back."""
        self.drag(socket, "Seconds back", 1.0)
        self.until(lambda: self.page.past_view.moment_ns == 1_000_000_000, "looking back")
        assert self.link.told[-1] == ("pause", True)

    @property
    def shows_now(self) -> bool:
        button = self.page.session_tab._go_on
        return self.page.past_view.moment_ns is None and self.input("Seconds back").value == 0.0 and button.disabled


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    monkeypatch.setattr(page_module, "RosLink", StandIn)
    monkeypatch.setattr(page_module, "GRACE_S", 0.0)
    desk = Desk()
    yield desk
    desk.end()


@pytest.mark.parametrize("paused", [False, True])
def test_the_last_page_that_closes_while_it_looks_back_leaves_the_node_as_it_was(desk: Desk, paused: bool) -> None:
    with bare_page(desk.server.get_port()) as socket:
        desk.fly()
        desk.page.node.paused = paused
        desk.past_view(socket)
    desk.until(lambda: ("stop_listening",) in desk.link.told, "end of listening")
    assert desk.link.told[-2:] == [("pause", paused), ("stop_listening",)]
    assert desk.shows_now


def test_a_page_server_that_ends_while_somebody_looks_back_leaves_the_node_as_it_was(desk: Desk, recwarn) -> None:
    with bare_page(desk.server.get_port()) as socket:
        desk.fly()
        desk.past_view(socket)
        desk.end()
    assert desk.link.told[-2:] == [("pause", False), ("close",)]
    assert not [str(warning.message) for warning in recwarn]


def test_a_lesson_chosen_while_looking_back_is_shown_as_it_is_now(desk: Desk) -> None:
    with bare_page(desk.server.get_port()) as socket:
        desk.fly()
        desk.past_view(socket)
        lesson = desk.input("Lesson").options[-1]
        desk.drag(socket, "Lesson", lesson)
        desk.until(lambda: desk.link.told[-1] == ("pause", False), "lesson")
        assert ("reset", None) in desk.link.told
        desk.until(lambda: desk.shows_now, "present")


def test_a_lesson_that_the_node_refuses_while_somebody_looks_back_leaves_it_running_and_shown_as_it_is(desk) -> None:
    with bare_page(desk.server.get_port()) as socket:
        desk.fly()
        desk.past_view(socket)
        desk.link.taken = False
        desk.drag(socket, "Lesson", desk.input("Lesson").options[-1])
        desk.until(lambda: any("not that" in text for text in desk.said), "refusal")
        assert desk.shows_now and desk.link.told[-1] == ("pause", False)


def test_a_damaged_link_that_opens_the_page_is_refused_when_somebody_can_see_it(desk: Desk) -> None:
    desk.do(lambda: desk.page.follow_link("1.AAAA"))
    desk.do(lambda: asyncio.sleep(0.0))
    assert desk.said == []
    with bare_page(desk.server.get_port()):
        desk.until(lambda: any("damaged" in text for text in desk.said), "refusal")


EXPLICIT = {"inertia_model": "explicit", "explicit_inertia.tensor": [1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3]}


@pytest.mark.parametrize(
    "model, mass",
    [
        ({"mass": 0.4}, "mass"),
        ({"mass": 0.0}, "mass"),  # by density
        ({**EXPLICIT, "explicit_inertia.mass": 0.4}, "explicit_inertia.mass"),
    ],
)
def test_times_the_mass_is_that_of_the_body_without_its_ballast(desk: Desk, model: dict, mass: str) -> None:
    desk.link.values = {**model, "ballast.weight": [0.6, 0.0, 0.0, 0.0]}
    with bare_page(desk.server.get_port()) as socket:
        desk.until(lambda: desk.page.scenes.scenario is not None, "scene")
        own = desk.page.scenes.scenario.setup.body.mass - 0.6
        assert desk.input("Mass ×").value == "1"
        desk.drag(socket, "Mass ×", "10")
        desk.until(lambda: desk.page.scenes.scenario.parameters.named()[mass] != model[mass], "another mass")
        assert desk.page.scenes.scenario.parameters.named()[mass] == pytest.approx(10.0 * own, rel=1e-12)
        desk.do(lambda: desk.page._controls.update(desk.page.scenes.scenario.parameters.named(), at_once=True))
        assert desk.input("Mass ×").value == "10"


def test_lines_that_are_no_events_are_passed_over_and_said_once(desk: Desk) -> None:
    garbage = ["", "{", "[]", '{"time_ns": -1, "kind": "poke", "content": {}}', '{"kind": 5}', "[" * 100_000]
    without_content = [f'{{"time_ns": 0, "kind": "{kind}", "content": {{}}}}' for kind in ("poke", "string_target")]
    odd = '{"time_ns": 0, "kind": "poke", "content": {"frame_id": 5, "force": "x", "torque": {}}}'
    with bare_page(desk.server.get_port()):
        desk.fly(1.0)
        desk.do(lambda: desk.link.say(events=[*garbage, *without_content, odd]))
        desk.do(lambda: desk.link.say(events=garbage))
        desk.fly(3.0, begin_s=1.1)  # it still listens
        assert not desk.running.done()
        assert len([text for text in desk.said if "/rigid_body/events" in text]) == 1


@pytest.mark.parametrize("late", [False, True])
def test_a_parameter_call_that_nobody_answers_is_given_up_and_the_next_one_made(late: bool, monkeypatch) -> None:
    """As when a node dies in it and is started again: what was set meanwhile goes to the new one."""
    monkeypatch.setattr(node_control, "ANSWER_S", 0.0)
    sent: list[tuple[dict, Callable]] = []
    refused: list[str] = []
    setter = ParameterSetter(lambda changes, done: sent.append((changes, done)), refused.append)

    async def node_dies() -> None:
        setter.set({"mass": 1.0})
        monkeypatch.setattr(node_control, "ANSWER_S", 1e6)
        setter.set({"mass": 2.0, "step": 0.01})
        while len(sent) < 2:
            await asyncio.sleep(0.01)
        if late:
            sent[0][1](False, "late")  # the answer to the call that was given up says nothing about this one
        setter.set({"mass": 3.0})
        assert len(sent) == 2
        sent[1][1](True, "")
        setter.set({"mass": 4.0})
        sent[2][1](True, "")

    asyncio.run(asyncio.wait_for(node_dies(), PATIENCE_S))
    assert [changes for changes, _ in sent] == [
        {"mass": 1.0},
        {"mass": 2.0, "step": 0.01},
        {"mass": 3.0},
        {"mass": 4.0},
    ]
    assert len(refused) == 1 and "no answer of the node" in refused[0]


def test_stamps_of_a_clock_are_read_as_simulated_time_whenever_the_page_opens() -> None:
    second = 1_000_000_000
    times = SimulatedTimes()
    assert times.of(3 * second) == 3 * second
    times.reported({"stamp_offset_ns": "0"})
    assert times.offset_ns == 0
    # A page that opens later hears it from a report, one that is open from the event; an old report comes after it.
    times.reported({"stamp_offset_ns": str(1000 * second)})
    assert times.of(1002 * second) == 2 * second
    times.heard('{"time_ns": 0, "kind": "clock", "content": {"offset_ns": 1010000000000}}')
    times.reported({"stamp_offset_ns": str(1000 * second)})
    assert (times.of(1012 * second), times.offset_ns) == (2 * second, 1010 * second)
    # A state of before the event that comes late.
    assert times.of(1009 * second) == 9 * second
    times.heard('no line of the log: "clock"')
    assert times.offset_ns == 1010 * second


def test_browsers_look_where_the_pointer_is_while_the_body_moves_and_not_while_it_rests(desk: Desk) -> None:
    """Whatever changes in its picture has a browser draw for a quarter of a second; at rest it should do nothing."""
    first_s = 1e9  # later than any look of the page itself

    def looks() -> list[tuple[int, ...]]:
        view, colours = desk.page.view, []
        for k, x in enumerate([*np.zeros(20), *np.linspace(0.1, 1.0, 20), *np.ones(20)]):
            view.place(np.array([x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), first_s + 0.25 * k)
            view.body.look_again(first_s + 0.25 * k)
            colours.append(tuple(view.body.mesh.color))
        return colours

    with bare_page(desk.server.get_port()):
        desk.fly()
        colours = desk.do(looks)
    assert len(set(colours[4:20])) == len(set(colours[44:])) == 1
    assert all(a != b for a, b in zip(colours[20:42], colours[21:42], strict=False))
