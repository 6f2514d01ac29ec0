# SPDX-License-Identifier: MIT
"""A flight as USD: read back by USD itself it is where the simulation is, and the body has the mass properties it has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_gltf import CHANGES, THROWN, TIMES, flown

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.script import read_script

pxr = pytest.importorskip("pxr")
from pxr import Usd, UsdGeom, UsdPhysics, UsdValidation


def broken_rules(stage) -> list[str]:
    """What usdchecker finds: every validator that comes with USD."""
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    return [f"{error.GetName()}: {error.GetMessage()}" for error in context.Validate(stage)]


def test_the_rules_are_all_of_usdcheckers_and_find_what_breaks_them():
    stage = Usd.Stage.CreateInMemory()
    UsdPhysics.RigidBodyAPI.Apply(UsdGeom.Scope.Define(stage, "/a").GetPrim())
    found = {rule.partition(":")[0] for rule in broken_rules(stage)}
    assert found == {
        "RigidBodyNonXformable",
        "MissingMetersPerUnitMetadata",
        "MissingUpAxisMetadata",
        "MissingDefaultPrim",
    }


def tensor_apart(stage, body) -> float:
    """The largest difference of mass and tensor from the body's, over their size."""
    mass = UsdPhysics.MassAPI(stage.GetPrimAtPath("/flight/body"))
    attributes = mass.GetMassAttr(), mass.GetPrincipalAxesAttr(), mass.GetDiagonalInertiaAttr()
    kilograms, q, moments = (own.Get() for own in attributes)
    axes = matrix_from_quaternion([*q.GetImaginary(), q.GetReal()])
    apart = np.abs(axes @ np.diag(moments) @ axes.T - body.inertia).max() / np.abs(body.inertia).max()
    return max(float(apart), abs(kilograms / body.mass - 1.0))


@pytest.fixture(scope="module")
def script(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("script") / "changes.yaml"
    path.write_text(CHANGES)
    return path


@pytest.mark.parametrize("ending", ["usda", "usdc"])
def test_mesh_and_mass_are_those_of_the_flight_and_no_rule_is_broken(ending, script, tmp_path, capsys):
    file = tmp_path / f"flight.{ending}"
    settings = [f"--set={name}={value}" for name, value in THROWN.items()]
    options = ["--script", str(script), "--duration", "1", "--usd", str(file)]
    assert main(["simulate", "hammer", *settings, *options]) == 0
    assert "mass or tensor change: the body's are those of the start" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == [file.name]
    stage = Usd.Stage.Open(str(file))
    assert not broken_rules(stage)
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetEndTimeCode() / stage.GetTimeCodesPerSecond() == pytest.approx(1.0)
    worst = 0.0
    for t, (row, body, surface) in zip(TIMES, flown("hammer", THROWN, read_script(str(script)), TIMES), strict=True):
        code = t * stage.GetTimeCodesPerSecond()
        shown = UsdGeom.Mesh(stage.GetPrimAtPath("/flight/body/mesh"))
        low, high = np.array(shown.GetExtentAttr().Get(), dtype=float)
        world = np.array(shown.ComputeLocalToWorldTransform(code))
        seen = np.array([[*low, 1.0], [*high, 1.0]]) @ world
        corners = np.array([surface.vertices.min(axis=0), surface.vertices.max(axis=0)]) * body.scale
        true = (corners - body.center_of_mass) @ matrix_from_quaternion(row[3:7]).T + row[:3]
        size = np.linalg.norm(np.ptp(corners, axis=0))
        worst = max(worst, float(np.linalg.norm(seen[:, :3] - true, axis=1).max() / size))
    assert worst < 2e-5  # measured 8e-7


def test_a_physics_engine_that_begins_with_the_stages_numbers_flies_as_the_samples_do(tmp_path):
    file = tmp_path / "flight.usda"
    assert main(["simulate", "thrown_hammer", "--duration", "0.5", "--usd", str(file), "--fps", "50"]) == 0
    run = OfflineRun(read_scene("thrown_hammer"))
    body, state = run.simulation.setup.body, run.simulation.state
    stage = Usd.Stage.Open(str(file))
    prim = stage.GetPrimAtPath("/flight/body")
    # The prim's origin is the centre of mass, and the mesh hangs below it.
    assert tuple(UsdPhysics.MassAPI(prim).GetCenterOfMassAttr().Get()) == (0.0, 0.0, 0.0)
    assert tensor_apart(stage, body) < 1e-6  # single precision: measured 1e-7
    rigid = UsdPhysics.RigidBodyAPI(prim)
    velocity = np.array(rigid.GetVelocityAttr().Get(), dtype=float)
    assert np.allclose(velocity, state.linear_velocity, rtol=1e-6)
    assert np.allclose(np.radians(rigid.GetAngularVelocityAttr().Get()), state.angular_velocity, rtol=1e-6)
    scene = UsdPhysics.Scene(stage.GetPrimAtPath("/flight/physics_scene"))
    gravity = np.array(scene.GetGravityDirectionAttr().Get()) * scene.GetGravityMagnitudeAttr().Get()
    assert np.allclose(gravity, run.simulation.setup.gravity, rtol=1e-6)
    place = UsdGeom.Xformable(prim).GetOrderedXformOps()[0]
    fallen = np.array(place.Get(0.0)) + 0.5 * velocity + 0.125 * gravity
    assert np.abs(np.array(place.Get(25.0)) - fallen).max() < 1e-5
    assert place.GetNumTimeSamples() == 26
