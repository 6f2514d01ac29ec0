# SPDX-License-Identifier: MIT
"""Log-Cholesky coordinates: every number is a body, and every body has numbers."""

from __future__ import annotations

import numpy as np
import pytest
from measured_flights import physical_change

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.identify import mass_parameters as mp
from rigid_proto_ros.mass.tensor import check_tensor


def test_any_ten_numbers_are_a_body_that_can_exist() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        body = mp.mass_of(rng.normal(0.0, 1.0, 10))
        assert body.mass > 0.0
        assert check_tensor(body.inertia) == ()


def test_a_body_comes_back_from_its_numbers() -> None:
    rng = np.random.default_rng(2)
    for _ in range(200):
        body = mp.mass_of(rng.normal(0.0, 1.0, 10))
        again = mp.mass_of(mp.parameters_of(body.mass, body.center_of_mass, body.inertia))
        assert again.mass == pytest.approx(body.mass, rel=1e-14)
        assert np.abs(again.inertia - body.inertia).max() < 1e-12 * np.abs(body.inertia).max()
        assert np.array_equal(again.center_of_mass, body.center_of_mass)


def test_the_pseudo_inertia_is_the_product_of_the_papers_factor() -> None:
    theta = np.array([0.3, -1.0, 0.2, -0.4, 0.5, -0.3, 0.1, 0.02, -0.05, 0.3])
    alpha, size, e1, e2, s12, s23, s13, *t = theta
    U = np.eye(4)
    U[0, 0], U[1, 1], U[2, 2] = np.exp([size + e1, size + e2, size - e1 - e2])
    U[0, 1], U[1, 2], U[0, 2] = np.exp(size) * np.array([s12, s23, s13])
    U[:3, 3] = t
    J = np.exp(2.0 * alpha) * U @ U.T
    body = mp.mass_of(theta)
    assert J[3, 3] == pytest.approx(body.mass, rel=1e-15)
    assert J[:3, 3] == pytest.approx(body.mass * body.center_of_mass, rel=1e-14)
    # About the origin of the tracked frame, by the parallel-axis theorem.
    c = body.center_of_mass
    about_origin = body.inertia + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
    assert np.trace(J[:3, :3]) * np.eye(3) - J[:3, :3] == pytest.approx(about_origin, rel=1e-13)


def test_mass_and_size_change_nothing_of_the_shape() -> None:
    theta = np.random.default_rng(3).normal(0.0, 0.5, 10)
    body, other = mp.mass_of(theta), mp.mass_of(mp.scaled(theta, 7.0, 3.0))
    assert other.mass == pytest.approx(7.0 * body.mass)
    assert other.inertia == pytest.approx(63.0 * body.inertia)


def test_a_changed_tensor_is_as_far_off_as_it_was_changed() -> None:
    theta = np.random.default_rng(4).normal(0.0, 0.3, 10)
    change = np.array([0.03, -0.02, 0.01, 0.02, -0.01, 0.015])
    changed = mp.changed_tensor(mp.mass_of(theta), change)
    found = physical_change(theta, mp.parameters_of(changed.mass, changed.center_of_mass, changed.inertia))
    assert found[1:7] == pytest.approx(change, abs=1e-12)
    assert np.abs(found[[0, 7, 8, 9]]).max() < 1e-12


@pytest.mark.parametrize("mass", [0.0, -1.0, np.nan])
def test_a_mass_that_no_body_has_is_refused(mass: float) -> None:
    with pytest.raises(InputError, match="mass"):
        mp.parameters_of(mass, np.zeros(3), np.eye(3))
