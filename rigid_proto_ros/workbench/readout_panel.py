# SPDX-License-Identifier: MIT
"""Numbers and small plots of the flight, in a panel of their own."""

from __future__ import annotations

from collections import deque

import numpy as np
import viser

from ..core.inertia_tensor import principal_axes
from ..core.state import State
from ..scenario import Scenario
from .readouts import angle_between

PLOTTED_S = 20.0
"""[s, simulated] Length of the plots."""

SAMPLE_S = 0.1
"""[s] Between two points of a plot."""

NUMBERS_S, PLOTS_S = 0.2, 0.5
"""[s] How often numbers and plots are drawn anew."""

COLOURS = ("rgb(235,85,85)", "rgb(70,170,90)", "rgb(85,130,250)", "rgb(60,60,60)")
PLOTS = {
    "Energy [J]": ("turning", "moving", "potential", "total"),
    "ω in principal axes [rad/s]": ("ω₁", "ω₂", "ω₃"),
    "Angle of L to its start [°]": ("angle",),
}


class ReadoutPanel:
    """Follows one flight; ``restart`` at every reset."""

    def __init__(self, server: viser.ViserServer, width: float) -> None:
        panel = server.gui.add_panel()
        with panel.add_tab("Readouts"):
            self._numbers = server.gui.add_markdown("waiting for the node …")
            self._plots = [self._plot(server, title, names) for title, names in PLOTS.items()]
        panel.dock_left()
        panel.set_width(width)
        self._samples: deque[tuple[float, ...]] = deque()
        self._start: np.ndarray | None = None
        self._numbers_due_s = self._plots_due_s = self._sample_due_s = 0.0

    def _plot(self, server: viser.ViserServer, title: str, names: tuple[str, ...]):
        series = [{"label": "t"}] + [
            {"label": name, "stroke": colour, "width": 1.5} for name, colour in zip(names, COLOURS, strict=False)
        ]
        data = tuple(np.zeros(1) for _ in series)
        scales = {"x": {"time": False}}
        return server.gui.add_uplot(data, tuple(series), title=title, scales=scales, height=150, legend={"show": True})

    def restart(self) -> None:
        """The flight began anew."""
        self._samples.clear()
        self._start = None

    def show(self, now_s: float, scenario: Scenario, state: State, string_energy: float) -> None:
        """Take a state; draw where that is due."""
        if now_s < self._sample_due_s and now_s < self._numbers_due_s:
            return
        body = scenario.setup.body
        momentum = state.angular_momentum(body.inertia)
        length = float(np.linalg.norm(momentum))
        if self._start is None and length > 0.0:
            self._start = momentum
        angle = 0.0 if self._start is None else float(np.degrees(angle_between(momentum, self._start)))
        w = principal_axes(body.inertia)[1].T @ state.angular_velocity_body
        total = state.kinetic_energy(body.mass, body.inertia)
        moving = 0.5 * body.mass * float(state.linear_velocity @ state.linear_velocity)
        potential = -body.mass * float(scenario.setup.gravity @ state.position) + string_energy
        time_s = state.time_ns * 1e-9
        if now_s >= self._sample_due_s:
            self._sample_due_s = now_s + SAMPLE_S
            if not self._samples or time_s > self._samples[-1][0]:
                self._samples.append((time_s, total - moving, moving, potential, total + potential, *w.tolist(), angle))
            while self._samples and self._samples[0][0] < time_s - PLOTTED_S:
                self._samples.popleft()
        if now_s >= self._numbers_due_s:
            self._numbers_due_s = now_s + NUMBERS_S
            spin = float(np.linalg.norm(state.angular_velocity_body))
            rows = (
                ("time", f"{time_s:.2f} s"),
                ("energy", f"{total + potential:.5g} J"),
                ("… turning, moving", f"{total - moving:.4g}, {moving:.4g} J"),
                ("\\|L\\|", f"{length:.5g} N m s"),
                ("L off its start", f"{angle:.3g}°"),
                ("\\|ω\\|", f"{spin:.4g} rad/s"),
                ("ω₁ ω₂ ω₃", " ".join(f"{x:.3g}" for x in w)),
            )
            table = "\n".join(f"| {name} | {value} |" for name, value in rows)
            self._numbers.content = "|  |  |\n| --- | --- |\n" + table
        if now_s >= self._plots_due_s and len(self._samples) > 1:
            self._plots_due_s = now_s + PLOTS_S
            columns = np.array(self._samples).T
            first = 1
            for plot, names in zip(self._plots, PLOTS.values(), strict=True):
                plot.data = (columns[0], *(columns[first + k] for k in range(len(names))))
                if names == ("angle",):
                    # Round-off isn't blown up to fill the plot.
                    plot.scales = {
                        "x": {"time": False},
                        "y": {"range": (0.0, max(1.0, 1.1 * float(columns[first].max())))},
                    }
                first += len(names)
