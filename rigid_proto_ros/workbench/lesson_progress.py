# SPDX-License-Identifier: MIT
"""Which steps of a lesson have been carried out, by what was done on the page and how long the motion was watched
since.

A step is a tuple of what it takes: ``poke``, ``drag`` and ``reset``, ``set NAME`` of a parameter, ``show NAME`` of a
switch, in any order and as often as it is listed, then ``watch SECONDS`` of simulated time.
"""

from __future__ import annotations

SPIN = "set initial.angular_velocity"

STEPS: dict[str, tuple[tuple[str, ...], ...]] = {
    "ballast_stops_flip": (("watch 4",), ("set ballast.tip", "watch 4"), ("set ballast.tip", "watch 4")),
    "book": (("watch 3",), (SPIN, SPIN, "reset", "reset", "watch 2"), ("set gyroscopic", "reset", "watch 2")),
    "com_or_rim": (("poke",), ("reset", "poke"), ("watch 1",)),
    "dropped_term": (("watch 2",), ("set gyroscopic", "watch 2"), ("set gyroscopic", "watch 2")),
    "hammer": (("watch 1",), ("set inertia_model", "watch 1"), ("set inertia_model", "poke", "poke")),
    "hollow_box": (("poke",), ("set inertia_model", "reset", "poke"), ("watch 1",)),
    "l_bracket": (("watch 0.9",), ("show Principal axes",), ("set gyroscopic", "watch 2")),
    "plumb_line": (("watch 20",), ("set string.attach", "watch 20"), ("poke",)),
    "spinning_top": (("poke",), (SPIN, "reset", "poke"), (SPIN, "reset", "poke")),
    "t_handle": (("watch 4",), ("poke", "watch 2"), ("drag", "watch 1")),
    "teapot": (("poke",), ("reset", "poke", "poke"), ("poke",)),
    "tennis_racket": (
        ("watch 3",),
        (SPIN, SPIN, "reset", "reset", "watch 2"),
        ("set gyroscopic", "reset", "watch 2"),
    ),
    "thrown_hammer": (("watch 0.5",), (SPIN, "reset", "watch 0.5"), ("set gravity", "watch 0.2")),
    "top_on_string": (("watch 2",), (SPIN, "reset", "watch 2"), (SPIN, "reset", "watch 1")),
    "true_or_box_tensor": (("watch 2",), ("set inertia_model", "reset", "watch 1"), ("watch 1",)),
    "weigh_by_throwing": (
        ("set density", "reset", "watch 2"),
        ("poke", "watch 0.5"),
        ("set density", "reset", "poke"),
    ),
}
"""By the lesson's name, one for each of its sentences."""

LONGEST_NS = 500_000_000
"""[ns] Between two states that were watched: time that goes on by more, or back, is another beginning."""


class LessonProgress:
    """done: how many steps of the present lesson have been carried out, one after the other."""

    def __init__(self) -> None:
        self.done = 0
        self._steps: tuple[tuple[str, ...], ...] = ()
        self._open: list[str] = []
        self._watch_ns = 0.0
        self._last_ns: int | None = None

    def begin(self, lesson: str) -> None:
        """Another lesson, or the same from its beginning; empty for none."""
        self._steps = STEPS.get(lesson, ())
        self._go_to(0)

    def _go_to(self, step: int) -> None:
        self.done = step
        self._open, self._watch_ns = [], 0.0
        for what in self._steps[step] if step < len(self._steps) else ():
            if what.startswith("watch "):
                self._watch_ns = 1e9 * float(what.removeprefix("watch "))
            else:
                self._open.append(what)

    def did(self, what: str) -> bool:
        """Something was done; returns whether that completes a step."""
        if what not in self._open:
            return False
        self._open.remove(what)
        return self._completed()

    def watched(self, time_ns: int) -> bool:
        """The body was seen at this simulated time; returns whether that completes a step."""
        before, self._last_ns = self._last_ns, time_ns
        if before is None or self._open or self._watch_ns <= 0.0 or not 0 < time_ns - before <= LONGEST_NS:
            return False
        self._watch_ns -= time_ns - before
        return self._completed()

    def _completed(self) -> bool:
        if self._open or self._watch_ns > 0.0:
            return False
        self._go_to(self.done + 1)
        return True
