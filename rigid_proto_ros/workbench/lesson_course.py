# SPDX-License-Identifier: MIT
"""What a lesson needs of the page, and which of its steps have been carried out."""

from __future__ import annotations

from dataclasses import dataclass

from ..picture import style
from .panel import CENTRE_OF_MASS, PATHS, SEE_INTO
from .readouts import COM_PLACE, DRIFT, ENERGY, GHOST_ANGLE, MOMENTUM, ROTATIONAL, SPEED, SPIN, SPINS, TRANSLATIONAL

TURN = "set initial.angular_velocity"

USUAL_NUMBERS = (SPEED, SPIN, ENERGY, MOMENTUM, DRIFT)

ALONE = "watch 1"


@dataclass(frozen=True)
class Course:
    """steps: one for each of the lesson's sentences, a tuple of what it takes: ``poke``, ``poke com``, ``poke away``,
    ``drag`` and ``reset``, ``set NAME`` of a parameter, ``show NAME`` of a switch, in any order and as often as it is
    listed, then ``watch SECONDS`` of simulated time.

    numbers: the readouts that the lesson speaks of. shows: switches that are off otherwise, and style.STRING_LINE.
    labels: the parts and contacts that are named in the picture, at most three. speed: simulated seconds per second.
    """

    steps: tuple[tuple[str, ...], ...]
    numbers: tuple[str, ...] = USUAL_NUMBERS
    shows: tuple[str, ...] = ()
    labels: tuple[str, ...] = (style.MOMENTUM,)
    speed: float = 1.0


PUSHED = (SPEED, SPIN, TRANSLATIONAL, ROTATIONAL, MOMENTUM)
THREE_THROWS = (("watch 3",), (TURN, TURN, "reset", "reset", "watch 2"), ("set gyroscopic", "reset", "watch 2"))

COURSES = {
    "ballast_stops_flip": Course(
        (("watch 4",), ("set ballast.tip", "watch 4"), ("set ballast.tip", "watch 4")),
        (SPIN, SPINS, ENERGY, MOMENTUM, DRIFT),
        labels=(style.MOMENTUM, "tip"),
    ),
    "book": Course(THREE_THROWS, (SPIN, SPINS, ENERGY, MOMENTUM, DRIFT)),
    "com_or_rim": Course((("poke com",), ("reset", "poke away"), (ALONE,)), PUSHED, (CENTRE_OF_MASS,), labels=("rim",)),
    "dropped_term": Course(
        (("watch 2",), ("set gyroscopic", "watch 2"), ("set gyroscopic", "watch 2")),
        (DRIFT, ENERGY, MOMENTUM, SPIN, SPINS),
        ("Angular velocity ω",),
        (style.MOMENTUM, style.OMEGA),
    ),
    "hammer": Course(
        ((ALONE,), ("set inertia_model", ALONE), ("set inertia_model", "poke", "poke")),
        (SPEED, SPIN, COM_PLACE, ENERGY, MOMENTUM),
        (CENTRE_OF_MASS, SEE_INTO),
        (style.MOMENTUM, "head", "grip"),
    ),
    "hollow_box": Course(
        (("poke",), ("set inertia_model", "reset", "poke"), (ALONE,)),
        (SPIN, SPEED, ROTATIONAL, MOMENTUM, ENERGY),
        (SEE_INTO,),
        (style.MOMENTUM, "corner"),
    ),
    "l_bracket": Course(
        (("watch 0.9",), ("show Principal axes",), ("set gyroscopic", "watch 2")),
        (SPIN, SPINS, DRIFT, MOMENTUM, ENERGY),
        ("Angular velocity ω",),
        (style.MOMENTUM, style.OMEGA),
    ),
    "plumb_line": Course(
        (("watch 20",), ("set string.attach", "watch 20"), ("poke",)),
        (SPEED, SPIN, ENERGY, COM_PLACE),
        (CENTRE_OF_MASS, SEE_INTO, style.STRING_LINE),
        (),
    ),
    "spinning_top": Course(
        (("poke",), (TURN, "reset", "poke"), (TURN, "reset", "poke")),
        (SPIN, SPINS, MOMENTUM, ENERGY, SPEED),
        labels=(style.MOMENTUM, "stem"),
    ),
    "t_handle": Course(
        (("watch 4",), ("poke", "watch 2"), ("drag", ALONE)),
        (SPIN, SPINS, ENERGY, MOMENTUM, DRIFT),
        labels=(style.MOMENTUM, "tip"),
    ),
    "teapot": Course((("poke",), ("reset", "poke", "poke"), ("poke com",)), PUSHED, (CENTRE_OF_MASS,), ()),
    "tennis_racket": Course(THREE_THROWS, (SPIN, SPINS, ENERGY, MOMENTUM, DRIFT)),
    "thrown_hammer": Course(
        (("watch 0.5",), (TURN, "reset", "watch 0.5"), ("set gravity", "watch 0.2")),
        (COM_PLACE, SPEED, SPIN, ENERGY, MOMENTUM),
        (PATHS,),
        (),
        0.1,
    ),
    "top_on_string": Course(
        (("watch 2",), (TURN, "reset", "watch 2"), (TURN, "reset", ALONE)),
        (SPIN, SPEED, MOMENTUM, ENERGY, COM_PLACE),
    ),
    "true_or_box_tensor": Course(
        (("watch 2",), ("set inertia_model", "reset", ALONE), (ALONE,)),
        (GHOST_ANGLE, SPIN, SPINS, ENERGY, DRIFT),
    ),
    "weigh_by_throwing": Course(
        (("set density", "reset", "watch 2"), ("poke", "watch 0.5"), ("set density", "reset", "poke")),
        (SPEED, SPIN, SPINS, ENERGY, MOMENTUM),
        labels=(style.MOMENTUM, "corner"),
    ),
}
"""By the lesson's name."""

NO_LESSON = Course(())

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
        self._steps = COURSES.get(lesson, NO_LESSON).steps
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
