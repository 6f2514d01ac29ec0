# SPDX-License-Identifier: MIT
"""A lesson in the browser, by mouse, finger or keys alone."""

from __future__ import annotations

import re
from typing import Any

from page_browser import Opened, page_address

from rigid_proto_ros.scene.lessons import lesson

WINDOW, CLASS, PHONE = (1280, 720), (1920, 1080), (390, 844)
WHERE: dict[str, dict[str, Any]] = {
    "window": {"size": WINDOW},
    "class": {"size": CLASS, "more": "&class"},
    "phone": {"size": PHONE, "touch": True},
    "keys": {"size": WINDOW, "keys": True, "reduced_motion": "reduce"},
}

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

FOCUS = """() => {
  const node = document.activeElement, drawn = node.matches(".picker select") ? node.nextElementSibling : node;
  const style = getComputedStyle(drawn), after = getComputedStyle(drawn, "::after");
  if (node === document.body) return ["", true];
  const seen = (style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2) || (node.id === "stage" && after.content !== "none");
  return [node.id || node.dataset.key || node.getAttribute("aria-label") || node.textContent, seen];
}"""
"""What has the focus, and whether that is seen."""

UNSEEN = """() => {
  const inside = (box, into) => box.left > into.left - 1 && box.right < into.right + 1 && box.top > into.top - 1 && box.bottom < into.bottom + 1;
  const free = document.getElementById("free").getBoundingClientRect(), found = [];
  for (const label of document.querySelectorAll("#labels > .label:not(.dot)"))
    if (label.checkVisibility({ visibilityProperty: true }) && !inside(label.getBoundingClientRect(), free)) found.push(label.textContent);
  for (const text of document.querySelectorAll("#lesson .picker span, #lesson h2:not(.out), #lesson .choice, #lesson li, #lesson .pill"))
    if (text.checkVisibility() && text.scrollWidth > text.clientWidth + 1) found.push(text.textContent);
  return found;
}"""
"""Words of a lesson, and labels of its picture, that are cut or lie under a card."""


class Taught(Opened):
    """A page that was opened in a lesson, and the hand that plays it."""

    def __init__(
        self, browser: Any, name: str, more: str = "", touch: bool = False, keys: bool = False, **options: Any
    ) -> None:
        super().__init__(browser, address=f"{page_address()}#lesson={name}{more}", touch=touch, **options)
        self.lesson, self.touches, self.keys = lesson(name), touch, keys
        self.page.wait_for_selector("#lesson .choice")
        self.drawn()

    @property
    def done(self) -> int:
        return self.js("page.lessons.lesson.done")

    @property
    def text(self) -> str:
        return self.page.locator("#lesson").inner_text()

    def fly(self, seconds: float, until_done: bool = True) -> None:
        self.js(FLOWN, [seconds, until_done])
        self.drawn()

    # Hands

    def tab_to(self, control: Any) -> None:
        """On from where the focus is, which is seen everywhere on the way."""
        wanted, been = control.element_handle(), []
        while not self.js("node => node === document.activeElement", wanted):
            assert len(been) < 200, f"{control} isn't reached: {been}"
            self.page.keyboard.press("Tab")
            name, seen = self.js(FOCUS)
            assert seen, f"the focus isn't seen on {name}"
            been.append(name)

    def use(self, control: Any) -> None:
        """Press a button."""
        if self.keys:
            self.tab_to(control)
            self.page.keyboard.press("Enter")
        elif self.touches:
            control.tap()
        else:
            control.click()

    def hit(self, x: float, y: float) -> None:
        """Press a place of the picture [px]."""
        if self.touches:
            self.page.touchscreen.tap(x, y)
        elif not self.keys:
            self.page.mouse.click(x, y)
        else:
            self.tab_to(self.page.locator("#stage"))
            self.aim(x, y)
            self.page.keyboard.press("Enter")
        self.drawn(1)

    def aim(self, x: float, y: float) -> None:
        """With arrow keys, as near as their steps go."""
        for key, back in (("ArrowRight", "ArrowLeft"), ("ArrowDown", "ArrowUp")):
            self.page.keyboard.press(key)
            self.page.keyboard.press(back)
        at = self.js("page.pointer.aim")
        for away, key, back in ((x - at[0], "ArrowRight", "ArrowLeft"), (y - at[1], "ArrowDown", "ArrowUp")):
            for _ in range(round(abs(away) / 12)):
                self.page.keyboard.press(key if away > 0 else back)

    def pull(self) -> None:
        """On the string, and let go."""
        if self.keys:
            self.tab_to(self.page.locator("#stage"))
            self.page.keyboard.press("g")
            for _ in range(4):
                for key in ("ArrowRight", "ArrowRight", "ArrowUp"):
                    self.page.keyboard.press(key)
                self.drawn(1)
                self.fly(0.15, False)
            self.page.keyboard.press("g")
        else:
            mouse, place = self.page.mouse, self.on_body(12)
            places = [(place["x"] + 30 * k, place["y"] - 20 * k) for k in range(5)]
            for k, (x, y) in enumerate(places):
                if self.touches:
                    self.touch("touchMove" if k else "touchStart", (x, y))
                else:
                    mouse.move(x, y)
                    if k == 0:
                        mouse.down()
                self.fly(0.15 if k else 0.0, False)
            if self.touches:
                self.touch("touchEnd")
            else:
                mouse.up()
        self.drawn()

    def nudge(self, slider: Any) -> None:
        """One step to the right."""
        if self.keys:
            self.tab_to(slider)
            self.page.keyboard.press("ArrowRight")
        else:
            slider.evaluate("input => { input.stepUp(); input.dispatchEvent(new Event('input')); }")

    def type(self, field: Any, value: str) -> None:
        if self.keys:
            self.tab_to(field)
            self.page.keyboard.type(value)
        else:
            field.fill(value)
        self.page.keyboard.press("Enter")

    # What a lesson wants

    def answer(self, choice: int | None = None) -> None:
        """Answer, and let time stand at once."""
        self.use(self.page.locator(".choice").nth(self.lesson.answer if choice is None else choice))
        self.pause()

    def press(self, name: str) -> None:
        """A button of the present step."""
        if not self.page.locator("#lesson").is_visible():  # a card stands before it on a small screen
            self.use(self.page.locator("section[data-card] .close").last)
            self.drawn(1)
        self.use(self.page.locator("#lesson").get_by_role("button", name=name, exact=True))
        self.pause()
        self.js("page.lessons.lookedMs = 0; page.lessons.look(page.motion.snapshot())")

    def again(self) -> None:
        """From the start, where time stands: on a slow machine a step that only watches would be done before the pause."""
        self.js("page.clock.held = 'held'")
        self.use(self.page.locator("#reset"))
        self.pause()
        self.js("page.clock.held = ''")

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

    def unseen(self) -> list[str]:
        return [*self.js(UNSEEN), *self.covered()]


# How lessons are played


def poke(page: Taught, contact: str, way: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
    page.hit(*page.place(contact, way))
    page.fly(0.3)


def teapot(page: Taught) -> None:
    """By hand: the belly, the handle and a poke without a new start aren't the spout."""
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
    if not page.page.locator("section[data-card=world]").count():
        page.use(page.page.locator("button[data-card=world]"))
    for axis, value in zip("xyz", values.split(), strict=True):
        page.type(page.page.get_by_label(f"Spin at the start {axis}, rad/s"), value)
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
    page.hit(*page.place("spine", (0.01, 0.0, 0.0138)))
    page.pause()
    tied, corner = page.value("string.attach"), page.js("page.motion.body().contacts.corner")
    assert sum((a - b) ** 2 for a, b in zip(tied, corner, strict=True)) > 0.05**2
    page.fly(60.0, False)
    page.press("draw the line")
    assert page.done == 2
    page.drawn()
    assert page.js("page.picture.chalk.geometry.attributes.position.count") > 1.5 * first, "both lines stay"
    poke(page, "corner", (-0.02, -0.03, 0.0))
    assert page.done == 2 and page.js(hidden) == [False] * 3
    page.fly(30.0, False)
    page.hit(*where_lines_meet(page))
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
                page.press(name)
                page.pull()
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


def turn(page: Taught) -> None:
    """Axes by hand, until products vanish: about y, and no farther."""
    page.press("open the axes")
    assert page.js("document.activeElement.getAttribute('aria-label')") == "about x"
    slider, said = page.page.get_by_label("about y"), page.page.locator("section[data-card=tensor] p:not(.note)")
    left = 100.0
    for _ in range(90):
        page.nudge(slider)
        found = re.search(r"([\d.]+) %", said.inner_text())
        if found is None or left < float(found.group(1)) < 2.0:
            break  # none is left, or the least
        left = float(found.group(1))
    page.drawn()


PLAYED = {"teapot": teapot, "spinning_top": spinning_top, "plumb_line": plumb_line}
"""Lessons that are also played by hand; the others by their buttons."""
