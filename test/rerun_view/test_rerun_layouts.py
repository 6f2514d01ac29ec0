# SPDX-License-Identifier: MIT
"""What a viewer shows first follows from what the flight is about, and its plots have room for their curves."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: no recordings")

from rerun.chunk import RrdReader

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.rerun_view import appearance
from rigid_proto_ros.rerun_view import entities as e
from rigid_proto_ros.rerun_view.derived import angle_to
from rigid_proto_ros.rerun_view.inertia_shapes import skewed
from rigid_proto_ros.rerun_view.layout import Subject, layout
from rigid_proto_ros.rerun_view.plot_range import with_two_ticks
from rigid_proto_ros.rerun_view.plots import Ranges
from rigid_proto_ros.rerun_view.reader import record_batches
from rigid_proto_ros.rerun_view.rerun_internals import BlueprintStream
from rigid_proto_ros.scene.offline import read_scene


@pytest.mark.parametrize(
    "subject, told_by",
    [
        (Subject(falls=True), e.POSITION),
        (Subject(tied=True), e.STRING_LINE_DISTANCE),
        (Subject(dropped_term=True), e.ANGULAR_MOMENTUM_ANGLE),
        (Subject(ghost=True), e.GHOST_ANGLE),
        (Subject(), e.ANGULAR_MOMENTUM),
    ],
)
def test_what_tells_most_of_a_flight_is_in_the_tab_in_front(subject: Subject, told_by: str) -> None:
    # Every plot is among those for debugging; one that is made twice is in the lesson too.
    assert len(layout("lesson", subject).plots[told_by]) == 2


def test_the_box_is_shown_around_a_body_whose_principal_axes_are_not_those_of_its_drawing() -> None:
    assert skewed(np.asarray(read_scene("l_bracket", {}).setup.body.inertia))
    for straight in ("book", "t_handle", "hollow_box", "spinning_top"):
        assert not skewed(np.asarray(read_scene(straight, {}).setup.body.inertia)), straight
    hidden = f"- /{e.BOUNDING_BOX}/**"
    shown = {k: str(layout("lesson", Subject(skewed=k)).body_views[0].contents) for k in (False, True)}
    assert hidden in shown[False] and hidden not in shown[True]


def test_no_curve_lies_on_the_edge_of_its_plot() -> None:
    ranges = Ranges()
    ranges.note(e.ENERGY, np.array([[0.0, 50.64], [0.0, np.nan]]))
    ranges.note(e.ENERGY, np.array([[-3.0, 2.0]]))
    ranges.note(e.ANGULAR_MOMENTUM_ANGLE, np.array([3e-14]))
    axes = ranges.axes()
    low, high = axes[e.ENERGY]
    assert low - 1e-9 < -8.0 or low < -3.0
    assert low < -3.0 and high > 50.64
    # Rounding of a constant isn't blown up.
    assert np.ptp(axes[e.ANGULAR_MOMENTUM_ANGLE]) >= 1.0


def test_page_and_recording_name_energies_and_components_alike() -> None:
    names = [name for name, _ in e.SERIES[e.ENERGY]]
    assert names[:3] == ["translational", "rotational", "gravity"] == [name for name, _ in appearance.ENERGY_SERIES]
    assert e.SERIES[e.ANGULAR_VELOCITY_PRINCIPAL] is appearance.OMEGA_SERIES


def column(path, entity: str, component: str) -> list:
    return [
        value
        for found, static, batch in record_batches(path)
        if found == entity and not static and component in batch.schema.names
        for value in batch.column(component).to_pylist()
    ]


def test_the_recording_of_a_body_on_a_string_draws_the_strings_line_through_the_com_at_rest(tmp_path) -> None:
    path = tmp_path / "plumb_line.rrd"
    assert main(["simulate", "plumb_line", "--duration", "40", "--record", str(path), "--json"]) == 0
    distances = np.ravel(column(path, e.STRING_LINE_DISTANCE, "Scalars:scalars"))
    size = float(np.linalg.norm(read_scene("plumb_line", {}).setup.surface.extent))
    assert distances[0] > 0.1 * size and distances[-1] < 1e-3 * size  # measured 0.12 m and 1e-5 m
    line = np.array(column(path, e.STRING_LINE, "LineStrips3D:strips")[-1][0])
    com = np.array(column(path, e.CENTRE, "Transform3D:translation")[-1][0])
    along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    assert np.linalg.norm(np.cross(along, com - line[0])) < 1e-3 * size
    assert np.dot(along, com - line[0]) > 0.0  # on from the knot, not back to the hand


def test_a_body_that_grows_is_kept_in_sight_without_another_layout(tmp_path, monkeypatch) -> None:
    sent = []
    send = BlueprintStream.send
    monkeypatch.setattr(BlueprintStream, "send", lambda stream, recording: sent.append(1) or send(stream, recording))
    script = tmp_path / "grow.yaml"
    script.write_text(
        "".join(
            f"- {{t: {t}, set: {{scale: [{factor}, {factor}, {factor}]}}}}\n" for t, factor in ((0.1, 1.5), (0.2, 5.0))
        )
    )
    path = tmp_path / "grow.rrd"
    words = ["simulate", "hammer", "--script", str(script), "--duration", "0.3", "--record", str(path), "--json"]
    assert main(words) == 0
    # One at the start, which is what a viewer arranges anew; one for the axes of the plots when the file is complete.
    assert len(sent) == 2
    scales = [scale[0] for (scale,) in column(path, e.VIEW, "Transform3D:scale")]
    assert len(scales) == 2 and scales[1] / scales[0] == pytest.approx(5.0, rel=1e-6)


def test_a_finished_recording_says_how_far_its_plots_reach(tmp_path) -> None:
    path = tmp_path / "thrown.rrd"
    assert main(["simulate", "thrown_hammer", "--duration", "1", "--record", str(path), "--json"]) == 0
    reader = RrdReader(str(path))
    (blueprint,) = reader.blueprints()
    ends = [
        end
        for chunk in reader.stream(store=blueprint)
        if chunk.entity_path.endswith("/ScalarAxis")
        for end in chunk.to_record_batch().column("ScalarAxis:range").to_pylist()
    ]
    # The height of the COM goes from 1.5 m to 2.77 m and back.
    assert any(low <= -0.5 and 3.0 <= high <= 5.0 for ((low, high),) in ends), ends
    com = np.array([points[-1] for points in column(path, e.COM_TRAIL, "Points3D:positions")])
    assert com[:, 2].max() == pytest.approx(2.77, abs=0.02) and abs(com[:, 1]).max() < 1e-6


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.5, 3.0, math.pi - 1e-6, math.pi])
def test_angles_are_accurate_at_both_ends(angle: float) -> None:
    other = np.array([math.cos(angle), math.sin(angle), 0.0])
    assert angle_to(np.array([2.0, 0.0, 0.0]), 5.0 * other[np.newaxis])[0] == pytest.approx(angle, rel=1e-9, abs=1e-16)
    assert angle_to(np.zeros(3), other[np.newaxis])[0] == 0.0


@pytest.mark.parametrize("ends", [(0.0, 5.5), (-6.0, 6.0), (-0.2, 0.9), (0.98, 1.03), (-3e-16, 8e-16), (-6.4, -5.8)])
def test_an_axis_has_two_ticks_whose_numbers_can_be_read(ends: tuple[float, float]) -> None:
    low, high = with_two_ticks(*ends)
    assert low <= ends[0] and high >= ends[1]
    # Rerun numbers ticks at one power of ten, and only where no more than some five of them lie on the axis of a small plot.
    step = 10.0 ** math.ceil(math.log10((high - low) / 5.0) - 1e-9)
    assert math.floor(high / step) - math.ceil(low / step) >= 1
    assert high - low <= 4.0 * (ends[1] - ends[0])


def test_a_legend_lies_beside_the_curves_and_never_over_them() -> None:
    made = layout("lesson", Subject()).plots[e.ENERGY]
    for view in made:
        (axis,) = view.properties["TimeAxis"].view_range.as_arrow_array().to_pylist()
        (ranges,) = [view.properties["VisibleTimeRanges"]]
        ends = [r["range"]["end"] for r in ranges.ranges.as_arrow_array().to_pylist()]
        assert all(end == 0 for end in ends), ends  # curves end at the cursor
        assert axis["end"] >= 0.44 * 1e9 * 20.0, axis  # and room for the legend follows
