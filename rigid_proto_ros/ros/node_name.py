# SPDX-License-Identifier: MIT
"""The node's name as ROS arguments remap it, known before rclpy starts."""

from __future__ import annotations

NODE_NAME = "rigid_body"


def remapped_node_name(argv: list[str], name: str = NODE_NAME) -> str:
    """The name after ``-r __node:=name`` (also ``--remap``, ``__name``); the last one counts."""
    for option, value in zip(argv, argv[1:], strict=False):
        if option in ("-r", "--remap"):
            left, assigned, right = value.partition(":=")
            if assigned and left.rpartition(":")[2] in ("__node", "__name"):
                name = right
    return name
