# SPDX-License-Identifier: MIT
"""A picture of an inspection for the Rerun viewer: the mesh, its COM and principal axes, and the shapes that stand in.

Lengths are drawn from the COM, so that a mesh far from its file's origin isn't lost in the viewer's single precision.
``rerun`` is imported when a picture is recorded, not with this module.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..base.errors import InputError, is_missing
from ..base.files import output_file
from ..mass.export import quaternion_wxyz
from ..mass.inspection import Inspection
from ..mass.model_difference import ModelDifference
from ..mass.tensor import equimomental_shapes, principal_axes
from ..picture.surface import shaded_surface

MESH_COLOR = (150, 170, 190, 230)
AXIS_COLORS = ((220, 70, 60), (70, 170, 80), (70, 110, 220))
SHAPE_COLORS = {
    "bounding_box": (150, 150, 150),
    "equimomental_box": (230, 150, 40),
    "equimomental_ellipsoid": (190, 90, 200),
}
MODEL_NAMES = {"shell": "shell", "points": "vertices", "bounding_box": "bounding box"}


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
    except ImportError:
        raise InputError("--record", is_missing("rerun-sdk", "rerun")) from None
    target = output_file("--record", path)
    recording = rr.RecordingStream("rigid_proto_inspect")
    try:
        recording.save(str(target), default_blueprint=_blueprint(inspection))
    except (OSError, RuntimeError) as error:
        raise InputError("--record", path, f"a path that can be written ({error})") from None
    _log_shapes(recording, inspection)
    _log_differences(recording, inspection)
    recording.flush()
    recording.disconnect()


def _box(inspection: Inspection) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the bounding box; a mesh that has none has nothing to show."""
    if inspection.lower is None or inspection.upper is None:
        raise InputError("mesh", inspection.body.mesh.name, "a mesh with vertices")
    return inspection.lower, inspection.upper


def _log_shapes(recording: Any, inspection: Inspection) -> None:
    import rerun as rr

    chosen = inspection.chosen
    center = chosen.center_of_mass
    moments, axes = principal_axes(chosen.inertia)
    sides, semi_axes = equimomental_shapes(chosen.mass, moments)
    quaternion = rr.Quaternion(xyzw=np.roll(quaternion_wxyz(axes), -1))
    lower, upper = _box(inspection)
    size = float(np.linalg.norm(upper - lower))
    triangles = inspection.body.triangles
    if np.prod(inspection.scale) < 0.0:
        triangles = triangles[:, [0, 2, 1]]
    vertices, faces, normals = shaded_surface(inspection.body.vertices * inspection.scale - center, triangles)
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log(
        "world/mesh",
        rr.Mesh3D(vertex_positions=vertices, triangle_indices=faces, vertex_normals=normals, albedo_factor=MESH_COLOR),
        static=True,
    )
    recording.log(
        "world/center_of_mass",
        rr.Points3D([[0.0, 0.0, 0.0]], radii=0.012 * size, colors=(250, 250, 250), labels="COM"),
        static=True,
    )
    labels = [f"{name} = {moment:.4g} kg m²" for name, moment in zip("ABC", moments, strict=True)]
    recording.log(
        "world/principal_axes",
        rr.Arrows3D(
            vectors=(0.6 * size * axes).T, colors=AXIS_COLORS, radii=0.005 * size, labels=labels, show_labels=True
        ),
        static=True,
    )
    recording.log(
        "world/bounding_box",
        rr.Boxes3D(
            mins=[lower - center],
            sizes=[upper - lower],
            colors=SHAPE_COLORS["bounding_box"],
            fill_mode="majorwireframe",
            labels="bounding box",
            show_labels=False,
        ),
        static=True,
    )
    recording.log(
        "world/equimomental_box",
        rr.Boxes3D(
            half_sizes=[0.5 * sides],
            quaternions=[quaternion],
            colors=SHAPE_COLORS["equimomental_box"],
            fill_mode="majorwireframe",
            labels="box of the same inertia",
            show_labels=False,
        ),
        static=True,
    )
    recording.log(
        "world/equimomental_ellipsoid",
        rr.Ellipsoids3D(
            half_sizes=[semi_axes],
            quaternions=[quaternion],
            colors=SHAPE_COLORS["equimomental_ellipsoid"],
            fill_mode="majorwireframe",
            labels="ellipsoid of the same inertia",
            show_labels=False,
        ),
        static=True,
    )


def _log_differences(recording: Any, inspection: Inspection) -> None:
    import rerun as rr

    differences = model_differences(inspection)
    chosen = inspection.chosen
    center = ", ".join(f"{value:.6g}" for value in chosen.center_of_mass)
    rows = "\n".join(
        f"| {MODEL_NAMES.get(name, name)} | {', '.join(f'{100.0 * e:+.3g}' for e in d.principal_moments)} % "
        f"| {math.degrees(d.axes_turned):.3g}° | {d.center_of_mass_offset:.3g} m | {d.tensor:.3g} |"
        for name, d in differences.items()
    )
    remarks = "\n".join(f"* {finding.severity}: {finding.message}" for finding in inspection.findings) or "* none"
    text = (
        f"# {inspection.body.mesh.name}\n\n"
        f"mass {chosen.mass:.6g} kg, centre of mass {center} m ({inspection.model})\n\n"
        "| model | principal moments off by | axes turned by | COM offset | largest entry off by |\n"
        f"|---|---|---|---|---|\n{rows}\n\nRemarks\n\n{remarks}\n"
    )
    recording.log("report", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
    if differences:
        worst = [float(np.abs(d.principal_moments).max()) for d in differences.values()]
        recording.log("differences", rr.BarChart(np.array(worst)), static=True)


def _blueprint(inspection: Inspection) -> Any:
    import rerun.blueprint as rrb

    names = ", ".join(MODEL_NAMES.get(name, name) for name in model_differences(inspection))
    lower, upper = _box(inspection)
    size = float(np.linalg.norm(upper - lower))
    middle = 0.5 * (lower + upper) - inspection.chosen.center_of_mass
    eye = rrb.EyeControls3D(position=middle + size * np.array([1.25, -1.1, 0.75]), look_target=middle)
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(origin="/world", name=inspection.body.mesh.name, eye_controls=eye),
            rrb.Vertical(
                rrb.TextDocumentView(origin="/report", name="Mass properties"),
                rrb.BarChartView(origin="/differences", name=f"worst principal moment off by: {names}"),
            ),
            column_shares=[2, 1],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="hidden"),
    )
