# SPDX-License-Identifier: MIT
"""A scene as numbers: one record (SCENE) of all that parameters decide about the motion, one (MESH) of what is computed
from the mesh, and the body and the flight that compiled functions make of them.

A setup, a row of a sweep, a flight of identify and the page all begin by ``begin``. Fields of SCENE have the names of
the parameters (parameters/declarations.py), with dots as underscores, their units and their bounds: a record that
breaks them is refused, whoever filled it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..base.arithmetic import exact_quotient
from ..base.compilation import (
    copy_numbers,
    exported,
    integers_in,
    local_matrix,
    local_numbers,
    njit,
    numbers_in,
    place_of,
    record_type,
)
from ..base.errors import InputError
from ..base.rotation import norm
from ..base.vectors import BoolArray, FloatArray, Matrix3, Vector, Vector3
from ..mass import MODEL_COMS
from ..mass.closed_form import (
    given_mass,
    is_plainly_good,
    mix_walls,
    spread_mass,
    spread_over,
    thickest_walls,
    walls_error,
)
from ..mass.moments import MODELS, MOMENTS, SOLID, STRETCHED
from ..mass.properties import SCALE_LIMITS
from ..mass.tensor import NEARLY, POSSIBLE, judged_tensor
from ..mass.walls import LIMIT, WALLS
from ..motion.body import LENGTH, MASS, MAX_ACCELERATION, BodyRow, fill_body, rotor_rate
from ..motion.body import MOMENTS as BODY_MOMENTS
from ..motion.integrators import INTEGRATORS
from ..motion.integrators.auto import FASTEST
from ..motion.integrators.series_steps import degree_for
from ..motion.loads import NEED_ANGULAR_DAMPING, NEED_NO_GYROSCOPIC_TERM, NEED_ROTOR, NEED_STRING, NEEDS
from ..motion.problem import begin_body
from ..motion.state import fill_initial_row
from ..parameters.declarations import PARAMETERS, PATTERNS, Parameter
from . import refusals as rf
from .flight import FLIGHT, NEVER, NOT_BEGUN, take_rotor
from .refusals import REFUSAL, refuse, refuse_tensor
from .string_control import begins_clear, follows, follows_rates, tie

MAX_BALLASTS = 32

SCENE_PARAMETERS = (
    *("scale", "mass", "density", "inertia_model", "inertia_model_com", "wall_thickness", "infill"),
    *("explicit_inertia.mass", "explicit_inertia.center_of_mass", "explicit_inertia.tensor"),
    *("gyroscopic", "gravity", "linear_damping", "angular_damping", "rotor.momentum", "rotor.torque"),
    *("initial.position", "initial.orientation_xyzw", "initial.linear_velocity", "initial.angular_velocity"),
    *("initial.string_mass", "integrator", "step", "accuracy", "wrench_timeout", "poke_duration"),
    *("string.attached", "string.attach", "string.target", "string.stiffness", "string.frequency"),
    *("string.damping_ratio", "string.rest_length", "string.bilateral", "string.timeout"),
)
"""Parameters that are numbers of a scene; one that is a choice is the place among its choices, and true is 1."""


def field_of(parameter: str) -> str:
    """Name of a parameter's field in SCENE."""
    return parameter.replace(".", "_")


def _type_of(parameter: Parameter) -> tuple[Any, ...]:
    if parameter.type == "doubles":
        return np.float64, max(parameter.lengths)
    return (np.float64 if parameter.type == "double" else np.int64,)


SCENE = record_type(
    [
        *((field_of(name), *_type_of(PARAMETERS[name])) for name in SCENE_PARAMETERS),
        ("ballasts", np.int64),  # how many there are
        ("ballast", np.float64, (MAX_BALLASTS, 4)),  # masses [kg], and their positions [mesh coordinates]
    ]
)

WALLED, EXPLICIT = len(MODELS), len(MODELS) + 1
"""Numbers of the last two INERTIA_MODELS; those before are moments of a mesh by themselves."""
OF_SOLID = MODEL_COMS.index("solid")

MESH = record_type(
    [
        ("has_surface", np.bool_),  # False: there is no mesh
        ("extent", np.float64, 3),  # sides of the bounding box [mesh units]
        # By the number of the model:
        ("moments", MOMENTS, len(MODELS)),
        ("stretch", np.float64, (len(MODELS), 3)),  # |scale|/|scale_x| for which those of STRETCHED hold
        ("walls", WALLS),
        ("known", np.uint8, EXPLICIT),  # by the number of the model, whether its moments are there
    ]
)

_IS_STRETCHED = np.array([model in STRETCHED for model in MODELS])

_SUPPORTS = np.array([sum(1 << k for k, need in enumerate(NEEDS) if need in i.supports) for i in INTEGRATORS.values()])
"""By the integrator's number, the bits of what it supports."""


def _bounds() -> tuple[FloatArray, FloatArray, BoolArray]:
    """Of each number of SCENE, all of 8 bytes: the least and the largest one accepted, and whether it is an integer."""
    count = SCENE.itemsize // 8
    lower, upper, integer = np.zeros(count), np.zeros(count), np.zeros(count, np.bool_)

    def put(field: str, least: float, largest: float, whole: bool) -> None:
        first = place_of(SCENE, field) // 8
        at = slice(first, first + SCENE[field].itemsize // 8)
        lower[at], upper[at], integer[at] = least, largest, whole

    for name in SCENE_PARAMETERS:
        one = PARAMETERS[name]
        if one.type in ("double", "doubles"):
            put(field_of(name), np.nextafter(one.lower, np.inf) if one.above else one.lower, one.upper, False)
        else:
            put(field_of(name), 0.0, len(one.choices or (False, True)) - 1.0, True)
    put("ballasts", 0.0, MAX_BALLASTS, True)
    point = PATTERNS["ballast."]
    put("ballast", point.lower, point.upper, False)
    lower[place_of(SCENE, "ballast") // 8 :: 4] = 0.0  # masses
    return lower, upper, integer


_LOWER, _UPPER, _IS_INTEGER = _bounds()
_BALLAST = place_of(SCENE, "ballast") // 8
"""Place of the first ballast among the numbers."""


@njit(error_model="numpy", allocates=False)
def _is_within_bounds(scene: np.record, refusal: np.record) -> bool:
    numbers, integers = numbers_in(scene), integers_in(scene)
    k, end = 0, _BALLAST
    while k < end:
        x = float(integers[k]) if _IS_INTEGER[k] else numbers[k]
        if not _LOWER[k] <= x <= _UPPER[k]:
            return refuse(refusal, rf.OUT_OF_BOUNDS, k, x, 0.0, 0.0)
        k += 1
        if k == _BALLAST:  # how many there are is known to be possible now
            end += 4 * scene.ballasts
    for k in range(3):
        if abs(scene.scale[k]) < SCALE_LIMITS[0]:
            return refuse(refusal, rf.SCALE, 0, 0.0, 0.0, 0.0)
    return True


def out_of_bounds(scene: np.record, place: int) -> InputError:
    """The error that says that the number at this place of a scene isn't within its bounds."""
    if place >= _BALLAST:
        point = (place - _BALLAST) // 4
        return InputError("ballast", tuple(scene.ballast[point].tolist()), "mass >= 0 [kg] and x, y, z, all finite")
    at = 8 * place
    field = next(
        name for name in SCENE.names or () if place_of(SCENE, name) <= at < place_of(SCENE, name) + SCENE[name].itemsize
    )
    received = scene[field].tolist()
    if field == "ballasts":
        return InputError("ballast", f"{received} point masses", f"0 to {MAX_BALLASTS}")
    parameter = next(PARAMETERS[name] for name in SCENE_PARAMETERS if field_of(name) == field)
    return InputError(parameter.name, received, parameter.accepted)


_TO_NEAREST = 6755399441055744.0  # 1.5·2⁵²


@njit(error_model="numpy", allocates=False)
def nearest_integer(x: float) -> int:
    """x rounded to a whole number, halves to the even one, |x| < 2⁶²."""
    return int((x + _TO_NEAREST) - _TO_NEAREST) if abs(x) < 2.0**51 else int(x)


@njit(error_model="numpy", allocates=False)
def timeout_ns(seconds: float) -> int:
    """A timeout [ns]: 0, which means never, for 0 s alone."""
    return max(1, nearest_integer(seconds * 1e9)) if seconds != 0.0 else 0


# The body


@njit(error_model="numpy", allocates=False)
def explicit_tensor(scene: np.record, inertia: Matrix3) -> None:
    """The explicit tensor as a matrix."""
    given = scene.explicit_inertia_tensor
    inertia[0, 0], inertia[1, 1], inertia[2, 2] = given[0], given[3], given[5]
    inertia[0, 1] = inertia[1, 0] = given[1]
    inertia[0, 2] = inertia[2, 0] = given[2]
    inertia[1, 2] = inertia[2, 1] = given[4]


@njit(error_model="numpy", allocates=False)
def _are_known(scene: np.record, mesh: np.record, refusal: np.record) -> bool:
    """Whether the moments are there that the scene needs: of its model, and of the solid for a density or its COM."""
    s, model = scene.scale, scene.inertia_model
    fits = mesh.known[model] != 0
    if _IS_STRETCHED[model]:
        for k in range(3):
            fits = fits and abs(s[k]) / abs(s[0]) == mesh.stretch[model, k]
    if not fits:
        return refuse(refusal, rf.NO_MOMENTS, model, 0.0, 0.0, 0.0)
    if model == WALLED:
        for k in range(3):
            fits = fits and abs(s[k]) / abs(s[0]) == mesh.walls.stretch[k]
        if not fits:
            return refuse(refusal, rf.NO_MOMENTS, model, 0.0, 0.0, 0.0)
    needs_solid = model == WALLED or scene.mass == 0.0 or scene.inertia_model_com == OF_SOLID
    if mesh.known[SOLID] == 0 and needs_solid:
        return refuse(refusal, rf.NO_MOMENTS, SOLID, 0.0, 0.0, 0.0)
    return True


@njit(error_model="numpy", allocates=False)
def _spread(
    scene: np.record,
    mesh: np.record,
    com: Vector3,
    inertia: Matrix3,
    moments: Vector3,
    axes: Matrix3,
    refusal: np.record,
) -> float:
    """Total mass [kg] of a model whose mass is distributed over a mesh, 0 if it is refused; fills COM (3,), inertia (3,
    3), its principal moments (3,) and axes (3, 3).
    """
    if not _are_known(scene, mesh, refusal):
        return 0.0
    s, mass, model = scene.scale, scene.mass, scene.inertia_model
    if model == WALLED:
        return _spread_walls(scene, mesh, com, inertia, moments, axes, refusal)
    if mass == 0.0:
        mass = scene.density * mesh.moments[SOLID].measure * abs(s[0] * s[1] * s[2])
        if not 1e-300 < mass < math.inf:
            refuse(refusal, rf.MASS, 0, mass, 0.0, 0.0)
            return 0.0
    # Moments of STRETCHED include the stretch: the uniform part and the mirroring are left.
    left = local_numbers(3)
    for k in range(3):
        left[k] = math.copysign(abs(s[0]), s[k]) if _IS_STRETCHED[model] else s[k]
    unit = mesh.moments[model]
    at_solid = scene.inertia_model_com == OF_SOLID
    placed, ballast = mesh.moments[SOLID] if at_solid else unit, scene.ballast[: scene.ballasts]
    return spread_mass(mass, unit, placed, at_solid, s, left, ballast, com, inertia, moments, axes)


@njit(error_model="numpy", allocates=False)
def _spread_walls(
    scene: np.record,
    mesh: np.record,
    com: Vector3,
    inertia: Matrix3,
    moments: Vector3,
    axes: Matrix3,
    refusal: np.record,
) -> float:
    """The same of a printed part, whose mass without a given one is that of walls and infill."""
    s, mass, unit = scene.scale, scene.mass, abs(scene.scale[0])
    t, infill, solid = scene.wall_thickness / unit, scene.infill, mesh.moments[SOLID]
    error = walls_error(solid, mesh.walls, t, infill)
    if not error <= LIMIT:
        largest = unit * thickest_walls(solid, mesh.walls, infill)
        refuse(refusal, rf.WALLS, 0, scene.wall_thickness, largest, error)
        return 0.0
    reference, center, second = local_numbers(3), local_numbers(3), local_numbers(6)
    low, left = local_numbers(3), local_numbers(3)
    measure = mix_walls(solid, mesh.walls, t, infill, reference, center, second)
    if mass == 0.0:
        mass = scene.density * measure * (unit * unit * unit)
        if not 1e-300 < mass < math.inf:
            refuse(refusal, rf.MASS, 0, mass, 0.0, 0.0)
            return 0.0
    at_solid = scene.inertia_model_com == OF_SOLID
    for k in range(3):
        left[k], low[k] = math.copysign(unit, s[k]), 0.0
        if at_solid:
            reference[k], center[k] = solid.reference[k], solid.center[k]
            low[k] = solid.center_low[k]
    per_measure, ballast = mass / measure, scene.ballast[: scene.ballasts]
    return spread_over(
        mass, per_measure, second, reference, center, low, at_solid, s, left, ballast, com, inertia, moments, axes
    )


@exported(SCENE, MESH, "f8[:]", REFUSAL, returns="b1")
def make_body(scene: np.record, mesh: np.record, body: BodyRow, refusal: np.record) -> bool:
    """Fill the row of a scene's body (BODY,); returns False, with the reason, where there is none. A warning about the
    tensor (TENSOR, detail NEARLY) is noted, too.
    """
    s, com, inertia = scene.scale, local_numbers(3), local_matrix(3, 3)
    moments, axes = local_numbers(3), local_matrix(3, 3)
    refusal.code = rf.ACCEPTED
    if not _is_within_bounds(scene, refusal):
        return False
    if scene.inertia_model == EXPLICIT:
        given = local_matrix(3, 3)
        explicit_tensor(scene, given)
        flaw = judged_tensor(given, moments)
        if flaw != POSSIBLE:
            refuse_tensor(refusal, flaw, given, 1)
        if flaw != POSSIBLE and flaw != NEARLY:
            return False
        ballast, center = scene.ballast[: scene.ballasts], scene.explicit_inertia_center_of_mass
        mass = given_mass(scene.explicit_inertia_mass, center, given, s, ballast, com, inertia, moments, axes)
        if scene.ballasts > 0:
            refusal.code = rf.ACCEPTED
            flaw = judged_tensor(inertia, moments)
    else:
        mass = _spread(scene, mesh, com, inertia, moments, axes, refusal)
        if refusal.code != rf.ACCEPTED:
            return False
        flaw = POSSIBLE if is_plainly_good(moments) else judged_tensor(inertia, moments)
    if flaw != POSSIBLE:
        refuse_tensor(refusal, flaw, inertia, 0)
        if flaw != NEARLY:
            return False
    diagonal = 0.0
    for k in range(3):
        # Within an ulp of where it is, at a product of mesh coordinate and scale: so it survives being sent back by
        # message.
        com[k] = exact_quotient(com[k], s[k]) * s[k]
        side = mesh.extent[k] * s[k]
        diagonal += side * side
    fill_body(mass, com, inertia, moments, axes, s, body)
    if mesh.has_surface:
        body[LENGTH] = 0.5 * math.sqrt(diagonal)
    return True


# The flight


@njit(error_model="numpy", allocates=False)
def set_rules(scene: np.record, flight: np.record) -> None:
    """What of a scene holds for the commands and segments of a flight: integrator, accuracy, times."""
    flight.integrator, flight.supports = scene.integrator, _SUPPORTS[scene.integrator]
    flight.chooses = scene.integrator == rf.AUTO
    flight.accuracy, flight.degree = scene.accuracy, degree_for(scene.accuracy)
    flight.step_ns = nearest_integer(scene.step * 1e9)
    flight.timeout_ns, flight.poke_ns = timeout_ns(scene.wrench_timeout), nearest_integer(scene.poke_duration * 1e9)
    flight.string_timeout_ns = timeout_ns(scene.string_timeout)


@njit(error_model="numpy", allocates=False)
def needs_of(scene: np.record, tied: bool) -> int:
    """What a scene asks of its integrator without any load, as bits of NEEDS."""
    needs = NEED_ANGULAR_DAMPING if scene.angular_damping != 0.0 else 0
    if not scene.gyroscopic:
        needs |= NEED_NO_GYROSCOPIC_TERM
    return needs | NEED_STRING if tied else needs


@njit(error_model="numpy", allocates=False)
def takes_rotor(scene: np.record, body: BodyRow, h: Vector, refusal: np.record) -> bool:
    """Whether integrator and body of a scene can take a flywheel of momentum h [N m s, body axes] and its torque."""
    torque = scene.rotor_torque
    turns, driven = norm(h[0], h[1], h[2]), norm(torque[0], torque[1], torque[2])
    if turns == 0.0 and driven == 0.0:
        return True
    if not meets(scene, NEED_ROTOR, refusal):
        return False
    if not driven / body[BODY_MOMENTS] <= MAX_ACCELERATION:
        return refuse(refusal, rf.MAGNITUDE, rf.OF_ROTOR, 0.0, driven / body[BODY_MOMENTS], body[MASS])
    rate = rotor_rate(body, h)
    return scene.integrator != rf.AUTO or follows(rf.ROTOR_MOMENTUM, turns, turns / rate * FASTEST, rate, refusal)


@njit(error_model="numpy", allocates=False)
def meets(scene: np.record, needs: int, refusal: np.record) -> bool:
    """Whether the scene's integrator supports all of these needs."""
    if needs & ~_SUPPORTS[scene.integrator] == 0:
        return True
    return refuse(refusal, rf.INTEGRATOR, scene.integrator, float(needs), 0.0, 0.0)


@exported(SCENE, MESH, FLIGHT, REFUSAL, returns="b1")
def begin(scene: np.record, mesh: np.record, flight: np.record, refusal: np.record) -> bool:
    """Begin the flight of a scene, a record of zeros: body, state and string at time 0, before its first segment.
    Returns False, with the reason, for a scene that is refused.
    """
    return make_body(scene, mesh, flight.body, refusal) and begin_with_body(scene, flight, refusal)


@njit(error_model="numpy", allocates=False)
def begin_with_body(scene: np.record, flight: np.record, refusal: np.record) -> bool:
    """The same for a flight that has its body already."""
    body = flight.body
    attitude, velocity, spin = (
        scene.initial_orientation_xyzw,
        scene.initial_linear_velocity,
        scene.initial_angular_velocity,
    )
    if not fill_initial_row(scene.initial_position, attitude, velocity, spin, flight.row):
        return refuse(refusal, rf.ORIENTATION, 0, 0.0, 0.0, 0.0)
    copy_numbers(flight.row, flight.start)
    begin_body(flight.common, body, scene, 1.0 if scene.gyroscopic else 0.0)
    set_rules(scene, flight)
    # None yet: the first method that adapts its steps gets a clean workspace, as every other does.
    flight.method = NOT_BEGUN
    flight.string_release_ns = NEVER
    for k in range(3):
        flight.string_attach[k] = scene.string_attach[k]
    if not meets(scene, needs_of(scene, scene.string_attached), refusal):
        return False
    if not follows_rates(scene, body, scene.string_attached, scene.string_attach, refusal):
        return False
    h = scene.rotor_momentum[0], scene.rotor_momentum[1], scene.rotor_momentum[2]
    if not takes_rotor(scene, body, h, refusal):
        return False
    take_rotor(flight, h, scene.rotor_torque)
    if scene.string_attached:
        if not begins_clear(scene, body, flight.row, scene.string_attach, scene.string_target, refusal):
            return False
        tie(scene, flight, scene.string_target, 0, scene.initial_string_mass)
    return True
