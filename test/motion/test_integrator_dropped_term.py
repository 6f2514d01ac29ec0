# SPDX-License-Identifier: MIT
"""What the paper's equation, without ω × Iω, keeps and what it loses."""

import numpy as np
import pytest
from flights import SECOND, bundled_body, flight, spinning

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.integrators.integrator import NO_GYROSCOPIC_TERM

WITHOUT = [name for name, i in INTEGRATORS.items() if NO_GYROSCOPIC_TERM in i.supports]
SPIN = (0.3, 4.0, 0.2)


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)


@pytest.mark.parametrize("name", WITHOUT)
def test_without_the_term_energy_and_size_of_momentum_stay_but_its_direction_turns(name):
    simulation = flight(bundled_body("t_handle"), integrator=name, initial=spinning(SPIN), gyroscopic=False)
    energy, momentum = simulation.kinetic_energy, simulation.angular_momentum
    turned = 0.0
    for tenth in range(1, 21):
        simulation.advance(tenth * SECOND // 10)
        assert simulation.kinetic_energy == pytest.approx(energy, rel=1e-12)
        assert np.linalg.norm(simulation.angular_momentum) == pytest.approx(np.linalg.norm(momentum), rel=1e-12)
        turned = max(turned, angle(simulation.angular_momentum, momentum))
    assert turned > 0.05


@pytest.mark.parametrize("name", ["rk4", "auto"])
def test_with_the_term_momentum_is_fixed_in_the_world(name):
    simulation = flight(bundled_body("t_handle"), integrator=name, initial=spinning(SPIN))
    momentum = simulation.angular_momentum
    for tenth in range(1, 21):
        simulation.advance(tenth * SECOND // 10)
        assert angle(simulation.angular_momentum, momentum) <= 1e-9  # measured 2e-11 (rk4)


@pytest.mark.parametrize("name", sorted(set(INTEGRATORS) - set(WITHOUT)))
def test_others_refuse_to_drop_the_term_and_name_those_that_can(name):
    with pytest.raises(CommandRefused, match="gyroscopic: false: auto, euler, midpoint, rk4$") as refusal:
        flight(bundled_body("t_handle"), integrator=name, initial=spinning(SPIN), gyroscopic=False)
    assert (refusal.value.field, refusal.value.reason) == ("integrator", "integrator")
