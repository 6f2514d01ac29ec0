# SPDX-License-Identifier: MIT
"""What commands, timeouts and parameters do to the string of a running simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.errors import CommandRefused
from ..base.rotation import transposed_times
from ..base.vectors import vector
from ..motion.body import Body
from ..motion.loads import MAX_ACCELERATION
from ..motion.state import State
from ..motion.string import StringState, tie
from .commands import MoveString, TieString
from .setup import Setup, check_rates


class StringControl:
    """tied: the string as it is, or None. attach: where the next target ties it (mesh coordinates)."""

    def __init__(self, setup: Setup, state: State) -> None:
        settings = setup.string
        self.attach = settings.attach
        self.tied: StringState | None = None
        if settings.attached:
            mass = setup.initial_string_mass
            self.tied = tie(settings, settings.attach, settings.target, setup.body, state, 0, mass)

    def end_due(self, now_ns: int) -> bool:
        """Whether the free end arrived at this very time, or the string let go."""
        if self.tied is None:
            return False
        if self.tied.release_ns is not None and self.tied.release_ns <= now_ns:
            self.tied = None
            return True
        return self.tied.end_ns == now_ns

    def tie_at(self, command: TieString, setup: Setup, state: State) -> None:
        """Take the knot to a point of the body; a string that is tied stays so, its k and c computed anew."""
        point = mesh_point(command, setup.body, state)
        attach = vector(point if setup.surface is None else setup.surface.nearest_point(point))
        if self.tied is not None:
            check_rates(setup, attach)
            self.tied = _checked(
                replace(self.tied, attach=attach).with_spring(setup.string, setup.body, state), setup.body, state
            )
        self.attach = attach

    def move(self, command: MoveString, setup: Setup, state: State) -> None:
        """Take the free end to a new target, tying the string if it wasn't; raises CommandRefused."""
        timeout_ns = setup.string.timeout_ns
        if self.tied is None:
            check_rates(setup, self.attach)
            tied = tie(setup.string, self.attach, command.point, setup.body, state, timeout_ns)
        else:
            tied = self.tied.moved(command.point, state.time_ns, timeout_ns)
        self.tied = _checked(tied, setup.body, state)

    def release(self) -> None:
        """Let go."""
        self.tied = None

    def change(self, old: Setup, new: Setup, state: State) -> None:
        """Take changed parameters, a changed body included. ``attached`` ties or lets go when it changes itself."""
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
            tied = tied.moved(after.target, state.time_ns, 0)
        if after.timeout_ns != before.timeout_ns and tied.release_ns is not None:
            release_ns = max(tied.last_target_ns + after.timeout_ns, state.time_ns)
            tied = replace(tied, release_ns=release_ns if after.timeout_ns else None)
        if after != before or new.body is not old.body:
            tied = tied.with_spring(after, new.body, state)
        self.tied = tied


def mesh_point(command: TieString, body: Body, state: State) -> np.ndarray:
    """Where a command ties the string (3,) in mesh coordinates, before it is taken onto the surface."""
    point = np.asarray(command.point, dtype=float)
    if command.axes == "world":
        point = transposed_times(state.rotation, point - state.position)
    return point if command.axes == "mesh" else body.mesh_point(point)


def _checked(tied: StringState, body: Body, state: State) -> StringState:
    """Raises CommandRefused (``magnitude``) when the string would pull beyond MAX_ACCELERATION."""
    # Where the free end goes counts, not only where it is.
    farthest = max(
        float(np.abs(replace(tied, origin=end, target=end).span(body, state)).max())
        for end in (tied.target, tied.origin)
    )
    with np.errstate(over="ignore"):
        acceleration = tied.frequency * tied.frequency * farthest
    if not acceleration <= MAX_ACCELERATION:
        raise CommandRefused(
            "magnitude",
            "string target",
            tied.target.tolist(),
            f"a target that pulls with at most {MAX_ACCELERATION:g} m/s²",
        )
    return tied
