# SPDX-License-Identifier: MIT
"""A torque-free body near its middle axis in the physics engines that npm has, ours beside them.

benchmarks/engines/engines.mjs flies it. Energy and angular momentum are computed here from attitudes and angular
velocities, as the engines return them, and the body's own moments. Where a ghost of the page is named after engines, its
own motion is flown too, and how far the attitudes come apart is measured.

    python benchmarks/engines.py
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from result_table import ResultTable
from rigid_proto_ros import __version__
from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.page.bundle import installed_node
from rigid_proto_ros.sweep.flights import Flight, load_scene

BODY = {"mass": 1.0, "moments": [0.3, 0.5, 0.7], "rotation": [0.0, 0.0, 0.0, 1.0], "omega": [0.01, 5.0, 0.01]}
"""rotation: of the principal axes, x y z w. omega [rad/s]: at the start."""
STEPS_NS = (16_666_667, 1_000_000)
"""1/60 s, as our parameter `step` rounds it, and 1 ms."""
DURATION_S, EVERY_S, BESIDE_S = 60.0, 0.05, 10.0
GHOSTS = {
    "no_gyroscopic_term": {"gyroscopic": False},
    "semi_implicit_euler": {"integrator": "semi_implicit_euler"},
}
"""Parameters of our own motions that are flown beside engines."""
FLOWN_BESIDE = {
    ("MuJoCo", "Euler, as it comes"): "semi_implicit_euler",
    ("Jolt", "as it comes"): "no_gyroscopic_term",
    ("Havok", "as it comes"): "no_gyroscopic_term",
    ("PhysX", "as it comes"): "no_gyroscopic_term",
    ("Bullet (ammo)", "as it comes"): "no_gyroscopic_term",
    ("cannon-es", "as it comes"): "no_gyroscopic_term",
}
COLUMNS = (
    "engine",
    "package",
    "version",
    "way",
    "step_s",
    "flips",
    "energy_change",
    "momentum_change",
    "momentum_turn_deg",
    "ghost",
    "ghost_apart_rad",
    "ghost_apart_10_s_rad",
    "why",
)
"""energy_change, momentum_change: at the end, of that at the start. momentum_turn_deg: the largest angle by which the angular momentum
has turned. ghost_apart_rad: the largest angle between the attitudes of the engine's body and the ghost's.
"""

MOMENTS = np.array(BODY["moments"])


def engines(body: dict, steps_s: list[float], duration_s: float, every_s: float) -> list[dict]:
    """What each way of each engine does with a body, by engines.mjs. Raises InputError without Node."""
    folder = HERE / "engines"
    node = installed_node(folder)
    asked = json.dumps({"body": body, "steps_s": steps_s, "duration_s": duration_s, "every_s": every_s})
    done = subprocess.run([node, folder / "engines.mjs"], input=asked, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


def ours(step_ns: int, settings: dict) -> np.ndarray:
    """The same states (n, 7) of our own body: attitude x y z w, and omega in world axes."""
    scene = load_scene(
        "t_handle",
        {
            "mesh": "",
            "inertia_model": "explicit",
            "explicit_inertia.mass": BODY["mass"],
            "explicit_inertia.center_of_mass": [0.0, 0.0, 0.0],
            "explicit_inertia.tensor": [MOMENTS[0], 0.0, 0.0, MOMENTS[1], 0.0, MOMENTS[2]],
            "initial.orientation_xyzw": [0.0, 0.0, 0.0, 1.0],
            "initial.angular_velocity": BODY["omega"],
            "gravity": [0.0, 0.0, 0.0],
            "step": step_ns * 1e-9,
            **settings,
        },
    )
    with Flight(scene) as flight:
        samples = [flight.sample()]
        for _ in range(round(DURATION_S / EVERY_S)):
            samples.append(flight.step(round(EVERY_S * 1e9 / step_ns) * step_ns * 1e-9))
    return np.array([[*one.orientation_xyzw, *one.angular_velocity] for one in samples])


def measures(states: np.ndarray) -> dict[str, float]:
    """Flips, energy and angular momentum of states (n, 7)."""
    turns = np.array([matrix_from_quaternion(q / np.linalg.norm(q)) for q in states[:, :4]])
    rates = np.einsum("nji,nj->ni", turns, states[:, 4:])
    momenta = np.einsum("nij,nj->ni", turns, MOMENTS * rates)
    energies, sizes = (MOMENTS * rates**2).sum(axis=1), np.linalg.norm(momenta, axis=1)
    directions = momenta / sizes[:, None]
    return {
        "flips": int((np.diff(np.sign(rates[:, 1])) != 0).sum()),
        "energy_change": energies[-1] / energies[0] - 1.0,
        "momentum_change": sizes[-1] / sizes[0] - 1.0,
        "momentum_turn_deg": float(np.degrees(_angles(directions - directions[0]).max())),
    }


def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles [rad] between attitudes."""
    p, q = (states[:, :4] / np.linalg.norm(states[:, :4], axis=1, keepdims=True) for states in (one, other))
    return 2.0 * np.minimum(_angles(p - q), _angles(p + q))


def _angles(chords: np.ndarray) -> np.ndarray:
    """Angles between unit vectors, of their differences (n, k)."""
    return 2.0 * np.arcsin(np.minimum(np.linalg.norm(chords, axis=1) / 2.0, 1.0))


def main() -> int:
    """Fly, measure and write the table; returns the exit status."""
    table = ResultTable(HERE / "results" / "engines.csv", COLUMNS)
    steps_s = [step_ns * 1e-9 for step_ns in STEPS_NS]
    own = {(name, step): ours(ns, GHOSTS[name]) for name in GHOSTS for ns, step in zip(STEPS_NS, steps_s, strict=True)}
    within = round(BESIDE_S / EVERY_S) + 1
    for row in engines(BODY, steps_s, DURATION_S, EVERY_S):
        kept = {name: row[name] for name in ("engine", "package", "version", "way", "step_s")} | {
            "why": row.get("why", "")
        }
        if "states" in row:
            states = np.array(row["states"])
            kept |= measures(states)
            ghost = FLOWN_BESIDE.get((row["engine"], row["way"]), "")
            kept["ghost"] = ghost
            if ghost:
                angles = apart(states, own[ghost, row["step_s"]])
                kept |= {"ghost_apart_rad": angles.max(), "ghost_apart_10_s_rad": angles[:within].max()}
        table.add(kept)
    of_ours = {"engine": "rigid_proto", "package": "rigid_proto", "version": __version__, "ghost": "", "why": ""}
    for ns, step_s in zip(STEPS_NS, steps_s, strict=True):
        flown = {"auto": ours(ns, {"integrator": "auto"})} | {name: own[name, step_s] for name in GHOSTS}
        for way, states in flown.items():
            table.add({**of_ours, "way": way, "step_s": step_s, **measures(states)})
    table.write()
    table.show()
    return 0


if __name__ == "__main__":
    sys.exit(main())
