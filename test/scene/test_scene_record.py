# SPDX-License-Identifier: MIT
"""The numbers of a scene are its parameters, each by its own name, and none that decides about the motion is left out."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_proto_ros.base.compilation import copy_fields, new_record
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.mass import INERTIA_MODELS
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.scene.parameters import AT_RESET, LIVE, PARAMETERS, PATTERNS, Parameter, Parameters
from rigid_proto_ros.scene.scenario import Scenario, make_scenario, scene_record
from rigid_proto_ros.simulation.record import BOUNDING_BOX, EXPLICIT, MAX_BALLASTS, POINTS, SCENE, SHELL, SOLID
from rigid_proto_ros.simulation.refusals import AUTO
from rigid_proto_ros.simulation.setup import make_setup

NAN, INF = float("nan"), float("inf")

OF_BALLAST = ("ballasts", "ballast")
"""Fields of the point masses, whose names are the user's choice."""

NOT_OF_THE_MOTION = {
    # What the record MESH is made of.
    *("mesh", "mesh_repair", "mesh_fallback"),
    # How simulated time passes, when commands come and what is said of the motion.
    *("publish_rate", "real_time_factor", "lockstep", "schedule_horizon", "publish_clock", "publish_tf", "record"),
    *("imu_contact", "noise.imu", "noise.seed"),
    # Of another body, which has a scene of its own.
    *("ghost.inertia_model", "ghost.integrator"),
}
"""Parameters that change in flight or at a reset, and leave the motion as it is."""


def field_of(name: str) -> str:
    return name.replace(".", "_")


DECLARED = {field_of(name): parameter for name, parameter in PARAMETERS.items() if field_of(name) in SCENE.names}


def test_every_field_is_a_parameter_or_of_the_ballast() -> None:
    assert set(SCENE.names) == {*DECLARED, *OF_BALLAST}


def test_every_parameter_that_changes_the_motion_has_a_field() -> None:
    """A sweep fills fields by the parameters' names: one without would be left out of its rows without a word."""
    without = {name for name, own in PARAMETERS.items() if own.changes in (LIVE, AT_RESET)} - {
        own.name for own in DECLARED.values()
    }
    assert without == NOT_OF_THE_MOTION
    assert {prefix for prefix, own in PATTERNS.items() if own.changes in (LIVE, AT_RESET)} == {"ballast."}


@pytest.mark.parametrize("field", DECLARED)
def test_a_field_has_the_type_that_its_parameter_declares(field: str) -> None:
    declared, (kind, *_) = DECLARED[field], SCENE.fields[field]
    number, shape = kind.base, kind.shape
    if declared.type == "doubles":
        # Whatever else a parameter accepts, its record has the longest.
        assert (number, shape) == (np.float64, (max(declared.lengths),))
    else:
        types = {"double": np.float64, "bool": np.bool_, "string": np.int64}
        assert (number, shape) == (types[declared.type], ())
        assert declared.type != "string" or declared.choices


def another(declared: Parameter) -> object:
    """A value that isn't the default."""
    if declared.choices:
        return declared.choices[-1 if declared.choices[-1] != declared.default else 0]
    if declared.type == "bool":
        return not declared.default
    if declared.type == "doubles":
        return [0.25 + k for k in range(max(declared.lengths))]
    return declared.default * 0.5 or 0.25


@pytest.mark.parametrize("field", DECLARED)
def test_a_parameter_writes_its_own_field_and_no_other(field: str) -> None:
    declared, before = DECLARED[field], scene_record(Parameters())
    value = another(declared)
    after = scene_record(Parameters().replaced({declared.name: value}))
    expected = declared.choices.index(value) if declared.choices else value
    assert after[field].tolist() == expected
    assert {name for name in SCENE.names if np.any(before[name] != after[name])} == {field}


@pytest.mark.parametrize("field", DECLARED)
def test_the_record_of_all_defaults_has_them(field: str) -> None:
    declared = DECLARED[field]
    expected = declared.choices.index(declared.default) if declared.choices else declared.default
    assert scene_record(Parameters())[field].tolist() == expected


def test_numbers_of_choices_are_those_of_the_parameters() -> None:
    for field, choices in (("inertia_model", INERTIA_MODELS), ("integrator", tuple(INTEGRATORS))):
        assert DECLARED[field].choices == choices
    models = {"solid": SOLID, "shell": SHELL, "points": POINTS, "bounding_box": BOUNDING_BOX, "explicit": EXPLICIT}
    assert {name: INERTIA_MODELS.index(name) for name in INERTIA_MODELS} == models
    assert list(INTEGRATORS)[AUTO] == "auto"


def test_one_factor_scales_all_axes() -> None:
    assert scene_record(Parameters().replaced({"scale": 2.5})).scale.tolist() == [2.5] * 3


def test_ballast_stands_in_the_order_of_its_names_and_without_what_weighs_nothing() -> None:
    ballast = {"ballast.b": [2.0, 1, 2, 3], "ballast.a": [1.0, 4, 5, 6], "ballast.none": [0.0, 7, 8, 9]}
    scene = scene_record(Parameters().replaced(ballast))
    assert scene.ballasts == 2
    assert scene.ballast[:2].tolist() == [[1.0, 4.0, 5.0, 6.0], [2.0, 1.0, 2.0, 3.0]]
    assert not scene.ballast[2:].any()


def many_ballasts(count: int, mass: float = 0.01) -> dict[str, list[float]]:
    return {f"ballast.b{k}": [mass, 0.01 * k, 0.0, 0.02] for k in range(count)}


def test_more_ballast_than_the_record_holds_is_refused_with_words() -> None:
    full = make_scenario(many_ballasts(MAX_BALLASTS))
    alone = make_scenario({})
    assert full.setup.body.mass == pytest.approx(alone.setup.body.mass + 0.01 * MAX_BALLASTS, rel=1e-12)
    accepted = f"ballast: got '{MAX_BALLASTS + 1} point masses'; accepted: at most {MAX_BALLASTS} with a mass"
    with pytest.raises(InputError, match=f"^{accepted}$"):
        make_scenario(many_ballasts(MAX_BALLASTS + 1))
    # In flight, too, and those without a mass don't count.
    with pytest.raises(InputError, match=f"^{accepted}$"):
        full.with_changes({"ballast.more": [0.01, 0.0, 0.0, 0.0]})
    assert make_scenario(many_ballasts(2 * MAX_BALLASTS, 0.0)).setup.body.mass == alone.setup.body.mass


TIED = {"string.attached": True, "string.target": [0.0, 0.0, 1.0], "ballast.a": [0.1, 0.1, 0.0, 0.0]}
MESHED = make_scenario({"mesh": "book", "mass": 1.0, **TIED})
BARE = make_scenario({"mesh": "", "inertia_model": "explicit", **TIED})
IMPOSSIBLE = [
    *((MESHED, f"scale.{k}", value) for k in range(3) for value in (NAN, INF, -INF, 0.0, 1e-10, 1e10)),
    *((MESHED, "mass", value) for value in (NAN, INF, -INF, -1.0)),
    *((MESHED, "ballast.0", value) for value in (NAN, INF, -INF)),
    *((BARE, f"explicit_inertia_tensor.{k}", value) for k in range(6) for value in (NAN, INF, -INF)),
    *((BARE, f"explicit_inertia_tensor.{k}", value) for k in (0, 3, 5) for value in (-1.0, 0.0, 2.1)),
    *((BARE, f"explicit_inertia_center_of_mass.{k}", value) for k in range(3) for value in (NAN, INF, -INF)),
    *((BARE, "explicit_inertia_mass", value) for value in (NAN, INF, -INF)),
    *((BARE, f"initial_orientation_xyzw.{k}", value) for k in range(4) for value in (INF, -INF)),
    *((BARE, f"initial_orientation_xyzw.{k}", NAN) for k in (0, 3)),
    (BARE, "initial_orientation_xyzw.3", 0.0),
    # What auto follows up to a limit.
    *((BARE, f"{name}_damping", INF) for name in ("linear", "angular")),
    *((BARE, f"string_{name}", INF) for name in ("stiffness", "frequency", "damping_ratio")),
    *((MESHED, f"string_attach.{k}", INF) for k in range(3)),
]


@pytest.mark.parametrize(("scenario", "place", "value"), IMPOSSIBLE)
def test_a_number_that_no_body_and_no_start_has_is_refused_also_where_it_is_written_straight_into_the_record(
    scenario: Scenario, place: str, value: float
) -> None:
    scene, setup = new_record(SCENE), scenario.setup
    copy_fields(setup.scene, scene)
    name, _, number = place.partition(".")
    numbers = scene[name].reshape(-1) if number else None
    if numbers is None:
        scene[name] = value
    else:
        numbers[int(number)] = value
    with pytest.raises(InputError):
        make_setup(scene, setup.mesh, setup.surface, provide=scenario.body_mesh and scenario.body_mesh.provide)


@pytest.mark.parametrize("density", [NAN, INF, -INF, -1.0, 0.0])
def test_a_density_that_gives_no_mass_is_refused_in_the_record(density: float) -> None:
    scenario = make_scenario({"mesh": "book"})
    scene = new_record(SCENE)
    copy_fields(scenario.setup.scene, scene)
    scene.density = density
    with pytest.raises(InputError, match="^mass: got .*; accepted: density . volume within 1e-300 .. 1e300 kg$"):
        make_setup(scene, scenario.setup.mesh, scenario.setup.surface)
