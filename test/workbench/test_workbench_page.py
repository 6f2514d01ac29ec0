# SPDX-License-Identifier: MIT
"""The page as its user sees it, in headless Chromium: what is drawn where, and what mouse and buttons do."""

from __future__ import annotations

import asyncio
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: no interactive page")
pytest.importorskip("playwright.sync_api", reason="playwright is not installed: nothing drives a browser")

from mesh_files import CUBE_QUADS, obj
from workbench_page import (
    CHROMIUM,
    NO_CHROMIUM,
    PATIENCE_S,
    QUICK,
    Browser,
    Flown,
    chromium,
)

from rigid_proto_ros.picture import style
from rigid_proto_ros.scene.lessons import lesson

pytestmark = [pytest.mark.drawn, pytest.mark.skipif(CHROMIUM is None, reason=NO_CHROMIUM)]

SIZE = (900, 420)
NEAR = 4.0
"""[pixels] A pixel of the mouse, one of the picture, and single precision; a click beside its point is 20 away."""


@pytest.fixture(scope="module")
def browser():
    with chromium(QUICK) as started:
        yield started


@pytest.fixture(scope="module")
def opened(browser):
    flown = Flown("t_handle")
    opened = Browser(browser, flown, SIZE)
    yield opened
    opened.page.close()  # or it would look for whoever serves on this port next
    flown.end()


@pytest.fixture
def page(opened):
    """The page, with a T-handle that rests at the world's origin."""
    opened.page.set_viewport_size({"width": SIZE[0], "height": SIZE[1]})
    fly(opened, {"mesh": "t_handle"})
    return opened


def fly(page: Browser, scene) -> None:
    """Begin another scene, and wait until it is drawn."""
    flown = page.flown

    async def begin() -> None:
        await flown.page.flight.fly(scene, paused=False)
        flown.page.lessons.leave()

    asyncio.run_coroutine_threadsafe(begin(), flown.server.get_event_loop()).result(PATIENCE_S)
    shown = flown.page
    page.until(lambda: not shown._told._queue and not shown._undrawn, "another body")
    page.drawn(3)


def com_pixel(page: Browser) -> tuple[float, float]:
    flown = page.flown
    return page.pixel((flown.page.state.position - flown.page.backend.origin) / flown.page.backend.unit)


def apart(a, b) -> float:
    return math.dist(a, b)


def commands(page: Browser) -> list[dict]:
    """What was done since the last reset, as the event log has it."""
    return [json.loads(line) for _, line in page.flown.page.flight.memory.session().events]


def pages(printed: bytes) -> int:
    """Of a .pdf."""
    return len(re.findall(rb"/Type\s*/Page\b", printed))


COLOURED = """() => [...document.querySelectorAll('canvas:not([data-engine])')].map(canvas => {
  if (!canvas.width || !canvas.height) return 0;
  const seen = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let i = 0; i < seen.length; i += 4) {
    const colour = [seen[i], seen[i + 1], seen[i + 2]];
    count += seen[i + 3] > 128 && Math.max(...colour) - Math.min(...colour) > 60;
  }
  return count;
})"""
"""Of each plot on the page, how many of its pixels have a colour: curves have, axes haven't."""


def test_a_drag_draws_the_string_from_the_grabbed_point_to_the_pointer_and_the_body_follows(page) -> None:
    x, y = com_pixel(page)
    page.drag(x, y, 150.0, -90.0)
    string = page.until(lambda: page.flown.node(style.STRING), "string")
    # Each of the pointer's moves takes its time on a busy machine.
    page.until(lambda: apart(page.pixel(string.points[0, 0]), (x + 150.0, y - 90.0)) < NEAR, "string to the pointer")
    page.drawn()
    tied = page.flown.live.loop.simulation.string
    grabbed = page.flown.page.picture.string._changes[-1].arm / page.flown.page.backend.unit
    start = page.pixel(grabbed)
    assert tied is not None and apart(start, (x, y)) < NEAR, "the knot isn't where the mouse went down"

    def orange() -> int:
        picture = page.look()
        return int((picture[..., 0] - picture[..., 2] > 60).sum())

    page.until(lambda: orange() > 20, "string in the picture")
    pulled = page.until(lambda: np.linalg.norm(page.flown.live.state.position) > 0.01, "body that follows")
    moved = np.subtract(com_pixel(page), (x, y))
    assert pulled and moved @ (150.0, -90.0) > 0.0
    page.release()
    page.until(lambda: page.flown.live.loop.simulation.string is None, "release")
    page.until(lambda: page.flown.node(style.STRING) is None, "picture without the string")


def test_a_click_pokes_where_it_points_and_a_shift_click_pushes_inward(page) -> None:
    fly(page, {"mesh": "hollow_box", "poke_duration": 0.5})
    page.flown.live.pause(True)
    acting = page.flown.page.picture.loads.acting
    x, y = com_pixel(page)
    for number, (modifier, beside) in enumerate((("", 30.0), ("Shift", -30.0))):
        page.click(x + beside, y + 5.0, modifier)
        # Time goes on by single states, so that the body has hardly moved when it is looked at.
        page.until(lambda n=number: (page.flown.live.step(), len(acting) > n)[1], "poke")
        load = list(acting.values())[-1].load
        point = np.asarray(load.point) / page.flown.page.backend.unit
        assert apart(page.pixel(point), (x + beside, y + 5.0)) < NEAR
        force = np.asarray(load.force) / np.linalg.norm(load.force)
        along = (np.asarray(point) - page.client.camera.position) / np.linalg.norm(point - page.client.camera.position)
        if modifier:
            # The side that faces the camera is x+, y- or z+, square to the axes.
            assert np.abs(force).max() > 0.999 and force @ along > 0.3
        else:
            assert force @ along > 0.9999
            # The force pushes into the body, so its arrow's tip stands at the point that was clicked.
            arrow = page.until(lambda: page.flown.node(style.load_part("poke", "force")), "arrow")
            tip = np.array(arrow.points).reshape(-1, 2, 3)[0, 1]
            assert apart(page.pixel(tip), (x + beside, y + 5.0)) < NEAR
            page.drawn()
            picture = page.look()
            assert (picture[..., 0] - picture[..., 1:].max(axis=-1) > 60).sum() > 8, "nothing red in the picture"


def poked(page: Browser) -> np.ndarray:
    """Where the picture has the point that a click poked of a body at rest at its start."""
    (load,) = page.until(lambda: [c["content"] for c in commands(page) if c["kind"] == "poke"], "poke")
    point = [float(x) for x in load["frame_id"].partition("point/")[2].partition(";")[0].split(",")]
    flown = page.flown
    return (np.array(flown.live.scenario.setup.body.point(point)) - flown.page.backend.origin) / flown.page.backend.unit


@pytest.mark.stress
def test_a_finger_taps_to_poke_and_drags_to_pull(page) -> None:
    x, y = com_pixel(page)
    page.touch("touchStart", (x, y))
    page.touch("touchEnd")
    assert apart(page.pixel(poked(page)), (x, y)) < NEAR
    fly(page, {"mesh": "t_handle"})
    x, y = com_pixel(page)
    page.touch("touchStart", (x, y))
    for k in (1, 2, 3):
        page.touch("touchMove", (x - 30.0 * k, y))
    page.until(lambda: page.flown.live.loop.simulation.string is not None, "string")
    page.touch("touchEnd")
    page.until(lambda: page.flown.live.loop.simulation.string is None, "release")


@pytest.mark.stress
def test_from_nearer_by_wheel_or_pinch_a_click_pokes_where_it_points(page) -> None:
    def turn_the_wheel(x: float, y: float) -> None:
        page.page.mouse.move(x, y)
        for _ in range(3):
            page.page.mouse.wheel(0.0, -100.0)

    def pinch(x: float, y: float) -> None:
        for k in range(6):
            page.touch("touchMove" if k else "touchStart", (x - 120.0 - 20.0 * k, y), (x + 120.0 + 20.0 * k, y))
            page.drawn()  # viser takes one move of a finger a picture
        page.touch("touchEnd")

    for come_nearer in (turn_the_wheel, pinch):
        fly(page, {"mesh": "t_handle"})
        before = np.linalg.norm(page.client.camera.position)
        come_nearer(*com_pixel(page))
        page.until(lambda before=before: np.linalg.norm(page.client.camera.position) < 0.9 * before, "nearer view")
        page.drawn(5)
        x, y = com_pixel(page)
        page.click(x, y)
        assert apart(page.pixel(poked(page)), (x, y)) < NEAR


def test_the_space_bar_pauses_and_resumes_but_not_from_within_an_input(page) -> None:
    live, press = page.flown.live, page.page.keyboard.press
    page.page.evaluate("document.activeElement.blur()")
    for paused in (True, False):
        press("Space")
        page.until(lambda paused=paused: live.paused == paused, "pause or motion")
    page.tab("Forces")
    field = page.input("Initial spin [rad/s]")
    field.click()
    press("Space")
    field.blur()
    press("Space")
    page.until(lambda: live.paused, "pause")
    # The first is how the scene began.
    assert [c["content"]["data"] for c in commands(page) if c["kind"] == "pause"] == [False, True, False, True]


def test_a_drag_beside_the_body_turns_the_camera_and_touches_nothing(page) -> None:
    before, logged = np.array(page.client.camera.position), len(commands(page))
    box = page.canvas
    page.drag(box["x"] + 40.0, box["y"] + 0.8 * box["height"], 120.0, 20.0)
    page.release()
    page.until(lambda: np.linalg.norm(page.client.camera.position - before) > 0.3, "camera that turns")
    x, y = com_pixel(page)
    page.drag(x, y, 60.0, 30.0, button="right")
    page.release("right")
    page.drawn()
    assert len(commands(page)) == logged and not np.any(page.flown.live.state.position)


def test_body_string_and_controls_of_time_are_in_sight_in_windows_of_every_size(page) -> None:
    fly(page, lesson("top_on_string").path.read_text("utf-8"))
    page.flown.live.pause(True)
    page.tab("Body")
    # What is waited for, and for how long, is to be read whole, too.
    page.flown.page.flight.busy("preparing the scene")
    page.until(lambda: re.search(r"preparing the scene … [1-9]\d* s", page.text), "word of what is waited for")
    scrolled = []
    for width, height in ((1400, 800), (800, 360), (768, 1024), (390, 844)):
        page.page.set_viewport_size({"width": width, "height": height})
        page.drawn(3)
        # Also of a panel that is scrolled to its end.
        panel = page.page.locator(".mantine-ScrollArea-viewport").first
        scrolled.append(panel.evaluate("panel => { panel.scrollTop = 9999; return panel.scrollTop; }"))
        for name in ("Play", "Step", "Reset"):
            box = page.page.locator("button:visible", has_text=name).first.bounding_box()
            assert box["x"] >= 0.0 and box["x"] + box["width"] <= width, name
            assert box["y"] >= 0.0 and box["y"] + box["height"] <= height, name
        tabs = [tab.bounding_box() for tab in page.page.get_by_role("tab").all()]
        assert len({round(tab["y"]) for tab in tabs}) == 1, "tabs on two lines"
        assert max(tab["x"] + tab["width"] for tab in tabs) <= width
        box, (x, y) = page.canvas, com_pixel(page)
        assert box["width"] * box["height"] > 0.45 * width * height
        assert box["x"] < x < box["x"] + box["width"] and box["y"] < y < box["y"] + box["height"]
        # Nothing of the panel lies over the body.
        assert page.page.evaluate("([x, y]) => document.elementFromPoint(x, y).tagName", [x, y]) == "CANVAS"
        assert page.page.locator(".rp-bar").first.evaluate("bar => bar.scrollWidth - bar.clientWidth") <= 0
    page.flown.page.flight.busy("")
    assert max(scrolled) > 150.0, "no panel was too long for its window"
    # On a telephone, too, the string is seen whole.
    string = page.until(lambda: page.flown.node(style.STRING), "string")

    def seen_whole() -> bool:
        picture, ends = page.look(), page.pixel(string.points[0])
        places = np.round(np.linspace(*ends, 50)[2:-8]).astype(int)
        seen = [picture[y - 2 : y + 3, x - 2 : x + 3] for x, y in places]
        return np.mean([(patch[..., 0] - patch[..., 2]).max() > 60 for patch in seen]) > 0.95

    page.until(seen_whole, "whole string")


def test_in_dark_mode_nothing_glares_and_in_class_mode_a_lesson_and_three_buttons_are_left(page) -> None:
    page.page.set_viewport_size({"width": 1000, "height": 420})
    page.tab("Show")
    page.page.get_by_label("Dark", exact=True).first.click(force=True)

    def picture() -> np.ndarray:
        box = page.canvas
        return page.look()[: int(box["height"]), : int(box["width"])]

    page.until(lambda: picture().mean() < 90.0, "dark picture")
    seen = picture()
    assert np.percentile(seen, 95) < 110.0, "a floor that glares"
    assert seen.max() > 150, "a body that is lit"
    page.page.get_by_label("Dark", exact=True).first.click(force=True)
    page.until(lambda: picture().mean() > 180.0, "light picture")

    page.tab("Lesson")
    page.page.get_by_label("Class mode", exact=True).first.click(force=True)
    page.until(lambda: not page.page.get_by_role("tab", name="Body").is_visible(), "page without tabs")
    buttons = [b.inner_text() for b in page.page.locator(".mantine-Button-root").all() if b.is_visible()]
    assert set(buttons) == {"Pause", "Step", "Reset"}
    # On a telephone that is held across, too, they are in one line, and the state of the motion is read whole.
    page.page.set_viewport_size({"width": 844, "height": 390})
    page.drawn(3)
    places = [page.page.locator("button:visible", has_text=name).first.bounding_box()["y"] for name in buttons]
    assert len(set(map(round, places))) == 1
    assert page.page.locator(".rp-bar").first.evaluate("bar => bar.scrollWidth - bar.clientWidth") <= 0
    page.page.set_viewport_size({"width": 1000, "height": 420})
    page.page.get_by_label("Class mode", exact=True).first.click(force=True)
    page.until(lambda: page.page.get_by_role("tab", name="Body").is_visible(), "tabs again")
    # One that shows another tab when somebody else begins class mode still finds the lesson.
    page.tab("Body")
    class_mode = page.flown.page.lessons._class
    class_mode.value = True
    scale = "getComputedStyle(document.documentElement).getPropertyValue('--mantine-scale').trim()"
    page.until(lambda: page.page.evaluate(scale) == "1.25", "large letters")
    page.page.get_by_role("tab", name="Lesson").click(timeout=10_000)
    page.until(lambda: not page.page.get_by_role("tab", name="Body").is_visible(), "page without tabs")
    class_mode.value = False

    lessons, longest = page.flown.page.lessons, lesson("true_or_box_tensor")
    lessons.name(longest.name)
    asyncio.run_coroutine_threadsafe(lessons.begin(), page.flown.server.get_event_loop()).result(PATIENCE_S)
    page.until(lambda: longest.choices[2] in page.text, "answers to choose from")
    cut = "labels => Math.max(...labels.map(label => label.scrollWidth - label.clientWidth))"
    labels = page.page.locator(".mantine-Button-label")
    assert labels.evaluate_all(cut) <= 0, "an answer that isn't to be read whole"
    uncut = "labels => labels.every(label => getComputedStyle(label).overflow === 'visible')"
    assert labels.evaluate_all(uncut), "the foot of a g may be cut off"
    for across in (True, False):
        printed = page.page.pdf(format="A4", landscape=across)
        assert pages(printed) == 1, "a lesson is printed on one page"
    assert b"/ShadingType" in printed, "the lines for answers are a background, which browsers leave out unasked"


MEASURED = """() => {
  const numbers = css => [...css.match(/[0-9.]+/g).map(Number), 1].slice(0, 4);
  const over = (back, [r, g, b, a]) => [r, g, b].map((c, i) => a * c + (1 - a) * back[i]);
  const linear = c => c < 10 ? c / 3295 : ((c / 255 + 0.055) / 1.055) ** 2.4;
  const light = ([r, g, b]) => 0.05 + 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  const contrast = node => {
    const around = [];
    for (let each = node; each; each = each.parentElement) around.unshift(numbers(getComputedStyle(each).backgroundColor));
    const back = around.reduce(over, [255, 255, 255]);
    const ratio = light(over(back, numbers(getComputedStyle(node).color))) / light(back);
    return Math.max(ratio, 1 / ratio);
  };
  const seen = selector => [...document.querySelectorAll(selector)].filter(node => node.offsetParent);
  const words = seen('label[for], .mantine-Button-label, [role="tab"], [class*="mark"][class*="abel"]');
  const heights = seen('.mantine-Button-root').map(button => button.getBoundingClientRect().height);
  const thumbs = seen('[class*="slider-thumb" i]').map(thumb => thumb.getBoundingClientRect().width);
  return [Math.min(...words.map(contrast)), Math.min(...heights), Math.min(99, ...thumbs)];
}"""
"""Of what is seen: the least contrast of labels, as WCAG defines it, the least height of buttons and the least width of
sliders' thumbs [pixels]."""


def test_labels_have_a_contrast_of_4_and_a_half_the_body_of_3_and_buttons_and_sliders_are_large(page) -> None:
    x, y = map(int, com_pixel(page))
    light = 0.05 + (page.look() / 255.0) ** 2.2 @ [0.2126, 0.7152, 0.0722]
    assert light[y, x + 100 : x + 150].mean() > 3.0 * light[y - 3 : y + 4, x - 2 : x + 3].mean()  # measured 3.9
    background = "getComputedStyle(document.body).backgroundColor"
    for dark, colour in ((True, "rgb(36, 36, 36)"), (False, "rgb(255, 255, 255)")):
        page.flown.page.room.paint(dark)
        page.until(lambda colour=colour: page.page.evaluate(background) == colour, "theme")
        for tab in ("Lesson", "Body", "Forces", "Record", "Show"):
            page.tab(tab)
            contrast, height, thumb = page.page.evaluate(MEASURED)
            assert contrast > 4.5 and height >= 26.0 and thumb >= 14.0, (dark, tab, contrast, height, thumb)


def test_plots_show_their_curves_also_after_a_lesson_was_begun(page) -> None:
    page.page.set_viewport_size({"width": 700, "height": 320})
    page.tab("Plots")
    for name in ("t_handle", "dropped_term"):
        fly(page, lesson(name).path.read_text("utf-8"))
        page.until(
            lambda: sum(n > 50 for n in page.page.evaluate(COLOURED)) >= 2, f"curves of energy and spin in {name}"
        )


def test_an_open_mesh_is_refused_and_from_a_closed_one_to_an_animation_it_takes_five_actions(page, tmp_path) -> None:
    page.page.set_viewport_size({"width": 900, "height": 500})
    for name, faces in (("open.obj", CUBE_QUADS[:-1]), ("closed.obj", CUBE_QUADS)):
        (tmp_path / name).write_bytes(obj(faces=faces))
    actions = 0

    def act(do, *arguments) -> None:
        nonlocal actions
        actions += 1
        do(*arguments)

    act(page.tab, "Body")
    chooser = page.page.locator('input[type="file"]').first
    simulate = page.page.get_by_role("button", name="Simulate it", exact=True)
    chooser.set_input_files(tmp_path / "open.obj")
    page.until(lambda: "refused: " in page.text, "refusal")
    assert "successfully" not in page.text and not simulate.is_visible()
    act(chooser.set_input_files, tmp_path / "closed.obj")
    act(simulate.click)
    page.until(lambda: page.flown.live.scenario.parameters.mesh.endswith("closed.obj"), "uploaded body")
    page.until(lambda: page.flown.live.state.time_ns > 0, "motion")
    act(page.tab, "Record")
    with page.page.expect_download() as download:
        act(page.page.get_by_role("button", name="Save as glTF", exact=True).click)
    assert actions == 5
    assert Path(download.value.path()).read_bytes()[:4] == b"glTF"
