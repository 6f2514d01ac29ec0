# SPDX-License-Identifier: MIT
"""The picture in browsers: a backend of ``picture`` that shows the present.

Browsers count in single precision, so the world point ``origin`` lies at the middle of what they draw, and ``unit``
metres are one: a nut and a satellite fill the page alike, and stand as still a million metres out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import viser

from ..base.rotation import rotate
from ..base.vectors import FloatArray, IntArray, Points, Vector3
from ..picture import style
from ..picture.backend import Backend, DrawnMesh

Wxyz = tuple[float, float, float, float]

MOVING = ("world/body/", "world/centre/", "world/ghost/")
"""What is below these is drawn in a frame that moves; all else in the world."""

TRAIL_POINTS, DRAWN_POINTS = 4000, 400
"""Of one path: kept, and drawn."""

TRAIL_S = 0.1
"""[s] Between two drawings of a path."""

MOST_LABELS = 3

POKE_SHOWN_NS = 800_000_000
"""[ns, of a body that flies in real time] A poke is over before it has been drawn twice; its arrow stays so long."""

ZOOM = (0.15, 1.6)
"""Body sizes in the picture's units between which a body may grow or shrink before the picture is scaled anew."""

BODY_COLOUR = (160, 153, 142)
"""Three times as dark as the floor, in WCAG's ratio: a lighter body is hardly seen in a projector's picture."""

SEEN_INTO = 0.5
"""Opacity of a body that one can look into."""

LABEL = "-"
"""A label's text before it is first shown: one that is empty as it is made stays empty in viser 1.1."""

LINE_PIXELS = 3.0
"""Thickness of lines, however far off they are: those of a telephone's picture would be seen in pieces."""

GHOST_INSET = 0.003
"""How far the ghost's surface lies within the body's, in parts of its size: exactly in it, it would show in patches."""

HEAD = 2.6
"""Radius of an arrow's head, in those of its shaft."""

THICKEST = 3.0
"""How many times as thick arrows are at most: from far off they would be seen in pieces."""


class ViserBackend(Backend):
    """on_body(node) is called with each new node that the pointer meets. shown: names of the parts that are to be seen,
    labelled: of those whose labels are.
    """

    def __init__(self, scene: viser.SceneApi, shown: Iterable[str], on_body: Callable[[Any], None]) -> None:
        self.origin = np.zeros(3)
        self.unit = 1.0
        self.shown = set(shown)
        self.labelled: set[str] = set()
        self._scene = scene
        self._on_body = on_body
        self.is_new = True
        self._seen_into = False
        self._thickness = self._label_scale = 1.0
        self._nodes: dict[str, Any] = {}
        self._meshes = 0
        self._there: set[str] = set()
        self._labels: list[Any] = []
        self._labels_of: dict[str, list[tuple[str, Vector3, str]]] = {}
        self._paths: dict[str, list[Points]] = {}
        self._path_due_s: dict[str, float] = {}
        self._path_base: dict[str, Vector3] = {}
        for name in (style.BODY, style.CENTRE, style.GHOST):
            self._nodes[name] = scene.add_frame(f"/{name}", show_axes=False)

    # What is seen

    def wanted(self, name: str) -> bool:
        """Whether a part is to be drawn."""
        return name in self.shown or any(name.startswith(f"{part}/") for part in self.shown)

    def switch(self, name: str, shown: bool) -> None:
        """Show a part, or don't."""
        (self.shown.add if shown else self.shown.discard)(name)
        for node in self._nodes:
            self._show(node)

    def see_into(self, seen_into: bool) -> None:
        """Whether one can look into the body."""
        self._seen_into = seen_into
        node = self._nodes.get(style.BODY_MESH)
        if node is not None:
            node.opacity = SEEN_INTO if seen_into else None

    def see_from(self, far: float) -> None:
        """How many times as far off as from a body alone it is seen: arrows are thicker then."""
        self._thickness = min(far, THICKEST)
        for name, node in self._nodes.items():
            if isinstance(node, viser.ArrowsHandle):
                for side, length in self._arrow_sides(name).items():
                    setattr(node, side, length)

    def scale_labels(self, scale: float) -> None:
        """Labels are so many times as large as usual."""
        self._label_scale = scale
        for node in self._labels:
            node.font_screen_scale = scale

    def _arrow_sides(self, name: str) -> dict[str, Any]:
        radius = self._thickness * style.STYLES[name].width
        return {"shaft_radius": radius, "head_radius": HEAD * radius, "head_length": 2.0 * HEAD * radius}

    def _show(self, name: str) -> None:
        always = name in (style.BODY, style.CENTRE, style.GHOST)
        self._nodes[name].visible = always or (name in self._there and self.wanted(name))

    def _set_there(self, name: str, there: bool) -> None:
        (self._there.add if there else self._there.discard)(name)
        self._show(name)

    def forget(self) -> None:
        """A run begins, or the body is somewhere else at once: paths, labels and what acts begin anew."""
        self._paths.clear()
        self._labels_of = {name: of for name, of in self._labels_of.items() if name.startswith(style.BODY)}
        for name in list(self._there):
            if not name.startswith((style.BODY, style.GHOST)):
                self._set_there(name, False)

    def drawn(self, name: str, points: FloatArray) -> FloatArray:
        """Points (..., 3) [m] of a part's parent frame as browsers have them."""
        return points / self.unit if name.startswith(MOVING) else (points - self.origin) / self.unit

    # Backend

    def resize(self, size: float) -> None:
        """The size of another body is one of the picture's units; one that grows or shrinks is seen to do so, until it
        would be lost or too large to be seen.
        """
        if self.is_new or not ZOOM[0] <= size / self.unit <= ZOOM[1]:
            self.unit = size
            self.is_new = False

    def mesh(self, name: str, surface: DrawnMesh | None) -> None:
        """A surface, in place of the one before."""
        before = self._nodes.pop(name, None)
        if before is not None:
            before.remove()
        self._there.discard(name)
        if surface is None:
            return
        look = style.STYLES[name]
        solid = look.opacity >= 1.0
        vertices = surface.vertices
        if name == style.GHOST_MESH:
            vertices = vertices - GHOST_INSET * np.ptp(vertices, axis=0).max() * surface.normals
        # A name of its own: browsers give a node the pose of the one that had its name before.
        self._meshes += 1
        self._nodes[name] = self._scene.add_mesh_simple(
            f"/{name}_{self._meshes}",
            vertices,
            surface.triangles,
            color=BODY_COLOUR if name == style.BODY_MESH else look.colours[0],
            opacity=None if solid else look.opacity,
            side="double",
            scale=1.0 / self.unit,
            cast_shadow=solid,
            visible=False,
        )
        self._set_there(name, True)
        if name == style.BODY_MESH:
            self.is_new = True
            self._on_body(self._nodes[name])
            self.see_into(self._seen_into)

    def place(
        self,
        name: str,
        positions: Points | None = None,
        attitudes: FloatArray | None = None,
        scale: Vector3 | None = None,
    ) -> None:
        """The last of these poses."""
        node = self._nodes.get(name)
        if node is None:
            return
        if positions is not None:
            move(node, self.drawn(name, positions[-1]))
        if attitudes is not None:
            turned = wxyz(attitudes[-1])
            if tuple(node.wxyz) != turned:
                node.wxyz = turned
        if scale is not None:
            node.scale = tuple((scale / self.unit).tolist())

    def arrows(self, name: str, counts: IntArray, vectors: Points, origins: Points | None = None) -> None:
        """The arrows of the last state."""
        count = int(counts[-1])
        if count:
            first = np.zeros((count, 3)) if origins is None else origins[-count:]
            points = np.stack([self.drawn(name, first), self.drawn(name, first + vectors[-count:])], axis=1)
            node = self._nodes.get(name)
            if node is None or len(node.points) != count:
                look = style.STYLES[name].colours  # one for all, or one of each
                colours = np.array(look if len(look) == count else look[0], np.uint8)
                node = self._scene.add_arrows(f"/{name}", points, colours, **self._arrow_sides(name))
                self._nodes[name] = node
            else:
                node.points = points
        if name in self._nodes:
            self._set_there(name, count > 0)

    def lines(
        self,
        name: str,
        counts: IntArray,
        strips: Sequence[Points],
        colours: Sequence[style.Colour] | None = None,
    ) -> None:
        """The strips of the last state."""
        count = int(counts[-1])
        if count:
            drawn = [self.drawn(name, np.asarray(strip)) for strip in strips[-count:]]
            segments = np.concatenate([np.stack([strip[:-1], strip[1:]], axis=1) for strip in drawn])
            look = style.STYLES[name]
            colour = (colours[-1] if colours else look.colours[0]) if len(look.colours) == 1 else look.colours[0]
            self._segments(name, segments, colour)
        if name in self._nodes:
            self._set_there(name, count > 0)

    def _segments(self, name: str, segments: FloatArray, colour: style.Colour) -> None:
        node = self._nodes.get(name)
        if node is None:
            self._nodes[name] = self._scene.add_line_segments(
                f"/{name}", segments, colour, thickness=LINE_PIXELS, thickness_units="screen"
            )
        else:
            node.points = segments
            if tuple(int(c) for c in np.ravel(node.colors)) != tuple(colour):
                node.colors = np.array(colour, np.uint8)

    def points(self, name: str, counts: IntArray, positions: Points) -> None:
        """A path of the last points; of one point alone, a ball."""
        if name in (style.TRAIL, style.COM_TRAIL):
            path = self._paths.setdefault(name, [])
            path.extend(positions)
            del path[:-TRAIL_POINTS]
            return
        there = bool(counts[-1])
        if there:
            node = self._nodes.get(name)
            if node is None:
                look = style.STYLES[name]
                node = self._scene.add_icosphere(f"/{name}", look.width, look.colours[0], cast_shadow=False)
                self._nodes[name] = node
            move(node, self.drawn(name, positions[-1]))
        if name in self._nodes:
            self._set_there(name, there)

    def labels(self, name: str, counts: IntArray, positions: Points, texts: Sequence[str]) -> None:
        """Texts of the last state; ``finish`` writes those that are to be seen."""
        count = int(counts[-1])
        first = len(texts) - count
        self._labels_of[name] = [(name, positions[k], texts[k]) for k in range(first, len(texts))]

    # Every frame

    def finish(self, now_s: float) -> None:
        """All of a frame has been said: draw paths and labels."""
        for name, path in self._paths.items():
            if self.wanted(name) and len(path) > 1 and now_s >= self._path_due_s.get(name, 0.0):
                self._path_due_s[name] = now_s + TRAIL_S
                # From a point of its own, so that it can be moved on without being sent again.
                self._path_base[name] = path[-1]
                every = -(-len(path) // DRAWN_POINTS)
                strip = (np.array(path[::-every][::-1]) - path[-1]) / self.unit
                self._segments(name, np.stack([strip[:-1], strip[1:]], axis=1), style.STYLES[name].colours[0])
            if name in self._nodes:
                move(self._nodes[name], self.drawn(name, self._path_base[name]))
                self._set_there(name, len(path) > 1)
        written = [
            label
            for name, labels in self._labels_of.items()
            if self.wanted(name) and name in self.labelled
            for label in labels
        ]
        self._write(written[:MOST_LABELS])

    def _write(self, labels: Sequence[tuple[str, Vector3, str]]) -> None:
        while len(self._labels) < len(labels):
            name = f"/labels/{len(self._labels)}"
            look: dict[str, Any] = {"anchor": "bottom-left", "font_screen_scale": self._label_scale}
            self._labels.append(self._scene.add_label(name, LABEL, visible=False, **look))
        for k, node in enumerate(self._labels):
            if k < len(labels):
                name, position, text = labels[k]
                if node.text != text:
                    node.text = text
                move(node, self._in_the_picture(name, position))
            node.visible = k < len(labels)

    def _in_the_picture(self, name: str, position: Vector3) -> Vector3:
        """A label stands in the world, whatever frame it belongs to: its size doesn't turn with that."""
        point = self.drawn(name, position)
        frame = next((frame for frame in (style.BODY, style.CENTRE, style.GHOST) if name.startswith(f"{frame}/")), None)
        if frame is None:
            return point
        w, x, y, z = self._nodes[frame].wxyz
        return np.asarray(self._nodes[frame].position) + rotate(x, y, z, w, *point)


def move(node: Any, position: Vector3) -> None:
    """Set the position (3,) of a node that isn't there already; viser 1.1 compares, too, but takes much longer."""
    if not np.array_equal(node.position, position):
        node.position = position


def wxyz(q_xyzw: Iterable[float]) -> Wxyz:
    """A quaternion in viser's order."""
    x, y, z, w = (float(c) for c in q_xyzw)
    return w, x, y, z
