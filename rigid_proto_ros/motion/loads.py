# SPDX-License-Identifier: MIT
"""Forces and torques on the body, and their sums, which integrators use.

On a rotating body three kinds of load differ: a torque fixed in the world, a world force at a point of the body, and a
force that rotates with the body. Any number of each reduces to the same few sums, because the torque of world forces Fᵢ
at body points rᵢ is linear in M = Σ rᵢ Fᵢᵀ: Σ rᵢ × RᵀFᵢ is the axial vector of M R.

The effect of a load is compiled once: live simulations, offline runs and sweeps call the functions here on its row.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..base.compilation import njit
from ..base.errors import CommandRefused
from ..base.rotation import matrix_elements, transposed_times
from ..base.vectors import FloatArray, Numbers, StateRow, Vector, Vector3, vector
from . import body as of_body
from .body import MAX_ACCELERATION, Body, BodyRow
from .frames import Frame, contact_point, point_text
from .state import State
from .surface import Surface

# Layout of the sums of loads, a row of LOADS_SIZE doubles.
FORCE_WORLD = 0  # (3,) [N]
FORCE_BODY = 3  # (3,) [N]
TORQUE_WORLD = 6  # (3,) [N m]
TORQUE_BODY = 9  # (3,) [N m]
MOMENT = 12  # (9,) M row by row [N m]
LOADS_SIZE = 21

# Layout of one load, a row of LOAD doubles.
LOAD_AXES = 0
WORLD_AXES, BODY_AXES, NORMAL_AXES = 0.0, 1.0, 2.0
HAS_POINT = 1
POINT = 2  # (3,) [mesh coordinates]
FORCE = 5  # (3,) [N, or N s]
TORQUE = 8  # (3,) [N m, or N m s]
NORMAL = 11  # (3,) inward normal of the unscaled mesh
LOAD = 14

_AXES = ("world", "body", "normal")
_AXES_NUMBERS = {"world": WORLD_AXES, "body": BODY_AXES, "normal": NORMAL_AXES}
_ROW = struct.Struct("=14d")
_ORIGIN = (0.0, 0.0, 0.0)


@njit(error_model="numpy", allocates=False)
def arm_of(load: FloatArray, body: BodyRow) -> Vector:
    """Vector from the COM to the point of application [m, body axes]: three numbers."""
    if load[HAS_POINT] == 0.0:
        return 0.0, 0.0, 0.0
    return of_body.arm(body, load[POINT], load[POINT + 1], load[POINT + 2])


@njit(error_model="numpy", allocates=False)
def own_force(load: FloatArray, body: BodyRow) -> Vector:
    """The force, in body axes, of a load whose axes rotate with the body: three numbers."""
    f = load[FORCE]
    if load[LOAD_AXES] == NORMAL_AXES:
        x, y, z = of_body.normal(body, load[NORMAL], load[NORMAL + 1], load[NORMAL + 2])
        return f * x, f * y, f * z
    return f, load[FORCE + 1], load[FORCE + 2]


@njit(error_model="numpy", allocates=False)
def _bound(x: float, y: float, z: float) -> float:
    """√3 times the largest component: an upper bound of the length without overflow of squares."""
    return 1.7320508075688772 * max(abs(x), abs(y), abs(z))


@njit(error_model="numpy", allocates=False)
def magnitudes(load: FloatArray, body: BodyRow) -> tuple[float, float]:
    """Upper bounds of the linear [m/s²] and angular [rad/s²] acceleration over all attitudes, computed from |r||F| and
    the smallest principal moment.
    """
    force = _bound(load[FORCE], load[FORCE + 1], load[FORCE + 2])
    torque = _bound(load[TORQUE], load[TORQUE + 1], load[TORQUE + 2])
    if load[HAS_POINT] != 0.0:
        x, y, z = arm_of(load, body)
        torque += _bound(x, y, z) * force
    return force / body[of_body.MASS], torque / body[of_body.MOMENTS]


@njit(error_model="numpy", allocates=False)
def is_within_magnitude(load: FloatArray, body: BodyRow) -> bool:
    """Whether both accelerations are within MAX_ACCELERATION; False if they overflow to NaN."""
    linear, angular = magnitudes(load, body)
    return linear <= MAX_ACCELERATION and angular <= MAX_ACCELERATION


@njit(error_model="numpy", allocates=False)
def is_zero(load: FloatArray) -> bool:
    """Whether the load has neither force nor torque."""
    return not load[FORCE : FORCE + 6].any()


@njit(error_model="numpy", allocates=False)
def accumulate_load(load: FloatArray, body: BodyRow, share: FloatArray) -> None:
    """Write the load's contribution to the sums into share (LOADS_SIZE,): forces and torques by axes, and the moment r
    Fᵀ of a world force.
    """
    share[:] = 0.0
    rx, ry, rz = arm_of(load, body)
    tx, ty, tz = load[TORQUE], load[TORQUE + 1], load[TORQUE + 2]
    if load[LOAD_AXES] == WORLD_AXES:
        for j in range(3):
            f = load[FORCE + j]
            share[FORCE_WORLD + j] = f
            if load[HAS_POINT] != 0.0:
                share[MOMENT + j], share[MOMENT + 3 + j], share[MOMENT + 6 + j] = rx * f, ry * f, rz * f
        share[TORQUE_WORLD], share[TORQUE_WORLD + 1], share[TORQUE_WORLD + 2] = tx, ty, tz
        return
    fx, fy, fz = own_force(load, body)
    if load[HAS_POINT] != 0.0:
        tx, ty, tz = tx + (ry * fz - rz * fy), ty + (rz * fx - rx * fz), tz + (rx * fy - ry * fx)
    share[FORCE_BODY], share[FORCE_BODY + 1], share[FORCE_BODY + 2] = fx, fy, fz
    share[TORQUE_BODY], share[TORQUE_BODY + 1], share[TORQUE_BODY + 2] = tx, ty, tz


@njit(error_model="numpy", allocates=False)
def apply_impulse(load: FloatArray, body: BodyRow, row: StateRow) -> None:
    """Apply impulse J and angular impulse H to a state row: v⁺ = v + J/m, ω⁺ = ω + I⁻¹(H + r × J), in closed form."""
    a, b, c, d, e, f, g, h, i = matrix_elements(row[3], row[4], row[5], row[6])
    hx, hy, hz = load[TORQUE], load[TORQUE + 1], load[TORQUE + 2]
    if load[LOAD_AXES] == WORLD_AXES:
        jx, jy, jz = load[FORCE], load[FORCE + 1], load[FORCE + 2]
        fx, fy, fz = a * jx + d * jy + g * jz, b * jx + e * jy + h * jz, c * jx + f * jy + i * jz
        hx, hy, hz = a * hx + d * hy + g * hz, b * hx + e * hy + h * hz, c * hx + f * hy + i * hz
    else:
        fx, fy, fz = own_force(load, body)
        jx, jy, jz = a * fx + b * fy + c * fz, d * fx + e * fy + f * fz, g * fx + h * fy + i * fz
    if load[HAS_POINT] != 0.0:
        rx, ry, rz = arm_of(load, body)
        hx, hy, hz = hx + (ry * fz - rz * fy), hy + (rz * fx - rx * fz), hz + (rx * fy - ry * fx)
    if jx != 0.0 or jy != 0.0 or jz != 0.0:
        row[7] += jx / body[of_body.MASS]
        row[8] += jy / body[of_body.MASS]
        row[9] += jz / body[of_body.MASS]
    if hx != 0.0 or hy != 0.0 or hz != 0.0:
        x, y, z = of_body.angular_acceleration(body, hx, hy, hz)
        row[10] += x
        row[11] += y
        row[12] += z


class Load(NamedTuple):
    """The wrench of one command, with its point resolved on the body.

    axes: ``world``, ``body`` or ``normal``. mesh_point (3,) in mesh coordinates, or None for the COM. mesh_normal (3,):
    the inward normal there, for ``normal``. force [N, or N s for an impulse], torque about the point [N m, or N m s].
    """

    axes: str
    mesh_point: Vector | None
    force: Vector
    torque: Vector
    mesh_normal: Vector | None = None

    @property
    def is_zero(self) -> bool:
        """Whether the load has neither force nor torque."""
        return not (any(self.force) or any(self.torque))

    @property
    def packed(self) -> bytes:
        """The load's row (LOAD,) as bytes."""
        axes, point, force, torque, normal = self
        return _ROW.pack(
            _AXES_NUMBERS[axes], point is not None, *(point or _ORIGIN), *force, *torque, *(normal or _ORIGIN)
        )

    @property
    def row(self) -> FloatArray:
        """The load as compiled functions read it (LOAD,)."""
        return np.frombuffer(self.packed).copy()

    @property
    def frame_id(self) -> str:
        """The resolved frame: world or body axes, and the point in mesh coordinates."""
        axes = "world" if self.axes == "world" else "body"
        point = ("com",) if self.mesh_point is None else ("point", self.mesh_point)
        return f"{axes}@{point_text(point)}"

    def arm(self, body: Body) -> Vector3:
        """Vector from the COM to the point of application (3,) [m, body axes]."""
        return np.array(arm_of(self.row, body.row))

    def own_force(self, body: Body) -> Vector3:
        """The force (3,), in body axes, of a load whose axes rotate with the body."""
        return np.array(own_force(self.row, body.row))

    def check_magnitude(self, body: Body) -> None:
        """Raises CommandRefused (``magnitude``) when the accelerations would pass MAX_ACCELERATION."""
        row = self.row
        if not is_within_magnitude(row, body.row):
            linear, angular = magnitudes(row, body.row)
            raise CommandRefused(
                "magnitude",
                "wrench",
                f"{linear:.3g} m/s² and {angular:.3g} rad/s²",
                f"at most {MAX_ACCELERATION:g} of each for a body of {body.mass:g} kg",
            )


def load_of_bytes(row: bytes) -> Load:
    """The load whose row has these bytes."""
    axes, has_point, *numbers = _ROW.unpack(row)
    point, force, torque, normal = (vector(numbers[k : k + 3]) for k in range(0, 12, 3))
    named = _AXES[int(axes)]
    return Load(named, point if has_point else None, force, torque, normal if named == "normal" else None)


def light_row(frame: Frame, force: Numbers, torque: Numbers, body: Body, contacts: Mapping[str, Vector]) -> bytes:
    """Fast path for most loads: the row of a load in world or body axes, at the COM, a contact or a given point, that
    is far below the magnitude limit. Empty for any other load, which ``resolve_load`` resolves or refuses.
    """
    word, axes = frame.point[0], frame.axes
    if word == "com":
        point = _ORIGIN
    elif word == "point":
        point = frame.point[1]
    elif word == "contact" and frame.point[1] in contacts:
        point = contacts[frame.point[1]]
    else:
        return b""
    fx, fy, fz = force
    tx, ty, tz = torque
    x, y, z = point
    amount = abs(fx) + abs(fy) + abs(fz) + abs(tx) + abs(ty) + abs(tz)
    # False for numbers that aren't finite.
    if axes != "normal" and amount * (1.0 + abs(x) + abs(y) + abs(z)) <= body.light:
        return _ROW.pack(_AXES_NUMBERS[axes], word != "com", x, y, z, fx, fy, fz, tx, ty, tz, *_ORIGIN)
    return b""


def resolve_load(
    frame: Frame,
    force: Numbers,
    torque: Numbers,
    body: Body | None,
    surface: Surface | None,
    contacts: Mapping[str, Vector],
    state: State | None,
) -> Load:
    """Resolve a frame's point on the body in its state; raises CommandRefused (``frame``, ``ray_miss``, ``nonfinite``).

    Without a body and a state a ray stays unresolved: it is checked again when it takes effect.
    """
    force, torque = vector(force), vector(torque)
    # The sum of finite numbers may overflow: if it isn't finite, each number is checked.
    if not math.isfinite(sum(force) + sum(torque)) and not all(map(math.isfinite, (*force, *torque))):
        raise CommandRefused("nonfinite", "wrench", [*force, *torque], "finite numbers")
    if frame.axes != "normal":
        return Load(frame.axes, _mesh_point(frame, body, surface, contacts, state), force, torque)
    if any(force[1:]) or any(torque):
        raise CommandRefused("frame", "wrench", [*force, *torque], "force.x alone in normal axes")
    mesh_point = _mesh_point(frame, body, surface, contacts, state)
    mesh_normal = None
    if mesh_point is not None:
        if surface is None:
            raise CommandRefused("frame", "frame_id", frame.text, "normal axes only on a body with a mesh")
        normal = surface.inward_normal(mesh_point)
        if not normal.any():
            raise CommandRefused("frame", "frame_id", frame.text, "a point where the surface has a normal")
        mesh_normal = vector(normal)
    return Load(frame.axes, mesh_point, force, torque, mesh_normal)


def _mesh_point(
    frame: Frame, body: Body | None, surface: Surface | None, contacts: Mapping[str, Vector], state: State | None
) -> Vector | None:
    word, *values = frame.point
    if word == "com":
        return None
    if word == "origin":
        return (0.0, 0.0, 0.0)
    if word == "contact":
        return contact_point(values[0], contacts)
    if word == "point":
        return vector(values[0])
    if surface is None:
        raise CommandRefused("frame", "frame_id", frame.text, "this point only on a body with a mesh")
    if word == "vertex":
        if values[0] >= len(surface.vertices):
            raise CommandRefused("frame", "frame_id", frame.text, f"vertex/0 to vertex/{len(surface.vertices) - 1}")
        return vector(surface.vertices[values[0]])
    if state is None or body is None:
        return None
    R = state.rotation
    origin = body.mesh_point(transposed_times(R, np.asarray(values[0]) - state.position))
    direction = transposed_times(R, np.asarray(values[1]) / np.abs(values[1]).max()) / body.scale
    hit = surface.ray_hit(origin, direction)
    if hit is None:
        raise CommandRefused("ray_miss", "frame_id", frame.text, "a ray that meets the body")
    return vector(hit)
