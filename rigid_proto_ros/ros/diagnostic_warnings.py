# SPDX-License-Identifier: MIT
"""What a report on /diagnostics warns of: what went wrong since the report before, and how many times.

Without ROS, because the page says the same of the reports that it receives.
"""

from __future__ import annotations

from collections.abc import Mapping

COUNTED = ("refused_total", "sequence_gaps", "queue_full", "overruns", "real_time_lost_s")
"""Keys of /diagnostics that only grow, and whose growth is warned of."""


def warnings_since(before: Mapping[str, object], now: Mapping[str, object]) -> list[str]:
    """One phrase for each kind of trouble since the report ``before``, with its number."""
    warnings = command_warnings(before, now)
    if late := round(increase("overruns", before, now)):
        warnings.append(f"{late} state{_s(late)} published late")
    if (lost_s := increase("real_time_lost_s", before, now)) > 0.0:
        warnings.append(f"{lost_s:.2g} s behind real time")
    return warnings


def command_warnings(before: Mapping[str, object], now: Mapping[str, object]) -> list[str]:
    """Those by which the motion isn't what was asked for: commands refused, messages lost."""
    warnings = []
    if refused := round(increase("refused_total", before, now)):
        reasons = {
            key.removeprefix("refused_"): round(increase(key, before, now))
            for key in now
            if key.startswith("refused_") and key != "refused_total"
        }
        named = ", ".join(f"{reason} {count}" for reason, count in reasons.items() if count)
        warnings.append(f"{refused} command{_s(refused)} refused" + (f" ({named})" if named else ""))
    if lost := round(increase("sequence_gaps", before, now) + increase("queue_full", before, now)):
        warnings.append(f"{lost} message{_s(lost)} lost on the way")
    return warnings


def increase(key: str, before: Mapping[str, object], now: Mapping[str, object]) -> float:
    """By how much a counter rose; one that fell is another node's, and began at 0."""
    past, present = (float(str(values.get(key, 0.0))) for values in (before, now))
    return present - past if present >= past else present


def _s(count: int) -> str:
    return "" if count == 1 else "s"
