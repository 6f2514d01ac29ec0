# SPDX-License-Identifier: MIT
"""How a viewer arranges a flight when it opens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from . import appearance
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

BACKGROUND = (24, 27, 34)


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


@dataclass(frozen=True)
class Layout:
    """A blueprint, its views of the body, and its plots by entity."""

    blueprint: Any
    body_views: tuple[Any, ...]
    plots: dict[str, list[Any]]


class PlotViews:
    """Makes plots, and remembers which."""

    def __init__(self) -> None:
        self.made: dict[str, list[Any]] = {}

    def plot(self, entity: str) -> Any:
        """Scalars of one entity over time."""
        view = rrb.TimeSeriesView(
            origin="/" + entity,
            name=TITLES[entity],
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=len(e.SERIES[entity]) > 1),
            axis_x=time_axis(),
            time_ranges=_up_to_cursor(rrb.TimeRangeBoundary.infinite()),
        )
        self.made.setdefault(entity, []).append(view)
        return view


def _title(name: str, unit: str) -> str:
    return f"{name} [{unit}]"


TITLES = {
    e.ENERGY: _title(appearance.ENERGY_TITLE, appearance.ENERGY_UNIT),
    e.ANGULAR_VELOCITY_PRINCIPAL: _title(appearance.OMEGA_TITLE, appearance.OMEGA_UNIT),
    e.ANGULAR_MOMENTUM: _title(appearance.MOMENTUM_TITLE, appearance.MOMENTUM_UNIT),
    e.ANGULAR_MOMENTUM_ANGLE: _title(appearance.MOMENTUM_ANGLE_TITLE, appearance.ANGLE_UNIT),
    e.GHOST_ANGLE: _title(appearance.GHOST_ANGLE_TITLE, appearance.ANGLE_UNIT),
    e.POSITION: "Position of the COM [m]",
    e.STRING_TENSION: "Tension of the string [N]",
    e.STRING_LINE_DISTANCE: "Distance of the COM from the string's line [m]",
    e.DRIFT: "Drift since the last command",
    e.EFFORT: "Effort per simulated second",
}


def layout(initial_view: str, subject: Subject) -> Layout:
    """Three tabs, ``initial_view`` in front."""
    plots = PlotViews()
    lesson_hides = tuple(entity for entity in LESSON if not (subject.boxed and entity == e.BOUNDING_BOX))
    body_views = (
        body_view("Motion", lesson_hides, subject),
        body_view("All shapes", DEBUGGING, subject),
        body_view("Plain", PLAIN, subject),
    )
    tabs = {
        "lesson": lesson_layout(body_views[0], subject, plots),
        "debugging": debugging(body_views[1], plots),
        "plain": body_views[2],
    }
    blueprint = rrb.Blueprint(
        rrb.Tabs(*tabs.values(), active_tab=list(tabs).index(initial_view)),
        rrb.TimePanel(state="collapsed", timeline=e.SIM_TIME),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )
    return Layout(blueprint, body_views, plots.made)


def camera(subject: Subject) -> Any:
    """Looks at the body from where it can be seen whole, or its path where that is what matters; in body sizes."""
    if subject.falls:
        # Beside the plane of a throw along x, and above the body, where it has come from.
        middle = np.array([-0.1, 0.0, 0.2])
        return _orbital(PATH_SIZES * (middle + [0.3, -1.2, 0.2]), PATH_SIZES * middle)
    return _orbital(np.array([0.95, -0.75, 0.5]), np.zeros(3))


def _orbital(position: np.ndarray, target: np.ndarray) -> Any:
    return rrb.EyeControls3D(kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=[0.0, 0.0, 1.0])


def lesson_layout(flight: Any, subject: Subject, plots: PlotViews) -> Any:
    """How the tensor governs the motion: the flight, and beside it what tells most of a flight of its kind."""
    if subject.ghost:
        # How far the two have come apart matters more than the energy, which both keep.
        beside = [poinsot_view(), e.GHOST_ANGLE, e.ANGULAR_VELOCITY_PRINCIPAL, e.ANGULAR_MOMENTUM]
    elif subject.dropped_term:
        beside = [e.ANGULAR_MOMENTUM_ANGLE, e.ANGULAR_MOMENTUM, e.ENERGY]
    elif subject.tied:
        beside = [e.STRING_LINE_DISTANCE, e.STRING_TENSION, e.ENERGY]
    elif subject.falls:
        beside = [e.POSITION, e.ANGULAR_VELOCITY_PRINCIPAL, e.ENERGY]
    else:
        beside = [poinsot_view(), e.ANGULAR_VELOCITY_PRINCIPAL, e.ANGULAR_MOMENTUM, e.ENERGY]
    views = [plots.plot(view) if isinstance(view, str) else view for view in beside]
    return rrb.Horizontal(
        rrb.Vertical(flight, command_view(), row_shares=[5, 1]),
        # Nearly equal shares: a smaller plot has no room for the four lines of a legend.
        rrb.Vertical(*views, row_shares=[4 if isinstance(view, str) else 5 for view in beside]),
        column_shares=[3, 2],
        name="Lesson",
    )


def debugging(flight: Any, plots: PlotViews) -> Any:
    """Everything that is logged: every plot, the state line, the event lines as they are."""
    return rrb.Horizontal(
        rrb.Vertical(
            flight,
            rrb.StateTimelineView(origin=e.STATUS, name="State"),
            rrb.Tabs(
                rrb.TextLogView(origin=e.EVENTS, name="Events"),
                command_view(),
                rrb.TextDocumentView(origin=e.SCENE, name="Scene"),
            ),
            row_shares=[9, 9, 4],
        ),
        rrb.Grid(*(plots.plot(entity) for entity in TITLES), grid_columns=2),
        name="Debugging",
    )


# What the flight views leave out; everything else below ``world`` is shown.
LESSON = (e.BOUNDING_BOX, e.INERTIA_BOX, e.INERTIA_ELLIPSOID)
DEBUGGING: tuple[str, ...] = ()
PLAIN = (*LESSON, e.BODY_AXES, e.ANGULAR_VELOCITY, e.MOMENTUM, e.TRAIL, e.COM_TRAIL, e.STRING_LINE)


def body_view(name: str, hidden: tuple[str, ...], subject: Subject) -> Any:
    """The body in the world, followed by the camera, with its trail."""
    return rrb.Spatial3DView(
        origin="/" + e.VIEW,
        contents=[f"+ /{e.WORLD}/**", *(f"- /{entity}/**" for entity in hidden)],
        name=name,
        background=list(BACKGROUND),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=camera(subject),
        overrides={
            "/" + trail: [] if trail in hidden else [_last_seconds(seconds)]
            for trail, seconds in (
                (e.TRAIL, TRAIL_SECONDS),
                (e.COM_TRAIL, FAR_SECONDS if subject.falls else TRAIL_SECONDS),
            )
        },
    )


def poinsot_view() -> Any:
    """The ellipsoid of inertia rolling on the invariable plane."""
    return rrb.Spatial3DView(
        origin="/" + e.POINSOT,
        contents="$origin/**",
        name="Poinsot: the inertia ellipsoid rolls on the invariable plane",
        background=list(BACKGROUND),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=[2.8, -2.25, 1.1],
            look_target=[0.0, 0.0, -0.45],
            eye_up=[0.0, 0.0, 1.0],
        ),
        overrides={"/" + e.POINSOT_HERPOLHODE: [_last_seconds(HERPOLHODE_SECONDS)]},
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


def time_axis(duration_s: float | None = None) -> Any:
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
