# SPDX-License-Identifier: MIT
"""Least squares held to tensors that a body can have."""

from __future__ import annotations

import numpy as np
from measured_flights import physical_change

from rigid_proto_ros.identify import mass_parameters as mp
from rigid_proto_ros.identify.possible_bodies import is_possible, possible_step


def _problem(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, mp.MassEstimate]:
    body = mp.mass_of(np.concatenate([rng.normal(0.0, 0.3, 7), np.zeros(3)]))
    jacobian = rng.standard_normal((30, 10))
    return jacobian, jacobian @ rng.normal(0.0, 0.6, 10) + 0.1 * rng.standard_normal(30), body


def test_a_held_step_is_possible_and_no_possible_one_beside_it_is_better() -> None:
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(40):
        jacobian, residuals, body = _problem(rng)
        step = possible_step(jacobian, residuals, slice(1, 7), body)
        tensor = mp.changed_tensor(body, step[1:7]).inertia
        assert is_possible(tensor)
        best = np.sum((jacobian @ step + residuals) ** 2)
        free = np.linalg.lstsq(jacobian, -residuals, rcond=None)[0]
        if is_possible(mp.changed_tensor(body, free[1:7]).inertia):
            assert np.abs(step - free).max() < 1e-6
            continue
        held += 1
        for _ in range(60):
            # The possible tensors are convex: from the step towards any of them all are possible.
            other = rng.normal(0.0, 1.0, 10)
            towards = mp.possible_tensor(mp.changed_tensor(body, other[1:7]).inertia, 1e-9)
            theta = mp.parameters_of(body.mass, body.center_of_mass, towards)
            other[1:7] = physical_change(mp.parameters_of(body.mass, body.center_of_mass, body.inertia), theta)[1:7]
            beside = step + 1e-3 * (other - step)
            assert np.sum((jacobian @ beside + residuals) ** 2) > best * (1.0 - 1e-6)
    assert held > 10
