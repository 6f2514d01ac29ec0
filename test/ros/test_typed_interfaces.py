# SPDX-License-Identifier: MIT
"""The package of typed messages beside: built with the generators of the ROS wheels, and taken by a node that finds it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

from command_rig import RosClient
from ros_process import READY_S, SOURCE, running_node

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.frames import Frame, parse_frame
from rigid_proto_ros.ros.body_wrenches import body_wrench_type, frame_of

PACKAGE = SOURCE / "interfaces" / "rigid_proto_interfaces"
BUILDER = SOURCE / "tools" / "build_interfaces.py"

needs_compiler = pytest.mark.skipif(
    not (PACKAGE.is_dir() and shutil.which("cc") and shutil.which("c++")),
    reason="not run from a source tree with a C and a C++ compiler",
)


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    """The folder that holds the built package."""
    folder = tmp_path_factory.mktemp("interfaces")
    done = subprocess.run(
        [sys.executable, str(BUILDER), str(PACKAGE), "--out", str(folder)],
        capture_output=True,
        text=True,
        timeout=READY_S,
    )
    assert done.returncode == 0, done.stderr
    return folder


def message(axes: str = "", point: str = "", slot: str = "", duration: float = 0.0, impulse: bool = False):
    header = SimpleNamespace(frame_id=axes)
    return SimpleNamespace(header=header, point=point, slot=slot, duration=duration, impulse=impulse)


@pytest.mark.parametrize(
    ("typed", "frame"),
    [
        (message(), Frame("world", ("com",))),
        (message("body"), Frame("body", ("com",))),
        (message("", "tip", slot="left"), Frame("world", ("contact", "tip"), slot="left")),
        (message("rigid_body", "vertex/3", duration=0.5), Frame("body", ("vertex", 3), 0.5)),
        (message("normal", "point/0,0,0.07", impulse=True), Frame("normal", ("point", (0.0, 0.0, 0.07)), impulse=True)),
        (message("tip", "", "a", 0.25), Frame("body", ("contact", "tip"), 0.25, slot="a")),
    ],
)
def test_fields_of_their_own_say_what_a_frame_id_says(typed, frame) -> None:
    assert parse_frame(frame_of(typed), {"tip"}, "world", "rigid_body") == frame


CLIENT = """
import rclpy, sys, time
from rigid_proto_interfaces.msg import BodyWrench
rclpy.init()
node = rclpy.create_node("typed")
publishers = {t: node.create_publisher(BodyWrench, "/rigid_body/" + t, 10) for t in ("body_wrench", "body_poke")}
while not all(p.get_subscription_count() for p in publishers.values()):
    time.sleep(0.02)
def send(topic, axes, **fields):
    message = BodyWrench(**fields)
    message.header.frame_id = axes
    message.wrench.force.z = 1e-3
    publishers[topic].publish(message)
send("body_wrench", "world", point="tip", slot="left")
send("body_poke", "body", point="vertex/3", duration=0.5)
send("body_poke", "", impulse=True)
send("body_poke", "nowhere")
assert all(p.wait_for_all_acked(rclpy.duration.Duration(seconds=100.0)) for p in publishers.values())
node.destroy_node()
rclpy.shutdown()
"""


@needs_compiler
def test_a_node_that_finds_the_package_takes_its_messages_as_it_takes_wrenches(ros_environment, tmp_path, built):
    path = os.pathsep.join(filter(None, (str(built), os.environ.get("PYTHONPATH", ""))))
    environment = {**ros_environment, "PYTHONPATH": path}
    scene = ("--ros-args", "--params-file", scene_path("t_handle"), "-p", "start_paused:=true")
    with (
        RosClient(ros_environment) as client,
        running_node(*scene, environment=environment, log=tmp_path / "node"),
    ):
        client.listen("pose", "events")
        client.watch_diagnostics()
        client.until(lambda: client.trigger("reset") and client.events(), "the node to know that somebody listens")
        sent = subprocess.run([sys.executable, "-c", CLIENT], env=environment, capture_output=True, text=True)
        assert sent.returncode == 0, sent.stderr
        report = client.until_received(4)
        assert (report["wrench_received"], report["poke_received"], report["refused_frame"]) == ("1", "3", "1")
        assert client.trigger("step")["success"]
        frames = {"world@tip;slot=left", "body@vertex/3;duration=0.5", ";impulse"}
        client.until(lambda: frames == {e["content"].get("frame_id") for e in client.events()} - {None}, "its events")


XML = "<package><name>some_interfaces</name></package>"
REFUSED = {
    "no folder": ({}, "package.xml: "),
    "broken xml": ({"package.xml": "<package"}, "package.xml: "),
    "nothing in it": ({"package.xml": XML}, "no msg/"),
    "a bad line": ({"package.xml": XML, "msg/Foo.msg": "float64 Bad Name = 3\n"}, "invalid"),
    "unknown type": ({"package.xml": XML, "msg/Foo.msg": "other_msgs/Thing thing\n"}, "other_msgs"),
}


@needs_compiler
@pytest.mark.parametrize("case", REFUSED)
def test_a_package_that_cannot_be_built_ends_in_one_line(tmp_path, case) -> None:
    files, reason = REFUSED[case]
    for name, text in files.items():
        (tmp_path / "some" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "some" / name).write_text(text)
    arguments = [str(tmp_path / "some"), "--out", str(tmp_path / "out")]
    done = subprocess.run([sys.executable, str(BUILDER), *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done.stderr
    assert str(tmp_path / "some") in done.stderr and reason in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_build_that_cannot_be_loaded_is_refused_in_one_line(tmp_path, monkeypatch) -> None:
    package = tmp_path / "rigid_proto_interfaces" / "msg"
    package.mkdir(parents=True)
    (package.parent / "__init__.py").touch()
    (package / "__init__.py").write_text("class BodyWrench:\n    pass\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in [name for name in sys.modules if name.startswith("rigid_proto_interfaces")]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(InputError, match="make interfaces") as caught:
        body_wrench_type()
    assert "\n" not in str(caught.value)
    for name in [name for name in sys.modules if name.startswith("rigid_proto_interfaces")]:
        del sys.modules[name]
