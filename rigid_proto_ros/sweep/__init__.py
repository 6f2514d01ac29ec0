# SPDX-License-Identifier: MIT
"""Sweeps: many variations of one scene, measured into one table."""
