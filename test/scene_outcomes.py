# SPDX-License-Identifier: MIT
"""What comes of a scene to the last bit, as text: for golden hashes, and to compare two of them line by line."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from typing import Any

from random_scenes import Scene

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.string import StringState
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import expand_script
from rigid_proto_ros.simulation.observer import EventLog
from rigid_proto_ros.simulation.simulation import Simulation

PARTS = 8
"""A flight is looked at so many times, evenly."""


def outcome(scene: Scene) -> dict[str, Any]:
    """What comes of a random scene: what refuses it, or how it flies."""
    try:
        run = OfflineRun(make_scenario(scene.values), expand_script(scene.script))
    except InputError as error:
        return {"refused at the start": f"{type(error).__name__}: {error}"}
    return flight_outcome(run, scene.end_ns)


def flight_outcome(run: OfflineRun, until_ns: int) -> dict[str, Any]:
    """How a run flies up to then. Floats are in hex, so that no digit is lost, and −0 counts as 0."""
    simulation, parts = run.simulation, []
    simulation.events = EventLog()  # chained, also without an observer
    for k in range(1, PARTS + 1):
        run.advance(until_ns * k // PARTS)
        counts = f"{simulation.steps} steps, {simulation.force_evaluations} evaluations"
        parts.append(f"{simulation.state.time_ns} ns: {simulation.state.sha256()} {counts}")
    return {"parts": parts, **at_end(simulation)}


def at_end(simulation: Simulation) -> dict[str, Any]:
    """What a simulation tells after its flight."""
    linear, angular = simulation.accelerations()
    return {
        "refused": {reason: [n, simulation.refusals[reason]] for reason, n in simulation.refused.items()},
        "failure": simulation.failure,
        "events": [simulation.events.count, simulation.events.sha256],
        "method": simulation.choice,
        "state": hex_of(simulation.state.row),
        "kinetic energy": hex_of([simulation.kinetic_energy]),
        "potential energy": hex_of([simulation.potential_energy]),
        "angular momentum": hex_of(simulation.angular_momentum),
        "accelerations": hex_of([*linear, *angular]),
        "floors": hex_of(simulation.floors),
        "string": string_lines(simulation.string),
        "hand's work": hex_of([simulation.hand_work]),
        "string's heat": hex_of([simulation.string_heat]),
    }


def string_lines(tied: StringState | None) -> dict[str, Any] | None:
    """The fields of a tied string."""
    if tied is None:
        return None
    return {
        **{name: hex_of(getattr(tied, name)) for name in ("attach", "origin", "target")},
        **{name: getattr(tied, name) for name in ("begin_ns", "end_ns", "last_target_ns", "release_ns", "bilateral")},
        **{
            name: hex_of([getattr(tied, name)])
            for name in ("effective_mass", "stiffness", "damping", "frequency", "rest_length")
        },
    }


def hex_of(numbers: Iterable[float]) -> str:
    """Numbers to the last bit."""
    return " ".join((float(number) + 0.0).hex() for number in numbers)


def text_of(found: dict[str, Any]) -> str:
    """An outcome as text to read."""
    return json.dumps(found, indent=1, ensure_ascii=False)


def short_digest(found: dict[str, Any]) -> str:
    """12 hex digits of an outcome."""
    return hashlib.sha256(text_of(found).encode()).hexdigest()[:12]
