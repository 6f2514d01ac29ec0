# SPDX-License-Identifier: MIT
"""The package installs by pip and by colcon, with its executables, bodies, scenes and examples where they are looked for."""

import importlib.metadata
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
import tarfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import yaml
from packaging.requirements import Requirement

import rigid_proto_ros
from rigid_proto_ros.base import bundled
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.motion.surface import Surface
from rigid_proto_ros.page.bundle import built_page

SOURCE = Path(rigid_proto_ros.__file__).resolve().parent.parent
EXECUTABLES = {"rigid_proto", "rigid_body_node", "poke_client"}
pytestmark = pytest.mark.skipif(not (SOURCE / "setup.py").is_file(), reason="not run from a source tree")


@pytest.fixture(scope="module")
def source_copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what is needed to build, so that nothing is written into the source tree."""
    copy = tmp_path_factory.mktemp("workspace") / "rigid_proto_ros"
    copy.mkdir()
    skipped = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in ("rigid_proto_ros", "config", "msg_examples", "launch", "resource"):
        if (SOURCE / name).is_dir():
            shutil.copytree(SOURCE / name, copy / name, ignore=skipped)
    for name in ("setup.py", "setup.cfg", "package.xml", "pyproject.toml", "LICENSE", "README.md"):
        shutil.copy(SOURCE / name, copy / name)
    return copy


def run(*command: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess:
    """Run a command; a failure shows its whole output."""
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def installed_bundle(site: Path, cwd: Path, **environment: str) -> list[str]:
    """What an installed copy finds: the paths of a scene and a body, then the names of all scenes."""
    code = (
        "from rigid_proto_ros.base import bundled as b; from rigid_proto_ros.mesh.locate import resolve_mesh; "
        "print(b.scene_path('t_handle')); print(resolve_mesh('t_handle')); print(*b.scene_names())"
    )
    return run(sys.executable, "-c", code, cwd=cwd, PYTHONPATH=str(site), **environment).stdout.split("\n")[:3]


@pytest.mark.slow
def test_pip_installs_executables_bodies_and_scenes(source_copy: Path, tmp_path: Path) -> None:
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet")
    prefix = tmp_path / "prefix"
    run(
        *pip,
        "--no-build-isolation",
        "--no-deps",
        "--no-index",
        "--ignore-installed",
        "--no-compile",
        "--prefix",
        prefix,
        ".",
        cwd=source_copy,
    )
    assert {path.name for path in (prefix / "bin").iterdir()} >= EXECUTABLES
    (site,) = prefix.glob("lib/python*/site-packages")
    _check_installed(prefix, installed_bundle(site, tmp_path))


@pytest.mark.slow
def test_colcon_puts_the_executables_where_ros2_run_looks(source_copy: Path, tmp_path: Path) -> None:
    pytest.importorskip("colcon_core")
    if importlib.util.find_spec("colcon_ros") is None:
        pytest.skip("colcon_ros is not installed")
    base = tmp_path / "ws"
    run(
        *(sys.executable, "-m", "colcon", "--log-base", base / "log", "build", "--base-paths", source_copy),
        *("--build-base", base / "build", "--install-base", base / "install"),
        cwd=tmp_path,
    )
    prefix = base / "install" / "rigid_proto_ros"
    # `ros2 run` lists the executable files of lib/<package>.
    found = {path.name for path in (prefix / "lib" / "rigid_proto_ros").iterdir() if os.access(path, os.X_OK)}
    assert found == EXECUTABLES
    (site,) = prefix.glob("lib/python*/site-packages")
    _check_installed(prefix, installed_bundle(site, tmp_path, AMENT_PREFIX_PATH=str(prefix)))


def test_setup_runs_through_a_link_elsewhere_as_a_symlinked_colcon_build_does(
    source_copy: Path, tmp_path: Path
) -> None:
    for name in ("setup.py", "setup.cfg", "rigid_proto_ros"):
        (tmp_path / name).symlink_to(source_copy / name)
    told = run(sys.executable, "setup.py", "--version", cwd=tmp_path).stdout
    assert told.split()[-1] == rigid_proto_ros.__version__


def _check_installed(prefix: Path, found: list[str]) -> None:
    scene, body, scenes = found
    assert (prefix / "share/ament_index/resource_index/packages/rigid_proto_ros").is_file()
    assert (prefix / "share/rigid_proto_ros/package.xml").is_file()
    assert Path(scene) == prefix / "share/rigid_proto_ros/config/t_handle.yaml"
    assert Path(body).is_file() and Path(body).is_relative_to(prefix)
    assert (prefix / "share/rigid_proto_ros/launch/rigid_body.launch.py").is_file()
    assert scenes.split() == bundled.scene_names()


def test_every_source_file_names_its_licence() -> None:
    files = [
        path
        for folder in ("rigid_proto_ros", "test", "benchmarks", "launch")
        for path in (SOURCE / folder).rglob("*.py")
    ]
    assert len(files) > 100
    lacking = [path for path in files if "# SPDX-License-Identifier: MIT" not in path.read_text("utf-8")[:200]]
    assert not lacking


ROSDEP_KEYS = {"python3-numpy", "python3-pytest", "python3-yaml"}
"""Those of rosdistro's rosdep/python.yaml that this package asks for; ROS packages are keys by their names. None ends in -pip:
Ubuntu lets pip install nothing beside apt (PEP 668), so that rosdep would stop there. python3-numba is a key for every Ubuntu,
and no package in 24.04: numba, which builds the kernels, comes by `make setup`."""

ROS_PACKAGES = {
    *("diagnostic_msgs", "geometry_msgs", "nav_msgs", "rosgraph_msgs", "sensor_msgs", "std_msgs", "std_srvs"),
    *("launch", "launch_ros", "rclpy", "ament_index_python", "rcl_interfaces", "tf2_msgs", "visualization_msgs"),
}
"""Released into Jazzy under these names."""


def test_what_the_code_imports_of_ros_is_declared_and_every_dependency_is_a_rosdep_key() -> None:
    tree = ElementTree.parse(SOURCE / "package.xml")
    asked = {element.text for element in tree.iter() if element.tag.endswith("depend")}
    assert asked == ROSDEP_KEYS | ROS_PACKAGES
    text = "\n".join(path.read_text("utf-8") for path in (SOURCE / "rigid_proto_ros").rglob("*.py"))
    imported = set(
        re.findall(r"^ *(?:from|import) (rclpy|ament\w*|\w+_(?:msgs|srvs|interfaces))\b", text, re.MULTILINE)
    )
    assert len(imported) > 8
    # builtin_interfaces comes with every message package; the other one is served where it is installed.
    declared = {element.text for element in tree.iter("exec_depend")}
    assert imported - {"builtin_interfaces", "simulation_interfaces"} <= declared


def test_all_but_ros_is_an_extra_and_every_extra_allows_what_is_pinned() -> None:
    """One list of versions for users of pip, another for `make setup`: they agree."""
    metadata = importlib.metadata.metadata("rigid_proto_ros")
    requirements = [Requirement(text) for text in metadata.get_all("Requires-Dist") or []]
    pins = {}
    for name in ("run", "all", "ros"):
        for line in (SOURCE / "requirements" / f"{name}.txt").read_text("utf-8").replace("\\\n", "").splitlines():
            if line and not line.startswith("#"):
                pin = Requirement(line.partition(" --hash")[0])
                if pin.marker is None or pin.marker.evaluate():
                    pins[pin.name.lower()] = next(iter(pin.specifier)).version
    needed = [r for r in requirements if r.marker is None or r.marker.evaluate({"extra": "all"})]
    assert {"numba", "rerun-sdk", "mcap", "websockets", "pyarrow"} <= {r.name for r in needed}
    assert not [r.name for r in needed if r.name.startswith("ros-")], "a ROS installation keeps its own"
    for requirement in requirements:
        if any(requirement.marker is None or requirement.marker.evaluate({"extra": e}) for e in ("all", "ros", "test")):
            assert requirement.specifier.contains(pins[requirement.name.lower()]), requirement


@pytest.mark.parametrize(
    "path", [*sorted((SOURCE / "requirements").glob("*.txt")), SOURCE / "benchmarks" / "requirements.txt"], ids=str
)
def test_every_pin_is_one_version_with_the_hashes_of_its_files_and_names_no_registry(path: Path) -> None:
    text = path.read_text("utf-8")
    entries = [line for line in text.replace("\\\n", "").splitlines() if line and not line.startswith("#")]
    assert entries and "://" not in text
    for entry in entries:
        pin, *hashes = entry.split(" --hash=")
        assert [operator.operator for operator in Requirement(pin).specifier] == ["=="], pin
        assert hashes and all(re.fullmatch(r"sha256:[0-9a-f]{64}\s*", one) for one in hashes), pin


def test_a_refusal_names_an_extra_that_installs_what_is_missing() -> None:
    metadata = importlib.metadata.metadata("rigid_proto_ros")
    brought: dict[str, set[str]] = {extra: set() for extra in metadata.get_all("Provides-Extra") or []}
    for requirement in [Requirement(text) for text in metadata.get_all("Requires-Dist") or []]:
        for extra, packages in brought.items():
            if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                packages.add(requirement.name.removeprefix("ros-"))
    text = "\n".join(path.read_text("utf-8") for path in (SOURCE / "rigid_proto_ros").rglob("*.py"))
    named = re.findall(r"""is_missing\(['"]([\w-]+)['"], ['"](\w+)['"]\)""", text)
    assert len(named) > 10
    assert not [(package, extra) for package, extra in named if package not in brought[extra]]


def scene_parameters(name: str) -> dict:
    """The parameters of a bundled scene as its file nests them."""
    (section,) = yaml.safe_load(bundled.scene_path(name).read_text(encoding="utf-8")).values()
    return section["ros__parameters"]


def test_every_body_has_a_scene_and_every_scene_a_body() -> None:
    assert set(bundled.body_names()) <= set(bundled.scene_names())
    for name in bundled.scene_names():
        mesh = scene_parameters(name)["mesh"]
        assert mesh == name or (mesh in bundled.body_names() and name not in bundled.body_names())
        text = bundled.scene_path(name).read_text(encoding="utf-8")
        comment = [line for line in text.splitlines() if line.startswith("#")]
        assert len(comment) >= 4, "a scene begins by saying what it teaches"


def test_contacts_of_the_scenes_lie_on_the_surface() -> None:
    for name in bundled.scene_names():
        body = mesh_body(scene_parameters(name)["mesh"])
        surface = Surface(body.vertices, body.triangles)
        for contact, point in scene_parameters(name)["contacts"].items():
            nearest = surface.nearest_point(point)
            # Contacts are written to 10 µm.
            assert np.linalg.norm(nearest - point) < 2e-5, f"{name}: {contact}"


@pytest.mark.parametrize("find", [bundled.scene_path, bundled.study_path, bundled.example_path])
def test_an_unknown_name_is_refused_with_what_there_is(find) -> None:
    with pytest.raises(InputError) as refused:
        find("no_such_thing")
    assert "no_such_thing" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_package_xml_and_recipe_agree_with_the_package() -> None:
    package = ElementTree.parse(SOURCE / "package.xml").getroot()
    assert (package.get("format"), package.findtext("export/build_type")) == ("3", "ament_python")
    assert (package.findtext("name"), package.findtext("version")) == ("rigid_proto_ros", rigid_proto_ros.__version__)
    recipe = yaml.safe_load((SOURCE / "recipe" / "recipe.yaml").read_text("utf-8"))
    assert rigid_proto_ros.__version__ not in (SOURCE / "recipe" / "recipe.yaml").read_text("utf-8")
    metadata = importlib.metadata.distribution("rigid_proto_ros")
    scripts = {f"{e.name} = {e.value}" for e in metadata.entry_points if e.group == "console_scripts"}
    assert set(recipe["build"]["python"]["entry_points"]) == scripts
    needed = [Requirement(text) for text in metadata.requires or []]
    asked = {r.name.lower(): r.specifier for r in map(Requirement, recipe["requirements"]["run"]) if r.name != "python"}
    assert asked == {r.name.lower(): r.specifier for r in needed if "extra" not in str(r.marker)}


@pytest.mark.skipif(not (SOURCE / ".git").exists(), reason="not run from a clone")
def test_the_source_archive_has_all_that_is_committed_but_what_the_host_reads(tmp_path: Path) -> None:
    names = run("git", "ls-files", cwd=SOURCE).stdout.splitlines()
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(SOURCE / name, tmp_path / name)
    run(sys.executable, "setup.py", "--quiet", "sdist", cwd=tmp_path)
    (archive,) = (tmp_path / "dist").iterdir()
    assert archive.name == f"rigid_proto_ros-{rigid_proto_ros.__version__}.tar.gz"
    with tarfile.open(archive) as opened:
        packed = {one.name.partition("/")[2] for one in opened if one.isfile()}
    made = {"PKG-INFO"} | {name for name in packed if name.startswith("rigid_proto_ros.egg-info/")}
    hosts = {name for name in names if name.startswith((".ci/", ".github/")) or name == ".gitignore"}
    assert packed - made - {"setup.cfg"} == set(names) - hosts - {"setup.cfg"}


@pytest.mark.stress
def test_the_wheel_inspects_simulates_and_serves_the_page_in_an_empty_environment(
    source_copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With what PyPI gives, for this Python. It carries the kernels: nothing is built, and no compiler comes with it."""
    monkeypatch.delenv("PYTHONPATH", raising=False)
    run(sys.executable, "-P", "-m", "rigid_proto_ros.kernels", "wheel", cwd=source_copy, PYTHONPATH=str(source_copy))
    carried = source_copy / "rigid_proto_ros" / "page" / "lib" / "page.html"
    carried.parent.mkdir()
    shutil.copyfile(built_page(), carried)
    run(sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-w", tmp_path, ".", cwd=source_copy)
    (wheel,) = tmp_path.glob("*.whl")
    assert "-py3-none-manylinux_2_17_" in wheel.name
    run(sys.executable, "-m", "venv", tmp_path / "env", cwd=tmp_path)
    run(tmp_path / "env/bin/python", "-m", "pip", "install", "--quiet", wheel, cwd=tmp_path)
    rigid_proto = tmp_path / "env/bin/rigid_proto"
    assert not list((tmp_path / "env").glob("lib/python*/site-packages/numba"))
    empty = tmp_path / "cache"
    run(rigid_proto, "inspect", "hammer", "--verify", cwd=tmp_path, RIGID_PROTO_KERNELS_FOLDER=str(empty))
    assert not empty.exists()
    run(rigid_proto, "simulate", "t_handle", "--duration", "1", "--bag", "flight.mcap", cwd=tmp_path)
    run(rigid_proto, "replay", "flight.mcap", "--verify", cwd=tmp_path)
    served = subprocess.Popen(
        [rigid_proto, "workbench", "hammer", "--no-browser"], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    )
    try:
        assert any("The workbench is at" in line for line in served.stdout)
    finally:
        served.send_signal(signal.SIGINT)
    # Ended by Ctrl-C.
    assert served.wait(timeout=180.0) == 130
