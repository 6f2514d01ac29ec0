# SPDX-License-Identifier: MIT
"""Mass, tensor, size and mesh changed in flight: what stays continuous, and what the energy is afterwards."""

import math

import numpy as np
import pytest
from flights import SECOND

from rigid_proto_ros.base.errors import CommandRefused, InputError
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.scene.scenario import make_scenario, with_inertia
from rigid_proto_ros.simulation.commands import Change, SetState
from rigid_proto_ros.simulation.simulation import Simulation

SCENE = {
    "mesh": "t_handle",
    "density": 7850.0,
    "integrator": "rk4",
    "gravity": [0.1, 0.0, -1.0],
    "initial.position": [0.3, -0.2, 0.5],
    "initial.orientation_xyzw": [0.2, -0.4, 0.4, 0.8],
    "initial.linear_velocity": [0.1, 0.2, -0.1],
    "initial.angular_velocity": [0.5, -2.0, 3.0],
}
WHEN = SECOND // 2
MESH_STAYS = [
    {"inertia_model": "bounding_box"},
    {"inertia_model": "shell", "mass": 2.0},
    {"density": 100.0},
    {"ballast.nut": [0.05, 0.0, 0.05, 0.02]},
    {
        "inertia_model": "explicit",
        "explicit_inertia.mass": 3.0,
        "explicit_inertia.center_of_mass": [0.01, 0.02, -0.03],
        "explicit_inertia.tensor": [0.02, 0.001, 0.0, 0.03, -0.002, 0.04],
    },
]


class Flight:
    """A simulation whose parameters change as a node changes them: each set on top of those in force."""

    def __init__(self, **values) -> None:
        self.scenario = make_scenario({**SCENE, **values})
        self.simulation = Simulation(self.scenario.setup)

    def change(self, changes: dict, at_ns: int | None = None) -> None:
        def apply():
            self.scenario = self.scenario.with_changes(changes)
            return self.scenario.setup

        self.simulation.submit(Change(changes, apply), at_ns)

    def around(self, changes: dict) -> tuple:
        """State and setup just before and right after the changes, at one instant; the energy is that of the new ones."""
        self.simulation.advance(WHEN)
        before = self.simulation.state, self.simulation.setup
        self.change(changes)
        self.simulation.advance(WHEN + 1)
        assert not self.simulation.refused
        v, w = self.simulation.state.linear_velocity, self.simulation.state.angular_velocity_body
        body = self.simulation.setup.body
        energy = 0.5 * body.mass * (v @ v) + 0.5 * w @ body.inertia @ w
        assert self.simulation.kinetic_energy == pytest.approx(energy, rel=1e-14)
        # The segment begins with the state that the change left.
        return *before, State(WHEN, self.simulation.flight.start.copy()), self.simulation.setup


def mesh_point(state, setup, point) -> tuple[np.ndarray, np.ndarray]:
    """Where a mesh point (mesh coordinates) is in the world, and its velocity."""
    arm = state.rotation @ (np.asarray(point) * setup.body.scale - setup.body.center_of_mass)
    return state.position + arm, state.linear_velocity + np.cross(state.angular_velocity, arm)


@pytest.mark.parametrize("changes", MESH_STAYS, ids=lambda c: next(iter(c)) + "=" + str(next(iter(c.values()))))
def test_another_tensor_or_model_leaves_the_mesh_where_it_is_and_every_material_point_at_its_speed(changes):
    """Pose of the mesh origin and velocities of three of its points: continuous to 1e-12; attitude and ω to the bit."""
    before, old, after, new = Flight().around(changes)
    assert (before.orientation_xyzw == after.orientation_xyzw).all()
    assert (before.angular_velocity_body == after.angular_velocity_body).all()
    for point in ((0.0, 0.0, 0.0), (0.07, 0.0, 0.0), (0.0, -0.05, 0.03), (1.0, 2.0, -3.0)):
        place, speed = mesh_point(before, old, point)
        place_after, speed_after = mesh_point(after, new, point)
        assert place_after == pytest.approx(place, rel=1e-12, abs=1e-12)
        assert speed_after == pytest.approx(speed, rel=1e-12, abs=1e-12)
    # It's a test only if the body did change.
    assert new.body.mass != old.body.mass or (new.body.inertia != old.body.inertia).any()


@pytest.mark.parametrize(
    "changes",
    [{"scale": [0.5, 1.0, -3.0]}, {"mesh": "hammer"}, {"scale": [3.0], "mass": 4.0}],
    ids=str,
)
def test_another_size_or_mesh_grows_in_place_pose_and_twist_of_the_centre_of_mass_stay_to_the_bit(changes):
    before, old, after, new = Flight().around(changes)
    assert before.row.tobytes() == after.row.tobytes()
    assert (new.body.inertia != old.body.inertia).any()


@pytest.mark.parametrize(
    "scene",
    [
        {"scale": [-1.1, 1.3, 1.7], "ballast.nut": [0.013, 0.01, 0.05, 0.02]},
        {"mesh": "hammer", "scale": [1.37, 1.61, 1.83], "mass": 0.7},
    ],
    ids=str,
)
def test_sending_back_the_inertia_that_was_received_changes_nothing(scene):
    """Pose, twist, mass, centre of mass and tensor, all to the bit; the model is explicit and ballast is counted in."""
    flight = Flight(**scene)
    flight.simulation.advance(WHEN)
    before, old = flight.simulation.state, flight.simulation.setup.body
    I = old.inertia
    content = {
        "relative": False,
        "mass": old.mass,
        "com": old.center_of_mass.tolist(),
        "tensor": [I[0, 0], I[0, 1], I[0, 2], I[1, 1], I[1, 2], I[2, 2]],
    }

    def apply():
        flight.scenario = with_inertia(flight.scenario, content)
        return flight.scenario.setup

    flight.simulation.submit(Change(content, apply, "inertia"))
    flight.simulation.advance(WHEN + 1)
    assert not flight.simulation.refused
    new = flight.simulation.setup.body
    assert flight.simulation.flight.start.tobytes() == before.row.tobytes()
    assert new.mass == old.mass
    assert new.center_of_mass.tobytes() == old.center_of_mass.tobytes()
    assert new.inertia.tobytes() == old.inertia.tobytes()
    values = flight.scenario.parameters.named()
    assert values["inertia_model"] == "explicit"
    assert all(v[0] == 0.0 for n, v in values.items() if n.startswith("ballast."))


def test_an_inertia_in_the_body_frame_counts_from_the_present_centre_of_mass():
    scenario = make_scenario({**SCENE, "scale": [2.0, 2.0, 2.0]})
    content = {"mass": 2.0, "com": [0.01, 0.0, -0.02], "tensor": [1.0, 0, 0, 1.5, 0, 2.0], "relative": True}
    new = with_inertia(scenario, content).setup.body
    assert new.center_of_mass == pytest.approx(scenario.setup.body.center_of_mass + [0.01, 0.0, -0.02], abs=1e-15)
    assert new.mass == 2.0


@pytest.mark.parametrize(
    ("mass", "com", "tensor", "reason"),
    [
        (0.0, (0, 0, 0), (1, 0, 0, 1, 0, 1), "tensor"),
        (1.0, (0, 0, 0), (1, 0, 0, 1, 0, 3), "tensor"),
        (1.0, (0, 0, 0), (1, 0, 0, 1, 0, 1e-13), "tensor"),
        (1.0, (0, 0, 1e200), (1, 0, 0, 1, 0, 1), "tensor"),
        (math.nan, (0, 0, 0), (1, 0, 0, 1, 0, 1), "nonfinite"),
        (1.0, (0, 0, 0), (1, math.nan, 0, 1, 0, 1), "nonfinite"),
    ],
)
def test_an_impossible_inertia_is_refused_with_its_reason(mass, com, tensor, reason):
    with pytest.raises(CommandRefused) as refused:
        with_inertia(make_scenario(SCENE), {"relative": False, "mass": mass, "com": com, "tensor": tensor})
    assert refused.value.reason == reason


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"orientation_xyzw": (math.nan, 0.0, 0.0, 1.0)}, "accepted: 4 finite numbers"),
        ({"orientation_xyzw": (0.0, 0.0, 0.0, 0.0)}, "four numbers, not all zero"),
        ({"angular_velocity": (0.0, 0.0, 1e101)}, "accepted: numbers of at most 1e.100$"),
        ({"position": (0.0, 0.0)}, "position of 3 numbers"),
    ],
)
def test_an_impossible_state_is_refused_with_what_is_accepted(values, words):
    with pytest.raises(CommandRefused, match=words):
        SetState(values)


def test_density_set_wins_over_mass_and_mass_over_density():
    scenario = make_scenario(SCENE)
    heavy = scenario.with_changes({"mass": 3.0})
    assert heavy.setup.body.mass == 3.0
    assert heavy.with_changes({"scale": [2.0]}).setup.body.mass == 3.0
    light = heavy.with_changes({"density": 785.0})
    assert light.parameters.mass == 0.0
    assert light.setup.body.mass == pytest.approx(scenario.setup.body.mass / 10, rel=1e-14)
    assert light.with_changes({"scale": [2.0]}).setup.body.mass == pytest.approx(8 * light.setup.body.mass, rel=1e-14)


def test_changes_given_together_are_judged_together():
    """Each alone would be refused; the two at once are fine, and so is the way back only together."""
    scenario = make_scenario(SCENE)
    explicit = {"inertia_model": "explicit", "mesh": ""}
    bare = scenario.with_changes(explicit)
    with pytest.raises(InputError):
        scenario.with_changes({"mesh": ""})
    with pytest.raises(InputError):
        bare.with_changes({"inertia_model": "solid"})
    assert bare.with_changes({"inertia_model": "solid", "mesh": "hammer"}).parameters.mesh == "hammer"
