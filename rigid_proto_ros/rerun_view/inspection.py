# SPDX-License-Identifier: MIT
"""An inspection in Rerun: the picture of the body at rest, with its principal axes and the shapes that stand in, and a
report.

The COM is the origin, so that a mesh far from its file's origin isn't lost in the viewer's single precision. ``rerun``
is imported when a picture is recorded, not with this module.
"""

from __future__ import annotations

import math
import uuid
from pathlib import Path

import numpy as np

from ..base.errors import InputError, is_missing
from ..mass.inspection import Inspection
from ..mass.model_difference import ModelDifference
from ..mass.tensor import principal_axes
from ..picture import style
from ..picture.picture import Picture
from ..simulation.observer import BodySnapshot

MODEL_NAMES = {"shell": "shell", "points": "vertices", "bounding_box": "bounding box"}
REPORT = "report"


def model_differences(inspection: Inspection) -> dict[str, ModelDifference]:
    """How each approximate model differs from the solid (from the chosen model if there is no solid), by model."""
    truth = inspection.models.get("solid", inspection.chosen)
    return {name: inspection.difference(name) for name, own in inspection.models.items() if own is not truth}


def record_inspection(path: str, inspection: Inspection) -> None:
    """Write the picture to ``path`` (.rrd); raises InputError when rerun is missing or the file can't be written."""
    if not path.lower().endswith(".rrd"):
        raise InputError("--record", path, "a file that ends in .rrd")
    try:
        import rerun as rr
        import rerun.blueprint as rrb

        from .backend import RerunBackend
        from .streams import FileStream
    except ImportError:
        raise InputError("--record", is_missing("rerun-sdk", "rerun")) from None
    body, chosen = inspection.body, inspection.chosen
    if inspection.lower is None:
        raise InputError("mesh", body.mesh.name, "a mesh with vertices")
    stream = FileStream(Path(path), str(uuid.uuid4()), body.mesh.name)
    backend = RerunBackend()
    backend.streams = [stream]
    picture = Picture(backend)
    picture.set_mesh(0, body.vertices, body.triangles)
    scale = np.asarray(inspection.scale, dtype=float)
    picture.set_body(
        0, BodySnapshot(chosen.mass, chosen.center_of_mass, chosen.inertia, scale, np.zeros(3), inspection.model, "")
    )
    picture.draw(np.zeros(1, np.int64), np.array([[*np.zeros(6), 1.0, *np.zeros(6)]]))
    stream.log_static(style.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    stream.log_static(REPORT, rr.TextDocument(_report(inspection), media_type="text/markdown"))
    stream.recording.send_blueprint(
        rrb.Blueprint(
            rrb.Horizontal(
                rrb.Spatial3DView(
                    origin="/" + style.WORLD,
                    contents=["$origin/**", f"- /{style.BODY_AXES}/**"],
                    name=body.mesh.name,
                ),
                rrb.TextDocumentView(origin="/" + REPORT, name="Mass properties"),
                column_shares=[2, 1],
            ),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
            rrb.TimePanel(state="hidden"),
        )
    )
    stream.close()


def _report(inspection: Inspection) -> str:
    chosen = inspection.chosen
    center = ", ".join(f"{value:.6g}" for value in chosen.center_of_mass)
    moments = ", ".join(f"{value:.4g}" for value in principal_axes(chosen.inertia)[0])
    rows = "\n".join(
        f"| {MODEL_NAMES.get(name, name)} | {', '.join(f'{100.0 * e:+.3g}' for e in d.principal_moments)} % "
        f"| {math.degrees(d.axes_turned):.3g}° | {d.center_of_mass_offset:.3g} m | {d.tensor:.3g} |"
        for name, d in model_differences(inspection).items()
    )
    remarks = "\n".join(f"* {finding.severity}: {finding.message}" for finding in inspection.findings) or "* none"
    return (
        f"# {inspection.body.mesh.name}\n\n"
        f"mass {chosen.mass:.6g} kg, centre of mass {center} m ({inspection.model}), I₁ I₂ I₃ {moments} kg m²\n\n"
        "| model | principal moments off by | axes turned by | COM offset | largest entry off by |\n"
        f"|---|---|---|---|---|\n{rows}\n\nRemarks\n\n{remarks}\n"
    )
