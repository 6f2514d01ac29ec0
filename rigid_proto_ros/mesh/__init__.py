# SPDX-License-Identifier: MIT
"""Meshes from files, and the topology and intersections of their surfaces."""
