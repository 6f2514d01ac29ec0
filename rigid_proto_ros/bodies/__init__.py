# SPDX-License-Identifier: MIT
"""Bundled bodies: closed .obj solids in metres, and their generator (``python -m rigid_proto_ros.bodies``)."""
