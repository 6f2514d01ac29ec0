# SPDX-License-Identifier: MIT
"""What a recording shows beside the picture: the ghost's angle per run, the state line, effort, events in words."""

from __future__ import annotations

import numpy as np
import pytest
import rerun_flight as flight
from rerun_flight import cells

from rigid_proto_ros.picture import style
from rigid_proto_ros.rerun_view import entities as e
from rigid_proto_ros.rerun_view.observer import RerunObserver
from rigid_proto_ros.rerun_view.reader import read_session
from rigid_proto_ros.rerun_view.writer import readable
from rigid_proto_ros.simulation.observer import (
    BodyChanged,
    BodySnapshot,
    Effort,
    GhostChanged,
    GhostPublished,
    LoadBegan,
    LoadEnded,
    Published,
    Reset,
    SceneChanged,
    Started,
    StatusChanged,
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


def test_the_state_line_shows_what_acts_and_who_integrates(tmp_path):
    path = tmp_path / "lanes.rrd"
    observer = RerunObserver(record=str(path))
    flight.fly(observer, flight.rows(60))
    observer.on(StatusChanged(590_000_000, "motion", "paused"))
    # A held wrench replaced at the same instant was never off.
    observer.on(LoadEnded(590_000_000, 2))
    observer.on(LoadBegan(590_000_000, 3, flight.WRENCH))
    observer.close()
    times, values = cells(path, f"{e.STATUS}/loads", "StateChange:state")
    assert list(zip(times, np.ravel(values).tolist(), strict=True)) == [
        (0, "none"),
        (200_000_000, "poke"),
        (305_000_000, "wrench + poke"),
        (400_000_000, "wrench"),
    ]
    assert np.ravel(cells(path, f"{e.STATUS}/integrator", "StateChange:state")[1]).tolist() == ["rk4"]
    assert cells(path, f"{e.STATUS}/motion", "StateChange:state")[0] == [590_000_000]


def test_the_state_line_of_a_run_after_a_reset_begins_with_what_holds(tmp_path):
    path = tmp_path / "again.rrd"
    observer = RerunObserver(record=str(path))
    flight.fly(observer, flight.rows(30))  # which ends while a poke acts
    observer.on(Reset())
    observer.on(Published(0, flight.rows(1)[0]))
    observer.close()
    for track, value in (("loads", "none"), ("integrator", "rk4"), ("inertia_model", "solid")):
        assert cells(path, f"{e.STATUS}/{track}", "StateChange:state") == ([0], [[value]])


def test_effort_is_plotted_as_a_rate_since_it_was_told_before(tmp_path):
    path = tmp_path / "effort.rrd"
    observer = RerunObserver(record=str(path))
    flight.fly(observer, flight.rows(10))
    for time_ns, steps in ((0, 0), (50_000_000, 50), (100_000_000, 50), (100_000_000, 51)):
        observer.on(Effort(time_ns, steps, 4 * steps))
    observer.on(Reset())
    observer.on(Effort(0, 0, 0))
    observer.on(Effort(50_000_000, 5, 20))
    observer.close()
    assert cells(tmp_path / "effort.run1.rrd", style.EFFORT, "Scalars:scalars") == (
        [50_000_000, 100_000_000],
        [[1000.0, 4000.0], [0.0, 0.0]],
    )
    assert cells(path, style.EFFORT, "Scalars:scalars") == ([50_000_000], [[100.0, 400.0]])


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
    before = tmp_path / "scene.run1.rrd"
    assert read_session(before).scene == flight.SCENE
    assert cells(before, e.SCENE_IN_FORCE, "TextDocument:text") == ([190_000_000], [[changed]])
    assert read_session(path).scene == changed


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            '{"time_ns": 5, "kind": "poke", "content": {"stamp_ns": 5, "frame_id": "world@rim", "force": '
            '[0.0, 0.0, 3.0], "torque": [0.0, 0.0, 0.0]}, "sha256": "ab"}',
            "poke world@rim, force [0, 0, 3]",
        ),
        ('{"time_ns": 5, "kind": "reset", "content": {}, "sha256": "ab"}', "reset"),
        ('{"time_ns": 5, "kind": "set", "content": {"mass": 2.5}, "sha256": "ab"}', "set mass 2.5"),
        ("not json", "not json"),
        ("[1, 2]", "[1, 2]"),
    ],
)
def test_events_are_put_in_words(line, said):
    assert readable(line) == said
