# SPDX-License-Identifier: MIT
"""What was done by hand becomes a scene and a script that give the same motion again, bit for bit."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from flights import SECOND, EventLines
from hypothesis import given, settings
from hypothesis.strategies import (
    SearchStrategy,
    booleans,
    fixed_dictionaries,
    floats,
    integers,
    just,
    lists,
    one_of,
    sampled_from,
    tuples,
)

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.parameters.declarations import with_mass_of_density
from rigid_proto_ros.scene.command_codec import of_event
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun, ScenarioRun
from rigid_proto_ros.scene.scene_file import read_scene_text
from rigid_proto_ros.scene.script import expand_schedule, parse_script, read_schedule, schedules
from rigid_proto_ros.session.as_script import SceneAndScript, script_of_session
from rigid_proto_ros.session.recorded_session import RecordedSession, StateRows


class HandSession:
    """A body under hands: drags, clicks, sliders and pauses, taken as the node takes them, with its event log."""

    def __init__(self, values: dict) -> None:
        self.first = make_scenario(values)
        self.log = EventLines()
        self.run = ScenarioRun(self.first, self.log)
        self.simulation = self.run.simulation
        self.now_ns = 0

    def wait(self, time_ns: int, every_ns: int = 10_000_000) -> None:
        """Let time pass, states published as it does."""
        until_ns = self.now_ns + time_ns
        while self.now_ns < until_ns:
            self.now_ns = min(until_ns, (self.now_ns // every_ns + 1) * every_ns)
            self.simulation.advance(self.now_ns)
            assert not self.simulation.failure

    def act(self, kind: str, **content) -> None:
        """What a message or a parameter call of this kind does now; a refused one changes nothing."""
        with suppress(InputError):
            if kind == "pause":
                self.simulation.log(kind, {"data": True})  # commands now pile up at one instant
            else:
                command = of_event(kind, with_mass_of_density(content) if kind == "set" else content)
                self.run.take(command)

    def load(self, kind: str, frame_id: str, force, torque=(0.0, 0.0, 0.0)) -> None:
        """A message of the wrench or the poke topic."""
        self.act(kind, frame_id=frame_id, force=force, torque=torque)

    def click(self, size: float, option: str) -> None:
        """A poke along a ray from an eye to a point of the body."""
        position, body = self.simulation.state.position, self.run.scenario.setup.body
        eye = position + np.array([1.0, 0.3, 0.2])
        way = position + self.simulation.state.rotation @ body.point((0.0, 0.0, 0.03)) - eye
        ray = "/".join(",".join(repr(float(x)) for x in v) for v in (eye, way))
        self.load("poke", f"world@ray/{ray};{option}", size * way)

    def session(self) -> RecordedSession:
        """As a client has heard it."""
        return RecordedSession(
            scene=self.first.text,
            events=list(self.log.timed),
            states=StateRows(np.array([self.now_ns]), self.simulation.state.row[None].copy()),
        )


SCENE = {
    "mesh": "t_handle",
    "density": 7850.0,
    "initial.angular_velocity": [0.05, 0.1, 12.0],
    "string.stiffness": 1.0,
    "string.damping_ratio": 0.3,
    "contacts.tip": [0.0, 0.0, 0.07],
}


def vectors(size: float) -> SearchStrategy:
    return lists(floats(-size, size), min_size=3, max_size=3)


def deed(name: str, **content: SearchStrategy) -> SearchStrategy:
    return tuples(just(name), fixed_dictionaries(content))


SLIDERS = {
    "mass": floats(0.1, 0.3),
    "density": floats(4000.0, 9000.0),
    "scale": lists(floats(0.8, 1.2), min_size=3, max_size=3),
    "ballast.tip": floats(0.0, 0.03).map(lambda mass: [mass, 0.0, 0.0, 0.07]),
    "inertia_model": sampled_from(("solid", "shell", "bounding_box", "points")),
    "gravity": floats(-0.3, 0.0).map(lambda along_z: [0.0, 0.0, along_z]),
    "linear_damping": floats(0.0, 0.1),
    "string.attached": booleans(),
    "string.target": vectors(0.2),
    "string.stiffness": floats(0.5, 2.0),
    "poke_duration": floats(0.01, 0.1),
    "gyroscopic": booleans(),
    "record": just("somewhere.mcap"),
}
INERTIA = {"mass": just(0.2), "com": vectors(1e-3), "tensor": just([3e-5, 0.0, 0.0, 1e-4, 0.0, 1.2e-4])}
HELD = {"force": vectors(0.02), "torque": vectors(1e-4)}
PUSH = {"force": floats(0.0, 5e-4).map(lambda size: [size, 0.0, 0.0]), "torque": just([0.0, 0.0, 0.0])}
DEEDS = one_of(
    deed("wait", time_ns=integers(1, 200_000_000)),
    deed("wait", time_ns=integers(1, 200_000_000)),
    deed("string_attach", frame_id=sampled_from(("body/mesh", "body", "world")), point=vectors(0.03)),
    deed("string_target", frame_id=just("world"), point=vectors(0.2)),
    deed("string_release"),
    deed("wrench", frame_id=sampled_from(("", "world@tip", "body@vertex/3", "body")), **HELD),
    deed("clear_wrench"),
    deed(
        "poke", frame_id=sampled_from(("normal@vertex/5;impulse", "normal@vertex/7;duration=0.1", "normal@tip")), **PUSH
    ),
    deed("click", size=floats(0.0, 1e-3), option=sampled_from(("impulse", "duration=0.05"))),
    deed("inertia", frame_id=just(""), **INERTIA),
    deed("pause"),
    one_of(*(deed("set", **{name: value}) for name, value in SLIDERS.items())),
)
"""What hands do, with forces and places that suit the T-handle."""


def flown(saved: SceneAndScript, until_ns: int) -> State:
    """The last state of ``simulate SCENE --script SCRIPT``."""
    run = OfflineRun(make_scenario(read_scene_text(saved.scene).values), parse_script(saved.script))
    assert run.advance(until_ns)
    assert not run.simulation.refused
    return run.simulation.state


def assert_flies_again(hand: HandSession) -> SceneAndScript:
    saved = script_of_session(hand.session())
    assert flown(saved, hand.now_ns).sha256() == hand.simulation.state.sha256()
    return saved


@given(deeds=lists(DEEDS, min_size=30, max_size=60))
@settings(max_examples=5)
def test_what_hands_did_saved_as_a_script_flies_again_to_the_bit(deeds: list) -> None:
    hand = HandSession(SCENE)
    for name, content in deeds:
        {"wait": hand.wait, "click": hand.click}.get(name, partial(hand.act, name))(**content)
    hand.wait(50_000_000)
    assert_flies_again(hand)


def test_what_was_done_in_one_paused_instant_is_one_message_to_a_node_in_the_order_in_which_it_acted() -> None:
    hand = HandSession(SCENE)
    hand.act("pause")
    for k in range(200):
        hand.act("set", **{"ballast.tip": [0.0001 * k, 0.0, 0.0, 0.07]})
    hand.load("poke", "normal@tip;impulse", [1e-4, 0.0, 0.0])
    hand.wait(SECOND)
    script = parse_script(assert_flies_again(hand).script)
    ((_, entries),) = schedules(script)
    assert len(entries) == len(script) and expand_schedule(read_schedule(json.dumps(entries))) == script
    assert [c.content["ballast.tip"][0] for c in script[:200]] == [0.0001 * k for k in range(200)]


def test_a_log_with_a_line_missing_is_refused() -> None:
    hand = HandSession(SCENE)
    for gravity in (-0.1, -0.2, -0.3):
        hand.act("set", gravity=[0.0, 0.0, gravity])
        hand.wait(SECOND // 10)
    session = hand.session()
    del session.events[1]
    with pytest.raises(InputError):
        script_of_session(session)


def test_nothing_of_the_running_program_is_saved() -> None:
    hand = HandSession({**SCENE, "record": "out.mcap", "viewer": "none", "start_paused": True})
    hand.act("set", record="elsewhere.mcap")
    hand.wait(SECOND)
    saved = assert_flies_again(hand)
    assert "mcap" not in saved.scene + saved.script
    # The change cut a step of the motion: what stands for it does so too.
    assert [command.kind for command in parse_script(saved.script)] == ["set"]


def test_entries_are_the_commands_of_the_hand() -> None:
    hand = HandSession(SCENE)
    hand.wait(SECOND // 3)
    hand.load("poke", "normal@tip", [0.02, 0.0, 0.0])
    hand.load("wrench", "body@point/0.01,0.02,0.03", [0.1, 0.2, 0.3], [0.0, 0.0, 1e-7])
    hand.wait(SECOND // 3)
    third = 333_333_333
    assert parse_script(script_of_session(hand.session()).script) == [
        of_event(kind, {"stamp_ns": third, "frame_id": frame_id, "force": force, "torque": torque})
        for kind, frame_id, force, torque in (
            ("wrench", "body@point/0.01,0.02,0.03", (0.1, 0.2, 0.3), (0.0, 0.0, 1e-7)),
            ("poke", "normal@tip", (0.02, 0.0, 0.0), (0.0, 0.0, 0.0)),
        )
    ]


def test_a_session_of_a_node_of_another_name_becomes_words_that_every_node_reads() -> None:
    hand = HandSession(SCENE)
    for kind, content in (
        ("poke", {"frame_id": "spinning_top@tip;impulse", "force": [1e-4, 0, 0], "torque": [0, 0, 0]}),
        ("string_attach", {"frame_id": "spinning_top/mesh", "point": [0.0, 0.0, 0.07]}),
    ):
        hand.simulation.submit(of_event(kind, content, ("world", "spinning_top")))
    hand.wait(SECOND)
    assert "spinning_top" in "".join(hand.session().lines)
    saved = script_of_session(replace(hand.session(), node_name="lab/spinning_top"))
    assert flown(saved, hand.now_ns).sha256() == hand.simulation.state.sha256()
    assert "spinning_top" not in saved.scene + saved.script
    knot, poke = parse_script(saved.script)
    assert (knot.axes, poke.frame.text) == ("mesh", "body@tip;impulse")


def test_a_change_that_only_a_later_scene_allows_flies_again() -> None:
    tensor = [1.0e-4, 0.0, 0.0, 2.0e-4, 0.0, 2.5e-4]
    hand = HandSession({"mesh": "", "inertia_model": "explicit", "explicit_inertia.tensor": tensor})
    hand.wait(SECOND // 10)
    hand.act("set", mesh="t_handle")
    hand.wait(SECOND // 10)
    hand.act("set", inertia_model="solid")
    hand.load("poke", "world@vertex/3", [0.01, 0.0, 0.0])
    hand.wait(SECOND // 10)
    with pytest.raises(InputError):
        hand.first.with_changes({"inertia_model": "solid"})
    assert len(parse_script(assert_flies_again(hand).script)) == 3
