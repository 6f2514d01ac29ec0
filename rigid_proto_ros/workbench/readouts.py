# SPDX-License-Identifier: MIT
"""Numbers and small plots of the flight: the five that a lesson speaks of, and all of them a click away."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
import viser

from ..base.vectors import FloatArray, StateRow, Vector3
from ..mass.tensor import principal_axes
from ..motion.state import State
from ..picture import style
from ..picture.picture import angle_to, energies
from ..simulation.quantities import attitude_angle
from ..simulation.setup import Setup

SPEED, SPIN, SPINS, COM_PLACE = "speed of the COM", "|ω|", "ω₁ ω₂ ω₃", "COM x y z"
ENERGY, TRANSLATIONAL, ROTATIONAL = "energy", "translational energy", "rotational energy"
MOMENTUM, DRIFT, GHOST_ANGLE = "|L|", "L has turned by", "angle to the ghost"

PLOTTED_S = 20.0
"""[s, simulated] Length of the plots, up to now."""

SAMPLE_S = 0.1
"""[s, simulated] Between two points of a plot."""

NUMBERS_S, PLOTS_S = 0.2, 0.5
"""[s] How often numbers and plots are drawn anew."""

PADDING = (10, 12, 0, 0)
"""[pixels] Above, right, below, left of a plot: a number at the end of an axis has half of its size beyond it."""

PLOT_PIXELS = 130

NARROWEST = 0.05
"""Of the largest value: a range isn't narrower, so that rounding isn't blown up to fill the plot."""

AXIS_PIXELS = 58
"""Width for the longest tick, "-999.95", its gap and its mark."""

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

AXES: Any = ({"label": "seconds before now", "labelSize": 14, "size": 30}, {"size": AXIS_PIXELS})

FLAT_ANGLE = 1.0
"""[°] An angle's plot spans at least this much: rounding isn't blown up to fill it."""


def html_table(rows: Iterable[tuple[str, str]]) -> str:
    """Names and values as HTML, which a browser takes at once; Markdown it would compile anew at every change."""
    cells = "".join(
        f'<tr><td style="opacity: 0.65; padding: 0 1em 0 0">{escape(name)}</td><td>{escape(value)}</td></tr>'
        for name, value in rows
    )
    return f'<table style="margin: 0.4em 0.9em; font-size: 0.85em; line-height: 1.5">{cells}</table>'


# Axes
#
# uPlot writes ticks in full, "0.00000012" or "7,200,000", into a column of fixed width, which cuts off what is longer.
# Ticks of values between 1 and 1000 always fit.


@dataclass(frozen=True)
class PlotRange:
    """Values are plotted divided by 10**exponent (a multiple of 3), on an axis from ``low`` to ``high``
    in these units.
    """

    exponent: int
    low: float
    high: float

    def title(self, name: str, unit: str) -> str:
        """The plot's title: the quantity, its power of ten and its unit."""
        power = f"10{self.exponent}".translate(SUPERSCRIPTS).replace("¹⁰", "10", 1) if self.exponent else ""
        return f"{name} [{f'{power} ' if power else ''}{unit}]"


def plot_range(values: FloatArray, least: float = 0.0) -> PlotRange:
    """For finite values in any order; ``least``: the range is at least as wide, in the values' unit."""
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    largest = max(abs(low), abs(high), least)
    exponent = 3 * math.floor(math.log10(largest) / 3.0) if largest > 0.0 else 0
    unit = 10.0**exponent
    low, high, largest, least = low / unit, high / unit, largest / unit, least / unit
    span = max(high - low, NARROWEST * largest, least)
    if span == 0.0:
        return PlotRange(0, -1.0, 1.0)
    middle = 0.5 * (low + high)
    step = nice_step(span / 4.0)
    # Outward to whole steps, with room at both ends: the range stays while the values change little.
    low = min(low, middle - 0.5 * span)
    high = max(high, middle + 0.5 * span)
    low, high = math.floor(low / step - 0.25) * step, math.ceil(high / step + 0.25) * step
    return PlotRange(exponent, round(low, 9), round(high, 9))


def nice_step(length: float) -> float:
    """The next above a positive length, or equal to it, of 1, 2 and 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(length))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= length * (1.0 - 1e-12))


class LivePlot:
    """One small plot of values against seconds before now. series: name and colour of each; least: as ``plot_range``
    takes it.
    """

    def __init__(
        self, gui: Any, title: str, unit: str, series: Sequence[tuple[str, style.Colour]], least: float = 0.0
    ) -> None:
        self._title, self._unit, self._least = title, unit, least
        self._range = PlotRange(0, -1.0, 1.0)
        styles = [
            {"label": "t"},
            *({"label": name, "stroke": style.css(colour), "width": 1.5} for name, colour in series),
        ]
        self._handle = gui.add_uplot(
            tuple(np.zeros(1) for _ in styles),
            tuple(styles),
            title=self._range.title(title, unit),
            scales=self._scales,
            axes=AXES,
            height=PLOT_PIXELS,
            # Its values are those under the pointer, "--" while there is none.
            legend={"show": len(series) > 1, "live": False},
            padding=PADDING,
        )

    @property
    def shown(self) -> bool:
        """Whether it is there."""
        return bool(self._handle.visible)

    @shown.setter
    def shown(self, shown: bool) -> None:
        self._handle.visible = shown

    @property
    def _scales(self) -> Any:
        return {"x": {"time": False, "range": (-PLOTTED_S, 0.0)}, "y": {"range": (self._range.low, self._range.high)}}

    def show(self, ages_s: FloatArray, values: FloatArray) -> None:
        """Draw values (n, columns) at times (n,) [s] up to 0, which is now."""
        suited = plot_range(values, self._least)
        if suited != self._range:
            # The page makes the plot anew for these, so they change in steps.
            self._range = suited
            self._handle.scales = self._scales
            self._handle.title = suited.title(self._title, self._unit)
        self._handle.data = (ages_s, *(values / 10.0**suited.exponent).T)


class Readings:
    """What can be read off a flight. ``restart`` at every reset."""

    def __init__(self) -> None:
        self._last: tuple[Setup, State, float, StateRow | None] | None = None
        self._samples: deque[tuple[float, ...]] = deque()
        self._start: Vector3 | None = None

    def restart(self) -> None:
        """The flight began anew."""
        self._samples.clear()
        self._start = None

    @property
    def samples(self) -> FloatArray:
        """Up to the last state (n, 10): time [s]; energies [J] translational, rotational, of gravity, total, of the
        string; ω in principal axes (3); angle of L [°].
        """
        samples = np.array(self._samples).reshape(-1, 10)
        return samples if self._last is None else samples[samples[:, 0] <= self._last[1].time_ns * 1e-9]

    def is_due(self, time_ns: int) -> bool:
        """Whether a point of the plots belongs to this time."""
        return not self._samples or time_ns * 1e-9 >= self._samples[-1][0] + SAMPLE_S

    def take(self, setup: Setup, state: State, string_energy: float, ghost: StateRow | None) -> None:
        """A state, what the string holds [J], and the ghost's state (13,)."""
        self._last = (setup, state, string_energy, ghost)
        time_s = state.time_ns * 1e-9
        if self._samples and time_s < self._samples[-1][0]:
            self._samples.clear()
        if self.is_due(state.time_ns):
            body = setup.body
            momentum = state.angular_momentum(body.inertia)
            if self._start is None and momentum.any():
                self._start = momentum
            energies = _energies(setup, state, string_energy)
            spins = principal_axes(body.inertia)[1].T @ state.angular_velocity_body
            self._samples.append((time_s, *energies, *spins.tolist(), self._turned(momentum)))
        while self._samples[0][0] < time_s - PLOTTED_S:
            self._samples.popleft()

    def look_at(self, setup: Setup, state: State, string_energy: float) -> None:
        """A state of the past; the samples stay."""
        self._last = (setup, state, string_energy, None)

    def _turned(self, momentum: Vector3) -> float:
        """The angle [°] that L (3,) has turned by."""
        return 0.0 if self._start is None else float(np.degrees(angle_to(self._start, momentum[np.newaxis])[0]))

    @property
    def values(self) -> dict[str, str]:
        """The last state in words, by name."""
        if self._last is None:
            return {}
        setup, state, string_energy, ghost = self._last
        body = setup.body
        momentum = state.angular_momentum(body.inertia)
        w = principal_axes(body.inertia)[1].T @ state.angular_velocity_body
        spin = style.without_rounding(float(np.linalg.norm(w)))
        speed = style.without_rounding(float(np.linalg.norm(state.linear_velocity)))
        spins = " ".join(f"{style.without_rounding(x, spin or math.inf):.3g}" for x in w)
        translational, rotational, _, total, _ = _energies(setup, state, string_energy)
        values = {
            SPEED: f"{speed:.4g} m/s",
            SPIN: f"{spin:.4g} {style.OMEGA_UNIT}",
            SPINS: f"{spins} {style.OMEGA_UNIT}",
            ENERGY: f"{total:.5g} {style.ENERGY_UNIT}",
            TRANSLATIONAL: f"{translational if speed else 0.0:.4g} {style.ENERGY_UNIT}",
            ROTATIONAL: f"{rotational if spin else 0.0:.4g} {style.ENERGY_UNIT}",
            MOMENTUM: f"{float(np.linalg.norm(momentum)):.5g} {style.MOMENTUM_UNIT}",
            DRIFT: f"{style.without_rounding(self._turned(momentum)):.3g}{style.ANGLE_UNIT}",
            COM_PLACE: " ".join(f"{style.without_rounding(x):.4g}" for x in state.position) + " m",
        }
        if ghost is not None:
            apart = float(np.degrees(attitude_angle(np.array(state.orientation_xyzw), ghost[3:7])))
            values[GHOST_ANGLE] = f"{apart:.0f}{style.ANGLE_UNIT}"
        return values


def _energies(setup: Setup, state: State, string_energy: float) -> tuple[float, ...]:
    """Energies [J]: translational, rotational, of gravity, total, of the string."""
    own = energies(state.row[np.newaxis], setup)[0].tolist()
    return *own, sum(own) + string_energy, string_energy


class ReadoutTab:
    """All numbers and the plots, in a tab of their own."""

    def __init__(self, gui: viser.GuiApi, tabs: viser.GuiTabGroupHandle, readings: Readings) -> None:
        self._readings = readings
        with tabs.add_tab("Plots"):
            self._numbers = gui.add_html("")
            free = (*style.ENERGY_SERIES, *style.TOTAL_ENERGY_SERIES)
            self._free, self._held = (
                LivePlot(gui, style.ENERGY_TITLE, style.ENERGY_UNIT, series)
                for series in (free, (*free, *style.STRING_ENERGY_SERIES))
            )
            spin = LivePlot(gui, style.OMEGA_TITLE, style.OMEGA_UNIT, style.OMEGA_SERIES)
            angle = LivePlot(
                gui, style.MOMENTUM_ANGLE_TITLE, style.ANGLE_UNIT, style.MOMENTUM_ANGLE_SERIES, least=FLAT_ANGLE
            )
        self._held.shown = False
        self._columns = {self._free: (1, 5), self._held: (1, 6), spin: (6, 9), angle: (9, 10)}
        self._numbers_due_s = self._plots_due_s = 0.0

    def draw(self, now_s: float) -> None:
        """Draw what is due."""
        readings = self._readings
        if now_s >= self._numbers_due_s:
            self._numbers_due_s = now_s + NUMBERS_S
            self._numbers.content = html_table(readings.values.items())
        if now_s >= self._plots_due_s:
            self._plots_due_s = now_s + PLOTS_S
            samples = readings.samples
            if not len(samples):
                samples = np.zeros((1, samples.shape[1]))
            ages = samples[:, 0] - samples[-1, 0]
            # A string that has held nothing for as long as is plotted isn't named.
            self._held.shown = bool(samples[:, 5].any())
            self._free.shown = not self._held.shown
            for plot, (first, end) in self._columns.items():
                if plot.shown:
                    plot.show(ages, samples[:, first:end])
