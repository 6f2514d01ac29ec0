# SPDX-License-Identifier: MIT
"""A what-if from any moment: the scene and script written there fly on as the session did."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mcap")

from flights import SECOND, EventLines

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.scenario import make_scenario, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.scene_file import read_scene_text
from rigid_proto_ros.scene.script import parse_script, read_script
from rigid_proto_ros.session.as_script import branch_at, recorded_branch
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.messages import PROJECTIONS
from rigid_proto_ros.session.recorded_session import RecordedSession, StateRows, resimulation

SCRIPT = """
- {t: 0.2, wrench: {at: tip, force: [0.0, 0.02, 0.0], torque: [0.0, 1.0e-4, 0.0], axes: body}}
- {t: 0.4, set: {density: 9000.0, gravity: [0.0, 0.0, -0.5]}}
- {t: 0.8, at: tip, push: 0.02, duration: 0.5}
- {t: 0.9, at: left, force: [0.01, 0.0, 0.0], duration: 0.01}
- {t: 1.0, set: {string.attached: true, string.rest_length: 0.2, string.target: [0.0, 0.1, 0.4], string.damping_ratio: 0.0}}
- {t: 3.0, set: {string.attached: false}}
- {t: 3.1, string: {attach: tip, target: [0.0, 0.1, 0.4]}}
"""


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flown")
    (folder / "script.yaml").write_text(SCRIPT)
    path = folder / "s.mcap"
    arguments = ["simulate", "t_handle", "--script", str(folder / "script.yaml"), "--duration", "5"]
    assert main([*arguments, "--bag", str(path)]) == 0
    return path


def fly_on(folder, seconds: float) -> OfflineRun:
    """The branch at the end of its own flight."""
    run = OfflineRun(read_scene(str(folder / "x.yaml")), read_script(folder / "x_script.yaml"))
    assert run.advance(round(seconds * SECOND))
    return run


@pytest.mark.parametrize(("at", "until"), [(0.0, 0.15), (0.85, 0.04), (3.15, 0.9)])
def test_a_branch_begins_with_the_recorded_state_and_flies_on_as_the_session_did(session, tmp_path, at, until, capsys):
    assert main(["replay", str(session), "--at", str(at), "--as-scene", str(tmp_path / "x.yaml")]) == 0
    said = capsys.readouterr().out.splitlines()[-1]
    scene, script = tmp_path / "x.yaml", tmp_path / "x_script.yaml"
    assert said == f"  scene at {at:g} s: rigid_proto simulate {scene} --script {script}"
    assert bool(read_script(script)) == (at > 0.0)
    (recorded,) = read_runs(session)

    def differs(row: np.ndarray, time_s: float) -> float:
        worst = 0.0
        for name, stamped in recorded.published.items():
            expected = stamped.rows[stamped.times.tolist().index(round(time_s * SECOND))]
            worst = max(worst, float(np.abs(np.array(PROJECTIONS[name](row.tolist())) - expected).max()))
        return worst

    # Measured 1.3e-14, in the spin of 12 rad/s, which is turned to the world's axes and back.
    assert differs(fly_on(tmp_path, 0.0).simulation.state.row, at) <= 4e-14
    assert differs(fly_on(tmp_path, until).simulation.state.row, at + until) < 1e-7


def test_without_a_time_all_of_it_is_written_and_flown_again_to_the_bit(session, tmp_path, capsys):
    assert main(["replay", str(session), "--as-scene", str(tmp_path / "x.yaml")]) == 0
    scene, script = tmp_path / "x.yaml", tmp_path / "x_script.yaml"
    assert capsys.readouterr().out.splitlines()[-1] == (
        f"  scene and script: rigid_proto simulate {scene} --script {script}"
    )
    (recorded,) = read_runs(session)
    last = fly_on(tmp_path, 5.0).simulation.state
    assert last.time_ns == recorded.end_ns
    for name, stamped in recorded.published.items():
        assert PROJECTIONS[name](last.row.tolist()) == stamped.rows[-1].tolist(), name


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


def flown(changes: dict, until_ns: int, script: str = ALL_KINDS) -> RecordedSession:
    """A session, by default of all kinds of commands that there are."""
    scenario, told = make_scenario({**FEATURES, **changes}), EventLines()
    run = OfflineRun(scenario, parse_script(script), told)
    assert run.advance(until_ns)
    return RecordedSession(
        scene=scenario.text,
        events=told.timed,
        states=StateRows(np.array([until_ns]), run.simulation.state.row[None].copy()),
    )


def branched(session: RecordedSession, cut_ns: int) -> OfflineRun:
    """A branch, flown by its own scene and script."""
    branch = branch_at(session, cut_ns)
    return OfflineRun(make_scenario(read_scene_text(branch.scene).values), parse_script(branch.script))


def assert_goes_on(session: RecordedSession, cut_ns: int, tolerance: float) -> None:
    """The branch follows the session up to its next command."""
    ends_ns = [time_ns for time_ns, _ in session.events if time_ns > cut_ns]
    original, branch = resimulation(session), branched(session, cut_ns).simulation
    assert np.abs(original.advance(cut_ns) - branch.state.row).max() <= 4e-15 * 12.0
    for time_ns in np.linspace(cut_ns, min([*ends_ns, session.end_ns]), 5).astype(int).tolist()[1:]:
        here, there = original.advance(time_ns), branch.advance(time_ns - cut_ns).row
        assert np.abs(here - there).max() < tolerance, (cut_ns, time_ns)


@pytest.mark.parametrize("integrator, tolerance", [("auto", 1e-8), ("rk4", 1e-4)])
def test_a_branch_goes_on_under_every_kind_of_command(integrator, tolerance):
    session = flown({"integrator": integrator}, 2 * SECOND)
    times = [time_ns for time_ns, _ in session.events]
    original = resimulation(session)
    for cut_ns in sorted({333_333_333, 1_310_000_000, *(time_ns + 1 for time_ns in times[::5])}):
        original.advance(cut_ns)
        tied = original.simulation.string
        # A free end that is on its way arrives when it would have, though not as evenly.
        if tied is None or tied.end_ns <= cut_ns:
            assert_goes_on(session, cut_ns, tolerance)


WHEELS = """
- {t: 0.2, set: {rotor.torque: [0.0, 0.0, 2.0e-3]}}
- {t: 0.5, set: {gravity: [0.0, 0.0, -0.5]}}
- {t: 0.7, set: {rotor.torque: [0.0, 0.0, 0.0]}}
- {t: 0.9, set: {rotor.momentum: [1.0e-3, 0.0, 0.0], rotor.torque: [0.0, 1.0e-3, 0.0]}}
- {t: 1.2, set: {scale: 1.1, ballast.nut: [0.02, 0.0, 0.0, 0.07]}}
"""


def test_a_branch_goes_on_with_the_flywheel_as_it_turns_then():
    session = flown({"rotor.momentum": [0.0, 5e-4, 0.0]}, 2 * SECOND, WHEELS)
    expected = {0.1: (0.0, 5e-4, 0.0), 0.6: (0.0, 5e-4, 8e-4), 0.8: (0.0, 5e-4, 1e-3), 1.5: (1e-3, 6e-4, 0.0)}
    for cut_s, momentum in expected.items():
        cut_ns = round(cut_s * SECOND)
        branch = branched(session, cut_ns)
        assert branch.scenario.parameters.rotor.momentum == pytest.approx(momentum, rel=1e-14)
        assert branch.simulation.rotor_momentum == pytest.approx(momentum, rel=1e-14)
        assert_goes_on(session, cut_ns, 1e-8)
    whole = OfflineRun(make_scenario(read_scene_text(session.scene).values), parse_script(WHEELS))
    whole.advance(2 * SECOND)
    assert whole.simulation.state.row.tolist() == session.rows[-1].tolist()


def test_a_branch_of_states_alone_has_the_flywheel_that_its_scene_drives():
    scenario = make_scenario({**FEATURES, "rotor.momentum": [0.0, 5e-4, 0.0], "rotor.torque": [0.0, 0.0, 1e-3]})
    run = OfflineRun(scenario)
    run.advance(SECOND)
    states = StateRows(np.array([SECOND]), run.simulation.state.row[None].copy())
    branch, _ = recorded_branch(RecordedSession(scene="", events=[], states=states), scenario, SECOND)
    assert read_scene_text(branch.scene).values["rotor.momentum"] == pytest.approx([0.0, 5e-4, 1e-3], rel=1e-14)


def test_a_push_goes_on_along_the_normal_of_a_mesh_that_was_changed_for_another_one():
    script = "- {t: 0.1, at: {vertex: 5}, push: 0.1, duration: 1.0}\n- {t: 0.2, set: {mesh: l_bracket}}\n"
    session = flown({"contacts.tip": [0.0, 0.0, 0.0]}, 900_000_000, script)
    assert_goes_on(session, 300_000_000, 1e-8)


def test_what_acts_ends_in_a_branch_when_it_would_have_ended():
    session = flown({}, 2 * SECOND)
    original, run = resimulation(session), branched(session, 480_000_000)
    original.advance(480_000_000)
    branch = run.simulation
    branch.advance(1)
    assert [(acting.load, acting.end_ns) for acting in branch.acting if acting.thruster < 0] == [
        (acting.load, acting.end_ns - 480_000_000) for acting in original.simulation.acting if acting.thruster < 0
    ]
    assert [acting.load for acting in branch.acting if acting.thruster >= 0] == [
        acting.load for acting in original.simulation.acting if acting.thruster >= 0
    ]
    assert branch.string is not None
    assert branch.string.effective_mass == original.simulation.string.effective_mass
    # The last target came at .47 s, and took the .07 s since the one before it; the string's timeout is .4 s.
    branch.advance(60_000_000)
    assert branch.string.free_end(60_000_000).tolist() == [0.1, 0.1, 0.4]
    branch.advance(390_000_000)
    assert branch.string is not None
    branch.advance(390_000_001)
    assert branch.string is None
    branch.advance(SECOND)
    assert not branch.acting


@pytest.mark.parametrize(
    ("cut_ms", "forces"), [(699, [0.03, 0.01]), (700, [0.03, 0.01]), (701, [0.03, 0.01]), (801, [])]
)
def test_thrusters_that_a_timeout_would_end_stay_on_in_a_branch_for_their_least_time(cut_ms, forces):
    """On at .1 s for at least .7 s; the timeout comes .6 s after the command."""
    least = {"thruster.minimum_on_time": 0.7}
    session = flown(least, SECOND, "- {t: 0.1, thrusters: [0.03, 0.01]}\n")
    branch = branched(session, cut_ms * 1_000_000).simulation
    branch.advance(1)
    assert [push.force for push in branch.thrusters.pushes if push.force] == forces


def test_a_branch_has_no_ghost_whose_integrator_cannot_take_the_string_that_is_tied():
    changes = {"ghost.integrator": "free_body", "ghost.inertia_model": "bounding_box"}
    session = flown(
        changes, 600_000_000, "- {t: 0.1, at: com, force: [0, 0, 1]}\n- {t: 0.3, string: {target: [0, 0, 1]}}\n"
    )
    for cut_ns, integrator in ((200_000_000, "free_body"), (500_000_000, "")):
        ghost = branched(session, cut_ns).scenario.parameters.ghost
        assert (ghost.integrator, ghost.inertia_model) == (integrator, "bounding_box")


def test_a_string_tied_by_parameters_stays_tied_in_a_branch_that_begins_while_its_end_moves():
    tied = {"string.attached": True, "string.target": [0.0, 0.0, 0.1], "string.timeout": 0.4}
    session = flown(tied, 2 * SECOND, "- {t: 1.0, set: {string.target: [0.0, 0.0, 0.3]}}\n")
    branch = branched(session, 1_050_000_000).simulation
    branch.advance(SECOND)
    assert branch.string is not None
    assert branch.string.release_ns is None and branch.string.target.tolist() == [0.0, 0.0, 0.3]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--at 1 --as-scene /proc/x.yaml", "--as-scene: got '/proc/x.yaml'; accepted: a file that can be"),
        ("--record /proc/x.mcap", "--record: got '/proc/x.mcap'; accepted: a file that can be"),
        ("--at 1 --as-scene SESSION", "--as-scene"),
        ("--at 9 --as-scene x.yaml", "--at"),
        ("--at -1 --as-scene x.yaml", "--at"),
        ("--at nan --as-scene x.yaml", "--at"),
        ("--at 1", "--as-scene"),
    ],
)
def test_a_time_or_a_place_that_is_none_is_refused_and_nothing_written(
    session, arguments, words, tmp_path, monkeypatch, capsys
):
    before = session.read_bytes()
    monkeypatch.chdir(tmp_path)
    try:
        status = main(["replay", str(session), *arguments.replace("SESSION", str(session)).split()])
    except SystemExit as refused:
        status = refused.code
    out, err = capsys.readouterr()
    assert status == 2 and len(err.splitlines()) == 1 and words in err
    assert out == "" or "/proc" not in arguments, "a place is tried before the work"
    assert session.read_bytes() == before and not list(tmp_path.iterdir())
