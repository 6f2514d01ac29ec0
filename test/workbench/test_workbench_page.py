# SPDX-License-Identifier: MIT
"""The interactive page in a real browser: what hands do to the picture is what the node receives.

One node, one page server and one browser for all tests; each begins with the teapot at rest at the world's origin,
whatever scene the one before it, which may have failed, has left.
"""

from __future__ import annotations

import os
import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from conftest import held_domain
from ros_process import READY_S, RosProcess, descendants, running_node
from workbench_page import CHROMIUM, FLAGS, NO_CHROMIUM, SAID_S, Bench, Ear, Page, bare_page

from rigid_proto_ros.scene.offline import read_scene
from rigid_proto_ros.scene.scene_file import read_scene_text
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.workbench.link import decode, encode
from rigid_proto_ros.workbench.save_as_script import kept_scene
from rigid_proto_ros.workbench.side_by_side import START

viser = pytest.importorskip("viser", reason="viser is not installed: no interactive page")
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: no browser to drive")
pytestmark = [pytest.mark.drawn, pytest.mark.skipif(CHROMIUM is None, reason=NO_CHROMIUM)]

UNIT = 0.5
"""[m] The picture's unit for the teapot, which is 0.32 m across."""


@pytest.fixture(scope="module")
def bench(ros_environment, tmp_path_factory) -> Iterator[Bench]:
    from rigid_proto_ros.rerun_view.ports import any_free_port

    with held_domain() as domain:
        environment = {**ros_environment, "ROS_DOMAIN_ID": str(domain)}
        # The browser and the client start while it does.
        bench = Bench(environment, tmp_path_factory.mktemp("bench"), any_free_port(), "teapot", wait=False)
        bench.environment = environment
        yield bench
        status = bench.process.end()
    assert status == 0, bench.process.errors


@pytest.fixture(scope="module")
def browser(bench) -> Iterator:
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def ear(bench) -> Iterator[Ear]:
    ear = Ear(bench.environment, wait=bench.wait)
    ear.until(lambda: ear.heard("pose", last=1), "a state")
    yield ear
    ear.close()


LINKED = "- {t: 0.25, at: {point: [0.1, 0.0, 0.05]}, force: [0.0, 0.5, 0.0]}\n"


@pytest.fixture(scope="module")
def linked_page(bench, browser, ear) -> Page:
    """The page, opened with a link to a teapot under light gravity that is poked after a quarter of a second."""
    link = encode(kept_scene(read_scene("teapot", {"gravity": [0.0, 0.0, -1.0]})), LINKED)
    return Page(browser, f"{bench.address}/?{link}")


@pytest.fixture(scope="module")
def shared_page(linked_page, ear) -> Page:
    ear.event("poke")
    assert ear.set_named({"gravity": [0.0, 0.0, 0.0]})[0][0]
    linked_page.scene = ear.until_scene(lambda values: values["gravity"] == [0.0, 0.0, 0.0])
    return linked_page


def restore_scene(page: Page, ear: Ear) -> None:
    """The scene of the beginning again, if a test has left another one."""
    values = ear.values()
    changed = {name: value for name, value in page.scene.items() if values.get(name) != value}
    if changed:
        assert ear.set_named(changed, atomically=True)[0][0]
        ear.until_scene(lambda values: all(values.get(name) == value for name, value in changed.items()))


@pytest.fixture
def page(shared_page, ear) -> Page:
    """The page with the body at rest at the origin, in the middle of the picture, and the Play tab open."""
    ear.trigger("string/release")
    restore_scene(shared_page, ear)
    shared_page.tab("Play")
    put_at_rest(shared_page, ear)
    return shared_page


def put_at_rest(page: Page, ear: Ear) -> None:
    """Reset, and wait until the page shows it."""
    ear.trigger("reset")

    def as_reset() -> bool:
        # One that moved before is shown at rest, or the page shows a time that isn't there yet.
        time_s, energy = page.readout
        return energy == 0.0 and time_s <= ear.now_ns() * 1e-9

    page.until(as_reset, "the body at rest")
    page.drawn()


def teapot():
    return read_scene("teapot", {}).setup


def seen_point(page: Page, x: float, y: float) -> np.ndarray:
    """The mesh point (3,) that a pixel shows while the teapot rests at the origin: geometry alone, nothing of the page."""
    setup = teapot()
    origin, direction = page.ray(x, y)
    hit, _ = setup.surface.ray_hit(setup.body.mesh_point(UNIT * origin), direction / setup.body.scale)
    return hit


def test_a_link_opens_the_situation_that_it_holds(linked_page, ear) -> None:
    poke = ear.event("poke")
    assert poke["time_ns"] == 250_000_000
    assert poke["content"]["frame_id"] == "world@point/0.1,0.0,0.05"
    assert poke["content"]["force"] == [0.0, 0.5, 0.0]
    assert ear.values()["gravity"] == [0.0, 0.0, -1.0]


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

    def targets() -> list:
        return [event["content"]["point"] for event in ear.events()[before:] if event["kind"] == "string_target"]

    # A still hand goes on holding: six times in the second after which the string would let go.
    ear.until(lambda: len(held := targets()) > 6 and held[-1] == held[-7], "a hand that holds still")
    page.release()
    ear.event("string_release", before)
    position = ear.heard("pose", last=1)[0]["pose"]["position"]
    moved = np.array([position[k] for k in "xyz"])
    left = page.ray(x - 90.0, y)[1] - page.ray(x, y)[1]
    assert moved @ left / np.linalg.norm(left) > 0.02
    time.sleep(0.3)
    tail = [event["kind"] for event in ear.events()[before:]]
    assert tail[-1] == "string_release"


@pytest.mark.stress
def test_a_finger_taps_to_poke_and_drags_to_pull(page, ear) -> None:
    before = len(ear.events())
    x, y = page.middle
    seen = seen_point(page, x, y)
    page.touch("touchStart", (x, y))
    page.touch("touchEnd")
    frame, _, point = ear.event("poke", before)["content"]["frame_id"].partition("point/")
    size = float(np.linalg.norm(teapot().surface.extent))
    assert frame == "world@" and np.linalg.norm(np.array(point.split(","), float) - seen) <= 0.01 * size
    put_at_rest(page, ear)
    before = len(ear.events())
    page.touch("touchStart", (x, y))
    for k in (1, 2, 3):
        page.touch("touchMove", (x - 30.0 * k, y))
        time.sleep(SAID_S)
    ear.event("string_attach", before)
    ear.event("string_target", before)
    page.touch("touchEnd")
    ear.event("string_release", before)


@pytest.mark.stress
def test_two_pages_have_one_string_and_closing_one_lets_go_of_what_it_holds(page, ear, bench) -> None:
    def kinds(since: int) -> set[str]:
        return {event["kind"] for event in ear.events()[since:] if event["kind"].startswith("string")}

    before = len(ear.events())
    with bare_page(bench.port) as other:
        ear.until(lambda: listeners(ear)["pose"] == 2, "one page server that listens, for all its pages")
        other.send(drag_message("start", (0.0, 0.0, 0.1), (0.0, 0.0, 0.1)))
        ear.event("string_target", before)
        # It is the other page's string: a drag here moves nothing of it, and its end doesn't let go.
        page.drag(*page.middle, -60.0, 0.0, steps=2)
        page.release()
        other.send(drag_message("update", (0.0, 0.0, 0.1), (0.0, 0.0, 0.5)))
        pulled = [0.0, 0.0, 0.5 * UNIT]
        last = ear.until(
            lambda: (p := last_target(ear)) and np.allclose(p, pulled, atol=1e-6) and p, "the other's hand"
        )
        assert last[2] == pytest.approx(0.5 * UNIT)
        assert kinds(before) == {"string_attach", "string_target"}
    ear.event("string_release", before)
    put_at_rest(page, ear)
    before = len(ear.events())
    page.click(*page.middle)
    ear.event("poke", before)


def last_target(ear: Ear) -> list[float] | None:
    targets = [event["content"]["point"] for event in ear.events() if event["kind"] == "string_target"]
    return targets[-1] if targets else None


@pytest.mark.stress
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
    page.write("Mass ×", "2")
    assert ear.until_value("mass", lambda m: m > 0.0) == pytest.approx(2.0 * mass)
    page.write("Size ×", "1.25")
    assert ear.until_value("scale", lambda s: s[0] != 1.0) == pytest.approx([1.25] * 3)
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
    page.until(lambda: "Simulating: bounding box." in page.text, "the table of both tensors")
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
    assert page.page.get_by_role("button", name="Use this tensor", exact=True).is_disabled()
    page.input("Tensor").fill("0.002 0 0 0.003 0 0.004")
    page.until(lambda: "✓ principal moments 0.002, 0.003, 0.004" in page.text, "a valid tensor")
    page.button("Use this tensor")
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
    assert page.page.get_by_text("1 × 1 × 1 m").count() == 1
    page.button("Simulate its hull")
    assert ear.until_value("mesh", lambda mesh: mesh.endswith("open_box.obj"))
    ear.set_named({"mesh": "teapot", "mesh_fallback": ""}, atomically=True)
    folder = bench.process._out.parent
    page.until(lambda: not list(folder.glob("rigid_proto_upload_*/*")), "a folder without uploads")


@pytest.mark.stress
def test_a_rewind_branches_and_the_old_future_stays_as_a_ghost(page, ear) -> None:
    before = len(ear.events())
    page.click(*page.middle)
    poke = ear.event("poke", before)
    ear.until(lambda: ear.now_ns() > poke["time_ns"] + 700_000_000, "a flight of 0.7 s")
    page.tab("Session")
    page.write("Seconds back", "0.5")
    page.until(lambda: "Looking at" in page.text, "a look back")
    reached_ns = ear.now_ns()
    page.button("Continue from here")
    reset = before + 1 + next(k for k, e in enumerate(ear.events()[before:]) if e is not None)
    ear.event("reset", reset)
    state = page.until(lambda: (p := ear.heard("pose", last=1)[0])["header"]["stamp"]["sec"] == 0 and p, "a new run")
    assert reached_ns > poke["time_ns"]
    # It goes on from where it was half a second before: it moves, away from the origin, as the poke had made it.
    start = ear.values()
    assert np.linalg.norm(start["initial.linear_velocity"]) > 0.0
    assert np.linalg.norm(start["initial.position"]) > 0.0
    assert state["pose"]["position"] != dict.fromkeys("xyz", 0.0)
    page.until(lambda: page.page.get_by_role("button", name="Remove the ghost").is_visible(), "a ghost")
    page.button("Remove the ghost")
    ear.set_named({n: [0.0] * 3 for n in ("initial.position", "initial.linear_velocity", "initial.angular_velocity")})
    ear.set_named({"initial.orientation_xyzw": [0.0, 0.0, 0.0, 1.0]})


@pytest.mark.stress
def test_what_was_done_by_hand_is_saved_as_scene_and_script_and_as_a_link(page, ear, bench) -> None:
    before = len(ear.events())
    page.click(*page.middle)
    poke = ear.event("poke", before)
    page.tab("Session")
    downloads = []
    page.page.on("download", lambda download: downloads.append(download))
    page.button("Save scene and script")
    page.until(lambda: len(downloads) == 2 or page.page.wait_for_timeout(50), "two files")
    files = {Path(d.suggested_filename).name: Path(d.path()).read_text("utf-8") for d in downloads}
    assert "mesh: teapot" in files["scene.yaml"].replace('"', "")
    commands = parse_script(files["script.yaml"])
    (command,) = [command for command in commands if command.kind == "poke"]
    assert command.t_ns == poke["time_ns"]
    assert command.frame_id == poke["content"]["frame_id"] and list(command.force) == poke["content"]["force"]
    # The link holds the same.
    page.button("Make a link")
    made = page.page.locator("input[value*='/?']").first
    link = page.until(lambda: made.count() and made.input_value(), "a link")
    assert link.startswith(f"{bench.address}/?")
    scene, script = decode(link.partition("?")[2])
    assert parse_script(script) == commands
    assert read_scene_text(scene).values == read_scene_text(files["scene.yaml"]).values


def drag_message(phase: str, start: tuple, end: tuple) -> bytes:
    """What a browser sends of a drag on the body, in the picture's units."""
    import msgspec.msgpack

    message = {"type": "SceneNodeDragMessage", "phase": phase, "name": "/body/mesh", "instance_index": None}
    places = {
        "start_position": start,
        "start_screen_pos": (0.5, 0.5),
        "end_position": end,
        "end_screen_pos": (0.5, 0.5),
    }
    return msgspec.msgpack.encode({**message, **places, "button": "left", "modifier": None, "owner": ""})


def test_one_click_shows_a_lesson_with_body_and_ghost_and_the_angle_between_them(page, ear) -> None:
    page.button(START)
    ear.until_value("ghost.inertia_model", lambda model: model == "bounding_box")
    page.until(lambda: re.search(r"[1-9]\d*° apart", page.text), "the angle between body and ghost")
    restore_scene(page, ear)
    assert read_scene("teapot", {}).parameters.mesh == ear.values()["mesh"]


def test_a_killed_node_is_said_on_the_page_which_goes_on_with_the_next_one(page, bench) -> None:
    node = bench.children()["node"]
    os.kill(bench.process.pid, signal.SIGSTOP)  # until the page was read, the command starts no other one
    try:
        os.kill(node, signal.SIGKILL)
        page.until(
            lambda: "has ended or doesn't respond" in page.text and "Start it again" in page.text,
            "word of the node's end",
        )
        assert "is simulating" not in page.text and "is sleeping" not in page.text
    finally:
        os.kill(bench.process.pid, signal.SIGCONT)
    page.until(lambda: "is sleeping" in page.text and "has ended" not in page.text, "another node on the same page")


STATE_TOPICS = ("pose", "twist", "events", "scene")


def listeners(ear: Ear) -> dict[str, int]:
    """How many subscriptions each topic of the node has, as DDS discovery knows them."""
    ends = {topic: ear.do("endpoints", topic=ear.name(topic)) for topic in STATE_TOPICS}
    return {topic: sum(side == "sub" for side, *_ in found) for topic, found in ends.items()}


WITH_A_PAGE = {"pose": 2, "twist": 1, "events": 2, "scene": 2}
"""Listeners while a page is open, this test among them."""


@pytest.mark.stress
def test_a_page_of_its_own_shows_a_node_of_another_name_that_runs_already(ros_environment, tmp_path) -> None:
    from rigid_proto_ros.rerun_view.ports import any_free_port

    def workbench(node: str, log: str, port: int) -> RosProcess:
        arguments = ("workbench", "--node", node, "--port", port, "--no-browser")
        return RosProcess("rigid_proto", *arguments, environment=environment, log=tmp_path / log)

    with held_domain() as domain:
        environment, port = {**ros_environment, "ROS_DOMAIN_ID": str(domain)}, any_free_port()
        remapped = ("--ros-args", "-r", "__node:=brick", "-r", "__ns:=/lab", "-p", "mesh:=book")
        with running_node(*remapped, environment=environment, log=tmp_path / "node"):
            ear = Ear(environment, "/lab/brick")
            missing = workbench("/lab/brik", "missing", any_free_port())
            second = workbench("lab/brick", "second", port)
            second.wait_for("The workbench is at")
            with bare_page(port) as page:
                ear.until(lambda: listeners(ear)["twist"] == 1, "a page that listens to the node")

                def pulled() -> bool:
                    # A server that has drawn nothing yet lets nothing be grabbed.
                    page.send(drag_message("start", (0.0, 0.0, 0.1), (0.0, 0.0, 0.1)))
                    return any(event["kind"] == "string_target" for event in ear.events())

                ear.until(pulled, "a string")
            ear.event("string_release")
            commands = [Path(f"/proc/{pid}/cmdline").read_bytes() for pid in descendants(second.process.pid)]
            assert len(commands) == 1 and b"workbench.main" in commands[0]
            assert second.end() == 0
            assert missing.process.wait(READY_S) == 2
            assert (
                missing.errors.count("\n") == 1 and "'/lab/brik'" in missing.errors and "(/lab/brick)" in missing.errors
            )
            # The node isn't theirs: it flies on.
            ear.now_ns()
            ear.close()


@pytest.mark.stress
def test_wheel_and_pinch_bring_the_view_nearer_and_a_click_still_pokes_where_it_points(page, ear) -> None:
    x, y = page.middle[0] + 30.0, page.middle[1]
    setup = teapot()
    size = float(np.linalg.norm(setup.surface.extent))
    start, direction = page.ray(x, y)

    def nearness() -> float:
        """Of the camera: its distance from the middle against that of before, from where a click is seen to poke."""
        put_at_rest(page, ear)
        before = len(ear.events())
        page.click(x, y)
        frame, _, text = ear.event("poke", before)["content"]["frame_id"].partition("point/")
        assert frame == "world@"
        point = np.array(text.split(","), float)
        seen = (point * setup.body.scale - setup.body.center_of_mass) / UNIT
        (factor, _), *_ = np.linalg.lstsq(np.stack([start, direction], axis=1), seen, rcond=None)
        hit, _ = setup.surface.ray_hit(setup.body.mesh_point(UNIT * factor * start), direction / setup.body.scale)
        assert np.linalg.norm(hit - point) <= 0.01 * size
        assert not [event for event in ear.events()[before:] if event["kind"].startswith("string")]
        return factor

    assert nearness() == pytest.approx(1.0, abs=0.02)
    page.wheel(3)
    page.until(lambda: nearness() < 0.9, "a nearer view")
    by_wheel = nearness()
    page.pinch(120.0, 220.0)
    page.until(lambda: nearness() < 0.9 * by_wheel, "a view that is nearer still")


@pytest.mark.stress
def test_with_the_page_closed_the_node_has_the_subscribers_that_it_had_before(page, ear) -> None:
    assert listeners(ear) == WITH_A_PAGE
    page.page.goto("about:blank")
    without = {"pose": 1, "twist": 0, "events": 1, "scene": 1}
    ear.until(lambda: listeners(ear) == without, "a node that only this test listens to")


def test_a_killed_page_server_in_mid_drag_lets_the_string_go_by_its_timeout(ear, bench) -> None:
    bench.wait()
    ear.trigger("reset")
    before, killed = len(ear.events()), bench.children()["page"]
    with bare_page(bench.port) as page:

        def pulled() -> bool:
            # A server that has drawn nothing yet lets nothing be grabbed.
            page.send(drag_message("start", (0.0, 0.0, 0.1), (0.0, 0.0, 0.1)))
            page.send(drag_message("update", (0.0, 0.0, 0.1), (0.2, 0.0, 0.1)))
            return any(event["kind"] == "string_target" for event in ear.events()[before:])

        ear.until(pulled, "a string")
        ear.until(lambda: ear.heard("pose", last=1)[0]["pose"]["position"]["x"] > 1e-3, "a body that it pulls")
        os.kill(killed, signal.SIGKILL)
        # Nobody releases it; a body on a string is drawn back and forth, a loose one flies straight.
        ear.until(lambda: flies_straight(ear), "a body that the string has let go")
    assert "string_release" not in [event["kind"] for event in ear.events()[before:]]
    # The command starts another page server.
    ear.until(lambda: bench.children().get("page", killed) != killed, "another page server")


def flies_straight(ear: Ear) -> bool:
    """Whether the COM moves evenly over the last states."""
    states = ear.heard("pose", last=40)
    points = np.array([[s["pose"]["position"][k] for k in "xyz"] for s in states])
    return len(points) == 40 and float(np.abs(np.diff(points[::13], 2, axis=0)).max()) < 1e-12
