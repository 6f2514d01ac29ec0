# SPDX-License-Identifier: MIT
"""Meshes from files, their cache, and the topology of their surfaces."""
