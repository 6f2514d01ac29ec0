# SPDX-License-Identifier: MIT
"""What the command lines have in common: examples that are read, and progress of long work on a terminal alone."""

import importlib
import io
import shlex
import sys

import pytest

from rigid_proto_ros.base import command_line
from rigid_proto_ros.base.command_line import Parser, Progress
from rigid_proto_ros.cli import main as command
from rigid_proto_ros.ros import arguments, poke_client


@pytest.mark.parametrize("name", command.COMMANDS)
def test_examples_in_the_help_of_a_command_are_read_by_it(name, capsys):
    module = importlib.import_module(f"rigid_proto_ros.cli.{name}")
    parser = Parser(prog=f"rigid_proto {name}", examples=module.EXAMPLES)
    module.add_arguments(parser)
    for example, _ in module.EXAMPLES:
        program, own, *words = shlex.split(example)
        assert (program, own) == ("rigid_proto", name)
        parser.parse_args(words)
    with pytest.raises(SystemExit):
        command.main([name, "--help"])
    text = capsys.readouterr().out
    assert all(example in text for example, _ in module.EXAMPLES)


def test_examples_of_the_node_and_the_client_are_read_by_them():
    for example, _ in arguments.EXAMPLES:
        arguments.own_arguments(shlex.split(example))
    for example, _ in poke_client.EXAMPLES:
        poke_client._arguments(shlex.split(example)[1:])


@pytest.mark.parametrize("terminal", [True, False])
def test_short_work_shows_nothing_and_long_work_a_line_on_a_terminal_that_is_left_clean(terminal, monkeypatch) -> None:
    stream = io.StringIO()
    stream.isatty = lambda: terminal
    monkeypatch.setattr(sys, "stderr", stream)
    with Progress("short") as shown:
        shown.fraction(1, 2)
    assert stream.getvalue() == ("\r\033[K" if terminal else "")
    monkeypatch.setattr(command_line, "FIRST_S", 0.0)
    with Progress("long") as shown:
        shown.fraction(200, 500)
    assert ("long: 40 %, 0 s" in stream.getvalue()) == terminal
    assert stream.getvalue().endswith("\r\033[K") if terminal else stream.getvalue() == ""
