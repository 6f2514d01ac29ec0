# SPDX-License-Identifier: MIT
"""A view of the past: the body is shown as it was at a moment of the history, and the node is paused meanwhile."""

from __future__ import annotations

from collections.abc import Callable

from .history import History
from .node_control import NodeControl
from .scene_loader import SceneLoader


class PastView:
    """moment_ns: on the history's time, which is shown; None while the present is shown. on_change()
    is called at each change.
    """

    def __init__(self, node: NodeControl, history: History, scenes: SceneLoader) -> None:
        self._node = node
        self._history = history
        self._scenes = scenes
        self.moment_ns: int | None = None
        self._from_ns = 0
        self._paused_before = False
        self.on_change: Callable[[], None] = lambda: None

    @property
    def back_s(self) -> float:
        """[s] How far back from the moment at which it began."""
        return 0.0 if self.moment_ns is None else (self._from_ns - self.moment_ns) * 1e-9

    @property
    def paused_before(self) -> bool:
        """Whether simulated time stood still before the past was shown; now, while the present is."""
        return self._node.paused if self.moment_ns is None else self._paused_before

    def show(self, back_s: float) -> None:
        """Show the body as it was so many seconds before the present, or before the moment at which this began."""
        if back_s <= 0.0:
            self.resume()
            return
        if self.moment_ns is None:
            first_ns, self._from_ns = self._history.span
            self._paused_before = self._node.paused
            self._node.pause(True)
        else:
            first_ns, _ = self._history.span
        self.moment_ns = max(self._from_ns - round(back_s * 1e9), first_ns)
        self.on_change()

    def move_by(self, seconds: float) -> None:
        """Go further back than now, or less far with a negative number."""
        self.show(max(0.0, self.back_s + seconds))

    def step(self, count: int) -> None:
        """Go back by so many publication periods, which is what ``~/step`` goes on by; less far with a
        negative number.
        """
        scenario = self._scenes.scenario
        self.move_by(count * (0.01 if scenario is None else 1.0 / float(scenario.parameters.publish_rate)))

    def run_afterwards(self) -> None:
        """Simulated time goes on after this, though it stood still before."""
        self._paused_before = False

    def resume(self) -> None:
        """Back to the present, running or paused as it was."""
        if self.moment_ns is not None:
            self._node.pause(self._paused_before)
        self.end()

    def end(self) -> None:
        """Show the present, whatever the node does."""
        self.moment_ns = None
        self.on_change()

    def reset(self) -> None:
        """Reset the node, from the present."""
        self.resume()
        self._node.call("reset")

    def close(self) -> None:
        """Leave the node as it was before the past was shown."""
        if self.moment_ns is not None:
            self._node.link.call("pause", self._paused_before)
