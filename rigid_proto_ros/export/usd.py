# SPDX-License-Identifier: MIT
"""A flight as USD (.usda, .usdc): time samples, and the body's mass properties as UsdPhysics has them.

The stage has z up and metres, as ROS has. A body's prim has the centre of mass as its origin, so that the axes of its
tensor are the prim's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError, is_missing
from ..base.files import whole_file
from ..base.rotation import quaternion_from_matrix, rotate
from ..mass.tensor import principal_axes
from ..picture import style
from ..picture.backend import DrawnMesh
from ..picture.style import Colour
from ..simulation.observer import BodyChanged, BodySnapshot
from .flight_record import FlightRecord
from .tracks import MeshSteps, Tracks

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

TRAIL_WIDTH, STRING_WIDTH = 0.01, 0.012
"""Of the body's size."""


def check_usd() -> None:
    """Raise InputError where the library isn't installed."""
    try:
        import pxr  # noqa: F401 (whether it is installed)
    except ImportError:
        raise InputError("--usd", is_missing("usd-core", "export")) from None


def write_usd(file: str, record: FlightRecord, tracks: Tracks, fps: float) -> list[str]:
    """Write the body, and ghost, string and path of the centre of mass where the tracks have them, at ``fps`` time
    codes a second. Returns what to say of it, a line each.
    """
    check_usd()
    from pxr import Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(fps)
    stage.SetFramesPerSecond(fps)
    clock = _Clock(int(record.times_ns[0]), fps)
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(clock.code(int(record.times_ns[-1])))
    root = UsdGeom.Xform.Define(stage, "/flight")
    stage.SetDefaultPrim(root.GetPrim())
    for name, part, mesh in (("body", style.BODY, style.BODY_MESH), ("ghost", style.GHOST, style.GHOST_MESH)):
        times_ns, positions, attitudes = tracks.poses(part)
        if not len(times_ns):
            continue
        prim = UsdGeom.Xform.Define(stage, f"/flight/{name}")
        _animate(prim, [clock.code(t) for t in times_ns.tolist()], positions, attitudes)
        if times_ns[0] > record.times_ns[0]:
            _show(prim, False, 0.0)
            _show(prim, True, clock.code(int(times_ns[0])))
        _draw_meshes(stage, prim, style.STYLES[mesh], tracks.meshes(mesh), clock)
    changes = _add_physics(stage, record, clock)
    _draw_string(stage, tracks.string, clock, STRING_WIDTH * tracks.size)
    if len(tracks.trail) > 1:
        _draw_trail(stage, tracks.trail, TRAIL_WIDTH * tracks.size)
    with whole_file("--usd", file) as path:
        # The library takes an empty file for a damaged one.
        path.unlink()
        if not stage.GetRootLayer().Export(str(path)):
            raise InputError("--usd", file, "a file that can be written")
    if not changes:
        return []
    times = "once" if changes == 1 else f"{changes} times"
    return [f"mass or tensor change {times}: they are time samples, of which a physics engine takes the first"]


@dataclass(frozen=True)
class _Clock:
    """Time codes of simulated times; start_ns [ns] is that of code 0."""

    start_ns: int
    rate: float

    def code(self, time_ns: int) -> float:
        return max(0, time_ns - self.start_ns) * 1e-9 * self.rate


def _animate(prim: UsdGeom.Xform, codes: list[float], positions: np.ndarray, attitudes: np.ndarray) -> None:
    from pxr import Gf, UsdGeom

    place = prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
    for code, at in zip(codes, positions.tolist(), strict=True):
        place.Set(Gf.Vec3d(*at), code)
    attitude = prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    values = attitudes / np.linalg.norm(attitudes, axis=1, keepdims=True)
    for code, (x, y, z, w) in zip(codes, values.tolist(), strict=True):
        attitude.Set(Gf.Quatd(w, x, y, z), code)


def _show(prim: UsdGeom.Imageable, shown: bool, time_code: float) -> None:
    from pxr import UsdGeom

    prim.CreateVisibilityAttr().Set(UsdGeom.Tokens.inherited if shown else UsdGeom.Tokens.invisible, time_code)


def _draw_meshes(
    stage: Usd.Stage, body: UsdGeom.Xform, look: style.Style, meshes: list[MeshSteps], clock: _Clock
) -> None:
    """A prim for each mesh that the body is drawn as, below the body's; values that change do so from one instant to
    the next.
    """
    from pxr import Gf, UsdGeom

    for number, steps in enumerate(meshes, 1):
        name = "mesh" if number == 1 else f"mesh_{number}"
        prim = UsdGeom.Mesh.Define(stage, body.GetPath().AppendChild(name))
        _fill(prim, steps.surface, look)
        seen = np.abs(steps.scales).max(axis=1) > 0.0
        # Where it isn't drawn it has some scale of its own: one of 0 has no inverse.
        scales = np.where(seen[:, np.newaxis], steps.scales, steps.scales[seen][0])
        place = prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
        size = prim.AddScaleOp(UsdGeom.XformOp.PrecisionDouble)
        for op, values in ((place, steps.positions.tolist()), (size, scales.tolist())):
            if len(values) == 1:
                op.Set(Gf.Vec3d(*values[0]))
                continue
            for k, time_ns in enumerate(steps.times_ns.tolist()):
                if k:
                    op.Set(Gf.Vec3d(*values[k - 1]), clock.code(time_ns))
                    op.Set(Gf.Vec3d(*values[k]), clock.code(time_ns + 1))
                else:
                    op.Set(Gf.Vec3d(*values[0]), 0.0)
        if len(seen) > 1:
            for k, time_ns in enumerate(steps.times_ns.tolist()):
                _show(prim, bool(seen[k]), clock.code(time_ns + 1) if k else 0.0)


def _fill(prim: UsdGeom.Mesh, surface: DrawnMesh, look: style.Style) -> None:
    """The prim's surface, about the middle of its box."""
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


def _add_physics(stage: Usd.Stage, record: FlightRecord, clock: _Clock) -> int:
    """The rigid body as it is at the start, with its velocities, and gravity: what a physics engine begins with. How
    often mass or tensor change in flight.
    """
    from pxr import Gf, UsdPhysics

    (_, body), *_ = record.bodies(BodyChanged)
    row = record.rows[0]
    prim = stage.GetPrimAtPath("/flight/body")
    rigid = UsdPhysics.RigidBodyAPI.Apply(prim)
    rigid.CreateVelocityAttr(Gf.Vec3f(*row[7:10].tolist()))
    spin = np.degrees(rotate(*row[3:7].tolist(), *row[10:13].tolist()))
    rigid.CreateAngularVelocityAttr(Gf.Vec3f(*spin.tolist()))
    steps = _mass_steps(record)
    _add_mass(UsdPhysics.MassAPI.Apply(prim), steps, clock)
    scene = UsdPhysics.Scene.Define(stage, "/flight/physics_scene")
    pull = float(np.linalg.norm(body.gravity))
    scene.CreateGravityMagnitudeAttr(pull)
    scene.CreateGravityDirectionAttr(Gf.Vec3f(*(body.gravity / pull if pull else [0.0, 0.0, -1.0])))
    return len(steps) - 1


def _mass_steps(record: FlightRecord) -> list[tuple[int, BodySnapshot]]:
    """The bodies whose mass or tensor is other than the one's before, and the times [ns] from which they are."""
    steps: list[tuple[int, BodySnapshot]] = []
    for time_ns, body in record.bodies(BodyChanged):
        if steps and steps[-1][0] == time_ns:
            steps.pop()
        before = steps[-1][1] if steps else None
        if before is None or before.mass != body.mass or not np.array_equal(before.inertia, body.inertia):
            steps.append((time_ns, body))
    return steps


def _add_mass(mass: Any, steps: list[tuple[int, BodySnapshot]], clock: _Clock) -> None:
    """Mass, centre of mass in the prim's space, principal moments [kg m²] and the attitude of their axes in it: by
    default those of the start, and time samples where they change, from one instant to the next.
    """
    from pxr import Gf

    mass.CreateCenterOfMassAttr(Gf.Vec3f(0.0))
    attributes = mass.CreateMassAttr(), mass.CreateDiagonalInertiaAttr(), mass.CreatePrincipalAxesAttr()
    before: tuple[Any, ...] | None = None
    for time_ns, body in steps:
        moments, axes = principal_axes(body.inertia)
        x, y, z, w = quaternion_from_matrix(axes).tolist()
        values = body.mass, Gf.Vec3f(*moments.tolist()), Gf.Quatf(w, x, y, z)
        for n, attribute in enumerate(attributes):
            if before is None:
                attribute.Set(values[n])
            else:
                attribute.Set(before[n], clock.code(time_ns))
            if len(steps) > 1:
                attribute.Set(values[n], 0.0 if before is None else clock.code(time_ns + 1))
        before = values


def _draw_string(stage: Usd.Stage, string: dict[int, np.ndarray | None], clock: _Clock, width: float) -> None:
    from pxr import Vt

    known = [own for own in string.values() if own is not None]
    if not known:
        return
    # Every sample needs as many points.
    count = max(map(len, known))
    curve = _line(stage, "/flight/string", count, style.STRING_COLOUR, width)
    points, extent = curve.CreatePointsAttr(), curve.CreateExtentAttr()
    before = None
    for time_ns, own in string.items():
        code = clock.code(time_ns)
        if before is None or before != (own is not None):
            before = own is not None
            _show(curve, before, code)
        if own is None:
            continue
        if len(own) < count:
            own = own[0] + np.linspace(0.0, 1.0, count)[:, np.newaxis] * (own[-1] - own[0])
        points.Set(Vt.Vec3fArray.FromNumpy(own.astype(np.float32)), code)
        extent.Set(Vt.Vec3fArray.FromNumpy(_extent(own.astype(np.float32), width)), code)


def _draw_trail(stage: Usd.Stage, places: np.ndarray, width: float) -> None:
    from pxr import Vt

    points = places.astype(np.float32)
    curve = _line(stage, "/flight/trail", len(points), style.TRAIL_COLOUR, width)
    curve.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    curve.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(_extent(points, width)))


def _line(stage: Usd.Stage, path: str, count: int, colour: Colour, width: float) -> UsdGeom.BasisCurves:
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
