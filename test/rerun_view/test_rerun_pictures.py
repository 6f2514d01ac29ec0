# SPDX-License-Identifier: MIT
"""What is drawn beside the mesh is true: inertia shapes, Poinsot's construction, normals, ghost, drift, state line."""

from __future__ import annotations

import numpy as np
import pytest
import rerun_flight as flight
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.rerun_view import RerunObserver
from rigid_proto_ros.rerun_view import entities as e
from rigid_proto_ros.rerun_view.arrows import ArrowScale, arrow_length
from rigid_proto_ros.rerun_view.inertia_shapes import PrincipalFrame, bounding_box
from rigid_proto_ros.rerun_view.motion_picture import Trail
from rigid_proto_ros.rerun_view.poinsot import inverse, plane_rotation, polhode, semi_axes, separatrix
from rigid_proto_ros.rerun_view.reader import read_session, record_batches
from rigid_proto_ros.rerun_view.run_log import readable
from rigid_proto_ros.rerun_view.surface_normals import shaded_surface
from rigid_proto_ros.simulation.observer import BodySnapshot, ShownString
from rigid_proto_ros.simulation.quantities import attitude_angle

MOMENTS = st.tuples(*[st.floats(0.1, 10.0)] * 3).map(
    lambda s: np.sort(np.array([s[1] + s[2], s[0] + s[2], s[0] + s[1]])),
)
"""Principal moments of bodies that exist: sums of two of three positive second moments."""

SPINS = st.tuples(*[st.floats(-5.0, 5.0)] * 3).map(np.array).filter(lambda w: np.linalg.norm(w) > 1e-3)


@settings(deadline=None)
@given(MOMENTS, SPINS)
def test_the_polhode_has_the_bodys_energy_and_momentum_and_passes_through_its_spin(moments, w):
    energy, squared_L = 0.5 * moments @ (w * w), (moments * w) @ (moments * w)
    curve = polhode(moments, energy, w)
    assert np.allclose(curve**2 @ moments, 2.0 * energy, rtol=1e-9)
    assert np.allclose((curve * moments) ** 2 @ np.ones(3), squared_L, rtol=1e-9)
    spacing = np.linalg.norm(np.diff(curve, axis=0), axis=1).max()
    assert np.linalg.norm(curve - w, axis=1).min() <= spacing + 1e-7 * np.linalg.norm(w)


@settings(deadline=None)
@given(MOMENTS, st.floats(0.01, 100.0))
def test_the_separatrix_is_where_momentum_is_that_of_the_middle_axis(moments, energy):
    for curve in separatrix(moments, energy):
        assert np.allclose(curve**2 @ moments, 2.0 * energy, rtol=1e-9)
        assert np.allclose((curve * moments) ** 2 @ np.ones(3), 2.0 * energy * moments[1], rtol=1e-7)
        assert np.isclose(abs(curve[:, 1]).max(), semi_axes(moments, energy)[1])


def test_a_symmetric_top_has_no_separatrix():
    assert separatrix(np.array([1.0, 1.0, 1.5]), 1.0) == []
    assert separatrix(np.array([1.0, 1.5, 1.5]), 1.0) == []


@settings(deadline=None)
@given(SPINS)
def test_the_floor_is_square_to_the_angular_momentum(L):
    (R,) = matrix_from_quaternion(plane_rotation(L)[np.newaxis])
    assert np.allclose(R @ [0.0, 0.0, 1.0], L / np.linalg.norm(L), atol=1e-6)
    (back,) = matrix_from_quaternion(inverse(plane_rotation(L))[np.newaxis])
    assert np.allclose(back @ R, np.eye(3), atol=1e-12)


@settings(deadline=None)
@given(MOMENTS, st.floats(0.01, 100.0))
def test_box_and_ellipsoid_have_the_mass_and_the_tensor_they_stand_for(moments, mass):
    frame = PrincipalFrame.of(np.diag(moments))
    a = frame.box_sides(mass)
    box = mass / 12.0 * np.array([a[1] ** 2 + a[2] ** 2, a[0] ** 2 + a[2] ** 2, a[0] ** 2 + a[1] ** 2])
    b = frame.ellipsoid_semi_axes(mass)
    ellipsoid = mass / 5.0 * np.array([b[1] ** 2 + b[2] ** 2, b[0] ** 2 + b[2] ** 2, b[0] ** 2 + b[1] ** 2])
    assert np.allclose(box, frame.moments, rtol=1e-12)
    assert np.allclose(ellipsoid, frame.moments, rtol=1e-12)
    assert np.linalg.det(frame.axes) > 0.0


def test_the_bounding_box_follows_scale_mirroring_included():
    centre, half = bounding_box(flight.VERTICES, np.array([-2.0, 1.0, 1.0]), np.array([-0.3, 0.1, 0.05]))
    assert np.allclose(centre, 0.0, atol=1e-15)
    assert np.allclose(half, [0.3, 0.1, 0.05])


def test_a_brick_is_drawn_with_flat_faces_and_a_ball_smooth():
    vertices, triangles, normals = shaded_surface(flight.VERTICES, flight.TRIANGLES)
    assert len(vertices) == 24
    for corner_normals, corners in zip(normals[triangles], vertices[triangles], strict=True):
        face = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        assert np.allclose(corner_normals, face / np.linalg.norm(face), atol=1e-6)

    # A ball of 24 by 48 facets: edges bend by 7.5 degrees, well below a crease.
    polar, around = np.meshgrid(np.linspace(0.1, np.pi - 0.1, 24), np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False))
    ball = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    index = np.arange(polar.size).reshape(polar.shape)
    a, b = index[:, :-1], np.roll(index, -1, axis=0)[:, :-1]
    c, d = np.roll(index, -1, axis=0)[:, 1:], index[:, 1:]
    faces = np.concatenate([np.stack([a, d, c], -1).reshape(-1, 3), np.stack([a, c, b], -1).reshape(-1, 3)])
    points, _, normals = shaded_surface(ball.reshape(-1, 3), faces)
    assert len(points) == polar.size
    assert np.einsum("ij,ij->i", points, normals).min() > np.cos(np.deg2rad(6.0))


@settings(deadline=None)
@given(st.floats(0.0, 1e6), st.floats(1e-3, 1e3))
def test_a_stronger_load_has_a_longer_arrow_that_still_fits_the_picture(magnitude, mass):
    scale = ArrowScale.of(mass, 2.0)
    lengths = [arrow_length(m, scale.force, scale.size) for m in (magnitude, 1.1 * magnitude + 1e-3)]
    assert 0.0 < lengths[0] <= lengths[1] < scale.size


def test_the_trail_stays_on_the_path_of_its_point_between_states():
    # A point on a wheel that rolls: a cycloid, known in closed form. States every 10 ms, spin 6 rad/s.
    times_ns = np.arange(101) * 10_000_000
    t, spin, radius = 1e-9 * times_ns, 6.0, 0.5
    rows = np.zeros((101, 13))
    rows[:, 0], rows[:, 7], rows[:, 11] = spin * radius * t, spin * radius, spin
    rows[:, 4], rows[:, 6] = np.sin(0.5 * spin * t), np.cos(0.5 * spin * t)
    points, counts = Trail().between(times_ns, rows, np.array([0.0, 0.0, radius]), spacing=0.01)
    assert counts.sum() == len(points) > 300
    angle = spin * np.concatenate(
        [t[k - 1] + (t[k] - t[k - 1]) * np.arange(1, n + 1) / n for k, n in enumerate(counts) if k]
    )
    cycloid = np.column_stack([radius * angle + radius * np.sin(angle), 0 * angle, radius * np.cos(angle)])
    # Between states a cubic: its error is (0.06 rad)^4/384 of the radius.
    assert np.abs(points[counts[0] :] - cycloid).max() < 2e-8


@settings(deadline=None)
@given(SPINS, st.floats(-14.0, 0.49))
def test_the_ghosts_angle_is_accurate_down_to_round_off(axis, log_angle):
    angle = 10.0**log_angle
    turn = np.append(np.sin(0.5 * angle) * axis / np.linalg.norm(axis), np.cos(0.5 * angle))
    start = np.array([0.5, -0.5, 0.5, 0.5])
    x, y, z, w = start
    a, b, c, d = turn
    turned = np.array(
        [
            w * a + x * d + y * c - z * b,
            w * b - x * c + y * d + z * a,
            w * c + x * b - y * a + z * d,
            w * d - x * a - y * b - z * c,
        ]
    )
    for second in (turned, -turned):
        found = attitude_angle(start, second)
        assert abs(found - angle) < 1e-15 + 1e-13 * angle


def cells(path, entity: str, name: str) -> tuple[list[int], list]:
    times, found = [], []
    for chunk_entity, static, batch in record_batches(path):
        if chunk_entity == entity and not static and name in batch.schema.names:
            times.extend(batch.column(e.SIM_TIME).to_numpy(zero_copy_only=False).astype(np.int64).tolist())
            found.extend(batch.column(name).to_pylist())
    return times, found


def test_the_ghost_is_compared_with_the_body_at_equal_times_and_per_run(tmp_path):
    path = tmp_path / "ghost.rrd"
    body, ghost = flight.rows(60, seed=1), flight.rows(60, seed=2)
    observer = RerunObserver(record=str(path))
    observer.started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256)
    observer.body_changed(0, flight.BODY)
    observer.ghost_began(0, BodySnapshot(12.0, flight.COM, np.eye(3), flight.SCALE, flight.GRAVITY, "explicit", "rk4"))
    for run in range(2):
        for k in range(30):
            observer.state(k * flight.PERIOD_NS, body[30 * run + k])
            observer.ghost_state(k * flight.PERIOD_NS, ghost[30 * run + k])
        if run == 0:
            observer.reset()
    observer.close()
    assert observer.error == ""
    for run, file in enumerate([tmp_path / "ghost.run1.rrd", path]):
        times, angles = cells(file, e.GHOST_ANGLE, "Scalars:scalars")
        part = slice(30 * run, 30 * run + 30)
        assert times == [k * flight.PERIOD_NS for k in range(30)]
        apart = [attitude_angle(*pair) for pair in zip(body[part, 3:7], ghost[part, 3:7], strict=True)]
        assert np.allclose(np.radians(np.ravel(angles)), apart, rtol=1e-14)
        _, places = cells(file, e.GHOST, "Transform3D:translation")
        assert np.array_equal(np.array(places)[:, 0], ghost[part, 0:3].astype(np.float32))


def test_drift_counts_from_the_last_command_and_is_zero_while_one_acts(tmp_path):
    path = tmp_path / "drift.rrd"
    rows = np.tile([0.0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 2], (50, 1))
    # Spin that grows by a millionth a state, in mid-air and under the poke alike.
    rows[:, 12] *= 1.0 + 1e-6 * np.arange(50)
    observer = RerunObserver(record=str(path))
    no_gravity = BodySnapshot(12.0, flight.COM, flight.INERTIA, flight.SCALE, np.zeros(3), "solid", "rk4")
    observer.started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256)
    observer.body_changed(0, no_gravity)
    for k, row in enumerate(rows):
        observer.state(k * flight.PERIOD_NS, row)
        if k == 20:
            observer.load_began(k * flight.PERIOD_NS, 1, flight.POKE)
        if k == 25:
            observer.load_ended(k * flight.PERIOD_NS + 5, 1)
    observer.close()
    _, drift = cells(path, e.DRIFT, "Scalars:scalars")
    momentum = np.array(drift)[:, 1]
    since = np.concatenate([np.arange(21), np.zeros(6), np.arange(1, 24)])
    assert np.allclose(momentum, 1e-6 * since, rtol=1e-4, atol=1e-15)
    L = 0.4 * rows[:, 12]
    assert np.isclose(momentum[20], (L[20] - L[0]) / L[0], rtol=1e-9)


def test_the_state_line_shows_what_acts_and_who_integrates(tmp_path):
    path = tmp_path / "lanes.rrd"
    observer = RerunObserver(record=str(path))
    flight.fly(observer, flight.rows(60))
    observer.status(590_000_000, "motion", "paused")
    # A held wrench replaced at the same instant was never off.
    observer.load_ended(590_000_000, 2)
    observer.load_began(590_000_000, 3, flight.WRENCH)
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


def test_an_impulse_is_shown_from_its_instant_for_a_moment(tmp_path):
    path = tmp_path / "impulse.rrd"
    observer = RerunObserver(record=str(path))
    observer.started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256)
    observer.body_changed(0, flight.BODY)
    push = type(flight.POKE)("impulse", "body", np.array([0.1, 0, 0]), np.array([0.0, 0.0, 2.0]), np.zeros(3))
    for k, row in enumerate(flight.rows(60)):
        observer.state(k * flight.PERIOD_NS, row)
        if k == 10:
            observer.load_began(100_000_000, 1, push)
    observer.close()
    times, vectors = cells(path, f"{e.LOADS}/impulse/force", "Arrows3D:vectors")
    shown = [time_ns for time_ns, vector in zip(times, vectors, strict=True) if vector]
    assert shown[0] == 100_000_000 and shown[-1] == 240_000_000
    assert (times[-1], vectors[-1]) == (250_000_000, [])


def test_the_string_runs_from_the_hand_to_its_knot_taut_or_slack_until_it_is_let_go(tmp_path):
    path = tmp_path / "string.rrd"
    rows = np.tile([0.0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0], (60, 1))
    # The body rises towards the hand at 1 m/s: 0.4 m long, the string goes slack half-way.
    rows[:, 2], rows[:, 9] = 0.01 * np.arange(60), 1.0
    knot, hand = np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 0.8])
    observer = RerunObserver(record=str(path))
    observer.started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256)
    observer.body_changed(0, flight.BODY)
    observer.string_changed(0, ShownString(knot, hand, hand, 0, 0, 50.0, 0.0, 0.4, False))
    for k, row in enumerate(rows[:50]):
        observer.state(k * flight.PERIOD_NS, row)
    observer.string_changed(495_000_000, None)
    for k, row in enumerate(rows[50:], start=50):
        observer.state(k * flight.PERIOD_NS, row)
    observer.close()
    assert observer.error == ""
    times, strips = cells(path, e.STRING, "LineStrips3D:strips")
    assert times == [*(k * flight.PERIOD_NS for k in range(50)), 495_000_000] and strips[-1] == []
    _, tensions = cells(path, e.STRING_TENSION, "Scalars:scalars")
    stretch = 0.8 - 0.1 - rows[:50, 2] - 0.4
    assert np.allclose(np.ravel(tensions)[:50], np.maximum(50.0 * stretch, 0.0), atol=1e-12)
    _, energies = cells(path, e.STRING_ENERGY, "Scalars:scalars")
    assert np.allclose(np.ravel(energies)[:50], 25.0 * np.maximum(stretch, 0.0) ** 2, atol=1e-12)
    for k in range(50):
        points = np.array(strips[k][0])
        assert np.allclose(points[0], hand, atol=1e-6) and np.allclose(points[-1], rows[k, 0:3] + knot, atol=1e-6)
        length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        # 25 points of a parabola are a little shorter than it.
        assert np.isclose(length, max(0.4, 0.4 + stretch[k]), rtol=5e-3)


def test_the_drawn_ellipsoid_touches_the_drawn_plane_where_the_spin_ends(tmp_path):
    path = tmp_path / "poinsot.rrd"
    rows = flight.rows(60)
    rows[-10:, 10:13] = 0.0
    observer = RerunObserver(record=str(path))
    flight.fly(observer, rows)
    observer.close()
    assert observer.error == ""
    omegas = dict(zip(*cells(path, e.POINSOT_OMEGA, "Arrows3D:vectors"), strict=True))
    polhodes = dict(zip(*cells(path, e.POINSOT_POLHODE, "LineStrips3D:strips"), strict=True))
    times, centres = cells(path, e.POINSOT_PLANE, "Boxes3D:centers")
    _, sizes = cells(path, e.POINSOT_ELLIPSOID, "Ellipsoids3D:half_sizes")
    frame = PrincipalFrame.of(flight.INERTIA)
    touched = 0
    for time_ns, centre in zip(times, centres, strict=True):
        row = rows[time_ns // flight.PERIOD_NS]
        if not row[10:13].any():
            assert centre == [] and polhodes[time_ns] == []
            continue
        touched += 1
        tip, plane = np.array(omegas[time_ns][0]), np.array(centre[0])
        distance = np.linalg.norm(plane)
        assert np.isclose(tip @ plane / distance, distance, rtol=1e-5)
        (R,) = matrix_from_quaternion(row[np.newaxis, 3:7])
        principal = frame.axes.T @ R.T @ tip
        assert np.isclose(np.sum((principal / sizes[0][0]) ** 2), 1.0, rtol=1e-5)
        # The plane is square to the ellipsoid there: its normal is the gradient I ω.
        gradient = R @ frame.axes @ (frame.moments * principal)
        assert np.allclose(gradient / np.linalg.norm(gradient), plane / distance, atol=1e-5)
        curve = np.array(polhodes[time_ns][0])
        assert np.linalg.norm(curve - principal, axis=1).min() < 0.1
    assert touched >= 8 and touched < len(times)


def test_effort_is_plotted_as_a_rate_since_it_was_told_before(tmp_path):
    path = tmp_path / "effort.rrd"
    observer = RerunObserver(record=str(path))
    flight.fly(observer, flight.rows(10))
    for time_ns, steps in ((0, 0), (50_000_000, 50), (100_000_000, 50), (100_000_000, 51)):
        observer.effort(time_ns, steps, 4 * steps)
    observer.reset()
    observer.effort(0, 0, 0)
    observer.effort(50_000_000, 5, 20)
    observer.close()
    assert cells(tmp_path / "effort.run1.rrd", e.EFFORT, "Scalars:scalars") == (
        [50_000_000, 100_000_000],
        [[1000.0, 4000.0], [0.0, 0.0]],
    )
    assert cells(path, e.EFFORT, "Scalars:scalars") == ([50_000_000], [[100.0, 400.0]])


def test_the_next_run_starts_from_the_parameters_then_in_force(tmp_path):
    path = tmp_path / "scene.rrd"
    rows = flight.rows(20)
    observer = RerunObserver(record=str(path))
    flight.fly(observer, rows)
    changed = flight.SCENE + "    mass: 2.0\n"
    observer.scene_changed(190_000_000, changed)
    observer.reset()
    observer.state(0, rows[0])
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
