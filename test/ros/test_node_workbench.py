# SPDX-License-Identifier: MIT
"""A node with its page: what comes by topic is seen on the page and the other way round, and both end together."""

from __future__ import annotations

import json
import random
import re
import sys
from pathlib import Path

import psutil
import pytest

pytest.importorskip("websockets", reason="websockets is not installed: no page of a node")

sys.path.append(str(Path(__file__).resolve().parents[1] / "page"))

import numpy as np
from command_rig import wrench_message
from live_rig import Page, random_take, until
from page_browser import Opened, chromium
from ros_client import RosClient
from ros_process import run, running_node, start_node

from rigid_proto_ros.motion.state import State

ADDRESS = re.compile(r"the workbench is at (http://127\.0\.0\.1:\d+/live/\S+)")


@pytest.fixture(scope="module")
def beside(ros_environment, tmp_path_factory):
    """A node's process, a client of it, and its page's address."""
    values = {"viewer": "workbench", "mesh": "t_handle", "string.timeout": 0.0}
    with running_node(ros_environment, tmp_path_factory.mktemp("node") / "node", values) as node:
        node.wait_for("the workbench is at")
        with RosClient(ros_environment) as client:
            yield node, client, ADDRESS.search(node.errors)[1]
    assert "Traceback" not in node.errors


def test_a_wrench_by_topic_is_seen_on_the_page_and_parameters_go_both_ways(beside) -> None:
    _, client, address = beside
    with Page(address) as page:
        page.until(lambda: page.pictures, "picture")
        assert not page.flight.row[7:10].any()
        client.advertise("wrench")
        client.publish("wrench", wrench_message(0, "world@com;duration=0.5", (1.0, 0.0, 0.0)))
        page.until(lambda: page.flight.row[7] > 0.0, "motion under the wrench")
        assert client.set(mass=0.25)[0][0]
        page.until(lambda: page.told["scene"]["values"]["mass"] == 0.25, "mass set by ROS")
        assert page.do(entry={"set": {"mass": 0.5, "gravity": [0.0, 0.0, -1.62]}}) is None
        until(lambda: list(client.get("mass").values()) == [0.5], "mass set by the page")
        assert list(client.get("gravity").values()) == [[0.0, 0.0, -1.62]]
        # Refused by the same words as everywhere.
        assert "mass" in str(page.do(entry={"set": {"mass": -1.0}})) and list(client.get("mass").values()) == [0.5]
        assert page.do(entry={"set": {"gravity": [0.0, 0.0, 0.0]}}) is None
        client.trigger("reset")
        page.until(lambda: {"reset": True} in page.all, "reset by a service")


@pytest.mark.drawn
def test_a_drag_in_the_browser_is_a_string_on_the_page_and_on_the_nodes_topics(beside) -> None:
    _, client, address = beside
    client.trigger("reset")
    client.listen("events")
    with chromium() as browser:
        plain, faults = browser.new_page(), []
        plain.on("console", lambda said: faults.append(said.text) if said.type in ("error", "warning") else None)
        plain.on("pageerror", lambda error: faults.append(str(error)))
        plain.goto(address)
        until(lambda: plain.evaluate("Boolean(window.page?.times.first)"), "first picture", 90.0)
        assert not [fault for fault in faults if "Security" in fault or "refused" in fault.lower()], faults
        plain.close()
        # Playwright waits by evaluating text, which the page's policy forbids.
        page = Opened(browser, address=address, bypass_csp=True)
        assert page.page.locator("#live").inner_text().startswith("Nobody drives")
        assert not page.page.locator("[data-card=lessons]").is_visible()
        place = page.on_body(30)
        mouse = page.page.mouse
        mouse.move(place["x"], place["y"])
        mouse.down()
        for k in range(1, 9):
            mouse.move(place["x"] + 15 * k, place["y"] - 6 * k)
            page.drawn(1)
        # Drawn as soon as it is tied, and then as the node has it.
        assert page.now["body"]["string"] is not None
        page.page.wait_for_function("page.motion.snapshot().body.string?.tension > 0")
        string = page.now["body"]["string"]
        assert np.linalg.norm(np.subtract(string["attach"], place["mesh"])) < 1e-3
        kinds = {
            event["kind"] for event in client.until(lambda: client.events("string_attach") and client.events(), "knot")
        }
        assert {"string_attach", "string_target"} <= kinds
        assert page.page.locator("#live").inner_text().startswith("You drive")
        mouse.up()
        client.until(lambda: client.events("string_release"), "release")
        page.page.wait_for_function("page.motion.snapshot().body.string === null")
        # A poke on the first screen, and its arrow's entry.
        place = page.on_body()
        mouse.click(place["x"], place["y"])
        client.until(lambda: [e for e in client.events("poke") if "impulse" in e["content"]["frame_id"]], "poke")
        page.page.wait_for_function("page.motion.history().script.some(entry => 'impulse' in entry)")
        # A slider, the switch and time are the node's.
        page.page.get_by_label("mass, kg").fill("0,4")
        page.page.keyboard.press("Enter")
        until(lambda: list(client.get("mass").values()) == [0.4], "mass of the slider")
        page.page.get_by_role("radio", name="bounding box").click()
        until(lambda: list(client.get("inertia_model").values()) == ["bounding_box"], "model of the switch")
        page.page.wait_for_function("document.querySelector('#tensor .box').ariaChecked === 'true'")
        page.page.locator("#play").click()
        client.until(lambda: client.events("pause"), "pause")
        page.page.wait_for_function("page.clock.paused")
        client.pause(False)
        page.page.wait_for_function("!page.clock.paused")
        # Back in what it has seen, where nothing can be done, and to now.
        page.js("page.motion.goTo(page.motion.history().endNs - 5e8)")
        page.drawn()
        assert page.page.locator("#onward").inner_text() == "to now"
        assert "past" in page.js("page.motion.set({mass: 1})")
        page.page.locator("#onward").click()
        page.page.wait_for_function("page.motion.history().endNs - page.motion.snapshot().timeNs === 0")
        # Another body, and the clock begins anew.
        page.js("page.motion.openBody('hammer')")
        page.page.wait_for_function("page.motion.body().name === 'hammer'")
        until(lambda: list(client.get("mesh").values()) == ["hammer"], "mesh of the node")
        page.close()


@pytest.mark.parametrize("number", [0, *(pytest.param(k, marks=pytest.mark.stress) for k in range(1, 10))])
def test_a_take_by_hands_beside_a_node_is_flown_again_by_simulate_to_the_bit(ros_environment, tmp_path, number) -> None:
    """Hands on a page's socket, the node's own recording, and the commands that anybody types afterwards."""

    def typed(*words: object) -> str:
        done = run("rigid_proto", *words, environment=ros_environment, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        return done.stdout

    values = {"viewer": "workbench", "record": "take.mcap", "initial.angular_velocity": [0.05, 0.1, 3.0]}
    with running_node(ros_environment, tmp_path / "node", values) as node:
        node.wait_for("the workbench is at")
        with Page(ADDRESS.search(node.errors)[1]) as page:
            page.until(lambda: page.pictures, "picture")
            assert len(random_take(page, random.Random(number), 1.5)) > 10
            # To a time at which nothing was done: a state is told as it was before.
            assert page.do(time="resume") is None
            page.take(0.1)
            assert page.do(time="pause") is None
            page.until(lambda: page.told["time"]["paused"], "pause")
            page.take(0.2)
            last = State(int(page.flight.now_ns), page.flight.row.copy())
    typed("replay", "take.mcap", "--verify", "--as-scene", "again.yaml")
    words = ("simulate", "again.yaml", "--script", "again_script.yaml", "--duration", repr(last.time_ns / 1e9))
    again = json.loads(typed(*words, "--json"))
    assert again["time_ns"] == last.time_ns and again["state_hash"] == last.sha256()


def test_the_pages_process_ends_when_the_node_is_killed(ros_environment, tmp_path) -> None:
    node = start_node(ros_environment, tmp_path / "node", {"viewer": "workbench"})
    node.wait_for("the workbench is at")
    children = psutil.Process(node.pid).children()
    (page,) = [child for child in children if "rigid_proto_ros.page.watchers" in child.cmdline()]
    node.process.kill()
    page.wait(10.0)
