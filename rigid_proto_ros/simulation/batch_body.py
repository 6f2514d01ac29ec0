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
from ..mass.closed_form import Principal, given_mass, is_plainly_good, spread_mass
from ..mass.properties import SCALE_LIMITS
from ..mass.tensor import principal_axes_kernel
from ..motion.body import COM, LENGTH, MASS, fill_body
from ..motion.state import fill_initial_row

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
SETTINGS = 34

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
CONSTANTS = 23

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
