# SPDX-License-Identifier: MIT
"""How a viewer arranges a flight when it opens: the body on the left, plots on the right, what was said below."""

from __future__ import annotations

from typing import Any

import rerun.blueprint as rrb

from . import entities as e

TRAIL_SECONDS = 3.0
"""[simulated s] Length of the trail shown behind the body."""

BACKGROUND = (24, 27, 34)


def layout(size: float) -> Any:
    """The blueprint for a body of this size [m]."""
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                flight_view(size),
                command_view(),
                row_shares=[5, 1],
            ),
            rrb.Vertical(
                plot(e.ENERGY, "Energy [J]"),
                plot(e.ANGULAR_MOMENTUM, "Angular momentum, world [kg m²/s]"),
                plot(e.ANGULAR_MOMENTUM_ANGLE, "Angle of L to its start [rad]"),
                plot(e.ANGULAR_VELOCITY_BODY, "Angular velocity, body [rad/s]"),
            ),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=e.SIM_TIME),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def flight_view(size: float) -> Any:
    """The body in the world, followed by the camera, with its trail."""
    return rrb.Spatial3DView(
        origin="/" + e.CENTRE,
        contents=f"/{e.WORLD}/**",
        name="Flight",
        background=list(BACKGROUND),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=[0.95 * size, -0.75 * size, 0.5 * size],
            look_target=[0.0, 0.0, 0.0],
            eye_up=[0.0, 0.0, 1.0],
        ),
        overrides={
            "/" + e.TRAIL: [
                rrb.VisibleTimeRanges(
                    [
                        rrb.VisibleTimeRange(
                            e.SIM_TIME,
                            start=rrb.TimeRangeBoundary.cursor_relative(seconds=-TRAIL_SECONDS),
                            end=rrb.TimeRangeBoundary.cursor_relative(),
                        ),
                        rrb.VisibleTimeRange(
                            e.ROS_TIME,
                            start=rrb.TimeRangeBoundary.cursor_relative(seconds=-TRAIL_SECONDS),
                            end=rrb.TimeRangeBoundary.cursor_relative(),
                        ),
                    ]
                )
            ]
        },
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
