# SPDX-License-Identifier: MIT
"""The page as a file that opens with a scene, or with any mesh that Python can read."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from ..base.bundled import body_names
from ..base.errors import InputError
from ..base.files import whole_file
from ..parameters.declarations import Parameters
from ..scene.scenario import BodyMesh, load_body_mesh, make_scenario
from ..scene.script import entry_of
from ..simulation.commands import Change, Command, MoveString, ThrusterCommand, TieString
from .bundle import built_page
from .data import LONGEST, is_of_page, page_values, page_version

FORM = 1
"""Version of the format of takes; page/src/take.ts has the same."""
SPIN = {"initial.angular_velocity": [0.05, 0.1, 3.0]}
"""Initial angular velocity of a mesh without a scene [rad/s], so that it moves."""
_PLACE = '<script type="application/gzip" id="take"></script>'
_BEGIN = '<meta name="begin" content="">'
"""Place for the fragment (#) that the page uses if its address has none."""


def write_page(
    file: str | Path, values: dict[str, Any] | None = None, script: Sequence[Command] = (), begins: str = ""
) -> None:
    """Write the page, which opens with a scene of these parameters and a script, or as with the fragment ``begins`` in
    its address (page/src/address.ts). Raises InputError.
    """
    page = page_text(values, script)
    if begins:
        if _BEGIN not in page:
            raise InputError("page", "the built page has no place for what it begins with")
        page = page.replace(_BEGIN, _BEGIN.replace('content=""', f'content="{escape(begins)}"'), 1)
    with whole_file("--html", file) as beside:
        beside.write_text(page, "utf-8")


def page_text(values: dict[str, Any] | None = None, script: Sequence[Command] = ()) -> str:
    """The page, which opens with a scene of these parameters and a script. Raises InputError."""
    page = built_page().read_text("utf-8")
    if values is None:
        return page
    take = base64.b64encode(gzip.compress(json.dumps(take_of(values, script)).encode(), 9, mtime=0)).decode()
    if _PLACE not in page:
        raise InputError("page", "the built page has no place for a scene")
    return page.replace(_PLACE, f"{_PLACE.partition('></')[0]}>{take}</script>")


def values_of_mesh(mesh: str) -> tuple[dict[str, Any], str]:
    """Parameters for a mesh without a scene, and a notice about them: millimetres are assumed for a large mesh, and a
    shell of 1 kg if the mesh bounds no solid. Raises InputError.
    """
    values: dict[str, Any] = {"mesh": mesh, **SPIN}
    notes = []
    body = load_body_mesh(Parameters().replaced(values))
    assert body is not None, mesh
    side = float(body.numbers["extent"].max())
    if side > LONGEST:
        values["scale"] = [0.001] * 3
        notes.append(f"its longest side of {side:.3g} is taken as millimetres")
    if body.moments.no_solid:
        values |= {"inertia_model": "shell", "mass": 1.0}
        notes.append(f"{body.moments.no_solid.partition('; use ')[0]}; it flies as a shell of 1 kg")
    return values, "; ".join(notes)


def take_of(values: dict[str, Any], script: Sequence[Command] = ()) -> dict[str, Any]:
    """A take with this scene and script, in the format of page/src/take.ts. Raises InputError."""
    scenario = make_scenario(values)
    ties = any(isinstance(command, TieString | MoveString) for command in script)
    used = page_values(_changed(scenario.parameters), with_hand=not ties)
    take: dict[str, Any] = {
        "form": FORM,
        "version": page_version(),
        "values": used,
        "script": [_entry(command) for command in script],
        "endNs": max((command.stamp_ns for command in script), default=0),
    }
    if scenario.body_mesh is not None and values.get("mesh", "t_handle") not in body_names():
        ending = "yaml" if scenario.body_mesh.mesh.parts else "obj"
        used["mesh"] = f"{scenario.body_mesh.mesh.name}.{ending}"
        take["mesh"] = mesh_numbers(scenario.body_mesh, used["mesh"])
    return take


def _entry(command: Command) -> dict[str, Any]:
    """The take's entry of a command. Raises InputError for a command that the page doesn't support."""
    if isinstance(command, ThrusterCommand):
        raise InputError("--script", "thrusters", "what the page can do: it has no thrusters")
    if isinstance(command, Change):
        unknown = [name for name in command.content if not is_of_page(name)]
        if unknown:
            raise InputError(
                "--script, set", unknown[0], "a parameter that the page has; others stay as they are there"
            )
    return {"t": command.stamp_ns / 1e9, **entry_of(command)}


def _changed(parameters: Parameters) -> dict[str, Any]:
    defaults = Parameters().named()
    return {name: value for name, value in parameters.named().items() if name == "mesh" or value != defaults.get(name)}


def mesh_numbers(body: BodyMesh, name: str) -> dict[str, Any]:
    """A mesh in a take. solid: its moments at unit density (mass/moments.py, MOMENTS), if it bounds a solid.
    volume: of a body of parts, whose ``solid`` has the parts' mass instead (mass/parts.py).
    """
    moments = body.moments
    mesh: dict[str, Any] = {
        "name": name,
        "vertices": _base64(moments.vertices, "<f8"),
        "triangles": _base64(moments.triangles, "<i4"),
    }
    if moments.polygon_starts is not None:
        mesh["starts"] = _base64(moments.polygon_starts, "<i4")
    try:
        mesh["solid"] = _base64(np.frombuffer(moments.moments("solid").record.tobytes()), "<f8")
    except InputError:
        pass  # its surface bounds no solid, as the page will find, too
    if body.volume is not None:
        mesh["volume"] = body.volume
    return mesh


def _base64(numbers: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(numbers, dtype=kind).tobytes()).decode()
