# SPDX-License-Identifier: MIT
"""Which tensors a rigid body has, and their principal axes."""

import re

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mass_solids import rotation

from rigid_proto_ros.base.errors import TensorError
from rigid_proto_ros.mass.tensor import check_tensor, equimomental_shapes, principal_axes


def turned(moments, seed):
    R = rotation(seed)
    tensor = R @ np.diag(moments) @ R.T
    return 0.5 * (tensor + tensor.T)


def test_the_sign_rule_makes_the_axes_of_a_tensor_unique_and_of_equal_components_the_first_decides():
    moments, axes = principal_axes(np.diag([3.0, 1.0, 2.0]))
    assert moments.tolist() == [1.0, 2.0, 3.0]
    assert axes.tolist() == [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    moments, axes = principal_axes(np.diag([1.0, 3.0, 2.0]))
    assert axes.tolist() == [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    R = np.array([[np.sqrt(0.5), np.sqrt(0.5), 0], [-np.sqrt(0.5), np.sqrt(0.5), 0], [0, 0, 1.0]])
    for noise in (0.0, 1e-16, -1e-16):
        tensor = R @ np.diag([1.0, 2.0, 2.5]) @ R.T
        tensor[0, 0] += noise
        _, axes = principal_axes(0.5 * (tensor + tensor.T))
        assert axes[0, 0] > 0.7
        assert axes[1, 0] < -0.7


@given(st.integers(0, 2**31), st.floats(-12, 0), st.floats(0, 1))
@settings(deadline=None, max_examples=60)
def test_axes_are_a_proper_rotation_that_diagonalises(seed, exponent, between):
    small = 10.0**exponent
    moments = np.array([small, 1.0 - between * small, 1.0])
    tensor = turned(moments, seed)
    found, axes = principal_axes(tensor)
    assert np.all(np.diff(found) >= 0.0)
    assert np.max(np.abs(axes.T @ axes - np.eye(3))) <= 2e-15  # measured 9e-16
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=2e-15)
    assert np.max(np.abs(axes @ np.diag(found) @ axes.T - tensor)) <= 3e-15
    for column in range(2):
        largest = np.abs(axes[:, column]).max()
        first = int(np.argmax(np.abs(axes[:, column]) >= (1 - 1e-9) * largest))
        assert axes[first, column] > 0.0


def test_small_moments_of_scaled_diagonally_dominant_tensors_keep_their_digits():
    d = np.array([1e-6, 1.0, 1e3])
    core = np.array([[1.0, 0.1, 0.05], [0.1, 1.0, -0.2], [0.05, -0.2, 1.0]])
    tensor = d[:, None] * core * d[None]
    with mpmath.workdps(60):
        exact = sorted(float(e) for e in mpmath.eigsy(mpmath.matrix(tensor.tolist()), eigvals_only=True))
    assert principal_axes(tensor)[0] == pytest.approx(exact, rel=1e-14)  # LAPACK's are off by up to 2e-12 here


@pytest.mark.parametrize("ratio", [2e5, 1.4e8, 1e12])
@pytest.mark.parametrize("unit", [1e-40, 1.0, 1e30])
def test_a_turned_needle_has_the_moments_that_its_tensor_says_to_rounding_of_the_largest(ratio, unit):
    for seed in range(4):
        tensor = unit * turned([1.0 / ratio, 1.0 - 0.3 * seed / ratio, 1.0], seed)
        (a, b, c), axes = principal_axes(tensor)
        with mpmath.workdps(60):
            exact, vectors = mpmath.eigsy(mpmath.matrix(tensor.tolist()))
            gap = exact[2] - exact[1]
            rounding = 2.0**-52 * exact[2]
            assert abs(a - exact[0]) <= 2.0 * rounding  # measured 0.7
            assert abs(c - exact[2]) <= 2.0 * rounding  # 0.9
            assert abs((c - b) - gap) <= 3.0 * rounding  # 1.3
            cosine = sum(vectors[i, 0] * axes[i, 0] for i in range(3))
            assert abs(abs(cosine) - 1) <= 1e-15  # 5e-16


def test_moments_of_which_two_are_too_small_for_the_third_say_how_large_it_may_be():
    with pytest.raises(TensorError) as refused:
        check_tensor(turned([1.0, 1.5, 3.0], 3))
    assert "A + B >= C" in str(refused.value)
    assert "with these A and B, C is at most 2.5 kg m²: look for swapped entries and another unit" in str(refused.value)


def test_the_equimomental_box_of_a_box_is_that_box():
    a, b, c = 1.0, 2.0, 3.0
    moments = np.array([a * a + b * b, a * a + c * c, b * b + c * c]) / 12 * 7.0
    sides, semi_axes = equimomental_shapes(7.0, moments)
    assert sides == pytest.approx([c, b, a], rel=1e-14)
    assert 7.0 / 5 * (semi_axes[1] ** 2 + semi_axes[2] ** 2) == pytest.approx(moments[0], rel=1e-14)


def test_good_tensors_pass_without_a_word_and_one_rounded_to_six_digits_with_a_warning():
    assert check_tensor(np.diag([1.0, 2.0, 3.0])) == check_tensor(np.diag([1e-12, 1.0, 1.0])) == ()
    for seed in range(50):
        assert check_tensor(turned([1.0, 2.0, 3.0 - 1e-13], seed)) == ()
    (warning,) = check_tensor(np.diag([1.0, 2.0, 3.0 * (1 + 9e-6)]))
    assert "A + B" in warning


@pytest.mark.parametrize(
    ("tensor", "why"),
    [
        (np.diag([1.0, 1.0, 2.1]), "A + B"),
        (np.diag([0.0, 1.0, 1.0]), "positive"),
        (np.diag([-1.0, 1.0, 1.0]), "positive"),
        (np.diag([1e-13, 1.0, 1.0]), "1e12"),
        (np.diag([1.0, np.nan, 1.0]), "finite"),
        (np.diag([1.0, np.inf, 1.0]), "finite"),
        (np.zeros((3, 3)), "symmetric"),
        (np.array([[1.0, 0.1, 0], [0, 1.0, 0], [0, 0, 1.0]]), "symmetric"),
        (np.eye(2), "3 x 3"),
    ],
)
def test_what_no_body_has_is_refused_with_the_reason(tensor, why):
    with pytest.raises(TensorError, match=re.escape(why)):
        check_tensor(tensor, source="explicit_inertia.tensor")
