# SPDX-License-Identifier: MIT
"""Arrows of L and ω at the COM: as long as the value, on a scale that is said and changes in steps where
the value outgrows it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..picture.plot_range import nice_step
from ..picture.style import MOMENTUM_COLOUR, MOMENTUM_UNIT, OMEGA_COLOUR, OMEGA_UNIT
from .poke_mark import UNWRITTEN

SHORTEST, USUAL, LONGEST = 0.57, 1.0, 1.05
"""Arrow lengths in body sizes: outside the first and the last the scale changes, to one on which the arrow is at most
the second long. The longest still lies within the picture, the shortest reaches out of most bodies.
"""

STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)
"""Of a scale, times powers of ten."""

MOMENTUM_SHARE = 0.95
"""Length of L's arrows against these: it is thick, and where ω is parallel to L its thin arrow reaches
out of it more often.
"""

LEAST_RATE = 1e-9
"""[rad/s] A body slower than this is at rest, and what is left of ω and L has no meaning."""


class VectorScale:
    """Value per round length of one kind of arrow: one of STEPS times a power of ten, kept while arrows
    aren't too long or short.
    """

    def __init__(self, share: float) -> None:
        self._share = share
        self.value = self.round_m = 0.0

    def length(self, value: float, size_m: float) -> float:
        """Length [m] of an arrow for a value > 0 on a body of this size [m]."""
        suited = nice_step(size_m) / 10.0
        if suited != self.round_m:
            self.round_m, self.value = suited, 0.0
        size_m *= self._share
        if not (self.value > 0.0 and SHORTEST <= value / self.value * self.round_m / size_m <= LONGEST):
            self.value = nice_step(value * self.round_m / (USUAL * size_m), STEPS)
        return value / self.value * self.round_m


class MotionArrow:
    """One arrow with its label. Lengths are in the picture's units."""

    def __init__(self, scene: Any, name: str, symbol: str, unit: str, share: float, anchor: str, **style: Any) -> None:
        self._symbol, self._unit = symbol, unit
        self._scale = VectorScale(share)
        self._arrow = scene.add_arrows(f"/{name}", np.zeros((1, 2, 3)), visible=False, **style)
        self._label = scene.add_label(f"/{name}_label", UNWRITTEN, visible=False, anchor=anchor)

    def show(self, at: np.ndarray, vector: np.ndarray, size_m: float, unit_m: float, shown: bool) -> str:
        """From ``at`` (3,) along ``vector`` (3,), for a body of this size [m], the picture's unit being ``unit_m`` [m];
        returns the scale as text, empty while nothing is drawn.
        """
        value = float(np.linalg.norm(vector))
        shown = shown and 0.0 < value < math.inf and size_m > 0.0
        if shown:
            length = self._scale.length(value, size_m) / unit_m
            self._arrow.points = np.array([[at, at + vector * (length / value)]])
            self._label.position = at + vector * ((length + 0.03 * size_m / unit_m) / value)
            text = f"{self._symbol} {value:.3g} {self._unit}"
            if self._label.text != text:
                self._label.text = text
        for handle in (self._arrow, self._label):
            if handle.visible != shown:
                handle.visible = shown
        return f"{length_text(self._scale.round_m)} = {self._scale.value:.3g} {self._unit}" if shown else ""


class MotionArrows:
    """L and ω of the body."""

    def __init__(self, scene: Any) -> None:
        thick = {"shaft_radius": 0.016, "head_radius": 0.036, "head_length": 0.08, "colors": MOMENTUM_COLOUR}
        thin = {"shaft_radius": 0.009, "head_radius": 0.024, "head_length": 0.07, "colors": OMEGA_COLOUR}
        self._momentum = MotionArrow(scene, "momentum", "L", MOMENTUM_UNIT, MOMENTUM_SHARE, "bottom-left", **thick)
        self._omega = MotionArrow(scene, "omega", "ω", OMEGA_UNIT, 1.0, "bottom-right", **thin)

    def show(
        self,
        at: np.ndarray,
        momentum: np.ndarray,
        omega: np.ndarray,
        size_m: float,
        unit_m: float,
        shown: tuple[bool, bool],
    ) -> dict[str, str]:
        """L (3,) [kg m²/s] and ω (3,) [rad/s] in world axes at the drawn COM; shown: which of the two.
        Returns their scales.
        """
        turns = float(np.linalg.norm(omega)) > LEAST_RATE
        texts = {
            "arrow of L": self._momentum.show(at, momentum, size_m, unit_m, shown[0] and turns),
            "arrow of ω": self._omega.show(at, omega, size_m, unit_m, shown[1] and turns),
        }
        return {name: text for name, text in texts.items() if text}


def length_text(metres: float) -> str:
    """A round length with its unit."""
    for unit, name in ((1e3, "km"), (1.0, "m"), (1e-2, "cm"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm")):
        if metres >= unit * (1.0 - 1e-9):
            return f"{metres / unit:.3g} {name}"
    return f"{metres:.3g} m"
