# SPDX-License-Identifier: MIT
"""What the user saw when the pointer went down: the body as a browser drew it, some moments before the
message came here.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..base.rotation import matrix_from_quaternion
from ..motion.body import Body
from ..motion.surface import Surface

KEPT_S = 1.0
"""Drawn poses are remembered for this long: a page further behind isn't usable."""

USUAL_DELAY_S = 0.06
"""From a pose sent to a pointer message that saw it: a window of 1/60 s each way, a frame, and the way itself."""

SEARCHED_TRIANGLES = 1_000_000
"""Times poses: more distances to a surface than this would be felt as a delay."""

ON_SURFACE = 1e-4
"""Of the body's size: a browser counts in single precision, and gives this much away with room to spare."""


@dataclass(frozen=True)
class DrawnPose:
    """time_s: by the monotonic clock. The picture shows the world point ``origin`` (3,) at its middle, ``unit`` metres
    as one."""

    time_s: float
    position: np.ndarray
    orientation_xyzw: np.ndarray
    origin: np.ndarray
    unit: float

    def world_point(self, drawn_point: Iterable[float]) -> np.ndarray:
        """A point of the picture (3,) in the world [m]."""
        return self.origin + self.unit * np.array(list(drawn_point))

    def body_point(self, drawn_point: Iterable[float]) -> np.ndarray:
        """A point of the picture (3,) in metres from the COM, body axes."""
        return (self.world_point(drawn_point) - self.position) @ matrix_from_quaternion(self.orientation_xyzw)

    def body_direction(self, direction: Iterable[float]) -> np.ndarray:
        """A direction of the picture (3,) in body axes."""
        return np.array(list(direction)) @ matrix_from_quaternion(self.orientation_xyzw)


class DrawnPoses:
    """The poses drawn lately, and which of them a pointer event belongs to."""

    def __init__(self) -> None:
        self._drawn: deque[DrawnPose] = deque()

    def add(self, pose: DrawnPose) -> None:
        """A pose went to the pages."""
        self._drawn.append(pose)
        while self._drawn[0].time_s < pose.time_s - KEPT_S:
            self._drawn.popleft()

    def forget(self) -> None:
        """Another body, or another flight: old poses mean nothing."""
        self._drawn.clear()

    def usual(self, now_s: float) -> DrawnPose | None:
        """The pose that an event arriving now has most likely seen."""
        for pose in reversed(self._drawn):
            if pose.time_s <= now_s - USUAL_DELAY_S:
                return pose
        return self._drawn[0] if self._drawn else None

    def of_point(
        self, drawn_point: Iterable[float], now_s: float, surface: Surface | None, body: Body
    ) -> DrawnPose | None:
        """The pose in which ``drawn_point`` (3,) lay on the surface, so that the user grabbed what he saw.

        Where several fit, as for a sphere, the one nearest to the usual delay; where none does, that of the usual
        delay.
        """
        usual = self.usual(now_s)
        if usual is None or surface is None:
            return usual
        size = float(np.linalg.norm(surface.extent * body.scale))
        nearest_first = sorted(self._drawn, key=lambda pose: abs(pose.time_s - usual.time_s))
        for pose in nearest_first[: max(1, SEARCHED_TRIANGLES // len(surface.triangles))]:
            point = body.mesh_point(_numbers(pose.body_point(drawn_point)))
            gap = float(np.linalg.norm((surface.nearest_point(_numbers(point)) - point) * body.scale))
            if gap <= ON_SURFACE * size:
                return pose
        return usual


def _numbers(point: np.ndarray) -> list[float]:
    return [float(x) for x in point]
