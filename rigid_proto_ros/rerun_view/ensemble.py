# SPDX-License-Identifier: MIT
"""Several flights in one recording, each a translucent body of its own colour, at one and the same time."""

from __future__ import annotations

import colorsys
import uuid
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class EnsembleMember:
    """label: what the viewer calls it. vertices (n, 3) and triangles (m, 3) in mesh coordinates, or None. scale (3,),
    center_of_mass (3,) [m, mesh axes after scale]. times_ns (k,), states (k, 13).
    """

    label: str
    vertices: np.ndarray | None
    triangles: np.ndarray | None
    scale: np.ndarray
    center_of_mass: np.ndarray
    times_ns: np.ndarray
    states: np.ndarray


def record_ensemble(path: str, flights: list[EnsembleMember], name: str) -> None:
    """Write the flights to an .rrd file; raises InputError where that can't be."""
    import rerun as rr

    from . import entities as e
    from .columns import time_columns
    from .statics import drawn_mesh
    from .streams import FileStream
    from .surface_normals import shaded_surface

    stream = FileStream(Path(path), str(uuid.uuid4()), name)
    try:
        stream.log_static(e.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for number, flight in enumerate(flights):
            red, green, blue = colorsys.hsv_to_rgb(number / max(1, len(flights)), 0.55, 0.95)
            colour = (int(255 * red), int(255 * green), int(255 * blue), 110)
            entity = f"{e.WORLD}/{flight.label}"
            times = time_columns(flight.times_ns, flight.times_ns)
            rows = flight.states
            stream.send(entity, times, rr.Transform3D.columns(translation=rows[:, 0:3], quaternion=rows[:, 3:7]))
            if flight.vertices is None or flight.triangles is None:
                sphere = rr.Points3D([[0.0, 0.0, 0.0]], radii=[0.02], colors=[colour[:3]], labels=[flight.label])
                stream.log_static(f"{entity}/centre", sphere)
                continue
            placed = rr.Transform3D(translation=-flight.center_of_mass, scale=flight.scale)
            stream.log_static(f"{entity}/mesh", placed)
            stream.log_static(f"{entity}/mesh", drawn_mesh(shaded_surface(flight.vertices, flight.triangles), colour))
            tip = flight.vertices * flight.scale - flight.center_of_mass
            highest = tip[np.argmax(np.einsum("ij,ij->i", tip, tip))]
            label = rr.Points3D([highest], radii=[0.0], labels=[flight.label], colors=[colour[:3]])
            stream.log_static(f"{entity}/label", label)
    finally:
        stream.close()
