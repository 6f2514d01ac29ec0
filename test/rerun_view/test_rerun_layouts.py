# SPDX-License-Identifier: MIT
"""What a viewer shows first follows from what the flight is about, and its plots have room for their curves."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: no recordings")

import rerun_flight as flight
from rerun.chunk import RrdReader
from rerun_flight import cells

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.picture import style
from rigid_proto_ros.rerun_view import observer
from rigid_proto_ros.rerun_view.layout import TITLES, FlightTraits, RunSummary, blueprint, value_axis
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.simulation.observer import BodyChanged, Published, Started

FINISHED = RunSummary(10.0, dict.fromkeys(TITLES, (0.0, 1.0)), True)
"""A run in which everything has been plotted."""


def views(traits: FlightTraits, finished: RunSummary | None = None) -> list:
    """All views of a layout."""
    found = []

    def walk(part) -> None:
        if hasattr(part, "contents") and hasattr(part, "kind"):
            for child in part.contents:
                walk(child)
        else:
            found.append(part)

    walk(blueprint(traits, finished).root_container)
    return found


@pytest.mark.parametrize(
    "traits, expected",
    [
        (FlightTraits(falls=True), style.POSITION),
        (FlightTraits(tied=True), style.STRING_LINE_DISTANCE),
        (FlightTraits(dropped_term=True), style.ANGULAR_MOMENTUM_ANGLE),
        (FlightTraits(ghost=True), style.GHOST_ANGLE),
        (FlightTraits(), style.ANGULAR_MOMENTUM),
    ],
)
def test_the_most_informative_plot_of_a_flight_is_shown(traits: FlightTraits, expected: str) -> None:
    for finished in (None, FINISHED):
        assert [view.origin for view in views(traits, finished)].count("/" + expected) == 1


def test_a_finished_recording_has_no_view_that_shows_nothing() -> None:
    shown = [view.origin for view in views(FlightTraits(), RunSummary(10.0, {style.ENERGY: (0.0, 1.0)}, False))]
    assert {o for o in shown if o.startswith("/plots")} == {"/" + style.ENERGY}
    assert "/" not in shown  # the log of commands


def test_poinsots_construction_has_a_view_only_where_it_holds() -> None:
    for subject, shown in (
        (FlightTraits(), True),
        (FlightTraits(rotor=True), False),
        (FlightTraits(ghost=True, rotor=True), False),
    ):
        assert (f"/{style.POINSOT}" in [f"/{view.origin}".replace("//", "/") for view in views(subject)]) == shown


@pytest.mark.parametrize("mesh", [True, False])
def test_a_body_without_a_mesh_is_seen_as_its_box_of_equal_inertia(mesh: bool) -> None:
    (motion,) = (view for view in views(FlightTraits(mesh=mesh)) if view.name == "Motion")
    assert ("/" + style.INERTIA_BOX in motion.visualizer_overrides) == mesh
    assert "/" + style.INERTIA_ELLIPSOID in motion.visualizer_overrides


def test_the_viewers_own_background_is_left_as_it_is() -> None:
    for view in views(FlightTraits()):
        assert "Background" not in (getattr(view, "properties", None) or {})


def test_the_recording_of_a_body_on_a_string_draws_the_strings_line_through_the_com_at_rest(tmp_path) -> None:
    path = tmp_path / "plumb_line.rrd"
    assert main(["simulate", "plumb_line", "--duration", "40", "--record", str(path), "--json"]) == 0
    distances = np.ravel(cells(path, style.STRING_LINE_DISTANCE, "Scalars:scalars")[1])
    size = float(np.linalg.norm(read_scene("plumb_line", {}).setup.surface.extent))
    assert distances[0] > 0.1 * size and distances[-1] < 1e-3 * size  # measured 0.12 m and 1e-5 m
    line = np.array(cells(path, style.STRING_LINE, "LineStrips3D:strips")[1][-1][0])
    com = np.array(cells(path, style.CENTRE, "Transform3D:translation")[1][-1][0])
    along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    assert np.linalg.norm(np.cross(along, com - line[0])) < 1e-3 * size
    assert np.dot(along, com - line[0]) > 0.0  # on from the knot, not back to the hand


def test_a_finished_recording_says_how_far_its_plots_reach(tmp_path) -> None:
    path = tmp_path / "thrown.rrd"
    assert main(["simulate", "thrown_hammer", "--duration", "1", "--record", str(path), "--json"]) == 0
    reader = RrdReader(str(path))
    ends = [
        end
        for blueprint in reader.blueprints()
        for chunk in reader.stream(store=blueprint)
        if chunk.entity_path.endswith("/ScalarAxis")
        for end in chunk.to_record_batch().column("ScalarAxis:range").to_pylist()
    ]
    # The height of the COM goes from 1.5 m to 2.77 m and back.
    assert any(low <= -0.05 and 2.9 <= high <= 5.0 for ((low, high),) in ends), ends
    com = np.array([strips[0][-1] for strips in cells(path, style.COM_TRAIL, "LineStrips3D:strips")[1]])
    assert com[:, 2].max() == pytest.approx(2.77, abs=0.02) and abs(com[:, 1]).max() < 1e-6


ENDS = [(0.0, 5.5), (-6.0, 6.0), (-0.2, 0.9), (0.2, 0.8), (0.98, 1.03), (-3.0, 50.64), (0.0, 7.2e-3), (-12.0, 12.0)]


def test_the_plots_of_a_recording_that_was_begun_in_flight_are_as_long_as_it(tmp_path, monkeypatch) -> None:
    made = []
    monkeypatch.setattr(observer, "blueprint", lambda _, finished: made.append(finished) or blueprint(FlightTraits()))
    recorder = observer.FileRecorder(str(tmp_path / "late.rrd"))
    recorder.on(Started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256))
    recorder.on(BodyChanged(1_000_000_000_000, flight.SETUP))
    for k, row in enumerate(flight.rows(201)):
        recorder.on(Published(1_000_000_000_000 + 10_000_000 * k, row))
    recorder.close()
    assert made[-1].duration_s == pytest.approx(2.0)


@pytest.mark.parametrize(
    "ends", [*ENDS, (0.0, 180.0), (0.0, 0.0), (-1e-9, 3e-14), (-3e-16, 8e-16), (-6.4, -5.8), (5.0, 5.0)]
)
def test_an_axis_has_two_numbers_that_can_be_read_and_no_curve_on_its_frame(ends: tuple[float, float]) -> None:
    low, high = value_axis(*ends)
    margin = 0.05 * (high - low)
    assert low + margin <= ends[0] and ends[1] <= high - margin
    # Rerun numbers ticks at one power of ten, and only where no more than some five of them lie on the axis of a small plot.
    step = 10.0 ** math.ceil(math.log10((high - low) / 5.0) - 1e-9)
    numbered = step * np.arange(math.ceil(low / step), math.floor(high / step) + 1)
    assert len(numbered) >= 2
    # Drawn at the end of the axis, a number lies on those of the time axis.
    assert (numbered > low + 0.9 * margin).all() and (numbered < high - 0.9 * margin).all()
    assert np.ptp(value_axis(*ends, 1.0)) >= 1.0  # rounding of an angle isn't blown up
    assert high - low <= 5.0 * max(ends[1] - ends[0], 0.05 * np.abs(ends).max()) or ends == (0.0, 0.0)


def test_a_legend_lies_beside_the_curves_and_never_over_them() -> None:
    (view,) = [view for view in views(FlightTraits()) if view.origin == "/" + style.ENERGY]
    (axis,) = view.properties["TimeAxis"].view_range.as_arrow_array().to_pylist()
    ends = [r["range"]["end"] for r in view.properties["VisibleTimeRanges"].ranges.as_arrow_array().to_pylist()]
    assert all(end == 0 for end in ends), ends  # curves end at the cursor
    assert axis["end"] >= 0.44 * 1e9 * 20.0, axis  # and room for the legend follows
