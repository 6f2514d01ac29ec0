# SPDX-License-Identifier: MIT
"""What a second simulation, ten times as accurate, says of the first one's end."""

from __future__ import annotations

import json

import numpy as np
import pytest

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import expand_script
from rigid_proto_ros.scene.sensitivity import finer, sensitivity_of
from rigid_proto_ros.simulation.quantities import attitude_angle
from rigid_proto_ros.sweep.flights import Flight, read_command
from rigid_proto_ros.sweep.rows import run_chunk
from rigid_proto_ros.sweep.study import make_study

CHAOTIC = {
    "mesh": "t_handle",
    "accuracy": 1e-8,
    "gravity": [0.0, 0.0, -9.81],
    "string.attached": True,
    "string.target": [0.0, 0.0, 0.1],
    "string.rest_length": 0.0,
    "string.frequency": 50.0,
    "string.damping_ratio": 0.0,
}
REGULAR = {"mesh": "t_handle", "initial.angular_velocity": [0.1, 0.2, 5.0], "angular_damping": 1e-5}
END_NS = 3_000_000_000


def sensitivity(values, script=()):
    scenario, commands = make_scenario(values), expand_script(list(script), "script")
    run = OfflineRun(scenario, commands)
    run.advance(END_NS)
    return sensitivity_of(run.simulation, scenario, commands)


def test_an_undamped_spring_of_zero_length_is_told_and_its_steps_are_all_good():
    scenario = make_scenario(CHAOTIC)
    run = OfflineRun(scenario)
    run.advance(END_NS)
    assert run.simulation.accuracy_floor == ""
    assert sensitivity_of(run.simulation, scenario, [])["attitude"] > 0.1


def test_a_regular_motion_moves_by_about_its_accuracy():
    found = sensitivity(REGULAR)
    assert 0.0 < found["attitude"] < 1e-8
    assert found["accuracy"] == 1e-10


@pytest.mark.parametrize(("integrator", "order"), [("euler", 1), ("midpoint", 2), ("rk4", 4), ("lie_midpoint", 2)])
def test_of_fixed_steps_it_is_the_error_itself(integrator, order):
    """A tenth of the error is left in the second flight, so the two are 0.9 of the error apart."""
    values = {**REGULAR, "angular_damping": 0.0, "initial.angular_velocity": [0.01, 0.5, 0.3]}
    exact, fixed = (
        OfflineRun(make_scenario({**values, **own})) for own in ({}, {"integrator": integrator, "step": 0.01})
    )
    for run in (exact, fixed):
        run.advance(END_NS)
    error = attitude_angle(*(np.array(run.simulation.state.orientation_xyzw) for run in (exact, fixed)))
    found = sensitivity_of(fixed.simulation, fixed.scenario, [])
    assert found["attitude"] == pytest.approx(0.9 * error, rel=0.1)
    assert found["step"] == pytest.approx(0.01 / 10 ** (1 / order), abs=1e-9)


def test_an_exact_motion_does_not_move():
    found = sensitivity({"mesh": "t_handle", "initial.angular_velocity": [0.1, 0.2, 5.0]})
    assert [found[name] for name in ("attitude", "position", "velocity", "spin")] == [0.0] * 4


def test_commands_act_on_the_second_flight_too_and_what_they_set_is_made_finer():
    script = [
        {"t": 0.5, "at": {"point": [0.0, 0.02, 0.0]}, "force": [0.0, 0.0, 0.1], "duration": 0.1},
        {"t": 1.0, "set": {"integrator": "euler", "step": 0.01}},
    ]
    found = sensitivity(REGULAR, script)
    assert found["step"] == pytest.approx(0.001)
    assert 1e-5 < found["attitude"] < 1.0
    assert sensitivity(REGULAR, script[:1])["attitude"] < 1e-8


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"accuracy": 5e-16}, "accuracy 5e-16'; accepted: accuracy above 1e-15"),
        ({"integrator": "rk4", "step": 1e-9}, "step 1e-09"),
    ],
)
def test_what_can_be_no_more_accurate_is_refused(values, said, capsys):
    with pytest.raises(InputError, match="sensitivity: got"):
        finer(make_scenario({**REGULAR, **values}))
    settings = [f"--set={name}={value}" for name, value in values.items()]
    assert main(["simulate", "t_handle", "--sensitivity", *settings]) == 2
    assert said in capsys.readouterr().err


def test_simulate_prints_it_and_its_own_result_stays(capsys):
    assert main(["simulate", "top_on_string", "--json"]) == 0
    without = json.loads(capsys.readouterr().out)
    assert main(["simulate", "top_on_string", "--json", "--sensitivity"]) == 0
    with_it = json.loads(capsys.readouterr().out)
    found = with_it.pop("sensitivity")
    assert {**without, "wall_time": 0} == {**with_it, "wall_time": 0}
    assert 0.0 < found["attitude"] < 1e-8
    assert main(["simulate", "top_on_string", "--sensitivity"]) == 0
    assert f"{found['attitude']:.3g} rad and {found['position']:.3g} m with accuracy 1e-10" in capsys.readouterr().out


def test_a_motion_that_stops_has_none(capsys):
    arguments = ["simulate", "t_handle", "--sensitivity", "--set=integrator=euler", "--set=step=0.1", "--duration=200"]
    assert main([*arguments, "--set=initial.angular_velocity=[0, 30, 1]", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["sensitivity"]["attitude"] is None


def test_a_flight_from_python_tells_its_own():
    scenario = make_scenario({**REGULAR, "accuracy": 1e-4})
    flight = Flight(scenario)
    script = []
    for k in range(20):
        torque = (1e-5 * np.cos(k)).item()
        flight.command({"wrench": {"axes": "body", "torque": [0.0, torque, 0.0]}})
        script.append({"t": 0.1 * k, "wrench": {"axes": "body", "torque": [0.0, torque, 0.0]}})
        flight.step(0.1)
    run = OfflineRun(scenario, expand_script(script, "script"))
    run.advance(2_000_000_000)
    expected = sensitivity_of(run.simulation, scenario, expand_script(script, "script"))
    found = flight.sensitivity()
    assert 0.0 < found["attitude"] < 1e-3
    assert found == {name: expected[name] for name in found}
    assert flight.sample().time_ns == 2_000_000_000


def test_a_flight_that_begins_again_and_commands_read_once_are_repeated_when_they_acted():
    scenario = make_scenario({**REGULAR, "accuracy": 1e-4})
    poke = read_command({"wrench": {"axes": "body", "torque": [0.0, 1e-4, 0.0], "duration": 0.3}})
    flight, fresh = Flight(scenario), Flight(scenario)
    flight.command({"set": {"mass": 1.0}})
    flight.step(0.5)
    flight.reset()
    for one in (flight, fresh):
        for _ in range(4):
            one.step(0.4)
            one.command(poke)
        one.step(0.4)
    assert (flight.sample().row == fresh.sample().row).all()
    assert 0.0 < flight.sensitivity()["attitude"] < 1e-3
    assert flight.sensitivity() == fresh.sensitivity()


def test_a_sweep_has_it_as_columns_of_the_batch_and_of_the_simulation_alike():
    spec = {
        "scene": "t_handle",
        "duration": 3.0,
        "samples": 8,
        "set": {name: value for name, value in CHAOTIC.items() if name != "mesh"},
        "vary": {"initial.angular_velocity": {"direction": 3.0}},
        "measure": {"sensitivity": ["attitude", "position"]},
    }
    study = make_study(spec)
    chunk = run_chunk(study, 0, 8)
    assert chunk.simulated == 0
    assert (chunk.columns["sensitivity.attitude"] > 1e-4).all()
    for row in range(2):
        variation = study.variation(row)
        run = OfflineRun(variation.scenario, variation.commands)
        run.advance(END_NS)
        found = sensitivity_of(run.simulation, variation.scenario, variation.commands)
        assert [chunk.columns[f"sensitivity.{name}"][row] for name in ("attitude", "position")] == [
            found["attitude"],
            found["position"],
        ]
    for more in (
        {"reference": {"inertia_model": "bounding_box"}},
        {"vary": {"accuracy": {"grid": [1e-8, 1e-6]}}, "samples": 1},
        {"script": [{"t": 1.0, "set": {"accuracy": 1e-6}}]},
    ):
        with pytest.raises(InputError, match="measure.sensitivity"):
            make_study({**spec, **more})
