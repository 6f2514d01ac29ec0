# SPDX-License-Identifier: MIT
"""Bundled bodies: closed .obj solids in metres, written by tools/bundled_bodies."""
