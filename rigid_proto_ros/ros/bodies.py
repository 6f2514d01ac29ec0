# SPDX-License-Identifier: MIT
"""Several bodies in one process: ``rigid_body_node --bodies a.yaml b.yaml``, a node for each scene, named after its file."""

from __future__ import annotations

import re
from pathlib import Path

from ..base.errors import InputError
from ..scene.offline import scene_file, scene_values

NODE_NAME_FORM = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")


def read_bodies(files: list[str]) -> dict[str, dict]:
    """The parameters given by each file under its node's name.

    Raises InputError for a file that can't be read, a name that no node can have, or two equal ones.
    """
    bodies: dict[str, dict] = {}
    for file in files:
        path = scene_file(file)
        name = node_name_of(path)
        if name in bodies:
            raise InputError("--bodies", file, f"files with different names; {name} is there already")
        bodies[name] = scene_values(path, print)
    return bodies


def node_name_of(path: Path) -> str:
    """The file's stem with other characters than [A-Za-z0-9_] as _; raises InputError if that names no node."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", path.stem)
    if not NODE_NAME_FORM.match(name) or len(name) > 255:
        raise InputError("--bodies", str(path), "a file whose name, made a node's name, begins with a letter or _")
    return name
