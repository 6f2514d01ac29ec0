# SPDX-License-Identifier: MIT
"""The picture of a simulation: computes the parts that a backend draws, from the states and the loads on the body."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.rotation import matrix_from_quaternion, quaternion_from_matrix
from ..base.vectors import FloatArray, IntArray, Points, Triangles, Vector3
from ..mass.tensor import equimomental_shapes, principal_axes
from ..motion.body import Body
from ..simulation.observer import (
    BodyChanged,
    Event,
    GhostChanged,
    LoadBegan,
    LoadEnded,
    MeshChanged,
    Started,
    StringChanged,
)
from ..simulation.quantities import attitude_angle
from ..simulation.setup import Setup
from . import style
from .arrows import ArrowScales, Loads
from .backend import Backend, DrawnMesh
from .poinsot import Poinsot
from .string import StringRows, Strings, string_curves
from .surface import ball_mesh, box_edges, box_mesh, shaded_surface

RATE = 250
"""Rate of arrows, trails and plots [1/s, simulated]; the body's pose is drawn for every state."""

AXIS_LENGTH, PRINCIPAL_LENGTH = 0.25, 0.88
"""Lengths of mesh and principal axes, in body sizes. The principal axes end outside the body and beyond the first ω and
L, which may lie on one of them.
"""

LABEL_BEYOND = 1.06
"""Position of a label, in lengths of its arrow."""

LINE_SIZES = 1.1
"""Length by which the line of a taut string extends beyond its knot, in body sizes."""


def energies(rows: FloatArray, setup: Setup) -> FloatArray:
    """Energies (n, 3) [J] of states (n, 13): translational, rotational, gravitational."""
    body, velocity, w = setup.body, rows[:, 7:10], rows[:, 10:13]
    translational = 0.5 * body.mass * np.einsum("ni,ni->n", velocity, velocity)
    rotational = 0.5 * np.einsum("ni,ij,nj->n", w, body.inertia, w)
    return np.column_stack([translational, rotational, -body.mass * (rows[:, 0:3] @ setup.gravity)])


def angle_to(reference: Vector3, vectors: Points) -> FloatArray:
    """Angles (n,) [rad] between reference (3,) and vectors (n, 3), accurate near 0 and π; 0 where either vanishes."""
    angles: FloatArray = np.arctan2(np.linalg.norm(np.cross(reference, vectors), axis=1), vectors @ reference)
    return angles


class Shape:
    """Dimensions of mesh and body. size [m]: the diagonal of the mesh's bounding box, or of the equimomental box
    without a mesh. tip (3,) [m, body axes]: the vertex farthest from the COM. centre, half_sizes (3,) [m, body axes]:
    of the bounding box along the mesh axes. Without a mesh, tip, centre and half_sizes are None. moments (3,), axes (3,
    3): principal moments, ascending, and principal axes.
    """

    def __init__(self, vertices: Points | None, body: Body) -> None:
        self.moments, self.axes = principal_axes(body.inertia)
        self.box_sides, self.semi_axes = equimomental_shapes(body.mass, self.moments)
        self.tip = self.centre = self.half_sizes = None
        extent = self.box_sides
        if vertices is not None:
            at = vertices * body.scale - body.center_of_mass
            low, high = at.min(axis=0), at.max(axis=0)
            self.centre, self.half_sizes, extent = 0.5 * (low + high), 0.5 * (high - low), high - low
            self.tip = at[np.argmax(np.einsum("ij,ij->i", at, at))]
        self.size = float(np.linalg.norm(extent)) or 1.0


class Picture:
    """Draws events and states through its backend. wanted(name): whether a part is to be drawn; other parts aren't
    computed. poke_shown_ns [ns, simulated]: shortest time for which the arrow of a poke is shown.
    """

    def __init__(self, backend: Backend, wanted: Callable[[str], bool] = lambda _: True, rate: int = RATE) -> None:
        self.backend = backend
        self.setup: Setup | None = None
        self.ghost: Setup | None = None
        self.shape: Shape | None = None
        self.scales = ArrowScales()
        self.poke_shown_ns = 0
        self._wanted = wanted
        self._period_ns = 1_000_000_000 // rate
        self._vertices: Points | None = None
        self._middle = np.zeros(3)
        self._rotor, self._rotor_ns = np.zeros(3), 0
        self._mesh: DrawnMesh | None = None
        self.restart()

    def restart(self) -> None:
        """Start a new run at simulated time 0; mesh, body and scales are kept."""
        self.redraw()
        self._first_momentum = np.zeros(3)
        self._poinsot = Poinsot()
        self.loads = Loads()
        self.string = Strings()
        self._body_times, self._body_attitudes = np.empty(0, np.int64), np.empty((0, 4))
        if self.shape is not None:
            self._poinsot.set_body(self.shape.moments, self.shape.axes)

    def redraw(self) -> None:
        """Draw the next state in full even if its period was drawn before, because other parts are wanted."""
        self._last_tick = -1

    # Changes

    def on(self, event: Event) -> None:
        """Process an event other than a state; ``draw`` takes states, in batches."""
        match event:
            case Started() | MeshChanged():
                self._set_mesh(event.time_ns, event.vertices, event.triangles)
            case BodyChanged(time_ns, setup, rotor):
                self._rotor, self._rotor_ns = np.array(rotor), time_ns
                self._set_body(time_ns, setup)
            case GhostChanged(time_ns, setup):
                self.set_ghost(time_ns, setup)
            case LoadBegan(time_ns, load_id, load):
                self.loads.began(time_ns, load_id, load)
            case LoadEnded(time_ns, load_id):
                self.loads.ended(time_ns, load_id, self.poke_shown_ns)
            case StringChanged():
                self.string.change(event)

    def _set_mesh(self, time_ns: int, vertices: Points | None, triangles: Triangles | None) -> None:
        """Set another mesh: vertices (n, 3) [mesh coordinates], triangles (m, 3); a BodyChanged follows."""
        self._vertices = self._mesh = None
        if vertices is not None and triangles is not None and len(triangles):
            # Vertices that no triangle uses are not part of the body.
            used = np.zeros(len(vertices), dtype=bool)
            used[triangles] = True
            triangles = (np.cumsum(used) - 1)[triangles]
            self._vertices = np.array(vertices, dtype=float)[used]
            # Relative to the middle, since single precision loses the digits of a mesh far from its origin.
            self._middle = 0.5 * (self._vertices.min(axis=0) + self._vertices.max(axis=0))
            self._mesh = shaded_surface(self._vertices - self._middle, triangles)
        self.backend.begin(np.array([time_ns]))
        self._describe_mesh(self.backend)

    def _set_body(self, time_ns: int, setup: Setup) -> None:
        """Set the body from ``time_ns`` on."""
        size = 0.0 if self.shape is None else self.shape.size
        if self.setup is not None:
            self.loads.body_changed(self.setup.body, setup.body)
            if setup.surface is not self.setup.surface:
                self.scales.forget()
        self.setup = setup
        self.shape = Shape(self._vertices, setup.body)
        self._poinsot.set_body(self.shape.moments, self.shape.axes)
        self.backend.begin(np.array([time_ns]))
        if self.shape.size != size:
            self.backend.resize(self.shape.size)
        self._describe_body(self.backend)

    def set_ghost(self, time_ns: int, ghost: Setup | None) -> None:
        """Set or remove the ghost from ``time_ns`` on."""
        first = self.ghost is None
        self.ghost = ghost
        self.backend.begin(np.array([time_ns]))
        if first or ghost is None:
            self.backend.mesh(style.GHOST_MESH, None if ghost is None else self._mesh)
        if ghost is None:
            self.backend.lines(style.GHOST_BOX, np.array([0]), [])
        self._describe_ghost(self.backend)

    def describe(self, backend: Backend) -> None:
        """Draw the parts that are drawn only when they change, for a backend added later; call after its ``begin`` with
        one time.
        """
        if self.shape is not None:
            backend.resize(self.shape.size)
        self._describe_mesh(backend)
        self._describe_body(backend)
        self._describe_ghost(backend)

    def _describe_mesh(self, backend: Backend) -> None:
        backend.mesh(style.BODY_MESH, self._mesh)
        if self.ghost is not None:
            backend.mesh(style.GHOST_MESH, self._mesh)

    def _describe_body(self, backend: Backend) -> None:
        setup, shape = self.setup, self.shape
        if setup is None or shape is None:
            return
        body = setup.body
        if self._mesh is not None:
            place = self._middle * body.scale - body.center_of_mass
            backend.place(style.BODY_MESH, place[np.newaxis], scale=body.scale)
        box = [] if shape.centre is None or shape.half_sizes is None else box_edges(shape.centre, shape.half_sizes)
        backend.lines(style.BOUNDING_BOX, np.array([len(box)]), box)
        principal = quaternion_from_matrix(shape.axes)[np.newaxis]
        for name, mesh, sizes in (
            (style.INERTIA_BOX, box_mesh(), 0.5 * shape.box_sides),
            (style.INERTIA_ELLIPSOID, ball_mesh(), shape.semi_axes),
        ):
            if self._wanted(name):
                backend.mesh(name, mesh)
                backend.place(name, attitudes=principal, scale=sizes)
        three = np.array([3])
        mesh_axes = AXIS_LENGTH * shape.size * np.eye(3)
        backend.arrows(style.BODY_AXES, three, mesh_axes)
        backend.labels(style.BODY_AXES, three, LABEL_BEYOND * mesh_axes, ["x", "y", "z"])
        ends = PRINCIPAL_LENGTH * shape.size * shape.axes.T
        backend.arrows(style.PRINCIPAL_AXES, three, ends)
        backend.labels(style.PRINCIPAL_AXES, three, LABEL_BEYOND * ends, ["I₁", "I₂", "I₃"])
        if self._wanted(style.POINSOT):
            self._poinsot.describe(backend)

    def _describe_ghost(self, backend: Backend) -> None:
        if self.ghost is None:
            return
        ghost = self.ghost.body
        moments, axes = principal_axes(ghost.inertia)
        if self._mesh is not None:
            place = self._middle * ghost.scale - ghost.center_of_mass
            backend.place(style.GHOST_MESH, place[np.newaxis], scale=ghost.scale)
        sides, _ = equimomental_shapes(ghost.mass, moments)
        backend.place(style.GHOST_BOX, attitudes=quaternion_from_matrix(axes)[np.newaxis])
        backend.lines(style.GHOST_BOX, np.array([12]), box_edges(np.zeros(3), 0.5 * sides))

    # States

    def draw(self, times_ns: IntArray, rows: FloatArray) -> None:
        """Draw states (n, 13) of the present body at times (n,) [ns]; all states since the previous call."""
        if self.setup is None or self.shape is None or not len(times_ns):
            return
        backend = self.backend
        backend.begin(times_ns)
        backend.place(style.BODY, rows[:, 0:3], rows[:, 3:7])
        backend.place(style.CENTRE, rows[:, 0:3])
        if self.ghost is not None:
            self._body_times = np.concatenate([self._body_times, times_ns])
            self._body_attitudes = np.vstack([self._body_attitudes, rows[:, 3:7]])
        # Arrows, trails and plots: the first state of each period.
        ticks = times_ns // self._period_ns
        chosen = np.flatnonzero(np.diff(ticks, prepend=self._last_tick) > 0)
        self._last_tick = int(ticks[-1])
        if not len(chosen):
            return
        times_ns, rows = times_ns[chosen], rows[chosen]
        backend.begin(times_ns)
        body = self.setup.body
        R = matrix_from_quaternion(rows[:, 3:7])
        spin = np.einsum("nij,nj->ni", R, rows[:, 10:13])
        L = np.einsum("nij,jk,nk->ni", R, body.inertia, rows[:, 10:13])
        torque = self.setup.scene.rotor_torque
        has_rotor = bool(self._rotor.any() or torque.any())
        if has_rotor:
            L += np.einsum("nij,nj->ni", R, self._rotor + np.outer((times_ns - self._rotor_ns) * 1e-9, torque))
        if self._wanted(style.POINSOT):
            self._poinsot.draw(backend, times_ns, rows, spin, L, has_rotor)
        self._draw_motion(spin, L)
        each = np.ones(len(rows), dtype=int)
        if self.shape.tip is not None and self._wanted(style.TRAIL):
            backend.points(style.TRAIL, each, rows[:, 0:3] + R @ self.shape.tip)
        if rows[:, 7:10].any() and self._wanted(style.COM_TRAIL):
            backend.points(style.COM_TRAIL, each, rows[:, 0:3])
        string = self.string.rows(times_ns, rows, R) if self.string.was_tied else None
        weight = 9.81 * body.mass
        if self._wanted("plots") and (commanded := self.loads.totals(times_ns, R)) is not None:
            backend.scalars(style.COMMANDED, commanded)
        self.loads.draw(backend, self._wanted, times_ns, rows, R, self.scales, self.shape.size, weight)
        if string is not None:
            self._draw_string(string, rows)
            self.string.forget_before(int(times_ns[-1]))
        if self._wanted("plots"):
            self._plot(rows, L, None if string is None else string.held)

    def _plot(self, rows: FloatArray, L: Points, string_energy: FloatArray | None) -> None:
        """Plot states (n, 13) with their angular momenta (n, 3) in world axes.

        string_energy (n,) [J]: None if the run has had no string yet.
        """
        assert self.setup is not None and self.shape is not None
        if not self._first_momentum.any():
            self._first_momentum = L[np.argmax(L.any(axis=1))].copy()
        own, backend = energies(rows, self.setup), self.backend
        total = own.sum(axis=1) if string_energy is None else own.sum(axis=1) + string_energy
        shown = [own, total] if string_energy is None else [own, total, string_energy]
        backend.scalars(style.ENERGY, np.column_stack(shown))
        backend.scalars(style.ANGULAR_MOMENTUM, np.column_stack([L, np.linalg.norm(L, axis=1)]))
        angle = np.degrees(angle_to(self._first_momentum, L))
        backend.scalars(style.ANGULAR_MOMENTUM_ANGLE, angle[:, np.newaxis])
        backend.scalars(style.ANGULAR_VELOCITY_PRINCIPAL, rows[:, 10:13] @ self.shape.axes)
        if np.any(self.setup.gravity) or rows[:, 7:10].any():
            backend.scalars(style.POSITION, rows[:, 0:3])

    def _draw_motion(self, spin: Points, L: Points) -> None:
        """Draw arrows of ω and L (n, 3) at the COM."""
        assert self.shape is not None
        natural = np.sqrt(9.81 / self.shape.size)
        moment = float(self.shape.moments.mean())
        for name, symbol, vectors, usual in (
            (style.OMEGA, "ω", spin, natural),
            (style.MOMENTUM, "L", L, moment * natural),
        ):
            if not self._wanted(name):
                continue
            values = np.linalg.norm(vectors, axis=1)
            lengths = self.scales.lengths(symbol, values, self.shape.size, usual)
            seen = lengths > 0.0
            drawn = vectors[seen] * (lengths[seen] / values[seen])[:, np.newaxis]
            counts = seen.astype(int)
            self.backend.arrows(name, counts, drawn)
            self.backend.labels(name, counts, LABEL_BEYOND * drawn, [symbol] * len(drawn))

    def _draw_string(self, string: StringRows, rows: FloatArray) -> None:
        assert self.setup is not None and self.shape is not None
        backend, tied, counts = self.backend, string.tied, string.tied.astype(int)
        directions, pulls = string.directions, string.pulls
        distances = np.linalg.norm(np.cross(directions, rows[tied, 0:3] - string.free), axis=1)
        if self._wanted(style.STRING):
            slack = np.linalg.norm(string.knots - string.free, axis=1) < string.lengths
            strips = list(np.stack([string.free, string.knots], axis=1))
            curves = string_curves(string.free[slack], string.knots[slack], string.lengths[slack], self.setup.gravity)
            for k, curve in zip(np.flatnonzero(slack), curves, strict=True):
                strips[k] = curve
            colours = [style.STRING_COLOUR if pull else style.SLACK_COLOUR for pull in pulls]
            backend.lines(style.STRING, counts, strips, colours)
            backend.points(style.HAND, counts, string.free)
        if self._wanted(style.STRING_LINE):
            pulling = counts.copy()
            pulling[tied] = pulls
            ends = string.knots + LINE_SIZES * self.shape.size * directions
            backend.lines(style.STRING_LINE, pulling, list(np.stack([string.knots, ends], axis=1)[pulls]))
        if self._wanted("plots"):
            plotted = np.zeros((len(rows), 1))
            plotted[tied, 0] = distances
            backend.scalars(style.STRING_LINE_DISTANCE, plotted)

    def draw_ghost(self, times_ns: IntArray, rows: FloatArray) -> None:
        """Draw states (n, 13) of the ghost, after those of the body at the same times."""
        if not len(times_ns):
            return
        self.backend.begin(times_ns)
        self.backend.place(style.GHOST, rows[:, 0:3], rows[:, 3:7])
        times, attitudes = self._body_times, self._body_attitudes
        keep = times > times_ns[-1]
        self._body_times, self._body_attitudes = times[keep], attitudes[keep]
        same, own, ghosts = np.intersect1d(times, times_ns, return_indices=True)
        if len(same):
            pairs = zip(attitudes[own], rows[ghosts, 3:7], strict=True)
            angles = np.degrees([attitude_angle(body, ghost) for body, ghost in pairs])
            self.backend.begin(same)
            self.backend.scalars(style.GHOST_ANGLE, angles[:, np.newaxis])
