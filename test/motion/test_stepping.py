# SPDX-License-Identifier: MIT
"""A method's number chooses the kernel of its integrator."""

import numpy as np
import pytest
from flights import flight, spinning
from reference_scenes import BODY

from rigid_proto_ros.base.compilation import new_record
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.integrators.integrator import ADAPTIVE, NOTHING
from rigid_proto_ros.motion.integrators.stepping import (
    CONTROL,
    KERNELS,
    ROOM,
    fixed_steps,
    method_for,
    method_of,
    reach,
    way_of,
)

STEP_NS = 100_000_000


def one_step(steps):
    simulation = flight(BODY, integrator="rk4", initial=spinning((1.0, 2.0, 3.0)))
    simulation.advance(1)
    y = simulation.flight.variables.copy()
    assert steps(y, simulation.flight.problem, STEP_NS * 1e-9, 1) == 1
    return y.tolist()


@pytest.mark.parametrize("code", range(len(KERNELS)))
def test_a_number_steps_by_the_kernel_at_its_place(code):
    assert one_step(lambda *arguments: fixed_steps(code, *arguments)) == one_step(KERNELS[code])


def test_kernels_take_different_steps():
    # Free rotation: without loads the exact step is the same in both of its kernels.
    steps = {tuple(one_step(kernel)) for kernel in KERNELS}
    assert len(steps) == len(KERNELS) - 1


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_method_has_the_way_and_the_kernel_that_its_integrator_states(name):
    for kind, method in enumerate(INTEGRATORS[name].methods):
        number = method_for(list(INTEGRATORS).index(name), kind)
        assert method_of(number) is method
        assert way_of(number) == method.way
        if method.way not in (NOTHING, ADAPTIVE):
            assert one_step(by_number(number)) == one_step(method.kernel)


def by_number(method):
    """A step as segments are stepped, by the number of a method."""
    control, room = new_record(CONTROL), np.zeros(ROOM)
    return lambda y, p, *_: reach(method, y, p, control, y, room, STEP_NS)
