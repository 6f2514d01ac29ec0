# SPDX-License-Identifier: MIT
"""A second body that gets the same commands, drawn through the first: what another tensor or integrator would do."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ..simulation.mailbox import Block
from ..simulation.observer import BodySnapshot
from ..simulation.quantities import attitude_angle
from . import entities as e
from .columns import Send, one_time, scalar_columns, time_columns
from .inertia_shapes import PrincipalFrame
from .plots import Ranges


class GhostPicture:
    """Follows the ghost of one run. Its states are compared with the body's at equal times."""

    def __init__(self, ranges: Ranges) -> None:
        self._ranges = ranges
        self._body_times = np.empty(0, np.int64)
        self._body_attitudes = np.empty((0, 4))

    def change(self, time_ns: int, wall_ns: int, ghost: BodySnapshot, send: Send) -> None:
        """The ghost is this body from ``time_ns`` on."""
        times = one_time(time_ns, wall_ns)
        frame = PrincipalFrame.of(np.asarray(ghost.inertia, dtype=float))
        send(
            e.GHOST_MESH,
            times,
            rr.Transform3D.columns(translation=[-np.asarray(ghost.center_of_mass)], scale=[ghost.scale]),
        )
        send(
            e.GHOST_BOX,
            times,
            [
                *rr.Boxes3D.columns(half_sizes=[0.5 * frame.box_sides(ghost.mass)]),
                *rr.Transform3D.columns(mat3x3=[frame.axes]),
            ],
        )

    def body_rows(self, times_ns: np.ndarray, rows: np.ndarray) -> None:
        """The body's own states, before the ghost's of the same times."""
        self._body_times = np.concatenate([self._body_times, times_ns])
        self._body_attitudes = np.vstack([self._body_attitudes, rows[:, 3:7]])

    def rows(self, block: Block, begin: int, end: int, send: Send) -> None:
        """States begin..end of the ghost."""
        if begin == end:
            return
        times_ns, walls, rows = block.times[begin:end], block.walls[begin:end], block.rows[begin:end]
        pose = rr.Transform3D.columns(translation=rows[:, 0:3], quaternion=rows[:, 3:7])
        send(e.GHOST, time_columns(times_ns, walls), pose)
        if len(self._body_times):
            at = np.minimum(np.searchsorted(self._body_times, times_ns), len(self._body_times) - 1)
            same = np.flatnonzero(self._body_times[at] == times_ns)
            if len(same):
                pairs = zip(self._body_attitudes[at[same]], rows[same, 3:7], strict=True)
                angle = np.degrees([attitude_angle(body, ghost) for body, ghost in pairs])
                self._ranges.note(e.GHOST_ANGLE, angle)
                send(e.GHOST_ANGLE, time_columns(times_ns[same], walls[same]), scalar_columns(angle[:, np.newaxis]))
        keep = self._body_times > times_ns[-1]
        self._body_times, self._body_attitudes = self._body_times[keep], self._body_attitudes[keep]
