# SPDX-License-Identifier: MIT
"""Every folder of the package knows only the folders before it, and each outside package is imported in its own place."""

import ast
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import rigid_proto_ros

PACKAGE = "rigid_proto_ros"
ROOT = Path(rigid_proto_ros.__file__).parent
MODULES = {
    ".".join((PACKAGE, *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__"): path
    for path in sorted(ROOT.rglob("*.py"))
}
ORDER = (
    *("base", "mesh", "mass", "motion", "parameters", "simulation", "scene", "session"),
    *(
        "picture",
        "rerun_view",
        "export",
        "live",
        "page",
        "ros",
        "sweep",
        "identify",
        "robots",
        "cli",
        "kernels",
    ),
)
"""Folders in the order of imports: each knows only those before it."""
STRANGERS = {
    "sweep": ("rerun_view", "live", "page", "ros"),
    "identify": ("rerun_view", "live", "page", "ros", "sweep"),
    "robots": (
        *("motion", "simulation", "scene", "session", "rerun_view", "live", "page", "ros", "sweep", "identify"),
        "export",
    ),
}
"""Folders that stand before one in the order but that it doesn't know all the same."""
ROS = ("rclpy", "rcl_interfaces", "builtin_interfaces")
# Which folders or modules may import a package that is neither ours nor Python's.
ALLOWED = {
    "numpy": ORDER,
    "numba": ("base.compilation", "base.simd", "base.arithmetic", "kernels"),  # where kernels are built
    "llvmlite": ("base.compilation", "base.simd", "base.arithmetic", "kernels"),  # comes with numba
    "yaml": ("base.yaml_text", "scene", "session", "sweep", "ros", "cli"),
    "trimesh": ("mesh.assembly", "robots.link_shapes"),
    "collada": ("mesh.assembly",),
    "mujoco": ("robots.mjcf_compiler",),
    "manifold3d": ("mesh.solids", "bodies.surfaces"),
    "rerun": ("rerun_view",),
    "rerun_bindings": ("rerun_view",),
    "distributed": ("sweep.workers",),
    "pyarrow": ("rerun_view", "sweep.table", "export.table"),  # comes with rerun, as PIL does
    "PIL": ("rerun_view",),
    "pxr": ("export.usd",),
    "scipy": ("mesh.solids", "identify"),
    "ament_index_python": ("mesh.locate", "ros"),  # package:// URIs
    "websockets": ("page.server", "page.watchers"),
    "segno": ("page.server",),
    "mcap": ("session.bag", "session.mcap_observer"),
    "zstandard": ("session.bag",),  # comes with mcap
    "rosbags": ("identify.bag_reading",),
}


@cache
def imports_of(path: Path) -> list[ast.Import | ast.ImportFrom]:
    """The import statements of a file, at its top or inside a function."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]


def imports(module: str, path: Path) -> Iterator[tuple[str, int]]:
    """Absolute names of everything that a module imports, with the line."""
    package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    for node in imports_of(path):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        else:
            base = package[: len(package) - node.level + 1] if node.level else []
            name = ".".join([*base, *filter(None, [node.module])])
            for alias in node.names:
                whole = f"{name}.{alias.name}"
                yield (whole if whole in MODULES else name), node.lineno


def place(module: str) -> str:
    """A module's name without the package's."""
    return module.removeprefix(PACKAGE).removeprefix(".")


def folder(module: str) -> str:
    """The folder that a module lies in; empty for the package itself."""
    return place(module).partition(".")[0]


def within(module: str, places: tuple[str, ...]) -> bool:
    """Whether a module is one of the places or lies below one."""
    return any(place(module) == known or place(module).startswith(f"{known}.") for known in places)


def complaints(allowed: Callable[[str, str], bool]) -> list[str]:
    """One line for each import that ``allowed(module, imported)`` denies."""
    return [
        f"{module}:{line} imports {name}"
        for module, path in MODULES.items()
        for name, line in imports(module, path)
        if not allowed(module, name)
    ]


def is_ours(name: str) -> bool:
    return name.split(".")[0] == PACKAGE


def test_every_folder_has_its_place_in_the_order() -> None:
    assert {folder(module) for module in MODULES} - {""} == {*ORDER, "bodies"}
    assert not [module for module, path in MODULES.items() if path.parent == ROOT and path.name != "__init__.py"]


def test_every_folder_knows_only_those_before_it() -> None:
    def allowed(module: str, name: str) -> bool:
        own, other = folder(module), folder(name) if is_ours(name) else ""
        if not other or other == own:
            return True
        if own not in ORDER or other not in ORDER:
            return False
        return ORDER.index(other) < ORDER.index(own) and other not in STRANGERS.get(own, ())

    assert not complaints(allowed)


def test_imports_inside_the_package_are_relative() -> None:
    absolute = [
        f"{module}:{node.lineno}"
        for module, path in MODULES.items()
        for node in imports_of(path)
        if (isinstance(node, ast.ImportFrom) and not node.level and is_ours(node.module or ""))
        or (isinstance(node, ast.Import) and any(is_ours(alias.name) for alias in node.names))
    ]
    assert not absolute


def test_every_exception_from_a_check_says_its_reason() -> None:
    bare = [
        f"{path.relative_to(ROOT.parent)}:{number}"
        for path in MODULES.values()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(r"#.*(noqa|type: ignore)", line)
        and not re.search(r"(noqa: [A-Z0-9, ]+|type: ignore\[[a-z, -]+\])\s*[(#-] ?\w", line)
    ]
    assert not bare


def test_every_annotation_of_an_array_gives_its_dtype() -> None:
    """mypy takes a bare np.ndarray for one of any dtype, strict as it is."""
    bare = []
    for path in MODULES.values():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            for name in ("annotation", "returns"):
                annotation = getattr(node, name, None)
                if annotation is not None and "np.ndarray" in ast.unparse(annotation):
                    bare.append(f"{path}:{node.lineno}")
    assert not bare


def test_each_outside_package_is_imported_in_its_own_place_alone() -> None:
    def allowed(module: str, name: str) -> bool:
        top = name.split(".")[0]
        if top == PACKAGE or top in sys.stdlib_module_names:
            return True
        if top in ROS or top == "simulation_interfaces" or top.endswith(("_msgs", "_srvs")):
            return within(module, ("ros",))
        return within(module, ALLOWED.get(top, ()))

    assert not complaints(allowed)


def test_a_launch_file_needs_no_numba() -> None:
    """ros2 launch runs with the system's Python; numba is in the environment that the node is started with."""
    code = f"import sys, {PACKAGE}.base.bundled, {PACKAGE}.scene.scene_file; print('numba' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "False"


def test_simulating_loads_no_compiler_viewer_mesh_reader_or_ros() -> None:
    heavy = ("numba", "llvmlite", "trimesh", "rerun", "rclpy", "pyarrow", "manifold3d", "mcap", "zstandard", "scipy")
    modules = ", ".join(
        f"{PACKAGE}.{name}" for name in ("simulation.simulation", "scene.scenario", "session.recorded_session")
    )
    code = f"import sys, {modules}; print(*[name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []
