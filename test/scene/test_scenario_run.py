# SPDX-License-Identifier: MIT
"""Parameters of a simulation without ROS change as the node's do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flights import SECOND, Heard
from mass_solids import box, inward

from rigid_proto_ros.base.bundled import BODIES
from rigid_proto_ros.base.errors import MeshError
from rigid_proto_ros.mesh.reading import load_mesh
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.simulation.observer import Refused, SceneChanged

SCRIPT = """
- {t: 0.0, at: com, torque: [0.1, 0.0, 0.0], duration: 1.0}
- {t: 0.5, set: {integrator: free_body}}
- {t: 2.0, set: {gravity: [0.0, 0.0, -1.0]}}
"""


def test_a_change_refused_when_it_acts_leaves_the_scene_as_it_is_for_those_after_it() -> None:
    scenes = Heard(SceneChanged, Refused)
    run = OfflineRun(make_scenario({"ghost.inertia_model": "bounding_box"}), parse_script(SCRIPT), scenes)
    assert run.advance(3 * SECOND)
    assert [event.reason for event in scenes.of(Refused)] == ["integrator"]
    assert run.scenario.parameters.integrator == run.simulation.setup.integrator.name == "auto"
    assert run.simulation.state.linear_velocity[2] == -1.0
    (changed,) = scenes.of(SceneChanged)
    assert "free_body" not in changed.scene
    assert run.ghost is not None and run.ghost.simulation.setup.integrator.name == "auto"


def test_steps_and_evaluations_are_counted_by_the_integrator_that_made_them() -> None:
    """On a string: a series of auto is one evaluation, a step of rk4 four, one of dop853 twelve."""
    string = {"string.attached": True, "string.attach": [0.0, 0.0, 0.07], "string.target": [0.1, 0.0, 0.0]}
    script = (
        "[{t: 0.1, set: {integrator: rk4}}, {t: 0.2, set: {integrator: auto}}, {t: 0.3, set: {integrator: dop853}}]"
    )
    run = OfflineRun(make_scenario(string), parse_script(script))
    counted = []
    for tenths in range(1, 5):
        run.advance(tenths * SECOND // 10)
        counted.append((run.simulation.steps, run.simulation.force_evaluations))
    # A segment of auto ends with a shorter step of the series that it has, and its last one counts when it is made.
    steps, evaluations = np.diff(counted, axis=0).T.tolist()
    assert [steps[0] - 100, steps[2] - 100] == [1, 1] and 0 < steps[1] < 50
    assert [evaluations[0] - 400, evaluations[2] - 1200] == [0, 0] and 0 < evaluations[1] < 50


def test_a_step_is_rounded_to_the_nearest_nanosecond() -> None:
    for step_s, step_ns in ((1e-3 + 4e-10, 1_000_000), (1e-3 + 6e-10, 1_000_001), (2e-9, 2), (1.4e-9, 1)):
        assert make_scenario({"step": step_s}).setup.flight.step_ns == step_ns


def test_contacts_move_with_a_mesh_that_is_scaled_in_flight() -> None:
    values = {"mesh": "hammer", "mass": 1.0, "contacts.grip": [0.0, 0.0, 0.0]}
    push = "at: grip, force: [1.0, 0.0, 0.0], duration: 1.0e-6"
    flown = []
    for scale in (1.0, 2.0):
        script = f"- {{t: 0.0, set: {{scale: [{scale}]}}}}\n- {{t: 0.5, {push}}}"
        run = OfflineRun(make_scenario(values), parse_script(script))
        assert run.advance(SECOND)
        flown.append(run.simulation.state.angular_velocity)
    # The same force on twice the arm turns four times the inertia: half the spin.
    np.testing.assert_allclose(flown[1], 0.5 * flown[0], rtol=1e-9, atol=1e-9 * np.abs(flown[0]).max())


def test_displacements_are_measured_by_half_the_diagonal_as_scaled_and_by_1_m_without_a_mesh(tmp_path: Path) -> None:
    diagonal = np.linalg.norm(np.ptp(load_mesh("hammer").vertices, axis=0) * 2.0)
    # A vertex that no triangle uses is no part of the body.
    stray = tmp_path / "stray.obj"
    stray.write_text((BODIES / "hammer.obj").read_text() + "v 100 0 0\n")
    for mesh in ("hammer", str(stray)):
        assert make_scenario({"mesh": mesh, "scale": 2.0}).setup.length == pytest.approx(0.5 * diagonal, rel=1e-14)
    explicit = {"mesh": "", "inertia_model": "explicit"}
    assert make_scenario(explicit).setup.length == 1.0


def test_a_scene_takes_an_open_mesh_repaired_or_its_hull_or_box(tmp_path: Path) -> None:
    box = tmp_path / "open.obj"
    lines = [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 2) for z in (0, 3)]
    quads = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5"]
    box.write_text("\n".join([*lines, *(f"f {quad}" for quad in quads)]))
    with pytest.raises(MeshError, match="open"):
        make_scenario({"mesh": str(box)})
    for choice in ({"mesh_repair": True}, {"mesh_fallback": "hull"}, {"mesh_fallback": "box"}):
        body = make_scenario({"mesh": str(box), **choice}).setup.body
        assert body.mass == pytest.approx(6000.0, rel=1e-12), choice


def test_a_push_goes_into_a_body_whose_mesh_is_wound_inward(tmp_path: Path) -> None:
    path = tmp_path / "inward.obj"
    vertices, triangles = inward(box())
    lines = [f"v {x} {y} {z}" for x, y, z in vertices.tolist()]
    path.write_text("\n".join([*lines, *(f"f {i} {j} {k}" for i, j, k in (triangles + 1).tolist())]))
    script = parse_script("- {t: 0.0, at: {point: [0.0, 0.0, 0.5]}, push: 1.0, duration: 1.0}")
    run = OfflineRun(make_scenario({"mesh": str(path), "mass": 1.0}), script)
    assert run.advance(SECOND)
    np.testing.assert_allclose(run.simulation.state.linear_velocity, [0.0, 0.0, -1.0], atol=1e-12)
