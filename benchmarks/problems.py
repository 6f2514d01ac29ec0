# SPDX-License-Identifier: MIT
"""The problems that integrators are judged on, as plain data: each is solved by us, by peers and by the reference.

All quantities SI, quaternions xyzw. Attitudes and rows follow rigid_proto_ros.motion.state: x, q (body to world), v (world), ω (body).
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, replace

import numpy as np

IDENTITY = (0.0, 0.0, 0.0, 1.0)
ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Wrench:
    """A load from ``begin`` to ``end`` [s], or an impulse at ``begin``.

    axes ``world`` or ``body``; point (3,) [m, body axes, from the COM]; force [N], torque about the point [N m].
    """

    axes: str = "world"
    point: tuple = ZERO
    force: tuple = ZERO
    torque: tuple = ZERO
    begin: float = 0.0
    end: float | None = None
    impulse: bool = False


@dataclass(frozen=True)
class Spring:
    """The string: body point [m, from the COM], fixed world end, stiffness [N/m], damping [N s/m], rest length [m]."""

    point: tuple
    target: tuple
    stiffness: float
    damping: float
    rest_length: float
    bilateral: bool
    frequency: float
    damping_ratio: float


@dataclass(frozen=True)
class Problem:
    """One body, its loads, and how long it flies [s]. row (13,): the state at time 0."""

    name: str
    title: str
    duration: float
    mass: float
    inertia: tuple
    row: tuple
    gravity: tuple = ZERO
    wrenches: tuple[Wrench, ...] = ()
    spring: Spring | None = None
    linear_damping: float = 0.0
    angular_damping: float = 0.0

    @property
    def fingerprint(self) -> str:
        """SHA-256 of all numbers: a cached reference belongs to exactly one of these."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()

    @property
    def has_reference(self) -> bool:
        """Whether its end is known. Undamped at 1e5 rad/s it is chaotic: energy and boundedness judge it."""
        return self.spring is None or self.spring.damping > 0.0 or self.spring.frequency < 1e5

    @property
    def torque_free(self) -> bool:
        """Nothing but gravity acts."""
        return not self.wrenches and self.spring is None and self.linear_damping == self.angular_damping == 0.0

    @property
    def conservative(self) -> bool:
        """Energy, the string's and gravity's potential included, stays what it was."""
        damped = self.linear_damping or self.angular_damping or (self.spring is not None and self.spring.damping)
        return not (self.wrenches or damped)

    @property
    def constant_body_wrench(self) -> bool:
        """The only wrench is fixed to the body and acts all the time: what most peers can express."""
        return all(w.axes == "body" and w.end is None and w.begin == 0.0 and not w.impulse for w in self.wrenches)


def tuples(matrix) -> tuple:
    """An array as nested tuples of floats."""
    return tuple(tuple(float(x) for x in row) for row in np.asarray(matrix))


def rotation(q) -> np.ndarray:
    """Rotation matrix (3, 3) of a quaternion xyzw of any length."""
    x, y, z, w = np.asarray(q, dtype=float)
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
        ]
    )


TURN = rotation((0.2, -0.4, 0.4, 0.8))

# Sums are written out: BLAS rounds them by processor and sum() by Python's version (it compensates from 3.12 on), and a
# cached reference belongs to one set of bits.


def _dot(a, b) -> float:
    return float(a[0]) * float(b[0]) + float(a[1]) * float(b[1]) + float(a[2]) * float(b[2])


def _times(matrix, vector) -> list[float]:
    return [_dot(row, vector) for row in matrix]


def _turned(moments) -> np.ndarray:
    """R diag(moments) Rᵀ, symmetric to the last bit."""
    return np.array([[_dot(TURN[i] * TURN[j], moments) for j in range(3)] for i in range(3)])


def _cross(a, b) -> list[float]:
    return [float(a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]) for k in range(3)]


def _spin(w, position=ZERO, velocity=ZERO) -> tuple:
    return tuple(float(c) for c in (*position, *IDENTITY, *velocity, *w))


P1 = Problem(
    "P1",
    "torque-free, near the separatrix",
    100.0,
    1.0,
    tuples(np.diag([1.0, 2.0, 3.0])),
    _spin((1e-3, 1.0, 1e-3)),
)
P1B = Problem(
    "P1b",
    "P1 with a full tensor",
    100.0,
    1.0,
    tuples(_turned([1.0, 2.0, 3.0])),
    _spin(_times(TURN, [1e-3, 1.0, 1e-3])),
)
_P2_FORCE = Wrench("body", (0.2, 0.1, -0.15), (0.5, -0.3, 0.8))


def _p2(name: str, title: str, spin: float) -> Problem:
    row = _spin(_times(TURN, [0.3 * spin, spin, -0.2 * spin]))
    return Problem(name, title, 10.0, 2.0, P1B.inertia, row, (0.0, 0.0, -9.81), (_P2_FORCE,))


P2 = _p2("P2", "force fixed to a body point, gravity", 1.0)
P2_FAST = _p2("P2x100", "P2 with 100 times the spin", 100.0)
_AXIS = np.array([1.0, 2.0, 2.0]) / 3.0
P4_ROD = Problem(
    "P4rod",
    "rod at 1000 rad/s",
    10.0,
    1.0,
    tuples(np.diag([1e-6, 1.0, 1.0 + 5e-7])),
    _spin(1000.0 * _AXIS),
)
P4_PLATE = Problem(
    "P4plate",
    "plate at 1000 rad/s",
    10.0,
    1.0,
    tuples(np.diag([1e-3, 1.0, 1.001])),
    _spin(1000.0 * _AXIS),
)


def effective_mass(mass: float, inertia, arm, direction) -> float:
    """m_eff = 1/(1/m + (r×n)ᵀ I⁻¹ (r×n)): what a string along n feels at the body point r."""
    turn = _cross(arm, direction)
    adjugate = [
        _cross(inertia[1], inertia[2]),
        _cross(inertia[2], inertia[0]),
        _cross(inertia[0], inertia[1]),
    ]
    determinant = _dot(inertia[0], adjugate[0])
    turned = [_dot(column, turn) / determinant for column in zip(*adjugate, strict=True)]
    return 1.0 / (1.0 / mass + _dot(turn, turned))


def string_problem(frequency: float, damping_ratio: float, bilateral: bool, duration: float = 1.0) -> Problem:
    """P3: a 2 kg body hung by an offset point on a string of 1 m, for ω_s [rad/s] and ζ; starts at rest length."""
    mass, inertia, arm = 2.0, _turned([0.02, 0.03, 0.04]), np.array([0.1, 0.15, 0.2])
    target, up, w = (
        np.array([0.0, 0.0, 2.0]),
        np.array([0.0, 0.0, 1.0]),
        np.array([0.5, -1.0, 2.0]),
    )
    m_eff = effective_mass(mass, inertia, arm, up)
    k = m_eff * frequency**2
    spring = Spring(
        tuple(map(float, arm)),
        tuple(map(float, target)),
        k,
        2.0 * damping_ratio * (k * m_eff) ** 0.5,
        1.0,
        bilateral,
        frequency,
        damping_ratio,
    )
    velocity = -up * _cross(w, arm)[2]
    kind = "bilateral" if bilateral else "pull-only"
    return Problem(
        f"P3{'b' if bilateral else 'p'}_w{frequency:g}_z{damping_ratio:g}",
        f"{kind} string, {frequency:g} rad/s, damping ratio {damping_ratio:g}",
        duration,
        mass,
        tuples(inertia),
        _spin(w, target - up - arm, velocity),
        (0.0, 0.0, -9.81),
        spring=spring,
    )


STRING_FREQUENCIES = (10.0, 100.0, 1e3, 1e4, 1e5)
P3 = tuple(
    string_problem(frequency, ratio, bilateral)
    for bilateral in (True, False)
    for ratio in (0.0, 0.1)
    for frequency in STRING_FREQUENCIES
)


def _heavy() -> Problem:
    """A crate of one ton swings on a rope of 3 m tied to its corner; it starts 40° from the vertical, taut by its weight."""
    mass, inertia, arm = (
        1000.0,
        np.diag([140.0, 150.0, 200.0]),
        np.array([0.4, 0.3, 0.5]),
    )
    angle = np.radians(40.0)
    up = np.array([np.sin(angle), 0.0, np.cos(angle)])
    m_eff = effective_mass(mass, inertia, arm, up)
    k = m_eff * 30.0**2
    length = 3.0 + mass * 9.81 * np.cos(angle) / k
    position = -length * up - arm
    spring = Spring(tuple(map(float, arm)), ZERO, k, 0.2 * (k * m_eff) ** 0.5, 3.0, False, 30.0, 0.1)
    return Problem(
        "heavy",
        "one ton on a string of 3 m",
        5.0,
        mass,
        tuples(inertia),
        _spin((0.0, 0.0, 0.2), position),
        (0.0, 0.0, -9.81),
        spring=spring,
    )


HEAVY = _heavy()
DAMPED = Problem(
    "damped",
    "tumbling with damping and gravity",
    10.0,
    2.0,
    P1B.inertia,
    _spin(_times(TURN, [0.6, 4.0, -1.5]), velocity=(1.0, 2.0, 5.0)),
    (0.0, 0.0, -9.81),
    linear_damping=0.5,
    angular_damping=0.3,
)
# The tensor of a T-handle of 1.2 kg; the pokes hit it at its ends, in the order in which somebody would try them.
POKES = Problem(
    "pokes",
    "a scripted poke session",
    6.0,
    1.2,
    tuples(np.diag([2.1e-3, 3.0e-3, 5.0e-3])),
    _spin((0.0, 0.0, 0.0)),
    ZERO,
    (
        Wrench("world", (0.0, 0.05, 0.0), (0.0, 0.0, 1.5), begin=0.5, end=0.55),
        Wrench("body", (0.08, 0.0, 0.0), (0.0, 0.8, 0.3), begin=1.0, end=1.05),
        Wrench("world", ZERO, (0.2, 0.0, 0.0), (0.0, 0.002, 0.0), begin=1.5, end=3.0),
        Wrench("world", (-0.02, 0.05, 0.0), (0.02, -0.05, 0.03), begin=2.0, impulse=True),
        Wrench("body", (-0.02, -0.05, 0.01), (1.0, 0.0, 0.5), begin=3.2, end=3.25),
        Wrench("world", (0.08, 0.0, 0.0), (0.0, 0.0, -1.2), begin=4.0, end=4.123456789),
    ),
)

PROBLEMS = {p.name: p for p in (P1, P1B, P2, P2_FAST, *P3, P4_ROD, P4_PLATE, HEAVY, DAMPED, POKES)}

STARTS = ((0.0, 0.0, 0.0), (0.1, -0.05, 0.2), (-0.2, 0.1, 0.05))
"""Added to a problem's spin [rad/s, body axes]."""
ENDS = (1.0, 0.8)
"""Parts of a problem's duration."""


def variants(problem: Problem) -> list[Problem]:
    """The problem, and the same from other starts and to another end: an error that happens to pass zero at one of them
    says nothing about an integrator.
    """
    found = []
    for number, spin in enumerate(STARTS):
        row = (*problem.row[:10], *(a + b for a, b in zip(problem.row[10:], spin, strict=True)))
        for part in ENDS:
            name = f"{problem.name}_start{number}_end{part:g}"
            found.append(replace(problem, name=name, row=row, duration=part * problem.duration))
    return [problem, *found[1:]]


JUDGED_BY_VARIANTS = ("P2", "P2x100", "damped", "heavy", "pokes")
VARIANTS = {p.name: p for name in JUDGED_BY_VARIANTS for p in variants(PROBLEMS[name])[1:]}
