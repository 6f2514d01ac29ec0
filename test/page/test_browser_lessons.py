# SPDX-License-Identifier: MIT
"""Lessons in the browser, played right and wrong, by mouse, finger and keys, for a class and on paper."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lesson_hands import PHONE, PLAYED, WHERE, WINDOW, Taught, by_buttons
from page_browser import Opened, page_address
from page_tools import SOURCE, TESTS, packages, run_node

from rigid_proto_ros.page.file import write_page
from rigid_proto_ros.scene.lessons import lesson, lessons

pytestmark = pytest.mark.drawn
NAMES = [one.name for one in lessons()]


def test_a_lesson_asks_first_stands_until_it_is_answered_and_says_at_once_what_is_right(browser: Any) -> None:
    page = Taught(browser, "t_handle")
    assert page.js("page.clock.paused") and page.page.locator("#lesson h2").inner_text() == page.lesson.question
    assert page.page.locator("#lesson li").count() == 0, "no steps before the answer"
    page.page.locator("#play").click()
    page.page.keyboard.press("Space")
    page.page.locator("#step").click()
    page.drawn(5)
    assert page.now["timeNs"] == 0 and "Answer first" in page.page.locator("#say").inner_text()
    assert page.covered() == []
    page.page.locator(".choice").nth(0).click()
    page.page.wait_for_function("page.motion.snapshot().timeNs > 1e8")
    assert f"No, it is B: {page.lesson.choices[1]}" in page.text and page.lesson.reason in page.text
    page.pause()
    assert page.covered() == []
    page.fly(8.0)
    assert page.done == 1 and "Step 1 of 3 is done" in page.page.locator("#told").inner_text()
    assert page.page.locator("#lesson li.done").count() == 1
    page.close()


def test_the_start_page_asks_nothing_and_the_picker_leads_from_lesson_to_lesson_and_out(browser: Any) -> None:
    page = Opened(browser)
    assert page.page.locator("#lesson").count() == 0 and not page.js("page.clock.paused")
    page.page.locator("button[data-card=lessons]").click()
    assert page.page.locator(".lessons a").count() == len(lessons())
    page.page.get_by_role("link", name=lesson("teapot").title).click()
    page.page.wait_for_selector("#lesson .choice")
    assert page.js("location.hash") == "#lesson=teapot" and page.js("page.motion.body().name") == "teapot"
    page.page.get_by_label("Lesson", exact=True).select_option("book")
    page.page.wait_for_function("page.motion.body().name === 'book'")
    page.page.locator("button[data-card=body]").click()
    page.page.get_by_role("button", name="hammer", exact=True).click()
    page.page.wait_for_function("page.motion.body().name === 'hammer'")
    assert page.page.locator("#lesson").count() == 0, "a lesson is about its own body"
    page.js("location.hash = '#lesson=book'")
    page.page.wait_for_selector("#lesson .choice")
    page.page.get_by_role("button", name="leave the lesson").click()
    page.page.wait_for_function("!document.getElementById('lesson')")
    page.page.locator("#play").click()
    page.page.wait_for_function("page.motion.snapshot().timeNs > 1e8")
    page.page.goto(f"{page_address()}#lesson=nothing")
    page.page.wait_for_function("document.querySelector('#say')?.textContent.includes('no lesson nothing')")
    page.close()


def others(first: str) -> list[Any]:
    """All lessons; but for this one they are under stress."""
    return [pytest.param(name, marks=() if name == first else pytest.mark.stress) for name in NAMES]


@pytest.mark.parametrize("name", others("teapot"))
def test_a_lesson_is_played_with_the_mouse(browser: Any, name: str, tmp_path: Path) -> None:
    page = Taught(browser, name, **WHERE["window"])
    page.drawn(3)
    assert page.unseen() == []
    page.answer()
    page.again()
    PLAYED.get(name, by_buttons)(page)
    assert page.unseen() == []
    page.look(tmp_path / f"{name}.png")
    page.close()


@pytest.mark.stress
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("where", ["class", "phone"])
def test_a_lesson_is_played_before_a_class_and_on_a_phone(browser: Any, where: str, name: str, tmp_path: Path) -> None:
    page = Taught(browser, name, **WHERE[where])
    page.drawn(3)
    assert page.unseen() == []
    page.answer()
    page.again()
    # There a card that is typed into covers the lesson.
    ({**PLAYED, "spinning_top": by_buttons}).get(name, by_buttons)(page)
    page.look(tmp_path / f"{name}.png")
    page.close()


@pytest.mark.parametrize("name", others("t_handle"))
def test_a_whole_lesson_is_done_by_keys_alone_and_the_focus_is_always_seen(browser: Any, name: str) -> None:
    page = Taught(browser, name, **WHERE["keys"])
    page.answer()
    page.again()
    PLAYED.get(name, by_buttons)(page)
    page.close()


LARGE = "Math.min(page.picture.free.width, page.picture.free.height) / 480"
"""How large the picture is, of that of a window."""

ELSEWHERE = """([x, y]) => {
  if (!document.elementFromPoint(x, y)?.closest("#stage")) return false;
  const { motion, lessons, picture: { eye } } = page, info = motion.body(), { origin, direction } = eye.ray(x, y), hit = motion.firstHit(origin, direction);
  if (!hit) return false; // beside the body it would be watched, which may be the step
  const whole = 2 * info.length, R = motion.snapshot().body.rotation;
  const near = (lessons.lesson.plan.marks ?? []).some((name) => name in info.contacts && Math.hypot(...info.contacts[name].map((c, k) => (c - hit.mesh[k]) * info.scale[k])) < 0.14 * whole);
  const n = [0, 1, 2].map((k) => R[k] * hit.normal[0] + R[3 + k] * hit.normal[1] + R[6 + k] * hit.normal[2]), p = hit.body;
  const lever = Math.hypot(p[1] * n[2] - p[2] * n[1], p[2] * n[0] - p[0] * n[2], p[0] * n[1] - p[1] * n[0]) / whole;
  return !near && lever > 0.1;
}"""
"""Whether a place on the screen is none that a step may name."""


@pytest.mark.stress
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("where", ["window", "class", "phone"])
def test_no_step_of_any_lesson_is_ticked_by_pokes_elsewhere(browser: Any, where: str, name: str) -> None:
    page = Taught(browser, name, **WHERE[where])
    page.answer((page.lesson.answer + 1) % 3)
    # What is only watched may have happened before time stood.
    first = page.done
    assert first <= (1 if page.js("page.lessons.lesson.plan.steps[0].acts[0].kind") == "again" else 0)
    random, around = np.random.default_rng(sum(map(ord, name))), 90.0 * page.js(LARGE)
    pokes = 0
    for _ in range(400):
        if pokes == 10:
            break
        x, y = page.seen(page.now["body"]["row"][:3]) + around * random.standard_normal(2)
        if page.js(ELSEWHERE, [x, y]):
            pokes += 1
            page.hit(x, y)
            page.fly(0.4, False)
            if pokes % 2:
                page.again()
    assert pokes >= 8 and page.done == first
    page.close()


@pytest.fixture(scope="module")
def wrong_hands(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A script that plays all wrong hands of a lesson at the page: those that Node plays, too."""
    script = tmp_path_factory.mktemp("hands") / "hands.js"
    esbuild = packages() / "esbuild" / "bin" / "esbuild"
    run_node(esbuild, TESTS / "lesson_browser.ts", "--bundle", "--format=iife", f"--outfile={script}")
    return script.read_text("utf-8")


@pytest.mark.parametrize("name", others("t_handle"))
@pytest.mark.parametrize(
    "where",
    [pytest.param("window", marks=pytest.mark.stress), pytest.param("class", marks=pytest.mark.stress), "phone"],
)
def test_no_wrong_hand_ticks_a_step_at_the_page(browser: Any, wrong_hands: str, where: str, name: str) -> None:
    page = Taught(browser, name, **WHERE[where])
    page.js(wrong_hands)
    assert page.js("name => wrong(name)", name) == []
    page.close()


@pytest.mark.stress
def test_a_finger_plays_a_lesson_on_a_phone(browser: Any) -> None:
    page = Taught(browser, "teapot", **WHERE["phone"])
    assert page.unseen() == []
    page.page.locator(".choice").nth(2).tap()
    page.pause()
    page.again()
    x, y = page.place("spout", (-0.008, 0.0, -0.006))
    page.page.touchscreen.tap(x, y)
    page.fly(0.3)
    assert page.done == 1 and page.covered() == []
    for shape in ((390, 844), (844, 390)):
        page.page.set_viewport_size({"width": shape[0], "height": shape[1]})
        page.drawn(4)
        assert page.covered() == []
    page.close()


LETTERS = """() => {
  const found = [];
  const walk = document.createTreeWalker(document.getElementById("app"), NodeFilter.SHOW_TEXT);
  for (let node = walk.nextNode(); node; node = walk.nextNode()) {
    const { parentElement: at } = node, box = at.getBoundingClientRect();
    if (!node.textContent.trim() || !at.checkVisibility({ visibilityProperty: true }) || box.width < 2 || at.closest(".out, option")) continue;
    found.push([parseFloat(getComputedStyle(at).fontSize), node.textContent.trim()]);
  }
  return found;
}"""


def test_for_a_class_words_are_28_px_high_and_nothing_else_is_to_be_read(browser: Any) -> None:
    page = Taught(browser, "true_or_box_tensor", **WHERE["class"])
    for answered in (False, True):
        if answered:
            page.answer()
            page.fly(2.5)
            page.drawn(4)
        found = page.js(LETTERS)
        assert [said for height, said in found if height < 28.0] == []
        for panel in ("#hand", "#tensor", "#energy", "#angle"):
            assert not page.page.locator(panel).is_visible()
        assert (
            page.page.locator("#class-plots canvas").is_visible()
            and page.page.get_by_label("Lesson", exact=True).is_visible()
        )
        assert page.covered() == []
    assert page.done == 1
    page.page.get_by_role("button", name="class mode").click()
    page.drawn()
    assert page.js("location.hash") == "#lesson=true_or_box_tensor" and page.page.locator("#hand").is_visible()
    page.close()


def test_a_lesson_is_printed_on_one_page_with_its_picture_question_and_steps(browser: Any) -> None:
    page = Taught(browser, "plumb_line")
    for landscape in (False, True):
        printed = page.page.pdf(format="A4", landscape=landscape)
        assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 1
        assert len(printed) > 30_000, "with its picture"
    page.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.page.emulate_media(media="print")
    sheet = page.page.locator("#sheet")
    assert sheet.inner_text().startswith(page.lesson.title) and all(
        step in sheet.inner_text() for step in page.lesson.sentences
    )
    assert page.js(
        "[...document.querySelectorAll('#app > *')].filter(node => node.checkVisibility()).map(node => node.id)"
    ) == ["sheet"]
    page.close()


AXE = """() => axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"] })
  .then(({ violations }) => violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target).join(", ")}`))"""
CARDS = ("lessons", "body", "world", "ghost", "tensor", "measure", "plots", "keep")


@pytest.mark.parametrize("cards", [(), pytest.param(CARDS, marks=pytest.mark.stress)], ids=["few", "all"])
def test_start_page_cards_lesson_class_and_phone_meet_wcag_aa(browser: Any, cards: tuple[str, ...]) -> None:
    tool = SOURCE / "node_modules" / "axe-core" / "axe.min.js"
    if not tool.is_file():
        pytest.skip("axe-core isn't installed")
    rules = tool.read_text("utf-8")

    def check(page: Opened) -> None:
        page.drawn()
        assert page.js(AXE) == []

    page = Opened(browser)
    page.pause()
    page.js(rules)
    check(page)
    for card in cards:
        page.page.locator(f"button[data-card={card}]").click()
        check(page)
        page.page.locator(f"button[data-card={card}]").click()
    page.js("location.hash = '#lesson=t_handle'")
    page.page.wait_for_selector("#lesson .choice")
    check(page)
    page.page.locator(".choice").nth(0).click()
    page.pause()
    check(page)
    page.page.get_by_role("button", name="class mode").click()
    check(page)
    page.page.set_viewport_size({"width": PHONE[0], "height": PHONE[1]})
    page.page.get_by_role("button", name="class mode").click()
    check(page)
    page.close()


CUT = """() => [...document.querySelectorAll("#app button, #app h2, #app p, #app li, #app label, #tensor, #time, .card")].filter((node) => {
  const box = node.getBoundingClientRect();
  if (!node.checkVisibility() || box.width < 3 || node.closest(".out, .chips, #side, #hand")) return false;
  return box.right > innerWidth + 1 || box.bottom > innerHeight + 1 || box.left < -1 || box.top < -1 || node.scrollWidth > node.clientWidth + 3;
}).map((node) => node.id || node.textContent)"""


@pytest.mark.parametrize("size", [WINDOW, pytest.param((780, 1688), marks=pytest.mark.stress)])
def test_with_letters_twice_as_large_nothing_is_cut_or_covered(browser: Any, size: tuple[int, int]) -> None:
    page = Opened(browser, size)
    tools = page.context.new_cdp_session(page.page)
    tools.send("Page.enable")
    tools.send("Page.setFontSizes", {"fontSizes": {"standard": 32, "fixed": 26}})
    page.js("location.hash = '#lesson=teapot'")
    page.page.wait_for_selector("#lesson .choice")
    page.drawn(5)
    assert page.js("getComputedStyle(document.documentElement).fontSize") == "32px"
    assert page.covered() == [] and page.js(CUT) == []
    page.page.locator(".choice").nth(0).click()
    page.pause()
    assert page.covered() == [] and page.js(CUT) == []
    page.close()


KEPT = """async () => [
  localStorage.length, sessionStorage.length, document.cookie, (await indexedDB.databases()).length, self.caches ? (await caches.keys()).length : 0,
]"""
"""What a browser keeps for a page, of all kinds."""


def test_a_file_that_was_written_for_a_lesson_opens_in_it_and_two_of_them_share_nothing(
    browser: Any, tmp_path: Path
) -> None:
    file = tmp_path / "lesson.html"
    write_page(file, begins="lesson=hammer")
    pages = [Opened(browser, address=file.as_uri())]
    pages.append(pages[0].beside())
    for page in pages:
        page.page.wait_for_selector("#lesson .choice")
        assert page.js("page.motion.body().name") == "hammer" and page.js("page.lessons.hidesCentre")
    one, other = pages
    one.page.bring_to_front()
    one.page.locator(".choice").nth(0).click()
    one.pause()
    one.js("page.motion.set({ mass: 3 }); page.motion.submit({ at: 'head', impulse: [1, 0, 0] })")
    one.page.locator("button[data-card=body]").click()
    one.fly(0.1)
    other.page.bring_to_front()
    other.drawn(5)
    assert one.value("mass") == 3 and len(one.script) == 2 and one.now["timeNs"] > 0
    assert other.value("mass") != 3 and other.script == [] and other.now["timeNs"] == 0
    assert other.page.locator("#lesson .choice").count() == 3, "nobody has answered here"
    for page in pages:
        assert page.js(KEPT) == [0, 0, "", 0, 0]
    one.page.reload()
    one.page.wait_for_selector("#lesson .choice")
    assert one.value("mass") != 3 and one.script == [], "nor does it share anything with what it was"
    one.close()
