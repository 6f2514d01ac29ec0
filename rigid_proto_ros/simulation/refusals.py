# SPDX-License-Identifier: MIT
"""Why a compiled function refuses: a code and numbers (REFUSAL), and the words for people that follow from them."""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit, record_type
from ..base.errors import CommandRefused
from ..base.vectors import Matrix3
from ..mass.walls import rounded_down
from ..motion.body import MAX_ACCELERATION
from ..motion.integrators import INTEGRATORS, check_supported
from ..motion.integrators.auto import FASTEST
from ..motion.loads import NEEDS

REFUSAL = record_type(
    [
        ("code", np.int64),
        ("detail", np.int64),
        ("numbers", np.float64, 3),
        ("tensor", np.float64, 9),
        ("given", np.int64),
    ]
)
"""The last refusal of compiled functions; the codes say what ``detail`` and ``numbers`` are."""

(
    ACCEPTED,
    NO_MOMENTS,  # detail: number of the model whose moments the scene needs and its mesh hasn't given yet
    SCALE,
    MASS,  # numbers: density · volume [kg]
    TENSOR,  # detail: as judged_tensor has it (mass/tensor.py); tensor, and whether it is the given one without ballast
    ORIENTATION,
    INTEGRATOR,  # detail: number of the integrator; numbers: bits of what the scene needs (motion/loads.py, NEEDS)
    RATE,  # detail: RATES; numbers: value, largest one, rate [1/s]
    MAGNITUDE,  # detail: MAGNITUDES; numbers: linear and angular acceleration [m/s², rad/s²], mass [kg]
    PULL,  # of a string's target; numbers: the target
    UNRESOLVED,  # detail: why a load's point wasn't found (motion/loads.py)
    OUT_OF_BOUNDS,  # detail: place of the number in SCENE (simulation/record.py); numbers: the number
    AT_FREE_END,  # of a string that pushes; numbers: the target
    WALLS,  # too thick for the first order: numbers: thickness, the largest one taken [m], error
) = range(14)

RATES = (
    ("linear_damping", "N s/m"),
    ("angular_damping", "N m s"),
    ("string.frequency", "rad/s"),
    ("string.stiffness", "N/m"),
    ("string.damping_ratio", ""),
    ("rotor.momentum", "N m s"),
)
AUTO = tuple(INTEGRATORS).index("auto")

LINEAR_DAMPING, ANGULAR_DAMPING, STRING_FREQUENCY, STRING_STIFFNESS, STRING_DAMPING_RATIO, ROTOR_MOMENTUM = range(6)
"""Parameters whose rates ``auto`` follows up to FASTEST, and their units."""

MAGNITUDES = ("wrench", "rotor.torque")
OF_WRENCH, OF_ROTOR = range(2)
"""What may be too large for a body."""


@njit(error_model="numpy", allocates=False)
def refuse(refusal: np.record, code: int, detail: int, a: float, b: float, c: float) -> bool:
    """Note a refusal; returns False."""
    refusal.code, refusal.detail = code, detail
    refusal.numbers[0], refusal.numbers[1], refusal.numbers[2] = a, b, c
    return False


@njit(error_model="numpy", allocates=False)
def refuse_tensor(refusal: np.record, flaw: int, inertia: Matrix3, given: int) -> None:
    """Note what is wrong with an inertia (3, 3) [kg m²]; given: 1 for the explicit one, without ballast."""
    refusal.code, refusal.detail, refusal.given = TENSOR, flaw, given
    for i in range(3):
        for j in range(3):
            refusal.tensor[3 * i + j] = inertia[i, j]


def refused_command(refusal: np.record) -> CommandRefused:
    """The error that says an INTEGRATOR, RATE, MAGNITUDE, PULL or AT_FREE_END."""
    a, b, c = refusal.numbers.tolist()
    if refusal.code == INTEGRATOR:
        try:
            check_supported(tuple(INTEGRATORS.values())[refusal.detail], needs_in(int(a)))
        except CommandRefused as error:
            return error
    if refusal.code == RATE:
        parameter, unit = RATES[refusal.detail]
        accepted = f"at most {rounded_down(b):g} {unit}".rstrip()
        why = f"auto follows rates up to {FASTEST:g} /s, and this is one of {c:.3g} /s"
        return CommandRefused("integrator", parameter, a, f"{accepted} for this body: {why}")
    if refusal.code == MAGNITUDE:
        received = f"{a:.3g} m/s² and {b:.3g} rad/s²"
        accepted = f"at most {MAX_ACCELERATION:g} of each for a body of {c:g} kg"
        return CommandRefused("magnitude", MAGNITUDES[refusal.detail], received, accepted)
    if refusal.code == AT_FREE_END:
        accepted = "a target away from the knot, where a string that pushes has a direction"
        return CommandRefused("integrator", "string target", [a, b, c], accepted)
    accepted = f"a target that pulls with at most {MAX_ACCELERATION:g} m/s²"
    return CommandRefused("magnitude", "string target", [a, b, c], accepted)


def needs_in(bits: int) -> frozenset[str]:
    """What a scene needs of its integrator, in words, of the bits of NEEDS."""
    return frozenset(need for k, need in enumerate(NEEDS) if bits >> k & 1)
