# SPDX-License-Identifier: MIT
"""The file for the name of a mesh: a path, a ``package://`` or ``model://`` URI, or a bundled name."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from ..base.bundled import BODIES, PACKAGE_FOLDER, body_names
from ..base.errors import MeshError, did_you_mean


@dataclass(frozen=True)
class Search:
    """Additional places to search: ``near``, the folder of the file that names the mesh, for relative paths and for
    packages in it or above it; ``folders`` that hold packages or models, or are one themselves."""

    near: Path | None = None
    folders: tuple[Path, ...] = ()


NOWHERE_ELSE = Search()


def _installed_package(package: str) -> Path | None:
    """Share folder of a ROS package, or this package's own folder for its own name."""
    try:
        from ament_index_python.packages import get_package_share_directory

        return Path(get_package_share_directory(package))
    except (ImportError, LookupError, ValueError, OSError):  # OSError: no ROS environment is set up
        return PACKAGE_FOLDER if package == "rigid_proto_ros" else None


def _names_itself(folder: Path, package: str) -> bool:
    """Whether the folder or its package.xml is named ``package``."""
    if folder.name == package:
        return True
    try:
        text = (folder / "package.xml").read_text("utf-8", "replace")
    except OSError:
        return False
    found = re.search(r"<name>\s*([^<\s]+)\s*</name>", text)
    return found is not None and found.group(1) == package


def _package_folders(package: str, search: Search) -> Iterator[Path]:
    """Candidates for the package or model: the given folders, then installed ones, then upwards from the file."""
    for folder in search.folders:
        if _names_itself(folder.absolute(), package):
            yield folder
        yield folder / package
    installed = _installed_package(package)
    if installed is not None:
        yield installed
        if package == "rigid_proto_ros":
            yield PACKAGE_FOLDER
    if search.near is not None:
        near = search.near.absolute()
        for folder in (near, *near.parents):
            if _names_itself(folder, package):
                yield folder
            yield folder / package


def resolve_mesh(name: str, search: Search = NOWHERE_ELSE) -> Path:
    """The file for ``name`` (a path, ``package://package/path``, ``model://model/path`` or a bundled name).

    Raises MeshError when there is none, with the bundled names and the closest match.
    """
    scheme, colon, rest = name.partition("://")
    try:
        if colon and scheme in ("package", "model"):
            return _in_package(name, *rest.partition("/")[::2], search)
        if colon and scheme not in ("file", ""):
            raise MeshError("mesh", name, "a path, file://, package://, model:// or a bundled name")
        return _at_path(rest if colon else name, search, uri=bool(colon))
    except (OSError, RuntimeError, ValueError) as error:
        if isinstance(error, MeshError):
            raise
        # a name too long or with a NUL, an unreadable folder, an unknown home directory
        reason = getattr(error, "strerror", None) or str(error).rstrip(".")
        accepted = f"a file that can be read, package://<package>/<path>, or a bundled name ({reason})"
        raise MeshError("mesh", name, accepted) from None


def _at_path(name: str, search: Search, uri: bool) -> Path:
    path = Path(name).expanduser()
    bundled = BODIES / f"{name}.obj"
    spelled = [path, Path(unquote(name)).expanduser()] if uri else [path]  # as written, or with %20 for a blank
    places = [search.near / path for path in spelled] if search.near is not None else []
    for place in (*places, *spelled, *([bundled] if name and "/" not in name else [])):
        if place.is_file():
            return place.resolve()
    if path.is_dir():
        raise MeshError("mesh", f"{name!r} is a folder, not a mesh file")
    names = body_names()
    hint = did_you_mean(path.name, names)
    known = f"the bundled meshes are {', '.join(names)}"
    raise MeshError("mesh", f"there is no file and no bundled mesh {name!r}; {' '.join(filter(None, [hint, known]))}")


def _in_package(name: str, package: str, inside: str, search: Search) -> Path:
    """The file ``inside`` a package or model; a folder of that name without the file doesn't end the search."""
    missing: Path | None = None
    for folder in _package_folders(package, search):
        for path in dict.fromkeys((folder / inside, folder / unquote(inside))):
            if path.is_file():
                return path.resolve()
        if missing is None and folder.is_dir():
            missing = folder / inside
    if missing is not None:
        raise MeshError("mesh", f"there is no file {str(missing)!r} in the package of {name!r}")
    where = f", and none above {str(search.near)!r}; give its folder by --package-path DIR" if search.near else ""
    raise MeshError("mesh", f"the package {package!r} of {name!r} was not found{where}")
