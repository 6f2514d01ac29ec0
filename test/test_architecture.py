# SPDX-License-Identifier: MIT
"""docs/architecture.md holds: every file it names exists, and its doors are two files each."""

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
HEUN = """
'heun: two evaluations a step, order 2.'
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
"""

# The ellipsoid that touches the box from within: π/6 of its volume, a fifth of the squared half axes.
ELLIPSOID = """
    _box(lower, upper, found)
    if model == ELLIPSOID:
        found.measure *= math.pi / 6.0
        for k in range(6):
            found.second[k] *= math.pi / 10.0
"""

TRI = """
'Triangles as nine numbers a line (.tri).'
import numpy as np


def read_tri(data, name):
    points = np.array([line.split() for line in data.splitlines()], float).reshape(-1, 3)
    return points, np.arange(len(points)), np.arange(0, len(points) + 1, 3)
"""

LINES = """
'States as a JSON object a line.'
import json


def write_lines(file, columns):
    rows = zip(*(column.tolist() for column in columns.values()))
    with open(file, "w") as stream:
        stream.writelines(json.dumps(dict(zip(columns, row))) + chr(10) for row in rows)
"""

DOORS: dict[str, dict[str, str | dict[str, str]]] = {
    "an integrator": {
        "motion/integrators/heun.py": HEUN,
        "motion/__init__.py": {
            '    "rk4",\n': '    "rk4",\n    "heun",\n',
            "    from .integrators.lie": "    from .integrators.heun import HEUN\n    from .integrators.lie",
            "        RK4,\n": "        RK4,\n        HEUN,\n",
        },
    },
    "an inertia model": {
        "mass/__init__.py": {'"bounding_box", ': '"bounding_box", "ellipsoid", '},
        "mass/moments.py": {
            "POINTS, BOX = range(": "POINTS, BOX, ELLIPSOID = range(",
            "\n    _box(lower, upper, found)\n": ELLIPSOID,
        },
    },
    "a parameter": {
        "parameters/declarations.py": {
            "    linear_damping: float": '    wind: Vector = declare(ZERO, "Velocity of the air.", "m/s")\n    linear_damping: float'
        },
        "simulation/record.py": {'"linear_damping", ': '"wind", "linear_damping", '},
    },
    "a file format of a mesh": {
        "mesh/tri.py": TRI,
        "mesh/reading.py": {
            "from .threemf": "from .tri import read_tri\nfrom .threemf",
            '"stl": read_stl}': '"stl": read_stl, "tri": read_tri}',
        },
    },
    "a file format of the motion": {
        "export/lines.py": LINES,
        "cli/exports.py": {
            '    "gltf": Export(': '    "lines": Export((".jsonl",), "write the states, an object a line"),\n    "gltf": Export(',
            "        from ..export import table\n": "        from ..export import lines, table\n",
            '("parquet", table.write_parquet)': '("parquet", table.write_parquet), ("lines", lines.write_lines)',
            'TABLES = ("csv", "parquet")': 'TABLES = ("csv", "parquet", "lines")',
        },
    },
}
"""What the document names for each, beside tests and docs: a new file's text, or what stands where in a file."""

GO = """
import json
from pathlib import Path
import numpy as np
import docs_tables
from rigid_proto_ros.parameters import declarations
from rigid_proto_ros.base.errors import CommandRefused, InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.scenario import make_scenario

body = {"mesh": "", "inertia_model": "explicit", "explicit_inertia.tensor": [1.0, 0.0, 0.0, 2.0, 0.0, 3.0]}

def attitude(step):
    values = {**body, "integrator": "heun", "step": step, "initial.angular_velocity": [1.0, 2.0, 3.0]}
    run = OfflineRun(make_scenario(values))
    assert run.advance(1_000_000_000)
    return run.simulation.state.orientation_xyzw

def refusal(change):
    try:
        OfflineRun(make_scenario({**body, **change}))
    except (CommandRefused, InputError) as error:
        return str(error)

attitudes = [attitude(h) for h in (2e-3, 1e-3, 5e-4)]
changes = [float(np.abs(b - a).max()) for a, b in zip(attitudes, attitudes[1:])]

corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], float)
quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
faces = [corners[list(f)] for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
Path("box.tri").write_text(chr(10).join(" ".join(map(str, face.ravel())) for face in faces))
box = {"mesh": "box.tri", "mass": 20.0, "inertia_model": "ellipsoid", "ghost.inertia_model": "solid"}
flown = make_scenario(box)

arguments = ["simulate", "box.tri", "--set", "wind=[1, 2, 3]", "--set", "inertia_model=ellipsoid", "--duration", "0.02"]
assert main([*arguments, "--lines", "flight.jsonl"]) == 0
print(json.dumps({
    "changes": changes,
    "refused": [refusal({"integrator": "heun", "string.attached": True}), refusal({"wind": [0.0, 1e200, 0.0]})],
    "choices": [declarations.PARAMETERS[name].choices for name in ("integrator", "inertia_model")],
    "table": docs_tables.integrators(),
    "moments": flown.setup.body.inertia.diagonal().tolist(),
    "solid": flown.ghost.body.inertia.diagonal().tolist(),
    "wind": make_scenario({**box, "wind": [1.0, 2.0, 3.0]}).setup.scene.wind.tolist(),
    "states": [json.loads(line)["time"] for line in open("flight.jsonl")],
}))
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
def test_doors_are_two_files_each_and_lead_in(tmp_path: Path) -> None:
    """All at once, in a copy."""
    shutil.copytree(ROOT, tmp_path / ROOT.name, ignore=shutil.ignore_patterns("__pycache__"))
    for door, files in DOORS.items():
        assert len(files) <= 2, door
        for name, content in files.items():
            file = tmp_path / ROOT.name / name
            if isinstance(content, dict):
                text = file.read_text("utf-8")
                for old, new in content.items():
                    assert text.count(old) == 1, (name, old)
                    text = text.replace(old, new)
            else:
                assert not file.exists()
                text = content
            file.write_text(text, "utf-8")
    done = subprocess.run(
        [sys.executable, "-c", GO], cwd=tmp_path, env=_only(tmp_path), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    integrators, models = found["choices"]
    assert "heun" in integrators and "ellipsoid" in models and models[-1] == "explicit"
    assert "| `heun` | 2 | 2 |" in found["table"]
    of_string, of_wind = found["refused"]
    assert "heun" in of_string and "rk4" in of_string
    assert of_wind.startswith("wind")
    # Halving the step quarters what is still missing: order 2.
    first, second = found["changes"]
    assert 3.6 < first / second < 4.4
    # 20 kg within a box of 1 x 2 x 3 m: m/20 (b² + c²) of the ellipsoid, m/12 (b² + c²) of the box.
    assert found["moments"] == pytest.approx([13.0, 10.0, 5.0], rel=1e-14)
    assert found["solid"] == pytest.approx([13.0 / 0.6, 10.0 / 0.6, 5.0 / 0.6], rel=1e-14)
    assert found["wind"] == [1.0, 2.0, 3.0]
    assert found["states"] == [0.0, 0.01, 0.02]


def _only(folder: Path) -> dict[str, str]:
    """Nothing is built: the copy's whole library would be, and what is proven here doesn't depend on it."""
    path = os.pathsep.join([str(folder), str(ROOT.parent / "tools")])
    return {**os.environ, "PYTHONPATH": path, "RIGID_PROTO_KERNELS": "interpreted"}
