# SPDX-License-Identifier: MIT
"""Where the package's own bodies, scenes and examples lie: source tree, virtual environment or ROS prefix."""

import os
from collections.abc import Iterator
from pathlib import Path

from .errors import InputError, one_of

PACKAGE = "rigid_proto_ros"
PACKAGE_FOLDER = Path(__file__).parent.parent
BODIES = PACKAGE_FOLDER / "bodies"


def body_names() -> list[str]:
    """Names of the bundled bodies, which are meshes (.obj, metres) in ``BODIES``, sorted."""
    return sorted(_files(BODIES, ".obj"))


def scene_path(name: str) -> Path:
    """Scene (ROS parameter file) ``config/<name>.yaml``. Raises InputError naming the scenes there are."""
    return _named("scene", name, _files(_shared("config"), ".yaml"))


def scene_names() -> list[str]:
    """Names of the bundled scenes, sorted."""
    return sorted(_files(_shared("config"), ".yaml"))


def study_path(name: str) -> Path:
    """Study ``config/studies/<name>.yaml``. Raises InputError naming the studies there are."""
    return _named("study", name, _files(_shared("config/studies"), ".yaml"))


def study_names() -> list[str]:
    """Names of the bundled studies, sorted."""
    return sorted(_files(_shared("config/studies"), ".yaml"))


def example_path(name: str) -> Path:
    """Poke script ``msg_examples/<name>.yaml``. Raises InputError naming the examples there are."""
    return _named("example", name, _files(_shared("msg_examples"), ".yaml"))


def example_names() -> list[str]:
    """Names of the bundled poke scripts, sorted."""
    return sorted(_files(_shared("msg_examples"), ".yaml"))


def _named(field: str, name: str, files: dict[str, Path]) -> Path:
    if name not in files:
        known = one_of(name, sorted(files)) if files else f"none: this installation of {PACKAGE} holds none"
        raise InputError(field, name, known)
    return files[name]


def _files(folder: Path | None, suffix: str) -> dict[str, Path]:
    return {} if folder is None else {path.stem: path for path in folder.glob(f"*{suffix}")}


def _shared(folder: str) -> Path | None:
    return next((place / folder for place in _places() if (place / folder).is_dir()), None)


def _places() -> Iterator[Path]:
    """Folders that may hold config/ and msg_examples/, nearest to this very file first, so that versions never mix."""
    source = PACKAGE_FOLDER.resolve().parent
    if (source / "package.xml").is_file():
        yield source
    for parent in (PACKAGE_FOLDER, *PACKAGE_FOLDER.parents):
        yield parent / "share" / PACKAGE
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(prefix) / "share" / PACKAGE
