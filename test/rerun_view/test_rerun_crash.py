# SPDX-License-Identifier: MIT
"""A recording outlives its recorder: killed or cut anywhere, it opens and shows what had been flushed."""

from __future__ import annotations

import os
import random
import signal
from pathlib import Path

import numpy as np
import pytest
import rerun_flight as flight
from rerun.chunk import RrdReader

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.rerun_view.observer import FileRecorder
from rigid_proto_ros.rerun_view.rrd_reading import FRAME_HEAD, HEADER_BYTES, read_session, whole_bytes
from rigid_proto_ros.rerun_view.session_files import repair


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("crash") / "whole.rrd"
    observer = FileRecorder(str(path), files=[flight.FILE])
    flight.fly(observer, flight.rows(400))
    observer.close()
    return path


def frame_starts(data: bytes) -> list[int]:
    """Offsets at which the file's frames begin, and where the last one before the end mark ends."""
    at, starts = HEADER_BYTES, []
    while True:
        starts.append(at)
        kind, length = FRAME_HEAD.unpack_from(data, at)
        if kind == 0:
            return starts
        at += FRAME_HEAD.size + length


def test_a_file_cut_anywhere_is_read_as_far_as_it_is_whole(recording, tmp_path):
    data = recording.read_bytes()
    whole = read_session(recording)
    starts = frame_starts(data)
    offsets = np.random.default_rng(3).integers(starts[2], len(data), 6).tolist()
    # And at, just before and just behind borders between frames, those of the first states and the last ones among them.
    borders = sorted({*starts[3:9], *starts[9:-4:7], *starts[-4:]})
    offsets += [start + d for start, d in zip(borders, (-1, 0, 1, FRAME_HEAD.size) * len(borders), strict=False)]
    offsets += [starts[-1], len(data) - 1]
    cut = tmp_path / "cut.rrd"
    for offset in offsets:
        cut.write_bytes(data[:offset])
        session = read_session(cut)
        n = len(session.times)
        assert not session.complete or offset > starts[-1]
        assert session.rows.tobytes() == whole.rows[:n].tobytes()
        assert session.events == whole.events[: len(session.events)]
        if n:
            # What the states are computed from is there before them.
            assert session.scene == whole.scene and session.attachments == whole.attachments == [flight.FILE]
            assert session.events[-1:] >= [event for event in whole.events if event[0] < session.times[-1]][-1:]
        if offset >= starts[-1]:
            assert n == len(whole.times)


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_repair_makes_a_file_that_is_complete_again_and_that_the_library_reads(recording, tmp_path):
    data = recording.read_bytes()
    cut, repaired = tmp_path / "cut.rrd", tmp_path / "repaired.rrd"
    for offset in (frame_starts(data)[-1] - 7, len(data) // 2):
        cut.write_bytes(data[:offset])
        before = read_session(cut)
        repair(cut, repaired)
        after = read_session(repaired)
        assert after.complete and not before.complete
        assert after.rows.tobytes() == before.rows.tobytes() and len(after.times)
        assert np.array_equal(after.times, before.times)
        assert after.events == before.events
        (found,) = RrdReader(repaired).recordings()
        assert sum(1 for _ in RrdReader(repaired).stream(store=found)) > 10


def test_what_is_no_recording_is_refused_in_one_line(recording, tmp_path):
    data = recording.read_bytes()
    damaged, inside = bytearray(data), frame_starts(data)[len(frame_starts(data)) // 2]
    damaged[inside + 30 : inside + 200] = bytes(170)
    for name, content in {
        "empty.rrd": b"",
        "text.rrd": b"not a recording at all",
        "noise.rrd": random.Random(4).randbytes(3000),
        "head.rrd": data[: HEADER_BYTES + 5],
        "damaged.rrd": bytes(damaged),
    }.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError) as refusal:
            read_session(tmp_path / name)
        assert "\n" not in str(refusal.value) and name in str(refusal.value)
        assert ("content" in str(refusal.value)) == (name in ("empty.rrd", "text.rrd", "noise.rrd"))
    with pytest.raises(InputError, match="No such file"):
        read_session(tmp_path / "nowhere.rrd")


RECORDER = """
import os, sys, time
import rerun_flight as flight
from rerun.chunk import RrdReader
from rigid_proto_ros.simulation.observer import BodyChanged, Published, Started
from rigid_proto_ros.rerun_view.observer import FileRecorder
observer = FileRecorder(sys.argv[1])
states = flight.rows(100_000)
published, flush = 0, observer._write_what_waits
def told():
    before = published
    flush()
    print("flushed", before, flush=True)
observer._write_what_waits = told
observer.on(Started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256))
observer.on(BodyChanged(0, flight.SETUP))
for k, row in enumerate(states):
    observer.on(Published(k * flight.PERIOD_NS, row))
    published = k + 1
    time.sleep(0.01)
"""


def test_kill_9_loses_what_came_since_the_last_flush_half_a_second_ago(tmp_path):
    path = tmp_path / "killed.rrd"
    recorder = flight.child(RECORDER, path)
    try:
        flushed = [int(recorder.stdout.readline().split()[1]) for _ in range(3)][-1]
        os.kill(recorder.pid, signal.SIGKILL)
        flushed = max([flushed, *(int(line.split()[1]) for line in recorder.stdout if line.endswith("\n"))])
    finally:
        recorder.kill()
        recorder.wait()
        recorder.stdout.close()
    session = read_session(path)
    states = flight.rows(100_000)
    assert session.rows.tobytes() == states[: len(session.rows)].tobytes()
    assert len(session.times) >= flushed > 0
    assert FileRecorder.period_s <= 0.5
    assert whole_bytes(path)[0] <= path.stat().st_size
