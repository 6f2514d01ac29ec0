# SPDX-License-Identifier: MIT
"""Back to a moment of a flight: what a node must be told to go on from there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import InputError, MeshError
from ..base.rotation import rotate_inverse
from ..scene.declaration import READ_ONLY
from ..scene.in_flight_text import NAME as IN_FLIGHT
from ..scene.parameters import parameter_named
from ..scene.scenario import scene_text
from ..scene.scene_file import read_scene_text
from ..session.branch import Branch, branch_at
from ..session.recorded_session import RecordedSession
from ..session.runs import decode_event

KEPT = frozenset(
    {
        *(
            "record",
            "real_time_factor",
            "publish_rate",
            "publish_clock",
            "publish_tf",
            "imu_contact",
            "schedule_horizon",
        ),
    }
)
"""Parameters that stay as they are: how one looks at the motion, not the motion."""

KEPT_BY_REWIND = KEPT | {"ghost.inertia_model", "ghost.integrator"}
"""A lesson has a ghost of its own; who goes back in one flight keeps his."""


@dataclass(frozen=True)
class Rewind:
    """A moment to go on from, and all that the node must be told for it.

    While paused: set ``changes`` atomically, tell the history ``rewinding``, call ``~/reset``, resume. Where the node
    refuses the changes because of what acts now, reset once before.

    moment_ns on the history's time, time_ns on the node's clock of that run. row (13,): the state there, as published.
    scene: the same as text, for files and links. notes: what differs from what was. exact: computed anew from
    the events to the bit; else taken from the recorded state.
    """

    moment_ns: int
    time_ns: int
    row: np.ndarray
    changes: dict[str, object]
    scene: str
    notes: list[str]
    exact: bool


def core_row(row: np.ndarray) -> np.ndarray:
    """A published state (13,) in the order of ``simulation/observer.py``'s ``STATE_FIELDS``: the angular
    velocity in body axes.
    """
    values = row.tolist()
    return np.array([*values[:10], *rotate_inverse(*values[3:7], *values[10:13])])


def make_rewind(session: RecordedSession, moment_ns: int, row: np.ndarray, whole: bool, present: str) -> Rewind:
    """The rewind to the end of a session, ``row`` (13,) being the state published there; whole: the session has all of
    its events. present: the scene as it is now. Raises MeshError when the mesh that flew then is gone.
    """
    time_ns = session.end_ns
    reason = "more events happened than are kept"
    branch: Branch | None = None
    values: Mapping[str, Any] = {}
    exact = False
    if whole:
        try:
            branch = branch_at(session, time_ns)
            values = read_scene_text(branch.scene).values
            exact = np.array_equal(_start(values), row)
            reason = "not all earlier commands were received"
        except MeshError:
            raise
        except InputError as error:
            reason = str(error)
    if branch is None or not exact:
        values = _recorded_values(session, row)
        note = f"the wrenches that acted then are left out; the state is the recorded one ({reason})"
        branch = Branch(scene_text(values, session.mesh_sha256), [note])
    return Rewind(
        moment_ns=moment_ns,
        time_ns=time_ns,
        row=row,
        changes=changes_to(values, read_scene_text(present).values, KEPT_BY_REWIND),
        scene=branch.scene,
        notes=branch.notes,
        exact=exact,
    )


_START = ("initial.position", "initial.orientation_xyzw", "initial.linear_velocity", "initial.angular_velocity")


def _start(values: Mapping[str, Any]) -> np.ndarray:
    return np.array([number for name in _START for number in values[name]])


def _recorded_values(session: RecordedSession, row: np.ndarray) -> dict[str, Any]:
    """Parameters in force at the session's end, as far as its events say, with the recorded state as the
    initial one.
    """
    values: dict[str, Any] = dict(read_scene_text(session.scene).values)
    for number, line in enumerate(session.lines, 1):
        _, kind, content = decode_event(line, number)
        if kind == "set":
            values |= content
    numbers = row.tolist()
    cuts = ((0, 3), (3, 7), (7, 10), (10, 13))
    values["initial.string_mass"] = 0.0
    values[IN_FLIGHT] = ""
    return {**values, **{name: numbers[i:j] for name, (i, j) in zip(_START, cuts, strict=True)}}


def changes_to(values: Mapping[str, Any], present: Mapping[str, Any], kept: frozenset[str] = KEPT) -> dict[str, object]:
    """What takes a node from its present parameters to those of a moment or a scene, to be set in one call.

    What can't change in flight and what is ``kept`` is left out; a ballast that isn't there yet weighs
    nothing.
    """
    changes = {
        name: value
        for name, value in values.items()
        if name not in kept
        and parameter_named(name).changes != READ_ONLY
        and (value != present.get(name) or name in _START)
    }
    for name, value in present.items():
        if name.startswith("ballast.") and name not in values and value[0] != 0.0:
            changes[name] = [0.0, *value[1:]]
    if changes.keys() & {"mass", "density"}:
        # Setting a density alone would take the mass away.
        changes |= {name: values[name] for name in ("mass", "density") if name in values}
    return changes
