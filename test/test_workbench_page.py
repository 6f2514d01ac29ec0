# SPDX-License-Identifier: MIT
"""The interactive page in a real browser: what hands do to the picture is what the node receives.

One node, one page server and one browser for all tests; each begins with the teapot at rest at the world's origin.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from conftest import held_domain
from ros_process import RosProcess, descendants
from workbench_page import CHROMIUM, FLAGS, Bench, Ear, Page

from rigid_proto_ros.offline import read_scene

viser = pytest.importorskip("viser", reason="viser is not installed: no interactive page")
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: no browser to drive")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on the PATH: no browser to drive")

UNIT = 0.5
"""[m] The picture's unit for the teapot, which is 0.32 m across."""


@pytest.fixture(scope="module")
def bench(ros_environment, tmp_path_factory) -> Iterator[Bench]:
    from rigid_proto_ros.rerun_view.ports import any_free_port

    with held_domain() as domain:
        environment = {**ros_environment, "ROS_DOMAIN_ID": str(domain)}
        bench = Bench(environment, tmp_path_factory.mktemp("bench"), any_free_port(), "teapot")
        bench.environment = environment
        yield bench
        status = bench.process.end()
    assert status == 0, bench.process.errors


@pytest.fixture(scope="module")
def ear(bench) -> Iterator[Ear]:
    ear = Ear(bench.environment)
    ear.until(lambda: ear.heard("pose", last=1), "a state")
    yield ear
    ear.close()


@pytest.fixture(scope="module")
def browser() -> Iterator:
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def shared_page(bench, ear, browser) -> Page:
    return Page(browser, bench.address)


@pytest.fixture
def page(shared_page, ear) -> Page:
    """The page with the body at rest at the origin, in the middle of the picture, and the Play tab open."""
    ear.trigger("reset")
    ear.trigger("string/release")
    shared_page.tab("Play")
    time.sleep(0.3)
    return shared_page


def teapot():
    return read_scene("teapot", {}).setup


def seen_point(page: Page, x: float, y: float) -> np.ndarray:
    """The mesh point (3,) that a pixel shows while the teapot rests at the origin: geometry alone, nothing of the page."""
    setup = teapot()
    origin, direction = page.ray(x, y)
    hit, _ = setup.surface.ray_hit(setup.body.mesh_point(UNIT * origin), direction / setup.body.scale)
    return hit


def test_a_click_pokes_along_the_view_at_the_point_that_was_clicked(page, ear) -> None:
    before = len(ear.events())
    x, y = page.middle[0] + 20.0, page.middle[1] - 10.0
    page.click(x, y)
    content = ear.event("poke", before)["content"]
    frame, _, point = content["frame_id"].partition("point/")
    assert frame == "world@"
    size = float(np.linalg.norm(teapot().surface.extent))
    # Measured 0.03 % of the size: half a pixel is 0.1 %.
    assert np.linalg.norm(np.array(point.split(","), float) - seen_point(page, x, y)) <= 0.01 * size
    force = np.array(content["force"])
    assert force @ page.ray(x, y)[1] == pytest.approx(np.linalg.norm(force), rel=1e-4)
    assert np.linalg.norm(force) > 0.0


def test_a_shift_click_pushes_along_the_inward_normal(page, ear) -> None:
    before = len(ear.events())
    x, y = page.middle
    page.click(x, y, "Shift")
    content = ear.event("poke", before)["content"]
    frame, _, point = content["frame_id"].partition("point/")
    assert frame == "normal@"
    size = float(np.linalg.norm(teapot().surface.extent))
    assert np.linalg.norm(np.array(point.split(","), float) - seen_point(page, x, y)) <= 0.01 * size
    assert content["force"][0] > 0.0 and content["force"][1:] == [0.0, 0.0]


def test_a_drag_ties_the_string_where_it_grabbed_and_moves_the_body_that_way(page, ear) -> None:
    before = len(ear.events())
    x, y = page.middle
    grabbed = seen_point(page, x, y)
    page.drag(x, y, -90.0, 0.0)
    knot = ear.event("string_attach", before)["content"]
    size = float(np.linalg.norm(teapot().surface.extent))
    assert knot["axes"] == "mesh"
    assert np.linalg.norm(np.array(knot["point"]) - grabbed) <= 0.01 * size
    time.sleep(1.2)
    targets = [event for event in ear.events()[before:] if event["kind"] == "string_target"]
    # A still hand goes on holding: at 0.2 s, where the string would let go after a second.
    assert len(targets) > 5
    page.release()
    ear.event("string_release", before)
    position = ear.heard("pose", last=1)[0]["pose"]["position"]
    moved = np.array([position[k] for k in "xyz"])
    left = page.ray(x - 90.0, y)[1] - page.ray(x, y)[1]
    assert moved @ left / np.linalg.norm(left) > 0.02
    time.sleep(0.3)
    tail = [event["kind"] for event in ear.events()[before:]]
    assert tail[-1] == "string_release"


def test_with_the_switch_at_the_centre_of_mass_a_drag_ties_the_string_there(page, ear) -> None:
    page.choose("Pull at", "Centre of mass")
    before = len(ear.events())
    page.drag(*page.middle, -30.0, 0.0, steps=1)
    ear.event("string_target", before)
    page.release()
    ear.event("string_release", before)
    page.choose("Pull at", "Grabbed point")
    # The knot is in mesh coordinates before scaling.
    body = teapot().body
    assert ear.values()["string.attach"] == pytest.approx(body.center_of_mass / body.scale, abs=1e-9)
    assert "string_attach" not in [event["kind"] for event in ear.events()[before:]]


def test_sliders_and_fields_change_the_nodes_parameters(page, ear) -> None:
    page.tab("Body")
    mass = teapot().body.mass
    page.write("Mass ×", "0.3")  # the slider is logarithmic
    assert ear.until_value("mass", lambda m: m > 0.0) == pytest.approx(mass * 10.0**0.3)
    page.write("Size ×", "0.1")
    assert ear.until_value("scale", lambda s: s[0] != 1.0) == pytest.approx([10.0**0.1] * 3)
    page.write("Scale x y z", "1 1 2")
    assert ear.until_value("scale", lambda s: s[2] == 2.0) == [1.0, 1.0, 2.0]
    page.tab("Physics")
    page.press("Moon's")
    assert ear.until_value("gravity", lambda g: g[2] != 0.0) == [0.0, 0.0, -1.62]
    page.input("Gyroscopic term ω × Iω").uncheck(force=True)
    ear.until_value("gyroscopic", lambda on: on is False)
    # What the node refuses goes back to what is in force, with its reason.
    page.write("Step [s]", "-1")
    page.until(lambda: "Refused" in page.text and page.input("Step [s]").input_value() == "0.001", "a refusal")
    restore = {"mass": 0.0, "density": 600.0, "scale": [1.0, 1.0, 1.0], "gravity": [0.0, 0.0, 0.0], "gyroscopic": True}
    assert ear.set_named(restore, atomically=True)[0][0]
    # Set by somebody else, it is shown here.
    page.until(lambda: page.input("Gravity [m/s²]").input_value() == "0 0 0", "gravity as it is in force")


def test_a_model_swap_shows_true_and_approximate_tensor_side_by_side(page, ear) -> None:
    page.tab("Body")
    page.choose("Model", "bounding_box")
    ear.until_value("inertia_model", lambda model: model == "bounding_box")
    page.until(lambda: "bounding_box flies" in page.text, "the table of both tensors")
    row = next(line for line in page.text.splitlines() if line.startswith("Ixx"))
    _, true, approximate, error = row.split("\t")
    setup = teapot()
    assert float(true) == pytest.approx(setup.body.inertia[0, 0], rel=1e-4)
    box = read_scene("teapot", {"inertia_model": "bounding_box"}).setup.body.inertia[0, 0]
    assert float(approximate) == pytest.approx(box, rel=1e-4)
    per_cent = 100.0 * (box - setup.body.inertia[0, 0]) / np.abs(setup.body.inertia).max()
    assert float(error.removesuffix(" %")) == pytest.approx(per_cent, rel=1e-2)
    page.choose("Model", "solid")
    ear.until_value("inertia_model", lambda model: model == "solid")


def test_a_tensor_is_judged_as_it_is_typed(page, ear) -> None:
    page.tab("Body")
    page.page.get_by_text("Edit the tensor").click()
    page.input("Tensor").fill("1 0 0 1 0 5")
    page.until(lambda: "A + B >= C" in page.text, "the reason why no body has this tensor")
    assert page.page.get_by_role("button", name="Fly it", exact=True).is_disabled()
    page.input("Tensor").fill("0.002 0 0 0.003 0 0.004")
    page.until(lambda: "✓ principal moments 0.002, 0.003, 0.004" in page.text, "a valid tensor")
    page.button("Fly it")
    assert ear.until_value("explicit_inertia.tensor", lambda t: t[0] == 0.002) == [0.002, 0.0, 0.0, 0.003, 0.0, 0.004]
    ear.set_named({"inertia_model": "solid"})


def test_an_upload_shows_the_verdict_and_a_broken_one_leaves_the_body_as_it_is(page, ear, bench, tmp_path) -> None:
    page.tab("Body")
    open_box = tmp_path / "open box.obj"
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5"]  # one side is missing
    open_box.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {f}\n" for f in faces))
    broken = tmp_path / "broken.stl"
    broken.write_bytes(b"\0" * 50)
    field = page.page.locator("input[type=file]").first
    field.set_input_files(str(broken))
    page.until(lambda: "refused: " in page.text and "broken.stl" in page.text, "a verdict on the broken file")
    time.sleep(0.5)  # the browser's own progress display is done with it
    field.set_input_files(str(open_box))
    page.until(lambda: "open_box.obj" in page.text and "boundary" in page.text, "a verdict on the open box")
    assert ear.values()["mesh"] == "teapot"
    page.button("Fly its hull")
    assert ear.until_value("mesh", lambda mesh: mesh.endswith("open_box.obj"))
    ear.set_named({"mesh": "teapot", "mesh_fallback": ""}, atomically=True)
    folder = bench.process._out.parent
    page.until(lambda: not list(folder.glob("rigid_proto_upload_*/*")), "a folder without uploads")


def test_a_rewind_branches_and_the_old_future_stays_as_a_ghost(page, ear) -> None:
    before = len(ear.events())
    page.click(*page.middle)
    poke = ear.event("poke", before)
    time.sleep(1.0)
    page.tab("Session")
    page.write("Seconds back", "0.5")
    page.until(lambda: "Looking at" in page.text, "a look back")
    reached_ns = ear.now_ns()
    page.button("Go on from here")
    reset = before + 1 + next(k for k, e in enumerate(ear.events()[before:]) if e is not None)
    ear.event("reset", reset)
    state = page.until(lambda: (p := ear.heard("pose", last=1)[0])["header"]["stamp"]["sec"] == 0 and p, "a new run")
    assert reached_ns > poke["time_ns"]
    # It goes on from where it was half a second before: it moves, away from the origin, as the poke had made it.
    start = ear.values()
    assert np.linalg.norm(start["initial.linear_velocity"]) > 0.0
    assert np.linalg.norm(start["initial.position"]) > 0.0
    assert state["pose"]["position"] != dict.fromkeys("xyz", 0.0)
    page.until(lambda: page.page.get_by_role("button", name="Forget the ghost").is_visible(), "a ghost")
    page.button("Forget the ghost")
    ear.set_named({n: [0.0] * 3 for n in ("initial.position", "initial.linear_velocity", "initial.angular_velocity")})
    ear.set_named({"initial.orientation_xyzw": [0.0, 0.0, 0.0, 1.0]})


def test_what_was_done_by_hand_is_saved_as_scene_and_script(page, ear) -> None:
    before = len(ear.events())
    page.click(*page.middle)
    ear.event("poke", before)
    page.tab("Session")
    downloads = []
    page.page.on("download", lambda download: downloads.append(download))
    page.button("Save scene and script")
    page.until(lambda: len(downloads) == 2 or page.page.wait_for_timeout(50), "two files")
    files = {Path(d.suggested_filename).name: Path(d.path()).read_text("utf-8") for d in downloads}
    assert "mesh: teapot" in files["scene.yaml"].replace('"', "")
    assert "point" in files["script.yaml"] and "force" in files["script.yaml"]


CAMERA_MESSAGE = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 0.0, 0.0),
    "fov": 0.7,
    "near": 0.01,
    "far": 100.0,
    "image_height": 4,
    "image_width": 4,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}
"""What viser waits for before it calls a page open."""

STATE_TOPICS = ("pose", "twist", "events", "scene")


def listeners(ear: Ear) -> dict[str, int]:
    """How many subscriptions each topic of the node has, as DDS discovery knows them."""
    ends = {topic: ear.do("endpoints", topic=ear.name(topic)) for topic in STATE_TOPICS}
    return {topic: sum(side == "sub" for side, *_ in found) for topic, found in ends.items()}


def test_with_the_page_closed_the_node_has_the_subscribers_it_had_before_and_a_link_opens_the_same_situation(
    page, ear
) -> None:
    assert listeners(ear) == {"pose": 2, "twist": 1, "events": 2, "scene": 2}
    before = len(ear.events())
    page.click(*page.middle)
    poke = ear.event("poke", before)["content"]
    page.tab("Session")
    page.button("Make a link")
    made = page.page.locator("input[value*='/?']").first
    link = page.until(lambda: made.count() and made.input_value(), "a link")
    page.page.goto("about:blank")
    without = {"pose": 1, "twist": 0, "events": 1, "scene": 1}
    ear.until(lambda: listeners(ear) == without, "a node that only this test listens to")
    ear.set_named({"gravity": [0.0, 0.0, -1.0]})
    before = len(ear.events())
    page.page.goto(link)
    assert ear.event("poke", before)["content"]["force"] == poke["force"]
    assert ear.event("poke", before)["content"]["frame_id"] == poke["frame_id"]
    assert ear.values()["gravity"] == [0.0, 0.0, 0.0]
    page.until(lambda: "is flying" in page.text or "is sleeping" in page.text, "the page again")


@pytest.mark.stress
def test_a_page_of_its_own_shows_a_node_that_runs_already(bench, ear, tmp_path) -> None:
    """Without a browser: a socket as a page opens it."""
    import msgspec.msgpack
    from websockets.sync.client import connect

    from rigid_proto_ros.rerun_view.ports import any_free_port

    port, pages = any_free_port(), listeners(ear)["pose"]
    second = RosProcess(
        *("rigid_proto", "workbench", "--node", "rigid_body", "--port", port, "--no-browser"),
        environment=bench.environment,
        log=tmp_path / "second",
    )
    second.wait_for("The workbench is at")
    with connect(f"ws://127.0.0.1:{port}", subprotocols=[f"viser-v{viser.__version__}"], max_size=None) as page:
        page.send(msgspec.msgpack.encode(CAMERA_MESSAGE))
        ear.until(lambda: listeners(ear)["pose"] == pages + 1, "another page that listens to the node")
    commands = [Path(f"/proc/{pid}/cmdline").read_bytes() for pid in descendants(second.process.pid)]
    assert len(commands) == 1 and b"workbench.main" in commands[0]
    assert second.end() == 0
    # The node isn't its own: it flies on.
    assert bench.process.process.poll() is None
    ear.now_ns()


def test_a_killed_page_server_in_mid_drag_lets_the_string_go_by_its_timeout(page, ear, bench) -> None:
    before = len(ear.events())
    page.drag(*page.middle, -60.0, 0.0, steps=1)
    ear.event("string_target", before)
    os.kill(bench.children()["page"], signal.SIGKILL)
    # Nobody releases it; a body on a string is drawn back and forth, a loose one flies straight.
    ear.until(lambda: flies_straight(ear), "a body that the string has let go")
    assert "string_release" not in [event["kind"] for event in ear.events()[before:]]
    page.page.mouse.up()
    # The command starts another page server, and the browser finds it.
    page.until(lambda: bench.children().get("page"), "another page server")


def flies_straight(ear: Ear) -> bool:
    """Whether the COM moves evenly over the last states."""
    states = ear.heard("pose", last=40)
    points = np.array([[s["pose"]["position"][k] for k in "xyz"] for s in states])
    return len(points) == 40 and float(np.abs(np.diff(points[::13], 2, axis=0)).max()) < 1e-12
