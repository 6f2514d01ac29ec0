# SPDX-License-Identifier: MIT
"""A picture of an estimate from measured flights: each measured track with the fitted flight over it as a ghost, what
is left between the two, and the ellipsoids of the given and of the found tensor.
"""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from ..mass.tensor import equimomental_shapes, principal_axes
from ..picture import style
from ..picture.surface import shaded_surface
from . import entities as e
from .backend import drawn_mesh, scalar_columns, time_columns
from .streams import FileStream, Stream

ELLIPSOIDS = "ellipsoids"
REPORT = "report"
FOUND_COLOUR, OTHERS_COLOUR = style.GHOST_COLOUR, style.ORANGE
TRACK_SAMPLES_MAX = 20_000
"""Points of a drawn path."""


@dataclass(frozen=True)
class Residuals:
    """title: what was measured, with the size of the noise. times_ns (n,) from the flight's begin; scaled (n, 3) in
    standard deviations.
    """

    title: str
    times_ns: np.ndarray
    scaled: np.ndarray


@dataclass(frozen=True)
class TrackedFlight:
    """Poses of the tracked frame, times_ns (n,) from the flight's begin: positions (n, 3) [m], attitudes (n, 4) xyzw.

    measured_*: what was measured of them, either may be empty.
    """

    name: str
    measured_times_ns: np.ndarray
    measured_positions: np.ndarray
    measured_attitudes: np.ndarray
    times_ns: np.ndarray
    positions: np.ndarray
    attitudes: np.ndarray
    residuals: Sequence[Residuals]


@dataclass(frozen=True)
class DrawnTensor:
    """label, mass [kg], center_of_mass (3,) [m, tracked frame] and inertia (3, 3) [kg m², about it]."""

    label: str
    mass: float
    center_of_mass: np.ndarray
    inertia: np.ndarray


def record_identification(
    path: str,
    flights: Sequence[TrackedFlight],
    tensors: Sequence[DrawnTensor],
    mesh: tuple[np.ndarray, np.ndarray] | None,
    report: str,
) -> None:
    """Write an .rrd file; raises InputError where that can't be. mesh: vertices (n, 3) [m, tracked frame], triangles.

    tensors: the found one first.
    """
    stream = FileStream(Path(path), str(uuid.uuid4()), "identified from motion")
    try:
        stream.recording.send_blueprint(_blueprint(flights))
        stream.log_static(style.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        stream.log_static(REPORT, rr.TextDocument(f"```\n{report}\n```", media_type="text/markdown"))
        size = _size(tensors, mesh)
        for number, flight in enumerate(flights, 1):
            _send_flight(stream, number, flight, mesh, size)
        _send_ellipsoids(stream, tensors)
    finally:
        stream.close()


def _size(tensors: Sequence[DrawnTensor], mesh: tuple[np.ndarray, np.ndarray] | None) -> float:
    """Of the body, about [m]."""
    if mesh is not None:
        return float(np.linalg.norm(np.ptp(mesh[0], axis=0)))
    if not tensors:
        return 0.2
    return 2.0 * _reach(tensors[0])


def _send_flight(
    stream: Stream, number: int, flight: TrackedFlight, mesh: tuple[np.ndarray, np.ndarray] | None, size: float
) -> None:
    measured, fitted = f"{style.WORLD}/measured_{number}", f"{style.WORLD}/fitted_{number}"
    # The pose as it came, with the mesh on it, and the fitted one drawn through it.
    if len(flight.measured_positions) and len(flight.measured_attitudes):
        times = time_columns(flight.measured_times_ns, flight.measured_times_ns)
        poses = rr.Transform3D.columns(translation=flight.measured_positions, quaternion=flight.measured_attitudes)
        stream.send(measured, times, poses)
        _send_body(stream, measured, mesh, (*style.BODY_COLOUR, 255), size)
    if len(flight.measured_positions):
        every = 1 + len(flight.measured_positions) // TRACK_SAMPLES_MAX
        points = rr.Points3D(flight.measured_positions[::every], colors=[style.TRAIL_COLOUR], radii=[0.01 * size])
        stream.log_static(f"{style.WORLD}/measured_track_{number}", points)
    times = time_columns(flight.times_ns, flight.times_ns)
    stream.send(fitted, times, rr.Transform3D.columns(translation=flight.positions, quaternion=flight.attitudes))
    _send_body(stream, fitted, mesh, (*style.GHOST_COLOUR, 110), size)
    every = 1 + len(flight.positions) // TRACK_SAMPLES_MAX
    line = rr.LineStrips3D([flight.positions[::every]], colors=[style.GHOST_COLOUR], radii=[0.005 * size])
    stream.log_static(f"{style.WORLD}/fitted_track_{number}", line)
    for k, left in enumerate(flight.residuals):
        entity = _plot(number, k)
        names = rr.SeriesPoints(
            names=["x", "y", "z"], colors=style.AXES_COLOURS, marker_sizes=[2.0] * 3, markers=["circle"] * 3
        )
        stream.log_static(entity, names)
        stream.send(entity, time_columns(left.times_ns, left.times_ns), scalar_columns(left.scaled))


def _send_body(
    stream: Stream, entity: str, mesh: tuple[np.ndarray, np.ndarray] | None, colour: tuple[int, ...], size: float
) -> None:
    if mesh is not None:
        stream.log_static(f"{entity}/mesh", drawn_mesh(shaded_surface(*mesh), colour))
        return
    axes = rr.Arrows3D(
        vectors=0.5 * size * np.eye(3),
        colors=[(*axis, colour[3]) for axis in style.AXES_COLOURS],
        radii=0.02 * size,
    )
    stream.log_static(f"{entity}/axes", axes)


def _send_ellipsoids(stream: Stream, tensors: Sequence[DrawnTensor]) -> None:
    """One in the other, where they lie in the tracked frame."""
    stream.log_static(ELLIPSOIDS, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    for number, tensor in enumerate(tensors):
        semi_axes, axes = _ellipsoid(tensor)
        entity, colour = f"{ELLIPSOIDS}/{number}", OTHERS_COLOUR if number else FOUND_COLOUR
        place = rr.Transform3D(translation=tensor.center_of_mass, mat3x3=axes)
        shape = rr.Ellipsoids3D(half_sizes=[semi_axes], colors=[colour], fill_mode="majorwireframe")
        stream.log_static(entity, place, shape)
        # Names one below the other, beside all of them.
        beside = np.array([0.0, 1.2, -0.2 * number]) * max(map(_reach, tensors))
        name = rr.Points3D([beside], labels=[tensor.label], show_labels=True, colors=[colour], radii=[0.0])
        stream.log_static(f"{ELLIPSOIDS}/name_{number}", name)


def _reach(tensor: DrawnTensor) -> float:
    """The ellipsoid's largest semi-axis [m]."""
    return float(_ellipsoid(tensor)[0].max())


def _ellipsoid(tensor: DrawnTensor) -> tuple[np.ndarray, np.ndarray]:
    """Semi-axes (3,) [m] and axes (3, 3), columns, of the ellipsoid of equal mass and inertia."""
    moments, axes = principal_axes(tensor.inertia)
    return equimomental_shapes(tensor.mass, moments)[1], axes


def _plot(flight: int, series: int) -> str:
    return f"residuals/{flight}_{series + 1}"


def _blueprint(flights: Sequence[TrackedFlight]) -> rrb.Blueprint:
    plots = [
        rrb.Horizontal(
            *(
                rrb.TimeSeriesView(origin="/" + _plot(number, k), name=one.title)
                for k, one in enumerate(flight.residuals)
            ),
            name=f"Residuals of {flight.name} in standard deviations",
        )
        for number, flight in enumerate(flights, 1)
    ]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                rrb.Spatial3DView(origin="/" + style.WORLD, name="Measured motion, and the fitted one as a ghost"),
                rrb.Vertical(
                    rrb.Spatial3DView(origin="/" + ELLIPSOIDS, name="Inertia ellipsoids in the tracked frame"),
                    rrb.TextDocumentView(origin="/" + REPORT, name="Mass properties identified"),
                ),
                column_shares=[1, 1],
            ),
            plots[0] if len(plots) == 1 else rrb.Tabs(*plots),
            row_shares=[2, 1],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=e.SIM_TIME),
    )
