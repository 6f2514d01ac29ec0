# SPDX-License-Identifier: MIT
"""The initial layout of a viewer: the body, its commands, and the most informative plots of the flight."""

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
"""[simulated s] Time span of the plots of a running flight; plots of a finished one show all of it."""

LEGEND_ROOM = 0.45
"""Free width for the legend at the right end of a plot, relative to the curves' width; the longest legend takes 0.42 of
a small plot.
"""

LEAST_SPANS = {style.ANGULAR_MOMENTUM_ANGLE: 1.0, style.GHOST_ANGLE: 1.0}
"""[°] Smallest span of an angle's axis, so that rounding errors don't fill the plot."""

NARROWEST = 0.05
"""Smallest span of an axis relative to its largest value, so that rounding errors don't fill the plot."""

NUMBERED_TICKS_MAX = 5.0
"""Largest number of numbered ticks on the axis of a small plot; Rerun numbers the ticks of one power of ten."""

ROOM = 0.08
"""Margin at both ends of an axis, relative to its span, so that no curve lies on the frame and no number on the time
axis.
"""

FLOOR_CELLS, FLOOR_BELOW = 5, 1.0
"""Squares of the floor from its middle to its edge, and its distance below the body in units of the flight's reach."""

FAR_SECONDS = 3600.0
"""[simulated s] Length of the trail of a falling COM: in practice all of it."""

PATH_SIZES = 4.5
"""Factor of the camera's distance for a falling body, whose path is of interest."""

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
"""Parts of the body that are hidden until they are switched on in the viewer's list; a body without a mesh shows its
box.
"""


@dataclass(frozen=True)
class FlightTraits:
    """Properties of a flight that determine the layout. reach [m]: radius about the COM to be visible. mesh: it has a
    mesh. ghost: it has a ghost. falls: under gravity without a string. tied: to a string. dropped_term: the motion
    lacks ω × Iω. rotor: the body has a flywheel.
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
        """The most informative plots of such a flight."""
        if self.ghost:
            # The angle between the two matters more than the energy, which both conserve.
            return [style.GHOST_ANGLE, style.ANGULAR_VELOCITY_PRINCIPAL, style.ANGULAR_MOMENTUM]
        if self.dropped_term:
            return [style.ANGULAR_MOMENTUM_ANGLE, style.ANGULAR_MOMENTUM, style.ENERGY]
        if self.tied:
            return [style.STRING_LINE_DISTANCE, style.ANGULAR_VELOCITY_PRINCIPAL, style.ENERGY]
        if self.falls:
            return [style.POSITION, style.ANGULAR_VELOCITY_PRINCIPAL, style.ENERGY]
        return [style.ANGULAR_VELOCITY_PRINCIPAL, style.ANGULAR_MOMENTUM, style.ENERGY]


@dataclass(frozen=True)
class RunSummary:
    """A complete run. duration_s: simulated time; plotted: smallest and largest value of each plot with values, by
    name; commanded: whether any command was logged.
    """

    duration_s: float
    plotted: dict[str, tuple[float, float]]
    commanded: bool


def blueprint(traits: FlightTraits, finished: RunSummary | None = None) -> Any:
    """The views of a running or finished simulation, without empty ones."""
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
    free = not (traits.dropped_term or traits.tied or traits.falls)
    if (traits.ghost or free) and not traits.rotor:
        # Free rotation: Poinsot's construction, beside the commands, where there is more room than above the plots.
        # Six commands, as `make run` has, are seen without scrolling in a window of 1600 x 900.
        listed = [rrb.Vertical(*below, row_shares=[3, 2][: len(below)])] if below else []
        below = [_poinsot_view(), *listed]
        row_shares = [3, 2]
    flight = _body_view(traits)
    if below:
        flight = rrb.Vertical(flight, rrb.Horizontal(*below), row_shares=row_shares)
    plots = [_plot(name, finished) for name in traits.plots if finished is None or name in finished.plotted]
    return rrb.Blueprint(
        # In a window of 1200 x 675, a legend of four lines fits into each of three plots.
        rrb.Horizontal(flight, rrb.Vertical(*plots), column_shares=[3, 2]),
        rrb.TimePanel(state="collapsed", timeline=e.SIM_TIME),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def floor(traits: FlightTraits, start: Vector3) -> tuple[Any, Any]:
    """A grid of lines below the body's start (3,) [m], and a label with their spacing."""
    apart = _round_below(0.5 * traits.reach)
    half, z = FLOOR_CELLS * apart, float(start[2]) - FLOOR_BELOW * traits.reach
    ends = [(apart * k, sign * half) for k in range(-FLOOR_CELLS, FLOOR_CELLS + 1) for sign in (-1.0, 1.0)]
    across = [[start[0] + u, start[1] + v, z] for u, v in ends]
    along = [[start[0] + v, start[1] + u, z] for u, v in ends]
    strips = [points[k : k + 2] for points in (across, along) for k in range(0, len(points), 2)]
    corner = [[start[0] + half, start[1] - half, z]]
    label = rr.Points3D(corner, colors=[style.GREY], radii=0.0, labels=[f"{apart:g} m"], show_labels=True)
    # A radius below 0 is in points of the screen.
    return rr.LineStrips3D(strips, colors=[style.FLOOR_COLOUR], radii=-0.4), label


def _round_below(length: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that isn't larger than ``length``."""
    power = 10.0 ** math.floor(math.log10(length))
    return next(n * power for n in (5.0, 2.0, 1.0) if n * power <= length or n == 1.0)


def value_axis(low: float, high: float, least: float = 0.0) -> tuple[float, float]:
    """The ends of an axis for values from ``low`` to ``high``, with at least two numbered ticks. least:
    smallest span.
    """
    span = max(high - low, NARROWEST * max(abs(low), abs(high)), least) or 2.0
    middle = 0.5 * (low + high)
    low, high = min(low, middle - 0.5 * span), max(high, middle + 0.5 * span)
    # The ends are numbered ticks plus a margin.
    step = 10.0 ** math.ceil(math.log10((1.0 + 2.0 * ROOM) * (high - low) / NUMBERED_TICKS_MAX))
    low, high = step * math.floor(low / step), step * math.ceil(high / step)
    room = ROOM * (high - low)
    return low - room, high + room


def _plot(name: str, finished: RunSummary | None) -> Any:
    """Scalars of one entity over time. Curves end at the cursor, followed by free width for the legend. All plots show
    the same time span; they aren't linked, because linked plots have no free width.
    """
    boundary = rrb.TimeRangeBoundary
    # Ends relative to the cursor work on both timelines, absolute ones only on one.
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


def _body_view(traits: FlightTraits) -> Any:
    """The body in the world, followed by the camera, with its trail."""
    if traits.falls:
        # Beside the plane of a throw along x, looking at a point above the body, towards its path.
        target = PATH_SIZES * np.array([-0.1, 0.0, 0.2])
        eye = target + PATH_SIZES * np.array([0.3, -1.2, 0.2])
    else:
        # Far enough to show the whole arrow of a force at the body's end, with its label.
        eye, target = np.array([1.65, -1.3, 0.85]), np.zeros(3)
    shown = {style.BOUNDING_BOX} if traits.ghost else set()
    shown |= set() if traits.mesh else {style.INERTIA_BOX}
    hidden = [name for name in HIDDEN if name not in shown]
    overrides: dict[Any, Any] = {"/" + name: rrb.EntityBehavior(visible=False) for name in hidden}
    overrides["/" + style.TRAIL] = _last_seconds(TRAIL_SECONDS)
    overrides["/" + style.COM_TRAIL] = _last_seconds(FAR_SECONDS if traits.falls else TRAIL_SECONDS)
    return _view(style.CENTRE, f"/{style.WORLD}/**", "Motion", traits.reach * eye, traits.reach * target, overrides)


def _poinsot_view() -> Any:
    """The inertia ellipsoid rolling on the invariable plane."""
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
    """The time range of the last ``seconds`` before the cursor, or of all time before it, on both timelines."""
    boundary = rrb.TimeRangeBoundary
    start = boundary.infinite() if seconds is None else boundary.cursor_relative(seconds=-seconds)
    end = boundary.cursor_relative()
    return rrb.VisibleTimeRanges(
        [rrb.VisibleTimeRange(timeline, start=start, end=end) for timeline in (e.SIM_TIME, e.ROS_TIME)]
    )
