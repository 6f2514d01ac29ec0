# SPDX-License-Identifier: MIT
"""What went wrong in a node between two of its reports: what it was, and how many times."""

from __future__ import annotations

from collections.abc import Mapping

COUNTED = ("refused_total", "sequence_gaps", "queue_full", "overruns", "real_time_lost_s")
"""Keys of /diagnostics that only grow, and whose growth is a trouble."""


def troubles(before: Mapping[str, object], now: Mapping[str, object]) -> list[str]:
    """One phrase for each kind of trouble since the report ``before``, with its number."""
    said = serious_troubles(before, now)
    if late := round(grown("overruns", before, now)):
        said.append(f"{late} state{_s(late)} published late")
    if (lost_s := grown("real_time_lost_s", before, now)) > 0.0:
        said.append(f"{lost_s:.2g} s behind real time")
    return said


def serious_troubles(before: Mapping[str, object], now: Mapping[str, object]) -> list[str]:
    """Those by which the motion isn't what was asked for: commands refused, messages lost."""
    said = []
    if refused := round(grown("refused_total", before, now)):
        reasons = {
            key.removeprefix("refused_"): round(grown(key, before, now))
            for key in now
            if key.startswith("refused_") and key != "refused_total"
        }
        named = ", ".join(f"{reason} {count}" for reason, count in reasons.items() if count)
        said.append(f"{refused} command{_s(refused)} refused" + (f" ({named})" if named else ""))
    if lost := round(grown("sequence_gaps", before, now) + grown("queue_full", before, now)):
        said.append(f"{lost} message{_s(lost)} lost on the way")
    return said


def grown(key: str, before: Mapping[str, object], now: Mapping[str, object]) -> float:
    """By how much a counter has grown; one that fell is another node's, and began at 0."""
    past, present = (float(str(values.get(key, 0.0))) for values in (before, now))
    return present - past if present >= past else present


def _s(count: int) -> str:
    return "" if count == 1 else "s"
