# SPDX-License-Identifier: MIT
"""How it stands with one body: counters, energies, and what went wrong since the report before."""

from __future__ import annotations

from collections.abc import Mapping

from .command_receiver import TOPICS
from .live_simulation import LiveSimulation

REFUSAL_REASONS = (
    *("frame", "nonfinite", "magnitude", "stamp", "ray_miss"),
    *("tensor", "integrator", "schedule", "thrusters", "state"),
)

COUNTED = ("refused_total", "messages_lost", "queue_full", "overruns", "real_time_lost_s")
"""Keys of /diagnostics that only grow, and whose growth is warned of."""


def report(live: LiveSimulation) -> dict[str, object]:
    """Counters and values by the keys of /diagnostics; from any thread."""
    loop = live.loop
    commands, simulation, timekeeping = loop.commands, loop.simulation, loop.timekeeping
    # First: whatever happened up to then is counted in what follows.
    time_ns = simulation.time_ns
    momentum = simulation.angular_momentum
    # Counted last by the physics thread, so read first: who finds a message received finds its refusal too.
    received = dict(commands.received)
    refused = dict(simulation.refused)
    return {
        "sim_time_ns": time_ns,
        "stamp_offset_ns": loop.stamps.offset_ns,
        "publish_rate": loop.scenario.parameters.publish_rate,
        "overruns": timekeeping.overruns,
        "real_time_lost_s": timekeeping.real_time_lost_s,
        **{f"{topic}_received": received.get(topic, 0) for topic in TOPICS},
        "commands_received": sum(received.values()),
        "refused_total": sum(refused.values()),
        **{f"refused_{reason}": refused.get(reason, 0) for reason in REFUSAL_REASONS},
        "late": commands.late,
        "wall_stamp": commands.wall_stamp,
        "messages_lost": live.endpoints.messages_lost,
        "queue_full": live.endpoints.queue_full,
        "kinetic_energy": simulation.kinetic_energy,
        "potential_energy": simulation.potential_energy,
        "angular_momentum_norm": float((momentum * momentum).sum()) ** 0.5,
        "angular_momentum_drift": simulation.angular_momentum_drift,
        "integrator": simulation.setup.integrator.name,
        "integrator_choice": simulation.choice,
        "accuracy_floor": simulation.accuracy_floor,
        "steps": simulation.steps,
        "force_evaluations": simulation.force_evaluations,
        "state": "paused" if timekeeping.paused else "sleeping" if simulation.at_rest else "flying",
        "recording": loop.scenario.parameters.record,
        "warning": simulation.failure or live.observers.recording_trouble or simulation.too_coarse,
    }


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
    if lost := round(increase("messages_lost", before, now)):
        warnings.append(f"{lost} message{_s(lost)} lost on the way")
    if increase("queue_full", before, now):
        warnings.append("messages may have been lost: a queue of commands was full")
    return warnings


def increase(key: str, before: Mapping[str, object], now: Mapping[str, object]) -> float:
    """By how much a counter rose; one that fell is another node's, and began at 0."""
    past, present = (float(str(values.get(key, 0.0))) for values in (before, now))
    return present - past if present >= past else present


def _s(count: int) -> str:
    return "" if count == 1 else "s"
