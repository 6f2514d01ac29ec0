# SPDX-License-Identifier: MIT
"""How a viewer arranges a flight when it opens: the body, its commands, and the plots that tell most of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ..base.vectors import Vector3
from ..picture import style
from . import backend as e

TRAIL_SECONDS = 3.0
"""[simulated s] Length of the trail shown behind the body."""

HERPOLHODE_SECONDS = 20.0

PLOTTED_SECONDS = 20.0
"""[simulated s] Of the plots of a flight that goes on; those of a recording that has ended show all of it."""

LEGEND_ROOM = 0.45
"""Width left free for the legend at the right end of a plot, in widths of the curves; the longest takes
.42 of a small plot.
"""

LEAST_SPANS = {style.ANGULAR_MOMENTUM_ANGLE: 1.0, style.GHOST_ANGLE: 1.0}
"""[°] That the axis of an angle spans at least: rounding doesn't fill the plot."""

NARROWEST = 0.05
"""Of the largest value: an axis isn't narrower, so that rounding isn't blown up to fill the plot."""

NUMBERED_TICKS_MAX = 5.0
"""Rerun numbers ticks at one power of ten, the least of which no more than these fit on the axis of a small plot."""

ROOM = 0.08
"""Of what is plotted, at both ends of an axis: no curve lies on the frame, and no number on the time axis."""

FLOOR_CELLS, FLOOR_BELOW = 5, 1.0
"""Of the floor: squares from its middle to its edge, and how far below the body it is, in the reach of the flight."""

FAR_SECONDS = 3600.0
"""[simulated s] Of the path of a COM that falls: all of it."""

PATH_SIZES = 4.5
"""How much farther off the camera stands where the path is what matters."""

TITLES = {
    style.ENERGY: f"{style.ENERGY_TITLE} [{style.ENERGY_UNIT}]",
    style.ANGULAR_VELOCITY_PRINCIPAL: f"{style.OMEGA_TITLE} [{style.OMEGA_UNIT}]",
    style.ANGULAR_MOMENTUM: f"{style.MOMENTUM_TITLE} [{style.MOMENTUM_UNIT}]",
    style.ANGULAR_MOMENTUM_ANGLE: f"{style.MOMENTUM_ANGLE_TITLE} [{style.ANGLE_UNIT}]",
    style.GHOST_ANGLE: f"{style.GHOST_ANGLE_TITLE} [{style.ANGLE_UNIT}]",
    style.POSITION: "Position of the COM [m]",
    style.STRING_LINE_DISTANCE: "Distance of the COM from the string's line [m]",
    style.COMMANDED: "Commanded",
}

HIDDEN = (style.BOUNDING_BOX, style.INERTIA_BOX, style.INERTIA_ELLIPSOID, style.PRINCIPAL_AXES)
"""Parts of the body that are shown at a click in the viewer's list; of one without a mesh its box is seen at once."""


@dataclass(frozen=True)
class Subject:
    """What a flight is about, so what is shown of it. reach [m]: how far about the COM it is to be seen. ghost:
    another body beside it. falls: under gravity, on no string. tied: to one. dropped_term: its motion lacks ω × Iω.
    rotor: it has a flywheel. mesh: it has one.
    """

    reach: float = 1.0
    mesh: bool = True
    ghost: bool = False
    falls: bool = False
    tied: bool = False
    dropped_term: bool = False
    rotor: bool = False

    @property
    def plots(self) -> list[str]:
        """What tells most of a flight of its kind."""
        if self.ghost:
            # How far the two have come apart matters more than the energy, which both keep.
            return [style.GHOST_ANGLE, style.ANGULAR_VELOCITY_PRINCIPAL, style.ANGULAR_MOMENTUM]
        if self.dropped_term:
            return [style.ANGULAR_MOMENTUM_ANGLE, style.ANGULAR_MOMENTUM, style.ENERGY]
        if self.tied:
            return [style.STRING_LINE_DISTANCE, style.ANGULAR_VELOCITY_PRINCIPAL, style.ENERGY]
        if self.falls:
            return [style.POSITION, style.ANGULAR_VELOCITY_PRINCIPAL, style.ENERGY]
        return [style.ANGULAR_VELOCITY_PRINCIPAL, style.ANGULAR_MOMENTUM, style.ENERGY]


@dataclass(frozen=True)
class Finished:
    """A run that is complete: duration_s [simulated], the least and the largest value of each plot that has any, by
    name, and whether any command was logged.
    """

    duration_s: float
    plotted: dict[str, tuple[float, float]]
    commanded: bool


def blueprint(subject: Subject, finished: Finished | None = None) -> Any:
    """The views of a running or a finished simulation, without those that have nothing to show."""
    below = []
    if finished is None or finished.commanded:
        commands = rrb.TextLogView(
            origin="/",
            contents=[f"/{e.EVENTS}", f"/{e.REFUSALS}", f"/{e.ACCURACY}"],
            name="Commands",
            columns=rrb.TextLogColumns(timeline_columns=[e.SIM_TIME], text_log_columns=["body"]),
        )
        below.append(commands)
        if finished is None or style.COMMANDED in finished.plotted:
            below.append(_plot(style.COMMANDED, finished))
    row_shares = [4, 1]
    free = not (subject.dropped_term or subject.tied or subject.falls)
    if (subject.ghost or free) and not subject.rotor:
        # It turns freely. Beside the commands there is more room than above the plots.
        below = [_poinsot_view(), *([rrb.Vertical(*below)] if below else [])]
        row_shares = [3, 2]
    flight = _body_view(subject)
    if below:
        flight = rrb.Vertical(flight, rrb.Horizontal(*below), row_shares=row_shares)
    plots = [_plot(name, finished) for name in subject.plots if finished is None or name in finished.plotted]
    return rrb.Blueprint(
        # Three plots have room for the four lines of a legend in a window of 1200 x 675.
        rrb.Horizontal(flight, rrb.Vertical(*plots), column_shares=[3, 2]),
        rrb.TimePanel(state="collapsed", timeline=e.SIM_TIME),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def floor(subject: Subject, start: Vector3) -> tuple[Any, Any]:
    """A square of lines below where the body starts (3,) [m], and the label that says how far apart they are."""
    apart = _round_below(0.5 * subject.reach)
    half, z = FLOOR_CELLS * apart, float(start[2]) - FLOOR_BELOW * subject.reach
    ends = [(apart * k, sign * half) for k in range(-FLOOR_CELLS, FLOOR_CELLS + 1) for sign in (-1.0, 1.0)]
    across = [[start[0] + u, start[1] + v, z] for u, v in ends]
    along = [[start[0] + v, start[1] + u, z] for u, v in ends]
    strips = [points[k : k + 2] for points in (across, along) for k in range(0, len(points), 2)]
    corner = [[start[0] + half, start[1] - half, z]]
    label = rr.Points3D(corner, colors=[style.GREY], radii=0.0, labels=[f"{apart:g} m"], show_labels=True)
    # A radius below 0 is in points of the screen.
    return rr.LineStrips3D(strips, colors=[style.FLOOR_COLOUR], radii=-0.4), label


def _round_below(length: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that isn't longer."""
    power = 10.0 ** math.floor(math.log10(length))
    return next(n * power for n in (5.0, 2.0, 1.0) if n * power <= length or n == 1.0)


def value_axis(low: float, high: float, least: float = 0.0) -> tuple[float, float]:
    """The ends of an axis for values from ``low`` to ``high``, on which two ticks have numbers. ``least``: it spans no
    less.
    """
    span = max(high - low, NARROWEST * max(abs(low), abs(high)), least) or 2.0
    middle = 0.5 * (low + high)
    low, high = min(low, middle - 0.5 * span), max(high, middle + 0.5 * span)
    # The ends are numbered ticks, and no curve lies on the frame.
    step = 10.0 ** math.ceil(math.log10((1.0 + 2.0 * ROOM) * (high - low) / NUMBERED_TICKS_MAX))
    low, high = step * math.floor(low / step), step * math.ceil(high / step)
    room = ROOM * (high - low)
    return low - room, high + room


def _plot(name: str, finished: Finished | None) -> Any:
    """Scalars of one entity over time. Curves end at the cursor, and room for the legend follows: all plots show the
    same time, without being linked, as linked ones know no room.
    """
    boundary = rrb.TimeRangeBoundary
    # Ends relative to the cursor hold on both timelines, absolute ones on one alone.
    start = boundary.cursor_relative(seconds=-PLOTTED_SECONDS) if finished is None else boundary.infinite()
    room_s = LEGEND_ROOM * (PLOTTED_SECONDS if finished is None else finished.duration_s)
    ends = None if finished is None else value_axis(*finished.plotted[name], LEAST_SPANS.get(name, 0.0))
    return rrb.TimeSeriesView(
        origin="/" + name,
        name=TITLES[name],
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=len(style.SERIES[name]) > 1),
        axis_x=rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=boundary.cursor_relative(seconds=room_s))),
        time_ranges=_last_seconds(),
        axis_y=None if ends is None else rrb.ScalarAxis(range=ends),
    )


def _body_view(subject: Subject) -> Any:
    """The body in the world, followed by the camera, with its trail."""
    if subject.falls:
        # Beside the plane of a throw along x, and above the body, where it has come from.
        target = PATH_SIZES * np.array([-0.1, 0.0, 0.2])
        eye = target + PATH_SIZES * np.array([0.3, -1.2, 0.2])
    else:
        # So far off that the arrow of a force at the body's end is seen whole, with its label.
        eye, target = np.array([1.65, -1.3, 0.85]), np.zeros(3)
    shown = {style.BOUNDING_BOX} if subject.ghost else set()
    shown |= set() if subject.mesh else {style.INERTIA_BOX}
    hidden = [name for name in HIDDEN if name not in shown]
    overrides: dict[Any, Any] = {"/" + name: rrb.EntityBehavior(visible=False) for name in hidden}
    overrides["/" + style.TRAIL] = _last_seconds(TRAIL_SECONDS)
    overrides["/" + style.COM_TRAIL] = _last_seconds(FAR_SECONDS if subject.falls else TRAIL_SECONDS)
    return _view(style.CENTRE, f"/{style.WORLD}/**", "Motion", subject.reach * eye, subject.reach * target, overrides)


def _poinsot_view() -> Any:
    """The ellipsoid of inertia rolling on the invariable plane."""
    name = "Poinsot: the ellipsoid of inertia rolls"
    overrides = {"/" + style.POINSOT_HERPOLHODE: _last_seconds(HERPOLHODE_SECONDS)}
    eye, target = np.array([2.1, -1.65, 0.75]), np.array([0.0, 0.0, -0.35])
    return _view(style.POINSOT, "$origin/**", name, eye, target, overrides)


def _view(origin: str, contents: str, name: str, eye: Vector3, target: Vector3, overrides: dict[Any, Any]) -> Any:
    return rrb.Spatial3DView(
        origin="/" + origin,
        contents=contents,
        name=name,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye, look_target=target, eye_up=[0.0, 0.0, 1.0]
        ),
        overrides=overrides,
    )


def _last_seconds(seconds: float | None = None) -> Any:
    """Shows what was logged in the last seconds before the cursor, or all before it, on either timeline."""
    boundary = rrb.TimeRangeBoundary
    start = boundary.infinite() if seconds is None else boundary.cursor_relative(seconds=-seconds)
    end = boundary.cursor_relative()
    return rrb.VisibleTimeRanges(
        [rrb.VisibleTimeRange(timeline, start=start, end=end) for timeline in (e.SIM_TIME, e.ROS_TIME)]
    )
