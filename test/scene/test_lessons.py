# SPDX-License-Identifier: MIT
"""What each bundled scene says that one will see, as physical assertions on the very motion that it gives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from lesson_flights import Flight, Z, degrees_between, fly


def test_t_handle_turns_over_every_two_to_three_seconds_while_momentum_and_energy_stay() -> None:
    flight = fly("t_handle", 10.0)
    flips = flight.flips(axis=2)
    assert len(flips) == 4
    assert np.all((np.diff(flips) > 2.0) & (np.diff(flips) < 3.0))
    assert flight.momentum_about(axis=2).min() < -0.999
    assert degrees_between(flight.momentum, flight.momentum[0]).max() < 1e-5  # measured 1.5e-6
    assert np.ptp(flight.energy) < 1e-9 * flight.energy[0]
    assert degrees_between(flight.spin, flight.spin[0]).max() > 15.0


def test_t_handle_flips_faster_after_a_sideways_poke_at_its_tip() -> None:
    flips = fly("t_handle", 12.0, script="flip_and_poke").flips(axis=2)
    after = flips[(flips > 4.2) & (flips < 8.0)]
    assert len(after) >= 4
    assert np.allclose(np.diff(after), 0.9, atol=0.05)


def test_rubber_band_lifts_the_t_handle_and_lets_it_go() -> None:
    flight = fly("t_handle", 8.0, script="pull_on_string")
    assert np.abs(flight.position[flight.at(1.0)]).max() == 0.0
    assert flight.position[flight.at(4.0), 2] > 0.05
    assert flight.position[flight.at(7.0), 0] > 0.05
    assert flight.simulation.string is None
    assert np.array_equal(flight.velocity[flight.at(7.0)], flight.velocity[-1])


def test_ballast_at_the_tip_makes_the_stem_the_smallest_moment_and_ends_the_flips() -> None:
    bare, loaded = fly("ballast_stops_flip", 15.0), fly("ballast_stops_flip", 15.0, ballast__tip=[0.03, 0.0, 0.0, 0.07])
    x, y, z = bare.body.inertia.diagonal()
    assert y < z < x
    x, y, z = loaded.body.inertia.diagonal()
    assert z < y < x
    assert len(bare.flips(axis=2)) == 5
    assert len(loaded.flips(axis=2)) == 0
    assert loaded.momentum_about(axis=2).min() > 0.999


def test_ballast_moves_the_flip_to_the_crossbar() -> None:
    about_the_crossbar = {"initial__angular_velocity": [0.05, 12.0, 0.1]}
    assert len(fly("ballast_stops_flip", 10.0, **about_the_crossbar).flips(axis=1)) == 0
    loaded = fly("ballast_stops_flip", 10.0, ballast__tip=[0.03, 0.0, 0.0, 0.07], **about_the_crossbar)
    assert len(loaded.flips(axis=1)) >= 3


def test_ballast_in_flight_stops_the_flips_and_taking_it_off_brings_them_back() -> None:
    flips = fly("ballast_stops_flip", 30.0, script="ballast_in_flight").flips(axis=2)
    assert np.count_nonzero(flips < 6.0) == 2
    assert np.count_nonzero((flips > 6.0) & (flips < 20.0)) == 0
    assert np.count_nonzero(flips > 20.0) >= 3


def test_thrown_hammer_keeps_to_newtons_parabola_whatever_its_spin() -> None:
    for spin in ([0.5, 12.0, 0.5], [3.0, -5.0, 20.0]):
        flight = fly("thrown_hammer", 1.1, interval_s=0.001, initial__angular_velocity=spin)
        t = flight.time[:, None]
        parabola = [0.0, 0.0, 1.5] + t * [1.5, 0.0, 5.0] + 0.5 * t**2 * [0.0, 0.0, -9.81]
        assert np.abs(flight.position - parabola).max() < 1e-14  # measured 4e-16
    back = 2.0 * 5.0 / 9.81
    assert math.isclose(back, 1.02, abs_tol=1e-3)
    # The grip's own path is no parabola: it leaves the COM's by up to its distance.
    grip = flight.position + flight.rotation @ flight.body.point((0.0, 0.0, 0.0))
    away = np.linalg.norm(grip - parabola - (grip - parabola)[0], axis=1)
    assert away.max() > 0.2


def test_a_book_ten_times_as_heavy_tumbles_alike_and_is_pushed_to_a_tenth_of_the_speed() -> None:
    light, heavy = (
        fly("weigh_by_throwing", 2.0, density=700.0),
        fly("weigh_by_throwing", 2.0, density=7000.0),
    )
    assert np.abs(light.rotation - heavy.rotation).max() < 1e-12  # measured 1e-14
    light, heavy = (
        fly("weigh_by_throwing", 4.0, script="weigh_by_throwing", density=density) for density in (700.0, 7000.0)
    )
    assert light.velocity[-1] == pytest.approx(10.0 * heavy.velocity[-1], abs=1e-12)
    # 5 N for .05 s over .634 kg.
    assert np.linalg.norm(light.velocity[-1]) == pytest.approx(0.394, abs=5e-4)
    assert np.linalg.norm(light.spin[-1]) > 2.0 * np.linalg.norm(light.spin[0])


def test_true_tensor_wobbles_and_turns_over_where_the_box_spins_as_on_an_axle() -> None:
    true, box = fly("true_or_box_tensor", 10.0), fly("true_or_box_tensor", 10.0, inertia_model="bounding_box")
    assert 30.0 < degrees_between(true.spin, Z).max() < 37.0  # measured 36.5
    assert degrees_between(true.rotation[:, :, 2], Z).max() > 150.0
    assert degrees_between(box.spin, Z).max() == 0.0
    assert box.body.mass == true.body.mass
    assert np.array_equal(box.body.center_of_mass, true.body.center_of_mass)
    box = fly("true_or_box_tensor", 0.01, inertia_model="bounding_box", inertia_model_com="model")
    apart = np.linalg.norm(box.body.center_of_mass - true.body.center_of_mass)
    assert apart == pytest.approx(0.0244, abs=1e-4)
    error = np.abs(box.body.principal_moments / true.body.principal_moments - 1.0)
    assert error.min() == pytest.approx(0.129, abs=1e-3)
    assert error.max() == pytest.approx(0.378, abs=1e-3)


def test_dropped_term_keeps_energy_and_the_size_of_l_but_not_its_direction() -> None:
    wrong, right = fly("dropped_term", 10.0), fly("dropped_term", 10.0, gyroscopic=True)
    size = np.linalg.norm(wrong.momentum, axis=1)
    assert np.ptp(size) < 1e-12 * size[0]  # measured 5e-16
    assert np.ptp(wrong.energy) < 1e-12 * wrong.energy[0]
    assert degrees_between(wrong.momentum, wrong.momentum[0]).max() == pytest.approx(39.6, abs=0.1)
    assert degrees_between(wrong.spin, wrong.spin[0]).max() < 1e-3
    assert degrees_between(right.momentum, right.momentum[0]).max() < 1e-5
    assert degrees_between(right.spin, right.spin[0]).max() > 40.0


@pytest.mark.parametrize("attach", ["corner", "spine"])
def test_plumb_line_comes_to_rest_through_the_centre_of_mass(attach: str) -> None:
    point = {"corner": [0.074, 0.105, 0.0138], "spine": [-0.08, 0.0, 0.0]}[attach]
    flight = fly("plumb_line", 40.0, interval_s=0.05, string__attach=point)
    body = flight.body
    knot_to_com = flight.rotation @ -body.point(point)
    tilt = degrees_between(knot_to_com, -Z)
    assert tilt[0] > 80.0
    # A hundredth of a degree, as its page says: measured 0.011 at the corner and 0.010 at the spine.
    assert tilt[flight.time >= 30.0].max() < 0.015
    assert tilt[-1] < 0.01  # measured 0.001
    # The knot hangs below the nail, lower than the rest length by the weight over the stiffness.
    knot = flight.position[-1] - knot_to_com[-1]
    assert np.abs(knot - [0.0, 0.0, -0.4 - body.mass * 9.81 / 2000.0]).max() < 1e-4


def test_top_on_a_string_walks_at_the_rate_of_its_weight_over_its_momentum() -> None:
    def walk(spin: float) -> tuple[Flight, float]:
        flight = fly("top_on_string", 10.0, interval_s=0.005, initial__angular_velocity=[0.0, -spin, 0.0])
        stem = flight.rotation[:, :, 2]
        azimuth = np.unwrap(np.arctan2(stem[:, 1], stem[:, 0]))
        return flight, abs(azimuth[-1] - azimuth[0]) / 10.0

    flight, rate = walk(600.0)
    body = flight.body
    arm = np.linalg.norm(body.point((0.0, 0.0, 0.075)))
    assert rate == pytest.approx(1.6, abs=0.05)
    assert rate == pytest.approx(body.mass * 9.81 * arm / (body.principal_moments[2] * 600.0), rel=0.01)
    assert np.abs(np.degrees(np.arcsin(flight.rotation[:, 2, 2]))).max() < 3.0  # it doesn't fall: measured 2.2°
    assert walk(300.0)[1] == pytest.approx(2.0 * rate, rel=0.05)


def test_top_without_spin_falls() -> None:
    flight = fly("top_on_string", 2.0, initial__angular_velocity=[0.0, 0.0, 0.0])
    assert np.degrees(np.arcsin(flight.rotation[:, 2, 2])).max() > 80.0


def test_push_at_the_rim_moves_the_centre_of_mass_alike_and_costs_four_times_the_energy() -> None:
    flight = fly("com_or_rim", 6.0, script="com_or_rim")
    after_com, stopped, after_rim = (flight.at(t) for t in (2.0, 4.0, 6.0))
    assert flight.velocity[after_com, 2] == pytest.approx(0.1 / flight.body.mass, rel=1e-13)
    assert flight.velocity[after_com, 2] == pytest.approx(0.27, abs=0.005)
    assert np.abs(flight.velocity[stopped]).max() < 1e-16
    assert flight.velocity[after_rim, 2] == pytest.approx(flight.velocity[after_com, 2], rel=1e-13)
    assert np.abs(flight.spin[after_com]).max() == 0.0
    assert np.linalg.norm(flight.spin[after_rim]) == pytest.approx(2.26, abs=0.01)
    assert flight.energy[after_rim] / flight.energy[after_com] == pytest.approx(4.0, abs=0.05)


@pytest.mark.parametrize(
    "scene, fast, slow, unsteady", [("book", 8.0, 0.05, 0), ("tennis_racket", 6.0, 0.03, 1)], ids=["book", "racket"]
)
def test_book_and_racket_spin_steadily_about_two_axes_and_not_about_the_middle_one(
    scene: str, fast: float, slow: float, unsteady: int
) -> None:
    for axis in range(3):
        spin = [slow] * 3
        spin[axis] = fast
        flight = fly(scene, 10.0, initial__angular_velocity=spin)
        assert (len(flight.flips(axis)) == 0) == (axis != unsteady)
    if scene == "tennis_racket":
        moments = flight.body.principal_moments
        assert moments[2] / moments[1] == pytest.approx(1.09, abs=0.005)
        assert moments[0] / moments[1] == pytest.approx(0.1, abs=0.01)


def test_l_bracket_wobbles_at_once_and_without_the_gyroscopic_term_not_at_all() -> None:
    assert degrees_between(fly("l_bracket", 2.0).spin, Z).max() > 5.0
    calm = fly("l_bracket", 10.0, gyroscopic=False)
    assert degrees_between(calm.spin, Z).max() < 1e-3
    assert degrees_between(calm.momentum, calm.momentum[0]).max() > 5.0


def test_numbers_of_a_tensor_a_spin_about_z_gives_l_a_part_along_x_and_one_about_a_principal_axis_none() -> None:
    flight = fly("numbers_of_a_tensor", 2.0)
    inertia = flight.body.inertia
    assert np.allclose(flight.momentum[0], inertia[:, 2] * 4.0)
    assert inertia[0, 2] / inertia[2, 2] == pytest.approx(0.266, abs=1e-3)
    assert degrees_between(flight.spin, Z).max() > 5.0
    moments, axes = np.linalg.eigh(inertia)
    assert np.abs(axes.T @ inertia @ axes - np.diag(moments)).max() < 1e-17
    steady = fly("numbers_of_a_tensor", 2.0, initial__angular_velocity=(4.0 * axes[:, 2]).tolist())
    assert degrees_between(steady.momentum, steady.spin[0]).max() < 1e-3
    assert degrees_between(steady.spin, steady.spin[0]).max() < 1e-3
    about_y = fly("numbers_of_a_tensor", 2.0, initial__angular_velocity=[0.0, 4.0, 0.0])
    assert math.degrees(math.acos(abs(axes[1, 2]))) == pytest.approx(2.4, abs=0.05)
    assert degrees_between(about_y.spin, [0.0, 1.0, 0.0]).max() < 10.0


def test_the_handle_turns_over_as_it_does_nowhere_without_the_term_and_gains_energy_with_long_steps() -> None:
    assert np.allclose(fly("engine", 10.0).flips(axis=2), [1.62, 4.33, 7.04, 9.76], atol=0.02)
    without = fly("engine", 60.0, gyroscopic=False, interval_s=0.05)
    assert len(without.flips(axis=2)) == 0
    assert math.isclose(degrees_between(without.momentum, without.momentum[0]).max(), 0.43, abs_tol=0.005)
    long_steps, short_steps = (
        fly("engine", 10.0, integrator="semi_implicit_euler", step=step) for step in (0.016666667, 0.001)
    )
    assert np.allclose(long_steps.flips(axis=2), [1.7, 4.4, 7.2, 9.9], atol=0.06)
    energy = long_steps.energy / long_steps.energy[0]
    assert math.isclose(long_steps.time[np.argmax(energy > 1.1)], 1.7, abs_tol=0.05)
    assert math.isclose(energy[-1], 2.13, abs_tol=0.01)
    assert math.isclose(short_steps.energy[-1] / short_steps.energy[0], 1.04, abs_tol=0.001)


def test_a_wheel_beyond_the_limit_keeps_the_satellite_on_its_middle_axis_and_half_of_it_does_not() -> None:
    bare = fly("flywheel", 20.0)
    assert np.allclose(bare.flips(axis=1), [3.0, 7.7, 12.5, 17.2], atol=0.06)
    a, b, c = bare.body.principal_moments
    assert (c - b) * 6.0 == pytest.approx(0.0064, abs=5e-5)
    assert (b - a) * 6.0 == pytest.approx(0.0187, abs=5e-5)

    def tipped(h: float) -> float:
        flight = fly("flywheel", 20.0, rotor__momentum=[0.0, h, 0.0])
        assert degrees_between(flight.momentum, flight.momentum[0]).max() < 1e-5
        return float(np.degrees(np.arccos(np.clip(flight.momentum_about(1), -1.0, 1.0))).max())

    assert tipped(0.01) == pytest.approx(3.8, abs=0.1)
    assert tipped(0.003) == pytest.approx(89.4, abs=0.2)
    assert tipped(-0.01) == pytest.approx(104.8, abs=0.2)
    assert tipped(-0.02) == pytest.approx(13.5, abs=0.2)
    assert tipped(0.0058) > 25.0 > 20.0 > tipped(0.0065)  # on either side of the limit


def test_a_motor_turns_a_satellite_at_rest_back_against_its_wheel() -> None:
    rest = {"initial__angular_velocity": [0.0, 0.0, 0.0], "rotor__torque": [0.0, 0.002, 0.0]}
    flight = fly("flywheel", 2.0, **rest)
    assert np.abs(flight.momentum).max() < 1e-15
    assert flight.spin[-1] == pytest.approx([0.0, -0.004 / flight.body.principal_moments[1], 0.0], abs=1e-9)
    assert flight.spin[-1, 1] == pytest.approx(-0.62, abs=0.005)
    spun_up = fly("flywheel", 20.0, script="wheel_spun_up")
    assert degrees_between(spun_up.momentum, spun_up.momentum[0]).max() < 1e-5
    assert spun_up.spin[spun_up.at(1.0), 1] == pytest.approx(4.45, abs=0.01)
    assert len(spun_up.flips(axis=1)) == 0


def test_omega_wanders_round_l_in_a_plane_while_l_stays() -> None:
    flight = fly("poinsot", 12.0)
    assert np.allclose(flight.flips(axis=0), [1.0, 3.8, 6.6, 9.4], atol=0.06)
    assert degrees_between(flight.momentum, flight.momentum[0]).max() < 1e-5
    upright = flight.momentum[0] / np.linalg.norm(flight.momentum[0])
    along = flight.spin @ upright
    assert np.ptp(along) < 1e-13 * along[0]  # measured 2e-15
    away = degrees_between(flight.spin, upright)
    assert math.isclose(away.min(), 2.3, abs_tol=0.1) and math.isclose(away.max(), 28.4, abs_tol=0.1)
    steady = fly("poinsot", 12.0, initial__angular_velocity=[0.4, 0.8, 5.0])
    away = degrees_between(steady.spin, steady.momentum[0] / np.linalg.norm(steady.momentum[0]))
    assert len(steady.flips(axis=2)) == 0 and away.min() > 3.0 and away.max() < 6.5
