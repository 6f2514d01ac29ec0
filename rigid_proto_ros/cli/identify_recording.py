# SPDX-License-Identifier: MIT
"""``rigid_proto identify --record``: what was measured and what was found, handed to the Rerun view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import InputError, is_missing

if TYPE_CHECKING:
    from ..identify.comparison import Candidate
    from ..identify.report import Identification
    from ..mass.from_mesh import MeshBody
    from ..rerun_view.identification_picture import DrawnTensor, TrackedFlight
    from ..scene.scenario import Scenario


def record(
    path: str,
    found: Identification,
    scenes: Sequence[Scenario],
    candidates: Mapping[str, Candidate],
    mesh: MeshBody | None,
) -> None:
    """Write the recording; raises InputError. mesh: that of --mesh; without it the first scene's is drawn."""
    try:
        from ..rerun_view.identification_picture import DrawnTensor, record_identification
    except ImportError:
        raise InputError("--record", is_missing("rerun-sdk", "rerun")) from None
    from ..identify.report import as_text

    com = found.estimate.values.center_of_mass
    given = [DrawnTensor(name, one.mass, com, one.inertia) for name, one in candidates.items()]
    if scenes:
        body = scenes[0].setup.body
        given.insert(0, DrawnTensor("the scene's", body.mass, np.zeros(3), body.inertia))
    tensors = [*_found_tensor(found), *given]
    record_identification(path, _tracked(found), tensors, _mesh(found, scenes, mesh), "\n".join(as_text(found)))


def _found_tensor(found: Identification) -> list[DrawnTensor]:
    """Where the motion tells its shape at least; an ellipsoid's axes depend on the tensor for each kg."""
    from ..rerun_view.identification_picture import DrawnTensor

    body = found.estimate.values
    if any(one.value is None for one in found.shape):
        return []
    is_whole = found.mass.value is not None and all(one.value is not None for one in found.inertia)
    label = "found" if is_whole else "found: its shape; the size isn't identified"
    return [DrawnTensor(label, body.mass, body.center_of_mass, body.inertia)]


def _mesh(
    found: Identification, scenes: Sequence[Scenario], mesh: MeshBody | None
) -> tuple[np.ndarray, np.ndarray] | None:
    """Vertices [m, tracked frame] and triangles. The tracked frame of a scene stands at its COM; where a mesh given by
    --mesh stands in a bag's tracked frame, nobody says: its COM is put where the found one is.
    """
    if mesh is not None:
        center = mesh.moments.mass_properties("solid", mass=1.0).center_of_mass if mesh.verdict.closed else 0.0
        return mesh.vertices - center + found.estimate.values.center_of_mass, mesh.triangles
    surface = scenes[0].setup.surface if scenes else None
    if surface is None:
        return None
    body = scenes[0].setup.body
    return surface.vertices * body.scale - body.center_of_mass, surface.triangles


def _tracked(found: Identification) -> list[TrackedFlight]:
    from ..identify import rotations as rot
    from ..identify.fitting import residuals_by_series
    from ..identify.measurements import UNITS
    from ..identify.shooting import flown
    from ..rerun_view.identification_picture import Residuals, TrackedFlight

    estimate, values = found.estimate, found.estimate.values
    left = residuals_by_series(estimate.segments, estimate.starts, values)
    tracked = []
    for segment, start in zip(estimate.segments, estimate.starts, strict=True):
        flight, motion = segment.flight, flown(segment, start, values)
        assert flight.pose is not None and motion is not None
        position, attitude = flight.pose
        times, samples, _ = motion
        turns = samples[:, 3:7]
        residuals = []
        for series in flight.series:
            sigma = estimate.sigmas[series.name]
            title = f"{series.name}, 1 is {sigma:.3g} {UNITS[series.kind]}"
            residuals.append(Residuals(title, series.times_ns - flight.begin_ns, left[id(series)] / sigma))
        tracked.append(
            TrackedFlight(
                flight.name,
                position.times_ns - flight.begin_ns,
                position.values,
                attitude.values,
                times + (segment.begin_ns - flight.begin_ns),
                samples[:, :3] - rot.turned(turns, values.center_of_mass),
                turns,
                residuals,
            )
        )
    return tracked
