# SPDX-License-Identifier: MIT
"""A flight as USD (.usda, .usdc): time samples, and the body's mass properties by UsdPhysics.

The stage has z up and metres, like ROS. The origin of a body's prim is the centre of mass, and the tensor is in the
prim's axes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import InputError
from ..base.files import whole_file
from ..base.rotation import quaternion_from_matrix, rotate
from ..base.vectors import BoolArray, FloatArray, IntArray, Points
from ..mass.tensor import principal_axes
from ..picture import style
from ..picture.backend import DrawnMesh
from ..simulation.observer import BodyChanged
from .flight_record import FlightRecord
from .tracks import BODIES, MESHES, Track, Tracks

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

STRING_WIDTH = 0.012
"""Relative to the body's size."""


def write_usd(file: str, record: FlightRecord, tracks: Tracks, fps: float) -> list[str]:
    """Write the body, and ghost and string if there are any, at ``fps`` time codes per second. Returns
    lines to print.
    """
    from pxr import Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(fps)
    stage.SetFramesPerSecond(fps)
    start_ns = int(record.times_ns[0])

    def codes(times_ns: IntArray) -> list[float]:
        # Times are rounded to the ns: a held value just after a whole time code would be seen a frame late.
        exact = np.maximum(times_ns - start_ns, 0) * 1e-9 * fps
        found: list[float] = np.where(np.abs(exact - np.rint(exact)) <= 0.6e-9 * fps, np.rint(exact), exact).tolist()
        return found

    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(codes(record.times_ns)[-1])
    root = UsdGeom.Xform.Define(stage, "/flight")
    stage.SetDefaultPrim(root.GetPrim())
    for name, part in BODIES.items():
        track = tracks.track(part)
        if track is None:
            continue
        prim = UsdGeom.Xform.Define(stage, f"/flight/{name}")
        _animate(prim, codes(track.times_ns), track.positions, track.attitudes)
        if track.surface is not None:
            mesh = UsdGeom.Mesh.Define(stage, prim.GetPath().AppendChild("mesh"))
            _fill(mesh, track.surface, style.STYLES[MESHES[part]])
            _place_mesh(mesh, codes(track.times_ns), track)
    changed = _add_physics(stage, record)
    _draw_string(stage, tracks.string, codes(np.array(list(tracks.string), np.int64)), STRING_WIDTH * tracks.size)
    with whole_file("--usd", file) as path:
        # The library treats an empty file as a damaged one.
        path.unlink()
        if not stage.GetRootLayer().Export(str(path)):
            raise InputError("--usd", file, "a file that can be written")
    return ["mass or tensor change: the file has the values at the start"] if changed else []


def _animate(prim: UsdGeom.Xform, codes: list[float], positions: Points, attitudes: FloatArray) -> None:
    from pxr import Gf, UsdGeom

    place = prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
    for code, at in zip(codes, positions.tolist(), strict=True):
        place.Set(Gf.Vec3d(*at), code)
    attitude = prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    for code, (x, y, z, w) in zip(codes, attitudes.tolist(), strict=True):
        attitude.Set(Gf.Quatd(w, x, y, z), code)


def _place_mesh(prim: UsdGeom.Mesh, codes: list[float], track: Track) -> None:
    """Pose of the mesh relative to its body: once, or at each frame if it changes during the simulation."""
    from pxr import Gf, UsdGeom

    shown: BoolArray = np.any(track.mesh_scales, axis=1)
    if not shown.all():
        visibility = prim.CreateVisibilityAttr()
        for code, is_shown in zip(codes, shown.tolist(), strict=True):
            visibility.Set(UsdGeom.Tokens.inherited if is_shown else UsdGeom.Tokens.invisible, code)
    place = prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
    size = prim.AddScaleOp(UsdGeom.XformOp.PrecisionDouble)
    for op, values in ((place, track.mesh_places[shown]), (size, track.mesh_scales[shown])):
        if not np.ptp(values, axis=0).any():
            op.Set(Gf.Vec3d(*values[0].tolist()))
            continue
        for code, value in zip(np.array(codes)[shown].tolist(), values.tolist(), strict=True):
            op.Set(Gf.Vec3d(*value), code)


def _fill(prim: UsdGeom.Mesh, surface: DrawnMesh, look: style.Style) -> None:
    """Set the prim's surface."""
    from pxr import Gf, UsdGeom, Vt

    points, triangles, normals = surface
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, dtype=np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel().astype(np.int32)))
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.array([points.min(axis=0), points.max(axis=0)])))
    prim.CreateDisplayColorAttr([Gf.Vec3f(*(np.array(look.colours[0]) / 255.0).tolist())])
    if look.opacity < 1.0:
        prim.CreateDisplayOpacityAttr([look.opacity])


def _add_physics(stage: Usd.Stage, record: FlightRecord) -> bool:
    """Add the rigid body at the start, with its velocities, and gravity: the initial conditions for a physics engine.
    Returns whether mass or tensor change in flight.
    """
    from pxr import Gf, UsdPhysics

    start, *later = record.setups(BodyChanged)
    body = start.body
    row = record.rows[0]
    prim = stage.GetPrimAtPath("/flight/body")
    rigid = UsdPhysics.RigidBodyAPI.Apply(prim)
    rigid.CreateVelocityAttr(Gf.Vec3f(*row[7:10].tolist()))
    spin = np.degrees(rotate(*row[3:7].tolist(), *row[10:13].tolist()))
    rigid.CreateAngularVelocityAttr(Gf.Vec3f(*spin.tolist()))
    moments, axes = principal_axes(body.inertia)
    x, y, z, w = quaternion_from_matrix(axes).tolist()
    mass = UsdPhysics.MassAPI.Apply(prim)
    mass.CreateMassAttr(body.mass)
    mass.CreateCenterOfMassAttr(Gf.Vec3f(0.0))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments.tolist()))
    mass.CreatePrincipalAxesAttr(Gf.Quatf(w, x, y, z))
    scene = UsdPhysics.Scene.Define(stage, "/flight/physics_scene")
    pull = float(np.linalg.norm(start.gravity))
    scene.CreateGravityMagnitudeAttr(pull)
    scene.CreateGravityDirectionAttr(Gf.Vec3f(*(start.gravity / pull if pull else [0.0, 0.0, -1.0])))
    return any(own.body.mass != body.mass or not np.array_equal(own.body.inertia, body.inertia) for own in later)


def _draw_string(stage: Usd.Stage, string: dict[int, Points | None], codes: list[float], width: float) -> None:
    """Add a straight curve from the free end to the knot, visible while a string is tied."""
    from pxr import Gf, UsdGeom, Vt

    if not any(own is not None for own in string.values()):
        return
    curve = UsdGeom.BasisCurves.Define(stage, "/flight/string")
    curve.CreateTypeAttr(UsdGeom.Tokens.linear)
    curve.CreateCurveVertexCountsAttr([2])
    curve.CreateWidthsAttr([width])
    curve.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    curve.CreateDisplayColorAttr([Gf.Vec3f(*(np.array(style.STRING_COLOUR) / 255.0).tolist())])
    points, extent, shown = curve.CreatePointsAttr(), curve.CreateExtentAttr(), curve.CreateVisibilityAttr()
    for code, own in zip(codes, string.values(), strict=True):
        shown.Set(UsdGeom.Tokens.invisible if own is None else UsdGeom.Tokens.inherited, code)
        if own is not None:
            ends, reach = own.astype(np.float32), np.float32(0.5 * width)
            points.Set(Vt.Vec3fArray.FromNumpy(ends), code)
            extent.Set(Vt.Vec3fArray.FromNumpy(np.array([ends.min(axis=0) - reach, ends.max(axis=0) + reach])), code)
