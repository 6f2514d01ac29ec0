# SPDX-License-Identifier: MIT
"""Recorded flights: writing, reading, verification, replay and branching."""
