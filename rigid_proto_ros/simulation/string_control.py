# SPDX-License-Identifier: MIT
"""Effects of commands, timeouts and parameters on the string of a running simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.errors import CommandRefused
from ..base.rotation import transposed_times
from ..base.vectors import Vector3, vector
from ..motion.body import MAX_ACCELERATION, Body
from ..motion.state import State
from ..motion.string import StringState, span_of, tie
from .commands import MoveString, TieString
from .setup import Setup, check_rates


class StringControl:
    """The string. tied: its state, or None. attach: where the next target ties it (mesh coordinates)."""

    def __init__(self, setup: Setup, state: State) -> None:
        settings = setup.string
        self.attach = settings.attach
        self.tied: StringState | None = None
        if settings.attached:
            mass = setup.initial_string_mass
            self.tied = tie(settings, settings.attach, settings.target, setup.body, state, 0, mass)

    def end_due(self, now_ns: int) -> bool:
        """Release the string on timeout; returns whether it was released or its free end arrived at this very time."""
        if self.tied is None:
            return False
        if self.tied.release_ns is not None and self.tied.release_ns <= now_ns:
            self.tied = None
            return True
        return self.tied.end_ns == now_ns

    def tie_at(self, command: TieString, setup: Setup, state: State) -> None:
        """Move the knot to a point of the body; a tied string stays tied, and its k and c are recomputed."""
        point = mesh_point(command, setup.body, state)
        attach = vector(point if setup.surface is None else setup.surface.nearest_point(point))
        if self.tied is not None:
            check_rates(setup, attach)
            self.tied = _checked(
                replace(self.tied, attach=attach).with_spring(setup.string, setup.body, state), setup.body, state
            )
        self.attach = attach

    def move(self, command: MoveString, setup: Setup, state: State) -> None:
        """Move the free end to a new target, and tie the string if it isn't tied; raises CommandRefused."""
        timeout_ns = setup.string.timeout_ns
        if self.tied is None:
            check_rates(setup, self.attach)
            tied = tie(setup.string, self.attach, command.point, setup.body, state, timeout_ns)
        else:
            tied = self.tied.moved(command.point, state.time_ns, timeout_ns)
        self.tied = _checked(tied, setup.body, state)

    def release(self) -> None:
        """Release the string."""
        self.tied = None

    def change(self, old: Setup, new: Setup, state: State) -> None:
        """Apply changed parameters or a changed body. A change of ``attached`` itself ties or releases the string."""
        before, after = old.string, new.string
        if after.attach != before.attach:
            self.attach = after.attach
        if after.attached != before.attached:
            self.tied = tie(after, self.attach, after.target, new.body, state, 0) if after.attached else None
            return
        if self.tied is None:
            return
        tied = replace(self.tied, attach=self.attach)
        if after.target != before.target:
            # One that parameters tie has no timeout.
            tied = tied.moved(after.target, state.time_ns, 0 if after.attached else after.timeout_ns)
        if after.timeout_ns != before.timeout_ns and not (after.attached and tied.release_ns is None):
            release_ns = max(tied.last_target_ns + after.timeout_ns, state.time_ns)
            tied = replace(tied, release_ns=release_ns if after.timeout_ns else None)
        # Each change of parameters makes a new body, mostly with the same numbers.
        same_spring = replace(after, target=before.target, timeout_ns=before.timeout_ns) == before
        if not (same_spring and np.array_equal(new.body.row, old.body.row)):
            tied = tied.with_spring(after, new.body, state)
        self.tied = tied


def mesh_point(command: TieString, body: Body, state: State) -> Vector3:
    """Point (3,) at which a command ties the string, in mesh coordinates, before it is projected to the surface."""
    point = np.asarray(command.point, dtype=float)
    if command.axes == "world":
        point = transposed_times(state.rotation, point - state.position)
    return point if command.axes == "mesh" else body.mesh_point(point)


def _checked(tied: StringState, body: Body, state: State) -> StringState:
    """The string; raises CommandRefused (``magnitude``) when its pull would exceed MAX_ACCELERATION."""
    rx, ry, rz = tied.arm(body)
    # Both ends of the free end's path count, not only its current position.
    farthest = max(abs(x) for end in (tied.target, tied.origin) for x in span_of(rx, ry, rz, state.row, *end))
    if not tied.frequency * tied.frequency * farthest <= MAX_ACCELERATION:
        raise CommandRefused(
            "magnitude",
            "string target",
            tied.target.tolist(),
            f"a target that pulls with at most {MAX_ACCELERATION:g} m/s²",
        )
    return tied
