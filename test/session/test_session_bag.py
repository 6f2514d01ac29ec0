# SPDX-License-Identifier: MIT
"""Bags of a real node's topics, in every layout that ros2 bag record has: read, shown, verified to the bit."""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mcap")
pytest.importorskip("rclpy")

from command_rig import wrench_message
from flights import SECOND
from mcap.writer import CompressionType, Writer
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_client import LATCHED, TOPICS, RosClient
from ros_process import running_node

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mesh.locate import resolve_mesh
from rigid_proto_ros.scene import cdr
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.check import verify
from rigid_proto_ros.session.messages import DEFINITIONS, PROJECTIONS, read_state
from rigid_proto_ros.session.messages import TOPICS as WRITTEN

ODOMETRY = "nav_msgs/msg/Odometry"
RECORDED = {**{name: kind for name, kind in WRITTEN.items() if name in TOPICS}, "odom": ODOMETRY}
DEFINED = {**DEFINITIONS, ODOMETRY: "std_msgs/Header header\nstring child_frame_id\n"}
"""Odometry's own definition is longer; nothing here decodes it by its schema."""


@dataclass(frozen=True)
class Logged:
    """A message as a recorder has it."""

    topic: str
    type: str
    log_time: int
    data: bytes


class BagRecorder(RosClient):
    """A client that subscribes to a node's topics before the node is there, and keeps every message's bytes."""

    def __init__(self, environment: dict[str, str]) -> None:
        super().__init__(environment, in_order=True)
        self.messages: list[Logged] = []
        for topic in RECORDED:
            latched = DurabilityPolicy.TRANSIENT_LOCAL if topic in LATCHED else DurabilityPolicy.VOLATILE
            self.own.create_subscription(
                TOPICS[topic], self.name(topic), self._keep(topic), QoSProfile(depth=1000, durability=latched), raw=True
            )

    def _keep(self, topic: str):
        name, message_type = self.name(topic), RECORDED[topic]
        return lambda data: self.messages.append(Logged(name, message_type, time.time_ns(), bytes(data)))

    def finish(self) -> list[Logged]:
        """Pause the node, wait for its last event and states, and return what was received."""
        self.pause(True)
        end_ns = int(self.diagnostics()["sim_time_ns"])

        def is_whole() -> bool:
            last = {message.topic.rpartition("/")[2]: message.data for message in list(self.messages)}
            stamps = {read_state(name, last[name], name)[0] for name in PROJECTIONS}
            return stamps == {end_ns} and b'"pause"' in last["events"]

        self.until(is_whole, "the last messages")
        self.close()
        return self.messages


def write_bag_file(
    path: Path,
    messages: list[Logged],
    *,
    compression: CompressionType = CompressionType.NONE,
    chunk_size: int = 768 * 1024,
    finish: bool = True,
) -> None:
    """One .mcap file as rosbag2_storage_mcap writes it; its default is chunks without compression."""
    with open(path, "wb") as stream:
        writer = Writer(stream, chunk_size=chunk_size, compression=compression)
        writer.start(profile="ros2", library="libmcap 1.3.0")
        channels: dict[str, int] = {}
        schemas: dict[str, int] = {}
        for message in messages:
            if message.topic not in channels:
                if message.type not in schemas:
                    schemas[message.type] = writer.register_schema(
                        message.type, "ros2msg", DEFINED[message.type].encode()
                    )
                qos = {"offered_qos_profiles": "- history: unknown\n  depth: 0\n  reliability: reliable\n"}
                channels[message.topic] = writer.register_channel(
                    message.topic, "cdr", schemas[message.type], {**qos, "topic_type_hash": "RIHS01_0"}
                )
            writer.add_message(channels[message.topic], message.log_time, message.data, message.log_time)
        if finish:
            writer.add_metadata("rosbag2", {"serialized_metadata": "version: 9\n"})
            writer.finish()
        else:
            writer.flush()


def write_bag(folder: Path, messages: list[Logged], *, files: int = 1, **options) -> Path:
    """A bag's folder; ``files`` as after splitting."""
    folder.mkdir()
    size = -(-len(messages) // files)
    for k in range(files):
        write_bag_file(folder / f"{folder.name}_{k}.mcap", messages[k * size : (k + 1) * size], **options)
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 9\n")
    return folder


@pytest.fixture(scope="module")
def flown(ros_environment, tmp_path_factory) -> list[Logged]:
    """Two runs of a node, poked, pulled and changed in both; the reset between them takes changed parameters along."""
    folder = tmp_path_factory.mktemp("flown")
    shutil.copy(resolve_mesh("l_bracket"), folder / "bracket.obj")
    client = BagRecorder(ros_environment)
    values = {"mesh": str(folder / "bracket.obj"), "initial.angular_velocity": [0.3, 2.0, 0.1], "start_paused": True}
    values |= {"contacts.tip": [0.01, 0.0, 0.0], "real_time_factor": 2.0}
    with running_node(ros_environment, folder / "node", values):
        client.meet()
        # Recorders find the node late; nothing has moved by then.
        client.until(lambda: any(m.topic.endswith("twist") for m in client.messages), "states")
        client.pause(False)
        _fly(client)
        client.reset()
        _fly(client)
        messages = client.finish()
    (folder / "bracket.obj").unlink()
    return messages


def _fly(client: RosClient) -> None:
    client.publish("poke", wrench_message(0, "world@tip;impulse", (0.0, 0.001, 0.0)))
    client.publish("wrench", wrench_message(0, "body", torque=(0.0, 0.0, 1e-4)))
    client.fly_until(SECOND // 2)
    client.set(gravity=[0.0, 0.0, -0.5], density=2000.0)
    client.pause(True)
    client.trigger("step")
    client.publish("poke", wrench_message(0, "world@point/0.0,0.0,0.0;duration=0.1", (0.01, 0.0, 0.0)))
    client.pause(False)
    client.fly_until(SECOND)
    client.set(string__target=[0.0, 0.0, 0.2], string__attached=True)
    client.fly_until(SECOND * 3 // 2)
    client.set(string__attached=False, density=1000.0, gravity=[0.0, 0.0, 0.0])
    client.trigger("clear_wrench")
    client.fly_until(SECOND * 7 // 4)


@pytest.fixture
def mesh_beside(tmp_path) -> None:
    """The file that the node flew, where a bag's reader looks for it."""
    shutil.copy(resolve_mesh("l_bracket"), tmp_path / "bracket.obj")


def _states_late(messages: list[Logged]) -> list[Logged]:
    """As a recorder on a busy machine has them: states seconds behind the events that they follow."""
    return [
        replace(m, log_time=m.log_time + 3 * SECOND) if m.topic.rpartition("/")[2] in PROJECTIONS else m
        for m in messages
    ]


LAYOUTS = {
    "bare": lambda to, m: write_bag_file(to.with_suffix(".mcap"), m),
    "late": lambda to, m: write_bag_file(to.with_suffix(".mcap"), _states_late(m)),
    "split": lambda to, m: write_bag(to, m, files=12, chunk_size=20_000, compression=CompressionType.ZSTD),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_bag_alone_or_split_or_of_a_slow_recorder_is_verified_to_the_bit(flown, mesh_beside, tmp_path, layout):
    LAYOUTS[layout](tmp_path / "bag", flown)
    path = tmp_path / "bag" if (tmp_path / "bag").is_dir() else tmp_path / "bag.mcap"
    first, second = runs = read_runs(path)
    for run in runs:
        assert len(run.events) >= 9
        assert len(run.published["pose"]) > 150 and len(run.published["odom"]) > 150
        # The two runs are told apart by their stamps.
        for rows in run.published.values():
            assert (np.diff(rows.times) >= 0).all()
            assert rows.times[-1] >= SECOND * 7 // 4
            assert rows.times[0] < SECOND // 4
        assert verify(run) is None
    # What the first run left is what the second begins with.
    assert "gravity: [0.0, 0.0, 0.0]" in first.scene
    assert "string.target: [0.0, 0.0, 0.2]" in second.scene
    assert "string.target: [0.0, 0.0, 0.2]" not in first.scene


def test_a_mesh_that_is_nowhere_is_named_with_its_hash(flown, tmp_path):
    LAYOUTS["bare"](tmp_path / "bag", flown)
    (run, _) = read_runs(tmp_path / "bag.mcap")
    with pytest.raises(InputError, match=f"bracket.obj.*{run.mesh_sha256}"):
        verify(run)


def _without(messages: list[Logged], *names: str) -> list[Logged]:
    return [m for m in messages if m.topic.rpartition("/")[2] not in names]


def _command(capsys, *arguments) -> tuple[int, str, str]:
    status = main(["replay", *map(str, arguments)])
    said = capsys.readouterr()
    return status, said.out, said.err


def test_a_bag_that_began_later_is_verified_from_a_reset_on_alone(flown, mesh_beside, tmp_path, capsys):
    begin = [m for m in flown if m.topic.endswith("events")][4].log_time
    late = [m for m in flown if m.log_time > begin or m.topic.endswith("scene")]
    reset = next(m.log_time for m in late if '"kind": "reset"' in m.data.decode(errors="ignore"))
    LAYOUTS["bare"](tmp_path / "first", [m for m in late if m.log_time < reset])
    status, _, err = _command(capsys, tmp_path / "first.mcap", "--verify")
    assert status == 2 and len(err.splitlines()) == 1 and "begins at" in err
    LAYOUTS["bare"](tmp_path / "bag", late)
    status, out, _ = _command(capsys, tmp_path / "bag.mcap", "--verify")
    assert status == 0
    assert "run 1: not checked: a recording that begins at" in out


@pytest.mark.parametrize("missing", [("events",), ("scene",), ("events", "scene"), ("pose", "twist", "odom")])
def test_a_bag_that_lacks_a_topic_is_shown_and_branched_with_a_scene_and_verify_names_the_topic(
    flown, mesh_beside, tmp_path, capsys, missing
):
    write_bag(tmp_path / "bag", _without(flown, *missing))
    bag, scene = tmp_path / "bag", tmp_path / "scene.yaml"
    status, _, err = _command(capsys, bag, "--verify")
    assert status == 2
    assert len(err.splitlines()) == 1
    assert all(f"/rigid_body/{name}" in err for name in missing[:1])
    if "pose" in missing:
        return
    if "scene" in missing:
        status, _, err = _command(capsys, bag, "--record", tmp_path / "x.mcap")
        assert status == 2 and "--scene FILE" in err and len(err.splitlines()) == 1
    branch = (bag, "--at", 1, "--as-scene", tmp_path / "x.yaml")
    status, _, err = _command(capsys, *branch)
    assert status == 2 and "--scene FILE" in err and len(err.splitlines()) == 1
    scene.write_text(f"rigid_body:\n  ros__parameters:\n    mesh: {tmp_path / 'bracket.obj'}\n    density: 3.0\n")
    status, out, _ = _command(capsys, *branch, "--scene", scene)
    assert status == 0 and "recorded at 1 s; what acts then isn't recorded" in out
    begun, last = read_scene(str(tmp_path / "x.yaml")), read_runs(bag)[-1]
    assert np.abs(begun.setup.initial - last.rows[last.times.tolist().index(SECOND)]).max() < 1e-12
    assert begun.parameters.density == 3.0 and read_script(tmp_path / "x_script.yaml") == []
    shown = tmp_path / "shown.mcap"
    assert _command(capsys, bag, "--scene", scene, "--record", shown)[0] == 0
    recorded = read_runs(bag)
    again = read_runs(shown)
    assert sum(len(run.times) for run in again) == sum(len(run.times) for run in recorded)
    assert np.array_equal(again[0].published["pose"].rows[-1], recorded[0].published["pose"].rows[-1])


def test_a_bag_whose_recorder_was_killed_is_read_up_to_its_last_chunk(flown, mesh_beside, tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    write_bag_file(folder / "bag_0.mcap", flown, chunk_size=20_000, finish=False)
    data = (folder / "bag_0.mcap").read_bytes()
    (folder / "bag_0.mcap").write_bytes(data[: len(data) * 3 // 4])
    runs = read_runs(folder)
    assert not runs[-1].complete
    assert sum(len(run.times) for run in runs) > 200
    for run in runs:
        assert verify(run) is None


def test_what_is_no_bag_is_refused_in_one_line(flown, tmp_path, capsys):
    empty = tmp_path / "empty"
    empty.mkdir()
    other = tmp_path / "other.mcap"
    write_bag_file(other, [Logged("/chatter", "std_msgs/msg/String", 1, cdr.string("hello"))])
    garbled = tmp_path / "garbled.mcap"
    bad = [replace(m, data=b"\x00\x01") if m.topic.endswith("pose") else m for m in flown]
    write_bag_file(garbled, bad)
    clock, line = tmp_path / "clock.mcap", '{"time_ns": 0, "kind": "clock", "content": {"offset_ns": 5}}'
    write_bag_file(clock, [*flown, Logged("/rigid_body/events", WRITTEN["events"], 1, cdr.string(line))])
    database = tmp_path / "bag.db3"
    database.write_bytes(b"SQLite format 3\0")
    for path, word in (
        (empty, "ros2 bag convert"),
        (other, "/chatter"),
        (garbled, "pose"),
        (clock, "a recording by the parameter record"),
        (database, "ros2 bag convert"),
    ):
        status, _, err = _command(capsys, path)
        assert status == 2 and word in err and len(err.splitlines()) == 1, err


def test_of_two_bodies_in_a_bag_one_is_to_be_chosen(flown, mesh_beside, tmp_path, capsys):
    both = [*flown, *(replace(m, topic=m.topic.replace("/rigid_body/", "/other/")) for m in flown)]
    LAYOUTS["bare"](tmp_path / "bag", both)
    bag = tmp_path / "bag.mcap"
    status, _, err = _command(capsys, bag)
    assert status == 2 and "/other" in err and "--node" in err
    assert _command(capsys, bag, "--node", "/other", "--verify")[0] == 0
