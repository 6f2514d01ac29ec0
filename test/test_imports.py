# SPDX-License-Identifier: MIT
"""Imports point one way: core <- meshes, viewers and sessions <- ros <- the page and the command line."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import rigid_proto_ros

PACKAGE = "rigid_proto_ros"
ROOT = Path(rigid_proto_ros.__file__).parent
MODULES = {
    ".".join((PACKAGE, *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(".__init__"): path
    for path in sorted(ROOT.rglob("*.py"))
}
ROS = ("rclpy", "rcl_interfaces", "builtin_interfaces")
# Which modules may import a package that is neither ours nor Python's; a trailing dot means everything below.
ALLOWED = {
    "numpy": (f"{PACKAGE}.",),
    "numba": (f"{PACKAGE}.core.", f"{PACKAGE}.mesh_"),
    "llvmlite": (f"{PACKAGE}.core.",),  # comes with numba
    "yaml": (
        f"{PACKAGE}.scene_file",
        f"{PACKAGE}.plain_yaml",
        f"{PACKAGE}.poke_script",
        f"{PACKAGE}.parameters",
        f"{PACKAGE}.session_bag",
        f"{PACKAGE}.session_branch",
        f"{PACKAGE}.sweep.",
        f"{PACKAGE}.ros.",
        f"{PACKAGE}.cli.",
    ),
    "trimesh": (f"{PACKAGE}.mesh_io",),
    "manifold3d": (f"{PACKAGE}.bodies.surfaces",),
    "rerun": (f"{PACKAGE}.rerun_view", f"{PACKAGE}.inspect_view"),
    "rerun_bindings": (f"{PACKAGE}.rerun_view",),
    "pyarrow": (f"{PACKAGE}.rerun_view", f"{PACKAGE}.sweep.table"),  # comes with rerun, as PIL does
    "scipy": (f"{PACKAGE}.sweep.sampling", f"{PACKAGE}.mesh_hull"),
    "distributed": (f"{PACKAGE}.sweep.cluster",),
    "matplotlib": (f"{PACKAGE}.sweep.plot",),
    "PIL": (f"{PACKAGE}.rerun_view",),
    "ament_index_python": (f"{PACKAGE}.mesh_io", f"{PACKAGE}.ros."),  # package:// URIs
    "rich": (f"{PACKAGE}.cli.terminal",),
    "argcomplete": (f"{PACKAGE}.command_line",),
    "viser": (f"{PACKAGE}.workbench",),
    "websockets": (f"{PACKAGE}.workbench",),  # comes with viser
    "mcap": (f"{PACKAGE}.session_mcap",),
    "zstandard": (f"{PACKAGE}.session_mcap",),  # comes with mcap
}


def imports(module: str, path: Path) -> Iterator[tuple[str, int]]:
    """Absolute names of everything that a module imports, at its top or inside a function, with the line."""
    package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            name = ".".join([*base, *filter(None, [node.module])])
            for alias in node.names:
                whole = f"{name}.{alias.name}"
                yield (whole if whole in MODULES else name), node.lineno


def within(module: str, *places: str) -> bool:
    """Whether a module is one of the places, or below one (`package.core.`), or starts like one (`package.mesh_`)."""
    return any(f"{module}.".startswith(place) if place.endswith((".", "_")) else _is(module, place) for place in places)


def _is(module: str, place: str) -> bool:
    return module == place or module.startswith((f"{place}.", f"{place}_"))


def complaints(allowed) -> list[str]:
    """One line for each import that ``allowed(module, imported)`` denies."""
    return [
        f"{module}:{line} imports {name}"
        for module, path in MODULES.items()
        for name, line in imports(module, path)
        if not allowed(module, name)
    ]


def test_the_reader_of_imports_sees_them_all() -> None:
    found = {name for name, _ in imports(f"{PACKAGE}.mesh_io", MODULES[f"{PACKAGE}.mesh_io"])}
    assert {"numpy", "trimesh"} <= found


def test_core_imports_numpy_numba_the_standard_library_and_itself() -> None:
    def allowed(module: str, name: str) -> bool:
        top = name.split(".")[0]
        return not within(module, f"{PACKAGE}.core.") or (
            top in ("numpy", "numba", "llvmlite") or top in sys.stdlib_module_names or within(name, f"{PACKAGE}.core.")
        )

    assert not complaints(allowed)


def test_each_outside_package_is_imported_in_its_own_modules_alone() -> None:
    def allowed(module: str, name: str) -> bool:
        top = name.split(".")[0]
        if top == PACKAGE or top in sys.stdlib_module_names:
            return True
        if top in ROS or top == "simulation_interfaces" or top.endswith(("_msgs", "_srvs")):
            return within(module, f"{PACKAGE}.ros.", f"{PACKAGE}.workbench.")
        return within(module, *ALLOWED.get(top, ()))

    assert not complaints(allowed)


def test_nothing_below_ros_and_the_command_line_imports_them() -> None:
    edges = (f"{PACKAGE}.ros.", f"{PACKAGE}.workbench.", f"{PACKAGE}.cli.")

    def allowed(module: str, name: str) -> bool:
        return within(module, *edges) or not within(name, *edges)

    assert not complaints(allowed)


def test_ros_imports_neither_the_page_nor_the_command_line() -> None:
    beyond = (f"{PACKAGE}.workbench.", f"{PACKAGE}.cli.")
    assert not complaints(lambda module, name: not (within(module, f"{PACKAGE}.ros.") and within(name, *beyond)))


def test_the_page_does_not_import_the_command_line() -> None:
    page, line = f"{PACKAGE}.workbench.", f"{PACKAGE}.cli."
    assert not complaints(lambda module, name: not (within(module, page) and within(name, line)))


def test_sweeps_are_imported_by_the_command_line_alone() -> None:
    sweep = f"{PACKAGE}.sweep."
    assert not complaints(lambda module, name: within(module, sweep, f"{PACKAGE}.cli.") or not within(name, sweep))


def test_the_generator_of_bodies_is_imported_by_nobody() -> None:
    bodies = f"{PACKAGE}.bodies."
    assert not complaints(lambda module, name: within(module, bodies) or not within(name, bodies))


@pytest.mark.parametrize(
    "module", [f"{PACKAGE}.core", f"{PACKAGE}.core.simulation", f"{PACKAGE}.bundled", f"{PACKAGE}.scenario"]
)
def test_importing_the_core_loads_no_viewer_mesh_reader_or_ros(module: str) -> None:
    # scipy is not among them: numba loads it where it is installed, for linear algebra that we don't use.
    heavy = ("trimesh", "rerun", "rclpy", "pyarrow", "manifold3d")
    code = f"import sys, {module}; print(*[name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []
