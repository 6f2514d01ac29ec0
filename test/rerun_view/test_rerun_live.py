# SPDX-License-Identifier: MIT
"""Viewers on this machine come, go and die without the flight noticing."""

from __future__ import annotations

import os
import socket
import sys
import urllib.request
from pathlib import Path

import pytest
import rerun_flight as flight
from rerun_flight import wait_for

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.base.ports import PORTS_TRIED
from rigid_proto_ros.picture import style
from rigid_proto_ros.rerun_view import ports, viewers
from rigid_proto_ros.rerun_view.backend import SIM_TIME
from rigid_proto_ros.rerun_view.layout import TITLES
from rigid_proto_ros.rerun_view.live_view import LiveView
from rigid_proto_ros.rerun_view.observer import FileRecorder
from rigid_proto_ros.rerun_view.snapshot import DRIVERS, headless_viewer, show
from rigid_proto_ros.simulation.observer import (
    BodyChanged,
    GhostChanged,
    GhostPublished,
    MeshChanged,
    Published,
    Reset,
)

pytestmark = pytest.mark.drawn

MACHINE_TARGETS = ("egui_wgpu", "re_renderer::context", "re_perf_telemetry", "wgpu", "winit")
"""Parts of the viewer whose warnings are about the machine, such as drawing without a graphics card."""


def complaints(client) -> list[str]:
    """What the viewer finds wrong with the recording: reports of the views shown at present, warnings it logged."""
    reports = [
        f"{view.name}: {report.severity}: {report.summary}"
        for view in client.get_state().views
        for report in view.reports
    ]
    logged = [
        entry.message
        for entry in client.get_logs()
        if entry.level in ("WARN", "ERROR") and not entry.target.startswith(MACHINE_TARGETS)
    ]
    return reports + logged


@pytest.fixture(scope="module")
def viewer():
    try:
        with headless_viewer(1200, 800) as client:
            yield client
    except InputError as error:
        if DRIVERS in str(error):
            pytest.skip(str(error))
        raise


def answers(address: str, port: int) -> bool:
    """Whether somebody listens there."""
    with socket.socket() as other:
        return other.connect_ex((address, port)) == 0


def test_a_taken_default_port_moves_on_and_a_taken_asked_one_is_refused():
    with socket.create_server((ports.LOOPBACK, 0)) as taken:
        port = taken.getsockname()[1]
        assert ports.serve_on_port("rerun_port", None, port, lambda served: served) > port
        with pytest.raises(InputError, match="rerun_port"):
            ports.serve_on_port("rerun_port", port, 1, lambda served: served)
        with pytest.raises(InputError, match="web_port"):
            LiveView("web", web_port=port)


def test_who_loses_the_race_for_a_port_serves_on_the_next_one_on_loopback_only_and_prints_that(monkeypatch):
    lines = []
    # As if other processes had come just after the look.
    monkeypatch.setattr(ports, "is_free", lambda _: True)
    with socket.create_server((ports.LOOPBACK, 0)) as one, socket.create_server((ports.LOOPBACK, 0)) as two:
        taken = {"rerun_port": one.getsockname()[1], "web_port": two.getsockname()[1]}
        for field, port in taken.items():
            with pytest.raises(InputError, match=field):
                LiveView("web", **{field: port})
            monkeypatch.setattr(f"rigid_proto_ros.rerun_view.live_view.DEFAULT_{field.upper()}", port)
        observer = LiveView("web", report=lines.append)
        try:
            addresses = [observer.live_address, observer.web_address]
            served = [int(address.split(":")[2].split("/")[0]) for address in addresses]
            for port, asked in zip(served, taken.values(), strict=True):
                assert asked < port < asked + PORTS_TRIED
            assert b"html" in wait_for(lambda: _page(observer.web_address)).lower()
            pids = (os.getpid(), observer._process.process.pid)
            assert wait_for(lambda: all(ports.listens(pid, at) for pid, at in zip(pids, served, strict=True)))
            assert all(any(address in line for line in lines) for address in addresses)
            # At another address of the same machine nobody listens.
            assert not any(answers("127.0.0.2", at) for at in served)
        finally:
            observer.close()
        wait_for(lambda: not answers(ports.LOOPBACK, served[1]))


def _page(address: str) -> bytes:
    try:
        with urllib.request.urlopen(address, timeout=5) as answer:
            return answer.read()
    except OSError:
        return b""


WATCHED_RUN = """
import time
from rigid_proto_ros.rerun_view.live_view import LiveView
observer = LiveView("web", report=lambda _: None)
print(observer._process.process.pid, flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux ends a child with its parent")
def test_a_killed_run_leaves_no_viewer_behind():
    run = flight.child(WATCHED_RUN)
    try:
        viewer_pid = int(run.stdout.readline())
        assert _is_running(viewer_pid)
    finally:
        run.kill()
        run.wait()
        run.stdout.close()
    wait_for(lambda: not _is_running(viewer_pid))


def _is_running(pid: int) -> bool:
    """Neither gone nor a zombie that nobody has collected."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_missing_viewer_or_display_is_a_warning_and_the_run_goes_on(monkeypatch):
    monkeypatch.setattr(viewers, "viewer_program", lambda: None)
    for mode, display, said in (("web", True, "no viewer"), ("native", True, "no viewer"), ("native", False, "")):
        monkeypatch.setattr(viewers, "has_display", lambda display=display: display)
        lines = []
        observer = LiveView(mode, report=lines.append)
        flight.fly(observer, flight.rows(10))
        observer.close()
        # Without --connect the program would pour the stream back into the server that it reads it from.
        assert (said or f": rerun --connect {observer.live_address}") in lines[-1]
        assert observer.error == ""


def test_a_viewer_that_comes_late_sees_the_run_and_the_next_one_without_errors(viewer):
    observer = flight.live_view()
    flight.fly(observer, flight.rows(80))
    viewer.open(observer.live_address)

    def shown() -> list[int]:
        recordings = viewer.get_state().recordings
        return [t.end for r in recordings for t in r.timelines if t.name == SIM_TIME]

    wait_for(lambda: 79 * flight.PERIOD_NS in shown())
    observer.on(Reset())
    for k, row in enumerate(flight.rows(40)):
        observer.on(Published(k * flight.PERIOD_NS, row))
    wait_for(lambda: 39 * flight.PERIOD_NS in shown())
    viewer.take_screenshot()
    assert complaints(viewer) == []
    observer.close()


def test_recordings_opened_in_one_viewer_have_their_own_layouts_without_errors(tmp_path, viewer):
    shown = []
    for name, ghost in (("first", True), ("second", False)):
        path = tmp_path / f"{name}.rrd"
        observer = FileRecorder(str(path))
        flight.fly(observer, flight.rows(80))
        observer.on(MeshChanged(780_000_000, 0.5 * flight.VERTICES, flight.TRIANGLES, "ab" * 32))
        observer.on(BodyChanged(780_000_000, flight.SETUP))
        if ghost:
            observer.on(GhostChanged(780_000_000, flight.SETUP))
            observer.on(Published(800_000_000, flight.rows(81)[80]))
            observer.on(GhostPublished(800_000_000, flight.rows(80)[79]))
        observer.close()
        show(viewer, path)
        for at_s in (0.0, 0.35, 0.79):
            viewer.set_time(SIM_TIME, duration=at_s, play_state="paused")
            viewer.take_screenshot()
            assert complaints(viewer) == []
        shown.append({view.name for view in viewer.get_state().views})
    assert [TITLES[style.GHOST_ANGLE] in names for names in shown] == [True, False]
