# SPDX-License-Identifier: MIT
"""A method's number chooses the kernel of its integrator."""

import numpy as np
import pytest
from flights import flight, spinning
from reference_scenes import BODY

from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.integrators.stepping import KERNELS, fixed_steps, method_table


def one_step(steps):
    simulation = flight(BODY, integrator="rk4", initial=spinning((1.0, 2.0, 3.0)))
    simulation.advance(1)
    y = simulation.flight.variables.copy()
    assert steps(y, simulation.flight.problem, 0.1, 1) == 1
    return y.tolist()


@pytest.mark.parametrize("code", range(len(KERNELS)))
def test_a_number_steps_by_the_kernel_at_its_place(code):
    assert one_step(lambda *arguments: fixed_steps(code, *arguments)) == one_step(KERNELS[code])


def test_kernels_take_different_steps():
    # Free rotation: without loads the exact step is the same in both of its kernels.
    steps = {tuple(one_step(kernel)) for kernel in KERNELS}
    assert len(steps) == len(KERNELS) - 1


def test_a_number_of_no_kernel_takes_no_step():
    y = np.zeros(15)
    simulation = flight(BODY, initial=spinning((1.0, 2.0, 3.0)))
    assert fixed_steps(len(KERNELS), y, simulation.flight.problem, 0.1, 1) == 0
    assert not y.any()


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_table_names_the_kernels_of_its_integrator(name):
    integrator = INTEGRATORS[name]
    for row, method in zip(method_table(integrator, 12), integrator.methods, strict=True):
        assert row["way"] == method.way
        assert method.kernel not in KERNELS or KERNELS[row["code"]] is method.kernel
