# SPDX-License-Identifier: MIT
"""Numbers and small plots of the flight, in a panel of their own."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
import viser

from ..mass.tensor import principal_axes
from ..motion.state import State
from ..picture.plot_range import AXIS_PIXELS, PlotRange, plot_range
from ..picture.plots import angle_to
from ..picture.style import (
    ANGLE_UNIT,
    ENERGY_SERIES,
    ENERGY_TITLE,
    ENERGY_UNIT,
    GHOST_ANGLE_TITLE,
    GHOST_COLOUR,
    MOMENTUM_ANGLE_SERIES,
    MOMENTUM_ANGLE_TITLE,
    MOMENTUM_UNIT,
    OMEGA_SERIES,
    OMEGA_TITLE,
    OMEGA_UNIT,
    STRING_ENERGY_SERIES,
    TOTAL_ENERGY_SERIES,
    css,
)
from ..scene.scenario import Scenario

PLOTTED_S = 20.0
"""[s, simulated] Length of the plots."""

SAMPLE_S = 0.1
"""[s] Between two points of a plot."""

NUMBERS_S, PLOTS_S = 0.2, 0.5
"""[s] How often numbers and plots are drawn anew."""

PADDING = (10, 12, 0, 0)
"""[pixels] Above, right, below, left of a plot: a number at the end of an axis has half of its size beyond it."""

PLOT_PIXELS = 130

AXES: Any = ({"label": "t [s]", "labelSize": 14, "size": 30}, {"size": AXIS_PIXELS})

ROUNDING = 1e-9
"""[°] A smaller angle comes from the arithmetic, and so does a smaller share of the spin."""

FLAT_ANGLE = 1.0
"""[°] An angle's plot spans at least this much: rounding isn't blown up to fill it."""


def html_table(rows: Iterable[tuple[str, str]]) -> str:
    """Names and values as HTML, which a browser takes at once; Markdown it would compile anew at every change."""
    cells = "".join(
        f'<tr><td style="color: gray; padding: 0 1em 0 0">{escape(name)}</td><td>{escape(value)}</td></tr>'
        for name, value in rows
    )
    return f'<table style="margin: 0.6em 0.9em; font-size: 0.85em; line-height: 1.45">{cells}</table>'


class LivePlot:
    """One small plot of values over the simulated time. series: name and colour of each; least: as
    ``plot_range`` takes it.
    """

    def __init__(
        self,
        gui: Any,
        title: str,
        unit: str,
        series: Sequence[tuple[str, tuple[int, int, int]]],
        least: float = 0.0,
    ) -> None:
        self._title, self._unit, self._least = title, unit, least
        self._range = PlotRange(0, -1.0, 1.0)
        self.columns = len(series)
        styles = [{"label": "t"}, *({"label": name, "stroke": css(colour), "width": 1.5} for name, colour in series)]
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
    def _scales(self) -> Any:
        return {"x": {"time": False}, "y": {"range": (self._range.low, self._range.high)}}

    def show(self, times_s: np.ndarray, values: np.ndarray) -> None:
        """Draw values (n, columns) at times (n,) [s]."""
        suited = plot_range(values, self._least)
        if suited != self._range:
            # The page makes the plot anew for these, so they change in steps.
            self._range = suited
            self._handle.scales = self._scales
            title = suited.title(self._title, self._unit)
            if self._handle.title != title:
                self._handle.title = title
        self._handle.data = (times_s, *(values / 10.0**suited.exponent).T)

    def switch(self, shown: bool) -> None:
        """Show or hide it."""
        if self._handle.visible != shown:
            self._handle.visible = shown


class ReadoutPanel:
    """Follows one flight; ``restart`` at every reset."""

    def __init__(self, server: viser.ViserServer) -> None:
        gui = server.gui
        panel = gui.add_panel()
        with panel.add_tab("Readouts"):
            self._numbers = gui.add_html("waiting for the node …")
            ghost_angle = (("angle", GHOST_COLOUR),)
            self._ghost_plot = LivePlot(gui, GHOST_ANGLE_TITLE, ANGLE_UNIT, ghost_angle, least=FLAT_ANGLE)
            self._ghost_plot.switch(False)
            self._plots = (
                LivePlot(gui, ENERGY_TITLE, ENERGY_UNIT, (*ENERGY_SERIES, *STRING_ENERGY_SERIES, *TOTAL_ENERGY_SERIES)),
                LivePlot(gui, OMEGA_TITLE, OMEGA_UNIT, OMEGA_SERIES),
                LivePlot(gui, MOMENTUM_ANGLE_TITLE, ANGLE_UNIT, MOMENTUM_ANGLE_SERIES, least=FLAT_ANGLE),
            )
        # One column beside the picture, which keeps most of the window's width.
        panel.dock_below(gui.main_panel)
        self._samples: deque[tuple[float, ...]] = deque()
        self._ghost_angles: deque[tuple[float, float]] = deque()
        self._start: np.ndarray | None = None
        self._numbers_due_s = self._plots_due_s = self._sample_due_s = 0.0

    def restart(self) -> None:
        """The flight began anew."""
        self._samples.clear()
        self._ghost_angles.clear()
        self._start = None

    def show(
        self,
        now_s: float,
        scenario: Scenario,
        state: State,
        string_energy: float,
        scales: Mapping[str, str],
        ghost_angle: float | None,
    ) -> None:
        """Take a state; draw where that is due. scales: of the picture's arrows, by their names. ghost_angle [rad]
        between body and ghost, None without one.
        """
        if now_s < self._sample_due_s and now_s < self._numbers_due_s:
            return
        body = scenario.setup.body
        momentum = state.angular_momentum(body.inertia)
        length = float(np.linalg.norm(momentum))
        if self._start is None and length > 0.0:
            self._start = momentum
        angle = 0.0 if self._start is None else float(np.degrees(angle_to(self._start, momentum[np.newaxis])[0]))
        w = principal_axes(body.inertia)[1].T @ state.angular_velocity_body
        kinetic = state.kinetic_energy(body.mass, body.inertia)
        translational = 0.5 * body.mass * float(state.linear_velocity @ state.linear_velocity)
        rotational = kinetic - translational
        gravity = -body.mass * float(scenario.setup.gravity @ state.position)
        total = kinetic + gravity + string_energy
        time_s = state.time_ns * 1e-9
        if now_s >= self._sample_due_s:
            self._sample_due_s = now_s + SAMPLE_S
            if not self._samples or time_s > self._samples[-1][0]:
                energies = (translational, rotational, gravity, string_energy, total)
                self._samples.append((time_s, *energies, *w.tolist(), angle))
                if ghost_angle is not None:
                    self._ghost_angles.append((time_s, float(np.degrees(ghost_angle))))
            for samples in (self._samples, self._ghost_angles):
                while samples and samples[0][0] < time_s - PLOTTED_S:
                    samples.popleft()
        if now_s >= self._numbers_due_s:
            self._numbers_due_s = now_s + NUMBERS_S
            spin = float(np.linalg.norm(state.angular_velocity_body))
            rows = (
                ("time", f"{time_s:.2f} s"),
                ("energy", f"{total:.5g} {ENERGY_UNIT}"),
                ("translational", f"{translational:.4g} {ENERGY_UNIT}"),
                ("rotational", f"{rotational:.4g} {ENERGY_UNIT}"),
                ("|L|", f"{length:.5g} {MOMENTUM_UNIT}"),
                ("drift of L's direction", f"{angle if angle > ROUNDING else 0.0:.3g}{ANGLE_UNIT}"),
                ("|ω|", f"{spin:.4g} {OMEGA_UNIT}"),
                ("ω₁ ω₂ ω₃", " ".join(f"{x if abs(x) > ROUNDING * spin else 0.0:.3g}" for x in w) + f" {OMEGA_UNIT}"),
                ("COM", " ".join(f"{x:.4g}" for x in state.position) + " m"),
                *scales.items(),
            )
            self._numbers.content = html_table(rows)
        if now_s >= self._plots_due_s and len(self._samples) > 1:
            self._plots_due_s = now_s + PLOTS_S
            self._ghost_plot.switch(ghost_angle is not None and len(self._ghost_angles) > 1)
            if len(self._ghost_angles) > 1:
                angles = np.array(self._ghost_angles)
                self._ghost_plot.show(angles[:, 0], angles[:, 1:])
            samples = np.array(self._samples)
            first = 1
            for plot in self._plots:
                plot.show(samples[:, 0], samples[:, first : first + plot.columns])
                first += plot.columns
