# SPDX-License-Identifier: MIT
"""What a flight brings along that goes on at time 0: a branch of a recorded one, or the page's rewind.

A segment that began before the branch is flown again from its own start, so that the motion goes on to the very bits;
from the state at time 0 alone its steps would begin anew. Whether it leads there is seen by flying it: where a scene
was edited it doesn't, and the motion begins with ``initial.*``, under the same loads and string.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..base.rotation import Vector, rotate
from ..motion.body import Body
from ..motion.loads import Load
from ..motion.state import State, fill_initial_row
from ..motion.string import StringSettings, Tied
from .flight import HELD_WRENCH, NEVER, NO_SLOT, PULSE
from .thrusters import Push

FARTHEST_NS = 1 << 60
"""Times of a flight that goes on lie within that of its time 0 [ns]."""


@dataclass(frozen=True)
class GoingLoad:
    """A wrench (``held``) or poke that acts at time 0, or, where ``thruster`` names one, what that pushes with.

    began_ns <= 0. end_ns >= 0: of a poke; a wrench times out as the setup says. slot: as a flight numbers it.
    """

    began_ns: int
    load: Load | None = None
    held: bool = False
    slot: int = NO_SLOT
    end_ns: int = NEVER
    thruster: str = ""

    @property
    def kind(self) -> int:
        """What it is to a flight."""
        return HELD_WRENCH if self.held else PULSE

    def ends_ns(self, wrench_timeout_ns: int) -> int:
        """When it ends by itself."""
        if not self.held:
            return self.end_ns
        return max(0, self.began_ns + wrench_timeout_ns) if wrench_timeout_ns else NEVER


@dataclass(frozen=True)
class GoingString:
    """settings: those in force at time 0 that are also where the string is: attached, attach, target, timeout_ns; what
    a scene says otherwise is a change at time 0. attach: where the next target ties it. tied: the string as it is, its
    stiffness and damping to follow from ``effective_mass``; None while it isn't tied. body: ``body_hash``.
    """

    settings: StringSettings
    attach: Vector
    tied: Tied | None
    body: int = 0

    def settings_before(self, now: StringSettings) -> StringSettings:
        """The settings before what a scene changed in where the string is."""
        then = self.settings
        return replace(now, attached=then.attached, attach=then.attach, target=then.target, timeout_ns=then.timeout_ns)


@dataclass(frozen=True)
class InFlight:
    """Times [ns] count from time 0 of the flight that goes on. began_ns <= 0: when its segment began; start (13,): the
    state then. loads: in the order in which they began. string: None where it is as the parameters say. thrusters:
    those at work, by name, commanded last at thrusters_last_ns.
    """

    began_ns: int
    start: tuple[float, ...]
    loads: tuple[GoingLoad, ...] = ()
    string: GoingString | None = None
    thrusters: Mapping[str, Push] = field(default_factory=dict)
    thrusters_last_ns: int = 0

    @property
    def is_tied(self) -> bool:
        """Whether a string is tied that the parameters don't tell of."""
        return self.string is not None and self.string.tied is not None

    @property
    def acts(self) -> bool:
        """Whether anything acts besides what the parameters tell of."""
        return bool(self.loads or self.thrusters) or self.is_tied


def initial_row_of(state: State) -> np.ndarray:
    """The row (13,) that a scene begins with which tells of this state by ``initial.*``."""
    row, q = np.empty(13), state.orientation_xyzw
    spin = np.array(rotate(*q.tolist(), *state.angular_velocity_body.tolist()))
    fill_initial_row(state.position, q, state.linear_velocity, spin, row)
    return row


def body_hash(body: Body) -> int:
    """What tells bodies apart that a string's stiffness was taken for."""
    digest = hashlib.sha256((body.row + 0.0).tobytes()).hexdigest()[:15]
    return int(digest, 16)
