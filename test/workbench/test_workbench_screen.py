# SPDX-License-Identifier: MIT
"""What a browser makes of the page: its layout on large and small screens, keys, and the outline under the pointer.

A stand-in takes the node's place, so nothing of ROS runs beside the browser. Several of these look at what viser's own page does
with means that it doesn't promise to keep: they say clearly when another version behaves otherwise.
"""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from workbench_page import CHROMIUM, FLAGS, NO_CHROMIUM, PATIENCE_S

viser = pytest.importorskip("viser", reason="viser is not installed: no interactive page")
pytest.importorskip("rclpy", reason="rclpy is not installed: no link to ROS")
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: no browser to drive")
pytestmark = [pytest.mark.drawn, pytest.mark.skipif(CHROMIUM is None, reason=NO_CHROMIUM)]

from test_workbench_without_browser import Desk, StandIn

from rigid_proto_ros.workbench import page as page_module

DESKTOP, PHONE = {"width": 1100, "height": 700}, {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def desk() -> Iterator[Desk]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page_module, "RosLink", StandIn)
        desk = Desk()
        yield desk
        desk.end()


@pytest.fixture(scope="module")
def browser_page(desk) -> Iterator:
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport=DESKTOP)
        page.set_default_timeout(PATIENCE_S * 1e3)
        page.goto(f"http://127.0.0.1:{desk.server.get_port()}")
        page.wait_for_selector("canvas")
        page.add_style_tag(content=".mantine-Notifications-root {display: none}")
        desk.fly(1.0)
        until(lambda: "ω₁ ω₂ ω₃" in page.inner_text("body"), "readouts")
        yield page
        browser.close()


def until(condition: Callable[[], object], what: str):
    deadline = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < deadline, f"no {what} within {PATIENCE_S} s (viser {viser.__version__})"
        time.sleep(0.05)
    return found


def pressed(desk: Desk, page, key: str, condition: Callable[[], object]) -> None:
    """Press a key until it has acted; the picture may not be listening yet."""
    page.keyboard.press(key)
    until(lambda: desk.do(condition), f"answer to {key!r}")


def test_the_picture_has_most_of_a_window_of_1100_pixels(browser_page) -> None:
    browser_page.set_viewport_size(DESKTOP)
    box = browser_page.locator("canvas").first.bounding_box()
    assert box["width"] >= 0.6 * DESKTOP["width"] and box["height"] == DESKTOP["height"]


def test_keys_pause_step_look_back_reset_and_are_listed(desk, browser_page) -> None:
    page, told = browser_page, desk.link.told
    count = len(told)
    pressed(desk, page, "Space", lambda: told[count:] == [("pause", True)])
    desk.page.node.paused = True
    pressed(desk, page, "ArrowRight", lambda: told[-1] == ("step", None))
    pressed(desk, page, "Space", lambda: told[-1] == ("pause", False))
    desk.page.node.paused = False
    pressed(desk, page, "r", lambda: told[-1] == ("reset", None))
    desk.fly(3.0, begin_s=1.1)
    pressed(desk, page, "Backspace", lambda: desk.page.past_view.moment_ns == 2_000_000_000)
    pressed(desk, page, "ArrowLeft", lambda: desk.page.past_view.moment_ns == 1_990_000_000)
    pressed(desk, page, "ArrowRight", lambda: desk.page.past_view.moment_ns == 2_000_000_000)
    pressed(desk, page, "n", lambda: desk.page.past_view.moment_ns is None and told[-1] == ("pause", False))
    for key in ("Shift+?", "h"):
        desk.said.clear()
        pressed(desk, page, key, lambda: any("Backspace: rewind 1 s" in text for text in desk.said))


def test_space_after_a_rewind_continues_from_there(desk, browser_page) -> None:
    page, told = browser_page, desk.link.told
    desk.fly(6.0, begin_s=5.0)
    back_ns = desk.page.history.span[1] - 1_000_000_000
    pressed(desk, page, "Backspace", lambda: desk.page.past_view.moment_ns == back_ns)
    count = len(told)
    pressed(desk, page, "Space", lambda: desk.page.past_view.moment_ns is None and told[-1] == ("pause", False))
    kinds = [kind for kind, *_ in told[count:]]
    # The state at that moment is set as the initial one, and time begins anew from it.
    assert "set" in kinds and kinds.index("set") < kinds.index("reset") and kinds[-1] == "pause", told[count:]


def test_letters_typed_into_an_input_are_no_keys(desk, browser_page) -> None:
    page, count = browser_page, len(desk.link.told)
    field = page.locator("input[type=text]").first
    field.click()
    page.keyboard.type("hr ")
    page.keyboard.press("Escape")
    field.blur()
    pressed(desk, page, "r", lambda: ("reset", None) in desk.link.told[count:])
    assert desk.link.told[count:].count(("reset", None)) == 1


def halo(page) -> np.ndarray:
    """Which pixels (height, width) of the page have the colour of viser's outline."""
    from PIL import Image

    pixels = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), dtype=int)
    return (pixels[..., :2].min(axis=2) > 200) & (pixels[..., 2] < 185)


@pytest.mark.stress
def test_the_outline_under_the_pointer_is_whole_and_ends_when_the_body_leaves(desk, browser_page) -> None:
    from scipy import ndimage

    page = browser_page
    box = page.locator("canvas").first.bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    assert not halo(page).any()
    until(lambda: page.mouse.move(x, y) or page.mouse.move(x + 2, y) or halo(page).sum() > 200, "outline")
    # One piece, not torn at the body's edges.
    pieces, _ = ndimage.label(halo(page), structure=np.ones((3, 3)))
    sizes = np.sort(np.bincount(pieces.ravel())[1:])
    assert sizes[-1] > 0.95 * sizes.sum(), sizes
    # The body goes, the pointer stays; the picture doesn't follow.
    desk.do(lambda: setattr(desk.page.view, "follows", False))
    away = np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0, *[0.0] * 6])
    desk.do(lambda: desk.link.say([(4_000_000_000, away)]))
    until(lambda: not halo(page).any(), "end of the outline")
    desk.do(lambda: setattr(desk.page.view, "follows", True))


def test_on_a_phone_the_body_is_seen_above_the_panel_and_the_readouts_are_at_its_top(browser_page) -> None:
    page = browser_page
    page.set_viewport_size(PHONE)
    readouts = page.get_by_role("button", name="panel Readouts")
    until(lambda: readouts.count() == 1, "section of readouts")

    def above() -> bool:
        canvas, sheet = page.locator("canvas").first.bounding_box(), _sheet(page)
        return sheet["y"] >= canvas["y"] + canvas["height"] - 1.0 and canvas["height"] >= 0.5 * PHONE["height"]

    until(above, "picture above the panel (has viser's bottom sheet other styles? see workbench/page_style.py)")
    assert _sheet(page)["width"] == pytest.approx(PHONE["width"], abs=1.0)
    # Reached without scrolling, and its numbers with one tap.
    until(lambda: _top(readouts) < _sheet(page)["y"] + 0.25 * PHONE["height"], "readouts at the top")
    readouts.click()
    time_row = page.get_by_text("drift of L's direction", exact=True)
    until(lambda: _top(time_row) < PHONE["height"], "numbers in sight")


@pytest.mark.parametrize("width, height", [(600, 800), (768, 1024), (600, 400), (768, 500), (950, 700)])
def test_between_telephone_and_desktop_the_picture_has_most_of_the_window_and_all_of_it_is_in_sight(
    browser_page, width, height
) -> None:
    page = browser_page
    # viser gives the panel another width where the window was a telephone's before.
    page.set_viewport_size(PHONE)
    until(lambda: _sheet(page) is not None, "viser's bottom sheet")
    page.set_viewport_size({"width": width, "height": height})
    share = 0.56 if height > width else 0.6

    def laid_out() -> bool:
        canvas = page.locator("canvas").first.bounding_box()
        panel = page.locator(".mantine-Paper-root", has=page.get_by_role("tab", name="Play")).first.bounding_box()
        if height > width:
            apart = panel["y"] >= canvas["y"] + canvas["height"] - 1.0 and canvas["width"] == width
            return apart and canvas["height"] >= share * height - 1.0
        apart = panel["x"] >= canvas["x"] + canvas["width"] - 1.0 and canvas["height"] == height
        return apart and canvas["width"] >= share * width - 1.0

    until(laid_out, "picture apart from the panel (has viser's dock other styles? see workbench/page_style.py)")
    for element in (page.get_by_role("tab", name="Play"), page.get_by_text("drift of L's direction", exact=True)):
        box = element.bounding_box()
        assert 0.0 <= box["x"] <= box["x"] + box["width"] <= width
        assert 0.0 <= box["y"] <= box["y"] + box["height"] <= height


def test_on_paper_the_whole_panel_is_below_the_picture_however_far_it_was_scrolled(browser_page) -> None:
    page = browser_page
    page.set_viewport_size(DESKTOP)
    page.emulate_media(media="print")
    cut = "[...document.querySelectorAll('.mantine-ScrollArea-viewport')].filter(e => e.scrollHeight > e.clientHeight).length"
    until(lambda: page.evaluate(cut) == 0, "panel without a part that is cut")
    canvas = page.locator("canvas").first.bounding_box()
    assert _top(page.get_by_text("Speed", exact=True).first) >= canvas["y"] + canvas["height"] - 1.0
    page.emulate_media(media="screen")
    until(lambda: page.evaluate(cut) > 0, "panel of the screen")


def _top(element) -> float:
    """Where its upper edge is; infinite while the page hasn't laid it out, also in the middle of a change."""
    box = element.bounding_box() if element.count() else None
    return box["y"] if box is not None else float("inf")


def _sheet(page) -> dict:
    return page.locator('.mantine-Paper-root[style*="position: fixed"]').first.bounding_box()
