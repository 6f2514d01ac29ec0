# SPDX-License-Identifier: MIT
"""Tensors that are moved, and least squares held to those that a body can have."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_proto_ros.identify.psd_projection import is_possible, possible_step
from rigid_proto_ros.identify.unknowns import moved_tensor, possible_tensor, second_moments


def _tensor(rng: np.random.Generator) -> np.ndarray:
    root = rng.standard_normal((3, 3))
    return np.trace(root @ root.T) * np.eye(3) - root @ root.T


def test_the_nearest_possible_tensor_is_on_the_rim_and_a_possible_one_stays() -> None:
    rng = np.random.default_rng(4)
    tensor = _tensor(rng)
    assert possible_tensor(tensor, 1e-9) is tensor
    flat = tensor + np.diag([0.0, 0.0, 3.0 * np.trace(tensor)])
    assert not is_possible(flat)
    held = np.linalg.eigvalsh(second_moments(possible_tensor(flat, 1e-3)))
    least = 1e-3 * np.abs(np.linalg.eigvalsh(second_moments(flat))).max()
    assert held[0] == pytest.approx(least)
    assert is_possible(possible_tensor(flat, 1e-3))


def test_a_held_step_is_possible_and_no_possible_one_beside_it_is_better() -> None:
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(40):
        inertia, jacobian = _tensor(rng), rng.standard_normal((30, 10))
        residuals = jacobian @ rng.normal(0.0, 0.6, 10) + 0.1 * rng.standard_normal(30)
        step = possible_step(jacobian, residuals, slice(1, 7), inertia)
        assert is_possible(moved_tensor(inertia, step[1:7]))
        best = np.sum((jacobian @ step + residuals) ** 2)
        free = np.linalg.lstsq(jacobian, -residuals, rcond=None)[0]
        if is_possible(moved_tensor(inertia, free[1:7])):
            assert np.abs(step - free).max() < 1e-6
            continue
        held += 1
        for _ in range(60):
            # The possible tensors are convex: from the step towards any of them all are possible.
            other = rng.normal(0.0, 1.0, 10)
            if is_possible(moved_tensor(inertia, other[1:7])):
                beside = step + 1e-3 * (other - step)
                assert np.sum((jacobian @ beside + residuals) ** 2) > best * (1.0 - 1e-6)
    assert held > 10
