# SPDX-License-Identifier: MIT
"""The motion keeps its bits: states and event chains of a fixed set of flights, as they were when last looked at.

Where numerics change on purpose, ``PYTHONPATH=test python
test/simulation/test_golden_hashes.py`` writes the file anew; what changed is then said in the
changelog. Hashes hold for one type of processor and one set of versions, so a machine of another type skips.
"""

from __future__ import annotations

import hashlib
import json
import platform
from pathlib import Path

import numba
import numpy as np
import pytest
from flights import SECOND
from random_scenes import random_scene

from rigid_proto_ros.base.bundled import scene_names
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.simulation.simulation import Simulation

FILE = Path(__file__).parents[1] / "golden_hashes.json"
RANDOM_SCENES = 24
INTEGRATORS = ("auto", "auto", "auto", "rk4", "dop853", "discrete_gradient")


def flown(simulation: Simulation, until_ns: int) -> str:
    """Hash of the states at 8 times, the counts, and the chain of events."""
    digest = hashlib.sha256()
    for k in range(1, 9):
        state = simulation.advance(until_ns * k // 8)
        counts = (simulation.steps, simulation.force_evaluations, simulation.events.count)
        digest.update(f"{state.sha256()} {counts} {simulation.choice}\n".encode())
    digest.update(f"{simulation.events.sha256} {simulation.failure}".encode())
    return digest.hexdigest()[:16]


def hashes() -> dict[str, str]:
    found = {}
    for name in sorted(scene_names()):
        found[name] = flown(OfflineRun(read_scene(name, warn=lambda line: None)).simulation, SECOND)
    for seed in range(RANDOM_SCENES):
        integrator = INTEGRATORS[seed % len(INTEGRATORS)]
        found[f"random {seed} {integrator}"] = flown(random_scene(seed, integrator, step_s=2e-3), SECOND)
    return found


def machine() -> str:
    """What the bits hang on."""
    model = next(line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name"))
    return f"{model.split(':')[1].strip()}, {platform.machine()}, numpy {np.__version__}, numba {numba.__version__}"


def test_states_and_events_of_a_fixed_set_of_flights_are_those_of_before() -> None:
    golden = json.loads(FILE.read_text())
    if golden["machine"] != machine():
        pytest.skip(f"written on {golden['machine']}")
    now = hashes()
    changed = sorted(name for name in golden["hashes"] if now.get(name) != golden["hashes"][name])
    assert not changed, f"other bits: {', '.join(changed)}"
    assert set(now) == set(golden["hashes"])


if __name__ == "__main__":
    FILE.write_text(json.dumps({"machine": machine(), "hashes": hashes()}, indent=1) + "\n")
