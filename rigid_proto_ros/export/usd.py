# SPDX-License-Identifier: MIT
"""A flight as USD (.usda, .usdc): time samples, and the body's mass properties as UsdPhysics has them.

The stage has z up and metres, as ROS has. A body's prim has the centre of mass as its origin, so that the axes of its
tensor are the prim's own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError, is_missing
from ..base.files import whole_file
from ..base.rotation import quaternion_from_matrix, rotate
from ..mass.tensor import principal_axes
from ..picture.style import BODY_COLOUR, GHOST_COLOUR, STRING_COLOUR, TRAIL_COLOUR
from ..simulation.observer import BodySnapshot
from .animation import Animation
from .flight_record import DrawnMesh, FlightRecord
from .keys import PoseKeys
from .sampling import Motion, Track, body_size, single
from .string_line import SAG, StringKeys, string_points

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

PLAYED_FPS = 60.0
"""Time codes a second where none are asked for; samples lie wherever they are needed."""

GHOST_OPACITY = 0.45
TRAIL_WIDTH, STRING_WIDTH = 0.01, 0.012
"""Of the body's size."""


def check_usd() -> None:
    """Raise InputError where the library isn't installed."""
    try:
        import pxr  # noqa: F401 (whether it is installed)
    except ImportError:
        raise InputError("--usd", is_missing("usd-core", "export")) from None


def write_usd(
    file: str, record: FlightRecord, made: Animation, fps: float | None = None, trail: bool = False
) -> list[str]:
    """Write an animation: the body, the ghost and the string where it has them, and the centre of mass's path on
    request. Returns what to say of it, a line each.
    """
    motion, keys, size = made.motion, made.keys, body_size(record)
    check_usd()
    from pxr import Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    rate = fps or PLAYED_FPS
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(float(motion.seconds[-1]) * rate)
    root = UsdGeom.Xform.Define(stage, "/flight")
    stage.SetDefaultPrim(root.GetPrim())
    styles = (("body", BODY_COLOUR, 1.0), ("ghost", GHOST_COLOUR, GHOST_OPACITY))
    for (name, colour, opacity), track, pose in zip(styles, motion.tracks, keys, strict=False):
        prim = UsdGeom.Xform.Define(stage, f"/flight/{name}")
        _animate(prim, pose, rate)
        _hide_while_away(prim, motion, track, rate)
        _draw_meshes(stage, prim, (colour, opacity), record, motion, track, rate)
    changes = _add_physics(stage, record, motion, rate)
    if made.string is not None:
        _draw_string(stage, made.string, rate, STRING_WIDTH * size)
    if trail and len(keys[0].places.times) > 1:
        _draw_trail(stage, keys[0].places.values, TRAIL_WIDTH * size)
    with whole_file("--usd", file) as path:
        # The library takes an empty file for a damaged one.
        path.unlink()
        if not stage.GetRootLayer().Export(str(path)):
            raise InputError("--usd", file, "a file that can be written")
    if not changes:
        return []
    times = "once" if changes == 1 else f"{changes} times"
    return [
        f"mass or tensor change {times} in flight: they are time samples, of which a physics engine takes the first"
    ]


def _animate(prim: UsdGeom.Xform, pose: PoseKeys, rate: float) -> None:
    from pxr import Gf, UsdGeom

    place = prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
    for t, at in zip(pose.places.times.tolist(), pose.places.values.tolist(), strict=True):
        place.Set(Gf.Vec3d(*at), t * rate)
    attitude = prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    values = pose.attitudes.values / np.linalg.norm(pose.attitudes.values, axis=1, keepdims=True)
    for t, (x, y, z, w) in zip(pose.attitudes.times.tolist(), values.tolist(), strict=True):
        attitude.Set(Gf.Quatd(w, x, y, z), t * rate)


def _hide_while_away(prim: UsdGeom.Xform, motion: Motion, track: Track, rate: float) -> None:
    if not track.shown.all():
        for k in np.flatnonzero(np.diff(track.shown.astype(int), prepend=-1)):
            _show(prim, bool(track.shown[k]), motion.seconds[k] * rate)


def _show(prim: UsdGeom.Imageable, shown: bool, time_code: float) -> None:
    from pxr import UsdGeom

    prim.CreateVisibilityAttr().Set(UsdGeom.Tokens.inherited if shown else UsdGeom.Tokens.invisible, time_code)


def _draw_meshes(
    stage: Usd.Stage,
    body: UsdGeom.Xform,
    look: tuple[tuple[int, int, int], float],
    record: FlightRecord,
    motion: Motion,
    track: Track,
    rate: float,
) -> None:
    """A prim for each mesh that the body is drawn as, below the body's; values that change do so from one instant to
    the next.
    """
    from pxr import Gf, UsdGeom

    spans = motion.spans(track)
    for number, mesh in enumerate(record.meshes):
        if number not in {span.drawn.mesh for span in spans}:
            continue
        name = "mesh" if number == 0 else f"mesh_{number + 1}"
        prim = UsdGeom.Mesh.Define(stage, body.GetPath().AppendChild(name))
        _fill(prim, mesh, look)
        ops = prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble), prim.AddScaleOp(UsdGeom.XformOp.PrecisionDouble)
        before: tuple[Any, Any] | None = None
        for k, span in enumerate(spans):
            scale, com = span.drawn.body.scale, span.drawn.body.center_of_mass
            values = Gf.Vec3d(*(scale * mesh.centre - com)), Gf.Vec3d(*scale)
            seconds = 0.0 if k == 0 else float(single(np.array([span.drawn.time_ns - motion.times_ns[0]]))[0])
            for n, op in enumerate(ops):
                if len(spans) == 1:
                    op.Set(values[n])
                    continue
                if before is not None:
                    op.Set(before[n], float(np.nextafter(np.float32(seconds), np.float32(-1.0))) * rate)
                op.Set(values[n], seconds * rate)
            before = values
            if len(spans) > 1:
                _show(prim, span.drawn.mesh == number, seconds * rate)


def _fill(prim: UsdGeom.Mesh, mesh: DrawnMesh, look: tuple[tuple[int, int, int], float]) -> None:
    """The prim's surface, about the middle of its box."""
    from pxr import Gf, UsdGeom, Vt

    points, triangles, normals = mesh.surface
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, dtype=np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel().astype(np.int32)))
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.array([points.min(axis=0), points.max(axis=0)])))
    colour, opacity = look
    prim.CreateDisplayColorAttr([Gf.Vec3f(*(np.array(colour) / 255.0).tolist())])
    if opacity < 1.0:
        prim.CreateDisplayOpacityAttr([opacity])


def _add_physics(stage: Usd.Stage, record: FlightRecord, motion: Motion, rate: float) -> int:
    """The rigid body as it is at the start, with its velocities, and gravity: what a physics engine begins with. How
    often mass or tensor change in flight.
    """
    from pxr import Gf, UsdPhysics

    body, row = record.bodies[0].body, record.rows[0]
    prim = stage.GetPrimAtPath("/flight/body")
    rigid = UsdPhysics.RigidBodyAPI.Apply(prim)
    rigid.CreateVelocityAttr(Gf.Vec3f(*row[7:10].tolist()))
    spin = np.degrees(rotate(*row[3:7].tolist(), *row[10:13].tolist()))
    rigid.CreateAngularVelocityAttr(Gf.Vec3f(*spin.tolist()))
    steps = _mass_steps(record, motion)
    _add_mass(UsdPhysics.MassAPI.Apply(prim), steps, rate)
    scene = UsdPhysics.Scene.Define(stage, "/flight/physics_scene")
    pull = float(np.linalg.norm(body.gravity))
    scene.CreateGravityMagnitudeAttr(pull)
    scene.CreateGravityDirectionAttr(Gf.Vec3f(*(body.gravity / pull if pull else [0.0, 0.0, -1.0])))
    return len(steps) - 1


def _mass_steps(record: FlightRecord, motion: Motion) -> list[tuple[float, BodySnapshot]]:
    """The bodies whose mass or tensor is other than the one's before, and the times [s] from which they are."""
    steps: list[tuple[float, BodySnapshot]] = []
    for drawn in record.bodies:
        seconds = max(0.0, float(single(np.array([drawn.time_ns - motion.times_ns[0]]))[0]))
        if steps and steps[-1][0] == seconds:
            steps.pop()
        before = steps[-1][1] if steps else None
        if before is None or before.mass != drawn.body.mass or not np.array_equal(before.inertia, drawn.body.inertia):
            steps.append((seconds, drawn.body))
    return steps


def _add_mass(mass: Any, steps: list[tuple[float, BodySnapshot]], rate: float) -> None:
    """Mass, centre of mass in the prim's space, principal moments [kg m²] and the attitude of their axes in it: by
    default those of the start, and time samples where they change, from one instant to the next.
    """
    from pxr import Gf

    mass.CreateCenterOfMassAttr(Gf.Vec3f(0.0))
    attributes = mass.CreateMassAttr(), mass.CreateDiagonalInertiaAttr(), mass.CreatePrincipalAxesAttr()
    before: tuple[Any, ...] | None = None
    for seconds, body in steps:
        moments, axes = principal_axes(body.inertia)
        x, y, z, w = quaternion_from_matrix(axes).tolist()
        values = body.mass, Gf.Vec3f(*moments.tolist()), Gf.Quatf(w, x, y, z)
        for n, attribute in enumerate(attributes):
            if before is None:
                attribute.Set(values[n])
            else:
                attribute.Set(before[n], float(np.nextafter(np.float32(seconds), np.float32(-1.0))) * rate)
            if len(steps) > 1:
                attribute.Set(values[n], seconds * rate)
        before = values


def _draw_string(stage: Usd.Stage, string: StringKeys, rate: float, width: float) -> None:
    from pxr import Vt

    times = np.union1d(string.places.times, string.forms.times)
    shapes = string.played(times)
    shown = string_points(shapes)
    # Every sample needs as many points.
    if not shapes[:, SAG].any():
        shown = shown[:, [0, -1]]
    curve = _line(stage, "/flight/string", shown.shape[1], STRING_COLOUR, width)
    for seconds, seen in zip(string.shown.times.tolist(), string.shown.values[:, 0].tolist(), strict=True):
        _show(curve, bool(seen), seconds * rate)
    points, extent = curve.CreatePointsAttr(), curve.CreateExtentAttr()
    for seconds, now in zip(times.tolist(), shown.astype(np.float32), strict=True):
        points.Set(Vt.Vec3fArray.FromNumpy(now), seconds * rate)
        extent.Set(Vt.Vec3fArray.FromNumpy(_extent(now, width)), seconds * rate)


def _draw_trail(stage: Usd.Stage, places: np.ndarray, width: float) -> None:
    from pxr import Vt

    points = places.astype(np.float32)
    curve = _line(stage, "/flight/trail", len(points), TRAIL_COLOUR, width)
    curve.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    curve.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(_extent(points, width)))


def _line(stage: Usd.Stage, path: str, count: int, colour: tuple[int, int, int], width: float) -> UsdGeom.BasisCurves:
    from pxr import Gf, UsdGeom

    curve = UsdGeom.BasisCurves.Define(stage, path)
    curve.CreateTypeAttr(UsdGeom.Tokens.linear)
    curve.CreateCurveVertexCountsAttr([count])
    curve.CreateWidthsAttr([width])
    curve.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    curve.CreateDisplayColorAttr([Gf.Vec3f(*(np.array(colour) / 255.0).tolist())])
    return curve


def _extent(points: np.ndarray, width: float) -> np.ndarray:
    reach = np.float32(0.5 * width)
    return np.array([points.min(axis=0) - reach, points.max(axis=0) + reach])
