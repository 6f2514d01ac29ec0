# SPDX-License-Identifier: MIT
"""What several test files share: real meshes, and a ROS domain of this run's own."""

import importlib.util
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from rigid_proto_ros.base import library
from rigid_proto_ros.ros.domain import hold_domain

settings.register_profile("the same examples every time", derandomize=True, deadline=None)
settings.register_profile("new examples every time", deadline=None)
settings.load_profile(f"{os.environ.get('RIGID_PROTO_EXAMPLES', 'the same')} examples every time")

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

NEEDED = {"rerun": ["cli/test_demo.py", "rerun_view/test_*.py"]}
"""Files that test an extra; without its package (apt's numpy is too old for Rerun's) the rest of the suite runs all the same."""

MISSING = {package: files for package, files in NEEDED.items() if importlib.util.find_spec(package) is None}
needs_rerun = pytest.mark.skipif("rerun" in MISSING, reason="rerun-sdk is not installed")
"""For single tests that record to .rrd."""

ENDINGS = [".mcap", pytest.param(".rrd", marks=needs_rerun)]
"""Of the files that a flight is recorded to: the recording, and the view."""

collect_ignore_glob = [file for files in MISSING.values() for file in files]


LONG = (
    *(
        "browser",
        "msg_examples",
        "browser_keep",
        "readme",
        "sweep_runs",
        "replay_publish",
        "mass_exactness",
        "poke_client",
    ),
    *("commands_flood", "time_in_flight", "demo", "executables"),
    *("session_crash", "order_of_commands", "commands_node", "string_pendulum", "rerun_live", "rerun_slow_viewers"),
    *("snapshot", "packaging", "fitting", "rerun_crash", "conventions_of_the_node", "node_signals"),
    *("session_bag", "node_workbench", "commands_refused", "simulate_bad_input"),
    *("mesh_fuzz", "architecture", "sweep_bits"),
)
"""Files that take longest, waiting and computing ones by turns: workers begin with them, so that none has one left at the end."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The files' order; within a file, and of all others, it stays as it is."""
    rank = {f"test_{name}": number for number, name in enumerate(LONG)}
    items.sort(key=lambda item: rank.get(item.path.stem, len(rank)))


def pytest_report_header() -> list[str]:
    """What isn't run, and why."""
    return [f"not run, for want of {package}: {', '.join(files)}" for package, files in MISSING.items()]


@pytest.fixture(scope="session")
def meshes() -> Path:
    """Folder of the real meshes with their truth.json; without RIGID_PROTO_MESHES the test skips and says so."""
    folder = os.environ.get("RIGID_PROTO_MESHES", "")
    if not folder:
        pytest.skip("RIGID_PROTO_MESHES is not set: no real meshes")
    path = Path(folder)
    if not path.is_dir():
        pytest.fail(f"RIGID_PROTO_MESHES: {folder} is not a folder")
    return path.resolve()


@pytest.fixture(scope="session")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What rigid_proto_ros/page/data.py writes for the page."""
    from rigid_proto_ros.page.data import page_data

    file = tmp_path_factory.mktemp("page") / "data"
    file.write_bytes(page_data())
    return file


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """The browser that the tests of a module share."""
    from page_browser import chromium

    with chromium() as found:
        yield found


@pytest.fixture
def opened(browser: Any) -> Iterator[Any]:
    """The page's first screen, paused a third of a second after it began."""
    from page_browser import Opened

    page = Opened(browser)
    page.pause()
    page.fly(0.33)
    yield page
    page.close()


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The user's cache folder is a test's own, but for the kernels in it: each would be compiled once more."""
    monkeypatch.setenv("RIGID_PROTO_KERNELS_FOLDER", library.kernels_folder())
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("RIGID_PROTO_CACHE", raising=False)


@contextmanager
def held_domain() -> Iterator[int]:
    """A ROS domain in 1..101 that no other test session on this machine holds, whichever checkout it runs from."""
    held = hold_domain(1 + (os.getpid() + k) % 101 for k in range(101))
    assert held is not None, "all ROS domains 1..101 are held by others"
    domain, lock = held
    with lock:
        yield domain


@pytest.fixture(scope="session")
def ros_domain_id() -> Iterator[int]:
    """The ROS domain of this test session."""
    with held_domain() as domain:
        yield domain


@pytest.fixture(scope="session")
def ros_environment(ros_domain_id: int) -> dict[str, str]:
    """Environment for child processes of this interpreter: own domain, nothing leaves the machine."""
    return {**os.environ, "ROS_DOMAIN_ID": str(ros_domain_id)}


@pytest.fixture(scope="module")
def commanded(ros_environment, tmp_path_factory):
    """A flying node and a client of it, in a domain of their own, shared by a file's tests (test/command_rig.py)."""
    from command_rig import Commanded

    with held_domain() as domain:
        shared = Commanded({**ros_environment, "ROS_DOMAIN_ID": str(domain)}, tmp_path_factory.mktemp("commanded"))
        yield shared
        shared.close()


@pytest.fixture
def rig(commanded):
    """The shared node with its first parameters in force again, reset and running, and nothing heard yet."""
    commanded.restore()
    yield commanded
    assert commanded.node_process.process.poll() is None, commanded.node_process.errors
    # Flying on, perhaps at the test's own rates, node and client would take half a core from all tests to come.
    commanded.pause(True)
