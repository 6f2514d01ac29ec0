# SPDX-License-Identifier: MIT
"""A sorted list of every name that users and their scripts rely on, one a line: commands and options, parameters, topics and
services, keys of JSON objects, diagnostics and scripts, controls of the page, bundled files.

    python tools/interface_list.py > test/interface.txt

test/test_interface_list.py compares; a line that goes, or changes, is a promise broken.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import node_interface
from rigid_proto_ros.base import bundled
from rigid_proto_ros.cli import main as cli
from rigid_proto_ros.parameters import declarations
from rigid_proto_ros.ros import diagnostics, poke_client
from rigid_proto_ros.ros.arguments import own_arguments
from rigid_proto_ros.scene import script

OPTION = re.compile(r"^  (-\S+(?: \S+)*)", re.MULTILINE)
POSITIONAL = re.compile(r"^positional arguments:\n((?:  .*\n)+)", re.MULTILINE)
PATIENCE_S = 60.0


def printed(main: Callable[[list[str]], object], *arguments: str) -> str:
    """What a command prints on stdout, also where it ends the process."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        main(list(arguments))
    return text.getvalue()


def commands() -> Iterator[str]:
    """Commands with their arguments and options, as --help shows them."""
    helps = {f"rigid_proto {name}": printed(cli.main, name, "--help") for name in cli.COMMANDS}
    helps["poke_client"] = printed(poke_client.main, "--help")
    helps["rigid_body_node"] = printed(own_arguments, "rigid_body_node", "--help")
    for command, text in helps.items():
        yield f"command {command}"
        for found in POSITIONAL.findall(text):
            for line in re.findall(r"^  (\S+)", found, re.MULTILINE):
                yield f"argument {command} {line}"
        for option in OPTION.findall(text):
            # The value after the last name alone, as Python 3.13 and later write it.
            yield f"option {command} {re.sub(r' [^ ,-]+, -', ', -', option)}"


def declared_parameters() -> Iterator[str]:
    """Parameters with type, default, bounds and when they may change."""
    for parameter in (*declarations.PARAMETERS.values(), *declarations.PATTERNS.values()):
        default = json.dumps(parameter.default)
        yield f"parameter {parameter.name}: {parameter.type}, {default}; {parameter.accepted}; {parameter.changes}"


def topics_and_services() -> Iterator[str]:
    """Topics, services and the keys of /diagnostics that count refusals."""
    for interface in node_interface.INTERFACES:
        on_request = f", on {interface.on_request}" if interface.on_request else ""
        yield f"{interface.direction} {interface.name} {interface.type}{on_request}"
    for reason in diagnostics.REFUSAL_REASONS:
        yield f"diagnostics refused_{reason}"


def script_keys() -> Iterator[str]:
    """Keys of the entries of a script."""
    yield from (f"script {key}" for key in sorted(script.ENTRY_KEYS))


def json_keys() -> Iterator[str]:
    """Keys of what --json prints."""
    inspected = json.loads(printed(cli.main, "inspect", "hammer", "--verify", "--json"))
    simulated = json.loads(printed(cli.main, "simulate", "t_handle", "--duration", "0.01", "--json"))
    for command, found in (("inspect", inspected), ("simulate", simulated)):
        for key, value in found.items():
            yield f"json {command} {key}"
            if isinstance(value, dict):
                for inner, part in value.items():
                    yield f"json {command} {key}.{inner}"
                    for innermost in part if isinstance(part, dict) else ():
                        yield f"json {command} {key}.{inner}.{innermost}"


def bundled_files() -> Iterator[str]:
    """Names of bundled bodies, scenes, studies and examples."""
    for kind, names in (
        ("body", bundled.body_names()),
        ("scene", bundled.scene_names()),
        ("study", bundled.study_names()),
        ("example", bundled.example_names()),
    ):
        for name in names:
            yield f"{kind} {name}"


def page_words() -> Iterator[str]:
    """Names of the page's cards and of what stands in its first screen, as its English catalogue has them."""
    text = (Path(__file__).resolve().parent.parent / "page" / "src" / "words.ts").read_text("utf-8")
    for group in ("cards", "hand", "tensor"):
        found = re.search(rf"^  {group}: {{(.*?)}},\n(?=  \w+: )", text, re.MULTILINE | re.DOTALL)
        assert found, group
        yield from (f"page {group} {name}" for name in re.findall(r'\b\w+: "([^"]+)"', found[1]))


def interface_list() -> list[str]:
    """Every line, sorted."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(Path(folder)):
        parts = (
            commands,
            declared_parameters,
            topics_and_services,
            script_keys,
            json_keys,
            bundled_files,
            page_words,
        )
        return sorted({line for part in parts for line in part()})


if __name__ == "__main__":
    print("\n".join(interface_list()))
