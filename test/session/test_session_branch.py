# SPDX-License-Identifier: MIT
"""A what-if from any moment: the scene written there flies on as the session did, to the bit."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from hand_session import random_hand_session

pytest.importorskip("mcap")

from rigid_proto_ros.base.errors import CommandRefused, InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.messages.session_messages import PROJECTIONS
from rigid_proto_ros.rerun_view.session_files import read_runs
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scene_file import read_scene_text
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.session.branch import branch_at
from rigid_proto_ros.session.recorded_session import RecordedSession, scene_sha256
from rigid_proto_ros.session.replay import Resimulation, resimulation
from rigid_proto_ros.simulation.commands import ClearWrench, ReleaseString
from rigid_proto_ros.simulation.observer import Logged, Observer
from rigid_proto_ros.simulation.simulation import Simulation

SECOND = 10**9

SCRIPT = """
- {t: 0.2, wrench: {at: tip, force: [0.0, 0.02, 0.0], torque: [0.0, 1.0e-4, 0.0], axes: body}}
- {t: 0.4, set: {density: 9000.0, gravity: [0.0, 0.0, -0.5]}}
- {t: 0.8, at: tip, push: 0.02, duration: 0.5}
- {t: 0.9, at: left, force: [0.01, 0.0, 0.0], duration: 0.01}
- {t: 1.0, set: {string.attached: true, string.rest_length: 0.2, string.target: [0.0, 0.1, 0.4], string.damping_ratio: 0.0}}
- {t: 3.0, set: {string.attached: false}}
- {t: 3.1, string: {attach: tip, target: [0.0, 0.1, 0.4]}}
"""


@pytest.fixture(scope="module", params=[".mcap", ".rrd"])
def session(request, tmp_path_factory):
    if request.param == ".rrd":
        pytest.importorskip("rerun")
    folder = tmp_path_factory.mktemp("flown")
    (folder / "script.yaml").write_text(SCRIPT)
    path = folder / f"s{request.param}"
    option = "--bag" if request.param == ".mcap" else "--record"
    arguments = ["simulate", "t_handle", "--script", str(folder / "script.yaml"), "--duration", "5"]
    assert main([*arguments, option, str(path)]) == 0
    return path


def fly_on(folder, seconds: float) -> np.ndarray:
    """The end of the branch's own flight."""
    run = OfflineRun(read_scene(str(folder / "x.yaml")))
    assert run.advance(round(seconds * SECOND))
    return run.simulation.state.row


@pytest.mark.parametrize("at", [0.0, 0.1, 0.3, 0.45, 0.85, 1.05, 1.75, 2.2, 3.15])
def test_a_branch_flies_on_to_the_bit_as_the_session_did(session, tmp_path, at, capsys):
    until = {0.0: 0.15, 0.1: 0.05, 0.3: 0.08, 0.45: 0.3, 0.85: 0.04, 1.05: 0.5, 1.75: 0.5, 2.2: 0.5, 3.15: 1.5}[at]
    assert main(["replay", str(session), "--at", str(at), "--as-scene", str(tmp_path / "x.yaml")]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"  scene at {at:g} s: {tmp_path / 'x.yaml'}"
    (recorded,) = read_runs(session)
    row = fly_on(tmp_path, until)
    streams = {name: (stamped.times, stamped.rows) for name, stamped in recorded.published.items()}
    for name, (times, rows) in (streams or {"": (recorded.times, recorded.rows)}).items():
        expected = rows[times.tolist().index(round((at + until) * SECOND))]
        told = np.array(PROJECTIONS[name](row.tolist())) if name else row
        assert told.tobytes() == expected.tobytes()


def test_a_branch_has_the_parameters_in_force(session, tmp_path):
    for at, density in ((0.1, 7850.0), (0.5, 9000.0)):
        assert main(["replay", str(session), "--at", str(at), "--as-scene", str(tmp_path / "x.yaml")]) == 0
        values = read_scene(str(tmp_path / "x.yaml")).parameters.named()
        assert values["density"] == density
        assert values["record"] == ""


FEATURES = {
    "mesh": "t_handle",
    "density": 7850.0,
    "initial.angular_velocity": [0.05, 0.1, 12.0],
    "contacts.tip": [0.0, 0.0, 0.07],
    "thrusters.main": [0.0, 0.0, 0.07, 0.0, 1.0, 0.0],
    "thrusters.side": [0.0, 0.02, 0.0, 1.0, 0.0, 0.0, 0.05],
    "thruster.bidirectional": True,
    "thruster.minimum_on_time": 0.5,
    "string.timeout": 0.4,
    "string.stiffness": 2.0,
    "wrench_timeout": 0.6,
    "step": 0.002,
}
ALL_KINDS = """
- {t: 0.05, wrench: {at: tip, force: [0.0, 0.02, 0.0], slot: left}}
- {t: 0.1, wrench: {at: com, torque: [0.0, 1.0e-4, 0.0], axes: body}}
- {t: 0.12, thrusters: [0.03, 0.01]}
- {t: 0.2, at: tip, push: 0.02, duration: 0.9, slot: right}
- {t: 0.3, thrusters: [-0.02, 0.2]}
- {t: 0.35, string: {attach: [0.0, 0.05, 0.0]}}
- {t: 0.4, string: {attach: tip, target: [0.0, 0.1, 0.4]}}
- {t: 0.45, set: {string.attach: [0.0, 0.05, 0.0]}}
- {t: 0.47, string: {target: [0.1, 0.1, 0.4]}}
- {t: 0.5, set: {string.target: [0.1, 0.2, 0.4]}}
- {t: 0.55, wrench: {at: tip, force: [0.0, -0.02, 0.0], slot: left}}
- {t: 0.57, set: {wrench_timeout: 0.5}}
- {t: 0.6, at: com, impulse: [0.0, 0.001, 0.0]}
- {t: 0.7, set: {gravity: [0.0, 0.0, -0.5], linear_damping: 0.05, string.frequency: 8.0}}
- {t: 0.8, state: {angular_velocity: [0.0, 9.0, 0.1]}}
- {t: 0.9, set: {scale: 1.1, ballast.nut: [0.02, 0.0, 0.0, 0.07]}}
- {t: 1.1, string: {target: [0.0, 0.0, 0.5]}}
- {t: 1.2, service: clear_wrench}
- {t: 1.25, thrusters: [0.02, 0.0]}
- {t: 1.3, string: release}
- {t: 1.35, string: {target: [0.0, 0.0, 0.5]}}
- {t: 1.5, set: {string.attached: true}}
- {t: 1.6, set: {string.attached: false}}
"""


class Lines(Observer):
    """The session that a run would record."""

    def __init__(self) -> None:
        self.events: list[tuple[int, str]] = []

    takes = frozenset({Logged})

    def on(self, event) -> None:
        if isinstance(event, Logged):
            self.events.append((event.time_ns, event.line))


def flown(changes: dict, until_ns: int) -> RecordedSession:
    """A session of all kinds of commands that there are."""
    scenario, lines = make_scenario({**FEATURES, **changes}), Lines()
    run = OfflineRun(scenario, parse_script(ALL_KINDS), lines)
    assert run.advance(until_ns)
    return RecordedSession(
        scene=scenario.text,
        events=lines.events,
        times=np.array([until_ns]),
        rows=run.simulation.state.row[None].copy(),
        mesh_sha256=scene_sha256(scenario.text),
    )


def assert_goes_on(session: RecordedSession, cut_ns: int, end_ns: int) -> None:
    """The branch goes on to the bit as the session does, under the session's own commands from then on."""
    scenario = make_scenario(read_scene_text(branch_at(session, cut_ns).scene).values)
    later = [
        json.dumps({**json.loads(line), "time_ns": time_ns - cut_ns})
        for time_ns, line in session.events
        if time_ns >= cut_ns
    ]
    original, branch = resimulation(session), Resimulation(scenario, later)
    for time_ns in np.linspace(cut_ns, end_ns, 8).astype(int).tolist():
        here, there = original.advance(time_ns), branch.advance(time_ns - cut_ns)
        assert here.tobytes() == there.tobytes(), (cut_ns, time_ns, np.abs(here - there).max())
    assert not original.simulation.failure


@pytest.mark.parametrize("integrator", ["auto", "rk4", "dop853", "midpoint"])
def test_a_branch_goes_on_to_the_bit_under_every_kind_of_command(integrator):
    end_ns = 2 * SECOND
    session = flown({"integrator": integrator}, end_ns)
    times = [time_ns for time_ns, _ in session.events]
    for cut_ns in sorted({0, 333_333_333, 451_000_001, 1_300_000_000, *times[:: 6 if integrator == "auto" else 11]}):
        assert_goes_on(session, cut_ns, end_ns)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.stress) for k in range(1, 200))])
def test_a_branch_of_a_hand_session_goes_on_to_the_bit(seed):
    hand = random_hand_session(seed, 4.0)
    session, rng = hand.session(), np.random.default_rng(seed)
    for cut_ns in (*rng.integers(0, hand.now_ns, 3).tolist(), session.events[len(session.events) // 2][0]):
        assert_goes_on(session, cut_ns, hand.now_ns)


def test_a_branch_of_a_branch_goes_on_to_the_bit():
    session = flown({}, 2 * SECOND)
    first = make_scenario(read_scene_text(branch_at(session, 410_000_000).scene).values)
    session = RecordedSession(
        scene=first.text, times=np.array([SECOND]), rows=np.zeros((1, 13)), mesh_sha256=scene_sha256(first.text)
    )
    for cut_ns in (10_000_000, 300_000_000):
        assert_goes_on(session, cut_ns, SECOND)


def test_a_branch_that_was_edited_begins_with_its_state_under_what_acted():
    session = flown({}, 2 * SECOND)
    values = dict(read_scene_text(branch_at(session, 480_000_000).scene).values)
    whole = OfflineRun(make_scenario(values)).simulation
    assert whole.string is not None and len(whole.acting) == 5
    start = whole.setup.initial

    def begun(**changes) -> Simulation:
        named = {name.replace("__", "."): value for name, value in changes.items()}
        return OfflineRun(make_scenario({**values, **named})).simulation

    for changes in ({"gravity": [0.0, 0.0, -9.81]}, {"string__stiffness": 9.0}, {"initial__position": [1.0, 2.0, 3.0]}):
        other = begun(**changes)
        assert np.array_equal(other.state.row, other.setup.initial)
        assert len(other.acting) == 5 and other.string is not None
    assert np.array_equal(begun(gravity=[0.0, 0.0, -9.81]).setup.initial, start)
    assert begun(string__stiffness=9.0).string.stiffness == 9.0
    # Where it is tied, and to what, is a change at time 0 as it would be in flight.
    moved = begun(string__target=[0.5, 0.0, 0.0])
    assert moved.string.target.tolist() == [0.5, 0.0, 0.0] and moved.string.end_ns > 0
    assert begun(string__attached=True).string.target.tolist() == values["string.target"]
    # Another body: what a frequency makes of it, and not what it made of the other.
    heavy = begun(density=78500.0, string__frequency=8.0)
    assert heavy.string.effective_mass > 5.0 * whole.string.effective_mass
    assert heavy.string.frequency == pytest.approx(8.0)
    short = begun(wrench_timeout=0.1)
    short.advance(1)
    # The poke, and the thrusters, which have to stay on.
    assert [acting.shown_kind for acting in short.acting] == ["poke", "thruster", "thruster"]
    # Without the rest nothing acts.
    alone = begun(initial__flight="")
    assert not alone.acting and alone.string is None


def test_what_a_branch_brings_along_comes_back_at_a_reset_and_is_left_out_where_the_integrator_cannot_take_it():
    session = flown({}, 2 * SECOND)
    scenario = make_scenario(read_scene_text(branch_at(session, 480_000_000).scene).values)
    simulation = Simulation(scenario.setup)
    first = simulation.advance(300_000_000).row
    simulation.reset()
    assert simulation.advance(300_000_000).row.tobytes() == first.tobytes()
    simulation.advance(SECOND)
    free = scenario.with_changes({"integrator": "free_body"}).setup
    simulation.submit(ClearWrench())
    simulation.submit(ReleaseString())
    simulation.advance(2 * SECOND)
    simulation.check_change(free)
    simulation.reset(free)
    assert simulation.refused == {"integrator": 1}
    assert not simulation.acting and simulation.string is None
    with pytest.raises(CommandRefused):
        Simulation(free)


@pytest.mark.parametrize(
    "text, said",
    [
        ("{", "initial.flight"),
        ("[1]", "mapping"),
        ("{began_ns: 3, state: []}", "began_ns: got '3'"),
        ("{began_ns: -1, state: [1.0]}", "13 finite numbers"),
        ("{began_ns: -1, state: [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0], more: 1}", "there is no key"),
        (
            "{began_ns: -1, state: [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0], loads: [{kind: pull, began_ns: 0}]}",
            "loads, 1",
        ),
        (
            "{began_ns: -1, state: [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0], thrusters: {last_ns: -1, nose: {force: 1, on_ns: -1}}}",
            "thruster of the body",
        ),
    ],
)
def test_what_a_branch_brings_along_is_checked_in_one_line(text, said):
    with pytest.raises(InputError, match=re.escape(said)) as refused:
        make_scenario({"mesh": "t_handle", "initial.flight": text})
    assert str(refused.value).startswith("initial.flight") and "\n" not in str(refused.value)


def test_a_branch_from_recorded_states_alone_needs_a_scene(session, tmp_path, capsys):
    scene = str(tmp_path / "x.yaml")
    assert main(["replay", str(session), "--at", "1", "--as-scene", scene, "--scene", "t_handle"]) == 0
    assert "isn't recorded" in capsys.readouterr().out
    (recorded,) = read_runs(session)
    start = read_scene(scene).setup.initial
    assert np.abs(start - recorded.rows[recorded.times.tolist().index(SECOND)]).max() < 1e-12


@pytest.mark.parametrize(
    "arguments",
    [["--at", "9"], ["--at", "-1"], ["--at", "nan"], ["--at", "1"], ["--as-scene", "x.yaml"]],
)
def test_a_time_that_is_none_is_refused(session, tmp_path, arguments, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if "--at" in arguments and arguments[1] != "1":
        arguments = [*arguments, "--as-scene", "x.yaml"]
    assert main(["replay", str(session), *arguments]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "x.yaml").exists()
