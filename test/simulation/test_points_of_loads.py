# SPDX-License-Identifier: MIT
"""The same load, said in different frames, moves the body the same way."""

import numpy as np
import pytest
from flights import SECOND
from scipy.spatial.transform import Rotation

from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.commands import WrenchCommand
from rigid_proto_ros.simulation.simulation import Simulation

SCENE = {
    "mesh": "t_handle",
    "density": 7850.0,
    "scale": [1.5, 0.8, 2.0],
    "initial.position": [0.3, -0.2, 0.5],
    "initial.orientation_xyzw": [0.2, -0.4, 0.4, 0.8],
    "initial.linear_velocity": [0.1, 0.2, -0.1],
    "initial.angular_velocity": [0.5, -2.0, 3.0],
    "integrator": "rk4",
    "wrench_timeout": 0.0,
}


def scenario(**contacts):
    return make_scenario({**SCENE, **{f"contacts.{n}": list(p) for n, p in contacts.items()}})


def flown(scene, *commands, seconds: float = 1.0) -> np.ndarray:
    """The state row after commands (time_ns, frame, force, torque, held)."""
    simulation = Simulation(scene.setup)
    for time_ns, frame, force, torque, held in commands:
        read = parse_frame(frame)
        simulation.submit(WrenchCommand(held, read, tuple(force), tuple(torque), frame), time_ns)
    row = simulation.advance(round(seconds * SECOND)).row
    assert not simulation.refused
    return row


def relative_difference(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of position, attitude, velocity and spin, each relative to its own size."""
    parts = (slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13))
    return max(np.abs(a[p] - b[p]).max() / np.abs(b[p]).max() for p in parts)


def text(point) -> str:
    return ",".join(repr(float(x)) for x in point)


VERTEX = 17
FORCE = (0.3, -0.2, 0.4)
START = SECOND // 10


@pytest.fixture(scope="module")
def scene():
    mesh = scenario().body_mesh
    return scenario(tip=mesh.surface.vertices[VERTEX])


@pytest.fixture(scope="module")
def corner(scene) -> np.ndarray:
    return scene.body_mesh.surface.vertices[VERTEX]


def same_loads(scene, corner) -> dict[str, list[tuple]]:
    """(frame, force, torque) that are one load, however it is said."""
    surface, body, scale = scene.setup.surface, scene.setup.body, np.array(SCENE["scale"])
    none, torque = (0.0, 0.0, 0.0), np.array((0.01, 0.02, -0.03))
    names = (f"vertex/{VERTEX}", "tip", f"point/{text(corner)}")
    about_com = np.cross(corner * scale - body.center_of_mass, FORCE)
    # Inward normals of a scaled surface go with the inverse of the scale.
    a, b, c = surface.vertices[surface.triangles[40]]
    centre = (a + b + c) / 3
    inward = -np.cross((b - a) * scale, (c - a) * scale)
    inward /= np.linalg.norm(inward)
    # From half a metre out nothing else of this convex face's side is in the way of a ray.
    state = Simulation(scene.setup).advance(START)
    R = Rotation.from_quat(state.orientation_xyzw).as_matrix()
    target = state.position + R @ body.point(centre)
    outside = target - 0.5 * (R @ inward)
    ray, middle = f"ray/{text(outside)}/{text(target - outside)}", f"point/{text(centre)}"
    return {
        "a point by vertex, contact or coordinates": [(f"world@{name}", FORCE, none) for name in names],
        # A point alone is in body axes; `body` alone is the centre of mass.
        "a body force off the centre and r x F at the centre": [
            *((f"body@{name}", FORCE, torque) for name in names),
            ("tip", FORCE, torque),
            ("body@com", FORCE, about_com + torque),
            ("body", FORCE, about_com + torque),
        ],
        "the mesh's origin": [("world@origin", FORCE, none), ("world@point/0,0,0", FORCE, none)],
        # The first point that it meets, which stays with the turning body.
        "a ray, world axes": [(f"world@{ray}", FORCE, none), (f"world@{middle}", FORCE, none)],
        "a ray, body axes": [(f"body@{ray}", FORCE, none), (f"body@{middle}", FORCE, none)],
        "a push": [(f"normal@{middle}", (2.0, 0.0, 0.0), none), (f"body@{middle}", 2.0 * inward, none)],
    }


@pytest.mark.parametrize("held", [True, False], ids=["wrench", "poke"])
def test_one_load_said_in_several_ways_moves_the_body_the_same_way(scene, corner, held):
    still, at_com = flown(scene), flown(scene, (START, "world@com", FORCE, (0.0, 0.0, 0.0), held))
    for name, loads in same_loads(scene, corner).items():
        first, *others = (flown(scene, (START, *load, held)) for load in loads)
        assert relative_difference(first, still) > 1e-3 and relative_difference(first, at_com) > 1e-3, name
        for other in others:
            assert relative_difference(other, first) <= 1e-12, name


def test_a_ray_that_misses_when_it_takes_effect_is_refused_and_the_motion_goes_on(scene):
    simulation = Simulation(scene.setup)
    frame = parse_frame("world@ray/100,100,100/1,0,0")
    simulation.submit(WrenchCommand(False, frame, FORCE, (0, 0, 0), frame.text), SECOND // 2)
    assert not simulation.refused
    end = simulation.advance(SECOND).row
    assert simulation.refused == {"ray_miss": 1}
    assert (end == Simulation(scene.setup).advance(SECOND).row).all()
