# SPDX-License-Identifier: MIT
"""What hands do on the page acts in the order in which it was done, though the body be paused."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("viser")

from flown_page import FlownLink

from rigid_proto_ros.session.runs import decode_event
from rigid_proto_ros.workbench.drawn_poses import DrawnPose
from rigid_proto_ros.workbench.hand_commands import HandCommands
from rigid_proto_ros.workbench.pointer import Pointer, Tools

SECOND = 10**9


class Hand:
    """A pointer on a body of the link's own simulation."""

    def __init__(self, paused: bool) -> None:
        self.link = FlownLink(
            "/rigid_body", lambda function, *arguments: function(*arguments), lambda text: None, lambda values: None
        )
        self.page = SimpleNamespace(scenario=self.link.scenario, paused=paused)
        self.hand = HandCommands(self.link, lambda: self.page.paused)
        state = self.link.simulation.state
        self.seen = DrawnPose(0.0, state.position, state.orientation_xyzw, np.zeros(3), 1.0)
        drawn_poses = SimpleNamespace(of_point=lambda *_: self.seen)
        self.pointer = Pointer(self.hand, self.page, drawn_poses, Tools(force=0.01))

    def kinds(self) -> list[str]:
        return [decode_event(line, 1)[1] for line in self.link._log.lines]

    def drag(self) -> None:
        """Grab, pull twice and let go, all while time stands still."""

        async def dragging() -> None:
            self.pointer.grab(1, np.array([0.0, 0.0, 0.07]), np.array([0.0, 0.0, 0.1]))
            self.pointer.pull(np.array([0.1, 0.0, 0.2]))
            self.pointer.pull(np.array([-0.3, 0.0, 0.1]))
            self.pointer.let_go()

        asyncio.run(dragging())


def test_a_drag_while_paused_acts_in_the_order_in_which_it_was_done_and_its_string_pulls_at_nothing() -> None:
    hand = Hand(paused=True)
    hand.drag()
    eye, direction = np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])
    assert hand.pointer.click(eye, direction, hand.seen, push=False)
    hand.drag()
    assert not hand.kinds() and not hand.pointer.dragging
    hand.hand.go_on()
    assert hand.link.received == 2 * 6 + 1
    hand.link.fly(1.0)
    drag = ["set", "string_attach", "string_target", "string_target", "string_target", "string_release"]
    assert hand.kinds() == [*drag, "poke", *drag[:]]
    # Nobody holds the string: only the poke has moved the body.
    assert hand.link.simulation.string is None
    alone = Hand(paused=False)
    alone.pointer.click(eye, direction, alone.seen, push=False)
    alone.link.fly(1.0)
    np.testing.assert_array_equal(
        hand.link.simulation.state.linear_velocity, alone.link.simulation.state.linear_velocity
    )


def test_a_release_taken_together_with_the_last_target_is_sent_again_and_nobody_holds_the_string() -> None:
    hand = Hand(paused=False)

    async def dragging() -> None:
        hand.pointer.grab(1, np.array([0.0, 0.0, 0.07]), np.array([0.0, 0.0, 0.1]))
        hand.link.fly(0.05)
        hand.pointer.pull(np.array([0.1, 0.0, 0.2]))
        hand.pointer.let_go()
        await asyncio.sleep(0.1)

    asyncio.run(dragging())
    hand.link.fly(0.01)
    assert hand.kinds()[-2:] == ["string_release", "string_target"] and hand.link.simulation.string is not None
    for line in hand.link._log.lines:
        hand.pointer.string_event(*decode_event(line, 1)[1:])
    hand.link.fly(0.01)
    assert hand.kinds()[-1] == "string_release" and hand.link.simulation.string is None
    assert not hand.pointer.dragging


def test_a_page_that_goes_while_it_pulls_leaves_the_string_to_the_others() -> None:
    hand = Hand(paused=False)

    async def pulling() -> None:
        hand.pointer.grab(1, np.array([0.0, 0.0, 0.07]), np.array([0.0, 0.0, 0.1]))
        hand.link.fly(0.05)
        hand.pointer.left(2)  # somebody else
        assert hand.pointer.dragging
        hand.pointer.left(1)
        assert not hand.pointer.dragging
        await asyncio.sleep(0.1)
        hand.link.fly(0.01)
        assert hand.link.simulation.string is None
        hand.pointer.grab(2, np.array([0.0, 0.0, 0.07]), np.array([0.0, 0.0, 0.1]))
        assert hand.pointer.dragging

    asyncio.run(pulling())


def test_what_is_done_together_in_flight_is_one_message_and_waits_for_nothing() -> None:
    hand = Hand(paused=False)

    async def grab() -> None:
        hand.pointer.grab(1, np.array([0.0, 0.0, 0.07]), np.array([0.0, 0.0, 0.1]))

    hand.pointer._tools.at_com = True
    hand.pointer.string_event("string_attach", {})
    asyncio.run(grab())
    assert hand.link.received == 4
    hand.link.fly(0.01)
    (frequency, aside, knot, target) = (decode_event(line, 1)[2] for line in hand.link._log.lines)
    assert hand.kinds() == ["set", "set", "set", "string_target"] and target["point"] == [0.0, 0.0, 0.1]
    assert frequency == {"string.frequency": 8.0}
    in_force = list(hand.link.scenario.parameters.string.attach)
    assert knot["string.attach"] == in_force != aside["string.attach"]
    assert hand.pointer.dragging


def test_parameters_set_while_paused_act_between_what_is_done_by_hand_before_and_after() -> None:
    hand = Hand(paused=True)
    answers: list[bool] = []

    def set_mass(kilograms: float) -> None:
        hand.hand.set_parameters({"mass": kilograms}, lambda successful, reason: answers.append(successful))

    eye, direction = np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])

    def click() -> None:
        assert hand.pointer.click(eye, direction, hand.seen, push=False)

    click()
    set_mass(1.0)
    set_mass(2.0)  # the slider goes on
    click()
    set_mass(-1.0)
    set_mass(3.0)
    # Seen at once, as the node has them; nothing else has acted.
    assert hand.link.scenario.parameters.mass == 3.0 and not hand.kinds()
    assert answers == [True, True, False, True]
    hand.hand.go_on()
    hand.link.fly(0.001)
    acted = [decode_event(line, 1)[1:] for line in hand.link._log.lines]
    in_order = [("poke", None), ("set", 2.0), ("poke", None), ("set", 3.0)]
    assert [(kind, content.get("mass")) for kind, content in acted][:4] == in_order
    assert hand.link.scenario.parameters.mass == hand.link.simulation.setup.body.mass == 3.0
    # Nothing done by hand: the service alone.
    set_mass(4.0)
    received = hand.link.received
    hand.hand.go_on()
    assert hand.link.received == received and hand.link.scenario.parameters.mass == 4.0


def test_another_tensor_set_while_paused_acts_in_its_place_among_what_is_done_by_hand() -> None:
    hand = Hand(paused=True)
    eye, direction = np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])
    for model in ("shell", "bounding_box"):
        assert hand.pointer.click(eye, direction, hand.seen, push=False)
        hand.hand.set_parameters({"inertia_model": model}, lambda successful, reason: None)
    assert hand.link.scenario.parameters.inertia_model == "bounding_box" and not hand.kinds()
    hand.hand.go_on()
    hand.link.fly(0.001)
    acted = [decode_event(line, 1)[1:] for line in hand.link._log.lines]
    in_order = [("poke", None), ("set", "shell"), ("poke", None), ("set", "bounding_box")]
    assert [(kind, content.get("inertia_model")) for kind, content in acted][:4] == in_order


def test_what_was_done_before_a_reset_is_forgotten_with_it() -> None:
    hand = Hand(paused=True)
    hand.drag()
    hand.hand.forget()
    hand.hand.go_on()
    assert hand.link.received == 0
