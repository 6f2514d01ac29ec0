# SPDX-License-Identifier: MIT
"""What a motion can tell is said before any number, and what it can't is never a number."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import measured_flights as mf
import numpy as np
import pytest

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.identify import measurements as ms
from rigid_proto_ros.identify.identification import Known, as_json, as_text, as_urdf, identify
from rigid_proto_ros.mass.properties import MassProperties

INERTIA = np.diag([2.0, 3.0, 4.0]) * 1e-3
POKE = (0.5, 0.05, "world", (0.05, 0.02, 0.0), (0.0, 0.5, 2.0), (0.0, 0.0, 0.01))


SPIN = (0.4, 6.0, 0.3)


@cache
def _identified(rate, is_poked=False, known=None, noise=mf.MOCAP):
    truth = mf.values_of(0.5, (0.01, -0.02, 0.03), INERTIA)
    load = mf.load_history(POKE) if is_poked else None
    flight = mf.mocap(truth, mf.tumbling(rate), np.random.default_rng(1), 2.0, load=load, noise=noise)
    return identify([flight], known=known)


def _what(found) -> set[str]:
    return {one.what for one in found.unidentified}


@pytest.mark.parametrize("noise", [mf.MOCAP, (1e-9, 1e-9)])
def test_a_free_tumble_tells_the_shape_of_the_tensor_and_its_size_is_null_and_no_urdf(noise) -> None:
    found = _identified(SPIN, noise=noise)
    assert _what(found) == {"mass", "size of the tensor"}
    assert found.mass.value is None
    assert all(one.value is None for one in found.inertia)
    assert all(one.value is not None for one in (*found.shape, *found.center_of_mass))
    assert "poke" in next(one.remedy for one in found.unidentified if one.what == "size of the tensor")
    assert any(line.startswith("gravity 0 0 0") for line in found.assumed)
    values = as_json(found)
    assert values["mass"] is None and values["inertia"]["ixx"] is None
    assert values["principal_moments"] == [None] * 3
    assert values["inertia_over_trace"]["ixx"]["value"] == pytest.approx(2.0 / 9.0, abs=0.01)
    with pytest.raises(InputError, match="not identified: mass"):
        as_urdf(found)


def test_a_flight_without_spin_tells_nothing_of_the_body() -> None:
    found = _identified((0.0, 0.0, 0.0))
    assert len(found.unidentified) == 10
    assert found.verdict.startswith("identified from this motion: none of the requested")
    assert not any("±" in line for line in as_text(found))


def test_a_spin_about_a_principal_axis_tells_only_the_centre_of_mass_across_it() -> None:
    found = _identified((0.0, 0.0, 5.0))
    assert [one.value is not None for one in found.center_of_mass] == [True, True, False]
    assert all(one.value is None for one in found.shape)
    assert "centre of mass along z" in _what(found)


def test_a_known_mass_fixes_the_mass_and_a_known_poke_all() -> None:
    assert _what(_identified(SPIN, known=Known(mass=0.5))) == {"size of the tensor"}
    assert not _identified(SPIN, is_poked=True).unidentified


def test_what_is_neither_asked_for_nor_given_is_no_number() -> None:
    truth = mf.values_of(0.5, (0.01, -0.02, 0.03), INERTIA, (0.0, 0.0, -9.81))
    flight = mf.mocap(truth, mf.tumbling(SPIN), np.random.default_rng(1), 1.5)
    found = identify([flight], fit=("com", "inertia"))
    assert found.mass.value is None
    assert all(one.value is not None for one in (*found.center_of_mass, *found.shape))
    bare = identify([flight], fit=("gravity",))
    assert all(one.value is None for one in (*bare.center_of_mass, *bare.inertia, *bare.shape, *bare.moments))
    given = Known(body=MassProperties(truth.mass, truth.center_of_mass, truth.inertia))
    assert identify([flight], fit=("gravity",), known=given).mass.value == pytest.approx(0.5)


def test_a_flight_without_poses_or_with_too_few_is_refused() -> None:
    truth = mf.values_of(0.5, (0.01, -0.02, 0.03), INERTIA)
    flight = mf.with_imu(truth, mf.tumbling(), np.random.default_rng(1), 1.0)
    with pytest.raises(InputError, match="has no poses"):
        identify([replace(flight, series=flight.series[2:])])
    few = mf.mocap(truth, mf.tumbling(), np.random.default_rng(1), 0.03)
    with pytest.raises(InputError, match="has 3 samples"):
        identify([few])


def _with(flight, kinds, convert):
    series = [replace(one, values=convert(one.values)) if one.kind in kinds else one for one in flight.series]
    return replace(flight, series=tuple(series))


@pytest.mark.parametrize(
    ("kinds", "convert", "gravity", "cause"),
    [
        ((ms.POSITION,), lambda v: 1e3 * v, (0.0, 0.0, -9.81), "positions that aren't in m"),
        ((ms.RATE,), np.degrees, (0.0, 0.0, -9.81), "rates in degrees"),
        ((ms.ACCELERATION,), lambda v: v / 9.80665, (0.0, 0.0, -9.81), "accelerations in g"),
        ((), None, (0.0, -9.81, 0.0), "gravity along another axis"),
        ((ms.ATTITUDE,), lambda q: np.roll(q, 1, axis=1), (0.0, 0.0, -9.81), "quaternions that begin with w"),
    ],
)
def test_a_unit_or_an_axis_that_was_taken_for_another_is_named(kinds, convert, gravity, cause) -> None:
    truth = mf.values_of(0.5, (0.01, -0.02, 0.03), INERTIA, (0.0, 0.0, -9.81))
    rng = np.random.default_rng(1)
    load = mf.load_history((0.2, *POKE[1:]))
    flight = mf.with_imu(truth, mf.tumbling((1.0, 6.0, 2.0)), rng, 0.5, load, bias=(0.02, 0.1))
    fit = ("mass", "com", "inertia", "gyro_bias", "accel_bias")
    flight = replace(_with(flight, kinds, convert), gravity=gravity)
    found = identify([flight], fit)
    assert not found.fits
    assert cause in found.remarks[0]
