# SPDX-License-Identifier: MIT
"""The page as a file that begins with a scene, or with any mesh that Python reads."""

from __future__ import annotations

import base64
import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..base.bundled import body_names
from ..base.errors import InputError
from ..base.files import whole_file
from ..parameters.declarations import Parameters
from ..scene.scenario import BodyMesh, make_scenario
from .bundle import built_page
from .data import page_values

FORM = 1
"""Of a take in a file or link; page/src/take.ts has the same."""
_PLACE = '<script type="application/gzip" id="take"></script>'


def write_page(file: str | Path, values: dict[str, Any] | None = None) -> None:
    """Write the page, to begin with a scene of these parameters, by name. Raises InputError."""
    page = built_page().read_text("utf-8")
    if values is not None:
        take = base64.b64encode(gzip.compress(json.dumps(take_of(values)).encode(), 9, mtime=0)).decode()
        if _PLACE not in page:
            raise InputError("page", "the built page has no place for a scene")
        page = page.replace(_PLACE, f"{_PLACE.partition('></')[0]}>{take}</script>")
    with whole_file("--html", file) as beside:
        beside.write_text(page, "utf-8")


def take_of(values: dict[str, Any]) -> dict[str, Any]:
    """A take in which nothing was done yet, as page/src/take.ts reads it. Raises InputError."""
    scenario = make_scenario(values)
    used = page_values(_changed(scenario.parameters))
    take: dict[str, Any] = {"form": FORM, "version": __version__, "values": used, "script": [], "endNs": 0}
    if scenario.body_mesh is not None and values.get("mesh", "t_handle") not in body_names():
        used["mesh"] = f"{scenario.body_mesh.mesh.name}.obj"
        take["mesh"] = _mesh_of(scenario.body_mesh, used["mesh"])
    return take


def _changed(parameters: Parameters) -> dict[str, Any]:
    defaults = Parameters().named()
    return {name: value for name, value in parameters.named().items() if name == "mesh" or value != defaults.get(name)}


def _mesh_of(body: BodyMesh, name: str) -> dict[str, Any]:
    """The numbers of a mesh. solid: its moments at unit density (mass/moments.py, MOMENTS), where Python has them."""
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
        pass  # its surface bounds none, as the page will find, too
    return mesh


def _base64(numbers: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(numbers, dtype=kind).tobytes()).decode()
