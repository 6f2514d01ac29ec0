# SPDX-License-Identifier: MIT
"""Where rounding limits a motion and not the accuracy asked for, that is said; and only there."""

import json

import numpy as np
import pytest
from flights import SECOND, StringSettings, flight, spinning
from reference_motion import angle_between, free_motion
from scipy.spatial.transform import Rotation

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.simulation.commands import ReleaseString

BOX = make_body(2.0, np.zeros(3), np.diag([0.02, 0.03, 0.04]))


def needle():
    """Moments 1 to 1.4e8, given as a full tensor."""
    turn = Rotation.from_rotvec([0.4, -0.9, 1.3]).as_matrix()
    inertia = turn @ np.diag([1e-9, 0.14, 0.14]) @ turn.T
    return make_body(1.0, np.zeros(3), 0.5 * (inertia + inertia.T))


@pytest.mark.parametrize(
    ("body", "spin", "accuracy"),
    [(BOX, (6e4, 7e4, -3e4), 1e-12), (BOX, (3.0, 4.0, 5.0), 1e-9), (needle(), (1.0, 2.0, 0.5), 1e-9)],
    ids=["1e5 rad/s", "everyday", "needle"],
)
def test_an_exact_step_says_when_rounding_is_more_than_the_accuracy(body, spin, accuracy):
    simulation = flight(body, integrator="auto", accuracy=accuracy, initial=spinning(spin))
    row = simulation.advance(SECOND).row
    exact, _ = free_motion(body.inertia, spin, 1)
    assert angle_between(row[3:7], exact) <= accuracy or simulation.accuracy_floor
    assert bool(simulation.accuracy_floor) == (body is not BOX or max(spin) > 1e3)


def test_a_position_far_from_the_origin_is_known_to_its_last_place():
    row = spinning((0, 0, 1))
    row[0] = 1e9
    simulation = flight(BOX, integrator="auto", initial=row)
    simulation.advance(SECOND)
    assert "position" in simulation.accuracy_floor
    row[0] = 1.0
    near = flight(BOX, integrator="auto", initial=row)
    near.advance(SECOND)
    assert near.accuracy_floor == ""


def test_a_floor_that_has_bound_is_told_until_the_reset_whatever_follows():
    string = StringSettings(True, (0.1, 0.15, 0.2), (0.0, 0.0, 2.0), 0.0, 1e5, 0.0, 1.0, True)
    simulation = flight(BOX, integrator="auto", accuracy=1e-13, initial=spinning((1, 2, 3)), string=string)
    assert simulation.accuracy_floor == ""
    simulation.submit(ReleaseString(), SECOND // 100)
    simulation.advance(SECOND)
    assert simulation.string is None
    assert "the string's length" in simulation.accuracy_floor
    simulation.reset()
    assert simulation.accuracy_floor == ""
    everyday = flight(BOX, integrator="auto", initial=spinning((1, 2, 3)), string=string._replace(frequency=100.0))
    everyday.advance(SECOND)
    assert everyday.string is not None and everyday.accuracy_floor == ""


def test_simulate_and_a_recording_tell_of_a_floor(capsys, tmp_path):
    fast = ["--set", "initial.angular_velocity=[60000, 70000, -30000]", "--set", "accuracy=1e-12"]
    for changes, words in (([], ""), (fast, "rounding of the spin")):
        file = str(tmp_path / f"{len(changes)}.mcap")
        assert main(["simulate", "t_handle", "--duration", "0.01", "--json", "--bag", file, *changes]) == 0
        told = json.loads(capsys.readouterr().out)["accuracy_floor"]
        assert words in told and bool(told) == bool(words)
        assert main(["replay", file]) == 0
        assert told in capsys.readouterr().out
        assert read_runs(file)[0].accuracy_floor == told


def test_a_floor_is_judged_by_the_accuracy_and_the_method_of_its_own_segment():
    """Neither a segment of no length nor one of fixed steps has a floor, and what comes later takes none back."""
    far = {"initial.position": [1e3, 0.0, 0.0], "initial.angular_velocity": [0.0, 0.0, 1.0]}
    for script, told in (
        ("[{t: 0, set: {gravity: [0, 0, -1]}}, {t: 0.5, set: {gravity: [0, 0, 0]}}]", False),
        ("[{t: 0.5, set: {accuracy: 1.0e-15}}, {t: 0.5, set: {integrator: rk4}}]", False),
        (
            "[{t: 0, set: {integrator: rk4, accuracy: 1.0e-15}}, {t: 0.5, set: {integrator: auto, accuracy: 1.0e-9}}]",
            False,
        ),
        ("[{t: 0, set: {accuracy: 1.0e-15}}, {t: 0.5, set: {integrator: rk4}}]", True),
        ("[{t: 0, set: {accuracy: 1.0e-15}}, {t: 0.5, set: {accuracy: 1.0e-9}}]", True),
    ):
        run = OfflineRun(make_scenario(far), parse_script(script))
        assert run.simulation.accuracy_floor == ""
        run.advance(SECOND)
        assert ("far from the world's origin" in run.simulation.accuracy_floor) == told, script
