# SPDX-License-Identifier: MIT
"""A bad study is refused before anything runs, in one line that names the field; a good one says what its rows are."""

import math
from datetime import date

import numpy as np
import pytest
from sweep_studies import POKES, STRUCTURE, study

from rigid_proto_ros.base.bundled import body_names, study_names
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.sweep.sampling import row_uniforms
from rigid_proto_ros.sweep.study import read_study

PLAIN = {"scene": "t_handle", "duration": 1.0, "vary": {"mass": {"grid": [1.0, 2.0]}}}
NUDGE = {"script": [{"t": 0.1, "at": {"vertex": 0}, "impulse": [0.1, 0.0, 0.0]}]}
CHANGED = {"script": [{"t": 0.1, "set": {"mass": 2.0}}]}
TWELVE = {"from": 1, "to": 2, "count": 10**6}


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"vary": {"mas": {"grid": [1.0]}}}, "vary", "did you mean mass"),
        ({"varry": {}}, "study", "did you mean vary"),
        ({"vary": {"scale.z": {"grid": [1.0]}, "scale": {"grid": [2.0]}}}, "vary", "one of them"),
        ({"scene": "t_handel"}, "scene", "t_handle"),
        ({"vary": {"mass": {"grid": []}}}, "vary.mass.grid", "1 to"),
        ({"vary": {"mass": {"grid": [1.0, math.nan]}}}, "vary.mass.grid, value 2", "finite"),
        ({"vary": {"mass": {"grid": [1.0, -1.0]}}}, "vary.mass", ">= 0"),
        ({"vary": {"mass": {"uniform": [2.0, 2.0]}}, "samples": 3}, "vary.mass.uniform", "a < b"),
        ({"vary": {"mass": {"uniform": [2.0, math.inf]}}, "samples": 3}, "vary.mass.uniform", "finite"),
        ({"vary": {"mass": {"log_uniform": [0.0, 1.0]}}, "samples": 3}, "vary.mass.log_uniform", "0 < a < b"),
        ({"vary": {"mass": {"unifrom": [1.0, 2.0]}}}, "vary.mass", "did you mean uniform"),
        ({"vary": {"mass": {"uniform": [1.0, 2.0]}}}, "samples", "how many"),
        ({"vary": {"contacts.tip": {"grid": [[0, 0, 1]]}}}, "vary", "fixed for the node"),
        ({"vary": {"gravity.q": {"grid": [1.0]}}}, "vary", "x, y, z"),
        ({"vary": {"script.1.force": {"grid": [[0, 0, 1]]}}}, "vary", "a study with a script"),
        ({"vary": {"mass": {"grid": TWELVE}, "density": {"grid": TWELVE}}}, "samples", "at most 10000000"),
        ({"vary": {"mass": {"list": [1, 2]}, "density": {"list": [1, 2, 3]}}}, "vary", "advance together"),
        ({"duration": math.nan}, "duration", "finite"),
        ({"seed": 0.5}, "seed", "whole"),
        ({"measure": {"max": ["sped"]}}, "measure.max", "did you mean speed"),
        ({"measure": {"difference": ["attitude"]}}, "reference", "parameters of a reference"),
        ({"measure": {"first": {"far": {"quantity": "distance"}}}}, "measure.first.far", "one of above, below"),
        ({"watch": 1e6, "measure": {"max": ["spin"]}}, "watch", "samples"),
        ({"set": {"mass": "heavy"}}, "set.mass", "a finite number"),
        ({"set": {"mas": 1.0}}, "study, set.mas", "there is no parameter 'mas'; did you mean mass?"),
        ({"set": {"initial": {"orientatoin_xyzw": [0, 0, 0, 1]}}}, "study, set.initial.", "initial.orientation_xyzw?"),
        ({"reference": {"publish_clok": True}}, "study, reference.publish_clok", "did you mean publish_clock"),
        ({"reference": {"record": "a.mcap"}}, "reference.record", "a parameter that changes the motion"),
        ({"vary": {"record": {"grid": ["a.mcap", "b.mcap"]}}}, "study, vary", "a parameter of the motion"),
        ({**CHANGED, "vary": {"script.1.set.mas": {"grid": [1.0]}}}, "study, vary", "did you mean mass"),
        ({"vary": {"mass": {"grid": [1.0, True]}}}, "vary.mass", "a finite number"),
        ({"vary": {"scale": {"grid": [1, [1, 2]]}}}, "vary.scale", "1 or 3 finite numbers"),
        ({"script": [{"t": 0.1, "at": "tipp", "force": [0, 0, 1]}]}, "script, command 1", "tip"),
        ({"script": [{"t": 0.1, "at": "tip", "froce": [0, 0, 1]}]}, "entry 1", "force"),
        ({**NUDGE, "vary": {"script.1.at.vertex": {"grid": [0, 0.5]}}}, "vary.script.1.at.vertex", "{vertex: i}"),
        ({"script": [{"t": 0, "set": {"mass": date(2020, 1, 1)}}], "vary": {"script.1.t": {"grid": [1]}}}, "", "mass"),
        ({"vary": {"mass": {"grid": {"from": 1, "to": 9, "count": 3, "log": 1}}}}, "mass.grid, log", "true or false"),
        ({"measure": {"flips": {"axis": ["0", "0", "0"]}}}, "measure.flips, axis", "a direction"),
        ({**NUDGE, "vary": {"script.².t": {"grid": [1.0]}}}, "vary", "entries 1 to 1"),
        ({**NUDGE, "vary": {"script.1.at.vertex": {"uniform": [0, 5]}}, "samples": 2}, "vertex", "random_vertex"),
    ],
)
def test_a_bad_study_is_refused_with_its_field(changes, field: str, words: str) -> None:
    with pytest.raises(InputError) as refused:
        study(PLAIN, **changes)
    assert field in refused.value.field
    assert words in str(refused.value)


def test_grids_make_every_combination_and_lists_go_in_step() -> None:
    own = study(STRUCTURE)
    assert own.rows == 3 * 2 * 3 * 2
    rows = [own.variation(k) for k in range(own.rows)]
    seen = {(r.parameters.inertia_model, r.parameters.mesh, r.script[1]["force"][0]) for r in rows}
    assert len(seen) == 18
    pairs = {(r.parameters.mesh, r.parameters.integrator) for r in rows}
    assert pairs == {("t_handle", "auto"), ("hammer", "rk4"), ("book", "dop853")}
    powers = {"mass": {"grid": {"from": 1e-3, "to": 1e3, "count": 7, "log": True}}}
    assert study(PLAIN, vary=powers).columns(np.arange(7))[0].tolist() == [1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0]


def test_names_that_are_numbers_are_names() -> None:
    conditions = {1: {"quantity": "turned", "above": 1.0}, "half": {"quantity": "turned", "above": 3.0}}
    assert study(PLAIN, measure={"first": conditions}).measures.columns == ("first.1", "first.half")


def test_forces_of_thrusters_have_columns_by_number() -> None:
    forces = {"script.1.thrusters": {"grid": [[0.1, 0.0, 0.0, 0.0], [0.0, 0.1, 0.0, 0.0]]}}
    own = study(PLAIN, script=[{"t": 0.1, "thrusters": [0.0, 0.0, 0.0, 0.0]}], vary=forces)
    assert own.vary[0].target.component_names(4) == [f"script.1.thrusters.{k}" for k in range(4)]


def numpys(seed: int, row: int, count: int) -> np.ndarray:
    """The same by numpy's own generator."""
    key = np.random.SeedSequence(seed).generate_state(2, np.uint64)
    return np.random.Generator(np.random.Philox(key=key, counter=row * -(-count // 4))).random(count)


def test_the_numbers_of_a_row_are_the_same_whatever_rows_are_drawn_with_it() -> None:
    rows = np.array([0, 1, 2, 7, 2**31, 2**32 - 1, 2**32, 5, 4, 2**40 + 3], np.int64)
    for seed in (0, 1, 2**32, 2**63 + 11, 2**200 + 1):
        for count in (1, 4, 5):
            found = row_uniforms(seed, rows, count)
            assert np.array_equal(found, [numpys(seed, int(row), count) for row in rows])
    assert len(np.unique(row_uniforms(3, np.arange(1000), 3))) == 3000


def test_a_row_draws_from_its_own_seed() -> None:
    own = study(POKES)
    dimensions = sum(v.form.uniforms for v in own.vary if hasattr(v.form, "uniforms"))
    u = numpys(POKES["seed"], 11, dimensions)
    values = own.variation(11).parameters.named()
    assert values["mass"] == math.exp(math.log(0.1) + (math.log(1.0) - math.log(0.1)) * u[0])
    assert values["scale"] == [0.5 + 1.5 * u[1]]


def test_rotations_and_directions_are_of_unit_length_and_even_and_normal_numbers_are_normal() -> None:
    vary = {
        "initial.orientation_xyzw": "random_rotation",
        "initial.linear_velocity": {"direction": 1.0},
        "gravity.z": {"normal": [3.0, 2.0]},
    }
    rotation, direction, normal = study({**PLAIN, "vary": vary, "samples": 4000}).columns(np.arange(4000))
    # Of 4000: a deviation of the mean is .016, of the variance .022, of the share within one deviation .0074.
    z = (normal - 3.0) / 2.0
    assert abs(z.mean()) < 5 * 0.016 and abs(z.var() - 1.0) < 5 * 0.022
    assert abs((np.abs(z) < 1.0).mean() - 0.6827) < 5 * 0.0074
    assert np.abs((rotation**2).sum(axis=1) - 1.0).max() < 1e-15
    assert np.abs((direction**2).sum(axis=1) - 1.0).max() < 1e-15
    # Means of 4000: ±5 deviations; second moments are 1/4 and 1/3 of the whole.
    assert np.abs(rotation.mean(axis=0)).max() < 5 * 0.5 / 63 and np.abs(direction.mean(axis=0)).max() < 5 * 0.58 / 63
    assert np.abs((rotation**2).mean(axis=0) - 1 / 4).max() < 0.02
    assert np.abs((direction**2).mean(axis=0) - 1 / 3).max() < 0.025


def test_the_bundled_studies_are_good_and_one_takes_every_body() -> None:
    assert study_names() == ["box_tensor", "flip_map"]
    for name in study_names():
        own = read_study(name)
        own.variation(own.rows - 1).scenario  # noqa: B018 (it raises)
    box = read_study("box_tensor")
    assert sorted(box.vary[0].form.values) == body_names()
