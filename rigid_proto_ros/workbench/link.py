# SPDX-License-Identifier: MIT
"""A scene and a script as one line that a URL can carry, and back.

    1.<base64url of raw deflate of JSON {"scene": {parameter: value}, "script": [entry, ...]}>

JSON and not YAML inside: it has no references that unfold. What comes out is bounded in size, in depth and in the
number of commands, and is refused where it names a file: a link opened here must neither read nor write here.
"""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from collections.abc import Mapping
from typing import Any

from ..base.bundled import body_names
from ..base.errors import InputError
from ..scene.parameters import PARAMETERS, convert_all
from ..scene.scenario import scene_text
from ..scene.scene_file import read_scene_text
from ..scene.script import expand_script
from ..scene.yaml_text import flow, load_plain_yaml
from .save_as_script import NOT_OF_THE_MOTION

VERSION = "1"

MAX_LINK = 64_000
"""Characters of a link; browsers take this much behind a #, chat programs less."""

MAX_DECODED = 1_000_000
"""Bytes of JSON inside, more than a link of this length holds of a hand's doings."""

MAX_COMMANDS = 20_000
"""That a link's script may expand to: reading them takes a second or two."""


def encode(scene: str, script: str = "") -> str:
    """The link of a scene (parameter-file text) and a poke script (YAML text).

    Raises InputError for what can't be read, for a mesh that is a file, and for more than a link carries.
    """
    values = {
        name: value
        for name, value in convert_all(read_scene_text(scene).values).items()
        if name not in NOT_OF_THE_MOTION and (name not in PARAMETERS or value != PARAMETERS[name].default)
    }
    if len(zlib.compress(script.encode(), 1)) > MAX_LINK:
        # It won't fit, and reading it takes a second for every thousand entries.
        raise _too_long(f"a script of {len(script)} characters")
    entries = load_plain_yaml(script, "script")
    _check(values, entries)
    text = json.dumps({"scene": values, "script": entries or []}, separators=(",", ":"), allow_nan=False).encode()
    if len(text) > MAX_DECODED:
        raise InputError("link", f"scene and script have {len(text)} bytes; a link holds at most {MAX_DECODED}")
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    packed = packer.compress(text) + packer.flush()
    link = f"{VERSION}.{base64.urlsafe_b64encode(packed).decode().rstrip('=')}"
    if len(link) > MAX_LINK:
        raise _too_long(f"{len(link)} characters")
    return link


def _too_long(received: str) -> InputError:
    return InputError("link", received, f"a link of at most {MAX_LINK} characters; save a longer script as a file")


def decode(link: str) -> tuple[str, str]:
    """Scene and script of a link, or of the address that it stands in, as texts; raises InputError."""
    link = link.rpartition("?")[2].strip()
    if len(link) > MAX_LINK:
        raise InputError("link", f"the link has {len(link)} characters; at most {MAX_LINK} are accepted")
    version, dot, payload = link.partition(".")
    if not dot or version != VERSION:
        raise InputError("link", link[:40], f"a link made here, beginning with {VERSION}.")
    content = _unpacked(payload)
    if not isinstance(content, dict) or content.keys() != {"scene", "script"} or not isinstance(content["scene"], dict):
        raise _damaged("its content")
    values, entries = content["scene"], content["script"]
    try:
        values = convert_all(values)
        _check(values, entries)
    except RecursionError:
        raise _damaged("its nesting") from None
    listed = entries["script"] if isinstance(entries, dict) else entries
    lines = "".join(f"- {flow(entry)}\n" for entry in listed or [])
    if isinstance(entries, dict):
        head = "".join(f"{key}: {flow(value)}\n" for key, value in entries.items() if key != "script")
        lines = f"{head}script:\n{lines}"
    return scene_text(values), lines


def _unpacked(payload: str) -> Any:
    try:
        packed = base64.b64decode(payload + "=" * (-len(payload) % 4), altchars=b"-_", validate=True)
    except (binascii.Error, ValueError):
        raise _damaged("its letters") from None
    unpacker = zlib.decompressobj(-zlib.MAX_WBITS)
    try:
        text = unpacker.decompress(packed, MAX_DECODED)
    except zlib.error:
        raise _damaged("its compression") from None
    if unpacker.unconsumed_tail:
        raise InputError("link", f"the link holds more than {MAX_DECODED} bytes")
    if not unpacker.eof or unpacker.unused_data:
        raise _damaged("its end")
    try:
        return json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError):
        raise _damaged("its text") from None


def _damaged(what: str) -> InputError:
    return InputError("link", f"the link is damaged ({what})")


def _check(values: Mapping[str, object], entries: Any) -> None:
    """Whether a link may carry it: nothing but bundled meshes, no files, a script that can be read."""
    _check_parameters(values, "scene")
    expand_script(entries, "script", max_commands=MAX_COMMANDS)
    listed = entries.get("script") if isinstance(entries, dict) else entries
    for entry in listed or []:
        if isinstance(entry.get("set"), dict):
            _check_parameters(convert_all(entry["set"]), "script, set")


def _check_parameters(values: Mapping[str, object], where: str) -> None:
    for name in sorted(NOT_OF_THE_MOTION & values.keys()):
        raise InputError(
            f"{where}, {name}", values[name], "parameters of the motion; a link can't set those of the program"
        )
    mesh = values.get("mesh", "")
    if mesh and mesh not in body_names():
        raise InputError(f"{where}, mesh", mesh, f"a bundled body: {', '.join(body_names())}")
