# SPDX-License-Identifier: MIT
"""How a viewer arranges a flight when it opens."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ..picture import style
from . import entities as e

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

FAR_SECONDS = 3600.0
"""[simulated s] Of the path of a COM that falls: all of it."""

PATH_SIZES = 4.5
"""How much farther off the camera stands where the path is what matters."""


@dataclass(frozen=True)
class Subject:
    """What a flight is about, so what is shown of it first. ghost: another body beside it. falls: under gravity, on no
    string. tied: to a string from the start. dropped_term: its motion lacks ω × Iω. skewed: its principal axes aren't
    those of its drawing, as the box around it shows.
    """

    ghost: bool = False
    falls: bool = False
    tied: bool = False
    dropped_term: bool = False
    skewed: bool = False

    @property
    def boxed(self) -> bool:
        """Whether the bounding box is shown around the body."""
        return self.ghost or self.skewed


def _title(name: str, unit: str) -> str:
    return f"{name} [{unit}]"


TITLES = {
    style.ENERGY: _title(style.ENERGY_TITLE, style.ENERGY_UNIT),
    style.ANGULAR_VELOCITY_PRINCIPAL: _title(style.OMEGA_TITLE, style.OMEGA_UNIT),
    style.ANGULAR_MOMENTUM: _title(style.MOMENTUM_TITLE, style.MOMENTUM_UNIT),
    style.ANGULAR_MOMENTUM_ANGLE: _title(style.MOMENTUM_ANGLE_TITLE, style.ANGLE_UNIT),
    style.GHOST_ANGLE: _title(style.GHOST_ANGLE_TITLE, style.ANGLE_UNIT),
    style.POSITION: "Position of the COM [m]",
    style.STRING_TENSION: "Tension of the string [N]",
    style.STRING_LINE_DISTANCE: "Distance of the COM from the string's line [m]",
    style.EFFORT: "Effort per simulated second",
}

LESSON_HIDES = (style.BOUNDING_BOX, style.INERTIA_BOX, style.INERTIA_ELLIPSOID, style.PRINCIPAL_AXES)
PLAIN_HIDES = (
    *(*LESSON_HIDES, style.BODY_AXES, style.OMEGA, style.MOMENTUM),
    *(style.TRAIL, style.COM_TRAIL, style.STRING_LINE),
)
"""What views of the body leave out; everything else below ``world`` is shown."""


@dataclass(frozen=True)
class Finished:
    """A run that is complete: duration_s [simulated], the least and the largest value of each plot that has any, by
    name, and whether any command was logged.
    """

    duration_s: float
    plotted: dict[str, tuple[float, float]]
    commanded: bool


def value_axis(low: float, high: float, least: float = 0.0) -> tuple[float, float]:
    """The ends of an axis for values from ``low`` to ``high``, on which two ticks have numbers. ``least``: it spans no
    less.
    """
    span = max(high - low, NARROWEST * max(abs(low), abs(high)), least) or 2.0
    middle = 0.5 * (low + high)
    low, high = min(low, middle - 0.5 * span), max(high, middle + 0.5 * span)
    step = 10.0 ** math.ceil(math.log10((1.0 + 2.0 * ROOM) * (high - low) / NUMBERED_TICKS_MAX))
    first, last = math.ceil(low / step), math.floor(high / step)
    if last < first:
        low, high = step * last, step * first
    elif last == first:
        # One tick: up or down to the next one, whichever is nearer.
        up, down = step * (first + 1), step * (first - 1)
        low, high = (low, up) if up - high <= low - down else (down, high)
    room = ROOM * (high - low)
    # A tick that the room would reach has room of its own.
    below, above = step * math.floor(low / step), step * math.ceil(high / step)
    low = below if below >= low - room else low
    high = above if above <= high + room else high
    return low - room, high + room


class Layout:
    """Makes the views for what a flight is about; of one that goes on all that may come to show something, of one that
    is finished those that do.
    """

    def __init__(self, subject: Subject, finished: Finished | None = None) -> None:
        self._subject = subject
        self._finished = finished

    def blueprint(self) -> Any:
        """Three tabs, the lesson in front."""
        boxed = self._subject.boxed
        hidden = tuple(name for name in LESSON_HIDES if not (boxed and name == style.BOUNDING_BOX))
        return rrb.Blueprint(
            rrb.Tabs(
                self._lesson(self._body_view("Motion", hidden)),
                self._debugging(self._body_view("All shapes", ())),
                self._body_view("Plain", PLAIN_HIDES),
            ),
            rrb.TimePanel(state="collapsed", timeline=e.SIM_TIME),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
            auto_views=False,
        )

    def _lesson(self, flight: Any) -> Any:
        """How the tensor governs the motion: the flight, and beside it what tells most of a flight of its kind."""
        subject = self._subject
        poinsot = [poinsot_view()]
        if subject.ghost:
            # How far the two have come apart matters more than the energy, which both keep.
            names = [style.GHOST_ANGLE, style.ANGULAR_VELOCITY_PRINCIPAL, style.ANGULAR_MOMENTUM]
        elif subject.dropped_term:
            poinsot = []
            names = [style.ANGULAR_MOMENTUM_ANGLE, style.ANGULAR_MOMENTUM, style.ENERGY]
        elif subject.tied:
            poinsot = []
            names = [style.STRING_LINE_DISTANCE, style.STRING_TENSION, style.ENERGY]
        elif subject.falls:
            poinsot = []
            names = [style.POSITION, style.ANGULAR_VELOCITY_PRINCIPAL, style.ENERGY]
        else:
            names = [style.ANGULAR_VELOCITY_PRINCIPAL, style.ANGULAR_MOMENTUM, style.ENERGY]
        plots = [self._plot(name) for name in names if self._shows(name)]
        if self._finished is None or self._finished.commanded:
            flight = rrb.Vertical(flight, command_view(), row_shares=[5, 1])
        return rrb.Horizontal(
            flight,
            # Nearly equal shares: a smaller plot has no room for the four lines of a legend.
            rrb.Vertical(*poinsot, *plots, row_shares=[5] * len(poinsot) + [4] * len(plots)),
            column_shares=[3, 2],
            name="Lesson",
        )

    def _debugging(self, flight: Any) -> Any:
        """Everything that is logged: every plot, the state line, the event lines as they are."""
        # A container of one view would be taken for the view by the viewer, but not by who looks for it by name.
        logs = rrb.TextDocumentView(origin=e.SCENE, name="Scene")
        if self._finished is None or self._finished.commanded:
            logs = rrb.Tabs(rrb.TextLogView(origin=e.EVENTS, name="Events"), command_view(), logs)
        return rrb.Horizontal(
            rrb.Vertical(
                flight,
                rrb.StateTimelineView(origin=e.STATUS, name="State"),
                logs,
                row_shares=[9, 9, 4],
            ),
            rrb.Grid(*(self._plot(name) for name in TITLES if self._shows(name)), grid_columns=2),
            name="Debugging",
        )

    def _shows(self, plot: str) -> bool:
        """Whether a plot has, or may come to have, something to show."""
        if self._finished is not None:
            return plot in self._finished.plotted
        return self._subject.ghost or plot != style.GHOST_ANGLE

    def _plot(self, name: str) -> Any:
        """Scalars of one entity over time."""
        finished = self._finished
        ends = None if finished is None else value_axis(*finished.plotted[name], LEAST_SPANS.get(name, 0.0))
        return rrb.TimeSeriesView(
            origin="/" + name,
            name=TITLES[name],
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=len(style.SERIES[name]) > 1),
            axis_x=_time_axis(None if finished is None else finished.duration_s),
            time_ranges=_up_to_cursor(rrb.TimeRangeBoundary.infinite()),
            axis_y=None if ends is None else rrb.ScalarAxis(range=ends),
        )

    def _body_view(self, name: str, hidden: tuple[str, ...]) -> Any:
        """The body in the world, followed by the camera, with its trail."""
        return rrb.Spatial3DView(
            origin="/" + e.VIEW,
            contents=[f"+ /{style.WORLD}/**", *(f"- /{entity}/**" for entity in hidden)],
            name=name,
            line_grid=rrb.LineGrid3D(visible=False),
            eye_controls=camera(self._subject),
            overrides={
                "/" + trail: [] if trail in hidden else [_last_seconds(seconds)]
                for trail, seconds in (
                    (style.TRAIL, TRAIL_SECONDS),
                    (style.COM_TRAIL, FAR_SECONDS if self._subject.falls else TRAIL_SECONDS),
                )
            },
        )


def camera(subject: Subject) -> Any:
    """Looks at the body from where it can be seen whole, or its path where that is what matters; in body sizes."""
    if subject.falls:
        # Beside the plane of a throw along x, and above the body, where it has come from.
        middle = np.array([-0.1, 0.0, 0.2])
        return _orbital(PATH_SIZES * (middle + [0.3, -1.2, 0.2]), PATH_SIZES * middle)
    # So far off that the arrow of a force at the body's end is seen whole, with its label.
    return _orbital(np.array([1.65, -1.3, 0.85]), np.zeros(3))


def _orbital(position: np.ndarray, target: np.ndarray) -> Any:
    return rrb.EyeControls3D(kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=[0.0, 0.0, 1.0])


def poinsot_view() -> Any:
    """The ellipsoid of inertia rolling on the invariable plane."""
    return rrb.Spatial3DView(
        origin="/" + style.POINSOT,
        contents="$origin/**",
        name="Poinsot: the inertia ellipsoid rolls on the invariable plane",
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=[2.8, -2.25, 1.1],
            look_target=[0.0, 0.0, -0.45],
            eye_up=[0.0, 0.0, 1.0],
        ),
        overrides={"/" + style.POINSOT_HERPOLHODE: [_last_seconds(HERPOLHODE_SECONDS)]},
    )


def _last_seconds(seconds: float) -> Any:
    """Shows what was logged in the last seconds before the cursor."""
    return _up_to_cursor(rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds))


def _up_to_cursor(start: Any) -> Any:
    """What was logged from ``start`` to the cursor, on either timeline."""
    end = rrb.TimeRangeBoundary.cursor_relative()
    return rrb.VisibleTimeRanges(
        [rrb.VisibleTimeRange(timeline, start=start, end=end) for timeline in (e.SIM_TIME, e.ROS_TIME)]
    )


def _time_axis(duration_s: float | None = None) -> Any:
    """Time axis of the plots of a run that has ended after ``duration_s``, or that goes on. Curves end at the cursor,
    and room for the legend follows. Ends relative to the cursor hold on both timelines, absolute ones on one alone.
    """
    boundary = rrb.TimeRangeBoundary
    start = boundary.cursor_relative(seconds=-PLOTTED_SECONDS) if duration_s is None else boundary.infinite()
    room_s = LEGEND_ROOM * (PLOTTED_SECONDS if duration_s is None else duration_s)
    return rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=boundary.cursor_relative(seconds=room_s)))


def command_view() -> Any:
    """Commands as applied and refusals, by simulated time."""
    return rrb.TextLogView(
        origin="log",
        name="Commands",
        columns=rrb.TextLogColumns(timeline_columns=[e.SIM_TIME], text_log_columns=["loglevel", "body"]),
    )
