# SPDX-License-Identifier: MIT
"""When a stamped command acts."""

from __future__ import annotations

from ..base.errors import CommandRefused

DAY_NS = 24 * 3600 * 1_000_000_000


def effective_time(stamp_ns: int, now_ns: int, wall_ns: int, horizon_ns: int) -> tuple[int, str]:
    """Simulated time [ns] at which a command with this stamp acts, and the counter it goes to, if any.

    Zero or past means now (past: ``late``); one up to the horizon ahead acts at exactly that time; one within a day of the
    system clock comes from a tool that stamps by it: it means now (``wall_stamp``). Raises CommandRefused (``stamp``).
    """
    if stamp_ns == 0:
        return now_ns, ""
    if stamp_ns <= now_ns:
        return now_ns, "late" if stamp_ns < now_ns else ""
    if stamp_ns <= now_ns + horizon_ns:
        return stamp_ns, ""
    if abs(stamp_ns - wall_ns) <= DAY_NS:
        return now_ns, "wall_stamp"
    raise CommandRefused(
        "stamp",
        "header.stamp",
        f"{stamp_ns / 1e9:.9g} s",
        f"0, or simulated time up to {horizon_ns / 1e9:g} s (schedule_horizon) after {now_ns / 1e9:.9g} s",
    )
