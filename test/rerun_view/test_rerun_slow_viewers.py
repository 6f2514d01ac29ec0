# SPDX-License-Identifier: MIT
"""What viewers can't do to a run: slow it down, keep it from ending, let its memory grow; and what late ones still see."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest
import rerun_flight as flight
from rerun.chunk import RrdReader

from rigid_proto_ros.picture import style
from rigid_proto_ros.rerun_view import live_view, viewers
from rigid_proto_ros.rerun_view.backend import SIM_TIME
from rigid_proto_ros.rerun_view.observer import FileRecorder
from rigid_proto_ros.simulation.observer import BodyChanged, Published, Reset, Started

RUN_WITH_A_STOPPED_VIEWER = """
import sys, time
import rerun_flight as flight
from rigid_proto_ros.simulation.observer import BodyChanged, Published, Reset, Started
states = flight.rows(200)
observer = flight.live_view()
observer.on(Started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256))
observer.on(BodyChanged(0, flight.SETUP))
observer.on(Published(0, states[0]))
print(observer.live_address, flush=True)
sys.stdin.readline()
k = 1
while k < 200:
    observer.on(Published(k * flight.PERIOD_NS, states[k]))
    observer.on(BodyChanged(k * flight.PERIOD_NS, flight.SETUP))
    if k == 150:
        # Thousands of messages are more than the server keeps back for a viewer; how many, the library decides.
        while not observer._stream.behind:
            observer.on(BodyChanged(k * flight.PERIOD_NS, flight.SETUP))
            time.sleep(0.01)
    k += 1
behind = observer._stream.behind
observer.close()
print("behind" if behind else "never behind", k, repr(observer.error), flush=True)
"""


def test_a_viewer_that_no_longer_reads_holds_up_neither_the_run_nor_its_end(tmp_path):
    run = flight.child(RUN_WITH_A_STOPPED_VIEWER)
    watcher = None
    try:
        address = run.stdout.readline().strip()
        saved = tmp_path / "seen.rrd"
        watcher = viewers.ViewerProcess("--connect", address, "--save", str(saved))
        flight.wait_for(lambda: saved.exists() and saved.stat().st_size > 10_000)
        watcher.process.send_signal(signal.SIGSTOP)
        # Nothing but a stopped viewer could hold it up for so long, however busy the machine is.
        said, _ = run.communicate("go\n", timeout=4.0 * flight.WAIT_S)
        assert said.splitlines()[-1] == "behind 200 ''"
        assert run.returncode == 0
    finally:
        run.kill()
        run.wait()
        if watcher is not None:
            watcher.process.kill()
            watcher.process.wait()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="counts threads as Linux shows them")
@pytest.mark.parametrize("kind", ["file", "live"])
def test_resets_and_bodies_of_every_size_leave_no_threads_behind(kind, tmp_path):
    def one_more_run() -> None:
        observer.on(Reset())
        for k, row in enumerate(flight.rows(4)):
            observer.on(BodyChanged(k, flight.setup_of(scale=flight.SCALE * 10.0 ** (k % 2))))
            observer.on(Published(k * flight.PERIOD_NS, row))
        flight.flush(observer)

    observer = FileRecorder(str(tmp_path / "session.rrd")) if kind == "file" else flight.live_view()
    try:
        observer.on(Started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256))
        observer.on(BodyChanged(0, flight.SETUP))
        for _ in range(3):
            one_more_run()
        before = _threads_of_this_process()
        for _ in range(6):
            one_more_run()
        # A run that has just ended may still be leaving.
        flight.wait_for(lambda: one_more_run() or _threads_of_this_process() <= before + 2)
    finally:
        observer.close()


def _threads_of_this_process() -> int:
    return len(os.listdir("/proc/self/task"))


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_a_viewer_that_comes_after_the_oldest_was_dropped_still_sees_the_whole_body(tmp_path, monkeypatch):
    monkeypatch.setattr(live_view, "LIVE_MEMORY_LIMIT", "4MB")
    observer = flight.live_view()
    saved = tmp_path / "seen.rrd"
    watcher = None
    try:
        observer.on(Started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256))
        observer.on(BodyChanged(0, flight.SETUP))
        states = flight.rows(1000)
        for k in range(40_000):
            observer.on(Published(k * 1_000_000, states[k % 1000]))
            if k % 2000 == 1999:
                # Or viewers would be spared most of it, and nothing would have to be dropped.
                flight.flush(observer)
        watcher = viewers.ViewerProcess("--connect", observer.live_address, "--save", str(saved))
        shapes = {
            *(style.BODY_MESH, style.INERTIA_BOX, style.INERTIA_ELLIPSOID),
            *(style.BOUNDING_BOX, style.POINSOT_ELLIPSOID),
        }

        def complete() -> dict[str, list[int]]:
            """What was saved, once it has all parts; of one that moves its place is temporal, and shows it alone."""
            found = _entities(saved)
            return found if all(max(found.get(name, [-1])) >= 0 for name in {style.BODY, *shapes}) else {}

        # The file grows: one reading of it is enough.
        assert min(flight.wait_for(complete)[style.BODY]) > 0, "nothing was dropped, so nothing is shown"
    finally:
        if watcher is not None:
            watcher.stop()
        observer.close()


def _entities(path: Path) -> dict[str, list[int]]:
    """Per entity the simulated times [ns] of a recording that may still be growing; −1 for what holds at all times."""
    found: dict[str, list[int]] = {}
    if not path.exists():
        return found
    try:
        for chunk in RrdReader(path).stream():
            batch = chunk.to_record_batch()
            times = found.setdefault(str(chunk.entity_path).lstrip("/"), [])
            if SIM_TIME in batch.schema.names:
                times += [int(t.value) for t in batch.column(SIM_TIME)]
            else:
                times.append(-1)
    except Exception:
        # Cut where the viewer has got to.
        pass
    return found
