# SPDX-License-Identifier: MIT
"""Sweeps: many variations of a scene, measured into one table."""
