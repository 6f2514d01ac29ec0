# SPDX-License-Identifier: MIT
"""What the command lines have in common: examples that are read."""

import importlib
import shlex

import pytest

from rigid_proto_ros.base.command_line import Parser
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
