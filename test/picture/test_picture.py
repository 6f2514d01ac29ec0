# SPDX-License-Identifier: MIT
"""What is drawn of a flight is true: shapes of the inertia, Poinsot's construction, arrows, trail, string, ghost, drift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rerun_flight as flight
from drawn import Drawn
from flights import SECOND, StringSettings, changed, flight_setup
from hypothesis import given, settings
from hypothesis import strategies as st
from judged_meshes import body, volume

from rigid_proto_ros.base.rotation import matrix_from_quaternion, multiply
from rigid_proto_ros.mass.tensor import principal_axes
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.surface import Surface
from rigid_proto_ros.picture import style
from rigid_proto_ros.picture.arrows import FIRST, LONGEST, ArrowScales
from rigid_proto_ros.picture.picture import Picture, Shape, angle_to
from rigid_proto_ros.picture.poinsot import polhode
from rigid_proto_ros.picture.string import POINTS, string_curves
from rigid_proto_ros.picture.surface import ball_mesh, box_mesh, shaded_surface
from rigid_proto_ros.simulation.commands import Change
from rigid_proto_ros.simulation.observer import (
    BodyChanged,
    GhostChanged,
    LoadBegan,
    LoadEnded,
    MeshChanged,
    Observer,
    ShownLoad,
    Started,
    StringChanged,
)
from rigid_proto_ros.simulation.quantities import attitude_angle
from rigid_proto_ros.simulation.setup import Setup
from rigid_proto_ros.simulation.simulation import Simulation

MOMENTS = st.tuples(*[st.floats(0.1, 10.0)] * 3).map(
    lambda s: np.sort(np.array([s[1] + s[2], s[0] + s[2], s[0] + s[1]])),
)
"""Principal moments of bodies that exist: sums of two of three positive second moments."""

SPINS = st.tuples(*[st.floats(-5.0, 5.0)] * 3).map(np.array).filter(lambda w: np.linalg.norm(w) > 1e-3)


@settings(deadline=None, max_examples=30)
@given(MOMENTS, SPINS)
def test_the_polhode_has_the_bodys_energy_and_momentum_and_passes_through_its_spin(moments, w):
    energy, squared_L = 0.5 * moments @ (w * w), (moments * w) @ (moments * w)
    curve = polhode(moments, energy, w)
    assert np.allclose(curve**2 @ moments, 2.0 * energy, rtol=1e-9)
    assert np.allclose((curve * moments) ** 2 @ np.ones(3), squared_L, rtol=1e-9)
    spacing = np.linalg.norm(np.diff(curve, axis=0), axis=1).max()
    assert np.linalg.norm(curve - w, axis=1).min() <= spacing + 1e-7 * np.linalg.norm(w)


@settings(deadline=None, max_examples=30)
@given(MOMENTS, st.floats(0.01, 100.0))
def test_box_and_ellipsoid_have_the_mass_and_the_tensor_they_stand_for(moments, mass):
    shape = Shape(None, make_body(mass, np.zeros(3), np.diag(moments)))
    a = shape.box_sides
    box = mass / 12.0 * np.array([a[1] ** 2 + a[2] ** 2, a[0] ** 2 + a[2] ** 2, a[0] ** 2 + a[1] ** 2])
    b = shape.semi_axes
    ellipsoid = mass / 5.0 * np.array([b[1] ** 2 + b[2] ** 2, b[0] ** 2 + b[2] ** 2, b[0] ** 2 + b[1] ** 2])
    assert np.allclose(box, shape.moments, rtol=1e-12)
    assert np.allclose(ellipsoid, shape.moments, rtol=1e-12)
    assert np.linalg.det(shape.axes) > 0.0


def test_a_brick_is_drawn_with_flat_faces_and_a_ball_smooth():
    vertices, triangles, normals = shaded_surface(flight.VERTICES, flight.TRIANGLES)
    assert len(vertices) == 24
    for corner_normals, corners in zip(normals[triangles], vertices[triangles], strict=True):
        face = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        assert np.allclose(corner_normals, face / np.linalg.norm(face), atol=1e-6)

    # A ball of 24 by 48 facets: edges bend by 7.5 degrees, well below a crease.
    ball = ball_mesh()
    points, _, normals = shaded_surface(ball.vertices.astype(float), ball.triangles)
    assert np.einsum("ij,ij->i", points, normals).min() > np.cos(np.deg2rad(6.0))


@pytest.mark.parametrize(("mesh", "content"), [(box_mesh(), 8.0), (ball_mesh(), 4.0 / 3.0 * np.pi)])
def test_box_and_ball_are_closed_and_wound_outward(mesh, content):
    # Where a ball's last meridian is the first again, single precision differs.
    made = body((np.round(mesh.vertices.astype(float), 6), mesh.triangles))
    assert made.verdict.closed and not made.verdict.inward
    assert volume(made) == pytest.approx(content, rel=0.02)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)


def spinning(spin: float, count: int = 20) -> np.ndarray:
    """States (count, 13) of a body that turns about its z."""
    rows = np.tile([0.0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, spin], (count, 1))
    half = 0.5 * spin * 1e-9 * flight.PERIOD_NS * np.arange(count)
    rows[:, 5], rows[:, 6] = np.sin(half), np.cos(half)
    return rows


def times(count: int, first: int = 0) -> np.ndarray:
    return flight.PERIOD_NS * np.arange(first, first + count)


def pictured(setup: Setup = flight.SETUP, vertices=flight.VERTICES, triangles=flight.TRIANGLES, **options):
    """A body's picture, and what is drawn of it."""
    drawn = Drawn()
    picture = Picture(drawn, **options)
    picture.on(Started("", vertices, triangles, ""))
    picture.on(BodyChanged(0, setup))
    return picture, drawn


WEIGHTLESS = flight.setup_of(gravity=np.zeros(3))


def test_arrows_are_as_long_as_their_values_through_all_runs_of_a_body():
    picture, drawn = pictured(WEIGHTLESS)
    lengths = {}
    for spin in (15.0, 30.0, 60.0):
        picture.draw(times(20), spinning(spin))
        for name in (style.OMEGA, style.MOMENTUM):
            lengths.setdefault(name, []).append(np.linalg.norm(drawn.at_end(name)[0]))
        picture.restart()
    for found in lengths.values():
        assert np.allclose(np.divide(found, found[0]), [1.0, 2.0, 4.0], rtol=1e-12)
    assert lengths[style.OMEGA][0] == pytest.approx(FIRST * picture.shape.size)


def test_a_state_drawn_between_another_mesh_and_its_body_sets_no_scale_for_that_body():
    picture, drawn = pictured(WEIGHTLESS)
    picture.draw(times(5), spinning(60.0, 5))
    picture.on(MeshChanged(50_000_000, 2.0 * flight.VERTICES, flight.TRIANGLES, ""))
    picture.draw(times(5, 5), spinning(60.0, 5))
    picture.on(BodyChanged(100_000_000, replace(WEIGHTLESS, surface=Surface(2.0 * flight.VERTICES, flight.TRIANGLES))))
    picture.draw(times(5, 10), spinning(2.0, 5))
    assert np.linalg.norm(drawn.at_end(style.OMEGA)[0]) == pytest.approx(FIRST * picture.shape.size)


def test_of_a_body_at_rest_no_arrow_and_no_label_is_drawn():
    picture, drawn = pictured(WEIGHTLESS)
    # What rounding leaves of a spin that a string has stopped.
    picture.draw(times(5), spinning(4e-11, 5))
    for name in (style.OMEGA, style.MOMENTUM):
        assert not drawn.at_end(name).size and not drawn.at_end(name + "/label").size
    # The first true spin has an arrow of a usual length, and so it is nothing beside it later.
    picture.draw(times(5, 5), spinning(8.0, 5))
    assert 0.1 < np.linalg.norm(drawn.at_end(style.OMEGA)) / picture.shape.size < 2.0
    picture.draw(times(5, 10), spinning(4e-11, 5))
    assert not drawn.at_end(style.OMEGA).size


@settings(deadline=None, max_examples=30)
@given(st.floats(1e-9, 1e6), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_a_stronger_load_has_a_longer_arrow_that_never_leaves_the_picture(first, size, factor):
    scales = ArrowScales()
    own, other = scales.lengths("N", np.array([first, factor * first]), size)
    assert own == pytest.approx(FIRST * size)
    if 0.01 < factor < LONGEST / FIRST:
        assert other == pytest.approx(factor * own)
    assert other <= LONGEST * size


def test_labels_stand_beyond_the_tips_of_their_arrows_and_apart_on_one_axis():
    picture, drawn = pictured(WEIGHTLESS)
    picture.draw(times(20), spinning(15.0))
    (tip,), (label,) = drawn.at_end(style.MOMENTUM), drawn.at_end(style.MOMENTUM + "/label")
    assert np.allclose(np.cross(tip, label), 0.0, atol=1e-12) and np.linalg.norm(label) > 1.02 * np.linalg.norm(tip)
    # The body turns about a principal axis: its name, ω and L stand on one line.
    names = [style.OMEGA, style.MOMENTUM, style.PRINCIPAL_AXES]
    heights = [np.abs(drawn.at_end(name + "/label")[:, 2]).max() / picture.shape.size for name in names]
    assert np.diff(heights).min() > 0.1  # of the body's size: some 15 pixels of a small view


def test_arrows_stand_at_their_points_and_only_while_the_load_acts():
    picture, drawn = pictured()
    states = flight.rows(50)
    picture.on(LoadBegan(200_000_000, 1, flight.POKE))
    picture.draw(times(30), states[:30])
    picture.on(LoadEnded(400_000_000, 1))
    picture.draw(times(20, 30), states[30:])
    name = style.load_part("poke", "force")
    rows = drawn.parts[name]
    assert {t for t, own in rows.items() if len(own)} == set(range(200_000_000, 400_000_000, flight.PERIOD_NS))
    for time_ns, vectors in rows.items():
        if not len(vectors):
            continue
        row = states[time_ns // flight.PERIOD_NS]
        point = row[0:3] + matrix_from_quaternion(row[3:7]) @ flight.POKE.point
        (origin,) = drawn.origins[name][time_ns]
        ends = np.array([origin, origin + vectors[0]])
        assert min(np.linalg.norm(ends - point, axis=1)) < 1e-12
        assert np.allclose(np.cross(vectors[0], flight.POKE.force), 0.0, atol=1e-12)
        assert np.dot(vectors[0], flight.POKE.force) > 0.0


def test_a_load_shorter_than_the_time_between_two_states_is_shown_at_the_next_one():
    picture, drawn = pictured()
    picture.on(LoadBegan(203_000_000, 1, flight.POKE))
    picture.on(LoadEnded(205_000_000, 1))
    picture.draw(times(30), flight.rows(30))
    rows = drawn.parts[style.load_part("poke", "force")]
    assert [t for t, own in rows.items() if len(own)] == [210_000_000]


def test_the_arrow_of_a_load_stays_at_its_point_of_a_body_that_changes():
    picture, drawn = pictured()
    push = ShownLoad("wrench", "body", np.array([0.1, 0.2, -0.3]), np.array([0.0, 0.0, 2.0]), np.zeros(3))
    at_com = ShownLoad("poke", "body", np.zeros(3), np.array([0.0, 0.0, 2.0]), np.zeros(3))
    for number, load in enumerate((push, at_com)):
        picture.on(LoadBegan(0, number, load))
    picture.draw(times(5), spinning(0.0, 5))
    # Twice as large, about another centre: the point of the mesh is (0.4, 0.3, -0.25) / (2, 1, 1).
    picture.on(BodyChanged(45_000_000, flight.setup_of(com=[0.1, 0.0, 0.0], scale=2.0 * flight.SCALE)))
    picture.draw(times(1, 5), spinning(0.0, 1))
    for load, before, after in (("wrench", [0.1, 0.2, -0.3], [0.7, 0.6, -0.5]), ("poke", np.zeros(3), np.zeros(3))):
        name = style.load_part(load, "force")
        for time_ns, point in ((40_000_000, before), (50_000_000, after)):
            (origin,), (vector,) = drawn.origins[name][time_ns], drawn.parts[name][time_ns]
            assert min(np.linalg.norm([origin - point, origin + vector - point], axis=1)) < 1e-12


def test_an_impulse_is_shown_from_its_instant_for_a_moment():
    picture, drawn = pictured()
    push = ShownLoad("impulse", "body", np.array([0.1, 0, 0]), np.array([0.0, 0.0, 2.0]), np.zeros(3))
    picture.on(LoadBegan(100_000_000, 1, push))
    picture.draw(times(60), flight.rows(60))
    rows = drawn.parts[style.load_part("impulse", "force")]
    shown = [t for t, own in rows.items() if len(own)]
    assert shown[0] == 100_000_000 and shown[-1] == 240_000_000
    assert len(shown) == 15 and not len(rows[250_000_000])


def test_the_string_runs_from_the_hand_to_its_knot_taut_or_slack_until_it_is_let_go():
    rows = spinning(0.0, 60)
    # The body rises towards the hand at 1 m/s: 0.4 m long, the string goes slack half-way.
    rows[:, 2], rows[:, 9] = 0.01 * np.arange(60), 1.0
    knot, hand = np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 0.8])
    picture, drawn = pictured()
    body = flight.SETUP.body
    string = StringSettings(True, body.mesh_point(knot), hand, damping_ratio=0.0, rest_length=0.4)
    tied = Simulation(flight_setup(body, initial=rows[0], string=string)).string
    picture.on(StringChanged(0, tied, knot))
    picture.on(StringChanged(495_000_000, None, None))
    picture.draw(times(60), rows)
    strips = drawn.parts[style.STRING]
    assert [t for t, own in strips.items() if own] == times(50).tolist()
    stretch = 0.8 - 0.1 - rows[:50, 2] - 0.4
    energies = np.array(list(drawn.parts[style.ENERGY].values()))
    assert np.allclose(energies[:50, 4], 25.0 * np.maximum(stretch, 0.0) ** 2, atol=1e-12)
    assert np.allclose(energies[:, 3], energies[:, :3].sum(axis=1) + energies[:, 4], rtol=1e-14)
    for k in range(50):
        (points,) = strips[k * flight.PERIOD_NS]
        assert np.allclose(points[0], hand, atol=1e-12) and np.allclose(points[-1], rows[k, 0:3] + knot, atol=1e-12)
        length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        assert np.isclose(length, max(0.4, 0.4 + stretch[k]), rtol=1e-9)


def test_without_a_string_the_energies_are_three_and_their_total():
    picture, drawn = pictured()
    picture.draw(times(20), flight.rows(20))
    assert {len(own) for own in drawn.parts[style.ENERGY].values()} == {4}
    assert style.STRING_LINE_DISTANCE not in drawn.parts


def test_the_momentum_of_a_body_that_was_at_rest_drifts_from_where_it_first_points():
    picture, drawn = pictured(WEIGHTLESS)
    states = spinning(0.0, 30)
    states[15:, 10], states[25:, 10:12] = 1.0, [0.0, 2.0]
    for first in (0, 10, 20):
        picture.draw(times(10, first), states[first : first + 10])
    angles = np.ravel(list(drawn.parts[style.ANGULAR_MOMENTUM_ANGLE].values()))
    assert np.allclose(angles, 25 * [0.0] + 5 * [90.0])


def test_the_drawn_ellipsoid_touches_the_drawn_plane_where_the_spin_ends():
    rows = flight.rows(60)
    rows[-10:, 10:13] = 0.0
    picture, drawn = pictured()
    picture.draw(times(60), rows)
    omegas, polhodes = drawn.parts[style.POINSOT_OMEGA], drawn.parts[style.POINSOT_POLHODE]
    _, _, sizes = drawn.places[style.POINSOT_ELLIPSOID]
    moments, axes = principal_axes(flight.INERTIA)
    touched, planes = 0, drawn.parts[style.POINSOT_PLANE]
    turned = drawn.attitudes[style.POINSOT_UPRIGHT]
    for time_ns, lines in planes.items():
        row = rows[time_ns // flight.PERIOD_NS]
        if not row[10:13].any():
            assert not lines and not polhodes[time_ns]
            continue
        touched += 1
        (tip,) = omegas[time_ns]
        # The floor lies square below, and what turns stands upright on it.
        assert np.ptp([line[:, 2] for line in lines]) == 0.0
        (upright,) = matrix_from_quaternion(turned[time_ns][np.newaxis])
        corners = np.array([lines[0][0], lines[0][1], lines[2][0]]) @ upright
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        normal *= np.sign(normal @ corners[0]) / np.linalg.norm(normal)
        assert np.isclose(tip @ normal, corners[0] @ normal, rtol=1e-9)
        (R,) = matrix_from_quaternion(row[np.newaxis, 3:7])
        principal = axes.T @ R.T @ tip
        assert np.isclose(np.sum((principal / sizes) ** 2), 1.0, rtol=1e-9)
        # The plane is square to the ellipsoid there: its normal is the gradient I ω.
        gradient = R @ axes @ (moments * principal)
        assert np.allclose(gradient / np.linalg.norm(gradient), normal, atol=1e-9)
        (curve,) = polhodes[time_ns]
        assert np.linalg.norm(curve - principal, axis=1).min() < 0.1
    assert touched >= 8 and touched < len(planes)


def test_momentum_is_that_of_body_and_flywheel_and_with_one_nothing_rolls():
    class ToPicture(Observer):
        takes = frozenset({BodyChanged})

        def on(self, event):
            picture.on(event)

    drawn = Drawn()
    picture, body = Picture(drawn), make_body(1.0, np.zeros(3), np.diag((1.0, 2.0, 2.5)))
    start = np.array((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.1, 2.0, 0.1))
    simulation = Simulation(flight_setup(body, integrator="auto", initial=start), ToPicture())
    simulation.announce()
    momentum = simulation.angular_momentum
    for second, rotor in ((0, {}), (1, {"rotor_torque": (0.0, 0.5, 0.2)}), (2, {"rotor_torque": (0.0, 0.0, 0.0)})):
        setup = changed(simulation.setup, **rotor)
        simulation.submit(Change({}, lambda setup=setup: setup))
        simulation.act()
        for k in range(1, 9):
            picture.draw(*drawable(simulation.advance(second * SECOND + k * SECOND // 8)))
    plotted = np.array(list(drawn.parts[style.ANGULAR_MOMENTUM].values()))
    assert len(plotted) == 24
    assert np.abs(plotted[:, :3] - momentum).max() < 1e-8
    assert simulation.rotor_momentum.tolist() == [0.0, 0.5, 0.2]
    tips = drawn.parts[style.POINSOT_OMEGA]
    assert [bool(len(tips[time_ns])) for time_ns in sorted(tips)] == 8 * [True] + 16 * [False]
    assert not len(drawn.at_end(style.POINSOT_PLANE))


def drawable(state):
    return np.array([state.time_ns]), state.row[np.newaxis].copy()


def test_the_ghost_is_compared_with_the_body_at_equal_times():
    picture, drawn = pictured()
    picture.on(GhostChanged(0, flight.setup_of(inertia=np.eye(3))))
    body, ghost = flight.rows(30, seed=1), flight.rows(30, seed=2)
    picture.draw(times(20), body[:20])
    picture.draw_ghost(times(12), ghost[:12])
    picture.draw(times(10, 20), body[20:])
    picture.draw_ghost(times(18, 12), ghost[12:])
    found = drawn.parts[style.GHOST_ANGLE]
    assert list(found) == times(30).tolist()
    apart = [attitude_angle(*pair) for pair in zip(body[:, 3:7], ghost[:, 3:7], strict=True)]
    assert np.allclose(np.radians(np.ravel(list(found.values()))), apart, rtol=1e-14)


def test_a_ghost_that_ended_leaves_nothing_and_may_come_back():
    picture, drawn = pictured()
    for time_ns, setup in enumerate((flight.setup_of(inertia=np.eye(3)), None, flight.setup_of(inertia=np.eye(3)))):
        picture.on(GhostChanged(time_ns, setup))
        assert (drawn.meshes[style.GHOST_MESH] is not None) == (setup is not None)
        assert len(drawn.parts[style.GHOST_BOX][time_ns]) == (12 if setup else 0)


def test_a_mesh_far_from_its_origin_is_drawn_to_single_precision_of_its_size():
    com = np.array([0.15, 0.1, 0.05]) + 1e7
    _, drawn = pictured(flight.setup_of(1.0, com, np.eye(3), np.ones(3), np.zeros(3)), flight.VERTICES + 1e7)
    place, _, scale = drawn.places[style.BODY_MESH]
    corners = drawn.meshes[style.BODY_MESH].vertices * scale + place
    assert np.allclose(np.ptp(corners, axis=0), [0.3, 0.2, 0.1], rtol=1e-6)
    assert np.allclose(corners.mean(axis=0), 0.0, atol=1e-8)


def test_a_stray_vertex_that_no_triangle_uses_changes_nothing_of_the_picture():
    picture, drawn = pictured()
    stray = np.insert(flight.VERTICES, 3, [0.0, 0.0, 100.0], axis=0)
    other, strayed = pictured(vertices=stray, triangles=flight.TRIANGLES + (flight.TRIANGLES >= 3))
    for each in (picture, other):
        each.draw(times(20), flight.rows(20))
    assert strayed.size == drawn.size
    for name, rows in drawn.parts.items():
        assert np.array_equal(list(rows.values()), list(strayed.parts[name].values())), name
    for with_stray, without in zip(strayed.meshes[style.BODY_MESH], drawn.meshes[style.BODY_MESH], strict=True):
        assert np.array_equal(with_stray, without)


def test_trails_go_through_the_com_and_its_farthest_vertex_at_each_state():
    picture, drawn = pictured()
    states = flight.rows(20)
    picture.draw(times(20), states)
    tip = picture.shape.tip
    assert np.linalg.norm(tip) == pytest.approx(
        np.linalg.norm(flight.SCALE * flight.VERTICES - flight.COM, axis=1).max()
    )
    com, path = (np.concatenate(list(drawn.parts[name].values())) for name in (style.COM_TRAIL, style.TRAIL))
    assert np.array_equal(com, states[:, 0:3])
    assert np.allclose(path, states[:, 0:3] + matrix_from_quaternion(states[:, 3:7]) @ tip, atol=1e-15)


def test_what_is_not_wanted_is_not_drawn():
    picture, drawn = pictured(wanted=lambda name: name == style.OMEGA)
    picture.draw(times(20), flight.rows(20))
    moving = {name for name in drawn.parts if name.startswith((style.CENTRE, style.POINSOT, "plots", style.TRAIL))}
    assert moving == {style.OMEGA, style.OMEGA + "/label"}


def test_a_backend_that_comes_late_is_told_what_is_drawn_only_once():
    picture, drawn = pictured()
    picture.draw(times(20), flight.rows(20))
    late = Drawn()
    late.begin(times(1, 20))
    picture.describe(late)
    assert set(late.meshes) == set(drawn.meshes) and late.size == drawn.size
    assert set(late.places) == set(drawn.places) - {
        *(style.BODY, style.CENTRE, style.POINSOT_BODY, style.POINSOT_UPRIGHT)
    }


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.5, 3.0, np.pi - 1e-6, np.pi])
def test_angles_are_accurate_at_both_ends(angle: float) -> None:
    other = np.array([np.cos(angle), np.sin(angle), 0.0])
    assert angle_to(np.array([2.0, 0.0, 0.0]), 5.0 * other[np.newaxis])[0] == pytest.approx(angle, rel=1e-9, abs=1e-16)
    assert angle_to(np.zeros(3), other[np.newaxis])[0] == 0.0


@settings(deadline=None)
@given(SPINS, st.floats(-14.0, 0.49).map(lambda e: 10.0**e), st.sampled_from([1.0, -1.0]))
def test_the_angle_between_two_attitudes_is_accurate_down_to_round_off(axis, angle, sign):
    turn = np.append(np.sin(0.5 * angle) * axis / np.linalg.norm(axis), np.cos(0.5 * angle))
    start = np.array([0.5, -0.5, 0.5, 0.5])
    found = attitude_angle(start, sign * np.array(multiply(*start, *turn)))
    assert found == pytest.approx(angle, rel=1e-13, abs=1e-15)


def test_the_bounding_box_follows_a_scale_that_mirrors():
    _, drawn = pictured(flight.setup_of(com=[-0.3, 0.1, 0.05], scale=np.array([-2.0, 1.0, 1.0])))
    corners = np.concatenate(drawn.at_end(style.BOUNDING_BOX))
    assert corners.min(axis=0) == pytest.approx([-0.3, -0.1, -0.05])
    assert corners.max(axis=0) == pytest.approx([0.3, 0.1, 0.05])


@settings(deadline=None, max_examples=30)
@given(st.floats(0.0, 0.9999), st.floats(0.0, np.pi), st.floats(1e-3, 1e3))
def test_a_slack_string_is_drawn_as_long_as_it_is_from_end_to_end(taut, slope, length):
    free = np.array([[0.3, -0.2, 1.0]])
    knots = free + taut * length * np.array([[np.sin(slope), 0.0, np.cos(slope)]])
    (curve,) = string_curves(free, knots, np.array([length]), flight.GRAVITY)
    assert curve.shape == (POINTS, 3)
    assert np.isclose(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum(), length, rtol=1e-9)
    assert np.array_equal(curve[0], free[0]) and np.abs(curve[-1] - knots[0]).max() < 1e-12 * max(length, 1.0)
    # Not above the straight line, and in the plane of its ends.
    straight = free + np.linspace(0.0, 1.0, POINTS)[:, np.newaxis] * (knots - free)
    assert (curve[:, 2] <= straight[:, 2]).all() and np.array_equal(curve[:, :2], straight[:, :2])


@pytest.mark.parametrize(
    "gravity, way",
    [([3.0, 0.0, 0.0], [1.0, 0.0, 0.0]), ([0.0, -1.6, 1.2], [0.0, -0.8, 0.6]), ([0.0, 0.0, 0.0], [0.0, 0.0, -1.0])],
)
def test_it_hangs_where_gravity_pulls_and_downward_without_any(gravity, way):
    knot = np.array([[0.3, 0.1, 0.2]])
    (curve,) = string_curves(np.zeros((1, 3)), knot, np.ones(1), np.array(gravity))
    sag = curve[POINTS // 2] - 0.5 * knot[0]
    assert np.linalg.norm(sag) > 0.2 and np.abs(sag / np.linalg.norm(sag) - way).max() < 1e-15
