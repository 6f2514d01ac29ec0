# SPDX-License-Identifier: MIT
"""Thrown bundled bodies, measured with noise and estimated: how far off, in the standard deviations that
the estimate gives itself. Half of the throws carry a phone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import measured_flights as mf
import numpy as np

from rigid_proto_ros.base.bundled import body_names
from rigid_proto_ros.identify import shooting as sh
from rigid_proto_ros.identify.fitting import Estimate, Problem
from rigid_proto_ros.identify.identification import Identification, Known, identify
from rigid_proto_ros.identify.measurements import ACCELERATION, ATTITUDE, POSITION, RATE, MeasuredFlight, topics_of
from rigid_proto_ros.identify.unknowns import DEFAULT_FIT, Values, make_unknowns
from rigid_proto_ros.identify.verdict import Identifiability, Quantity
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.properties import MassProperties
from rigid_proto_ros.mass.tensor import principal_axes, six_from_tensor

EARTH = (0.0, 0.0, -9.81)
SIGMAS = dict(zip((POSITION, ATTITUDE, RATE, ACCELERATION), (*mf.MOCAP, *mf.PHONE), strict=True))
PHONE_FIT = (*DEFAULT_FIT, "offset", "gyro_bias", "accel_bias", "imu_place")


@dataclass(frozen=True)
class Throw:
    """errors: of every number that is told, in its standard deviations; failed: another minimum, or none.

    against_bound: the same errors by name, in the standard deviations of the Cramér-Rao bound, which is the truth's.
    """

    body: str
    errors: list[float]
    failed: bool
    against_bound: dict[str, float]


def bundled_truth(name: str) -> tuple[Values, float]:
    """A bundled body at 1 kg as it was drawn, its tracked frame away from its centre of mass; and half
    its diagonal [m].
    """
    body = mesh_body(name)
    properties = body.moments.mass_properties("solid", density=1000.0)
    size = 0.5 * float(np.linalg.norm(np.ptp(body.vertices, axis=0)))
    com = np.array([0.1, -0.2, 0.15]) * size
    return mf.values_of(properties.mass, com, properties.inertia, EARTH), size


@dataclass(frozen=True)
class MeasuredThrow:
    """A throw of a bundled body, by a number that decides all. size: half its diagonal [m]; start (13,): the tracked
    frame's; fit: what is looked for.
    """

    number: int
    body: str
    truth: Values
    size: float
    start: np.ndarray
    flight: MeasuredFlight
    fit: tuple[str, ...] = DEFAULT_FIT

    def bound(self) -> Estimate:
        """What nobody has: the truth, with its Fisher information."""
        unknowns = make_unknowns(self.fit, topics_of([self.flight]))
        sigmas = {one.name: SIGMAS[one.kind] for one in self.flight.series}
        return Estimate(Problem(sh.cut([self.flight], np.inf), sigmas, self.truth, unknowns), self.truth, [self.start])

    def error(self, found: Values) -> float:
        """How far a body is from the truth, in standard deviations of the Cramér-Rao bound, root mean square of all ten
        directions.
        """
        true = self.truth
        moments, axes = principal_axes(true.inertia)
        d = axes.T @ (found.inertia - true.inertia) @ axes / np.sqrt(np.outer(moments, moments))
        a, b, c = np.diag(d)
        tensor = ((a + b + c) / 3.0, c - 0.5 * (a + b), b - a, d[1, 2], d[0, 2], d[0, 1])
        change = [np.log(found.mass / true.mass), *tensor, *(found.center_of_mass - true.center_of_mass)]
        return float(np.linalg.norm(self.bound().root @ np.array(change)) / np.sqrt(10.0))


def measured_throw(number: int, poked: bool, seconds: float = 2.0, phone: bool = False) -> MeasuredThrow:
    """One flight, with noise; phone: one is fixed on the body, its clock and biases unknown."""
    rng = np.random.default_rng(number)
    names = sorted(body_names())
    name = names[number % len(names)]
    truth, size = bundled_truth(name)
    start = mf.tumbling(rng.uniform(3.0, 8.0) * _direction(rng), rng.normal(0.0, 2.0, 3))
    load = None
    if poked:
        mass = truth.mass
        point = tuple((truth.center_of_mass + 0.6 * size * _direction(rng)).tolist())
        load = mf.load_history((0.4 * seconds, 0.05, "world", point, 20.0 * mass * _direction(rng), (0.0, 0.0, 0.0)))
    if not phone:
        return MeasuredThrow(number, name, truth, size, start, mf.mocap(truth, start, rng, seconds, load=load))
    offset, biases = 0.013, (0.02, 0.1)
    place = 0.5 * size * _direction(rng)
    flight = mf.with_imu(truth, start, rng, seconds, load, offset, place, biases)
    gyro, accel = (np.full(3, bias) for bias in biases)
    truth = replace(truth, offsets={"/imu": offset}, gyro_bias=gyro, accel_bias=accel, imu_place=place)
    return MeasuredThrow(number, name, truth, size, start, flight, PHONE_FIT)


def throw(number: int, poked: bool, first: str = "ball", phone: bool = False) -> Throw:
    """One throw, estimated. first: what the estimate begins with, ``ball`` or ``wrong``: a hundred times
    the mass and a turned tensor.
    """
    made = measured_throw(number, poked, phone=phone)
    begin = _first(first, made.truth, np.random.default_rng([number, 1]))
    found = identify([made.flight], made.fit, Known(body=begin, length=made.size))
    failed = any(
        check.noise > 1.5 * SIGMAS[one.kind] for check, one in zip(found.checks, made.flight.series, strict=True)
    )
    return Throw(made.body, normalised_errors(found, made.truth).tolist(), failed, _against_bound(found, made))


def _against_bound(found: Identification, made: MeasuredThrow) -> dict[str, float]:
    ideal = made.bound()
    bound = Identification([made.flight], ideal, Identifiability(ideal, made.size), [], [])
    names, told, true = _numbers(found, made.truth)
    sds = _numbers(bound, made.truth)[1]
    return {
        name: (one.value - x) / sd.sd
        for name, one, sd, x in zip(names, told, sds, true, strict=True)
        if one.value is not None and sd.sd is not None
    }


def normalised_errors(found: Identification, truth: Values) -> np.ndarray:
    """Of mass, centre of mass and tensor, or its shape, as far as they are told."""
    _, told, true = _numbers(found, truth)
    return np.array([(one.value - x) / one.sd for one, x in zip(told, true, strict=True) if one.value is not None])


def _numbers(found: Identification, truth: Values) -> tuple[list[str], list[Quantity], list[float]]:
    six = np.array(six_from_tensor(truth.inertia))
    tensor, names = found.inertia, ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]
    if any(one.value is None for one in tensor):
        tensor, six, names = found.shape, six / np.trace(truth.inertia), [f"{name} of the trace" for name in names]
    told = [found.mass, *found.center_of_mass, *tensor, *found.others.values()]
    unknowns = found.estimate.unknowns
    others = [unknowns.read(truth, k) for k, (name, _) in enumerate(unknowns.slots) if name not in DEFAULT_FIT]
    names = ["mass", "x", "y", "z", *names, *found.others]
    return names, told, [truth.mass, *truth.center_of_mass, *six, *others]


def _direction(rng: np.random.Generator) -> np.ndarray:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _first(first: str, truth: Values, rng: np.random.Generator) -> MassProperties | None:
    if first == "ball":
        return None
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return MassProperties(100.0 * truth.mass, truth.center_of_mass, 100.0 * turn @ truth.inertia @ turn.T)


def has_phone(number: int) -> bool:
    """Whether this throw of the study carries one."""
    return number % 4 >= 2


def throw_of_study(number: int, first: str = "ball") -> Throw:
    """One of the study: every second one is poked, and of each two neighbouring pairs one carries a phone."""
    return throw(number, poked=number % 2 == 0, first=first, phone=has_phone(number))
