# SPDX-License-Identifier: MIT
"""What the page's picture says of the motion: paths, arrows whose length is a value, ground, labels. No browser is needed."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scene_stand_in import SceneStandIn

pytest.importorskip("viser", reason="viser is not installed: no interactive page")

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.picture.plot_range import plot_range
from rigid_proto_ros.scene.offline import read_scene
from rigid_proto_ros.simulation.simulation import Simulation
from rigid_proto_ros.workbench import readout_panel
from rigid_proto_ros.workbench.body_view import BodyView, Switches
from rigid_proto_ros.workbench.keys import KEYS
from rigid_proto_ros.workbench.motion_arrows import MotionArrows, length_text
from rigid_proto_ros.workbench.poke_mark import PokeMark
from rigid_proto_ros.workbench.scene_view import CAMERA, SWITCHES, SceneView
from rigid_proto_ros.workbench.soft_shadow import CELLS, sampled, shadow_picture
from rigid_proto_ros.workbench.surroundings import CELL, SECTION, Surroundings
from rigid_proto_ros.workbench.trails import COM_TRAIL, POINT_TRAIL, Trails, farthest_point


def test_every_key_stands_in_the_docs() -> None:
    page = (Path(__file__).parents[2] / "docs" / "workbench.md").read_text("utf-8")
    written = {name for cell in re.findall(r"^\| ([^|]+) \| [^|]+ \|$", page, re.MULTILINE) for name in cell.split()}
    assert {key.shown for key in KEYS} <= written


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
    assert sent.shape == line.arguments[1].shape  # viser loses the colours of lines whose number changes
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


def arrow_lengths(values, size_m: float = 0.3, unit_m: float = 0.5):
    """Of L's arrow [m] and what its label and its scale say, for each |L| in turn."""
    scene = SceneStandIn()
    arrows = MotionArrows(scene)
    for value in values:
        said = arrows.show(np.zeros(3), np.array([0.0, 0.0, value]), np.ones(3), size_m, unit_m, (True, True))
        arrow = scene.nodes["/momentum"]
        yield float(arrow.points[0, 1, 2]) * unit_m, scene.nodes["/momentum_label"].text, said["arrow of L"]


def test_an_arrows_length_is_its_value_on_the_scale_that_is_said() -> None:
    lengths = list(arrow_lengths([0.55, 0.5, 0.4]))
    assert {scale for *_, scale in lengths} == {lengths[0][2]}
    for (length, label, scale), value in zip(lengths, (0.55, 0.5, 0.4), strict=True):
        assert scale == "5 cm = 0.1 kg m²/s"
        assert length == pytest.approx(value / 0.1 * 0.05, rel=1e-12)
        assert label == f"L {value} kg m²/s"


def test_the_scale_of_an_arrow_goes_in_steps_and_keeps_it_in_sight() -> None:
    values = np.geomspace(1e-6, 1e6, 2000)
    found = list(arrow_lengths([*values, *values[::-1]]))
    assert all(0.5 * 0.3 < length < 1.0 * 0.3 for length, *_ in found)
    steps = sum(a[2] != b[2] for a, b in zip(found[:-1], found[1:], strict=True))
    assert steps <= 2 * 6 * 12 + 1  # six in a decade, up and down
    # A value that trembles about a step doesn't make it change to and fro.
    edge = next(k for k in range(1, 2000) if found[k][2] != found[k - 1][2])
    trembling = [
        found_at[2] for found_at in arrow_lengths([values[edge] * (1.0 + 0.01 * (-1) ** k) for k in range(20)])
    ]
    assert len(set(trembling[1:])) == 1


def test_a_body_at_rest_has_no_arrows() -> None:
    scene = SceneStandIn()
    said = MotionArrows(scene).show(np.zeros(3), np.full(3, 1e-20), np.full(3, 1e-12), 0.3, 0.5, (True, True))
    assert said == {} and not any(node.visible for node in scene.nodes.values())


@pytest.mark.parametrize(
    "metres, text",
    [
        (2.5e-7, "250 nm"),
        (5e-5, "50 µm"),
        (0.002, "2 mm"),
        (0.05, "5 cm"),
        (0.5, "50 cm"),
        (20.0, "20 m"),
        (5e3, "5 km"),
    ],
)
def test_lengths_are_written_with_the_unit_that_suits_them(metres: float, text: str) -> None:
    assert length_text(metres) == text


@pytest.mark.parametrize(
    "values", [[0.0, 2e5], [-1.2e7, -1.1e7], [7229.8, 7229.8 + 1e-9], [-12.0, 12.0], [1e-9, 5e-9], [0.0], [3.0, 1e15]]
)
def test_the_ticks_of_a_plot_fit_beside_it_whatever_the_values(values) -> None:
    values = np.array(values)
    shown = plot_range(values)
    scaled = values / 10.0**shown.exponent
    assert shown.low < scaled.min() and scaled.max() < shown.high and shown.exponent % 3 == 0
    ticks = np.linspace(shown.low, shown.high, 5)
    assert np.abs(ticks).max() <= 1500.0
    # Two digits behind the point tell them apart, so "-1,500.25" is the longest.
    assert np.diff(ticks).min() >= 0.01


def test_a_plots_title_says_its_power_of_ten() -> None:
    assert plot_range(np.array([0.0, 2e5])).title("Energy", "J") == "Energy [10³ J]"
    assert plot_range(np.array([-3e-10])).title("Energy", "J") == "Energy [10⁻¹² J]"
    assert plot_range(np.array([10.0])).title("Angle", "°") == "Angle [°]"


def test_rounding_of_a_constant_does_not_fill_its_plot() -> None:
    shown = plot_range(np.array([0.0, 3e-14]), least=1.0)
    assert shown.exponent == 0 and shown.high - shown.low >= 1.0
    constant = plot_range(np.array([5.0, 5.0 + 1e-12]))
    assert constant.high - constant.low > 0.2


def test_the_floor_goes_with_a_falling_body_and_the_wall_passes_it_by() -> None:
    scene = SceneStandIn()
    surroundings, unit = Surroundings(scene), 0.5
    lines = {}
    for height in (0.0, -0.3, -7.0):
        surroundings.place(np.array([0.0, 0.0, height]), unit, True)
        assert scene.nodes["/grid/floor"].position[2] < 0.0
        wall = scene.nodes["/grid/wall"]
        lines[height] = wall.position[2]
        # A thick line lies where its height is in the world.
        for k in range(2):
            label = scene.nodes[f"/grid/height{k}"]
            said = float(label.text.split()[2])
            assert label.position[2] * unit + height == pytest.approx(said, abs=1e-9)
            assert (label.position[2] - wall.position[2]) % SECTION == pytest.approx(0.0, abs=1e-9) or (
                label.position[2] - wall.position[2]
            ) % SECTION == pytest.approx(SECTION, abs=1e-9)
    assert lines[-0.3] - lines[0.0] == pytest.approx(0.3 / unit)
    assert scene.nodes["/grid/bar_label"].text == length_text(CELL * unit)


def test_without_gravity_the_wall_is_seen_only_by_a_body_that_left_the_floor() -> None:
    scene = SceneStandIn()
    surroundings = Surroundings(scene)
    surroundings.place(np.zeros(3), 1.0, False)
    assert not scene.nodes["/grid/wall"].visible
    surroundings.place(np.array([0.0, 0.0, 2.0]), 1.0, False)
    assert scene.nodes["/grid/wall"].visible
    surroundings.switch(False)
    surroundings.place(np.array([0.0, 0.0, 2.0]), 1.0, True)
    assert not any(node.visible for node in scene.nodes.values())


def test_a_shadow_is_dark_below_the_body_and_nowhere_else() -> None:
    setup = read_scene("t_handle", {}).setup
    points = sampled(setup.surface.vertices, setup.surface.triangles)
    low, high = setup.surface.vertices.min(axis=0), setup.surface.vertices.max(axis=0)
    assert (points >= low - 1e-12).all() and (points <= high + 1e-12).all()
    places = np.array([[0.25, 0.1]] * 50)
    alpha = shadow_picture(places)[..., 3]
    row, column = np.unravel_index(int(alpha.argmax()), alpha.shape)
    assert (column + 0.5) / CELLS - 0.5 == pytest.approx(0.25, abs=1.0 / CELLS)
    assert 0.5 - (row + 0.5) / CELLS == pytest.approx(0.1, abs=1.0 / CELLS)
    assert np.count_nonzero(alpha) <= 25


def test_no_label_begins_empty_for_viser_would_never_show_it() -> None:
    scene = SceneStandIn()
    for thing in (Surroundings, MotionArrows):
        thing(scene)
    PokeMark(scene, (0, 0, 0))
    labels = [node for node in scene.nodes.values() if node.kind == "add_label"]
    assert len(labels) >= 5 and all(label.arguments[0] for label in labels)


def ghost_view() -> tuple[SceneStandIn, SceneView]:
    """A picture without a browser."""

    class Scene(SceneStandIn):
        def __getattr__(self, method: str):
            return super().__getattr__(method) if method.startswith("add_") else lambda *a, **k: None

        world_axes = SimpleNamespace(visible=True)

    scene = Scene()
    return scene, SceneView(SimpleNamespace(scene=scene, initial_camera=SimpleNamespace()))


def test_the_names_of_body_and_ghost_are_apart_from_every_side_and_the_contacts_names_give_way() -> None:
    scene, view = ghost_view()
    scenario = read_scene("true_or_box_tensor", {})
    view.set_body(scenario, zoom=True)
    view.body.label_contacts(scenario.parameters.contacts, "l_bracket")
    contacts = [scene.nodes[f"/body/contact_{name}"] for name in scenario.parameters.contacts]
    assert all(label.visible for label in contacts)
    setup, com = scenario.setup, scenario.ghost.body.center_of_mass
    labels = [scene.nodes[f"/names/{whose}"] for whose in ("body", "ghost")]
    lines = [scene.nodes[f"/names/{whose}_line"] for whose in ("body", "ghost")]
    body_run, ghost_run = Simulation(setup), Simulation(scenario.ghost)
    lower = set()
    for k in range(40):
        row, ghost = (run.advance(k * 10**8).row.copy() for run in (body_run, ghost_run))
        ghost[2] += 0.15 * view.radius * (k - 20)  # in its turn far below the body and far above it
        view.place(row, 0.1 * k)
        view.show_motion(row[0:3], State(0, row).angular_momentum(setup.body.inertia), np.ones(3))
        view.show_ghost(ghost, com, ("body: solid (true)", "ghost: bounding box"))
        lower.add(min((0, 1), key=lambda which: labels[which].position[2]))
        for angle in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
            for elevation in (-0.2, 0.4, 1.2, 1.5):
                assert not overlap(*(on_screen(label, angle, elevation) for label in labels))
        # As a page looks at first, L's own is apart, too.
        angle, elevation = np.arctan2(CAMERA[1], CAMERA[0]), np.arctan2(CAMERA[2], np.hypot(*CAMERA[:2]))
        texts = [on_screen(label, angle, elevation) for label in (*labels, scene.nodes["/momentum_label"])]
        assert not any(overlap(one, other) for one, other in combinations(texts, 2))
        # Each leads to a point of its own body, as it lies.
        for line, pose, own in zip(lines, (row, ghost), (setup.body.center_of_mass, com), strict=True):
            point = (line.points[0, 1] * view.unit - pose[0:3]) @ matrix_from_quaternion(pose[3:7]) + own
            assert np.abs(setup.surface.vertices - point).max(axis=1).min() < 1e-12
    assert lower == {0, 1}
    assert not any(label.visible for label in contacts)
    view.show_ghost(None, com, ("body", "ghost"))
    assert not any(node.visible for node in (*labels, *lines)) and all(label.visible for label in contacts)
    view.switch("Contacts", False)
    view.show_ghost(ghost, com, ("body", "ghost"))
    view.show_ghost(None, com, ("body", "ghost"))
    assert not any(label.visible for label in contacts)


def on_screen(label: SimpleNamespace, angle: float, elevation: float) -> tuple[float, float, float, float]:
    """Left, right, lower and upper edge of a label's text [pixels], seen from this direction [rad] at the distance that
    a page has at first; letters are 8 pixels wide and 14 high.
    """
    toward = np.array([np.cos(angle) * np.cos(elevation), np.sin(angle) * np.cos(elevation), np.sin(elevation)])
    right = np.array([-np.sin(angle), np.cos(angle), 0.0])
    up = np.cross(toward, right)
    away = np.linalg.norm(CAMERA) - label.position @ toward
    x, y = np.array([label.position @ right, label.position @ up]) / away * 400.0 / np.tan(np.radians(20.0))
    wide = 8.0 * len(label.text)
    vertical, horizontal = label.anchor.split("-")
    left = x - wide if horizontal == "right" else x
    low = y if vertical == "bottom" else y - 14.0
    return left, left + wide, low, low + 14.0


def overlap(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """Whether two rectangles share more than an edge."""
    return one[0] < other[1] and other[0] < one[1] and one[2] < other[3] and other[2] < one[3]


def test_the_floor_is_seen_through_the_shadow_whichever_a_browser_draws_first() -> None:
    scene, view = ghost_view()
    scenario = read_scene("true_or_box_tensor", {})
    view.set_body(scenario, zoom=True)
    view.place(np.array([*scenario.setup.initial]), 0.0)
    view.place_surroundings(False)
    assert scene.nodes["/grid/shadow"].position[2] < scene.nodes["/grid/floor"].position[2]


@pytest.mark.parametrize("follower", ["ball", "explicit"])
def test_of_a_body_with_sharp_edges_nothing_is_left_in_the_picture_when_a_smooth_one_follows(
    follower, tmp_path
) -> None:
    import trimesh

    trimesh.creation.icosphere(subdivisions=3).export(tmp_path / "ball.stl")
    smooth = {"mesh": str(tmp_path / "ball.stl")} if follower == "ball" else {"mesh": "", "inertia_model": "explicit"}
    scene = SceneStandIn()
    body = BodyView(scene, Switches(SWITCHES))
    body.set_body(read_scene("teapot", {}), 0.5)
    assert "/body/drawn" in scene.nodes
    body.set_body(read_scene("teapot", smooth), 0.5)
    assert "/body/mesh" in scene.nodes and "/body/drawn" not in scene.nodes
    assert ("/body/bounds" in scene.nodes) == (follower == "ball")
    body.set_body(read_scene("teapot", {}), 0.5)
    assert "/body/drawn" in scene.nodes


def test_the_number_at_the_top_of_an_axis_is_whole() -> None:
    digits_px = 12  # of uPlot's axes
    assert readout_panel.PADDING[0] >= 0.5 * digits_px  # 4 cut it in half
