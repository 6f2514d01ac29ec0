# SPDX-License-Identifier: MIT
"""The page of a running body: what it shows is what flies, what it does flies, and it costs nothing while nobody looks."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

pytest.importorskip("websockets", reason="websockets is not installed: no page of a node")

from live_rig import Page, beside, until

TEST = Path(__file__).resolve().parents[1]


def test_a_picture_is_the_flight_itself_with_its_loads_and_string() -> None:
    with beside({"start_paused": True}) as flown, Page(flown.page.address) as page:
        assert page.do(entry={"string": {"attach": [0.0, 0.0, 0.0], "target": [0.0, 0.0, 0.3]}}) is None
        assert page.do(entry={"wrench": {"at": "com", "force": [0.0, 0.1, 0.0]}}) is None
        page.until(lambda: page.picture and len(page.loads) == 1, "picture with a load")
        flight = page.flight
        assert flight.tied and flight.now_ns == 0
        memory = flown.live.call(lambda: flown.live.loop.simulation.memory)
        assert page.picture[16:] == memory
        assert page.told["time"] == {"paused": True, "rate": 1.0, "failure": ""}
        assert page.do(time="step") is None
        page.until(lambda: page.flight.now_ns == 10_000_000, "picture after the step")
        assert page.do(time="reset") is None
        page.until(lambda: page.flight.now_ns == 0 and not page.flight.tied, "picture after the reset")
        assert {"reset": True} in page.all


def test_what_a_hand_sets_and_does_is_told_to_all_and_refusals_to_it_alone() -> None:
    with beside() as flown, Page(flown.page.address) as hand, Page(flown.page.address) as other:
        for page in (hand, other):
            page.until(lambda page=page: page.pictures, "picture")
        assert hand.do(entry={"set": {"mass": 0.25, "ballast.nut": [0.1, 0.0, 0.0, 0.0]}}) is None
        assert hand.do(entry={"at": {"point": [0.0, 0.0, 0.0]}, "impulse": [0.0, 0.0, 0.01]}) is None
        refusal = hand.do(entry={"set": {"mass": -1.0}})
        assert "mass: got -1.0" in str(refusal)
        other.until(lambda: other.told["scene"]["values"]["mass"] == 0.25, "other's mass")
        assert other.told["scene"]["values"]["ballast.nut"] == [0.1, 0.0, 0.0, 0.0]
        done = other.until(lambda: [e for told in other.all for e in told.get("done", []) if "impulse" in e], "impulse")
        assert (
            done[0]["at"] == {"point": [0.0, 0.0, 0.0]} and done[0]["impulse"] == [0.0, 0.0, 0.01] and done[0]["t"] > 0
        )
        assert not any("refusal" in told for told in other.all)
        # What others than pages do is seen, too.
        flown.live.set_parameters({"gravity": [0.0, 0.0, -1.62]})
        flown.live.pause(True)
        hand.until(
            lambda: hand.told["scene"]["values"]["gravity"] == [0.0, 0.0, -1.62] and hand.told["time"]["paused"],
            "gravity",
        )


def test_another_body_begins_with_its_scene_and_a_ghost_flies_beside() -> None:
    with beside() as flown, Page(flown.page.address) as page:
        assert (
            page.do(
                begin={
                    "mesh": "hammer",
                    "ghost.inertia_model": "bounding_box",
                    "initial.angular_velocity": [0.1, 5.0, 0.1],
                }
            )
            is None
        )
        page.until(lambda: page.told.get("scene", {}).get("values", {}).get("mesh") == "hammer", "hammer")
        assert page.do(time="reset") is None
        page.until(lambda: page.picture and np.frombuffer(page.picture, np.uint32, 4)[2] == 1, "ghost")
        size = (len(page.picture) - 16) // 2
        assert np.frombuffer(page.picture[16 + size :], np.int64, 1)[0] == page.flight.now_ns
        assert flown.live.scenario.parameters.record == ""


def test_a_mesh_of_ones_own_is_told_once_and_without_its_folder(tmp_path) -> None:
    own = tmp_path / "own.obj"
    own.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    with beside({"mesh": str(own)}) as flown:
        with Page(flown.page.address) as page:
            page.until(lambda: page.pictures, "picture")
            assert page.told["mesh"]["name"] == page.told["scene"]["values"]["mesh"] == "own.obj"
            assert page.do(entry={"set": {"mass": 2.0}}) is None
            page.until(lambda: page.told["scene"]["values"]["mass"] == 2.0, "mass")
            assert sum("mesh" in told for told in page.all) == 1
            assert str(tmp_path) not in str(page.all)
        with Page(flown.page.address) as later:
            later.until(lambda: "mesh" in later.told and later.pictures, "mesh for who comes later")


def test_nothing_is_asked_for_or_sent_while_nobody_looks() -> None:
    with beside() as flown:
        simulation, asked = flown.live.loop.simulation, []
        kind = type(simulation)
        original = kind.memory
        kind.memory = property(lambda self: asked.append(1) or original.fget(self))
        try:
            with Page(flown.page.address) as page:
                page.until(lambda: page.pictures > 2, "pictures")
                page.send({"looking": False})
                page.take(0.3)
                asked.clear()
                before = page.bytes
                flown.live.set_parameters({"mass": 0.3})
                page.take(0.7)
                assert page.bytes == before and not asked
                page.send({"looking": True})
                page.until(lambda: page.bytes > before and page.told["scene"]["values"]["mass"] == 0.3, "present scene")
            time.sleep(0.3)
            asked.clear()
            time.sleep(0.5)
            assert not asked
        finally:
            kind.memory = original


def test_the_page_ends_with_its_process_and_the_body_flies_on_released() -> None:
    with beside({"string.timeout": 0.0}) as flown, Page(flown.page.address) as page:
        assert page.do(entry={"string": {"attach": [0.0, 0.0, 0.0], "target": [0.0, 0.0, 0.3]}}) is None
        flown.child.kill()
        until(lambda: flown.string is None, "release of the string")
        until(lambda: flown.said, "line")
        assert flown.said == ["the page's process has ended, and the node goes on without it"]
        before = flown.live.state.time_ns
        assert flown.live.call(lambda: flown.live.loop.simulation.time_ns) > before


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_the_pages_process_ends_when_the_nodes_is_killed(how: signal.Signals) -> None:
    # It hears Ctrl-C also where the tests' own process ignores it.
    code = (
        "import signal, time; signal.signal(signal.SIGINT, signal.default_int_handler); from live_rig import Beside; "
        "b = Beside({'mesh': 't_handle'}); print(b.child.pid, flush=True); time.sleep(100)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TEST.parent), str(TEST), str(TEST / "page")])}
    node = subprocess.Popen(
        [sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    child = psutil.Process(int(node.stdout.readline()))
    assert child.is_running()
    node.send_signal(how)
    node.wait(20.0)
    child.wait(10.0)
