# SPDX-License-Identifier: MIT
"""The XML of robot files, xacro expanded by the installed ``xacro``, also where no ROS is installed.

xacro asks ament_index_python for ``$(find package)``, which stands in no package index but ROS's own. It is given a
module of that name that knows the packages which mesh names are looked for in, too.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from ..base.errors import InputError
from ..base.files import read_bounded
from ..mesh.locate import Search, package_folder

MAX_BYTES = 50_000_000
TIMEOUT_S = 60.0
"""The largest descriptions expand in a few seconds."""
MAX_FILES = 2000
"""Files of all packages together that are searched for names of packages."""
_FIND = re.compile(r"\$\(find\s+([\w.-]+)\s*\)")
_NO_ARGUMENT = re.compile(r"Undefined substitution argument (\w+)")
_INDEX = """
FOLDERS = {folders!r}


class PackageNotFoundError(KeyError):
    pass


def get_package_share_directory(name):
    if name not in FOLDERS:
        raise PackageNotFoundError(f"package {{name}} was not found; --package-path DIR says where it is")
    return FOLDERS[name]
"""


def robot_root(path: Path, folders: tuple[Path, ...] = (), xacro: tuple[str, ...] = ()) -> ElementTree.Element:
    """The root of a robot file, xacro expanded with arguments like ``name:=value``, packages looked for upwards from
    the file and in ``folders``; raises InputError when the file can't be read.
    """
    root = parse_xml(read_bounded(path, MAX_BYTES, "robot file", "a URDF, SDF or MJCF file"), path)
    if is_xacro(root, path):
        return parse_xml(expand_xacro(path, Search(path.parent, folders), xacro), path)
    if xacro:
        raise InputError("--xacro", " ".join(xacro), "a file that xacro expands")
    return root


def is_xacro(root: ElementTree.Element, path: Path) -> bool:
    """Whether the file is to be expanded by xacro before it is a robot's description."""
    return path.suffix == ".xacro" or any("xacro" in str(element.tag) for element in root.iter())


def parse_xml(data: bytes, path: Path) -> ElementTree.Element:
    """The root of a file's XML, names as they are written: SDFs use prefixes (gz:) that they don't declare.

    Raises InputError for what is no XML, or has entities.
    """
    if b"<!ENTITY" in data:
        raise InputError("robot file", path.name, "a file without XML entities")
    tree = ElementTree.TreeBuilder()
    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = tree.start, tree.end
    parser.CharacterDataHandler = tree.data
    try:
        parser.Parse(data, True)
        return tree.close()
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputError("robot file", path.name, f"well-formed XML ({error})") from None


def _packages(path: Path, search: Search) -> dict[str, str]:
    """Folders of the packages that a file, and the xacro and YAML files of these packages, name."""
    found: dict[str, str] = {}
    waiting, seen = [path], 0
    while waiting and seen < MAX_FILES:
        file = waiting.pop()
        seen += 1
        try:
            text = file.read_text("utf-8", "replace")
        except OSError:
            continue
        for name in set(_FIND.findall(text)) - found.keys():
            folder = package_folder(name, search)
            if folder is not None:
                found[name] = str(folder)
                waiting += [part for ending in ("xacro", "urdf") for part in folder.rglob(f"*.{ending}")]
    return found


def expand_xacro(path: Path, search: Search, arguments: Iterable[str] = ()) -> bytes:
    """What the installed ``xacro`` makes of the file with ``arguments`` like ``name:=value``; raises InputError without
    it, and with its reason where it fails.
    """
    # pip puts it beside the Python of an environment, which need not be activated.
    program = shutil.which("xacro") or shutil.which("xacro", path=os.path.dirname(sys.executable))
    if program is None:
        accepted = "plain URDF: expand it first, xacro FILE > robot.urdf (or install xacro)"
        raise InputError("robot file", path.name, accepted)
    with tempfile.TemporaryDirectory() as folder:
        module = Path(folder) / "ament_index_python"
        module.mkdir()
        (module / "__init__.py").write_text("", encoding="utf-8")
        text = _INDEX.format(folders=_packages(path, search))
        (module / "packages.py").write_text(text, encoding="utf-8")
        places = os.pathsep.join(filter(None, [folder, os.environ.get("PYTHONPATH", "")]))
        try:
            done = subprocess.run(
                [program, str(path), *arguments],
                capture_output=True, timeout=TIMEOUT_S, check=False, env={**os.environ, "PYTHONPATH": places},
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired) as error:
            raise InputError("robot file", path.name, f"a file that xacro expands ({error})") from None
    if done.returncode != 0:
        lines = [line.strip() for line in done.stderr.decode("utf-8", "replace").split("\n") if line.strip()]
        # Its last lines say in which files; the error stands before them.
        reason = next((line for line in lines if line.startswith("error:")), lines[-1] if lines else "no reason given")
        undefined = _NO_ARGUMENT.search(reason)
        remedy = f"; --xacro {undefined[1]}:=VALUE gives it" if undefined else ""
        raise InputError("robot file", path.name, f"a file that xacro expands ({reason[:200]}){remedy}")
    return done.stdout
