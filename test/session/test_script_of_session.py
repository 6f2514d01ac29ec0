# SPDX-License-Identifier: MIT
"""What was done by hand becomes a scene and a script that give the same motion again, bit for bit."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from flights import SECOND, EventLines

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.scene.command_codec import of_event
from rigid_proto_ros.scene.parameters import with_mass_of_density
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun, ScenarioRun
from rigid_proto_ros.scene.scene_file import read_scene_text
from rigid_proto_ros.scene.script import expand_schedule, parse_script, read_schedule, schedules
from rigid_proto_ros.session.as_script import SceneAndScript, script_of_session
from rigid_proto_ros.session.recorded_session import RecordedSession
from rigid_proto_ros.simulation.commands import Change, ClearWrench, Command, ReleaseString


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

    def submit(self, command: Command | None) -> None:
        """Which acts now."""
        assert command is not None
        self.simulation.submit(command)

    def load(self, held: bool, frame_id: str, force, torque=(0.0, 0.0, 0.0)) -> None:
        """A message of the wrench or the poke topic."""
        content = {"frame_id": frame_id, "force": force, "torque": torque}
        self.submit(of_event("wrench" if held else "poke", content))

    def set(self, **changes) -> None:
        """A parameter call; dots as two underscores. A refused one changes nothing."""
        named = with_mass_of_density({name.replace("__", "."): value for name, value in changes.items()})
        with suppress(InputError):
            setup = self.run.replace(self.run.scenario.with_changes(named))
            self.submit(Change(named, lambda: setup))

    def pause(self) -> None:
        """The mark that stands in the log: commands now pile up at one instant."""
        self.simulation.log("pause", {"data": True})

    def session(self) -> RecordedSession:
        """As a client has heard it."""
        return RecordedSession(
            scene=self.first.text,
            events=list(self.log.timed),
            times=np.array([self.now_ns]),
            rows=self.simulation.state.row[None].copy(),
        )


SCENE = {
    "mesh": "t_handle",
    "density": 7850.0,
    "initial.angular_velocity": [0.05, 0.1, 12.0],
    "string.stiffness": 1.0,
    "string.damping_ratio": 0.3,
    "contacts.tip": [0.0, 0.0, 0.07],
}


def random_hand_session(seed: int, seconds: float) -> HandSession:
    """Drags, clicks, sliders and pauses as hands make them, the same for a seed."""
    rng = np.random.default_rng(seed)
    hand = HandSession(SCENE)
    end_ns = round(seconds * 1e9)
    while hand.now_ns < end_ns:
        _act(hand, rng)
        hand.wait(int(rng.integers(1, 200_000_000)))
    hand.wait(50_000_000)
    return hand


def _act(hand: HandSession, rng: np.random.Generator) -> None:
    deed = rng.choice(
        ["drag", "click", "push", "hold", "slide", "paused", "inertia", "record"],
        p=[0.2, 0.2, 0.1, 0.1, 0.2, 0.1, 0.05, 0.05],
    )
    if deed == "drag":
        frames = (
            ("body/mesh", [0.0, 0.0, 0.07]),
            ("body", [0.01, 0.0, 0.02]),
            ("world", hand.simulation.state.position),
        )
        frame, point = frames[rng.integers(3)]
        hand.submit(of_event("string_attach", {"frame_id": frame, "point": point}))
        for _ in range(rng.integers(2, 12)):
            hand.submit(of_event("string_target", {"frame_id": "world", "point": 0.1 * rng.normal(size=3)}))
            hand.wait(int(rng.integers(1, 60_000_000)))
        if rng.random() < 0.7:
            hand.submit(ReleaseString())
    elif deed in ("click", "push"):
        _click(hand, rng, deed)
    elif deed == "hold":
        hand.load(
            True,
            rng.choice(["", "world@tip", "body@vertex/3", "body"]),
            0.02 * rng.normal(size=3),
            1e-4 * rng.normal(size=3),
        )
        if rng.random() < 0.3:
            hand.wait(100_000_000)
            hand.submit(ClearWrench())
    elif deed == "slide":
        for _ in range(rng.integers(1, 6)):
            _slide(hand, rng)
            hand.wait(int(rng.integers(1, 50_000_000)))
    elif deed == "paused":
        hand.pause()
        for _ in range(rng.integers(1, 30)):
            _slide(hand, rng)
        for _ in range(rng.integers(0, 3)):
            _click(hand, rng, "push")
    elif deed == "inertia":
        body = hand.run.scenario.setup.body
        I = 1.1 * body.inertia
        tensor = [I[0, 0], I[0, 1], I[0, 2], I[1, 1], I[1, 2], I[2, 2]]
        com = (body.center_of_mass + 0.001).tolist()
        hand.submit(of_event("inertia", {"frame_id": "", "mass": body.mass, "com": com, "tensor": tensor}))
    else:
        hand.set(record="somewhere.mcap")


def _click(hand: HandSession, rng: np.random.Generator, deed: str) -> None:
    if deed == "push":
        option = rng.choice([";impulse", ";duration=0.1", ""])
        size = 0.0005 if option == ";impulse" else 0.02
        hand.load(False, f"normal@vertex/{rng.integers(20)}{option}", [size, 0.0, 0.0])
        return
    state = hand.simulation.state
    eye = state.position + np.array([1.0, 0.3, 0.2])
    knot = state.position + state.rotation @ hand.run.scenario.setup.body.point((0.0, 0.0, 0.03))
    ray = "/".join(",".join(repr(float(x)) for x in v) for v in (eye, knot - eye))
    option = rng.choice([";impulse", ";duration=0.05"])
    size = 0.001 if option == ";impulse" else 0.03
    hand.load(False, f"world@ray/{ray}{option}", size * (knot - eye))


def _slide(hand: HandSession, rng: np.random.Generator) -> None:
    changes = (
        {"mass": float(rng.uniform(0.1, 0.3))},
        {"density": float(rng.uniform(4000.0, 9000.0))},
        {"scale": rng.uniform(0.8, 1.2, 3).tolist()},
        {"ballast.tip": [float(rng.uniform(0.0, 0.03)), 0.0, 0.0, 0.07]},
        {"inertia_model": str(rng.choice(["solid", "shell", "bounding_box", "points"]))},
        {"gravity": [0.0, 0.0, float(rng.uniform(-0.3, 0.0))], "linear_damping": float(rng.uniform(0.0, 0.1))},
        {"string.attached": bool(rng.random() < 0.5), "string.target": (0.1 * rng.normal(size=3)).tolist()},
        {"string.stiffness": float(rng.uniform(0.5, 2.0)), "poke_duration": float(rng.uniform(0.01, 0.1))},
        {"gyroscopic": bool(rng.random() < 0.7)},
    )
    hand.set(**changes[rng.integers(len(changes))])


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


@pytest.mark.parametrize(
    "seeds",
    [range(2), *(pytest.param(range(k, k + 100), marks=pytest.mark.stress) for k in range(100, 1100, 100))],
)
def test_hand_sessions_saved_as_scripts_fly_again_to_the_bit(seeds: range) -> None:
    for seed in seeds:
        assert_flies_again(random_hand_session(seed, seconds=4.0))


def test_what_was_done_in_one_paused_instant_is_one_message_to_a_node_in_the_order_in_which_it_acted() -> None:
    hand = HandSession(SCENE)
    hand.pause()
    for k in range(200):
        hand.set(ballast__tip=[0.0001 * k, 0.0, 0.0, 0.07])
    hand.load(False, "normal@tip;impulse", [1e-4, 0.0, 0.0])
    hand.wait(SECOND)
    script = parse_script(assert_flies_again(hand).script)
    ((_, count, text),) = schedules(script)
    assert count == len(script) and expand_schedule(read_schedule(text)) == script
    assert [c.content["ballast.tip"][0] for c in script[:200]] == [0.0001 * k for k in range(200)]


def test_a_log_with_a_line_missing_is_refused() -> None:
    hand = random_hand_session(1, seconds=2.0)
    session = hand.session()
    del session.events[3]
    with pytest.raises(InputError):
        script_of_session(session)


def test_nothing_of_the_running_program_is_saved() -> None:
    hand = HandSession({**SCENE, "record": "out.mcap", "viewer": "none", "start_paused": True})
    hand.set(record="elsewhere.mcap")
    hand.wait(SECOND)
    saved = assert_flies_again(hand)
    assert "mcap" not in saved.scene + saved.script
    # The change cut a step of the motion: what stands for it does so too.
    assert [command.kind for command in parse_script(saved.script)] == ["set"]


def test_entries_are_the_commands_of_the_hand() -> None:
    hand = HandSession(SCENE)
    hand.wait(SECOND // 3)
    hand.load(False, "normal@tip", [0.02, 0.0, 0.0])
    hand.load(True, "body@point/0.01,0.02,0.03", [0.1, 0.2, 0.3], [0.0, 0.0, 1e-7])
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
        hand.submit(of_event(kind, content, ("world", "spinning_top")))
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
    hand.set(mesh="t_handle")
    hand.wait(SECOND // 10)
    hand.set(inertia_model="solid")
    hand.load(False, "world@vertex/3", [0.01, 0.0, 0.0])
    hand.wait(SECOND // 10)
    with pytest.raises(InputError):
        hand.first.with_changes({"inertia_model": "solid"})
    assert len(parse_script(assert_flies_again(hand).script)) == 3
