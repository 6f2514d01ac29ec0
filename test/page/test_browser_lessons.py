# SPDX-License-Identifier: MIT
"""Lessons in the browser, played right and wrong, by mouse, finger and keys, for a class and on paper."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_browser import Opened, chromium, page_address
from page_tools import SOURCE

from rigid_proto_ros.page.file import write_page
from rigid_proto_ros.scene.lessons import lesson, lessons

pytestmark = pytest.mark.drawn
WINDOW, CLASS, PHONE = (1280, 720), (1920, 1080), (390, 844)

FLOWN = """([seconds, until]) => {
  const { motion, lessons } = page, { lesson } = lessons, before = lesson.done;
  for (let k = 0; k < 60 * seconds && !(until && lesson.done > before); k++) {
    motion.advance(motion.snapshot().timeNs + 1e9 / 60);
    lesson.note();
    if (k % 6 === 0) { lessons.lookedMs = 0; lessons.look(motion.snapshot()); }
  }
  lessons.lookedMs = 0;
  lessons.look(motion.snapshot());
  return lesson.done;
}"""
"""On by simulated time, looked at as often as pictures would."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


class Taught(Opened):
    """A page that was opened in a lesson."""

    def __init__(self, browser: Any, name: str, more: str = "", **options: Any) -> None:
        super().__init__(browser, address=f"{page_address()}#lesson={name}{more}", **options)
        self.lesson = lesson(name)
        self.page.wait_for_selector("#lesson .choice")
        self.drawn()

    @property
    def done(self) -> int:
        return self.js("page.lessons.lesson.done")

    @property
    def text(self) -> str:
        return self.page.locator("#lesson").inner_text()

    def answer(self, choice: int | None = None) -> None:
        """Answer, and let time stand at once."""
        chosen = self.lesson.answer if choice is None else choice
        self.page.locator(".choice").nth(chosen).click()
        self.pause()

    def fly(self, seconds: float, until_done: bool = True) -> None:
        self.js(FLOWN, [seconds, until_done])
        self.drawn()

    def press(self, name: str) -> None:
        if not self.page.locator("#lesson").is_visible():  # a card stands before it on a small screen
            self.page.locator("section[data-card] .close").last.click()
            self.drawn(1)
        self.page.locator("#lesson").get_by_role("button", name=name, exact=True).click()
        self.pause()
        self.js("page.lessons.lookedMs = 0; page.lessons.look(page.motion.snapshot())")

    def again(self) -> None:
        self.page.locator("#reset").click()
        self.pause()

    def place(self, contact: str, way: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[float, float]:
        """Where a contact is on the screen [px], a little of its size off it."""
        code = """([name, way]) => {
          const { motion, picture } = page, info = motion.body(), { com, scale } = motion.snapshot().body;
          const p = name === "com" ? com.map((c, k) => c / scale[k]) : info.contacts[name];
          const seen = picture.onBody(p.map((x, k) => x + way[k]));
          picture.eye.project(seen, seen);
          return [seen.x, seen.y];
        }"""
        x, y = self.js(code, [contact, list(way)])
        return x, y


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


def poke(page: Taught, contact: str, way: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
    page.page.mouse.click(*page.place(contact, way))
    page.fly(0.3)


def teapot(page: Taught) -> None:
    """With the mouse: the belly, the handle and a poke without a new start aren't the spout."""
    for wrong in ("com", "handle"):
        poke(page, wrong)
        assert page.done == 0
        page.again()
    poke(page, "spout", (-0.008, 0.0, -0.006))
    assert page.done == 1
    poke(page, "handle")
    assert page.done == 1, "it moves already"
    for step, name in ((2, "handle"), (3, "knob"), (4, "centre of mass")):
        page.press(f"start again, and poke: {name}")
        page.fly(0.3)
        assert page.done == step


def typed(page: Taught, values: str) -> None:
    """The spin at the start, in the card of the world."""
    card = page.page.locator("section[data-card=world]")
    if not card.count():
        page.page.locator("button[data-card=world]").click()
    for axis, value in zip("xyz", values.split(), strict=True):
        field = page.page.get_by_label(f"Spin at the start {axis}, rad/s")
        field.fill(value)
        field.press("Enter")
    page.again()


def spinning_top(page: Taught) -> None:
    """Numbers typed: another spin isn't twice the spin, and the step wants the poke, too."""
    page.press("poke: stem")
    page.fly(1.0)
    assert page.done == 1
    typed(page, "1 2 3")
    page.press("poke: stem")
    page.fly(1.0)
    assert page.done == 1
    typed(page, "0 0 60")
    page.fly(2.0)
    assert page.done == 1
    page.press("poke: stem")
    page.fly(1.0)
    assert page.done == 2
    page.press("no spin")
    page.press("poke: stem")
    page.fly(3.0)
    assert page.done == 3


def plumb_line(page: Taught) -> None:
    """The line is drawn at rest only, both stay, and the centre of mass is found before it is shown."""
    hidden = "[page.picture.omega.node.visible, page.picture.momentum.node.visible, page.picture.weight.node.visible]"
    page.press("draw the line")
    assert "still swings" in page.page.locator("#say").inner_text() and page.done == 0
    page.fly(40.0, False)
    assert page.js(hidden) == [False] * 3
    page.press("draw the line")
    first = page.js("page.picture.chalk.geometry.attributes.position.count")
    assert page.done == 1 and first > 50
    page.press("tie it here")
    page.page.mouse.click(*page.place("spine", (0.01, 0.0, 0.0138)))
    page.pause()
    assert (
        np.linalg.norm(np.subtract(page.value("string.attach"), page.js("page.motion.body().contacts.corner"))) > 0.05
    )
    page.fly(60.0, False)
    page.press("draw the line")
    assert page.done == 2
    page.drawn()
    assert page.js("page.picture.chalk.geometry.attributes.position.count") > 1.5 * first, "both lines stay"
    poke(page, "corner", (-0.02, -0.03, 0.0))
    assert page.done == 2 and page.js(hidden) == [False] * 3
    page.page.locator("#stage").focus()
    page.fly(30.0, False)
    page.page.mouse.click(*where_lines_meet(page))
    page.fly(0.2)
    assert page.done == 3 and page.js("page.lessons.hidesCentre") is False
    page.drawn(3)
    assert any(page.js(hidden)), "and then it is shown"


def where_lines_meet(page: Taught) -> tuple[float, float]:
    """On the cover that is seen, or comes to be when the view is turned."""
    code = """mesh => {
      const { motion, picture: { eye } } = page, x = mesh[0], y = mesh[1], { origin, direction } = eye.ray(x, y), hit = motion.firstHit(origin, direction);
      return hit && Math.hypot(...hit.mesh.map((p, k) => p - mesh[2][k]));
    }"""
    com = [c / s for c, s in zip(page.now["body"]["com"], page.now["body"]["scale"], strict=True)]
    for _ in range(12):
        for side in (0.0138, -0.0138):
            x, y = page.place("com", (0.0, 0.0, side - com[2]))
            away = page.js(code, [x, y, [com[0], com[1], side]])
            if away is not None and away < 0.005:
                return x, y
        page.js("page.picture.eye.turn(80, 0)")
        page.drawn()
    raise AssertionError("no cover is seen")


def by_buttons(page: Taught) -> None:
    """Each step by its buttons, and by hand where these only lead to it."""
    count = len(page.lesson.sentences)
    while (step := page.done) < count:  # a slow machine has flown on before time stood
        names = page.page.locator("#lesson li.now .pill").all_inner_texts()
        for name in names:
            if name == "show me how":
                pull(page)
            elif name == "open the axes":
                turn(page)
            elif name not in ("start again", "open the card", "open ballast"):
                page.press(name)
            page.fly(12.0)
            if page.done > step:
                break
        assert page.done > step, (page.lesson.name, step, page.text)
    assert "All steps are done." in page.text
    page.drawn(3)
    assert page.covered() == []


def pull(page: Taught) -> None:
    mouse, place = page.page.mouse, page.on_body(12)
    mouse.move(place["x"], place["y"])
    mouse.down()
    for k in range(1, 5):
        mouse.move(place["x"] + 30 * k, place["y"] - 20 * k)
        page.fly(0.15, False)
    mouse.up()
    page.drawn()


def turn(page: Taught) -> None:
    """Axes by hand, until products vanish: about y, and no farther."""
    page.press("open the axes")
    assert page.js("document.activeElement.getAttribute('aria-label')") == "about x"
    best, at = 1.0, 0
    slider = page.page.get_by_label("about y")
    for angle in range(-90, 91):
        slider.evaluate(
            "(input, value) => { input.value = value; input.dispatchEvent(new Event('input')); }", str(angle)
        )
        part = page.js("document.querySelector('section[data-card=tensor] p:not(.note)').textContent")
        found = re.search(r"([\d.]+) %", part)
        value = float(found.group(1)) / 100.0 if found else 0.0
        if value < best:
            best, at = value, angle
    slider.evaluate("(input, value) => { input.value = value; input.dispatchEvent(new Event('input')); }", str(at))
    page.drawn()


PLAYED = {"teapot": teapot, "spinning_top": spinning_top, "plumb_line": plumb_line}


BY_BUTTONS = {**PLAYED, "spinning_top": by_buttons}
"""Where a card that is typed into covers the lesson."""


def check_lesson(browser: Any, name: str, shots: Path | None = None) -> None:
    page = Taught(browser, name)
    page.drawn(3)
    assert page.covered() == []
    if shots is not None:
        page.look(shots / f"{name}_asked.png")
    page.answer()
    page.again()
    PLAYED.get(name, by_buttons)(page)
    if shots is not None:
        page.look(shots / f"{name}_done.png")
    page.close()


def test_a_lesson_is_played_with_the_mouse(browser: Any) -> None:
    check_lesson(browser, "teapot")


@pytest.mark.stress
@pytest.mark.parametrize("name", [one.name for one in lessons()])
@pytest.mark.parametrize("where", ["class", "phone"])
def test_a_lesson_is_played_before_a_class_and_on_a_phone(browser: Any, where: str, name: str, tmp_path: Path) -> None:
    before_class = where == "class"
    page = Taught(
        browser, name, "&class" if before_class else "", size=CLASS if before_class else PHONE, touch=not before_class
    )
    page.answer()
    page.again()
    BY_BUTTONS.get(name, by_buttons)(page)
    page.look(tmp_path / f"{name}.png")
    page.close()


@pytest.mark.stress
@pytest.mark.parametrize("name", [one.name for one in lessons()])
def test_every_lesson_is_played_in_the_browser(browser: Any, name: str, tmp_path: Path) -> None:
    check_lesson(browser, name, tmp_path)


ELSEWHERE = """([x, y]) => {
  const { motion, lessons, picture: { eye } } = page, info = motion.body(), { origin, direction } = eye.ray(x, y), hit = motion.firstHit(origin, direction);
  if (!hit) return false; // beside the body it would be watched, which may be the step
  const whole = 2 * info.length, R = motion.snapshot().body.rotation;
  const near = (lessons.lesson.course.marks ?? []).some((name) => name in info.contacts && Math.hypot(...info.contacts[name].map((c, k) => (c - hit.mesh[k]) * info.scale[k])) < 0.14 * whole);
  const n = [0, 1, 2].map((k) => R[k] * hit.normal[0] + R[3 + k] * hit.normal[1] + R[6 + k] * hit.normal[2]), p = hit.body;
  const lever = Math.hypot(p[1] * n[2] - p[2] * n[1], p[2] * n[0] - p[0] * n[2], p[0] * n[1] - p[1] * n[0]) / whole;
  return !near && lever > 0.1;
}"""
"""Whether a place on the screen is none that a step may name."""


@pytest.mark.stress
@pytest.mark.parametrize("name", [one.name for one in lessons()])
def test_no_step_of_any_lesson_is_ticked_by_pokes_elsewhere(browser: Any, name: str) -> None:
    page = Taught(browser, name)
    page.answer((page.lesson.answer + 1) % 3)
    # What is only watched may have happened before time stood.
    first = page.done
    assert first <= (1 if page.js("page.lessons.lesson.course.steps[0].acts[0].kind") == "again" else 0)
    random = np.random.default_rng(sum(map(ord, name)))
    pokes = 0
    for _ in range(400):
        if pokes == 10:
            break
        x, y = page.seen(page.now["body"]["row"][:3]) + 90.0 * random.standard_normal(2)
        if page.js(ELSEWHERE, [x, y]):
            pokes += 1
            page.page.mouse.click(x, y)
            page.fly(0.4, False)
            if pokes % 2:
                page.again()
    assert pokes >= 8 and page.done == first
    page.close()


FOCUS = """() => {
  const node = document.activeElement, style = getComputedStyle(node), after = getComputedStyle(node, "::after");
  if (node === document.body) return ["", true];
  const seen = (style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2) || (node.id === "stage" && after.content !== "none");
  return [node.id || node.dataset.key || node.getAttribute("aria-label") || node.textContent, seen];
}"""


def test_a_whole_lesson_is_done_by_keys_alone_and_the_focus_is_always_seen(browser: Any) -> None:
    page = Taught(browser, "teapot", reduced_motion="reduce")
    keys, been = page.page.keyboard, []

    def tab_to(wanted: str) -> None:
        for _ in range(400):
            keys.press("Tab")
            name, seen = page.js(FOCUS)
            assert seen, f"the focus isn't seen on {name}"
            been.append(name)
            if name == wanted:
                return
        raise AssertionError(f"{wanted} isn't reached: {been}")

    tab_to("choice2")
    keys.press("Enter")
    page.pause()
    page.again()
    for step in range(4):
        tab_to("act0")
        keys.press("Enter")
        page.pause()
        page.fly(0.3)
        assert page.done == step + 1
    # And the picture: aim, and poke there.
    tab_to("stage")
    pokes = len(page.script)
    for key in ("ArrowLeft", "ArrowUp", "Enter"):
        keys.press(key)
    page.drawn()
    assert len(page.script) == pokes + 1
    assert "stage" in been and page.page.locator("#lesson .end").is_visible()
    page.close()


@pytest.mark.stress
def test_a_finger_plays_a_lesson_on_a_phone(browser: Any) -> None:
    page = Taught(browser, "teapot", size=PHONE, touch=True)
    assert page.covered() == []
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
    page = Taught(browser, "true_or_box_tensor", "&class", size=CLASS)
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


@pytest.mark.stress
def test_a_file_that_was_written_for_a_lesson_opens_in_it_and_two_of_them_share_nothing(
    browser: Any, tmp_path: Path
) -> None:
    file = tmp_path / "lesson.html"
    write_page(file, begins="lesson=hammer")
    page = Opened(browser, address=file.as_uri())
    page.page.wait_for_selector("#lesson .choice")
    assert page.js("page.motion.body().name") == "hammer" and page.js("page.lessons.hidesCentre")
    page.page.locator(".choice").nth(0).click()
    other = page.context.new_page()
    other.goto(file.as_uri())
    other.wait_for_selector("#lesson .choice")
    assert page.js("[localStorage.length, sessionStorage.length, document.cookie]") == [0, 0, ""]
    page.close()
