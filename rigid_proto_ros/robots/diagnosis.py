# SPDX-License-Identifier: MIT
"""A verdict on each inertial of a robot file, the first of these words that holds:

* impossible: no body has it (mass > 0, tensor positive definite, A + B >= C);
* impossible for its shape: no mass distribution inside the link's shapes has it (robots/realizable.py);
* explained: it isn't the uniform solid's, and a usual mistake turns that one into it (robots/causes.py);
* not uniform: it isn't the uniform solid's, but some distribution inside the shapes has it;
* uniform: it is the uniform solid's, to the tolerance and the digits printed;
* unknown: it can't be compared, for want of a shape that encloses a volume.

The file's mass is taken as it is, so that the tensor and the COM are checked for themselves; with a density (or mass)
given on the command line the mass is checked, too. What a link shows and what it collides with are compared each, and
the better of both is named; a mass distribution may lie in either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..base.errors import InputError, did_you_mean
from ..mass.from_mesh import MeshBody, mesh_body
from ..mass.properties import MassProperties
from ..mesh.locate import Search, resolve_mesh
from ..mesh.reading import MAX_TRIANGLES, load_mesh
from .causes import LIMIT, explain_center, explain_inertia
from .link_shapes import LinkShapes, Meshes
from .model import COLLISION, VISUAL, WATER, Link, Shape
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
    tensor's size over that of the uniform solid; ``judged_by`` says whether by its visual or its collision shapes, of
    which ``volume`` [m³] is the sum."""

    link: str
    mesh: str
    status: str
    mass: float
    mass_error: float | None = None
    center_of_mass_error: float | None = None
    inertia_error: float | None = None
    ratio: float | None = None
    causes: tuple[str, ...] = ()
    expected: MassProperties | None = None
    note: str = ""
    judged_by: str = ""
    volume: float = 0.0

    @property
    def error(self) -> float:
        """The largest of the errors."""
        return max(self.mass_error or 0.0, self.center_of_mass_error or 0.0, self.inertia_error or 0.0)

    def as_dict(self) -> dict:
        """The diagnosis as a JSON object; ``expected`` is in the link's axes."""
        expected = self.expected and {
            "mass": self.expected.mass,
            "center_of_mass": self.expected.center_of_mass.tolist(),
            "inertia": self.expected.inertia.tolist(),
        }
        return {
            "link": self.link,
            "mesh": self.mesh,
            "status": self.status,
            "mass": None if math.isnan(self.mass) else self.mass,
            "mass_error": self.mass_error,
            "center_of_mass_error": self.center_of_mass_error,
            "inertia_error": self.inertia_error,
            "ratio": self.ratio,
            "causes": list(self.causes),
            "expected": expected,
            "note": self.note,
            "judged_by": self.judged_by,
        }


@dataclass(frozen=True)
class Options:
    """How shapes are taken, and where their files are looked for. ``mass`` or ``density`` > 0 is the true one of every
    link. ``tolerance``: relative differences up to this are taken for rounding.
    """

    mass: float = 0.0
    density: float = 0.0
    repair: bool | str = False
    fallback: str = ""
    accept_open: float = 0.0
    max_triangles: int = MAX_TRIANGLES
    folders: tuple[Path, ...] = ()
    tolerance: float = LIMIT

    def mass_of(self, volume: float) -> float:
        """The true mass of a link of ``volume`` [m³], 0 where none is given."""
        return self.mass or self.density * volume


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


def diagnose(link: Link, parts: LinkShapes, options: Options, judged_by: str = "") -> LinkDiagnosis:
    """Compare one link with shapes of its own as a solid of one density."""
    plain = LinkDiagnosis(link.name, parts.names, UNKNOWN, link.mass, judged_by=judged_by)
    try:
        volume = parts.volume()
        plain = replace(plain, volume=volume)
        wanted = options.mass_of(volume)
        if link.problem:
            return replace(plain, note=link.problem, expected=parts.properties(wanted or WATER * volume))
        finite = np.all(np.isfinite(link.inertia)) and np.all(np.isfinite(link.center_of_mass))
        if not (0.0 < link.mass < math.inf) or not finite:
            known = wanted or link.mass
            return replace(plain, expected=parts.properties(known) if 0.0 < known < math.inf else None)
        truth = parts.properties(link.mass)
    except InputError as error:
        return replace(plain, note=": ".join(filter(None, (link.problem, str(error)))))
    diagonal = parts.diagonal
    offset = np.abs(link.center_of_mass - truth.center_of_mass)
    center_left = float(np.max(offset - np.minimum(link.center_step, MAX_ROUNDING * diagonal))) / diagonal
    inertia_error, inertia_left = _tensor_error(link, truth)
    mass_error = abs(link.mass - wanted) / wanted if wanted else None
    causes: tuple[str, ...] = ()
    if inertia_left > options.tolerance:
        causes += explain_inertia(link.inertia, link.mass, link.center_of_mass, parts)
    if center_left > options.tolerance:
        causes += explain_center(link.center_of_mass, parts, truth)
    if mass_error is not None and mass_error > options.tolerance + min(link.mass_step / link.mass, MAX_ROUNDING):
        causes += (f"mass: {wanted:.6g} kg expected",)
    note = f"density {link.mass / volume:.4g} kg/m³"
    if not 1.0 <= link.mass / volume <= 25000.0:
        note += ", which no solid has: units of the mesh or of the mass?"
    expected = truth
    if wanted:
        expected = MassProperties(wanted, truth.center_of_mass, truth.inertia * (wanted / link.mass))
    off = max(inertia_left, center_left) > options.tolerance
    return replace(
        plain,
        status=EXPLAINED if causes else NOT_UNIFORM if off else UNIFORM,
        mass_error=mass_error,
        center_of_mass_error=float(np.max(offset)) / diagonal,
        inertia_error=inertia_error,
        ratio=float(np.sum(link.inertia * truth.inertia) / np.sum(truth.inertia**2)),
        causes=causes,
        expected=expected,
        note=note,
    )


class Doctor:
    """Judges the links of a robot file."""

    def __init__(self, path: Path, links: list[Link], options: Options, meshes: Meshes | None = None) -> None:
        self.options = options
        search = Search(path.parent, options.folders)
        self.meshes = meshes or Meshes(
            search,
            options.max_triangles,
            repair=options.repair,
            fallback=options.fallback,
            accept_open=options.accept_open,
        )
        self.links = links

    def require(self, name: str) -> None:
        """Raise InputError when not one link has this name."""
        names = [known.name for known in self.links]
        if names.count(name) > 1:
            raise InputError("link", f"{names.count(name)} links are called {name!r}")
        if name not in names:
            hint = did_you_mean(name, names) or f"the links are {', '.join(names)}"
            raise InputError("link", f"there is no link {name!r} with an inertial or a shape; {hint}")

    def diagnoses(self, only: str | None = None) -> list[tuple[Link, LinkDiagnosis]]:
        """The links (or that one) with their diagnoses, in the file's order."""
        return [(link, self.diagnose(link)) for link in self.links if only in (None, link.name)]

    def diagnose(self, link: Link) -> LinkDiagnosis:
        """The verdict on a link: by what it shows and by what it collides with, the better of both."""
        found, inside = [], []
        for role in (VISUAL, COLLISION):
            shapes = [shape for shape in link.shapes if shape.role == role]
            if not shapes:
                continue
            try:
                parts = self.meshes.parts(shapes)
                inside.append(parts.points)
                found.append(diagnose(link, parts, self.options, role))
            except InputError as error:
                note = ": ".join(filter(None, (link.problem, str(error))))
                name = shapes[0].file or shapes[0].kind
                found.append(LinkDiagnosis(link.name, name, UNKNOWN, link.mass, note=note, judged_by=role))
        bare = LinkDiagnosis(link.name, "", UNKNOWN, link.mass, note=link.problem or "no shape to compare it with")
        return judged(link, min(found, key=_quality, default=bare), inside)

    def fitting(self, body: MeshBody) -> list[tuple[Link, Shape]]:
        """The links' shapes that are the mesh: by its whole path, else by its name without the ending."""
        shapes = [(link, shape) for link in self.links for shape in link.shapes if shape.kind == "mesh"]
        same = [pair for pair in shapes if self._is_file(pair[1].file, Path(body.mesh.path))]
        return same or [pair for pair in shapes if Path(pair[1].file).stem == Path(body.mesh.path).stem]

    def _is_file(self, name: str, path: Path) -> bool:
        try:
            return resolve_mesh(name, self.meshes.search) == path
        except InputError:
            return False


def judged(link: Link, diagnosis: LinkDiagnosis, inside: list[np.ndarray]) -> LinkDiagnosis:
    """The diagnosis with the verdict that the link's inertial is impossible, where it is; ``inside``: points (n, 3) of
    the shapes.
    """
    if link.problem:
        return diagnosis
    reasons = impossible_inertial(link)
    if reasons:
        return replace(diagnosis, status=IMPOSSIBLE, causes=(*reasons, *diagnosis.causes))
    beyond = beyond_shapes(link, np.concatenate(inside)) if inside else ""
    if beyond:
        return replace(diagnosis, status=BEYOND_SHAPE, causes=(beyond, *diagnosis.causes))
    return diagnosis


def _quality(diagnosis: LinkDiagnosis) -> tuple[int, bool, float]:
    """The better of two diagnoses of a link has the smaller one: the closest verdict, then by error."""
    order = {UNIFORM: 0, EXPLAINED: 1, NOT_UNIFORM: 2, UNKNOWN: 3}[diagnosis.status]
    return order, diagnosis.expected is None, diagnosis.error


def _by_mesh(doctor: Doctor, mesh: str, scale: np.ndarray | None, link_name: str | None) -> LinkDiagnosis:
    """The diagnosis of the one link that the mesh belongs to."""
    options = doctor.options
    loaded = load_mesh(mesh, max_triangles=options.max_triangles)
    body = mesh_body(loaded, repair=options.repair, fallback=options.fallback, accept_open=options.accept_open)
    pairs = [pair for pair in doctor.fitting(body) if link_name in (None, pair[0].name)]
    if not pairs:
        links = [link for link in doctor.links if not link.problem and link_name in (None, link.name)]
        pairs = [(link, Shape(VISUAL, "mesh", np.eye(3), np.zeros(3), mesh)) for link in links]
    different = {
        (link.name, shape.scale.tobytes(), shape.rotation.tobytes(), shape.position.tobytes()) for link, shape in pairs
    }
    if len(different) != 1:
        names = ", ".join(dict.fromkeys(f"{link.name} ({shape.file})" for link, shape in pairs)) or "none"
        accepted = "name it by its whole path, or the link with --link"
        raise InputError("compare", f"{body.mesh.name} fits {len(different)} shapes of: {names}; {accepted}")
    link, shape = pairs[0]
    if scale is not None:
        shape = replace(shape, scale=scale)
    parts = LinkShapes([(shape, body)])
    return judged(link, diagnose(link, parts, options, shape.role), [parts.points])


@np.errstate(all="ignore")  # of numbers near the largest, which are judged
def compare_robot(
    path: Path,
    options: Options,
    *,
    mesh: str | None = None,
    scale: np.ndarray | None = None,
    link: str | None = None,
) -> list[LinkDiagnosis]:
    """Diagnoses of a file's links, the worst verdict and those farthest off first; of ``link`` alone when it is named,
    and with ``mesh`` of the one link that the mesh belongs to, by that mesh at ``scale``.

    Raises InputError when the file, or nothing in it, can be diagnosed.
    """
    doctor = Doctor(path, read_robot(path).links, options)
    if link is not None:
        doctor.require(link)
    if mesh is not None:
        return [_by_mesh(doctor, mesh, scale, link)]
    diagnoses = [diagnosis for _, diagnosis in doctor.diagnoses(link)]
    if not diagnoses:
        raise InputError("compare", path.name, "links with an inertial or a shape")
    return sorted(diagnoses, key=lambda diagnosis: (VERDICTS.index(diagnosis.status), -diagnosis.error))
