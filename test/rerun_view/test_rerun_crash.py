# SPDX-License-Identifier: MIT
"""A view outlives its recorder: killed, it opens and shows what had been written."""

from __future__ import annotations

import os
import signal

import pytest
import rerun_flight as flight

from rigid_proto_ros.rerun_view.observer import WRITE_S

RECORDER = """
import sys, time
import rerun_flight as flight
from rigid_proto_ros.simulation.observer import BodyChanged, Published, Started
from rigid_proto_ros.rerun_view import observer as module
module.WRITE_S = 0.5
observer = module.FileRecorder(sys.argv[1])
states = flight.rows(100_000)
published, write = 0, observer._write
def told(events):
    before = published
    write(events)
    observer._stream.flush()
    print("written", before, flush=True)
observer._write = told
observer.on(Started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256))
observer.on(BodyChanged(0, flight.SETUP))
for k, row in enumerate(states):
    observer.on(Published(k * flight.PERIOD_NS, row))
    published = k + 1
    time.sleep(0.01)
"""


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_after_kill_9_a_file_opens_as_far_as_it_was_written(tmp_path):
    path = tmp_path / "killed.rrd"
    recorder = flight.child(RECORDER, path)
    try:
        written = [int(recorder.stdout.readline().split()[1]) for _ in range(4)][-1]
        os.kill(recorder.pid, signal.SIGKILL)
        written = max([written, *(int(line.split()[1]) for line in recorder.stdout if line.endswith("\n"))])
    finally:
        recorder.kill()
        recorder.wait()
        recorder.stdout.close()
    times = flight.drawn(path)
    assert times == [k * flight.PERIOD_NS for k in range(len(times))]
    assert len(times) >= written > 0
    assert WRITE_S <= 5.0
    # Without an index; Rerun's own program gives it one.
    assert not flight.verified(path)
