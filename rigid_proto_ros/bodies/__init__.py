# SPDX-License-Identifier: MIT
"""Bundled bodies: closed .obj solids in metres, and the generator that writes them (``python -m rigid_proto_ros.bodies``)."""
