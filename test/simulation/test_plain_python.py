# SPDX-License-Identifier: MIT
"""Uncompiled (RIGID_PROTO_KERNELS=interpreted) everything flies in plain Python: slowly, but with tracebacks that can be read."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script

TESTS = Path(__file__).parents[1]
BODY = {
    "mesh": "t_handle",
    "initial.angular_velocity": [0.1, 5.0, 0.2],
    "initial.linear_velocity": [0.1, 0.0, 2.0],
    "step": 0.01,
    "accuracy": 1e-6,
}
STRING = {
    "string.attached": True,
    "string.target": [0.0, 0.0, 0.5],
    "string.attach": [0.1, 0.0, 0.0],
    "string.rest_length": 0.3,
}
SCENES = {
    **{name: {"integrator": name} for name in INTEGRATORS},
    "a wrench, gravity and damping": {"gravity": [0.0, 0.0, -9.81], "linear_damping": 0.1, "angular_damping": 1e-4},
    "a string under auto": {"gravity": [0.0, 0.0, -9.81], **STRING},
    "a string under rk4": {"integrator": "rk4", **STRING},
}
WRENCH = "[{t: 0.02, wrench: {at: com, force: [0.1, 0, 0], torque: [0, 0.01, 0], axes: body, duration: 0.05}}]"


def flown() -> dict[str, list[float]]:
    """The last state of each scene by name."""
    rows = {}
    for name, changes in SCENES.items():
        commands = parse_script(WRENCH) if name.startswith("a wrench") else []
        run = OfflineRun(make_scenario({**BODY, **changes}), commands)
        rows[name] = run.simulation.advance(50_000_000).row.tolist()
    return rows


def test_every_integrator_and_method_of_auto_and_the_command_fly_alike_in_plain_python() -> None:
    code = """
import sys; sys.path[:0] = ['.', 'simulation']
import json, test_plain_python as t
from rigid_proto_ros.cli.main import main
print(json.dumps(t.flown()))
main(['simulate', 't_handle', '--duration', '0.02', '--json'])
"""
    ran = subprocess.run(
        [sys.executable, "-c", code],
        cwd=TESTS,
        env={**os.environ, "RIGID_PROTO_KERNELS": "interpreted"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout[-4000:] + ran.stderr[-4000:]
    plain, told = map(json.loads, ran.stdout.splitlines()[-2:])
    assert told["time_ns"] == 20_000_000
    compiled = flown()
    assert plain.keys() == compiled.keys()
    for name, row in compiled.items():
        # Sums of more than two numbers may be taken in another order there.
        assert plain[name] == pytest.approx(row, rel=1e-11, abs=1e-11), name
