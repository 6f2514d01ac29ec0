# SPDX-License-Identifier: MIT
"""Flights without any attitude: body axes turned by their own rates, the first attitude from gravity and known forces;
and what a fit that isn't right says of itself.
"""

from __future__ import annotations

import calibration_study as study
import measured_flights as mf
import numpy as np
import pytest

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.identify import measurements as ms
from rigid_proto_ros.identify import rotations as rot
from rigid_proto_ros.identify.first_attitude import first_attitude
from rigid_proto_ros.identify.identification import identify
from rigid_proto_ros.identify.poses import poses_of
from rigid_proto_ros.identify.report import as_json, as_text

INERTIA = np.array([[2.0, 0.2, -0.1], [0.2, 3.0, 0.3], [-0.1, 0.3, 4.0]]) * 1e-3
TRUTH = mf.values_of(0.5, (0.01, -0.02, 0.03), INERTIA, study.EARTH)


def _twists(axes: str, seed: int, seconds: float = 2.0, noise: float = 0.01, in_body: bool = True):
    """Velocities and rates alone, of a flight from any attitude with one poke along the given axes; and its start."""
    rng = np.random.default_rng(seed)
    force = 10.0 * study._direction(rng)
    load = mf.load_history((0.4 * seconds, 0.05, axes, (0.05, 0.02, 0.0), force, (0.0, 0.0, 0.01)))
    start = mf.tumbling(rng.uniform(3.0, 8.0) * study._direction(rng), rng.normal(0.0, 2.0, 3))
    q = rng.standard_normal(4)
    start[3:7] = q / np.linalg.norm(q)
    times, samples = mf.flown(TRUTH, start, np.arange(0.0, seconds, 0.01), load)
    turn = rot.turned_back if in_body else (lambda _, vector: vector)
    q, w = samples[:, 3:7], samples[:, 10:13]
    velocity = turn(q, samples[:, 7:10] - rot.turned(q, rot.cross(w, np.broadcast_to(TRUTH.theta[7:10], w.shape))))
    rates = w if in_body else rot.turned(q, w)
    series = [
        ms.Series("/twist", kind, times, values + noise * rng.standard_normal(values.shape), in_body=in_body)
        for kind, values in ((ms.VELOCITY, velocity), (ms.RATE, rates))
    ]
    return ms.MeasuredFlight("flight", tuple(series), load, study.EARTH), start


@pytest.mark.parametrize(
    ("axes", "seed", "seconds", "noise"),
    [
        ("body", 0, 2.0, 0.01),
        ("world", 1, 2.0, 0.01),
        ("world", 2, 2.0, 0.01),
        ("body", 1, 10.0, 0.01),
        # Parts of a flight that no load acts on don't show their turn about the vertical.
        ("world", 4, 10.0, 1e-4),
        # The second stage's segments don't begin where the first one's do.
        ("world", 5, 10.0, 1e-4),
        # The first heading is .3 rad off, and the poked segment's own start alone would go elsewhere for it.
        ("world", 4, 10.0, 0.01),
    ],
)
def test_twists_in_body_axes_without_an_attitude_give_the_body(
    axes: str, seed: int, seconds: float, noise: float
) -> None:
    found = identify([_twists(axes, seed, seconds, noise)[0]])
    assert not found.unidentified
    assert not found.remarks
    assert np.mean(study.normalised_errors(found, TRUTH) ** 2) < 5.0  # ten numbers that hang together


def test_the_first_attitude_follows_from_gravity_and_a_known_force() -> None:
    flight, start = _twists("world", 1)
    poses = poses_of(flight, {"/twist": 0.0}, TRUTH)
    assert poses is not None and poses.is_reckoned
    found = first_attitude(poses, TRUTH, damped=False)
    off = np.linalg.norm(rot.logarithm(rot.product(rot.inverse(start[3:7]), found)))
    assert off < 0.05


def test_reckoned_paths_of_a_fast_tumble_are_as_good_as_its_noise() -> None:
    flight, start = _twists("world", 1, 10.0, 1e-4)  # 17 rad/s
    poses = poses_of(flight, {"/twist": 0.0}, TRUTH)
    assert poses is not None
    found = first_attitude(poses, TRUTH, damped=False)
    off = np.linalg.norm(rot.logarithm(rot.product(rot.inverse(start[3:7]), found)))
    assert off < 0.02  # .003; .18 by trapezoids alone


def test_a_fit_that_leaves_more_than_noise_says_so_before_any_number() -> None:
    flight, _ = _twists("body", 0)
    # Half a gravity more than was said, of which nothing is known: a wrong model.
    wrong = ms.MeasuredFlight("flight", flight.series, flight.load_history, (0.0, 0.0, -4.9))
    found = identify([wrong])
    assert as_json(found)["fits"] is False
    assert as_text(found)[0].startswith("the residuals are larger than the noise")


def test_twists_in_world_axes_without_an_attitude_are_refused_as_nobody_knows_the_bodys_axes() -> None:
    with pytest.raises(InputError, match="no attitude"):
        identify([_twists("body", 0, in_body=False)[0]])
