# SPDX-License-Identifier: MIT
"""What the command lines have in common: examples that are read, and text for people."""

import importlib
import json
import shlex

import pytest

from rigid_proto_ros.base.command_line import Parser
from rigid_proto_ros.cli import main as command
from rigid_proto_ros.cli.inspect_report import shown_zero
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


def test_what_does_not_show_beside_the_rest_is_0_in_text_and_itself_in_json(capsys):
    assert shown_zero([1.0, -4e-7, 6e-7], 1.0) == [1.0, 0.0, 6e-7]
    assert command.main(["inspect", "hammer"]) == 0
    center = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("centre of mass"))
    assert center.split()[3:6] == ["0.00343475", "0", "0.237056"]
    assert command.main(["inspect", "hammer", "--json"]) == 0
    assert 0.0 < abs(json.loads(capsys.readouterr().out)["center_of_mass"][1]) < 1e-9
