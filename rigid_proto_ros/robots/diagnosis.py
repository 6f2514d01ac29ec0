# SPDX-License-Identifier: MIT
"""Verdicts on the inertials of a robot file. A verdict is the first of these that holds:

* frame: mass 0 and no shape, as for a link that only marks a frame;
* impossible: no body has it (mass > 0, tensor positive definite, A + B >= C);
* unknown: it can't be compared, because no shape encloses a volume, or a visual shape can't be found or read; or it is
  wrong only by its shapes, and no longer if meshes are turned upright as their files say;
* uniform: it is that of the uniform solid, within the tolerance and the digits printed;
* explained: it isn't that of the uniform solid, and a common mistake explains the difference (robots/causes.py); a COM
  at an origin, or that of box, shell or hull, counts only if the tensor fits, is explained, or is impossible for any
  mass inside the shapes;
* not judged: all shapes are primitives, which often replace the parts that were weighed or drawn;
* impossible for its shape: no mass distribution inside the link's shapes has it;
* not uniform: it isn't that of the uniform solid, but some distribution inside the shapes has it.

The mass in the file is taken as given, so that tensor and COM are checked independently. Visual and collision shapes
are compared separately, and the report names the ones that decide. A mass distribution may lie inside either. Collision
shapes are often cruder than the parts, so they don't make a link wrong if its visual shapes are solids.

Along an axis on which the shapes reach from l to u, a distribution with mean c has at most the variance (c - l)(u - c),
with all mass at the two ends (Bhatia and Davis, American Mathematical Monthly 107, 2000). A tensor gives the variance
along every axis. If it is larger along one axis, the inertial can't be that of these shapes, whatever their density.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.vectors import Points, Vector3
from ..mass.from_mesh import mesh_body
from ..mass.inspection import remarks
from ..mass.properties import MassProperties
from ..mass.tensor import check_tensor
from ..mesh.locate import Search
from ..mesh.reading import load_mesh
from ..mesh.solids import convex_hull
from .causes import LIMIT, WEAK, explain_center, explain_inertia
from .link_shapes import LinkShapes, Meshes
from .reading import COLLISION, HERE, VISUAL, Link, Shape, check_finite, check_inertial, read_robot

IMPOSSIBLE, BEYOND_SHAPE, EXPLAINED = "impossible", "impossible for its shape", "explained"
NOT_UNIFORM, NOT_JUDGED, UNIFORM, UNKNOWN, FRAME = "not uniform", "not judged", "uniform", "unknown", "frame"
WRONG = (IMPOSSIBLE, BEYOND_SHAPE, EXPLAINED)
"""Verdicts of inertials that can't be intended."""
VERDICTS = (*WRONG, NOT_UNIFORM, NOT_JUDGED, UNIFORM, UNKNOWN, FRAME)
"""Verdicts in the order of a report, the worst first."""
MARGIN = 1e-3
"""Fraction of the shapes' diagonal by which parts may be larger than drawn."""
MAX_ROUNDING = 0.05
"""Largest relative rounding that is excused: a number printed with one digit is accurate to 50 %, which would excuse
anything.
"""
DIRECTIONS = 1000
"""Number of axes evenly spread over all directions, about 5 degrees apart, which are checked besides those of link,
tensor and hull.
"""


@dataclass(frozen=True)
class LinkDiagnosis:
    """The verdict on one link. status: one of VERDICTS. Errors are relative (COM: to the box's diagonal). ratio: size
    of the tensor relative to the uniform solid's. judged_by: visual or collision shapes. expected: their properties as
    a uniform solid of the link's mass. info: remarks without effect on the verdict.
    """

    link: str
    mesh: str
    status: str
    mass: float
    center_of_mass_error: float | None = None
    inertia_error: float | None = None
    ratio: float | None = None
    causes: tuple[str, ...] = ()
    expected: MassProperties | None = None
    note: str = ""
    judged_by: str = ""
    info: tuple[str, ...] = ()

    @property
    def error(self) -> float:
        """The larger of the two errors."""
        return max(self.center_of_mass_error or 0.0, self.inertia_error or 0.0)

    def as_dict(self) -> dict[str, Any]:
        """The diagnosis as a JSON object; ``expected`` is in the link's axes."""
        expected = self.expected and self.expected.as_dict()
        plain = {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in vars(self).items()
        }
        return {**plain, "causes": list(self.causes), "expected": expected, "info": list(self.info)}


def impossible_inertial(link: Link) -> str:
    """Why no body can have the link's inertial; "" if one can."""
    remedy = "" if np.any(link.inertia) else "; a link that only marks a frame needs no inertial"
    if not link.mass > 0.0:
        return f"mass {link.mass:g}, which isn't a positive number{remedy}"
    try:
        check_inertial(link)
        check_tensor(link.inertia)
    except InputError as error:
        return f"no rigid body has this: {error}{remedy}"
    return ""


def beyond_shapes(link: Link, points: Points) -> str:
    """Why no mass distribution within the hull of ``points`` (n, 3) has the link's inertial; "" if one may have it. The
    inertial is one of a possible body.
    """
    c = link.center_of_mass
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    reach = MARGIN * diagonal + np.minimum(link.center_step, MAX_ROUNDING * diagonal)
    variance = (0.5 * np.trace(link.inertia) * np.eye(3) - link.inertia) / link.mass
    step = (0.5 * np.trace(link.inertia_step) * np.eye(3) + link.inertia_step) / link.mass
    step = np.minimum(step, MAX_ROUNDING * np.trace(variance))
    rounding = 1.0 - min(link.mass_step / link.mass, MAX_ROUNDING)
    corners, normals = _hull(points)

    axes = np.concatenate([np.eye(3), np.linalg.eigh(variance)[1].T, _spread(DIRECTIONS), normals])
    along = corners @ axes.T
    margin = np.abs(axes) @ reach
    below, above = axes @ c - along.min(axis=0) + margin, along.max(axis=0) - axes @ c + margin
    outside = np.maximum(-below, -above)  # distance of the COM from the hull's extent [m]
    if outside.max() > 0.0:
        axis = axes[outside.argmax()]
        return f"COM {outside.max() + MARGIN * diagonal:.3g} m outside the hull of its shapes along {_text(axis)}"
    own = np.einsum("ki,ij,kj->k", axes, variance, axes) * rounding - np.einsum(
        "ki,ij,kj->k", np.abs(axes), step, np.abs(axes)
    )
    tiny = 1e-12 * diagonal + 1e-150
    most = np.maximum(below, tiny) * np.maximum(above, tiny)
    worst = (own / most).argmax()
    if own[worst] <= most[worst]:
        return ""
    return (
        f"too wide for its shapes: along {_text(axes[worst])} the mass lies {math.sqrt(own[worst]):.3g} m (r.m.s.) "
        f"from the COM, and inside the shapes at most {math.sqrt(most[worst]):.3g} m"
    )


def _spread(count: int) -> Points:
    """Directions (count, 3) spread evenly over the sphere: a Fibonacci lattice."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def _hull(points: Points) -> tuple[Points, Points]:
    """Corners (n, 3) and normals (m, 3) of the hull. For points without a hull, or without SciPy: all points and no
    normals.
    """
    try:
        corners, triangles = convex_hull(points)
    except InputError:
        return points, np.zeros((0, 3))
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    size = np.linalg.norm(normals, axis=1)
    normals = np.unique(np.round(normals[size > 0.0] / size[size > 0.0][:, None], 3), axis=0)
    normals = normals[:: max(1, len(normals) // 1000)]  # a smooth hull has more than needed
    return corners, normals / np.linalg.norm(normals, axis=1)[:, None]


def _text(axis: Vector3) -> str:
    return f"({', '.join(f'{value + 0.0:.2g}' for value in np.round(axis, 3))})"


def _tensor_error(link: Link, truth: MassProperties) -> tuple[float, float, float]:
    """Relative difference of the tensor, the part of it that printed digits don't explain, and the ratio of sizes."""
    size = float(np.max(np.abs(truth.inertia)))
    # Rounding of the mass scales the whole tensor; rounding of an entry changes it by its own step.
    slack = min(link.mass_step / link.mass, MAX_ROUNDING)
    ratio = float(np.sum(link.inertia * truth.inertia) / np.sum(truth.inertia**2))
    factor = min(max(ratio, 1.0 - slack), 1.0 + slack)
    excused = np.minimum(link.inertia_step, MAX_ROUNDING * size)
    left = np.maximum(np.abs(link.inertia - factor * truth.inertia) - excused, 0.0)
    return float(np.max(np.abs(link.inertia - truth.inertia))) / size, float(np.max(left)) / size, ratio


def _compare(link: Link, parts: LinkShapes, tolerance: float, role: str) -> LinkDiagnosis:
    """Compare the link's inertial with that of its shapes of one role as a uniform solid."""
    plain = LinkDiagnosis(link.name, parts.names, UNKNOWN, link.mass, note=link.problem, judged_by=role)
    if not 0.0 < link.mass < math.inf:  # NaN for a link without an inertial
        return plain
    try:
        truth = parts.uniform(link.mass)
        check_finite(f"a solid of link {link.name}", inertia=truth.inertia)
        plain = replace(plain, expected=truth)
        check_inertial(link)
    except InputError as error:
        return replace(plain, note=str(error))
    offset = np.abs(link.center_of_mass - truth.center_of_mass)
    center_left = float(np.max(offset - np.minimum(link.center_step, MAX_ROUNDING * parts.diagonal))) / parts.diagonal
    inertia_error, inertia_left, ratio = _tensor_error(link, truth)
    of_tensor: tuple[str, ...] = ()
    of_center: tuple[str, ...] = ()
    if inertia_left > tolerance:
        of_tensor = explain_inertia(link.inertia, truth, link.center_of_mass, parts)
    if center_left > tolerance:
        of_center = explain_center(link.center_of_mass, truth, parts)
    causes = of_tensor + of_center
    if parts.are_primitives and (bool(of_tensor), bool(of_center)) != (
        inertia_left > tolerance,
        center_left > tolerance,
    ):
        causes = ()  # a partial match means nothing if the shapes may be those of something else
    # A COM at an origin, or that of the hull, is a mistake if the tensor is that of the shapes or a known mistake. With
    # another tensor, as of a body that was weighed or computed with its densities, it may be right.
    is_weak = inertia_left > tolerance and not of_tensor and set(causes) <= set(WEAK)
    off = max(inertia_left, center_left) > tolerance
    density = link.mass / sum(solid.mass for solid in parts.solids)
    note = f"density {density:.4g} kg/m³"
    if not 1.0 <= density <= 25000.0:
        note += ", which no solid has; check the units of mesh and mass"
    return replace(
        plain,
        status=EXPLAINED if causes and not is_weak else NOT_UNIFORM if off else UNIFORM,
        center_of_mass_error=float(np.max(offset)) / parts.diagonal,
        inertia_error=inertia_error,
        ratio=ratio,
        causes=causes,
        note=note,
    )


def diagnose(link: Link, meshes: Meshes, tolerance: float = LIMIT) -> LinkDiagnosis:
    """The verdict on a link by its visual or its collision shapes. Unknown if any visual shape can't be found or read,
    or any collision shape of a link without visual ones.
    """
    if link.mass == 0.0 and not link.shapes:
        note = "mass 0 and no shape: it only marks a place" + ("; its tensor isn't 0" if np.any(link.inertia) else "")
        return LinkDiagnosis(link.name, "", FRAME, link.mass, note=note)
    shapes = {role: [shape for shape in link.shapes if shape.role == role] for role in (VISUAL, COLLISION)}
    readable: dict[str, LinkShapes] = {}
    lost: dict[str, str] = {}
    for role, of_role in shapes.items():
        try:
            if of_role:
                readable[role] = meshes.parts(of_role)
        except InputError as error:
            lost[role] = str(error)
    missing = VISUAL if VISUAL in lost else COLLISION if COLLISION in lost and not readable else ""
    if missing or not readable:
        note = lost.get(missing, "no shape to compare it with")
        note = "; ".join(filter(None, [link.problem, note])) if missing else link.problem or note
        name = shapes[missing][0].file or shapes[missing][0].kind if missing else ""
        bare = LinkDiagnosis(link.name, name, UNKNOWN, link.mass, note=note, judged_by=missing)
        return _check_possible(link, bare, [])
    best, verdict = _judge(link, readable, tolerance)
    by_shape_alone = verdict.status in (BEYOND_SHAPE, EXPLAINED) and best.status != EXPLAINED
    if by_shape_alone and any(parts.upright() for parts in readable.values()):
        turned = {role: parts.upright() or parts for role, parts in readable.items()}
        if _judge(link, turned, tolerance)[1].status not in WRONG:
            note = f"{verdict.causes[-1]}, but not if its meshes are turned upright as their files say: programs differ"
            verdict = replace(verdict, status=UNKNOWN, causes=(), note=note)
    told = _remarks(readable[VISUAL if VISUAL in readable else COLLISION])
    return replace(verdict, info=(*lost.values(), *told, *verdict.info))


def _judge(link: Link, readable: dict[str, LinkShapes], tolerance: float) -> tuple[LinkDiagnosis, LinkDiagnosis]:
    """The diagnosis by the shapes that decide, without and with the check whether they can have the link's inertial."""
    found = [_compare(link, parts, tolerance, role) for role, parts in readable.items()]
    best = min(found, key=lambda one: _preference(one, readable[one.judged_by]))
    only_primitives = all(parts.are_primitives for parts in readable.values())
    return best, _check_possible(link, best, [parts.points for parts in readable.values()], only_primitives)


def missing_inertial(link: Link, meshes: Meshes, density: float) -> MassProperties:
    """The inertial of a link that has none: that of its visual shapes, or of its collision shapes if it has no others,
    as solids of ``density`` [kg/m³]. Raises InputError if a shape can't be found or read, or encloses no solid.
    """
    shown = [shape for shape in link.shapes if shape.role == VISUAL]
    parts = meshes.parts(shown or link.shapes)
    properties = parts.uniform(density * sum(solid.mass for solid in parts.solids))
    check_finite(f"link {link.name}", mass=properties.mass, inertia=properties.inertia)
    check_tensor(properties.inertia, source=f"tensor of link {link.name}")
    return properties


def _remarks(parts: LinkShapes) -> list[str]:
    """What the user of a link's meshes may not expect."""
    bodies = [body for _, body in parts.parts if body is not None]
    told = [f"{body.mesh.name}: {text}" for body in bodies for text in remarks(body, parts.diagonal)]
    return list(dict.fromkeys(told))


def _preference(diagnosis: LinkDiagnosis, parts: LinkShapes) -> tuple[bool, ...]:
    """Sort key of a link's diagnoses; the smallest decides. First comes one that finds the inertial uniform; then that
    of meshes, since primitives replace meshes; then one with numbers; then that of visual shapes, which are finer than
    collision shapes.
    """
    has_numbers = diagnosis.expected is not None
    return diagnosis.status != UNIFORM, parts.are_primitives, not has_numbers, diagnosis.judged_by == COLLISION


def _check_possible(
    link: Link, diagnosis: LinkDiagnosis, inside: list[Points], only_primitives: bool = False
) -> LinkDiagnosis:
    """The diagnosis, with the verdict changed if the link's inertial is impossible or not judged. inside: points (n, 3)
    of the shapes.
    """
    if link.problem:
        return diagnosis
    if reason := impossible_inertial(link):
        return replace(diagnosis, status=IMPOSSIBLE, causes=(reason, *diagnosis.causes))
    if only_primitives and diagnosis.status == NOT_UNIFORM:
        note = f"its shapes are primitives only: not judged against them; {diagnosis.note}"
        return replace(diagnosis, status=NOT_JUDGED, note=note)
    if diagnosis.status != UNIFORM and inside and (reason := beyond_shapes(link, np.concatenate(inside))):
        if diagnosis.causes:
            return replace(diagnosis, status=EXPLAINED, causes=(*diagnosis.causes, reason))
        return replace(diagnosis, status=BEYOND_SHAPE, causes=(reason,))
    if diagnosis.status == NOT_UNIFORM and diagnosis.causes:
        told = f"{diagnosis.causes[0]}: maybe on purpose or by chance, since the tensor isn't that of the shapes either"
        return replace(diagnosis, causes=(), info=(*diagnosis.info, told))
    return diagnosis


def _by_mesh(
    links: list[Link], mesh: str, scale: Vector3 | None, accept_open: float, tolerance: float
) -> LinkDiagnosis:
    """The verdict by a given mesh on the one link with a shape of its name, or else on the only link with an
    inertial.
    """
    body = mesh_body(load_mesh(mesh), accept_open=accept_open)
    shapes = [(link, shape) for link in links for shape in link.shapes if shape.kind == "mesh"]
    pairs = [(link, shape) for link, shape in shapes if Path(shape.file).stem == Path(body.mesh.path).stem]
    plain = Shape(VISUAL, "mesh", HERE, mesh)
    pairs = pairs or [(link, plain) for link in links if not link.problem]
    different = {repr((link.name, replace(shape, role="", file="", problem=""))) for link, shape in pairs}
    if len(different) != 1:
        names = ", ".join(dict.fromkeys(f"{link.name} ({shape.file})" for link, shape in pairs)) or "none"
        raise InputError("compare", f"{body.mesh.name} fits {len(different)} shapes of: {names}", "one link's shape")
    link, shape = pairs[0]
    parts = LinkShapes([(shape if scale is None else replace(shape, scale=scale), body)])
    return _check_possible(link, _compare(link, parts, tolerance, shape.role), [parts.points])


@np.errstate(all="ignore")  # for numbers near the largest, which are judged
def compare_robot(
    path: Path,
    *,
    mesh: str | None = None,
    scale: Vector3 | None = None,
    folders: tuple[Path, ...] = (),
    accept_open: float = 0.0,
    tolerance: float = LIMIT,
) -> list[LinkDiagnosis]:
    """Diagnose a file's links; the worst verdicts and the largest errors come first. mesh: diagnose only the link that
    it belongs to, by that mesh at ``scale``. folders: searched for meshes, too. tolerance: relative differences up to
    it are taken as rounding.

    Raises InputError if the file, or nothing in it, can be diagnosed.
    """
    links = read_robot(path).links
    if mesh is not None:
        return [_by_mesh(links, mesh, scale, accept_open, tolerance)]
    meshes = Meshes(Search(path.parent, folders), accept_open)
    diagnoses = [diagnose(link, meshes, tolerance) for link in links]
    if not diagnoses:
        raise InputError("compare", path.name, "links with an inertial or a shape")
    return sorted(diagnoses, key=lambda diagnosis: (VERDICTS.index(diagnosis.status), -diagnosis.error))
