# SPDX-License-Identifier: MIT
"""What a command is to a flight, as its tables hold it; without numba, which who only sends commands has no use for."""

NO_SLOT, UNNAMED_SLOT = 0, 1
HELD_WRENCH, PULSE, IMPULSE, CLEAR = range(4)
"""Kinds of commands."""
