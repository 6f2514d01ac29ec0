# SPDX-License-Identifier: MIT
"""What a recording shows of several runs: the ghost's angle in each, and the parameters that each begins with."""

from __future__ import annotations

import numpy as np
import rerun_flight as flight
from rerun_flight import cells

from rigid_proto_ros.picture import style
from rigid_proto_ros.rerun_view.observer import RerunObserver
from rigid_proto_ros.rerun_view.reader import read_session
from rigid_proto_ros.simulation.observer import (
    BodyChanged,
    BodySnapshot,
    GhostChanged,
    GhostPublished,
    Published,
    Reset,
    SceneChanged,
    Started,
)
from rigid_proto_ros.simulation.quantities import attitude_angle


def test_the_ghost_is_compared_with_the_body_at_equal_times_and_per_run(tmp_path):
    path = tmp_path / "ghost.rrd"
    body, ghost = flight.rows(60, seed=1), flight.rows(60, seed=2)
    observer = RerunObserver(record=str(path))
    observer.on(Started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256))
    observer.on(BodyChanged(0, flight.BODY))
    observer.on(
        GhostChanged(0, BodySnapshot(12.0, flight.COM, np.eye(3), flight.SCALE, flight.GRAVITY, "explicit", "rk4"))
    )
    for run in range(2):
        for k in range(30):
            observer.on(Published(k * flight.PERIOD_NS, body[30 * run + k]))
            observer.on(GhostPublished(k * flight.PERIOD_NS, ghost[30 * run + k]))
        if run == 0:
            observer.on(Reset())
    observer.close()
    assert observer.error == ""
    for run, file in enumerate([tmp_path / "ghost.run1.rrd", path]):
        times, angles = cells(file, style.GHOST_ANGLE, "Scalars:scalars")
        part = slice(30 * run, 30 * run + 30)
        assert times == [k * flight.PERIOD_NS for k in range(30)]
        apart = [attitude_angle(*pair) for pair in zip(body[part, 3:7], ghost[part, 3:7], strict=True)]
        assert np.allclose(np.radians(np.ravel(angles)), apart, rtol=1e-14)
        _, places = cells(file, style.GHOST, "Transform3D:translation")
        assert np.array_equal(np.array(places)[:, 0], ghost[part, 0:3].astype(np.float32))


def test_the_next_run_starts_from_the_parameters_then_in_force(tmp_path):
    path = tmp_path / "scene.rrd"
    rows = flight.rows(20)
    observer = RerunObserver(record=str(path))
    flight.fly(observer, rows)
    changed = flight.SCENE + "    mass: 2.0\n"
    observer.on(SceneChanged(190_000_000, changed))
    observer.on(Reset())
    observer.on(Published(0, rows[0]))
    observer.close()
    assert read_session(tmp_path / "scene.run1.rrd").scene == flight.SCENE
    assert read_session(path).scene == changed
