# SPDX-License-Identifier: MIT
"""Bodies of many variations, compiled: from a row of settings and a mesh's ten numbers to what a flight needs.

Every operation stands in the order in which ``scenario`` does it, so the bits are its own. Whatever is out of the
ordinary (a bound, a doubtful tensor) makes no body: the caller then asks the simulation, which knows what to say.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from ..base.exact_arithmetic import exact_quotient
from ..base.rotation import Vector
from ..mass.closed_form import Principal, given_mass, is_plainly_good, spread_mass
from ..mass.properties import SCALE_LIMITS
from ..mass.tensor import principal_axes_kernel
from ..motion.body import AXES, COM, LENGTH, MASS, MOMENTS, arm, fill_body
from ..motion.integrators.auto import FASTEST
from ..motion.problem import KNOT, ORIGIN, PUSHES, REST, TARGET, C, K
from ..motion.state import fill_initial_row
from ..motion.string import effective_mass, energy_of, most_yielding, span_of, spring_of

# A row of settings.
SCALE = 0  # (3,)
BODY_MASS = 3  # [kg], 0: the density decides
DENSITY = 4  # [kg/m³]
GIVEN_MASS = 5  # of the explicit model [kg]
GIVEN_CENTER = 6  # (3,) [mesh coordinates]
GIVEN_TENSOR = 9  # (6,) ixx ixy ixz iyy iyz izz [kg m²]
GRAVITY = 15  # (3,) [m/s², world]
LINEAR_DAMPING = 18  # [N s/m]
ANGULAR_DAMPING = 19  # [N m s]
POSITION = 20  # (3,) at time 0 [m, world]
ORIENTATION = 23  # (4,) at time 0, xyzw, of any length
VELOCITY = 27  # (3,) at time 0 [m/s, world]
ANGULAR_VELOCITY = 30  # (3,) at time 0 [rad/s, world]
ACCURACY = 33  # local error rate
# Of a string that is tied at time 0:
STRING_ATTACH = 34  # (3,) [mesh coordinates]
STRING_TARGET = 37  # (3,) [m, world]
STRING_STIFFNESS = 40  # [N/m]
STRING_FREQUENCY = 41  # [rad/s], > 0 wins over the stiffness
STRING_DAMPING_RATIO = 42
STRING_REST_LENGTH = 43  # [m]
SETTINGS = 44

# A row of times.
STEP_NS, TIMEOUT_NS, POKE_NS, DEGREE = range(4)
TIMES = 4

# What of a mesh doesn't change with the settings.
SOLID_MEASURE = 0  # volume at unit scale; NaN when the surface bounds none
MEASURE = 1  # of the model: volume, area or number of points
REFERENCE = 2  # (3,)
CENTER = 5  # (3,)
CENTER_LOW = 8  # (3,)
SECOND = 11  # (6,)
EXTENT = 17  # (3,) of the bounding box
HAS_SURFACE = 20
MODEL = 21  # EXPLICIT, ORDINARY or SHELL
GYROSCOPIC = 22
TIED = 23  # whether a string is tied at time 0
BILATERAL = 24
CONSTANTS = 25

EXPLICIT, ORDINARY, SHELL = 0, 1, 2


@njit(cache=True, error_model="numpy")
def _points_with_mass(ballast: np.ndarray) -> tuple[np.ndarray, bool]:
    """The rows of ``ballast`` (k, 4) with a mass; and whether all are in order."""
    count = 0
    for k in range(ballast.shape[0]):
        if not ballast[k, 0] >= 0.0:
            return ballast, False
        for j in range(4):
            if not math.isfinite(ballast[k, j]):
                return ballast, False
        if ballast[k, 0] > 0.0:
            count += 1
    if count == ballast.shape[0]:
        return ballast, True
    points = np.empty((count, 4))
    at = 0
    for k in range(ballast.shape[0]):
        if ballast[k, 0] > 0.0:
            points[at, :] = ballast[k, :]
            at += 1
    return points, True


_Made = tuple[float, np.ndarray, np.ndarray, Principal, bool]


@njit(cache=True, error_model="numpy")
def _explicit(s: np.ndarray, settings: np.ndarray, points: np.ndarray) -> _Made:
    """Mass, COM (3,), inertia (3, 3), its principal moments and axes, and whether the numbers are plainly good."""
    given = settings[GIVEN_TENSOR : GIVEN_TENSOR + 6]
    inertia = np.empty((3, 3))
    inertia[0, 0], inertia[1, 1], inertia[2, 2] = given[0], given[3], given[5]
    inertia[0, 1] = inertia[1, 0] = given[1]
    inertia[0, 2] = inertia[2, 0] = given[2]
    inertia[1, 2] = inertia[2, 1] = given[4]
    mass = settings[GIVEN_MASS]
    center = settings[GIVEN_CENTER : GIVEN_CENTER + 3]
    good = 0.0 < mass < math.inf
    # Without ballast the tensor that comes out is the one given.
    if points.shape[0] > 0:
        good = good and is_plainly_good(principal_axes_kernel(inertia)[0])
    total, com, gathered, principal, _, _ = given_mass(mass, center, inertia, s, points)
    return total, com, gathered, principal, good and is_plainly_good(principal[0])


@njit(cache=True, error_model="numpy")
def _spread(s: np.ndarray, settings: np.ndarray, points: np.ndarray, constants: np.ndarray) -> _Made:
    """The same for a model whose mass is spread over a mesh."""
    mass = settings[BODY_MASS]
    if not mass > 0.0:
        mass = settings[DENSITY] * constants[SOLID_MEASURE] * abs(s[0] * s[1] * s[2])
    left = s.copy()
    uniform = True
    if constants[MODEL] == SHELL:
        for k in range(3):
            uniform = uniform and abs(s[k]) == abs(s[0])
            left[k] = math.copysign(abs(s[0]), s[k])
    reference, center = constants[REFERENCE : REFERENCE + 3], constants[CENTER : CENTER + 3]
    low, second = constants[CENTER_LOW : CENTER_LOW + 3], constants[SECOND : SECOND + 6]
    total, com, inertia, principal, _, _ = spread_mass(
        mass, constants[MEASURE], s, left, center, low, reference, second, points
    )
    return total, com, inertia, principal, uniform and 1e-300 < mass < math.inf and is_plainly_good(principal[0])


@njit(cache=True, error_model="numpy", forceinline=True)
def make_body_row(settings: np.ndarray, ballast: np.ndarray, constants: np.ndarray, body: np.ndarray) -> bool:
    """Fill ``body`` (BODY,) from settings (SETTINGS,), ballast (k, 4) and a mesh's constants; False when
    the simulation has to check it.
    """
    s = settings[SCALE : SCALE + 3]
    for k in range(3):
        if not SCALE_LIMITS[0] <= abs(s[k]) <= SCALE_LIMITS[1]:
            return False
    points, good = _points_with_mass(ballast)
    if not good:
        return False
    if constants[MODEL] == EXPLICIT:
        mass, com, inertia, principal, good = _explicit(s, settings, points)
    else:
        mass, com, inertia, principal, good = _spread(s, settings, points, constants)
    if not good:
        return False
    diagonal = 0.0
    for k in range(3):
        com[k] = exact_quotient(com[k], s[k]) * s[k]
        side = constants[EXTENT + k] * s[k]
        diagonal += side * side
    fill_body(mass, com, inertia, principal, s, body)
    if constants[HAS_SURFACE] != 0.0:
        body[LENGTH] = 0.5 * math.sqrt(diagonal)
    return math.isfinite(body[MASS] + body[COM] + body[COM + 1] + body[COM + 2] + body[LENGTH])


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def initial_row(settings: np.ndarray, row: np.ndarray) -> bool:
    """The state row (13,) at time 0; False when the orientation has no length."""
    return fill_initial_row(
        settings[POSITION : POSITION + 3],
        settings[ORIENTATION : ORIENTATION + 4],
        settings[VELOCITY : VELOCITY + 3],
        settings[ANGULAR_VELOCITY : ANGULAR_VELOCITY + 3],
        row,
    )


@njit(cache=True, error_model="numpy", allocates=False)
def is_followed(settings: np.ndarray, constants: np.ndarray, body: np.ndarray) -> bool:
    """Whether an integrator that chooses its own steps can follow damping and string (simulation/checks.py)."""
    mass, smallest = body[MASS], body[MOMENTS]
    if settings[LINEAR_DAMPING] > FASTEST * mass or settings[ANGULAR_DAMPING] > FASTEST * smallest:
        return False
    if constants[TIED] == 0.0:
        return True
    A, S, P, M = STRING_ATTACH, settings, AXES, MOMENTS
    rx, ry, rz = arm(body, S[A], S[A + 1], S[A + 2])
    x = body[P] * rx + body[P + 3] * ry + body[P + 6] * rz
    y = body[P + 1] * rx + body[P + 4] * ry + body[P + 7] * rz
    z = body[P + 2] * rx + body[P + 5] * ry + body[P + 8] * rz
    yields = most_yielding(mass, body[M], body[M + 1], body[M + 2], x, y, z)
    stiffness, damping = spring_of(mass, S[STRING_STIFFNESS], S[STRING_FREQUENCY], S[STRING_DAMPING_RATIO])
    # Near the limit the simulation decides.
    return math.sqrt(stiffness * yields) <= 0.999 * FASTEST and damping * yields <= 0.999 * FASTEST


@njit(cache=True, error_model="numpy", allocates=False)
def tie_string(
    settings: np.ndarray, constants: np.ndarray, body: np.ndarray, row: np.ndarray, string: np.ndarray
) -> None:
    """Fill ``string`` (motion/problem.STRING,) as it is tied at the state row (13,)."""
    for k in range(3):
        string[KNOT + k] = settings[STRING_ATTACH + k]
        string[ORIGIN + k] = string[TARGET + k] = settings[STRING_TARGET + k]
    span, rest = string_span(body, string, row), settings[STRING_REST_LENGTH]
    rx, ry, rz = arm(body, string[KNOT], string[KNOT + 1], string[KNOT + 2])
    mass = effective_mass(body, rx, ry, rz, row, span, rest)
    stiffness, frequency = settings[STRING_STIFFNESS], settings[STRING_FREQUENCY]
    string[K], string[C] = spring_of(mass, stiffness, frequency, settings[STRING_DAMPING_RATIO])
    string[REST], string[PUSHES] = rest, constants[BILATERAL]


@njit(cache=True, error_model="numpy", allocates=False)
def string_span(body: np.ndarray, string: np.ndarray, row: np.ndarray) -> Vector:
    """From the free end, which rests at its target, to the knot: three numbers [m, world]."""
    rx, ry, rz = arm(body, string[KNOT], string[KNOT + 1], string[KNOT + 2])
    return span_of(rx, ry, rz, row, string[TARGET], string[TARGET + 1], string[TARGET + 2])


@njit(cache=True, error_model="numpy", allocates=False)
def string_energy(flight: np.record) -> float:
    """Of the string of a flight now [J]; 0 where none is tied."""
    if not flight.tied:
        return 0.0
    string = flight.string
    return energy_of(string_span(flight.body, string, flight.row), string[K], string[REST], string[PUSHES] != 0.0)
