# SPDX-License-Identifier: MIT
"""Motion against outside truths: NASA's check case, closed forms in high precision, Newton's second law."""

import re
from pathlib import Path

import numpy as np
import pytest
from flights import SECOND, bundled_body, flight, spinning, wrench
from mass_solids import box
from reference_motion import angle_between, free_motion

from rigid_proto_ros.base.bundled import body_names
from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS

# Check case 2, a tumbling brick without torque, of its sides; of its tensor in test_integrator_truths.py: Jackson, Shelton, Jackson, Castro, Noble, "Further Development of
# Verification Check-Cases for Six-Degree-of-Freedom Flight Vehicle Simulations", and NASA/TM-2015-218675.
NASA_MASS = 2.26796
NASA_SIDES = np.array([8.0, 4.0, 2.25]) * 0.0254
NASA_RATES = np.radians([10.0, 20.0, 30.0])
NASA_RATES_AFTER_30_S = np.radians([12.6183907757, -17.3974747618, 31.1195888868])

# Unit fractions of the principal axes: a general spin, and one beside the unstable middle axis.
DIRECTIONS = {"general": (0.6, 0.64, 0.48), "beside the middle axis": (0.01, 1.0, 0.01)}


def test_errors_of_van_zon_and_schofields_top_at_120_hz_are_those_of_the_document():
    document = Path(__file__).parents[2] / "docs" / "benchmarks.md"
    if not document.is_file():
        pytest.skip("not run from a source tree")
    table = document.read_text("utf-8").partition("| integrator | attitude [rad] |")[2].partition("\n\n")[0]
    moments, rates = np.diag([10.0, 20.0, 26.0]), [1.0, 15.0, 1.0]
    body = make_body(1.0, np.zeros(3), moments)
    attitude, exact = free_motion(moments, rates, 10)
    rows = re.findall(r"^\| (`.*`) \| (\S+) \| (\S+) \|$", table, re.MULTILINE)
    names = [name for cell, _, _ in rows for name in re.findall(r"`(\w+)`", cell)]
    assert {*names} == {*INTEGRATORS}
    for cell, turned, faster in rows:
        for integrator in re.findall(r"`(\w+)`", cell):
            simulation = flight(body, integrator=integrator, step_s=1 / 120, initial=spinning(rates))
            state = simulation.advance(10 * SECOND)
            # Both have two digits there.
            assert angle_between(state.orientation_xyzw, attitude) == pytest.approx(float(turned), rel=0.06, abs=0.0), (
                integrator
            )
            off = np.abs(state.angular_velocity_body - [float(w) for w in exact]).max()
            assert off == pytest.approx(float(faster), rel=0.06, abs=0.0), integrator


def test_nasa_tumbling_brick_from_its_mesh():
    properties = MeshMoments(*box(NASA_SIDES)).mass_properties("solid", mass=NASA_MASS)
    body = make_body(properties.mass, properties.center_of_mass, properties.inertia)
    rates = flight(body, initial=spinning(NASA_RATES)).advance(30 * SECOND).angular_velocity_body
    # The published tensor is rounded to 7 digits of its box.
    assert np.abs(np.degrees(rates - NASA_RATES_AFTER_30_S)).max() <= 1e-4


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("name", body_names())
def test_bundled_bodies_tumble_as_they_should_with_rk4(name, direction):
    """10 rad/s at 1 kHz: energy and L over 60 s, attitude against the closed form after 10 s."""
    body = bundled_body(name)
    unit = np.array(DIRECTIONS[direction]) / np.linalg.norm(DIRECTIONS[direction])
    spin = 10.0 * body.principal_axes @ unit
    simulation = flight(body, initial=spinning(spin))
    energy, momentum = simulation.kinetic_energy, simulation.angular_momentum
    exact, _ = free_motion(body.inertia, spin, 10)
    # Measured up to 7e-9 (tennis_racket beside the middle axis).
    assert angle_between(simulation.advance(10 * SECOND).orientation_xyzw, exact) <= 1e-8
    for second in range(11, 61):
        simulation.advance(second * SECOND)
        # Measured up to 1.1e-10 and 6.9e-10.
        assert abs(simulation.kinetic_energy - energy) <= 1e-9 * energy
        assert np.linalg.norm(simulation.angular_momentum - momentum) <= 1e-9 * np.linalg.norm(momentum)


def test_force_at_the_centre_of_mass_gives_newtons_parabola():
    body, force = bundled_body("hammer"), np.array([0.3, -0.2, 0.5])
    start = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0, 0.4, 0.5, -0.6, 3.0, 2.0, 1.0])
    simulation = flight(body, initial=start)
    simulation.submit(wrench("world@com", force), 0)
    state = simulation.advance(10 * SECOND)
    position = start[0:3] + 10.0 * start[7:10] + 50.0 * force / body.mass
    velocity = start[7:10] + 10.0 * force / body.mass
    assert np.linalg.norm(state.position - position) <= 1e-12 * np.linalg.norm(position)
    assert np.linalg.norm(state.linear_velocity - velocity) <= 1e-12 * np.linalg.norm(velocity)
