# SPDX-License-Identifier: MIT
"""A verdict on each inertial of a robot file, the first of these words that holds:

* impossible: no body has it (mass > 0, tensor positive definite, A + B >= C);
* impossible for its shape: no mass distribution inside the link's shapes has it (robots/realizable.py);
* explained: it isn't the uniform solid's, and a usual mistake turns that one into it (robots/causes.py);
* not uniform: it isn't the uniform solid's, but some distribution inside the shapes has it;
* uniform: it is the uniform solid's, to the tolerance and the digits printed;
* unknown: it can't be compared, for want of a shape that encloses a volume.

The file's mass is taken as it is, so that the tensor and the COM are checked for themselves. What a link shows and what
it collides with are compared each, and the better of both is named; a mass distribution may lie in either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..base.errors import InputError
from ..mass.from_mesh import mesh_body
from ..mass.properties import MassProperties
from ..mesh.locate import Search
from ..mesh.reading import load_mesh
from .causes import LIMIT, explain_center, explain_inertia
from .link_shapes import LinkShapes, Meshes
from .model import COLLISION, VISUAL, Link, Shape
from .reading import read_robot
from .realizable import MAX_ROUNDING, beyond_shapes, impossible_inertial

IMPOSSIBLE, BEYOND_SHAPE, EXPLAINED = "impossible", "impossible for its shape", "explained"
NOT_UNIFORM, UNIFORM, UNKNOWN = "not uniform", "uniform", "unknown"
WRONG = (IMPOSSIBLE, BEYOND_SHAPE, EXPLAINED)
"""Verdicts on inertials that nobody can have meant."""
VERDICTS = (*WRONG, NOT_UNIFORM, UNIFORM, UNKNOWN)


@dataclass(frozen=True)
class LinkDiagnosis:
    """One link: ``status`` is one of VERDICTS; errors are relative (COM over the box's diagonal), ``ratio`` is the
    tensor's size over that of the uniform solid; ``judged_by`` says whether by its visual or its collision shapes,
    ``expected`` what they have as a uniform solid of the link's mass."""

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

    @property
    def error(self) -> float:
        """The larger of the errors."""
        return max(self.center_of_mass_error or 0.0, self.inertia_error or 0.0)

    def as_dict(self) -> dict:
        """The diagnosis as a JSON object; ``expected`` is in the link's axes."""
        expected = self.expected and {
            "mass": self.expected.mass,
            "center_of_mass": self.expected.center_of_mass.tolist(),
            "inertia": self.expected.inertia.tolist(),
        }
        mass = None if math.isnan(self.mass) else self.mass
        return {**vars(self), "mass": mass, "causes": list(self.causes), "expected": expected}


def _tensor_error(link: Link, truth: MassProperties) -> tuple[float, float]:
    """(relative difference of the tensor, how much of it the digits printed don't explain)."""
    size = float(np.max(np.abs(truth.inertia)))
    # A rounded mass changes the whole tensor by one factor, rounded entries change each by its own step.
    slack = min(link.mass_step / link.mass, MAX_ROUNDING)
    factor = float(np.sum(link.inertia * truth.inertia) / np.sum(truth.inertia**2))
    factor = min(max(factor, 1.0 - slack), 1.0 + slack)
    excused = np.minimum(link.inertia_step, MAX_ROUNDING * size)
    left = np.maximum(np.abs(link.inertia - factor * truth.inertia) - excused, 0.0)
    return float(np.max(np.abs(link.inertia - truth.inertia))) / size, float(np.max(left)) / size


def _compared(link: Link, parts: LinkShapes, tolerance: float, role: str) -> LinkDiagnosis:
    """The link's inertial compared with that of its shapes of one role as a solid of one density."""
    plain = LinkDiagnosis(link.name, parts.names, UNKNOWN, link.mass, note=link.problem, judged_by=role)
    if not 0.0 < link.mass < math.inf:  # NaN for a link without an inertial
        return plain
    try:
        volume, truth = parts.volume(), parts.properties(link.mass)
    except InputError as error:
        return replace(plain, note=str(error))
    if not np.isfinite(link.inertia).all() or not np.isfinite(link.center_of_mass).all():
        return replace(plain, expected=truth)
    offset = np.abs(link.center_of_mass - truth.center_of_mass)
    center_left = float(np.max(offset - np.minimum(link.center_step, MAX_ROUNDING * parts.diagonal))) / parts.diagonal
    inertia_error, inertia_left = _tensor_error(link, truth)
    causes: tuple[str, ...] = ()
    if inertia_left > tolerance:
        causes += explain_inertia(link.inertia, truth, link.center_of_mass, parts)
    if center_left > tolerance:
        causes += explain_center(link.center_of_mass, truth, parts)
    note = f"density {link.mass / volume:.4g} kg/m³"
    if not 1.0 <= link.mass / volume <= 25000.0:
        note += ", which no solid has: units of the mesh or of the mass?"
    return replace(
        plain,
        status=EXPLAINED if causes else NOT_UNIFORM if max(inertia_left, center_left) > tolerance else UNIFORM,
        center_of_mass_error=float(np.max(offset)) / parts.diagonal,
        inertia_error=inertia_error,
        ratio=float(np.sum(link.inertia * truth.inertia) / np.sum(truth.inertia**2)),
        causes=causes,
        expected=truth,
        note=note,
    )


def diagnose(link: Link, meshes: Meshes, tolerance: float = LIMIT) -> LinkDiagnosis:
    """The verdict on a link: by what it shows and by what it collides with, the better of both."""
    found, inside = [], []
    for role in (VISUAL, COLLISION):
        shapes = [shape for shape in link.shapes if shape.role == role]
        if not shapes:
            continue
        try:
            parts = meshes.parts(shapes)
        except InputError as error:
            name, note = shapes[0].file or shapes[0].kind, link.problem or str(error)
            found.append(LinkDiagnosis(link.name, name, UNKNOWN, link.mass, note=note, judged_by=role))
            continue
        found.append(_compared(link, parts, tolerance, role))
        inside.append(parts.points)
    bare = LinkDiagnosis(link.name, "", UNKNOWN, link.mass, note=link.problem or "no shape to compare it with")
    return _possible(link, min(found, key=_quality, default=bare), inside)


def _quality(diagnosis: LinkDiagnosis) -> tuple[int, bool, float]:
    """The better of two diagnoses of a link has the smaller one: the closest verdict, then by error."""
    order = (UNIFORM, EXPLAINED, NOT_UNIFORM, UNKNOWN).index(diagnosis.status)
    return order, diagnosis.expected is None, diagnosis.error


def _possible(link: Link, diagnosis: LinkDiagnosis, inside: list[np.ndarray]) -> LinkDiagnosis:
    """The diagnosis with the verdict that the link's inertial is impossible, where it is; ``inside``: points (n, 3) of
    the shapes.
    """
    if link.problem:
        return diagnosis
    if reason := impossible_inertial(link):
        return replace(diagnosis, status=IMPOSSIBLE, causes=(reason, *diagnosis.causes))
    if inside and (reason := beyond_shapes(link, np.concatenate(inside))):
        return replace(diagnosis, status=BEYOND_SHAPE, causes=(reason, *diagnosis.causes))
    return diagnosis


def _by_mesh(
    links: list[Link], mesh: str, scale: np.ndarray | None, accept_open: float, tolerance: float
) -> LinkDiagnosis:
    """The verdict on the one link with a shape of the mesh's name, or the only one with an inertial, by that mesh."""
    body = mesh_body(load_mesh(mesh), accept_open=accept_open)
    pairs = [
        (link, shape)
        for link in links
        for shape in link.shapes
        if shape.kind == "mesh" and Path(shape.file).stem == Path(body.mesh.path).stem
    ]
    if not pairs:
        plain = Shape(VISUAL, "mesh", np.eye(3), np.zeros(3), mesh)
        pairs = [(link, plain) for link in links if not link.problem]
    different = {
        (link.name, shape.scale.tobytes(), shape.rotation.tobytes(), shape.position.tobytes()) for link, shape in pairs
    }
    if len(different) != 1:
        names = ", ".join(dict.fromkeys(f"{link.name} ({shape.file})" for link, shape in pairs)) or "none"
        raise InputError("compare", f"{body.mesh.name} fits {len(different)} shapes of: {names}", "one link's shape")
    link, shape = pairs[0]
    parts = LinkShapes([(shape if scale is None else replace(shape, scale=scale), body)])
    return _possible(link, _compared(link, parts, tolerance, shape.role), [parts.points])


@np.errstate(all="ignore")  # of numbers near the largest, which are judged
def compare_robot(
    path: Path,
    *,
    mesh: str | None = None,
    scale: np.ndarray | None = None,
    folders: tuple[Path, ...] = (),
    accept_open: float = 0.0,
    tolerance: float = LIMIT,
) -> list[LinkDiagnosis]:
    """Diagnoses of a file's links, the worst verdict and those farthest off first; with ``mesh`` of the one link that
    the mesh belongs to, by that mesh at ``scale``. Meshes are looked for in ``folders``, too; relative differences up
    to ``tolerance`` are taken for rounding.

    Raises InputError when the file, or nothing in it, can be diagnosed.
    """
    links = read_robot(path).links
    if mesh is not None:
        return [_by_mesh(links, mesh, scale, accept_open, tolerance)]
    meshes = Meshes(Search(path.parent, folders), accept_open)
    diagnoses = [diagnose(link, meshes, tolerance) for link in links]
    if not diagnoses:
        raise InputError("compare", path.name, "links with an inertial or a shape")
    return sorted(diagnoses, key=lambda diagnosis: (VERDICTS.index(diagnosis.status), -diagnosis.error))
