# SPDX-License-Identifier: MIT
"""Build a package of ROS interfaces for the ROS wheels of this environment, which have rosidl's generators, headers and
libraries, but not ament_cmake, which colcon would need.

    python tools/build_interfaces.py interfaces/rigid_proto_interfaces [MORE ...] [--out FOLDER]

A package comes behind those that it uses. Each becomes a Python package in FOLDER, by default among those of the environment.
Needs a C and a C++ compiler. What can't be built ends in one line and status 2; the compiler's or generator's own words stand
above it.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

PREFIX = Path(sys.prefix)
KINDS = ("msg", "srv", "action")
IMPLEMENTATIONS = ["rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"]
RUNTIME = (
    "rosidl_runtime_c",
    "rcutils",
    "rosidl_typesupport_c",
    *IMPLEMENTATIONS,
    "rosidl_typesupport_fastrtps_cpp",
    "fastcdr",
)


def main() -> int:
    """Build the packages in turn; 2 when one can't be built, with the reason in one line on stderr."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("packages", type=Path, nargs="+", help="folders with package.xml and msg, srv or action")
    parser.add_argument("--out", type=Path, default=Path(sysconfig.get_path("platlib")), help="where they are to lie")
    options = parser.parse_args()
    # rosidl finds its templates through it; the wheels set it in processes that import rclpy.
    os.environ["AMENT_PREFIX_PATH"] = str(PREFIX)
    with tempfile.TemporaryDirectory() as work:
        built: list[Package] = []
        for folder in options.packages:
            try:
                built.append(built_package(folder.resolve(), Path(work), options.out.resolve(), built))
            except BuildError as error:
                print(f"build_interfaces: {folder}: {' '.join(str(error).split())}", file=sys.stderr)
                return 2
            print(f"{built[-1].name}: {built[-1].python}")
    return 0


class BuildError(Exception):
    """Why a package can't be built, in one line."""


def built_package(folder: Path, work: Path, out: Path, others: list[Package]) -> Package:
    """The package, built and moved to ``out`` when it is whole; raises BuildError."""
    if missing := [name for name in ("cc", "c++") if shutil.which(name) is None]:
        raise BuildError(f"no {' and no '.join(missing)} found; accepted: a C and a C++ compiler (apt: g++)")
    package = Package(folder, work)
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said):
            package.generate([other.share.parent for other in others])
    except Exception as error:  # rosidl's parsers and generators raise many kinds
        reason = f"a package that isn't here: {error}" if isinstance(error, KeyError) else str(error)
        raise BuildError(f"rosidl refuses its interfaces: {reason}") from error
    package.compile(others)
    package.move_to(out)
    return package


class Package:
    """One package: its folder, and the generated sources below ``work``."""

    def __init__(self, folder: Path, work: Path) -> None:
        try:
            name = ElementTree.parse(folder / "package.xml").getroot().findtext("name")
        except (OSError, ElementTree.ParseError) as error:
            raise BuildError(f"package.xml: {error}") from None
        if not name:
            raise BuildError("package.xml: no <name>")
        if not any(_relative(folder, f"{kind}/*.{kind}") for kind in KINDS):
            raise BuildError("no msg/*.msg, srv/*.srv or action/*.action in it")
        self.name = name
        self.folder = folder
        self.share = work / "share" / name
        # Two generators write files of the same names.
        self.sources, self.introspection = work / name / "c", work / name / "introspection"
        self.objects = work / name / "objects"
        self.python = work / "python" / name

    def generate(self, others: list[Path]) -> None:
        """IDL, type descriptions, C and Python sources. others: folders with the IDL of packages built before."""
        # The command rosidl takes a generator that pip and setuptools both list for two, and refuses.
        from rosidl_adapter.cli import TranslateActionToIDL, TranslateMsgToIDL, TranslateSrvToIDL
        from rosidl_generator_c.cli import GenerateC
        from rosidl_generator_py.cli import GeneratePython
        from rosidl_generator_type_description.cli import HashTypeDescription
        from rosidl_typesupport_c.cli import GenerateCTypesupport
        from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
        from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

        include = [PREFIX / "share", *others]
        for kind, translate in zip(KINDS, (TranslateMsgToIDL, TranslateSrvToIDL, TranslateActionToIDL), strict=True):
            if files := _relative(self.folder, f"{kind}/*.{kind}"):
                translate(f"{kind}2idl").translate(self.name, files, include, self.share)
        idl = _relative(self.share, "*/*.idl")
        HashTypeDescription("hash").generate_type_hashes(self.name, idl, [*include, self.share.parent], self.share)
        sources, introspection = self.sources / self.name, self.introspection / self.name
        for kind in KINDS:
            # By themselves: rosidl finds a description by its file's name, which a message and a service may share.
            descriptions = [str(file) for file in sorted(self.share.glob(f"{kind}/*.json"))]
            if files := _relative(self.share, f"{kind}/*.idl"):
                GenerateC("c").generate(self.name, files, include, sources, type_description_files=descriptions)
        dispatch = GenerateCTypesupport("c", typesupport_implementations=IMPLEMENTATIONS)
        dispatch.generate(self.name, idl, include, sources)
        GenerateFastRTPSCTypesupport("fastrtps_c").generate(self.name, idl, include, sources)
        GenerateIntrospectionCTypesupport("introspection_c").generate(self.name, idl, include, introspection)
        GeneratePython("py").generate(self.name, idl, include, self.python)
        (self.python / "__init__.py").touch()

    def compile(self, others: list[Package]) -> None:
        """The libraries that rmw looks for by name, and the module that Python imports, beside it."""
        sources, python = self.sources, self.python
        extension = f"{self.name}_s__rosidl_typesupport_c{sysconfig.get_config_var('EXT_SUFFIX')}"
        entry = python / f"_{self.name}_s.ep.rosidl_typesupport_c.c"
        groups = {
            f"lib{self.name}__rosidl_generator_c.so": sources.rglob("*.c"),
            f"lib{self.name}__rosidl_typesupport_fastrtps_c.so": sources.rglob("*__type_support_c.cpp"),
            f"lib{self.name}__rosidl_typesupport_introspection_c.so": self.introspection.rglob("*.c"),
            f"lib{self.name}__rosidl_typesupport_c.so": sources.rglob("*__type_support.cpp"),
            f"lib{self.name}__rosidl_generator_py.so": python.rglob("*_s.c"),
            extension: [entry],
        }
        include = [PREFIX / "include", *sorted(p for p in (PREFIX / "include").iterdir() if p.is_dir())]
        include += [sysconfig.get_path("include"), np.get_include(), self.sources, self.introspection]
        include += [folder for other in others for folder in (other.sources, other.introspection)]
        flags = [f"-I{folder}" for folder in include]
        libraries = [PREFIX / "lib" / f"lib{name}.so" for name in RUNTIME]
        libraries += sorted(p for p in (PREFIX / "lib").glob("lib*__rosidl_*.so") if "_cpp" not in p.name)
        libraries += [library for other in others for library in sorted(other.python.glob("lib*.so"))]
        rpath = [f"-Wl,-rpath,{place}" for place in ("$ORIGIN", *(f"$ORIGIN/../{other.name}" for other in others))]
        made: list[Path] = []
        for name, files in groups.items():
            objects = [self._object(file, flags) for file in sorted(files)]
            # All of them are loaded with the module: then rmw finds the libraries by their names.
            link = ["c++", "-shared", f"-Wl,-soname,{name}", "-Wl,--no-as-needed", *rpath, "-o", python / name]
            _run([*map(str, (*link, *objects, *made, *libraries))])
            made.append(python / name)
        for source in (*python.rglob("*.c"),):
            source.unlink()

    def move_to(self, out: Path) -> None:
        """Put the package where Python finds it, in the place of one that is there."""
        target = out / self.name
        try:
            out.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(target, ignore_errors=True)
            shutil.move(str(self.python), str(target))
        except OSError as error:
            raise BuildError(f"{target}: {error.strerror or error}") from None
        self.python = target

    def _object(self, source: Path, flags: list[str]) -> Path:
        made = self.objects / f"{len(list(self.objects.glob('*')))}_{source.name}.o"
        made.parent.mkdir(parents=True, exist_ok=True)
        compiler = ["c++", "-std=c++17"] if source.suffix == ".cpp" else ["cc", "-std=gnu11"]
        _run([*compiler, "-O1", "-fPIC", "-c", str(source), "-o", str(made), *flags])
        return made


def _run(command: list[str]) -> None:
    """Run a compiler, whose words stand on stderr above the one line."""
    if status := subprocess.run(command, check=False).returncode:
        raise BuildError(f"{command[0]} ended with status {status}")


def _relative(folder: Path, pattern: str) -> list[str]:
    """Files below a folder, as rosidl wants them."""
    return [f"{folder}:{file.relative_to(folder)}" for file in sorted(folder.glob(pattern))]


if __name__ == "__main__":
    sys.exit(main())
