# SPDX-License-Identifier: MIT
"""How a viewer arranges a flight when it opens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import rerun.blueprint as rrb

from . import entities as e

TRAIL_SECONDS = 3.0
"""[simulated s] Length of the trail shown behind the body."""

HERPOLHODE_SECONDS = 20.0

BACKGROUND = (24, 27, 34)


@dataclass(frozen=True)
class Layout:
    """A blueprint, and those of its views whose camera stands as far away as the body is large."""

    blueprint: Any
    flights: tuple[Any, ...]


def layout(size: float, initial_view: str, ghost: bool) -> Layout:
    """For a body of this size [m]: three tabs, ``initial_view`` in front; ``ghost`` if there is one."""
    flights = (
        flight_view(size, "Flight", LESSON),
        flight_view(size, "All shapes", DEBUGGING),
        flight_view(size, "Plain", PLAIN),
    )
    tabs = {"lesson": lesson(flights[0], ghost), "debugging": debugging(flights[1]), "plain": flights[2]}
    blueprint = rrb.Blueprint(
        rrb.Tabs(*tabs.values(), active_tab=list(tabs).index(initial_view)),
        rrb.TimePanel(state="collapsed", timeline=e.SIM_TIME),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )
    return Layout(blueprint, flights)


def camera(size: float) -> Any:
    """Looks at the body, of this size [m], from where it can be seen whole."""
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=[0.95 * size, -0.75 * size, 0.5 * size],
        look_target=[0.0, 0.0, 0.0],
        eye_up=[0.0, 0.0, 1.0],
    )


def lesson(flight: Any, ghost: bool) -> Any:
    """How the tensor governs the motion: the flight, Poinsot's construction, what is conserved and what isn't."""
    return rrb.Horizontal(
        rrb.Vertical(flight, command_view(), row_shares=[5, 1]),
        rrb.Vertical(
            poinsot_view(),
            # Beside a ghost, how far the two have come apart matters more than the energy, which both keep.
            *([plot(e.GHOST_ANGLE, "Angle of the ghost to the body [rad]")] if ghost else []),
            plot(e.ANGULAR_VELOCITY_BODY, "Angular velocity, body [rad/s]"),
            plot(e.ANGULAR_MOMENTUM, "Angular momentum, world [kg m²/s]"),
            *([] if ghost else [plot(e.ENERGY, "Energy [J]")]),
            row_shares=[3, 2, 2, 2],
        ),
        column_shares=[3, 2],
        name="Lesson",
    )


def debugging(flight: Any) -> Any:
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
        rrb.Grid(
            plot(e.ENERGY, "Energy [J]"),
            plot(e.ANGULAR_VELOCITY_BODY, "Angular velocity, body [rad/s]"),
            plot(e.ANGULAR_MOMENTUM, "Angular momentum, world [kg m²/s]"),
            plot(e.ANGULAR_MOMENTUM_ANGLE, "Angle of L to its start [rad]"),
            plot(e.DRIFT, "Drift since the last command"),
            plot(e.GHOST_ANGLE, "Angle of the ghost to the body [rad]"),
            plot(e.STRING_TENSION, "Tension of the string [N]"),
            plot(e.EFFORT, "Effort per simulated second"),
            grid_columns=2,
        ),
        name="Debugging",
    )


# What the flight views leave out; everything else below ``world`` is shown.
LESSON = (e.BOUNDING_BOX, e.INERTIA_BOX, e.INERTIA_ELLIPSOID)
DEBUGGING: tuple[str, ...] = ()
PLAIN = (*LESSON, e.BODY_AXES, e.ANGULAR_VELOCITY, e.MOMENTUM, e.TRAIL)


def flight_view(size: float, name: str, hidden: tuple[str, ...]) -> Any:
    """The body in the world, followed by the camera, with its trail."""
    return rrb.Spatial3DView(
        origin="/" + e.CENTRE,
        contents=[f"+ /{e.WORLD}/**", *(f"- /{entity}/**" for entity in hidden)],
        name=name,
        background=list(BACKGROUND),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=camera(size),
        overrides={"/" + e.TRAIL: [] if e.TRAIL in hidden else [_last_seconds(TRAIL_SECONDS)]},
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
            kind=rrb.Eye3DKind.Orbital, position=[2.5, -2.0, 1.0], look_target=[0.0, 0.0, -0.4], eye_up=[0.0, 0.0, 1.0]
        ),
        overrides={"/" + e.POINSOT_HERPOLHODE: [_last_seconds(HERPOLHODE_SECONDS)]},
    )


def _last_seconds(seconds: float) -> Any:
    """Shows what was logged in the last seconds before the cursor, on either timeline."""
    return rrb.VisibleTimeRanges(
        [
            rrb.VisibleTimeRange(
                timeline,
                start=rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds),
                end=rrb.TimeRangeBoundary.cursor_relative(),
            )
            for timeline in (e.SIM_TIME, e.ROS_TIME)
        ]
    )


def command_view() -> Any:
    """Commands as applied and refusals, by simulated time."""
    return rrb.TextLogView(
        origin="log",
        name="Commands",
        columns=rrb.TextLogColumns(timeline_columns=[e.SIM_TIME], text_log_columns=["loglevel", "body"]),
    )


def plot(entity: str, name: str) -> Any:
    """Scalars of one entity over time."""
    legend = rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=len(e.SERIES[entity]) > 1)
    return rrb.TimeSeriesView(origin="/" + entity, name=name, plot_legend=legend)
