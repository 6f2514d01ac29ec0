# SPDX-License-Identifier: MIT
"""Mass properties in physics engines: what each computes of a mesh by itself, and whether it takes what
``rigid_proto inspect --for`` prints, ``--mjcf`` and ``--urdf`` for MuJoCo and Bullet, and a flight's .glb.

benchmarks/engines/inertia.mjs asks the engines that npm has, MuJoCo and Bullet of PyPI are asked here. A body of 2.5 kg in the shape of the
bundled L bracket gets an impulse beside its centre of mass, so that it translates and turns, and flies for 0.1 s; motion
of the exact one is in closed form, since it turns by less than 0.01 rad.

    python benchmarks/engine_inertia.py
"""

from __future__ import annotations

import base64
import io
import json
import subprocess
import sys
import tempfile
from contextlib import redirect_stdout
from importlib.metadata import version
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from result_table import ResultTable
from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.cli.main import main as rigid_proto
from rigid_proto_ros.mass.engines import engine_text
from rigid_proto_ros.mass.export import mjcf_inertial, urdf_inertial
from rigid_proto_ros.mass.from_mesh import MeshBody, mesh_body
from rigid_proto_ros.mass.inspection import model_difference
from rigid_proto_ros.mass.properties import MassProperties
from rigid_proto_ros.mass.tensor import tensor_from_six
from rigid_proto_ros.page.bundle import installed_node

MESH, MASS = "l_bracket", 2.5
TAKERS = ("rapier", "jolt", "physx", "havok", "babylon")
"""Engines of npm that fly with what is printed for them; a .glb of a flight, which Babylon reads, flies beside them."""
IMPULSE = np.array([0.2, -0.3, 0.15])
BESIDE = np.array([4e-4, 2e-4, -3e-4])
"""[N s] and [m] from the centre of mass: about 0.1 m/s and 0.07 rad/s, slow enough that ω × Iω changes little."""
STEP_S, STEPS = 0.01, 10
PRINTED, READ = "as printed", "a flight's .glb"
"""What a body flies with."""
COLUMNS = (
    *(
        "engine",
        "package",
        "version",
        "shape",
        "first_moment",
        "second_moment",
        "third_moment",
        "axes_turned_deg",
        "center_off_mm",
    ),
    *("spin_error", "position_error"),
)
"""first_moment to third_moment: relative errors of the principal moments, ascending. spin_error, position_error: of a
flight with the numbers printed for the engine, relative to the exact ones."""


def taken(body: MeshBody, properties: MassProperties) -> dict:
    """What the engines of npm answer."""
    folder = HERE / "engines"
    asked = {
        "texts": {name: engine_text(name, properties) for name in TAKERS},
        "glb": base64.b64encode(glb()).decode(),
        "center": properties.center_of_mass.tolist(),
        "impulse": IMPULSE.tolist(),
        "point": (properties.center_of_mass + BESIDE).tolist(),
        "step_s": STEP_S,
        "steps": STEPS,
        "surface": {"vertices": body.vertices.tolist(), "triangles": body.triangles.tolist()},
        "mass": properties.mass,
    }
    command = [installed_node(folder), folder / "inertia.mjs"]
    text = json.dumps(asked)
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def glb() -> bytes:
    """A flight of the body as a file; at its start the body's axes are the world's, and so is its centre of mass."""
    with tempfile.TemporaryDirectory() as folder, redirect_stdout(io.StringIO()):
        file = Path(folder) / "flight.glb"
        command = ["simulate", MESH, "--set", f"mass={MASS}", "--duration", "0.1", "--gltf", str(file)]
        if status := rigid_proto(command):
            raise RuntimeError(f"rigid_proto {' '.join(command)}: exit {status}")
        return file.read_bytes()


def flown_in_mujoco(properties: MassProperties) -> dict:
    """With the <inertial> of ``inspect --mjcf``."""
    import mujoco

    options = f'<option gravity="0 0 0" timestep="{STEP_S}"/>'
    body = f"<body><freejoint/>{mjcf_inertial(properties)}</body>"
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{options}<worldbody>{body}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    data.xfrc_applied[1] = np.append(IMPULSE, np.cross(BESIDE, IMPULSE)) / STEP_S
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
        data.xfrc_applied[:] = 0.0
    R = matrix_from_quaternion(np.roll(data.qpos[3:7], -1))
    return {"position": data.qpos[:3].tolist(), "omega": (R @ data.qvel[3:6]).tolist()}


def flown_in_bullet(properties: MassProperties) -> dict:
    """With the <inertial> of ``inspect --urdf``."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "body.urdf"
        file.write_text(f'<robot name="body"><link name="body">{urdf_inertial(properties)}</link></robot>')
        body = pybullet.loadURDF(str(file), flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=STEP_S)
    pybullet.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)
    place, turn = pybullet.getDynamicsInfo(body, -1)[3:5]  # of the principal axes in the link's
    force, point = (IMPULSE / STEP_S).tolist(), (properties.center_of_mass + BESIDE).tolist()
    pybullet.applyExternalForce(body, -1, force, point, pybullet.WORLD_FRAME)
    for _ in range(STEPS):
        pybullet.stepSimulation()
    pose = pybullet.getBasePositionAndOrientation(body)
    origin, _ = pybullet.multiplyTransforms(*pose, *pybullet.invertTransform(place, turn))
    omega = pybullet.getBaseVelocity(body)[1]
    pybullet.disconnect(client)
    return {"position": list(origin), "omega": list(omega)}


FLOWN = {"mujoco": flown_in_mujoco, "pybullet": flown_in_bullet}
"""Engines by their packages on PyPI."""

PACKAGES = {
    "rapier": "@dimforge/rapier3d-compat",
    "jolt": "jolt-physics",
    "physx": "physx-js-webidl",
    "babylon": "@babylonjs/core",
    "gltf": "@babylonjs/loaders",
    "bullet": "ammojs-typed",
    "cannon": "cannon-es",
    "havok": "@babylonjs/havok",
}
"""Of npm."""


def package(engine: str) -> dict[str, str]:
    """The engine's name, its package, and the version that is installed."""
    pinned = json.loads((HERE / "engines" / "package.json").read_text("utf-8"))["dependencies"]
    return {"engine": engine, "package": PACKAGES[engine], "version": pinned[PACKAGES[engine]]}


def flight_errors(row: dict, properties: MassProperties) -> dict[str, float]:
    """Errors of the spin and of the way of the body's origin, relative to the exact ones."""
    spin = np.linalg.solve(properties.inertia, np.cross(BESIDE, IMPULSE))
    way = (IMPULSE / properties.mass - np.cross(spin, properties.center_of_mass)) * STEP_S * STEPS
    return {
        "spin_error": float(np.linalg.norm(np.array(row["omega"]) - spin) / np.linalg.norm(spin)),
        "position_error": float(np.linalg.norm(np.array(row["position"]) - way) / np.linalg.norm(way)),
    }


def differences(own: MassProperties, true: MassProperties) -> dict[str, float]:
    """How far what an engine computes is off."""
    difference = model_difference(own, true)
    names = ("first_moment", "second_moment", "third_moment")
    return {
        **dict(zip(names, difference.principal_moments.tolist(), strict=True)),
        "axes_turned_deg": float(np.degrees(difference.axes_turned)),
        "center_off_mm": 1e3 * float(np.linalg.norm(difference.center_of_mass)),
    }


def in_mujoco(body: MeshBody) -> dict[str, MassProperties]:
    """What MuJoCo computes of the mesh, by its words for how."""
    import mujoco

    found = {}
    for how in ("legacy", "exact", "convex"):
        spec = mujoco.MjSpec()
        mesh = spec.add_mesh(name="m", uservert=body.vertices.ravel(), userface=body.triangles.ravel())
        mesh.inertia = getattr(mujoco.mjtMeshInertia, f"mjMESH_INERTIA_{how.upper()}")
        spec.worldbody.add_body().add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m", mass=MASS)
        model = spec.compile()
        R = matrix_from_quaternion(np.roll(model.body_iquat[1], -1))
        inertia = R @ np.diag(model.body_inertia[1]) @ R.T
        found[how] = MassProperties(float(model.body_mass[1]), model.body_ipos[1].copy(), inertia)
    return found


def main() -> int:
    """Ask, measure and write the table; returns the exit status."""
    table = ResultTable(HERE / "results" / "engine_inertia.csv", COLUMNS)
    body = mesh_body(MESH)
    properties = body.moments.mass_properties(mass=MASS)
    for engine, row in taken(body, properties).items():
        if "why" in row:
            raise RuntimeError(f"{engine}: {row['why']}")
        for shape, own in row["own"].items():
            found = MassProperties(own["mass"], np.array(own["center"]), tensor_from_six(own["tensor"]))
            table.add({**package(engine), "shape": shape, **differences(found, properties)})
        if "omega" in row:
            shape = READ if engine == "gltf" else PRINTED
            table.add({**package(engine), "shape": shape, **flight_errors(row, properties)})
    for engine, flown in FLOWN.items():
        of_pypi = {"engine": engine, "package": engine, "version": version(engine)}
        table.add({**of_pypi, "shape": PRINTED, **flight_errors(flown(properties), properties)})
    for how, found in in_mujoco(body).items():
        of_pypi = {"engine": "mujoco", "package": "mujoco", "version": version("mujoco")}
        table.add({**of_pypi, "shape": f"inertia {how}", **differences(found, properties)})
    box = body.moments.mass_properties("bounding_box", mass=MASS)
    table.add({"engine": "any", "shape": "bounding box", **differences(box, properties)})
    table.write()
    table.show()
    return 0


if __name__ == "__main__":
    sys.exit(main())
