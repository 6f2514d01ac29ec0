# SPDX-License-Identifier: MIT
"""Motion, mass properties, rows of sweeps and elementary functions have the same bits on every machine.

Their hashes lie in test/golden_hashes.json, those of random scenes (test/random_scenes.py) in test/golden_scenes.json. Where numerics
change on purpose, ``PYTHONPATH=test python test/simulation/test_golden_hashes.py --write`` writes both anew, MOTION gets a new date,
and the changelog says why; without ``--write`` it compares, all or those whose names begin as said, which needs nothing of pytest:
tools/bits_elsewhere.py does so under other processors, compilers and versions. Of the random scenes it compares the chosen ones; with
the words ``"random scene"``, or more of a name, all those of that name. ``--show 17`` prints what comes of random scene 17, for a
comparison with what comes of it elsewhere or did before. What goes in is written down here in decimals or drawn by the package itself:
NumPy's normal numbers and LAPACK would differ from place to place.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import numpy as np
from random_scenes import random_scene
from scene_outcomes import flight_outcome, outcome, short_digest, text_of
from sweep_studies import PULLED, study

from rigid_proto_ros.base import arithmetic as el
from rigid_proto_ros.base.bundled import body_names, example_names, example_path, scene_names
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.base.provenance import MOTION
from rigid_proto_ros.mass.moments import MODELS, Moments
from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.mass.tensor import principal_axes
from rigid_proto_ros.mesh.reading import load_mesh
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.parameters.declarations import Parameters
from rigid_proto_ros.scene.lessons import lesson
from rigid_proto_ros.scene.scenario import make_scenario, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script, read_script
from rigid_proto_ros.scene.sensor_noise import imu_noise
from rigid_proto_ros.simulation.observer import EventLog
from rigid_proto_ros.simulation.simulation import Simulation
from rigid_proto_ros.sweep.rows import run_chunk
from rigid_proto_ros.sweep.sampling import row_uniforms

FILE = Path(__file__).parents[1] / "golden_hashes.json"
SCENES = Path(__file__).parents[1] / "golden_scenes.json"
SEEDS = 2000
"""Random scenes whose digests are kept."""
SECOND = 10**9

START = {
    "step": 0.002,
    "initial.orientation_xyzw": [0.1, -0.2, 0.3, 0.9],
    "initial.angular_velocity": [0.3, 5.0, -0.2],
    "initial.linear_velocity": [0.1, 0.2, 0.3],
}
POKES = """
- {t: 0.1, at: tip, force: [0.0, 0.01, 0.0], duration: 0.3}
- {t: 0.2, at: {vertex: 3}, impulse: [0.0, 0.0, 0.002]}
- {t: 0.25, at: left, push: 0.01, duration: 0.02}
- {t: 0.3, wrench: {at: com, torque: [0.0, 1.0e-4, 0.0], axes: body}}
- {t: 0.7, wrench: {force: [0.0, 0.0, 0.0]}}
- {t: 0.5, set: {density: 9000.0, gravity: [0.0, 0.0, -0.5], scale: 1.1}}
"""
STRING = """
- {t: 0.6, string: {attach: tip, target: [0.1, 0.0, 0.2]}}
- {t: 0.7, string: {target: [0.15, 0.05, 0.2]}}
- {t: 0.9, string: release}
"""
BODY_WRENCH = """
- {t: 0.2, at: com, impulse: [0.0, 0.0, 0.002], angular_impulse: [1.0e-5, 0.0, 2.0e-5]}
- {t: 0.3, wrench: {at: com, force: [0.0, 0.01, 0.0], torque: [0.0, 1.0e-4, 0.0], axes: body}}
- {t: 0.7, wrench: {force: [0.0, 0.0, 0.0]}}
"""
IMPULSES = "- {t: 0.2, at: tip, impulse: [0.0, 0.0, 0.002]}\n- {t: 0.5, set: {density: 9000.0}}\n"
JITTER = "- {t: 0.2, at: com, angular_impulse: [1.0e-5, 0.0, 0.0], repeat: 4, every: 0.1, jitter: 0.02, seed: 7}\n"
ROPE = {"string.attached": True, "string.attach": [0.0, 0.0, 0.07], "string.target": [0.0, 0.0, 0.4]}

# Scene's changes and script of flights by ``auto``; each takes another of its ways.
BY_AUTO = {
    "free": ({}, ""),
    "along the separatrix": (
        {"initial.orientation_xyzw": [0, 0, 0, 1], "initial.angular_velocity": [1e-9, 9.0, 0]},
        "",
    ),
    "jitter": ({}, JITTER),
    "pokes and string": ({}, POKES + STRING),
    "damping": ({"linear_damping": 0.3, "angular_damping": 1e-4}, POKES),
    "fast damping": ({"linear_damping": 1e4, "angular_damping": 1.0}, POKES),
    "fast spin under a weak load": ({"initial.angular_velocity": [300.0, 20.0, 5.0]}, BODY_WRENCH),
    "without the gyroscopic term": ({"gyroscopic": False}, POKES),
    "rope": ({**ROPE, "string.rest_length": 0.3, "gravity": [0.0, 0.0, -9.81]}, IMPULSES),
    "stiff rope": ({**ROPE, "string.frequency": 3e4, "string.rest_length": 0.3, "gravity": [0.0, 0.0, -9.81]}, ""),
    "stiff rod": ({**ROPE, "string.frequency": 1e3, "string.rest_length": 0.3, "string.bilateral": True}, POKES),
}

NOISY = {
    "noise.seed": 3,
    "noise.imu": [0.01, 0.0, 0.1, 0.0],
}

DRAWN = {
    **PULLED,
    "seed": 11,
    "samples": 4,
    "vary": {
        "mass": {"log_uniform": [0.1, 1.0]},
        "initial.orientation_xyzw": "random_rotation",
        "initial.angular_velocity.x": {"normal": [0, 1]},
        "string.stiffness": {"uniform": [1, 20]},
    },
}


def digest(*parts: object) -> str:
    """Of arrays by their bytes, of anything else by its text."""
    found = hashlib.sha256()
    for part in parts:
        # −0 counts as 0.
        found.update(
            (part + 0.0).tobytes() if isinstance(part, np.ndarray) and part.dtype == float else f"{part}".encode()
        )
    return found.hexdigest()[:16]


def flown(simulation: Simulation, until_ns: int) -> str:
    """Hash of the states at 8 times, the counts, and the chain of events."""
    found = []
    simulation.events = EventLog()  # chained, also without an observer
    for k in range(1, 9):
        state = simulation.advance(until_ns * k // 8)
        found.append(f"{state.sha256()} {(simulation.steps, simulation.force_evaluations, simulation.events.count)}")
    return digest(*found, simulation.events.sha256, simulation.failure)


def flight(changes: dict, *scripts: str) -> str:
    """The hash of a flight by the first of the scripts that its integrator supports."""
    scenario = read_scene("t_handle", warn=lambda line: None).with_changes({**START, **changes})
    for text in scripts[:-1]:
        try:
            return flown(OfflineRun(scenario, parse_script(text, "script")).simulation, SECOND)
        except InputError:
            pass
    return flown(OfflineRun(scenario, parse_script(scripts[-1], "script")).simulation, SECOND)


def mass_properties(body: MeshMoments) -> str:
    """The hash of all models, with a ballast and another scale."""
    found: list[object] = []
    for model in ("solid", "shell", "points", "bounding_box"):
        for changes in ({}, {"scale": (1.5, 0.5, -2.0), "ballast": [(0.1, 0.01, 0.02, 0.03)]}):
            properties = body.mass_properties(model, **changes)
            moments, axes = principal_axes(properties.inertia)
            found += [properties.mass, properties.center_of_mass, properties.inertia, moments, axes]
    return digest(*found)


def rounded_cube(n: int) -> MeshMoments:
    """A ball of 12 n² triangles: points of a cube's faces at distance 1 from its middle."""
    corners = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            for i in range(n):
                for j in range(n):
                    square = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                    points = [np.roll([side, 2.0 * a / n - 1.0, 2.0 * b / n - 1.0], axis) for a, b in square]
                    p, q, r, s = points if side > 0.0 else points[::-1]
                    corners += [p, q, r, p, r, s]
    vertices, triangles = np.unique(np.array(corners), axis=0, return_inverse=True)
    size = np.sqrt(vertices[:, 0] * vertices[:, 0] + vertices[:, 1] * vertices[:, 1] + vertices[:, 2] * vertices[:, 2])
    return MeshMoments(vertices / size[:, np.newaxis] + 100.0, triangles.reshape(-1, 3), name="rounded cube")


@cache
def arguments() -> tuple[np.ndarray, np.ndarray]:
    """Of elementary functions, (600,) each: of every size, and near 0."""
    u = row_uniforms(5, np.zeros(1, np.int64), 1200).reshape(2, 600)
    far = np.ldexp(u[0] + 0.5, (u[1] * 1800.0 - 900.0).astype(int))
    return far, np.ldexp(u[0] - 0.5, (u[1] * 60.0 - 50.0).astype(int))


OF_ONE = {
    "sine": (lambda x: el.sine_cosine(x)[0], 0),
    "cosine": (lambda x: el.sine_cosine(x)[1], 0),
    "inverse_tangent": (lambda x: el.inverse_tangent_of(x, 1.0), 0),
    "logarithm": (el.logarithm, 0),
    "exponential_of": (el.exponential_of, 1),
    "expm1": (el.expm1, 1),
}
"""Elementary functions of one argument, and which of ``arguments`` they are given."""


def function_of_one(name: str) -> str:
    """Hash of the values of an elementary function."""
    function, given = OF_ONE[name]
    return digest(np.array([function(x) for x in arguments()[given].tolist()]))


def angles() -> str:
    """Hash of the angles of points, all around."""
    far, near = arguments()
    pairs = zip(far.tolist(), far[::-1].tolist(), near.tolist(), strict=True)
    return digest(np.array([el.inverse_tangent_of(a if c > 0.0 else -a, b) for a, b, c in pairs]))


def mass_of(name: str) -> str:
    """Hash of a bundled body's mass properties."""
    mesh = load_mesh(name)
    return mass_properties(MeshMoments(mesh.vertices, mesh.triangles, name=name))


def numbers_of(moments: Moments) -> list[object]:
    """All that there is of moments."""
    return [moments.measure, moments.reference, moments.center, moments.center_low, moments.second]


def moments(body: MeshMoments) -> str:
    """The hash of the moments of all models, and of the shell's at other proportions."""
    found: list[object] = []
    for model in MODELS:
        found += numbers_of(body.moments(model))
    for scale in ((1.5, 0.5, -2.0), (1.0, 1.0, 3.0), (-1e-3, 2e-3, 1.7e-3), (7.0, 7.0, 7.0)):
        found += numbers_of(body.moments("shell", scale))
    return digest(*found)


def moments_of(name: str) -> str:
    """Hash of a bundled body's moments."""
    mesh = load_mesh(name)
    return moments(MeshMoments(mesh.vertices, mesh.triangles, mesh.polygon_starts, name=name))


def prism(height: float) -> MeshMoments:
    """An L of this height whose faces are polygons, concave ones among them: 20 triangles."""
    outline = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.1), (1.2, 1.1), (1.2, 2.3), (0.0, 2.3)]
    vertices = np.array([(x, y, z) for z in (0.1, 0.1 + height) for x, y in outline])
    polygons = [[5, 4, 3, 2, 1, 0], [6, 7, 8, 9, 10, 11], *([k, (k + 1) % 6, 6 + (k + 1) % 6, 6 + k] for k in range(6))]
    triangles = [[face[0], face[k], face[k + 1]] for face in polygons for k in range(1, len(face) - 1)]
    starts = np.cumsum([0, *(len(face) - 2 for face in polygons)])
    return MeshMoments(vertices, np.array(triangles), starts, name="prism")


def flattened(body: MeshMoments, thickness: float) -> MeshMoments:
    """The body as thin as this, relative to its width."""
    return MeshMoments((body.vertices - 100.0) * (1.0, 1.0, thickness), body.triangles, name="flat")


def bodies_by_hand() -> str:
    """The hash of bodies given in numbers, with ballast and another scale."""
    found: list[object] = []
    for tensor in ((1.0, 0.0, 0.0, 1.5, 0.0, 2.0), (1.1, 0.2, -0.3, 1.4, 0.1, 1.7), (1e-9, 0.0, 0.0, 1.0, 0.0, 1.0)):
        for ballast in (
            (),
            ((0.1, 0.01, 0.02, 0.03),),
            ((0.1, 0.01, 0.02, 0.03), (0.0, 1.0, 1.0, 1.0), (2.0, -0.5, 0.25, 7.0)),
        ):
            values: dict[str, object] = {
                "inertia_model": "explicit",
                "explicit_inertia.mass": 1.7,
                "scale": (1.5, 0.5, -2.0),
            }
            values |= {"explicit_inertia.center_of_mass": (0.01, -0.02, 0.3), "explicit_inertia.tensor": tensor}
            values |= {f"ballast.b{k}": list(point) for k, point in enumerate(ballast)}
            setup = make_scenario(values).setup
            found += [setup.body.row, setup.warnings]
    return digest(*found)


def scene_flown(name: str) -> str:
    """Hash of a bundled scene's first second."""
    return flown(OfflineRun(read_scene(name, warn=lambda line: None)).simulation, SECOND)


def scene_in_full(name: str) -> str:
    """Hash of a bundled scene's flight for as long as its lesson runs, without the lesson's script."""
    run = OfflineRun(read_scene(name, warn=lambda line: None))
    return digest(text_of(flight_outcome(run, round(lesson(name).duration_s * SECOND))))


EXAMPLE_SCENES = {
    "ballast_in_flight": "ballast_stops_flip",
    "com_or_rim": "com_or_rim",
    "weigh_at_com": "weigh_by_throwing",
    "weigh_by_throwing": "weigh_by_throwing",
    "wheel_spun_up": "flywheel",
}
"""The scenes that the examples are meant for, where it isn't the T-handle."""


def example_flown(name: str) -> str:
    """Hash of a bundled script's flight on its scene, from the beginning to 4 s after its last command."""
    script = read_script(example_path(name))
    run = OfflineRun(read_scene(EXAMPLE_SCENES.get(name, "t_handle"), warn=lambda line: None), script)
    return digest(text_of(flight_outcome(run, script[-1].stamp_ns + 4 * SECOND)))


def rows() -> str:
    """Hash of four rows of a sweep."""
    columns = run_chunk(study(DRAWN), 0, 4).columns
    return digest(*(column for name, column in sorted(columns.items())))


def noise() -> str:
    """Hash of what an IMU tells of a state, by white noise and bias."""
    imu = imu_noise(Parameters().replaced(NOISY))
    told = [imu.measured(k * 37_000_001, [-1.0, 0.5, 2.5], [1.0, 2.0, 3.0]) for k in range(40)]
    return digest(np.array(told))


def computations() -> dict[str, Callable[[], str]]:
    """What gives each hash, by name."""
    found: dict[str, Callable[[], str]] = {f"function {name}": partial(function_of_one, name) for name in OF_ONE}
    found["function inverse_tangent_of"] = angles
    found |= {f"mass of {name}": partial(mass_of, name) for name in sorted(body_names())}
    found["mass of 19200 triangles"] = lambda: mass_properties(rounded_cube(40))
    found["bodies given in numbers"] = bodies_by_hand
    found |= {f"moments of {name}": partial(moments_of, name) for name in sorted(body_names())}
    found["moments of 19200 triangles"] = lambda: moments(rounded_cube(40))
    found["moments of a thin body"] = lambda: moments(flattened(rounded_cube(6), 1e-7))
    found["moments of polygons"] = lambda: moments(prism(0.7))
    found["moments of a thin body of polygons"] = lambda: moments(prism(1e-6))
    found |= {f"scene {name}": partial(scene_flown, name) for name in sorted(scene_names())}
    found |= {f"whole scene {name}": partial(scene_in_full, name) for name in sorted(scene_names())}
    found |= {f"script {name}": partial(example_flown, name) for name in sorted(example_names())}
    for name in INTEGRATORS:
        found[f"by {name}"] = partial(flight, {"integrator": name}, POKES + STRING, POKES, BODY_WRENCH, IMPULSES)
    for name, (changes, script) in BY_AUTO.items():
        found[f"auto: {name}"] = partial(flight, changes, script or "[]")
    found["noise of the IMU"] = noise
    found["rows of a sweep"] = rows
    return found


CHOSEN = (
    *(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 15, 16, 17, 21, 25, 31),
    *(33, 34, 48, 52, 71, 95, 97, 101, 120, 121, 128, 143, 148, 160, 161, 171, 177, 181, 215, 227),
    *(237, 243, 253, 256, 287, 329, 341, 454, 521, 623, 749, 811, 813, 880, 962, 990, 1009, 1154, 1257, 1384),
)
"""Random scenes of the ordinary suite: every integrator, command, parameter and reason of a refusal occurs in them."""


def scene_digest(seed: int) -> str:
    """Digest of what comes of the random scene of this seed."""
    return short_digest(outcome(random_scene(seed)))


def golden_scenes() -> list[str]:
    """The digests of the file, by seed."""
    return json.loads(SCENES.read_text())["digests"]


def drawn_scenes() -> str:
    """The hash of the random scenes themselves, which no numerics change."""
    return digest(json.dumps([[scene.values, scene.script, scene.end_ns] for scene in map(random_scene, range(SEEDS))]))


def scene_computations(beginnings: tuple[str, ...] = ()) -> dict[str, Callable[[], str]]:
    """What gives the digests of the random scenes whose names begin so; without any, of the chosen ones."""
    named = {f"random scene {seed}": partial(scene_digest, seed) for seed in range(len(golden_scenes()))}
    chosen = {f"random scene {seed}" for seed in CHOSEN}
    return {
        name: compute
        for name, compute in named.items()
        if (name.startswith(beginnings) if beginnings else name in chosen)
    }


def golden() -> dict[str, str]:
    """The hashes of the file, by name."""
    return json.loads(FILE.read_text())["hashes"]


def test_the_bits_of_a_fixed_set_are_those_of_before() -> None:
    assert json.loads(FILE.read_text())["motion"] == MOTION
    assert {name: compute() for name, compute in computations().items()} == golden()


def write() -> None:
    """Write both files anew."""
    computed = {name: compute() for name, compute in computations().items()}
    digests = [scene_digest(seed) for seed in range(SEEDS)]
    others = any(computed.get(name) != value for name, value in golden().items())
    if drawn_scenes() == json.loads(SCENES.read_text())["drawn"]:
        others = others or digests != golden_scenes()
    if json.loads(FILE.read_text())["motion"] == MOTION and others:
        sys.exit("other bits: give MOTION in base/provenance.py a new date first (a letter behind it on the same day)")
    FILE.write_text(json.dumps({"motion": MOTION, "hashes": computed}, indent=1) + "\n")
    rows = [", ".join(f'"{one}"' for one in digests[k : k + 8]) for k in range(0, SEEDS, 8)]
    SCENES.write_text(
        f'{{"motion": "{MOTION}", "drawn": "{drawn_scenes()}", "digests": [\n' + ",\n".join(rows) + "\n]}\n"
    )


def compare(beginnings: tuple[str, ...]) -> int:
    """Compare the hashes whose names begin so, and say of each whether it is equal; how many aren't."""
    known, differ = golden(), []
    known |= {f"random scene {seed}": value for seed, value in enumerate(golden_scenes())}
    chosen = {name: compute for name, compute in computations().items() if name.startswith(beginnings or "")}
    chosen |= scene_computations(beginnings)
    for name, compute in chosen.items():
        equal = compute() == known.get(name)
        print(f"{'equal  ' if equal else 'DIFFERS'} {name}", flush=True)
        differ += [] if equal else [name]
    print(f"{len(chosen)} hashes, {len(differ)} differ{': ' if differ else ''}{', '.join(differ)}")
    return len(differ)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["--write"]:
            write()
        case ["--show", seed]:
            print(text_of(outcome(random_scene(int(seed)))))
        case beginnings:
            sys.exit(1 if compare(tuple(beginnings)) else 0)
