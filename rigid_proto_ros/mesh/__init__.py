# SPDX-License-Identifier: MIT
"""Meshes from files, and the topology and intersections of their surfaces."""

INFILL = 0.2
"""Density within the walls of a printed part, relative to theirs, where none is given: what slicers begin with."""
