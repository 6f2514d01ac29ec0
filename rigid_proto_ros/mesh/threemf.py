# SPDX-License-Identifier: MIT
"""3D Manufacturing Format (.3mf), core specification 1.3 with the production extension: the items to be built."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ElementTree
import zipfile

import numpy as np

from ..base.errors import MeshError
from ..base.vectors import FloatArray, Points, Triangles
from .assembly import Assembly, tag_of

UNITS = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}
SUPPORTS = ("support", "solidsupport")
"""Types of objects that support a part during printing and don't belong to it."""
MAX_RATIO, SPARE = 100, 1_000_000
"""Bytes unpacked, for each byte of the file and beyond: models shrink to a tenth, and what is made to fill the memory
to a thousandth.
"""
MAX_DEPTH = 100
"""Of objects within objects."""
MAX_PLACES = 100_000
"""Maximum number of placements of objects, nested ones included; a file with more is refused."""
_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
_READ = (_CORE, _PRODUCTION, "http://schemas.microsoft.com/3dmanufacturing/material/2015/02")


def _matrix(text: str | None) -> FloatArray:
    """The matrix (4, 4), for column vectors, of a transform's twelve numbers, which apply to row vectors."""
    matrix = np.eye(4)
    if text is not None:
        rows = np.array([float(word) for word in text.split()]).reshape(4, 3)
        matrix[:3] = rows.T
    return matrix


class _Package:
    """The model files of an archive and their objects."""

    def __init__(self, archive: zipfile.ZipFile, assembly: Assembly) -> None:
        self._archive = archive
        self._assembly = assembly
        self._names = {f"/{name.lower().lstrip('/')}": name for name in archive.namelist()}
        self._models: dict[str, tuple[ElementTree.Element, dict[str, ElementTree.Element]]] = {}
        self._places: dict[tuple[str, str], int] = {}

    def refusal(self, reason: str, accepted: str = "") -> MeshError:
        """An error that names the file."""
        return MeshError(self._assembly.name, reason, accepted)

    def _read(self, name: str) -> bytes:
        """A file of the archive, as long as its directory says at most."""
        entry = self._archive.getinfo(name)
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):  # others unpack all that there is
            raise self.refusal(f"{name} is compressed by method {entry.compress_type}", "DEFLATE, as packages have it")
        with self._archive.open(entry) as stream:
            return stream.read(entry.file_size)

    def root(self) -> str:
        """Path of the model file with the items to be built."""
        if "/_rels/.rels" in self._names:
            for relation in ElementTree.fromstring(self._read(self._names["/_rels/.rels"])):
                if relation.get("Type", "").endswith("/3dmodel"):
                    return "/" + relation.get("Target", "").lstrip("/")
        models = [name for name in self._names if name.endswith(".model")]
        if len(models) != 1:
            raise self.refusal(f"{len(models)} files .model and no relation that says which one is to be built")
        return models[0]

    def model(self, path: str) -> tuple[ElementTree.Element, dict[str, ElementTree.Element]]:
        """The root element of a model file and its objects by their ids."""
        if path not in self._models:
            name = self._names.get(path.lower())
            if name is None:
                raise self.refusal(f"it names the model file {path!r}, which isn't in it")
            parser = ElementTree.iterparse(io.BytesIO(self._read(name)), events=("start-ns",))
            prefixes = dict(names for _, names in parser)
            model = parser.root  # type: ignore[attr-defined]  # set once the file is read
            for prefix in model.get("requiredextensions", "").split():
                if prefixes.get(prefix) not in _READ:
                    raise self.refusal(f"it requires the extension {prefixes.get(prefix, prefix)}")
            objects = {part.get("id", ""): part for part in model.iter(f"{{{_CORE}}}object")}
            self._models[path] = model, objects
        return self._models[path]

    def unit(self, path: str) -> float:
        """Unit of a model file in metres."""
        unit = self.model(path)[0].get("unit", "millimeter")
        if unit not in UNITS:
            raise self.refusal(f"unit {unit}", f"a file in one of {', '.join(UNITS)}")
        return UNITS[unit]

    def places(self, reference: ElementTree.Element, path: str, depth: int = 0) -> int:
        """How many objects are placed by what an item or component in the file ``path`` refers to, each object counted
        once and multiplied. Raises MeshError for more than MAX_PLACES, and for objects within themselves.
        """
        target, number = reference.get(f"{{{_PRODUCTION}}}path", path), reference.get("objectid", "")
        total = self._places.get((target, number), 0)
        if total:
            return total
        found, total = self.model(target)[1].get(number), 1
        if found is not None and found.get("type") not in SUPPORTS and depth <= MAX_DEPTH:
            parts = (part for child in found if tag_of(child) == "components" for part in child)
            total += sum(self.places(part, target, depth + 1) for part in parts)
        if total > MAX_PLACES or depth > MAX_DEPTH:
            raise self.refusal(f"its components place objects more than {MAX_PLACES} times, or within themselves")
        self._places[target, number] = total
        return total

    def place(self, reference: ElementTree.Element, path: str, above: FloatArray) -> None:
        """Add the object that an item or component in the file ``path`` refers to."""
        target = reference.get(f"{{{_PRODUCTION}}}path", path)
        number = reference.get("objectid", "")
        found = self.model(target)[1].get(number)
        if found is None:
            raise self.refusal(f"it places object {number!r}, which isn't in {target}")
        if found.get("type") in SUPPORTS:
            return
        ratio = self.unit(target) / self.unit(path)
        matrix = above @ _matrix(reference.get("transform")) @ np.diag([ratio, ratio, ratio, 1.0])
        for child in found:
            if tag_of(child) == "mesh":
                self._assembly.add(*self._mesh(child), matrix, f"object {number}")
            elif tag_of(child) == "components":
                for component in child:
                    self.place(component, target, matrix)
            elif tag_of(child) != "metadatagroup":
                raise self.refusal(f"object {number} is made of {tag_of(child)}", "objects of mesh and components")

    def _mesh(self, mesh: ElementTree.Element) -> tuple[Points, Triangles]:
        """Vertices (n, 3) and triangles (m, 3) of a mesh element."""
        vertices, triangles = [], []
        for child in mesh:
            if tag_of(child) == "vertices":
                vertices += [[float(vertex.attrib[axis]) for axis in "xyz"] for vertex in child]
            elif tag_of(child) == "triangles":
                triangles += [[int(triangle.attrib[corner]) for corner in ("v1", "v2", "v3")] for triangle in child]
            elif tag_of(child) != "trianglesets":
                raise self.refusal(f"a mesh with {tag_of(child)}", "meshes of vertices and triangles")
        return np.array(vertices).reshape(-1, 3), np.array(triangles, dtype=np.int64).reshape(-1, 3)


def add_threemf(data: bytes, assembly: Assembly, max_bytes: int) -> float:
    """Add the items to be built, except supports, in a file's bytes, in the file's unit; returns this unit in metres.

    An archive of more than ``max_bytes``, or of far more than a model of its size holds, unpacked, is refused.

    Raises MeshError, or other errors if the file doesn't follow the specification.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
        most = min(max_bytes, MAX_RATIO * len(data) + SPARE)
        if size > most:
            raise MeshError(assembly.name, f"{size} bytes unpacked", f"at most {most} in a file of {len(data)}")
        package = _Package(archive, assembly)
        root = package.root()
        unit = package.unit(root)
        build = package.model(root)[0].find(f"{{{_CORE}}}build")
        items = [] if build is None else list(build)
        if sum(package.places(item, root) for item in items) > MAX_PLACES:
            raise package.refusal(f"it builds more than {MAX_PLACES} objects")
        for item in items:
            package.place(item, root, np.eye(4))
    return unit
