# SPDX-License-Identifier: MIT
"""From a line of the node's event log back to the command that acted."""

from __future__ import annotations

from ..core.commands import ClearWrench, Command, MoveString, ReleaseString, TieString, WrenchCommand
from ..core.frames import parse_frame
from ..scenario import Scenario


def heard_command(kind: str, content: dict, scenario: Scenario, node_name: str) -> Command | None:
    """The command of an event; None for marks, and for changes, whose outcome is heard as the scene.

    node_name: without its namespace; the body's frame is called so where no parameter names it. Raises InputError.
    """
    if kind == "string_attach":
        return TieString(content["axes"], _three(content["point"]))
    if kind == "string_target":
        return MoveString(_three(content["point"]))
    if kind == "string_release":
        return ReleaseString()
    if kind == "clear_wrench":
        return ClearWrench()
    if kind in ("wrench", "poke"):
        values = scenario.values
        names = (values["world_frame"], values["body_frame"] or node_name)
        frame = parse_frame(content["frame_id"], frozenset(scenario.setup.contacts), *names)
        force, torque = _three(content["force"]), _three(content["torque"])
        return WrenchCommand(kind == "wrench", frame, force, torque, 0, content["frame_id"], b"")
    return None


def _three(values) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
