# SPDX-License-Identifier: MIT
"""No command, option, parameter, topic, key, control or bundled file goes, or changes, without a word."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: no topics, services and executables to list")

from interface_list import interface_list

LIST = Path(__file__).parent / "interface.txt"


def test_the_names_that_users_rely_on_are_those_of_the_list() -> None:
    listed, now = set(LIST.read_text("utf-8").splitlines()), set(interface_list())
    assert not listed - now, "gone, or changed; where that is meant, write the list anew and say so in the changelog"
    assert not now - listed, "new: python tools/interface_list.py > test/interface.txt"
