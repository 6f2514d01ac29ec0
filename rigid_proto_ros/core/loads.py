# SPDX-License-Identifier: MIT
"""Forces and torques on the body, and their sum as an integrator takes it.

Three kinds of load differ on a turning body: a torque fixed in the world, a world force at a point of the body, and a force
that turns with the body. Any number of each sums to the same few vectors, because the torque of world forces Fᵢ at body
points rᵢ is linear in M = Σ rᵢ Fᵢᵀ: Σ rᵢ × RᵀFᵢ is the axial vector of M R.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .body import Body
from .errors import CommandRefused
from .frames import Frame, point_text
from .state import State
from .surface import Surface

MAX_ACCELERATION = 1e15
"""m/s² and rad/s²; m/s and rad/s for impulses. A command beyond it is a slip of the keyboard, and it would leave no digits."""


# Where the sums of loads stand in one row of LOADS_SIZE doubles.
FORCE_WORLD = 0  # (3,) [N]
FORCE_BODY = 3  # (3,) [N]
TORQUE_WORLD = 6  # (3,) [N m]
TORQUE_BODY = 9  # (3,) [N m]
MOMENT = 12  # (9,) M row by row [N m]
LOADS_SIZE = 21
_NO_MOMENT = (0.0,) * 9


@dataclass(frozen=True)
class Load:
    """One command's wrench, its point settled on the body.

    axes: ``world``, ``body`` or ``normal``. mesh_point (3,) in mesh coordinates, or None for the COM. mesh_normal (3,): the
    inward normal there, for ``normal``. force [N, or N s for an impulse], torque about the point [N m, or N m s].
    """

    axes: str
    mesh_point: tuple[float, float, float] | None
    force: tuple[float, float, float]
    torque: tuple[float, float, float]
    mesh_normal: tuple[float, float, float] | None = None

    @property
    def is_zero(self) -> bool:
        return not (any(self.force) or any(self.torque))

    @property
    def frame_id(self) -> str:
        """The settled frame: world or body axes, and the point in mesh coordinates."""
        axes = "world" if self.axes == "world" else "body"
        point = ("com",) if self.mesh_point is None else ("point", self.mesh_point)
        return f"{axes}@{point_text(point)}"

    def arm(self, body: Body) -> np.ndarray:
        """From the COM to the point of attack (3,) [m, body axes]."""
        return np.zeros(3) if self.mesh_point is None else body.point(self.mesh_point)

    def force_body(self, body: Body, state: State) -> np.ndarray:
        """The force (3,) in body axes at this state."""
        if self.axes == "world":
            return _transposed_times(state.rotation, np.asarray(self.force))
        return self.own_force(body)

    def own_force(self, body: Body) -> np.ndarray:
        """The force (3,) in body axes, of a load whose axes turn with the body."""
        if self.axes == "normal":
            return self.force[0] * body.normal(self.mesh_normal)
        return np.asarray(self.force, dtype=float)

    def share(self, body: Body) -> np.ndarray:
        """What the load adds to the sums (LOADS_SIZE,): forces and torques by axes, and the moment r Fᵀ of a world force."""
        fx, fy, fz = self.force
        tx, ty, tz = self.torque
        rx, ry, rz = (0.0, 0.0, 0.0) if self.mesh_point is None else body.arm(self.mesh_point)
        if self.axes == "world":
            moment = (rx * fx, rx * fy, rx * fz, ry * fx, ry * fy, ry * fz, rz * fx, rz * fy, rz * fz)
            return np.array((fx, fy, fz, 0.0, 0.0, 0.0, tx, ty, tz, 0.0, 0.0, 0.0, *moment))
        if self.axes == "normal":
            fx, fy, fz = self.own_force(body).tolist()
        if self.mesh_point is not None:
            tx, ty, tz = tx + (ry * fz - rz * fy), ty + (rz * fx - rx * fz), tz + (rx * fy - ry * fx)
        return np.array((0.0, 0.0, 0.0, fx, fy, fz, 0.0, 0.0, 0.0, tx, ty, tz, *_NO_MOMENT))

    def check_magnitude(self, body: Body) -> None:
        """Raises CommandRefused (``magnitude``) when the accelerations would pass MAX_ACCELERATION.

        A world wrench is judged over all attitudes: by |r||F| and the smallest principal moment.
        """
        force, torque = _norm_bound(self.force), _norm_bound(self.torque)
        if self.mesh_point is not None:
            torque += _norm_bound(body.arm(self.mesh_point)) * force
        linear, angular = force / body.mass, torque / body.smallest_moment
        # Negated, so that an overflow to NaN is refused too.
        if not (linear <= MAX_ACCELERATION and angular <= MAX_ACCELERATION):
            raise CommandRefused(
                "magnitude",
                "wrench",
                f"{linear:.3g} m/s2 and {angular:.3g} rad/s2",
                f"at most {MAX_ACCELERATION:g} of each for a body of {body.mass:g} kg",
            )


class LoadSum:
    """The sum of loads: force_world, force_body, torque_world, torque_body (3,), moment (3, 3) = Σ r Fᵀ (r body, F world).

    All are parts of ``values`` (LOADS_SIZE,), in the order of Load.share.
    """

    def __init__(self, values: np.ndarray | None = None) -> None:
        self.values = np.zeros(LOADS_SIZE) if values is None else values
        self.force_world = self.values[FORCE_WORLD : FORCE_WORLD + 3]
        self.force_body = self.values[FORCE_BODY : FORCE_BODY + 3]
        self.torque_world = self.values[TORQUE_WORLD : TORQUE_WORLD + 3]
        self.torque_body = self.values[TORQUE_BODY : TORQUE_BODY + 3]
        self.moment = self.values[MOMENT:].reshape(3, 3)

    def add(self, load: Load, body: Body) -> None:
        self.values += load.share(body)


def apply_impulse(load: Load, body: Body, state: State) -> State:
    """The state right after an impulse: v⁺ = v + J/m, ω⁺ = ω + I⁻¹(H + r × J), in closed form."""
    R = state.rotation
    if load.axes == "world":
        impulse_world = np.asarray(load.force)
        impulse_body, angular_body = _transposed_times(R, impulse_world), _transposed_times(R, np.asarray(load.torque))
    else:
        impulse_body, angular_body = load.own_force(body), np.asarray(load.torque)
        impulse_world = (R * impulse_body).sum(axis=1)
    if load.mesh_point is not None:
        angular_body = angular_body + cross(load.arm(body), impulse_body)
    row = state.row.copy()
    if impulse_world.any():
        row[7:10] += impulse_world / body.mass
    if angular_body.any():
        row[10:13] += body.angular_acceleration(angular_body)
    return replace(state, row=row)


def settle(
    frame: Frame, force, torque, body: Body, surface: Surface | None, contacts: dict, state: State | None
) -> Load:
    """Settle a frame's point on the body as it is now; raises CommandRefused (``frame``, ``ray_miss``, ``nonfinite``).

    state None leaves a ray unsettled: it is checked again when it takes effect.
    """
    force, torque = tuple(float(f) for f in force), tuple(float(t) for t in torque)
    if not all(map(math.isfinite, (*force, *torque))):
        raise CommandRefused("nonfinite", "wrench", [*force, *torque], "finite numbers")
    if frame.axes == "normal" and (any(force[1:]) or any(torque)):
        raise CommandRefused("frame", "wrench", [*force, *torque], "force.x alone in normal axes")
    mesh_point = _mesh_point(frame, body, surface, contacts, state)
    mesh_normal = None
    if frame.axes == "normal" and mesh_point is not None:
        if surface is None:
            raise CommandRefused("frame", "frame_id", frame.text, "normal axes only on a body with a mesh")
        normal = surface.inward_normal(mesh_point)
        if not normal.any():
            raise CommandRefused("frame", "frame_id", frame.text, "a point where the surface has a normal")
        mesh_normal = tuple(float(n) for n in normal)
    return Load(frame.axes, mesh_point, force, torque, mesh_normal)


def _mesh_point(frame, body, surface, contacts, state):
    word, *values = frame.point
    if word == "com":
        return None
    if word == "origin":
        return (0.0, 0.0, 0.0)
    if word == "contact":
        return tuple(float(x) for x in contacts[values[0]])
    if word == "point":
        return values[0]
    if surface is None:
        raise CommandRefused("frame", "frame_id", frame.text, "this point only on a body with a mesh")
    if word == "vertex":
        if values[0] >= len(surface.vertices):
            raise CommandRefused("frame", "frame_id", frame.text, f"vertex/0 to vertex/{len(surface.vertices) - 1}")
        return tuple(float(x) for x in surface.vertices[values[0]])
    if state is None:
        return None
    R = state.rotation
    origin = body.mesh_point(_transposed_times(R, np.asarray(values[0]) - state.position))
    direction = _transposed_times(R, np.asarray(values[1]) / np.abs(values[1]).max()) / body.scale
    hit = surface.ray_hit(origin, direction)
    if hit is None:
        raise CommandRefused("ray_miss", "frame_id", frame.text, "a ray that meets the body")
    return tuple(float(x) for x in hit[0])


def _norm_bound(vector) -> float:
    """√3 times the largest component: not below the length, and without its overflow."""
    return 1.7320508075688772 * max(abs(vector[0]), abs(vector[1]), abs(vector[2]))


def cross(a, b) -> np.ndarray:
    """a × b of two (3,) arrays."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _transposed_times(R, v) -> np.ndarray:
    return R[0] * v[0] + R[1] * v[1] + R[2] * v[2]
