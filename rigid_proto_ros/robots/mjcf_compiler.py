# SPDX-License-Identifier: MIT
"""MuJoCo's MJCF compiler in a separate process: a small file may replicate to a model that takes hours and all memory,
and the compiler can't be interrupted.

The process runs ``main``: it reads a pickled Question, writes a pickled Answer, and ends at its limits of time and
memory.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from ..base.errors import InputError
from ..base.interrupts import end_with_this_thread, with_this_package
from . import reading as rd

CPU_S = 10
"""Limit of processor time for one file [s]: 3000 bodies with a geom each take 3.4 s."""
WALL_S = 120.0
"""Limit of wall time [s], for a busy machine."""
MEMORY_BYTES = 1 << 30
"""Limit of address space; Python and MuJoCo alone take 143 MB."""


@dataclass(frozen=True)
class Question:
    """text: an MJCF with its includes. path: of the file. inertials: elements by the names of bodies. simulated: ask
    for links with the masses that MuJoCo uses instead of those in the file.
    """

    text: str
    path: Path
    inertials: dict[str, Element | None]
    simulated: bool


@dataclass(frozen=True)
class Answer:
    """Links, and the poses of the bodies in the world by name. refused: field and reason if the question has no
    answer.
    """

    links: list[rd.Link]
    poses: dict[str, rd.Pose]
    refused: tuple[str, str] | None = None


def ask(question: Question) -> Answer:
    """Answer a question in a new process. Raises InputError for what MuJoCo refuses or doesn't finish within the
    limits.
    """
    environment = {**with_this_package(), "OPENBLAS_NUM_THREADS": "1"}
    # -P: nothing is imported from the working folder, which may hold a stranger's files.
    command = [sys.executable, "-P", "-c", "from rigid_proto_ros.robots.mjcf_compiler import main; main()"]
    try:
        done = subprocess.run(
            command,
            input=pickle.dumps(question),
            capture_output=True,
            env=environment,
            timeout=WALL_S,
            check=False,
            preexec_fn=end_with_this_thread(),
        )
    except subprocess.TimeoutExpired:
        raise _beyond_limits(question) from None
    if done.returncode < 0:  # ended by a signal: at its limits, or by a fault in the compiler
        raise _beyond_limits(question)
    if done.returncode > 0:
        raise RuntimeError(done.stderr.decode(errors="replace"))
    answer: Answer = pickle.loads(done.stdout)
    if answer.refused is not None:
        raise InputError(*answer.refused)
    return answer


def _beyond_limits(question: Question) -> InputError:
    limits = f"what MuJoCo compiles in {CPU_S} s of a core and {MEMORY_BYTES >> 30} GiB"
    return InputError("robot file", question.path.name, limits)


def _set_limits() -> None:
    """Set the limits of this process."""
    try:
        import resource
    except ImportError:  # on Windows
        return
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))
    with contextlib.suppress(ValueError, OSError):  # macOS has no limit of memory
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))


class _Source:
    """A model's text and MuJoCo's reading of it. Files that it names are searched in the folder of ``path``."""

    def __init__(self, text: str, path: Path) -> None:
        import mujoco

        self.mujoco: Any = mujoco
        mujoco.set_mju_user_warning(lambda _: None)  # warnings would be written into a file in the robot's folder
        self.text = text
        self.path = path

    def parsed(self) -> Any:
        """A new MjSpec of the file, with default classes applied and models attached; nothing is computed."""
        with self._refusing("reads"):
            spec = self.mujoco.MjSpec.from_string(self.text)
        spec.compiler.fusestatic = spec.compiler.discardvisual = False  # they would drop bodies and geoms
        spec.compiler.usethread = False  # each thread takes address space
        for joint in spec.joints:
            joint.align = False  # it would move a body's frame into its principal axes
        self._delete(spec, "keys sensors actuators equalities tendons pairs excludes skins tuples")
        return spec

    def _delete(self, spec: Any, kinds: str) -> None:
        for kind in kinds.split():
            for element in list(getattr(spec, kind)):
                spec.delete(element)

    def without_files(self) -> Any:
        """A new spec with small spheres in place of meshes, height fields and textures."""
        spec = self.parsed()
        drawn = self.mujoco.mjtGeom
        for geom in spec.geoms:
            if geom.meshname or geom.type in (drawn.mjGEOM_HFIELD, drawn.mjGEOM_PLANE, drawn.mjGEOM_SDF):
                geom.type, geom.size, geom.fromto = drawn.mjGEOM_SPHERE, [1.0, 0.0, 0.0], [np.nan, 0, 0, 0, 0, 0]
            geom.meshname = geom.hfieldname = geom.material = ""
        for site in spec.sites:
            site.material = ""
        self._delete(spec, "meshes hfields materials textures")
        return spec

    def compiled(self, spec: Any) -> Any:
        """Compile a spec to an MjModel."""
        with self._refusing("compiles"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # for attributes that will be removed
            return spec.compile()

    @contextlib.contextmanager
    def _refusing(self, verb: str) -> Iterator[None]:
        try:
            with contextlib.chdir(self.path.parent):
                yield
        except MemoryError:
            raise
        except Exception as error:  # MuJoCo raises other exceptions, too, for an unexpected file
            reason = " ".join(str(error).replace("XML Error:", "").replace("Error:", "").split())
            raise InputError("robot file", self.path.name, f"what MuJoCo {verb} ({reason})") from None


def _shape(spec: Any, raw: Any, meshes: dict[str, Any], model: Any, number: int) -> rd.Shape | None:
    """The shape of a geom, ``raw`` as the file has it, at its compiled pose. None for a geom that isn't a solid."""
    kind = str(raw.type).rpartition("_")[2].lower()
    if kind in ("plane", "hfield"):
        return None
    role = rd.COLLISION if raw.contype or raw.conaffinity else rd.VISUAL
    pose = rd.Pose(rd.rotation_from_wxyz(model.geom_quat[number]), model.geom_pos[number].copy())
    shape = rd.Shape(role, kind, pose)
    if kind == "mesh":
        mesh = meshes.get(raw.meshname)
        if mesh is None or not mesh.file or np.any(mesh.refpos) or mesh.refquat.tolist() != [1.0, 0.0, 0.0, 0.0]:
            return replace(shape, file=raw.meshname, problem="a mesh without a file, or with refpos or refquat")
        file = Path(mesh.file).name if spec.strippath else mesh.file
        return replace(shape, file=str(Path(mesh.compiler.meshdir or "") / file), scale=mesh.scale.copy())
    a, b, c = (2.0 * model.geom_size[number]).tolist()
    sizes = {
        "box": (a, b, c),
        "cylinder": (0.5 * a, b),
        "capsule": (0.5 * a, b),
        "sphere": (0.5 * a,),
        "ellipsoid": (0.5 * a, 0.5 * b, 0.5 * c),
    }
    if raw.meshname or kind not in sizes:
        return replace(shape, problem=f"a {kind} fitted to a mesh" if raw.meshname else f"a geom of type {kind}")
    return replace(shape, size=sizes[kind])


def _link(spec: Any, body: Any, name: str, shapes: list[rd.Shape | None], inertial: Element | None) -> rd.Link:
    """A body with the inertial in the file."""
    bare = rd.Link(name, tuple(filter(None, shapes)))
    if not body.explicitinertial:
        return bare
    if np.isnan(body.fullinertia[0]):
        a, b, c = body.inertia.tolist()
        six = [a, 0.0, 0.0, b, 0.0, c]
    else:
        xx, yy, zz, xy, xz, yz = body.fullinertia.tolist()
        six = [xx, xy, xz, yy, yz, zz]
    quaternion = body.iquat
    if body.ialt.type != type(body.ialt.type).mjORIENTATION_QUAT:
        of = body.compiler
        quaternion = spec.resolve_orientation(degree=of.degree, sequence=of.eulerseq, orientation=body.ialt)
    center, rotation = " ".join(map(repr, body.ipos.tolist())), rd.rotation_from_wxyz(quaternion)
    return rd.printed_link(bare, repr(body.mass), center, [repr(value) for value in six], rotation, inertial)


def _poses(model: Any, names: list[str]) -> dict[str, rd.Pose]:
    """Poses of the bodies in the world, as the file gives them."""
    poses = [rd.HERE]
    for body in range(1, model.nbody):
        own = rd.Pose(rd.rotation_from_wxyz(model.body_quat[body]), model.body_pos[body])
        poses.append(poses[model.body_parentid[body]] @ own)
    return dict(zip(names, poses, strict=True))


def _simulated(source: _Source, links: list[rd.Link], names: list[str]) -> list[rd.Link]:
    """The links with the masses that MuJoCo uses: those of its <compiler>, and of the geoms where inertials are
    missing.
    """
    spec = source.parsed()
    always = source.mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    from_geoms = any(body.compiler.inertiafromgeom == always for body in spec.bodies)  # attached models have their own
    if not from_geoms and all(body.explicitinertial or not body.geoms for body in spec.bodies[1:]):
        spec = source.without_files()
    model = source.compiled(spec)
    known = {link.name: link for link in links}
    found = []
    for body, name in list(enumerate(names))[1:]:
        rotation = rd.rotation_from_wxyz(model.body_iquat[body])
        link = replace(
            known.get(name) or rd.Link(name),
            mass=float(model.body_mass[body]),
            center_of_mass=model.body_ipos[body].copy(),
            inertia=rotation @ np.diag(model.body_inertia[body]) @ rotation.T,
            problem="" if model.body_mass[body] > 0.0 else rd.NO_INERTIAL,
        )
        found.append(link)
    return found


def answered(question: Question) -> Answer:
    """Compute the answer in this process."""
    source = _Source(question.text, question.path)
    spec, frames = source.parsed(), source.without_files()
    for body in frames.bodies[1:]:  # MuJoCo may refuse the inertials in the file
        body.explicitinertial, body.mass, body.inertia = True, 1.0, [1.0, 1.0, 1.0]
        body.fullinertia = [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0]
    model = source.compiled(frames)
    names = [model.body(body).name or f"body {body}" for body in range(model.nbody)]
    meshes = {mesh.name: mesh for mesh in spec.meshes}
    shapes: dict[int, list[rd.Shape | None]] = {body: [] for body in range(model.nbody)}
    for raw, placed in zip(spec.geoms, frames.geoms, strict=True):
        shapes[int(model.geom_bodyid[placed.id])].append(_shape(spec, raw, meshes, model, placed.id))
    links = [
        _link(spec, raw, names[placed.id], shapes[placed.id], question.inertials.get(raw.name) if raw.name else None)
        for raw, placed in zip(spec.bodies[1:], frames.bodies[1:], strict=True)
    ]
    return Answer(_simulated(source, links, names) if question.simulated else links, _poses(model, names))


def main() -> None:
    """Answer the question on standard input."""
    answers = os.dup(1)
    os.dup2(2, 1)  # for anything that a library prints
    _set_limits()
    question: Question = pickle.load(sys.stdin.buffer)
    try:
        answer = answered(question)
    except (InputError, MemoryError) as error:
        refusal = error if isinstance(error, InputError) else _beyond_limits(question)
        answer = Answer([], {}, (refusal.field, str(refusal).removeprefix(f"{refusal.field}: ")))
    with open(answers, "wb") as pipe:
        pickle.dump(answer, pipe)
