# SPDX-License-Identifier: MIT
"""What is refused, at the start, before a command acts and when it acts, and the words for it."""

from __future__ import annotations

import pytest
from flights import SECOND, wrench

from rigid_proto_ros.base.errors import CommandRefused, InputError
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.loads import ANGULAR_DAMPING, BODY_FORCE, NO_GYROSCOPIC_TERM, STRING, WORLD_TORQUE
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.commands import Change, Command, MoveString, ThrusterCommand, TieString
from rigid_proto_ros.simulation.simulation import Simulation

BARE = {"mesh": "", "inertia_model": "explicit", "explicit_inertia.tensor": [0.02, 0.0, 0.0, 0.03, 0.0, 0.04]}
"""A body of 1 kg, without a mesh."""
THRUSTER = {"thrusters.a": [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]}


def explicit(*tensor: float, **more: object) -> dict:
    return {**BARE, "explicit_inertia.tensor": list(tensor), **more}


def tied(**own: float) -> dict:
    """A string of these parameters."""
    return {"string.attached": True, "string.target": [0.0, 0.0, 1.0], **{f"string.{name}": own[name] for name in own}}


def supported(integrator: str, *needs: str) -> str:
    able = ", ".join(name for name, own in INTEGRATORS.items() if own.supports >= set(needs))
    return f"integrator: got '{integrator}'; accepted: one that supports {' and '.join(sorted(needs))}: {able}"


def at_most(parameter: str, received: str, most: str, rate: str) -> str:
    why = f"auto follows rates up to 500000 /s, and this is one of {rate} /s"
    return f"{parameter}: got {received}; accepted: at most {most} for this body: {why}"


def too_large(linear: str, angular: str, mass: str = "1") -> str:
    received = f"{linear} m/s² and {angular} rad/s²"
    return f"wrench: got '{received}'; accepted: at most 1e+15 of each for a body of {mass} kg"


POSITIVE = (
    "accepted: principal moments all positive, the largest at most 1e12 times the smallest (a body on one line has no "
    "such tensor)"
)
UNEQUAL = (
    "accepted: principal moments A <= B <= C with A + B >= C (1 - 1e-5), as every body has; with these A and B, C is at "
    "most 2 kg m²: look for swapped entries and another unit"
)
AT_START = [
    (
        {"scale": [1.0, 0.0, 1.0]},
        "scale: got [1.0, 0.0, 1.0]; accepted: one or three numbers, each with 1e-9 <= |s| <= 1e9",
    ),
    ({"density": 1e-300, "scale": 1e-9}, "mass: got 0.0; accepted: density * volume within 1e-300 .. 1e300 kg"),
    ({"mesh": "", "inertia_model": "shell"}, "mesh: a mesh is needed, unless inertia_model is explicit"),
    (
        {"initial.orientation_xyzw": [0.0] * 4},
        "initial.orientation_xyzw: got [0.0, 0.0, 0.0, 0.0]; accepted: four finite numbers x, y, z, w, not all zero",
    ),
    (explicit(1.0, 0.0, 0.0, -1.0, 0.0, 1.0), f"explicit_inertia.tensor: got (-1.0, 1.0, 1.0); {POSITIVE}"),
    (explicit(1e-13, 0.0, 0.0, 1.0, 0.0, 1.0), f"explicit_inertia.tensor: got (1e-13, 1.0, 1.0); {POSITIVE}"),
    (explicit(1.0, 0.0, 0.0, 1.0, 0.0, 2.1), f"explicit_inertia.tensor: got (1.0, 1.0, 2.1); {UNEQUAL}"),
    (
        explicit(*[0.0] * 6),
        f"explicit_inertia.tensor: got {[[0.0] * 3] * 3}; accepted: a symmetric matrix other than zero",
    ),
    (
        explicit(1e-15, 0.0, 0.0, 1e-15, 0.0, 1e-15, **{"ballast.far": [1.0, 1.0, 0.0, 0.0]}),
        f"explicit_inertia.tensor with ballast: got (1e-15, 0.500000000000001, 0.500000000000001); {POSITIVE}",
    ),
    (
        {"inertia_model": "points", "scale": [1.0, 1e-8, 1e-8]},
        "inertia_model points: got 't_handle: (3.6842881047052116e-37, 3.900935502431565e-23, 3.9009355024315737e-23)'; "
        + POSITIVE,
    ),
    ({"integrator": "free_body", "angular_damping": 0.1}, supported("free_body", ANGULAR_DAMPING)),
    ({"integrator": "lie_midpoint", "gyroscopic": False}, supported("lie_midpoint", NO_GYROSCOPIC_TERM)),
    ({"integrator": "taylor", **tied()}, supported("taylor", STRING)),
    (
        {"integrator": "free_body", "gyroscopic": False, "angular_damping": 1.0, **tied()},
        supported("free_body", STRING, ANGULAR_DAMPING, NO_GYROSCOPIC_TERM),
    ),
    ({**BARE, "linear_damping": 1e60}, at_most("linear_damping", "1e+60", "500000 N s/m", "1e+60")),
    ({**BARE, "angular_damping": 1e60}, at_most("angular_damping", "1e+60", "10000 N m s", "5e+61")),
    ({**BARE, **tied(frequency=1e8)}, at_most("string.frequency", "100000000.0", "500000 rad/s", "1e+08")),
    ({**BARE, **tied(stiffness=1e29)}, at_most("string.stiffness", "1e+29", "2.5e+11 N/m", "3.16e+14")),
    (
        {**BARE, **tied(frequency=1e5, damping_ratio=1e5)},
        at_most("string.damping_ratio", "100000.0", "2.5", "2e+10"),
    ),
]


@pytest.mark.parametrize(("values", "words"), AT_START)
def test_a_scene_is_refused_with_these_words_at_its_start_and_as_a_change_in_flight(values: dict, words: str) -> None:
    with pytest.raises(InputError) as refused:
        make_scenario(values)
    assert str(refused.value) == words
    with pytest.raises(InputError) as refused:
        make_scenario({}).with_changes(values)
    assert str(refused.value) == words


def ray(down: float) -> str:
    return f"world@ray/0.0,0.0,1.0/0.0,0.0,{-down}"


HIGH = (0.0, 0.0, 1e30)
SUBMITTED = [
    (BARE, wrench("world@com", HIGH), too_large("1.73e+30", "0")),
    (BARE, wrench("world@com;impulse", HIGH, held=False), too_large("1.73e+30", "0")),
    (BARE, wrench("body", torque=HIGH), too_large("0", "8.66e+31")),
    (BARE, wrench("world@point/1e20,0,0", (0.0, 1.0, 0.0)), too_large("1.73", "1.5e+22")),
    ({"mass": 1.0}, wrench("normal@vertex/0", (1e30, 0.0, 0.0)), too_large("1.73e+30", "3.07e+32")),
    ({"mass": 1.0}, wrench(ray(1.0), HIGH), too_large("1.73e+30", "0")),
    (BARE, wrench(ray(1.0), HIGH), "frame_id: got '{}'; accepted: this point only on a body with a mesh"),
    (BARE, wrench("world@vertex/0", HIGH), "frame_id: got '{}'; accepted: this point only on a body with a mesh"),
    (
        BARE,
        wrench("normal@point/1.0,0.0,0.0", (1.0, 0.0, 0.0)),
        "frame_id: got '{}'; accepted: normal axes only on a body with a mesh",
    ),
    ({}, wrench("world@vertex/984", HIGH), "frame_id: got '{}'; accepted: vertex/0 to vertex/983"),
    ({"integrator": "taylor"}, wrench("world", torque=(1.0, 0.0, 0.0)), supported("taylor", WORLD_TORQUE)),
    ({"integrator": "free_body"}, wrench("body@com", (1.0, 0.0, 0.0)), supported("free_body", BODY_FORCE)),
    ({"integrator": "taylor"}, MoveString((0.0, 0.0, 1.0)), supported("taylor", STRING)),
    (THRUSTER, ThrusterCommand((1.0, 2.0)), "thrusters: got '2 numbers'; accepted: 1 numbers, one a thruster (a)"),
    (
        {},
        ThrusterCommand((1.0,)),
        "thrusters: got '1 numbers'; accepted: 0 numbers, one a thruster (none is declared by thrusters.<name>)",
    ),
    ({**BARE, **THRUSTER}, ThrusterCommand((1e30,)), too_large("1.73e+30", "0")),
    ({"integrator": "free_body", **THRUSTER}, ThrusterCommand((0.0,)), supported("free_body", "a torque", BODY_FORCE)),
]


@pytest.mark.parametrize(("values", "command", "words"), SUBMITTED)
def test_a_command_is_refused_with_these_words_when_it_is_submitted(values: dict, command: Command, words: str) -> None:
    simulation = Simulation(make_scenario(values).setup)
    with pytest.raises(CommandRefused) as refused:
        simulation.submit(command, SECOND)
    assert str(refused.value) == words.format(getattr(command, "frame_id", ""))
    assert not simulation.refused


LIGHT = {"explicit_inertia.mass": 1e-9, "explicit_inertia.tensor": [2e-11, 0.0, 0.0, 3e-11, 0.0, 4e-11]}
"""Of BARE, what makes it lighter."""
IN_FLIGHT = [
    (BARE, LIGHT, wrench("world@com", (1e7, 0.0, 0.0)), "magnitude", too_large("1.73e+16", "0", "1e-09")),
    (
        BARE,
        LIGHT,
        wrench("world;impulse", (1e7, 0.0, 0.0), held=False),
        "magnitude",
        too_large("1.73e+16", "0", "1e-09"),
    ),
    (
        BARE,
        {"integrator": "taylor"},
        wrench("world", torque=(1.0, 0.0, 0.0)),
        "integrator",
        supported("taylor", WORLD_TORQUE),
    ),
    (
        BARE,
        {"integrator": "free_body"},
        wrench("body@com", (1.0, 0.0, 0.0)),
        "integrator",
        supported("free_body", BODY_FORCE),
    ),
    (
        {"mass": 1.0},
        {"mass": 1e-9},
        wrench(ray(1.0), (1e7, 0.0, 0.0)),
        "magnitude",
        too_large("1.73e+16", "3.68e+18", "1e-09"),
    ),
    ({}, {"integrator": "taylor"}, wrench(ray(1.0), (1.0, 0.0, 0.0)), "integrator", supported("taylor", WORLD_TORQUE)),
    ({}, {}, wrench(ray(-1.0), (1.0, 0.0, 0.0)), "ray_miss", "frame_id: got '{}'; accepted: a ray that meets the body"),
    (
        {},
        BARE,
        wrench("world@vertex/0", (1.0, 0.0, 0.0)),
        "frame",
        "frame_id: got '{}'; accepted: this point only on a body with a mesh",
    ),
    (
        {"mesh": "l_bracket"},
        {"mesh": "t_handle"},
        wrench("world@vertex/1499", (1.0, 0.0, 0.0)),
        "frame",
        "frame_id: got '{}'; accepted: vertex/0 to vertex/983",
    ),
    ({**BARE, **THRUSTER}, LIGHT, ThrusterCommand((1e7,)), "magnitude", too_large("1.73e+16", "0", "1e-09")),
    (
        {**BARE, **THRUSTER},
        {"integrator": "free_body"},
        ThrusterCommand((1.0,)),
        "integrator",
        supported("free_body", "a torque", BODY_FORCE),
    ),
    (BARE, {"integrator": "taylor"}, MoveString((0.0, 0.0, 1.0)), "integrator", supported("taylor", STRING)),
    (
        {**BARE, **tied()},
        {},
        MoveString(HIGH),
        "magnitude",
        "string target: got [0.0, 0.0, 1e+30]; accepted: a target that pulls with at most 1e+15 m/s²",
    ),
    (
        {**BARE, **tied(damping_ratio=0.0, stiffness=1e11)},
        {},
        TieString("mesh", (1.0, 0.0, 0.0)),
        "integrator",
        at_most("string.stiffness", "100000000000.0", "4.9e+09 N/m", "2.26e+06"),
    ),
    (
        {**BARE, "string.stiffness": 1e29},
        {},
        MoveString((0.0, 0.0, 1.0)),
        "integrator",
        at_most("string.stiffness", "1e+29", "2.5e+11 N/m", "3.16e+14"),
    ),
    ({**BARE, **tied()}, {}, {"integrator": "free_body"}, "integrator", supported("free_body", STRING)),
    (BARE, {}, {"angular_damping": 1e60}, "integrator", at_most("angular_damping", "1e+60", "10000 N m s", "5e+61")),
]


@pytest.mark.parametrize(("values", "change", "command", "reason", "words"), IN_FLIGHT)
def test_a_command_is_refused_with_these_words_when_it_acts(
    values: dict, change: dict, command: Command | dict, reason: str, words: str
) -> None:
    """After a change of parameters for which it was no longer checked; what comes of it is what comes without it."""
    scenario = make_scenario(values)
    flown = []
    for with_it in (True, False):
        simulation = Simulation(scenario.setup)
        if change:
            simulation.submit(Change(change, lambda: scenario.with_changes(change).setup), 10_000)
        if with_it:
            sent = (
                Change(command, lambda: scenario.with_changes(command).setup) if isinstance(command, dict) else command
            )
            simulation.submit(sent, 20_000)
        simulation.advance(SECOND // 20)
        flown.append(simulation)
    one, other = flown
    assert (one.refused, other.refused) == ({reason: 1}, {})
    assert one.refusals[reason] == words.format(getattr(command, "frame_id", ""))
    assert one.state.sha256() == other.state.sha256()


def test_a_change_is_refused_for_the_loads_that_act() -> None:
    scenario = make_scenario({})
    simulation = Simulation(scenario.setup)
    simulation.submit(wrench("world", torque=(0.001, 0.0, 0.0)))
    simulation.submit(wrench("body@com;slot=hand", (0.001, 0.0, 0.0)))
    simulation.advance(10_000)
    with pytest.raises(CommandRefused) as refused:
        simulation.check_change(scenario.with_changes({"integrator": "free_body"}).setup)
    assert str(refused.value) == supported("free_body", BODY_FORCE, WORLD_TORQUE)
