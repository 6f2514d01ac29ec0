# SPDX-License-Identifier: MIT
"""docs/architecture.md holds: every file it names exists, and its steps for adding an integrator add one."""

from __future__ import annotations

import fnmatch
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import rigid_proto_ros

ROOT = Path(rigid_proto_ros.__file__).resolve().parent
DOCUMENT = ROOT.parent / "docs" / "architecture.md"
pytestmark = pytest.mark.skipif(not DOCUMENT.is_file(), reason="not run from a source tree")

# Heun's method of order 2 on the tableau's own machinery: no stops at a slack string, so it carries none.
HEUN = '''
"""heun: two evaluations a step, order 2."""
import numpy as np

from ..loads import ANGULAR_DAMPING, NO_GYROSCOPIC_TERM
from .integrator import LOADS, Integrator
from .runge_kutta import explicit


heun_steps = explicit(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.5]]))

HEUN = Integrator(
    name="heun",
    order=2,
    evaluations=2,
    source="Heun 1900",
    limits="Explicit.",
    stability_limit=1.0,
    supports=LOADS | {ANGULAR_DAMPING, NO_GYROSCOPIC_TERM},
    kernel=heun_steps,
)
'''

FLY = """
import json
import numpy as np
import docs_tables
from rigid_proto_ros.parameters import declarations
from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.scenario import make_scenario

body = {"mesh": "", "inertia_model": "explicit", "explicit_inertia.tensor": [1.0, 0.0, 0.0, 2.0, 0.0, 3.0]}

def attitude(step):
    values = {**body, "integrator": "heun", "step": step, "initial.angular_velocity": [1.0, 2.0, 3.0]}
    run = OfflineRun(make_scenario(values))
    assert run.advance(1_000_000_000)
    return run.simulation.state.orientation_xyzw

attitudes = [attitude(h) for h in (2e-3, 1e-3, 5e-4)]
changes = [float(np.abs(b - a).max()) for a, b in zip(attitudes, attitudes[1:])]
try:
    OfflineRun(make_scenario({**body, "integrator": "heun", "string.attached": True}))
    refusal = ""
except CommandRefused as error:
    refusal = str(error)
choices = declarations.PARAMETERS["integrator"].choices
print(json.dumps({"changes": changes, "refusal": refusal, "choices": choices, "table": docs_tables.integrators()}))
"""


def named_files() -> list[str]:
    """Patterns of file names in code marks, such as ``moments*.py``."""
    return re.findall(r"([\w*]+\.py)\b", DOCUMENT.read_text("utf-8"))


def test_every_named_file_exists() -> None:
    existing = {
        path.name for path in [*ROOT.rglob("*.py"), *ROOT.parent.glob("test/**/*.py"), *ROOT.parent.glob("tools/*.py")]
    }
    for pattern in named_files():
        assert fnmatch.filter(existing, pattern), pattern


@pytest.mark.slow
def test_the_steps_for_an_integrator_add_one(tmp_path: Path) -> None:
    shutil.copytree(ROOT, tmp_path / ROOT.name, ignore=shutil.ignore_patterns("__pycache__"))
    folder = tmp_path / ROOT.name / "motion" / "integrators"
    (folder / "heun.py").write_text(HEUN, "utf-8")
    changes = {
        folder.parent / "__init__.py": {'    "rk4",\n': '    "rk4",\n    "heun",\n'},
        folder / "__init__.py": {
            "from .integrator import": "from .heun import HEUN\nfrom .integrator import",
            "        RK4,\n": "        RK4,\n        HEUN,\n",
        },
    }
    for file, replaced in changes.items():
        text = file.read_text("utf-8")
        for old, new in replaced.items():
            assert text.count(old) == 1, (file, old)
            text = text.replace(old, new)
        file.write_text(text, "utf-8")
    done = subprocess.run(
        [sys.executable, "-c", FLY], cwd=tmp_path, env=_only(tmp_path), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert "heun" in found["choices"]
    assert "| `heun` | 2 | 2 |" in found["table"]
    assert "heun" in found["refusal"] and "rk4" in found["refusal"]
    # Halving the step quarters what is still missing: order 2.
    first, second = found["changes"]
    assert 3.6 < first / second < 4.4


def _only(folder: Path) -> dict[str, str]:
    """Nothing is built: the copy's whole library would be, and what is proven here doesn't depend on it."""
    path = os.pathsep.join([str(folder), str(ROOT.parent / "tools")])
    return {**os.environ, "PYTHONPATH": path, "RIGID_PROTO_KERNELS": "interpreted"}
