# SPDX-License-Identifier: MIT
"""Recorded flights: written, read, verified, replayed and branched."""
