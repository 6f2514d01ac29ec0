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

from ..base.compilation import local_numbers, njit
from ..base.errors import CommandRefused
from ..base.rotation import matrix_elements
from ..base.vectors import FloatArray, Points, StateRow, Triangles, Vector, Vector3, vector
from . import body as of_body
from .body import MAX_ACCELERATION, Body, BodyRow
from .frames import Frame, contact_point, point_text
from .state import to_body_axes
from .surface import inward_normal, ray_hit

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
PLACE = 1
AT_COM, AT_POINT, AT_VERTEX, ON_RAY = 0.0, 1.0, 2.0, 3.0
"""Where a load acts. A vertex, whose number is in POINT, and a ray, whose origin and direction in world axes are in
POINT and NORMAL, become the point that they lead to when the load is resolved.
"""
POINT = 2  # (3,) [mesh coordinates]
FORCE = 5  # (3,) [N, or N s]
TORQUE = 8  # (3,) [N m, or N m s]
NORMAL = 11  # (3,) inward normal of the unscaled mesh
LOAD = 14

BODY_TORQUE = "a torque"
WORLD_TORQUE = "a torque fixed in the world or a world force off the centre of mass"
BODY_FORCE = "a force that turns with the body"
ANGULAR_DAMPING = "angular damping"
STRING = "a string"
NO_GYROSCOPIC_TERM = "gyroscopic: false"
ROTOR = "a flywheel"
NEEDS = (BODY_TORQUE, WORLD_TORQUE, BODY_FORCE, ANGULAR_DAMPING, STRING, NO_GYROSCOPIC_TERM, ROTOR)
"""What a scene may need of its integrator; compiled functions have bits for it, in this order."""
(
    NEED_BODY_TORQUE,
    NEED_WORLD_TORQUE,
    NEED_BODY_FORCE,
    NEED_ANGULAR_DAMPING,
    NEED_STRING,
    NEED_NO_GYROSCOPIC_TERM,
    NEED_ROTOR,
) = (1 << k for k in range(len(NEEDS)))

RESOLVED, NO_MESH, NO_VERTEX, NO_MESH_NORMAL, NO_NORMAL, MISSED = range(6)
"""Whether a load's point was found, or why not."""

_AXES = ("world", "body", "normal")
_AXES_NUMBERS = {"world": WORLD_AXES, "body": BODY_AXES, "normal": NORMAL_AXES}
_ROW = struct.Struct("=14d")
_ORIGIN = (0.0, 0.0, 0.0)


@njit(error_model="numpy", allocates=False)
def arm_of(load: FloatArray, body: BodyRow) -> Vector:
    """Vector from the COM to the point of application [m, body axes]: three numbers."""
    if load[PLACE] == AT_COM:
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
    if load[PLACE] != AT_COM:
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
def needs_of_load(load: FloatArray) -> int:
    """What a load needs of the integrator, as bits of NEEDS."""
    pushes = load[FORCE] != 0.0 or load[FORCE + 1] != 0.0 or load[FORCE + 2] != 0.0
    turns = load[TORQUE] != 0.0 or load[TORQUE + 1] != 0.0 or load[TORQUE + 2] != 0.0
    turns = turns or (load[PLACE] != AT_COM and pushes)
    if load[LOAD_AXES] == WORLD_AXES:
        return NEED_WORLD_TORQUE if turns else 0
    return (NEED_BODY_TORQUE if turns else 0) | (NEED_BODY_FORCE if pushes else 0)


@njit(error_model="numpy", allocates=False)
def resolve_load(
    load: FloatArray, body: BodyRow, row: StateRow, vertices: Points, triangles: Triangles, extent: Vector3
) -> int:
    """Resolve a load (LOAD,) on a body in a state (13,): a vertex or a ray to the point that it leads to on the
    surface, of this extent (3,), and the normal there if it pushes along it. Returns RESOLVED, or why there is no such
    point.
    """
    has_mesh = triangles.shape[0] > 0
    if load[PLACE] == AT_VERTEX:
        number = int(load[POINT])
        if not has_mesh:
            return NO_MESH
        if number >= vertices.shape[0]:
            return NO_VERTEX
        for k in range(3):
            load[POINT + k] = vertices[number, k]
        load[PLACE] = AT_POINT
    elif load[PLACE] == ON_RAY:
        if not has_mesh:
            return NO_MESH
        if not _hit(load, body, row, vertices, triangles):
            return MISSED
    if load[LOAD_AXES] != NORMAL_AXES:
        return RESOLVED
    if not has_mesh:
        return NO_MESH_NORMAL
    found = inward_normal(vertices, triangles, load[POINT : POINT + 3], extent, load[NORMAL : NORMAL + 3])
    return RESOLVED if found else NO_NORMAL


@njit(error_model="numpy", allocates=False)
def _hit(load: FloatArray, body: BodyRow, row: StateRow, vertices: Points, triangles: Triangles) -> bool:
    """Replace a ray by the first point where it meets the surface; False for a miss."""
    c, s = of_body.COM, of_body.BODY_SCALE
    x, y, z = load[NORMAL], load[NORMAL + 1], load[NORMAL + 2]
    longest = max(abs(x), abs(y), abs(z))
    x, y, z = to_body_axes(row, x / longest, y / longest, z / longest)
    ox, oy, oz = to_body_axes(row, load[POINT] - row[0], load[POINT + 1] - row[1], load[POINT + 2] - row[2])
    origin, direction = local_numbers(3), local_numbers(3)
    direction[0], direction[1], direction[2] = x / body[s], y / body[s + 1], z / body[s + 2]
    origin[0], origin[1] = (ox + body[c]) / body[s], (oy + body[c + 1]) / body[s + 1]
    origin[2] = (oz + body[c + 2]) / body[s + 2]
    if not ray_hit(vertices, triangles, origin, direction, load[POINT : POINT + 3]):
        return False
    load[PLACE], load[NORMAL], load[NORMAL + 1], load[NORMAL + 2] = AT_POINT, 0.0, 0.0, 0.0
    return True


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
            if load[PLACE] != AT_COM:
                share[MOMENT + j], share[MOMENT + 3 + j], share[MOMENT + 6 + j] = rx * f, ry * f, rz * f
        share[TORQUE_WORLD], share[TORQUE_WORLD + 1], share[TORQUE_WORLD + 2] = tx, ty, tz
        return
    fx, fy, fz = own_force(load, body)
    if load[PLACE] != AT_COM:
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
    if load[PLACE] != AT_COM:
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
        place = AT_COM if point is None else AT_POINT
        return _ROW.pack(_AXES_NUMBERS[axes], place, *(point or _ORIGIN), *force, *torque, *(normal or _ORIGIN))

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


def load_of_bytes(row: bytes) -> Load:
    """The load whose row, resolved, has these bytes."""
    axes, place, *numbers = _ROW.unpack(row)
    point, force, torque, normal = (vector(numbers[k : k + 3]) for k in range(0, 12, 3))
    named = _AXES[int(axes)]
    return Load(named, None if place == AT_COM else point, force, torque, normal if named == "normal" else None)


def packed_load(frame: Frame, force: Vector, torque: Vector, contacts: Mapping[str, Vector]) -> tuple[bytes, float]:
    """The row of a wrench in a frame, as bytes, and its weight: (Σ|F| + Σ|τ|)(1 + Σ|point|), to be compared with
    ``Body.light``; inf where a vertex, a ray or a normal is still to be resolved. Raises CommandRefused (``frame``,
    ``nonfinite``).
    """
    fx, fy, fz = force
    tx, ty, tz = torque
    # The sum of finite numbers may overflow: if it isn't finite, each number is checked.
    if not math.isfinite(fx + fy + fz + tx + ty + tz) and not all(map(math.isfinite, (*force, *torque))):
        raise CommandRefused("nonfinite", "wrench", [*force, *torque], "finite numbers")
    word, axes = frame.point[0], frame.axes
    if axes == "normal" and (fy or fz or tx or ty or tz):
        raise CommandRefused("frame", "wrench", [*force, *torque], "force.x alone in normal axes")
    place, x, y, z, normal = AT_POINT, 0.0, 0.0, 0.0, _ORIGIN
    weight = abs(fx) + abs(fy) + abs(fz) + abs(tx) + abs(ty) + abs(tz) if axes != "normal" else math.inf
    if word == "com":
        place = AT_COM
    elif word == "point":
        x, y, z = frame.point[1]
    elif word == "contact":
        x, y, z = contact_point(frame.point[1], contacts)
    elif word == "vertex":
        place, x = AT_VERTEX, frame.point[1]
    elif word == "ray":
        place, (x, y, z), normal = ON_RAY, frame.point[1], frame.point[2]
    weight = math.inf if place > AT_POINT else weight * (1.0 + abs(x) + abs(y) + abs(z))
    return _ROW.pack(_AXES_NUMBERS[axes], place, x, y, z, fx, fy, fz, tx, ty, tz, *normal), weight


def unresolved(code: int, frame: Frame, vertices: int) -> CommandRefused:
    """The error that says why the point of a frame wasn't found (``resolve_load``) on a mesh of so many vertices."""
    if code == MISSED:
        return CommandRefused("ray_miss", "frame_id", frame.text, "a ray that meets the body")
    accepted = {
        NO_MESH: "this point only on a body with a mesh",
        NO_VERTEX: f"vertex/0 to vertex/{vertices - 1}",
        NO_MESH_NORMAL: "normal axes only on a body with a mesh",
        NO_NORMAL: "a point where the surface has a normal",
    }
    return CommandRefused("frame", "frame_id", frame.text, accepted[code])
