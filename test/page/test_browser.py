# SPDX-License-Identifier: MIT
"""What a person does on the page's first screen."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from page_browser import Opened

pytestmark = pytest.mark.drawn


def test_the_first_screen_moves_beside_its_ghost_and_asks_no_network(browser: Any) -> None:
    page = Opened(browser)
    page.page.wait_for_function("page.motion.snapshot().timeNs > 5e8")
    before = page.look()
    row = page.now["body"]["row"]
    page.page.wait_for_function("t => page.motion.snapshot().timeNs > t", arg=page.now["timeNs"] + 4e8)
    now = page.now
    assert abs(np.dot(now["body"]["row"][3:7], row[3:7])) < 0.999
    assert now["ghost"] is not None and now["angleToGhost"] > 0.0
    assert (np.abs(page.look() - before).max(axis=2) > 40).sum() > 1000
    assert page.page.locator("#angle .value").inner_text().endswith("°")
    assert [url for url in page.requests if not url.startswith(("file:", "data:"))] == []
    page.close()


def test_a_drag_ties_the_string_at_what_was_grabbed_and_lets_go(opened: Opened) -> None:
    place = opened.on_body(30)
    mouse = opened.page.mouse
    mouse.move(place["x"], place["y"])
    mouse.down()
    mouse.move(place["x"] + 40, place["y"] - 10)
    mouse.move(place["x"] + 120, place["y"] - 50)
    opened.drawn()
    string = opened.now["body"]["string"]
    size = opened.js("page.motion.body().length")
    assert string is not None
    assert np.linalg.norm(np.subtract(string["attach"], place["mesh"])) < 1e-6 * size
    # Measured 0.00 px: the hand is where the pointer is, in the plane of what was grabbed.
    assert np.linalg.norm(opened.seen(string["end"]) - (place["x"] + 120, place["y"] - 50)) < 0.5
    assert string["tension"] > 0.0
    # A link holds every place of a drag: no more digits than the eye sees.
    assert all(len(repr(x)) <= 9 for x in opened.script[-1]["string"]["target"])
    before = opened.now["body"]["row"]
    opened.fly(0.2)
    mouse.up()
    opened.drawn()
    after = opened.now["body"]
    assert after["string"] is None and opened.script[-1]["string"] == "release"
    pulled = np.subtract(after["row"][:3], before[:3])
    assert pulled @ np.subtract(string["end"], string["knot"]) > 0.0, "it is pulled towards the hand"
    assert np.linalg.norm(after["row"][7:10]) > 0.0, "and is thrown"


def test_a_poke_acts_at_once_along_the_inward_normal_with_the_strength_that_is_set(opened: Opened) -> None:
    field = opened.page.get_by_label("poke, N s")
    field.fill("0,05")
    field.press("Enter")
    place, before = opened.on_body(), opened.now
    opened.page.mouse.click(place["x"], place["y"])
    opened.drawn()
    now, mass = opened.now, opened.js("page.motion.body().massKg")
    given = mass * np.subtract(now["body"]["row"][7:10], before["body"]["row"][7:10])
    assert now["timeNs"] == before["timeNs"], "while time stands"
    assert np.allclose(given, -0.05 * np.array(place["normal"]), atol=1e-12)
    assert "0.05 N s" in opened.page.locator("#labels").inner_text()


def test_mass_and_sizes_are_set_by_slider_key_and_number_alone_or_together(opened: Opened) -> None:
    page = opened.page
    mass = opened.js("page.motion.body().massKg")
    page.get_by_role("slider", name="mass").press("ArrowRight")
    opened.drawn()
    assert opened.js("page.motion.body().massKg") > mass
    first = np.array(opened.value("scale"))
    y = page.get_by_label("size y, ×")
    y.fill("1,6")
    y.press("Enter")
    opened.drawn()
    assert np.allclose(np.array(opened.value("scale")) / first, (1.0, 1.6, 1.0))
    page.get_by_role("button", name="equal sizes").click()
    x = page.get_by_label("size x, ×")
    x.fill("1.2")
    x.press("Enter")
    opened.drawn()
    assert np.allclose(np.array(opened.value("scale")) / first, 1.2)
    x.fill("wide")
    x.press("Enter")
    assert "wide isn't a number" in page.locator("#say").inner_text()
    assert np.allclose(np.array(opened.value("scale")) / first, 1.2)
    x.fill("0")
    x.press("Enter")
    opened.drawn()
    assert "scale" in page.locator("#say").inner_text(), "a refusal is said"
    assert np.allclose(np.array(opened.value("scale")) / first, 1.2), "and nothing has changed"


def test_the_switch_changes_the_tensor_by_click_and_key(opened: Opened) -> None:
    box = opened.page.get_by_role("radio", name="bounding box")
    moments = opened.js("[...page.motion.body().moments]")
    box.click()
    opened.drawn()
    assert opened.value("inertia_model") == "bounding_box" and box.get_attribute("aria-checked") == "true"
    assert not np.allclose(opened.js("[...page.motion.body().moments]"), moments, rtol=1e-3)
    box.press("ArrowLeft")
    opened.drawn()
    assert opened.value("inertia_model") == "solid"
    assert np.allclose(opened.js("[...page.motion.body().moments]"), moments)


def test_the_ghost_is_chosen_goes_beside_the_body_and_away(opened: Opened) -> None:
    page = opened.page
    page.locator("[data-card=ghost]").click()
    assert page.get_by_role("radio", name="tensor of the bounding box").is_checked()
    page.get_by_role("radio", name="no gyroscopic term").check()
    opened.fly(1.0)
    assert opened.js("page.motion.ghost().gyroscopic") is False and opened.now["angleToGhost"] > 0.0
    page.get_by_label("beside the body").check()
    opened.drawn(30)
    assert opened.covered() == []
    card = page.locator("section[data-card=ghost]")
    assert "Jolt\t0\tkept" in card.inner_text(), "what was measured of the engines stands there"
    page.get_by_role("radio", name="as MuJoCo at 1/60 s").check()
    opened.fly(0.1)
    assert opened.js("page.motion.ghost().step") == 0.016666667
    assert "MuJoCo\t9\t+121 %" in card.inner_text()
    page.get_by_role("radio", name="another integrator or step").check()
    page.get_by_label("step", exact=True).select_option("1/60 s")
    assert opened.js("page.motion.ghost()") == {
        "inertia_model": "",
        "integrator": "euler",
        "step": 0.016666667,
        "gyroscopic": True,
    }
    page.get_by_role("radio", name="no ghost").check()
    opened.drawn()
    assert opened.now["ghost"] is None and not page.locator("#angle").is_visible()


def test_time_goes_back_on_and_starts_again(opened: Opened) -> None:
    page = opened.page
    place = opened.on_body()
    page.mouse.click(place["x"], place["y"])
    opened.fly(1.0)
    late = opened.now
    scrub = page.get_by_role("slider", name="Moment of the take")
    page.wait_for_function("document.querySelectorAll('.marks i').length === 1")
    scrub.press("Home")
    opened.drawn()
    assert opened.now["timeNs"] == 0
    scrub.press("End")
    opened.drawn()
    assert opened.now == late, "to the bit as it was"
    scrub.press("ArrowLeft")
    opened.drawn()
    assert opened.now["timeNs"] == late["timeNs"] - 1_000_000_000
    page.get_by_role("button", name="go on from here").click()
    page.wait_for_function("t => page.motion.snapshot().timeNs > t", arg=late["timeNs"])
    opened.pause()
    page.get_by_role("button", name="Step 0.01 s").click()
    page.get_by_role("button", name="Start again").click()
    page.wait_for_function("page.motion.history().script.length === 0")
    assert opened.now["timeNs"] < late["timeNs"]
    for rate in ("1", "0.5", "0.25", "0.1", "0.02"):
        page.get_by_label("How fast time goes").select_option(rate)
        assert opened.js("page.clock.rate") == float(rate)


def test_time_goes_as_fast_as_the_clock_and_slower_as_chosen(opened: Opened) -> None:
    """A picture makes up for at most 100 ms of the clock."""
    for rate, passed_ms, simulated_ns in ((1.0, 40, 40_000_000), (0.1, 40, 4_000_000), (0.02, 500, 2_000_000)):
        opened.page.get_by_label("How fast time goes").select_option(str(rate).removesuffix(".0"))
        flown = opened.js(
            """ms => {
              const { clock, motion } = page, from = motion.snapshot().timeNs;
              clock.paused = false;
              clock.advance(ms);
              clock.paused = true;
              return motion.snapshot().timeNs - from;
            }""",
            passed_ms,
        )
        assert flown == simulated_ns


def test_the_view_turns_on_the_background_and_zooms_but_not_while_a_string_is_held(opened: Opened) -> None:
    where = "page.picture.eye.camera.position.toArray()"
    mouse, before = opened.page.mouse, opened.js(where)
    free = opened.page.locator("#free").bounding_box()
    mouse.move(free["x"] + 20, free["y"] + 20)
    mouse.down()
    mouse.move(free["x"] + 80, free["y"] + 50)
    mouse.up()
    opened.drawn()
    turned = opened.js(where)
    assert np.linalg.norm(np.subtract(turned, before)) > 0.1 * np.linalg.norm(before) and opened.script == []
    place = opened.on_body(10)
    mouse.move(place["x"], place["y"])
    mouse.down()
    mouse.move(place["x"] + 100, place["y"] + 60)
    opened.drawn()
    assert np.allclose(opened.js(where), turned)
    mouse.up()
    mouse.wheel(0, 300)
    opened.drawn()
    assert np.linalg.norm(opened.js(where)) > 1.1 * np.linalg.norm(turned)


def test_the_keyboard_aims_pokes_and_pulls(opened: Opened) -> None:
    page = opened.page
    page.locator("#stage").focus()
    place = opened.on_body()
    opened.js("([x, y]) => { page.pointer.aim = [x, y]; }", [place["x"], place["y"]])
    page.keyboard.press("Enter")
    opened.drawn()
    assert opened.script[-1]["impulse"] is not None
    page.keyboard.press("g")
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    opened.drawn()
    assert opened.now["body"]["string"] is not None
    page.keyboard.press("g")
    opened.drawn()
    assert opened.now["body"]["string"] is None
    page.keyboard.press(" ")
    page.wait_for_function("!page.clock.paused")


SIZES = [
    (390, 844),
    (1280, 720),
    *(pytest.param(size, marks=pytest.mark.stress) for size in ((844, 390), (820, 1180), (1920, 1080))),
]


@pytest.mark.parametrize("size", SIZES)
def test_nothing_covers_the_body_or_an_arrows_tip_and_every_control_is_in_sight(
    browser: Any, size: tuple[int, int]
) -> None:
    page = Opened(browser, size, touch=size[0] < 1000)
    page.pause()
    for _ in range(6):
        page.fly(0.37)
        assert page.covered() == []
    for name in ("#tensor", "#hand", "#time", "#energy", "#angle"):
        box = page.page.locator(name).bounding_box()
        assert box is not None and box["x"] >= 0 and box["y"] >= 0, name
        assert box["x"] + box["width"] <= size[0] + 0.5 and box["y"] + box["height"] <= size[1] + 0.5, name
    for name in ("#play", "#reset", "#step", "#clock"):
        inner, outer = page.page.locator(name).bounding_box(), page.page.locator("#time").bounding_box()
        assert outer["x"] <= inner["x"] and inner["x"] + inner["width"] <= outer["x"] + outer["width"], name
    for card in ("body", "world", "ghost", "tensor", "measure", "plots", "keep"):
        page.page.locator(f"[data-card={card}]").first.evaluate("node => node.click()")
        page.drawn(12)
        assert page.covered() == [], card
        page.page.locator(f"section[data-card={card}] .close").click()
    page.close()


@pytest.mark.parametrize("size", [(390, 844), (844, 390)])
def test_a_finger_pulls_and_a_second_one_that_makes_it_a_pinch_takes_the_drag_back(
    browser: Any, size: tuple[int, int]
) -> None:
    page = Opened(browser, size, touch=True)
    page.pause()
    page.fly(0.5)
    place = page.on_body(5)
    x, y = place["x"], place["y"]
    page.touch("touchStart", (x, y))
    page.touch("touchMove", (x + 30, y - 10))
    page.touch("touchMove", (x + 50, y - 20))
    string = page.now["body"]["string"]
    assert np.linalg.norm(np.subtract(string["attach"], place["mesh"])) < 1e-6 * page.js("page.motion.body().length")
    page.touch("touchEnd")
    assert page.now["body"]["string"] is None and page.script[-1]["string"] == "release"
    far = page.js("page.picture.eye.camera.position.length()")
    place = page.on_body(5)
    x, y = place["x"], place["y"]
    page.touch("touchStart", (x, y))
    page.touch("touchMove", (x + 20, y))
    page.touch("touchStart", (x + 20, y), (x + 80, y + 10))
    assert page.now["body"]["string"] is None
    page.touch("touchMove", (x - 20, y), (x + 130, y + 10))
    page.touch("touchEnd")
    assert page.now["body"]["string"] is None
    assert page.js("page.picture.eye.camera.position.length()") < 0.8 * far
    page.close()


def test_a_person_who_wants_less_motion_gets_a_page_that_stands(browser: Any) -> None:
    page = Opened(browser, reduced_motion="reduce")
    page.drawn(5)
    assert page.now["timeNs"] == 0 and page.js("page.clock.paused")
    page.close()


def test_every_control_has_a_name_a_visible_focus_and_words_that_can_be_read(opened: Opened) -> None:
    """Names, and contrast of at least 4.5 as WCAG AA has it, with every card open."""
    for card in ("", "body", "world", "ghost", "tensor", "measure", "plots", "keep"):
        if card:
            opened.page.locator(f"[data-card={card}]").first.click()
            opened.drawn()
        assert opened.js(NAMELESS) == [], card
        assert opened.js(FAINT) == [], card
    opened.page.locator("#play").focus()
    opened.page.keyboard.press("Tab")
    assert opened.js("getComputedStyle(document.activeElement).outlineStyle") == "solid"


NAMELESS = """() => [...document.querySelectorAll("button, input, select, [tabindex='0']")]
  .filter(node => node.offsetParent !== null && !node.classList.contains("out"))
  .filter(node => !(node.getAttribute("aria-label") ?? node.closest("label")?.textContent ?? node.textContent).trim())
  .map(node => node.outerHTML.slice(0, 120))"""

FAINT = """() => {
  const numbers = colour => colour.match(/[\\d.]+/g).map(Number);
  const luminance = ([r, g, b]) => [r, g, b].map(c => (c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
    .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
  const behind = node => {
    for (; node; node = node.parentElement) {
      const [r, g, b, a = 1] = numbers(getComputedStyle(node).backgroundColor);
      if (a > 0) return [r, g, b].map(c => a * c + (1 - a) * 255);
    }
    return [241, 244, 249];
  };
  const found = [];
  for (const node of document.querySelectorAll("#app *")) {
    const own = [...node.childNodes].some(child => child.nodeType === 3 && child.textContent.trim());
    if (!own || !node.checkVisibility({ visibilityProperty: true }) || node.closest("#say, option")) continue;
    const ink = luminance(numbers(getComputedStyle(node).color)), paper = luminance(behind(node));
    const contrast = (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05);
    if (contrast < 4.5) found.push(`${node.textContent.trim().slice(0, 30)}: ${contrast.toFixed(2)}`);
  }
  return found;
}"""


def test_the_rate_is_held_by_drawing_less(opened: Opened) -> None:
    """Antialiasing goes first, the shadow last; told of slow pictures it draws less, of quick ones never more than failed."""
    levels = opened.js("""() => {
      const renderer = page.picture.renderer, shown = [], judge = renderer.judge.bind(renderer);
      renderer.judge = () => false;
      let now = 1e6;
      const told = (gap, count) => { for (let k = 0; k < count; k++) { now += gap; if (judge(now)) shown.push({ ...renderer.shown }); } };
      renderer.level = 0;
      renderer.failed = -1;
      renderer.adopt();
      shown.push({ ...renderer.shown });
      told(60, 200);
      const slow = shown.length;
      told(12, 3000);
      return { shown, slow };
    }""")
    shown = levels["shown"]
    assert shown[0]["smooth"] and shown[0]["shadow"]
    assert not shown[1]["smooth"] and shown[1]["shadow"]
    assert not shown[levels["slow"] - 1]["shadow"] and all(each["shadow"] for each in shown[: levels["slow"] - 2])
    assert len(shown) == levels["slow"], "what didn't hold once isn't tried again"


def test_nothing_is_drawn_while_time_stands_and_nobody_does_anything(opened: Opened) -> None:
    opened.js("page.pointer.touched()")
    count = "page.picture.renderer.gl.info.render.frame"
    opened.page.wait_for_timeout(4000)
    before = opened.js(count)
    opened.drawn(5)
    assert opened.js(count) == before
    opened.page.mouse.move(300, 300)
    opened.drawn(3)
    assert opened.js(count) > before


def test_arrows_grow_with_their_values_and_stay_in_the_picture(opened: Opened) -> None:
    place = opened.on_body(30)
    field = opened.page.get_by_label("poke, N s")
    field.fill(str(20 * opened.js("page.motion.body().massKg * page.motion.body().length")))
    field.press("Enter")
    for _ in range(3):
        opened.page.mouse.click(place["x"], place["y"])
        opened.drawn(2)
    assert opened.covered() == []
    assert math.isfinite(opened.now["body"]["kinetic"])
