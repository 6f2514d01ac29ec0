# SPDX-License-Identifier: MIT
"""Commands in, motion out: segments, the event log, what observers are told, and many flights in one compiled call."""
