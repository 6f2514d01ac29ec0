# SPDX-License-Identifier: MIT
"""The numbers of a scene are its parameters, each by its own name, and none that decides about the motion is left out."""

from __future__ import annotations

import re

import numpy as np
import pytest

from rigid_proto_ros.base.compilation import copy_of, new_record, new_records
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.mass import INERTIA_MODELS
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.integrators.stepping import ROOM
from rigid_proto_ros.parameters.declarations import AT_RESET, LIVE, PARAMETERS, PATTERNS, Parameter, Parameters
from rigid_proto_ros.scene.scenario import Scenario, make_scenario, scene_record
from rigid_proto_ros.simulation.effects import change
from rigid_proto_ros.simulation.flight import LOAD_ROW
from rigid_proto_ros.simulation.record import (
    EXPLICIT,
    MAX_BALLASTS,
    SCENE,
    SCENE_PARAMETERS,
    SOLID,
    WALLED,
    field_of,
)
from rigid_proto_ros.simulation.refusals import AUTO, OUT_OF_BOUNDS, REFUSAL
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


DECLARED = {field_of(name): PARAMETERS[name] for name in SCENE_PARAMETERS}


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
        types = {"double": np.float64, "bool": np.int64, "string": np.int64}
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
    assert [INERTIA_MODELS.index(name) for name in ("solid", "walled", "explicit")] == [SOLID, WALLED, EXPLICIT]
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


def beyond(declared: Parameter) -> list[float]:
    """Numbers that a parameter doesn't accept, as its field holds them."""
    if declared.type not in ("double", "doubles"):
        return [-1, len(declared.choices or (False, True)), 2**62]
    lower = declared.lower if declared.above else np.nextafter(declared.lower, -INF)
    bounds = [bound for bound in (lower, np.nextafter(declared.upper, INF)) if np.isfinite(bound)]
    return [NAN, INF, -INF, *map(float, bounds)]


def written(scenario: Scenario, field: str, number: int, value: float) -> np.record:
    """The scenario's record with one number of a field written straight into it."""
    scene = copy_of(scenario.setup.scene)
    if scene[field].shape:
        scene[field].reshape(-1)[number] = value
    else:
        scene[field] = value
    return scene


@pytest.mark.parametrize("scenario", [MESHED, BARE], ids=["meshed", "bare"])
@pytest.mark.parametrize("field", DECLARED)
def test_a_number_out_of_bounds_is_refused_with_its_parameters_words_wherever_the_record_comes_from(
    scenario: Scenario, field: str
) -> None:
    declared, setup = DECLARED[field], scenario.setup
    for number in range(setup.scene[field].size):
        for value in beyond(declared):
            scene = written(scenario, field, number, value)
            received = re.escape(str(scene[field].tolist()))
            with pytest.raises(InputError, match=f"^{re.escape(declared.name)}: got .*; accepted: ") as refused:
                make_setup(scene, setup.mesh, setup.surface)
            assert refused.value.accepted == declared.accepted and re.search(received, str(refused.value))
            # A change in flight leaves the flight as it is.
            flight, loads, refusal = copy_of(setup.flight), new_records(1, LOAD_ROW), new_record(REFUSAL)
            assert not change(setup.scene, scene, setup.mesh, True, flight, loads, np.zeros(ROOM), refusal)
            assert refusal.code == OUT_OF_BOUNDS and flight.tobytes() == setup.flight.tobytes()


@pytest.mark.parametrize("count", [-1, MAX_BALLASTS + 1, 2**62])
def test_a_number_of_ballasts_that_the_record_has_no_room_for_is_refused(count: int) -> None:
    with pytest.raises(InputError, match=f"^ballast: got '{count} point masses'; accepted: 0 to {MAX_BALLASTS}$"):
        make_setup(written(BARE, "ballasts", 0, count), BARE.setup.mesh)


@pytest.mark.parametrize(("number", "value"), [(0, -1e-300), *((k, v) for k in range(4) for v in (NAN, INF, -INF))])
def test_a_point_mass_that_there_is_none_of_is_refused(number: int, value: float) -> None:
    with pytest.raises(InputError, match="^ballast: got .*; accepted: mass >= 0 .kg. and x, y, z, all finite$"):
        make_setup(written(BARE, "ballast", number, value), BARE.setup.mesh)
    # Of rows that aren't used nothing is read.
    unused = written(BARE, "ballast", 4 + number, value)
    assert make_setup(unused, BARE.setup.mesh).body.mass == BARE.setup.body.mass


IMPOSSIBLE = [
    *((MESHED, "scale", k, value) for k in range(3) for value in (0.0, 1e-10)),
    *((BARE, "explicit_inertia_tensor", k, value) for k in (0, 3, 5) for value in (-1.0, 0.0, 2.1)),
    (BARE, "initial_orientation_xyzw", 3, 0.0),
    # What auto follows up to a limit.
    *((BARE, f"{name}_damping", 0, 1e60) for name in ("linear", "angular")),
    *((BARE, f"string_{name}", 0, value) for name, value in (("stiffness", 1e29), ("frequency", 1e8))),
    *((MESHED, "string_attach", k, 1e100) for k in range(3)),
]


@pytest.mark.parametrize(("scenario", "field", "number", "value"), IMPOSSIBLE)
def test_a_number_that_no_body_and_no_start_has_is_refused_also_where_it_is_written_straight_into_the_record(
    scenario: Scenario, field: str, number: int, value: float
) -> None:
    scene, setup = written(scenario, field, number, value), scenario.setup
    with pytest.raises(InputError):
        make_setup(scene, setup.mesh, setup.surface, provide=scenario.body_mesh and scenario.body_mesh.provide)
