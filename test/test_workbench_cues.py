# SPDX-License-Identifier: MIT
"""What the page's picture says of the motion: paths, arrows whose length is a value, ground, labels. No browser is needed."""

from __future__ import annotations

import numpy as np
import pytest
from scene_stand_in import SceneStandIn

pytest.importorskip("viser", reason="viser is not installed: no interactive page")

from rigid_proto_ros.core.simulation import Simulation  # noqa: E402
from rigid_proto_ros.offline import read_scene  # noqa: E402
from rigid_proto_ros.workbench.trails import COM_TRAIL, POINT_TRAIL, Trails, farthest_point  # noqa: E402


def flown_trails(scene: str, seconds: float, scene_stand_in: SceneStandIn | None = None):
    """Trails of a flight at 100 states a second, its setup and its states."""
    setup = read_scene(scene, {}).setup
    simulation, trails = Simulation(setup), Trails(scene_stand_in or SceneStandIn())
    rows = []
    for time_ns in range(0, round(seconds * 1e9) + 1, 10_000_000):
        row = simulation.advance(time_ns).row.copy()
        rows.append(row)
        trails.add(time_ns, row)
    return trails, setup, np.array(rows)


def test_the_com_of_a_thrown_hammer_draws_a_parabola_and_its_far_end_does_not() -> None:
    trails, setup, rows = flown_trails("thrown_hammer", 1.0)
    for name in (COM_TRAIL, POINT_TRAIL):
        trails.switch(name, True)
    paths = trails.paths(10**9, setup.body, setup.surface)
    com, point = paths[COM_TRAIL], paths[POINT_TRAIL]
    assert np.allclose(com, rows[:, 0:3], rtol=0, atol=1e-15)
    second = np.diff(com, 2, axis=0)
    assert np.allclose(second, np.array(setup.gravity) * 1e-4, rtol=0, atol=1e-9)  # measured 3e-16
    # A point fixed to the body keeps its distance from the COM.
    arm = farthest_point(setup.surface, setup.body) * setup.body.scale - setup.body.center_of_mass
    assert np.allclose(np.linalg.norm(point - com, axis=1), np.linalg.norm(arm), rtol=1e-12)
    assert np.ptp(np.diff(point, 2, axis=0), axis=0).max() > 1e-3  # measured 4e-3; 0 on a parabola


def test_paths_are_drawn_where_they_are_in_a_picture_that_moves_on_and_end_at_the_moment_shown() -> None:
    scene = SceneStandIn()
    trails, setup, rows = flown_trails("thrown_hammer", 0.5, scene)
    trails.switch(COM_TRAIL, True)
    line, frame = scene.nodes["/trails/0"], scene.nodes["/trails"]
    origin, unit = np.array([0.3, -0.2, 0.1]), 0.5
    trails.draw(0.0, 300_000_000, setup.body, setup.surface, origin, unit)
    ends = (line.points[-1, 1] + frame.position) * unit + origin
    assert line.visible and np.allclose(ends, rows[30, 0:3], atol=1e-12)
    # Soon after, only the frame is moved.
    sent = line.points
    trails.draw(0.01, 300_000_000, setup.body, setup.surface, origin + 1.0, unit)
    assert line.points is sent
    assert np.allclose((line.points[0, 0] + frame.position) * unit + origin + 1.0, rows[0, 0:3], atol=1e-12)
    trails.forget()
    trails.draw(1.0, 300_000_000, setup.body, setup.surface, origin, unit)
    assert not line.visible


def test_time_that_went_back_begins_the_paths_anew() -> None:
    trails, setup, _ = flown_trails("thrown_hammer", 0.5)
    trails.switch(COM_TRAIL, True)
    trails.add(0, np.zeros(13))
    assert trails.paths(10**9, setup.body, setup.surface) == {}
