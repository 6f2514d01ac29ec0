# SPDX-License-Identifier: MIT
"""How a model differs from the true solid in what counts for the motion: moments, axes, centre of mass."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mass_solids import box

from rigid_proto_ros.base.errors import MeshError
from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass.inspection import model_difference
from rigid_proto_ros.mass.moments import MODELS
from rigid_proto_ros.mass.properties import MassProperties, MeshMoments
from rigid_proto_ros.scene.scenario import read_scene


def turned(moments, rotation_vector, com=(0.0, 0.0, 0.0)) -> MassProperties:
    """A body with its principal axes turned by a rotation vector [rad]."""
    angle = float(np.linalg.norm(rotation_vector))
    axis = np.asarray(rotation_vector) / angle if angle else np.array([1.0, 0.0, 0.0])
    R = matrix_from_quaternion((*(np.sin(0.5 * angle) * axis), np.cos(0.5 * angle)))
    return MassProperties(1.0, np.array(com), R @ np.diag(moments) @ R.T)


@settings(deadline=None)
@given(st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_axes_are_turned_by_the_angle_between_the_two_bodies(small, any_turn) -> None:
    true = turned((1.0, 2.0, 2.5), any_turn)
    R = turned((1.0, 2.0, 3.0), any_turn)
    assert model_difference(R, true).axes_turned < 1e-7
    # Whatever the first turn, a further one by less than 45° about any axis is what is found.
    angle = float(np.linalg.norm(small))
    if angle < 0.75:
        found = model_difference(turned((1.0, 2.0, 2.5), small), turned((1.0, 2.0, 2.5), (0.0, 0.0, 0.0)))
        assert found.axes_turned == pytest.approx(angle, abs=1e-7)
        assert np.abs(found.principal_moments).max() < 1e-12


@pytest.mark.parametrize(
    "moments, others, turn, angle",
    [
        ((1, 1, 2), (1, 1, 2), (0.0, 0.0, 0.7), 0.0),  # about its axis of symmetry: nothing
        ((1, 1, 2), (1, 1, 2), (0.3, 0.0, 0.9), None),  # the axis of symmetry alone counts
        ((1, 1, 1), (1, 2, 2.5), (0.3, 0.2, 0.9), 0.0),  # a sphere has no axes
        ((1, 1.5, 1.5), (1, 1, 1.5), (0.0, 0.0, 1.0), 0.0),  # x lies in the other's plane whatever the turn about z
        ((1, 1.5, 1.5), (1, 1, 1.5), (0.0, 0.4, 0.0), 0.4),  # and is tilted out of it about y
    ],
)
def test_axes_that_are_arbitrary_are_no_difference(moments, others, turn, angle) -> None:
    own, true = turned(moments, turn), turned(others, (0.0, 0.0, 0.0))
    if angle is None:
        z = own.inertia @ np.array([0.0, 0.0, 1.0]) - np.array([0.0, 0.0, 1.0])  # (I - 1) z along the axis: 2 - 1 = 1
        angle = float(np.arctan2(np.linalg.norm(z[:2]), z[2]))
    assert model_difference(own, true).axes_turned == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("scale", [[0.5, -2.0, 3.0]])
@pytest.mark.parametrize("weights", [{"ballast.a": [0.3, 0.1, 0.02, -0.05]}])
def test_a_model_at_the_solids_com_has_its_own_tensor_there(model: str, scale, weights) -> None:
    def body(**values):
        return read_scene("hammer", {"scale": scale, "inertia_model": model, **values}).setup.body

    apart, there = body(), body(inertia_model_com="solid")
    solid = read_scene("hammer", {"scale": scale}).setup.body
    assert there.mass == apart.mass
    size = np.linalg.norm(scale)
    assert np.abs(there.center_of_mass - solid.center_of_mass).max() < 1e-15 * size
    assert np.abs(there.inertia - apart.inertia).max() == 0.0
    loaded, truly = (
        body(inertia_model_com="solid", **weights),
        read_scene("hammer", {"scale": scale, **weights}).setup.body,
    )
    # A weight moves the COM of both alike, since both began at one place with one mass.
    assert np.abs(loaded.center_of_mass - truly.center_of_mass).max() < 1e-15 * size


def test_explicit_numbers_keep_their_com_and_without_a_solid_there_is_no_com_of_it() -> None:
    given_com = [0.01, 0.02, 0.03]
    values = {"inertia_model": "explicit", "explicit_inertia.center_of_mass": given_com, "inertia_model_com": "solid"}
    assert read_scene("hammer", values).setup.body.center_of_mass.tolist() == given_com
    vertices, triangles = box()
    opened = MeshMoments(vertices, triangles[1:], no_solid="open")
    with pytest.raises(MeshError, match="open"):
        opened.mass_properties("bounding_box", mass=1.0, com="solid")


def test_inspect_says_of_every_model_what_counts(capsys: pytest.CaptureFixture) -> None:
    assert main(["inspect", "hammer", "--density", "7850"]) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.strip().startswith("bounding_box")]
    assert "+90.9, -4.99, +3.13 %" in row and row.split()[-2:] == ["1.34", "0.0808"]
