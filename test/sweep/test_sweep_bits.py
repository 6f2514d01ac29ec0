# SPDX-License-Identifier: MIT
"""Rows of a sweep have the simulation's bits, whoever flies them and whatever is flown beside them."""

import json

import numpy as np
import pytest
from sweep_studies import HUNG, POKES, PULLED, STRUCTURE, study

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.parameters.declarations import PARAMETERS
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.simulation.batch import new_results
from rigid_proto_ros.simulation.flight import floor_text
from rigid_proto_ros.simulation.record import SCENE
from rigid_proto_ros.sweep.rows import Chunk, FailedFlight, row_summary, run_chunk, simulate_row


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal to the bit, −0 as +0; NaN and None equal themselves."""
    if a.dtype == object:
        return a.tolist() == b.tolist()
    return np.array_equal(a + 0, b + 0, equal_nan=a.dtype.kind == "f")


def differing_rows(own, chunk: Chunk) -> list[str]:
    """Rows whose measures, floors or reasons differ from those of the simulation."""
    found = []
    for i, row in enumerate(chunk.columns["row"].tolist()):
        alone, reason = new_results(1, len(own.measures.table)), None
        try:
            simulate_row(own, own.variation(row), 0, alone)
        except (FailedFlight, InputError) as error:
            reason = " ".join(str(error).split())
        measured = np.array([chunk.columns[name][i] for name in own.measures.columns])
        floor = floor_text(alone.floors[0]) or None
        if (reason, floor) != (chunk.columns["failure"][i], chunk.columns["accuracy_floor"][i]):
            found.append(f"row {row}: {reason}, {floor}")
        elif not same(alone.measured[0], measured):
            found.append(f"row {row}: other bits")
    return found


@pytest.mark.parametrize(
    ("spec", "is_simulated"),
    [(POKES, False), (HUNG, False), (STRUCTURE, True), (PULLED, True)],
    ids=["pokes", "hung", "structure", "pulled"],
)
def test_rows_have_the_bits_of_the_simulation_whatever_chunk_they_are_in(spec, is_simulated: bool) -> None:
    own = study(spec)
    whole = run_chunk(own, 0, own.rows)
    assert differing_rows(own, whole) == []
    assert whole.simulated == (own.rows if is_simulated else 0)
    for first, last in ((0, 1), (own.rows - 3, own.rows)):
        part = run_chunk(own, first, last).columns
        assert all(same(part[name], whole.columns[name][first:last]) for name in part)
    if spec is STRUCTURE:
        # A ballast below zero is a row with its reason.
        reasons = [reason for reason in whole.columns["failure"].tolist() if reason]
        assert 0 < len(reasons) < own.rows / 2 and any("ballast" in reason for reason in reasons)


def test_energies_and_momentum_are_those_of_the_body_and_gravity_in_force() -> None:
    changed = {"density": 15700.0, "gravity": [0.0, 0.0, -9.81]}
    own = study(
        {
            "scene": "t_handle",
            "script": [{"t": 0.5, "set": changed}],
            "duration": 1.0,
            "set": {"initial.position": [0.0, 0.0, 2.0]},
            "vary": {"script.1.set.density": {"grid": [1000.0, 15700.0]}},
            "measure": {
                "final": ["position", "kinetic_energy", "potential_energy", "angular_momentum", "energy_drift"],
                "min": ["angular_momentum"],
                "max": ["angular_momentum"],
            },
        }
    )
    columns = run_chunk(own, 0, own.rows).columns
    for row in range(own.rows):
        found = {name: column[row] for name, column in columns.items()}
        run = OfflineRun(own.variation(row).scenario, own.variation(row).commands)
        simulation = run.simulation
        energy, momentum = simulation.kinetic_energy, np.linalg.norm(simulation.angular_momentum)
        run.advance(own.duration_ns)
        assert found["kinetic_energy"] == simulation.kinetic_energy
        assert found["potential_energy"] == pytest.approx(simulation.potential_energy, rel=1e-15, abs=0.0)
        now = found["kinetic_energy"] + found["potential_energy"]
        assert found["energy_drift"] == pytest.approx(abs(now / energy - 1.0), rel=1e-14, abs=0.0)
        # Momentum is constant before and after the change: the samples before are of the body before.
        after = np.linalg.norm(simulation.angular_momentum)
        assert found["angular_momentum"] == pytest.approx(after, rel=1e-14, abs=0.0)
        extremes = [found["min.angular_momentum"], found["max.angular_momentum"]]
        assert extremes == pytest.approx(sorted([momentum, after]), rel=1e-12, abs=0.0)
        assert extremes[1] > 1.5 * extremes[0]


def test_what_a_body_at_rest_has_none_of_doesnt_drift() -> None:
    """Neither energy nor angular momentum at the start: their drifts are null, and no number of JSON is infinite."""
    spec = {
        "scene": "t_handle",
        "set": {"initial.angular_velocity": [0.0, 0.0, 0.0]},
        "script": [{"t": 0.1, "at": "tip", "impulse": [0.001, 0.0, 0.0]}],
        "duration": 0.2,
        "vary": {"mass": {"grid": [0.1, 0.2]}},
        "measure": {kind: ["energy_drift", "momentum_turned", "spin"] for kind in ("final", "max", "min")},
    }
    found = json.loads(json.dumps(row_summary(study(spec), 1), allow_nan=False))
    assert found["failure"] is None and found["max.spin"] > 0.0 and found["min.spin"] == 0.0
    assert [found[name] for name in found if "drift" in name or "turned" in name] == [None] * 6


@pytest.mark.parametrize(
    ("name", "written", "plain"),
    [
        ("scale", [1, [1, 2, 1]], [[1, 1, 1], [1, 2, 1]]),
        ("scale", [1, "2"], [1, 2]),
        ("scale.z", ["1", 2], [1, 2]),
        ("mass", [0.1, "0.2"], [0.1, 0.2]),
        ("initial.angular_velocity", [[1, 2, 3], ["1e-3", 0, 1]], [[1, 2, 3], [1e-3, 0, 1]]),
        ("initial.orientation_xyzw", ["0 0 0 1", [1, 0, 0, 0]], [[0, 0, 0, 1], [1, 0, 0, 0]]),
    ],
)
def test_values_make_the_same_rows_however_their_numbers_are_written(name: str, written: list, plain: list) -> None:
    spec = {"scene": "t_handle", "duration": 0.1, "vary": {}}
    own, other = (study(spec, vary={name: {"grid": values}}) for values in (written, plain))
    chunk = run_chunk(own, 0, own.rows)
    assert chunk.simulated == 0 and differing_rows(own, chunk) == []
    expected = run_chunk(other, 0, other.rows).columns
    assert chunk.columns.keys() == expected.keys()
    assert all(same(column, expected[key]) for key, column in chunk.columns.items())


OFTEN = ("free_body", "rk4", "semi_implicit_euler")
"""One of each way to step, beside auto; the others are stepped in the same way and flown under stress."""


@pytest.mark.parametrize(
    "integrator", [pytest.param(n, marks=() if n in OFTEN else pytest.mark.stress) for n in sorted(INTEGRATORS)]
)
def test_every_integrator_has_its_own_bits_in_a_batch(integrator: str) -> None:
    # Free flight is all that each of them carries; `taylor` and the rest get what more they can.
    free = not INTEGRATORS[integrator].supports
    spec = {
        "scene": "t_handle",
        "script": [] if free else [{"t": 0.01, "axes": "body", "torque": [0.001, 0.0, 0.0], "duration": 0.02}],
        "duration": 0.05,
        "set": {"integrator": integrator, "gravity": [0.0, 0.0, -9.81]},
        "samples": 3,
        "vary": {"initial.angular_velocity": {"direction": 8.0}, "mass": {"uniform": [0.1, 1.0]}},
    }
    own = study(spec)
    chunk = run_chunk(own, 0, own.rows)
    assert chunk.simulated == 0
    assert differing_rows(own, chunk) == []


EVERYTHING = {
    "scale": [1.1, 0.9, 1.2],
    "mass": 0.2,
    "density": 900.0,
    "wall_thickness": 5e-4,
    "infill": 0.3,
    "explicit_inertia": {
        "mass": 0.3,
        "center_of_mass": [0.01, 0.02, 0.03],
        "tensor": [3e-4, 1e-5, -1e-5, 3.5e-4, 2e-5, 4e-4],
    },
    "gravity": [0.5, -0.7, -9.81],
    "linear_damping": 0.02,
    "angular_damping": 1e-5,
    "rotor": {"momentum": [1e-3, -2e-3, 3e-3], "torque": [-1e-2, 2e-2, 1e-2]},
    "initial": {
        "position": [0.1, 0.2, -0.3],
        "orientation_xyzw": [0.1, -0.2, 0.3, 0.9],
        "linear_velocity": [0.2, -0.1, 0.3],
        "angular_velocity": [0.5, 3.0, -1.0],
        "string_mass": 0.05,
    },
    "step": 0.004,
    "accuracy": 1e-7,
    "wrench_timeout": 0.02,
    "poke_duration": 0.03,
    "string": {
        "attached": True,
        "attach": [0.01, 0.02, 0.07],
        "target": [0.1, 0.2, 0.4],
        "stiffness": 20.0,
        "frequency": 30.0,
        "damping_ratio": 0.2,
        "rest_length": 0.1,
        "timeout": 0.04,
    },
}
"""A value other than zero for every number of a scene's record."""

ONLY_WITH = {
    "density": {"mass": 0.0},
    **dict.fromkeys(("wall_thickness", "infill"), {"inertia_model": "walled"}),
    **{f"explicit_inertia.{own}": {"inertia_model": "explicit"} for own in EVERYTHING["explicit_inertia"]},
    "step": {"integrator": "rk4"},
    "string.stiffness": {"string": {**EVERYTHING["string"], "frequency": 0.0}},
}
"""What a parameter needs to matter, beside the rest."""

ONLY_FOR_TARGETS = {"string.timeout"}
"""A string that is tied from the start has no timeout, and targets are the simulation's."""

NUMBERS = [
    name
    for name, own in PARAMETERS.items()
    if own.type in ("double", "doubles") and name.replace(".", "_") in SCENE.names
]


def values_of(name: str) -> list:
    """The value that EVERYTHING has for a parameter, and that with each of its numbers 1.25 times as large."""
    value = EVERYTHING
    for word in name.split("."):
        value = value[word]
    if not isinstance(value, list):
        return [value, 1.25 * value]
    return [value, *([1.25 * c if i == k else c for i, c in enumerate(value)] for k in range(len(value)))]


@pytest.mark.parametrize("name", NUMBERS)
def test_a_sweep_over_any_number_of_a_scene_has_the_bits_of_the_simulation_and_the_number_counts(name: str) -> None:
    final = ["position", "orientation", "velocity", "spin", "kinetic_energy", "energy"]
    spec = {
        "scene": "t_handle",
        "script": [
            {"t": 0.01, "at": "tip", "force": [0.2, 0.0, 0.5]},
            {"t": 0.02, "wrench": {"at": "left", "force": [0.0, 0.1, 0.1]}},
        ],
        "duration": 0.1,
        "set": {**EVERYTHING, **ONLY_WITH.get(name, {})},
        "vary": {name: {"list": values_of(name)}},
        "measure": {"final": final, "max": ["potential_energy"]},
    }
    own = study(spec)
    chunk = run_chunk(own, 0, own.rows)
    assert chunk.simulated == 0
    assert differing_rows(own, chunk) == []
    measured = np.array([chunk.columns[column] for column in own.measures.columns])
    is_other = (measured[:, 1:] != measured[:, :1]).any(axis=0)
    assert not is_other.any() if name in ONLY_FOR_TARGETS else is_other.all()


def test_a_row_that_is_too_fast_for_auto_is_refused_with_what_its_body_takes() -> None:
    changed = [{"t": 0.1, "set": {"angular_damping": 0.0}}]
    for name, values, script in (
        ("angular_damping", [1e-3, 1e6], []),
        ("string.frequency", [10.0, 1e7], []),
        ("script.1.set.angular_damping", [1e-3, 1e6], changed),
    ):
        own = study({**HUNG, "samples": 1, "vary": {name: {"list": values}}, "script": script})
        reasons = run_chunk(own, 0, own.rows).columns["failure"].tolist()
        assert reasons[0] is None and "for this body: auto follows rates up to" in reasons[1]


@pytest.mark.parametrize(("name", "values"), [("script.1.force.x", [1e20, 0.1]), ("mass", [1e-18, 0.1])])
def test_a_row_whose_load_is_too_large_for_its_body_is_refused_with_its_reason(name: str, values: list[float]) -> None:
    script = [{"t": 0.01, "at": "com", "force": [0.1, 0.0, 0.0], "duration": 0.02}]
    chunk = run_chunk(
        study({"scene": "t_handle", "script": script, "duration": 0.05, "vary": {name: {"list": values}}}), 0, 2
    )
    assert chunk.simulated == 1
    first, second = chunk.columns["failure"].tolist()
    assert second is None and "accepted: at most 1e+15 of each for a body of" in first


def test_a_floor_of_accuracy_is_in_the_table_whoever_flew_the_row() -> None:
    vary = {"initial.angular_velocity": {"list": [[0.1, 0.2, 3.0], [6e4, 7e4, -3e4]]}}
    spec = {"scene": "t_handle", "set": {"accuracy": 1e-12}, "duration": 0.01, "vary": vary}
    moved = [{"t": 0.005, "state": {"position": [0.0, 0.0, 1.0]}}]
    for own, simulated in ((study(spec), 0), (study(spec, script=moved), 2)):
        chunk = run_chunk(own, 0, own.rows)
        assert chunk.simulated == simulated
        slow, *others = chunk.columns["accuracy_floor"].tolist()
        assert slow is None and "rounding of the spin" in others[-1]


def test_what_the_batch_refuses_is_the_simulations_to_explain() -> None:
    spec = {
        "scene": "t_handle",
        "duration": 0.01,
        "set": {"inertia_model": "explicit", "explicit_inertia.tensor": [1, 0, 0, 1, 0, 1]},
        "vary": {"explicit_inertia.tensor.izz": {"grid": [0.5, 1.0, 2.0, 2.5, 1e-14]}},
    }
    reasons = run_chunk(study(spec), 0, 5).columns["failure"].tolist()
    assert reasons[:3] == [None] * 3
    assert "A + B >= C" in reasons[3] and "at most 1e12" in reasons[4]
