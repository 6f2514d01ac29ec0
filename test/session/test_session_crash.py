# SPDX-License-Identifier: MIT
"""A session outlives its recorder: a node killed while it records, a file cut anywhere; and --repair makes it whole."""

from __future__ import annotations

import random
import signal
import struct
import time
from contextlib import suppress
from pathlib import Path

import pytest
import zstandard

pytest.importorskip("mcap")

from mcap.reader import make_reader

from rigid_proto_ros.base.bundled import example_path, scene_path
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.check import verify
from rigid_proto_ros.session.mcap_observer import McapObserver

SECOND = 10**9
RECORD_HEAD = struct.Struct("<BQ")
MAGIC_BYTES = 8


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("crash") / "whole.mcap"
    recorder = McapObserver(path, simulated_log=True)
    assert OfflineRun(read_scene("t_handle"), read_script(example_path("flip_and_poke")), recorder).advance(5 * SECOND)
    recorder.close()
    return path


def records(data: bytes) -> list[tuple[int, int]]:
    """Offset and opcode of each record of the file."""
    at, found = MAGIC_BYTES, []
    while at + RECORD_HEAD.size <= len(data) - MAGIC_BYTES:
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        found.append((at, opcode))
        at += RECORD_HEAD.size + length
    return found


def last_state_before(data: bytes, offset: int) -> int:
    """End of the simulated time in the chunks that lie whole before an offset."""
    end_ns = -1
    for at, opcode in records(data):
        _, length = RECORD_HEAD.unpack_from(data, at)
        if opcode == 0x06 and at + RECORD_HEAD.size + length <= offset:
            end_ns = int.from_bytes(data[at + 17 : at + 25], "little")
    return end_ns


def offsets(data: bytes) -> list[int]:
    """At random, and at, just before and just behind every border, within heads, and in the index and footer."""
    found = random.Random(3).sample(range(MAGIC_BYTES, len(data)), 20)
    found += [at + d for at, _ in records(data)[::6] for d in (-1, 0, 1, RECORD_HEAD.size, RECORD_HEAD.size + 3)]
    return sorted({offset for offset in found if offset <= len(data)} | {len(data) - d for d in (1, 7, 8, 9, 20, 37)})


def test_a_file_cut_anywhere_shows_all_but_what_the_cut_fell_into(recording, tmp_path):
    data = recording.read_bytes()
    (whole,) = read_runs(recording)
    cut = tmp_path / "cut.mcap"
    empty = 0
    for offset in offsets(data):
        cut.write_bytes(data[:offset])
        try:
            (session,) = read_runs(cut)
        except InputError as error:
            # Before the first topic is declared there is nothing to open.
            assert last_state_before(data, offset) == -1
            assert "\n" not in str(error)
            empty += 1
            continue
        assert session.complete == (offset == len(data))
        n = len(session.times)
        assert session.rows.tobytes() == whole.rows[:n].tobytes()
        assert session.lines == whole.lines[: len(session.lines)]
        # A chunk ends at its last message, an event perhaps; states are 10 ms apart.
        assert session.end_ns > last_state_before(data, offset) - 20_000_000
    assert empty < 20


def test_what_a_cut_left_is_verified_and_repaired_to_a_file_that_the_stock_reader_opens(recording, tmp_path, capsys):
    data = recording.read_bytes()
    cut, repaired = tmp_path / "cut.mcap", tmp_path / "repaired.mcap"
    for offset in random.Random(5).sample(range(len(data) // 4, len(data)), 3):
        cut.write_bytes(data[:offset])
        assert main(["replay", str(cut), "--repair", str(repaired)]) == 0
        assert "truncated" in capsys.readouterr().out
        (before,), (after,) = read_runs(cut), read_runs(repaired)
        assert verify(before) is None
        assert after.complete and after.lines == before.lines
        assert after.rows.tobytes() == before.rows.tobytes()
        assert after.attachments == before.attachments
        with open(repaired, "rb") as stream:
            summary = make_reader(stream, validate_crcs=True).get_summary()
            counts = {summary.channels[k].topic: n for k, n in summary.statistics.channel_message_counts.items()}
        assert counts.get("/rigid_body/pose", 0) == len(before.times)


def test_repair_is_refused_where_it_would_harm(recording, tmp_path, capsys):
    before = recording.read_bytes()
    for target in (recording, tmp_path / "other.rrd", recording / "x.mcap"):
        assert main(["replay", str(recording), "--repair", str(target)]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
        assert recording.read_bytes() == before


def test_damage_inside_is_refused_in_one_line(recording, tmp_path, capsys):
    data = recording.read_bytes()
    chunks = [at for at, opcode in records(data) if opcode == 0x06]
    repaired = tmp_path / "repaired.mcap"
    repaired.write_bytes(b"an earlier one")
    for offset in (chunks[2] + 60, chunks[3] + 30, chunks[4] + 200):
        damaged = bytearray(data)
        damaged[offset : offset + 16] = bytes(255 - b for b in damaged[offset : offset + 16])
        (tmp_path / "damaged.mcap").write_bytes(damaged)
        for options in ([], ["--repair", str(repaired)]):
            assert main(["replay", str(tmp_path / "damaged.mcap"), *options]) == 2
            error = capsys.readouterr().err
            assert len(error.splitlines()) == 1 and "damaged.mcap" in error
    assert repaired.read_bytes() == b"an earlier one"
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("says_size", [True, False])
def test_a_chunk_that_unpacks_to_far_more_than_the_file_can_is_refused(says_size, tmp_path):
    frame = zstandard.ZstdCompressor(write_content_size=says_size).compress(bytes(200_000_000))
    # Where the frame itself says its size, the chunk may lie.
    size = 100 if says_size else 200_000_000
    chunk = struct.pack("<QQQII4sQ", 0, 0, size, 0, 4, b"zstd", len(frame)) + frame
    path = tmp_path / "bomb.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + RECORD_HEAD.pack(0x06, len(chunk)) + chunk)
    with pytest.raises(InputError, match="chunks that hold more"):
        read_runs(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the content"),
        (b"\x89MCAP", "the content"),
        (random.Random(4).randbytes(3000), "the content"),
        (b"\x89MCAP0\r\n", "ends before its first chunk"),
    ],
)
def test_a_file_whose_content_is_no_recording_is_said_to_be_none(content, words, tmp_path, capsys):
    path = tmp_path / "noise.mcap"
    path.write_bytes(content)
    assert main(["replay", str(path)]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1 and "noise.mcap" in error and words in error and "()" not in error


def test_random_bytes_never_end_in_a_traceback(recording, tmp_path, capsys):
    data, rng = recording.read_bytes(), random.Random(6)
    path = tmp_path / "random.mcap"
    for _ in range(20):
        damaged = bytearray(data[: rng.randrange(1, len(data))])
        for _ in range(rng.randrange(1, 4)):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        path.write_bytes(damaged)
        assert main(["replay", str(path), "--verify"]) in (0, 1, 2)
        assert "Traceback" not in capsys.readouterr().err


# A node killed


def waits_ns(pid: int) -> dict[str, int]:
    """How long each thread of a process has waited for a core [ns], by its number."""
    waits = {}
    for task in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        with suppress(OSError):  # the thread has ended meanwhile
            waits[task.parent.name] = int(task.read_text().split()[1])
    return waits


def starved_ns(before: dict[str, int], after: dict[str, int]) -> int:
    """How long the threads that are there after have waited since."""
    return sum(wait - before.get(thread, 0) for thread, wait in after.items())


def states_end_ns(path: Path) -> int:
    """Time of the last state in the file, or -1: the topics tell states earlier, as nobody who simulates waits for a
    disk.
    """
    try:
        (session,) = read_runs(path)
    except InputError:
        return -1
    return session.end_ns if len(session.times) else -1


def kill_while_recording(environment: dict[str, str], folder: Path, after_s: float) -> None:
    from command_rig import wrench_message
    from ros_client import RosClient, stamp_ns
    from ros_process import start_node

    pytest.importorskip("rclpy")
    path = folder / "session.mcap"
    values = {"record": str(path), "publish_rate": 200}
    node = start_node(environment, folder / "node", values, "--params-file", scene_path("t_handle"))
    # How long the node had waited for a core, and then where the file ended.
    seen: list[tuple[dict[str, int], int]] = []

    def recorded_for_long_enough() -> bool:
        seen.append((waits_ns(node.pid), states_end_ns(path)))
        _, end_ns = seen[-1]
        return client.heard_count("pose") and time.monotonic() > earliest and end_ns >= 0

    try:
        with RosClient(environment) as client:
            node.wait_for("is simulating")
            seen.append((waits_ns(node.pid), -1))
            client.meet()
            client.publish("poke", wrench_message(0, "world@tip;impulse", (0.0, 0.001, 0.0)))
            earliest = time.monotonic() + after_s
            client.until(recorded_for_long_enough, "states on the topic and in the file")
            # Stopped, it waits for no core while that is read.
            node.process.send_signal(signal.SIGSTOP)
            waited = waits_ns(node.pid)
            node.process.kill()
            node.process.wait()
            last = max(stamp_ns(message) for topic in ("pose", "twist") for message in client.heard(topic, last=1))
            # Fast DDS 2.14 maps shared memory anew about a second after its peer was killed. A participant that is closed at
            # that moment locks memory that is gone: 7 of 270 clients ended there with a segmentation fault.
            time.sleep(2.0)
    finally:
        node.process.kill()
        node.process.wait()
    (session,) = read_runs(path)
    assert not session.complete
    # A second of what the machine let the node have since the last flush: a thread that gets no core flushes nothing.
    starved = min(starved_ns(before, waited) for before, end_ns in seen if end_ns < session.end_ns)
    assert last - session.end_ns <= SECOND + starved
    assert verify(session) is None
    repaired = folder / "repaired.mcap"
    assert main(["replay", str(path), "--repair", str(repaired)]) == 0
    (again,) = read_runs(repaired)
    assert again.complete and again.rows.tobytes() == session.rows.tobytes() and again.lines == session.lines


MOMENTS = random.Random(0)


@pytest.mark.parametrize(
    "after_s", [1.0, *(pytest.param(MOMENTS.uniform(0.0, 6.0), marks=pytest.mark.stress) for _ in range(20))]
)
def test_a_node_killed_at_a_random_moment_loses_at_most_a_second(ros_environment, tmp_path, after_s):
    kill_while_recording(ros_environment, tmp_path, after_s)
