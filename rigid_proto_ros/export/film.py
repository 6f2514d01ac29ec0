# SPDX-License-Identifier: MIT
"""A film of a flight, drawn without a display: pygfx draws through any Vulkan driver, mesa's on the processor among
them, and ffmpeg encodes.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ..base.errors import InputError, is_missing
from ..base.files import whole_file
from ..rerun_view.appearance import BODY_COLOUR, GHOST_COLOUR, HAND_COLOUR, STRING_COLOUR, TRAIL_COLOUR
from .flight_record import FlightRecord
from .sampling import Motion, Sampler, Tolerance, Track, body_size
from .state_source import StateSource
from .string_line import string_points, string_shapes

VIEW = np.array([0.55, -0.8, 0.4])
"""From what is looked at to the eye, z up."""
FIELD_OF_VIEW = 35.0
"""[degrees], the mean of the picture's two directions, which is what pygfx takes."""
WIDE_MAX = 4.0
"""In reaches of the body: a flight through more than this is followed by the eye."""
FOLLOWED = 1.5
"""In reaches: what is in sight of a body that is followed."""
SKY, GROUND = "#f7f9fc", "#cfd8e4"
GHOST_OPACITY = 0.45
PICTURES_MAX = 200_000
OVERSAMPLING = 2
"""Pixels drawn for each one shown, along each edge: finer edges than a filter makes of one. A linear filter takes
just the mean of two, in three quarters of the time of a wider one."""
GIF_FILTER = "split[a][b];[a]palettegen[p];[b][p]paletteuse=dither=bayer:bayer_scale=4:diff_mode=rectangle"


def check_film() -> None:
    """Raise InputError where a library isn't installed."""
    try:
        # Without it libraries of the display complain on the terminal, though there is none.
        os.environ.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
        import imageio_ffmpeg  # noqa: F401 (whether it is installed)
        import pygfx  # noqa: F401 (whether it is installed)
    except ImportError as error:
        raise InputError("--video", is_missing(str(error.name), "video")) from None


def write_film(
    file: str,
    record: FlightRecord,
    motion: Motion,
    fps: float,
    size: tuple[int, int],
    progress: Callable[[float, float], None] = lambda *_: None,
) -> None:
    """Write a film of a motion at the pictures' times, .mp4 (H.264) or .gif, of ``size`` pixels (width, height)."""
    check_film()
    import imageio_ffmpeg

    settings: dict[str, Any] = {"codec": "libx264", "output_params": ["-crf", "20", "-preset", "fast"]}
    if file.lower().endswith(".gif"):
        settings = {"codec": "gif", "pix_fmt_out": "pal8", "output_params": ["-filter_complex", GIF_FILTER]}
    with whole_file("--video", file) as path:
        writer = imageio_ffmpeg.write_frames(
            str(path),
            size,
            pix_fmt_in="rgba",
            fps=fps,
            quality=None,
            macro_block_size=2,
            ffmpeg_log_level="error",
            **settings,
        )
        writer.send(None)
        try:
            for number, picture in enumerate(pictures(record, motion, size), 1):
                writer.send(picture)
                progress(number, len(motion.times_ns))
        except OSError as error:
            raise InputError("--video", file, f"a film that ffmpeg can write ({error})") from None
        finally:
            writer.close()


def film_motion(
    record: FlightRecord,
    source: StateSource | None,
    fps: float,
    begin_s: float | None = None,
    end_s: float | None = None,
) -> Motion:
    """Body and ghost at the times of the pictures of a part of the flight, simulated time begin_s to end_s [s]. Raises
    InputError for a part that has none.
    """
    sampler = Sampler(record, source, Tolerance.of(1e-3, body_size(record)), ghost=True)
    first = max(0 if begin_s is None else round(begin_s * 1e9), sampler.start_ns)
    last = min(sampler.end_ns if end_s is None else round(end_s * 1e9), sampler.end_ns)
    if last < first:
        span = f"{sampler.start_ns * 1e-9:g} to {sampler.end_ns * 1e-9:g} s"
        option, given = ("--to", end_s) if begin_s is None or begin_s * 1e9 <= sampler.end_ns else ("--from", begin_s)
        raise InputError(option, given, f"a part of the flight, which is from {span}")
    count = int((last - first) * 1e-9 * fps + 1e-9) + 1
    if count > PICTURES_MAX:
        raise InputError("--fps", fps, f"at most {PICTURES_MAX} pictures; --from and --to choose a part of the flight")
    return sampler.at(first + np.rint(np.arange(count) / fps * 1e9).astype(np.int64))


def pictures(record: FlightRecord, motion: Motion, size: tuple[int, int]) -> Iterator[np.ndarray]:
    """Pictures (height, width, 4) of uint8, one for each time of the motion. Raises InputError without a driver."""
    import pygfx
    from rendercanvas.offscreen import OffscreenRenderCanvas

    try:
        canvas = OffscreenRenderCanvas(size=size, pixel_ratio=1)
        renderer = pygfx.renderers.WgpuRenderer(canvas, pixel_scale=OVERSAMPLING, pixel_filter="linear", ppaa="none")
    except RuntimeError as error:
        reason = " ".join(str(error).split())[:120]
        raise InputError(
            "--video", f"no Vulkan driver; mesa-vulkan-drivers has one that needs no GPU ({reason})"
        ) from None
    stage = _Stage(record, motion, size[0] / size[1])
    canvas.request_draw(lambda: renderer.render(stage.scene, stage.camera))
    for k in range(len(motion.times_ns)):
        stage.show(k)
        yield np.ascontiguousarray(canvas.draw())


class _Stage:
    """What is drawn, and from where; ``show(k)`` puts everything where it is in picture k."""

    def __init__(self, record: FlightRecord, motion: Motion, aspect: float) -> None:
        import pygfx

        self.scene = pygfx.Scene()
        self.camera = pygfx.PerspectiveCamera(FIELD_OF_VIEW, aspect)
        # Half of what the narrower direction sees of the mean of both.
        self._half_view = np.arctan(np.tan(np.radians(0.5 * FIELD_OF_VIEW)) * 2.0 * min(1.0, aspect) / (1.0 + aspect))
        self._places = motion.body.poses[:, :3]
        self.scene.add(pygfx.Background.from_color(GROUND, SKY))
        self.scene.add(pygfx.AmbientLight("#ffffff", 0.9))
        light = pygfx.DirectionalLight("#ffffff", 2.4)
        light.local.position = tuple(VIEW + [0.5, 0.4, 1.0])
        self.scene.add(light)
        styles = ((BODY_COLOUR, 1.0), (GHOST_COLOUR, GHOST_OPACITY))
        self._bodies = [
            _Drawn(self.scene, record, motion, track, colour, opacity)
            for (colour, opacity), track in zip(styles, motion.tracks, strict=False)
        ]
        self._trail = self._line(self._places, TRAIL_COLOUR, 2.0)
        self._curves = string_points(string_shapes(record, motion.times_ns, motion.body.poses))
        self._string = self._line(np.zeros(self._curves.shape[1:]), STRING_COLOUR, 3.0)
        self._hand = pygfx.Mesh(
            pygfx.sphere_geometry(0.03 * body_size(record)), pygfx.MeshPhongMaterial(color=_rgb(HAND_COLOUR))
        )
        self.scene.add(self._hand)
        self._aim()

    def _line(self, points: np.ndarray, colour: tuple[int, int, int], thickness: float) -> Any:
        import pygfx

        line = pygfx.Line(
            pygfx.Geometry(positions=points.astype(np.float32)),
            pygfx.LineMaterial(thickness=thickness, color=_rgb(colour)),
        )
        self.scene.add(line)
        return line

    def _aim(self) -> None:
        reach = max(body.reach for body in self._bodies)
        known = np.vstack([self._places, self._curves[:, 0][~np.isnan(self._curves[:, 0, 0])]])
        middle = 0.5 * (known.min(axis=0) + known.max(axis=0))
        radius = 0.5 * float(np.linalg.norm(np.ptp(known, axis=0))) + reach
        self._moves = float(np.ptp(self._places, axis=0).max()) > 0.01 * reach
        self._follows = radius > WIDE_MAX * reach
        self._middle = middle
        radius = FOLLOWED * reach if self._follows else radius
        self._eye = VIEW / np.linalg.norm(VIEW) * radius / np.sin(self._half_view)
        self.camera.depth_range = (0.01 * radius, 100.0 * radius)
        self.camera.world.reference_up = (0.0, 0.0, 1.0)

    def show(self, k: int) -> None:
        """Put everything where it is in picture k."""
        for body in self._bodies:
            body.show(k)
        self._trail.geometry.positions.draw_range = (0, max(k + 1, 2))
        self._trail.visible = self._moves and k > 0
        curve = self._curves[k]
        self._string.visible = self._hand.visible = not np.isnan(curve[0, 0])
        if self._string.visible:
            self._string.geometry.positions.data[:] = curve
            self._string.geometry.positions.update_full()
            self._hand.local.position = tuple(curve[0])
        middle = self._places[k] if self._follows else self._middle
        self.camera.local.position = tuple(middle + self._eye)
        self.camera.look_at(tuple(middle))


class _Drawn:
    """One body; ``reach``: how far from its centre of mass it extends at most [m]."""

    def __init__(
        self,
        scene: Any,
        record: FlightRecord,
        motion: Motion,
        track: Track,
        colour: tuple[int, int, int],
        opacity: float,
    ) -> None:
        import pygfx

        self._poses = track.poses
        self._spans = motion.spans(track)
        self._group = pygfx.Group()
        scene.add(self._group)
        self._meshes = []
        self._centres = []
        for mesh in record.meshes:
            points, triangles, normals = mesh.surface
            material = pygfx.MeshPhongMaterial(color=_rgb(colour), opacity=opacity, shininess=15, specular="#303030")
            if opacity < 1.0:
                # Whatever order its triangles have.
                material.alpha_mode, material.side = "weighted_blend", "front"
            geometry = pygfx.Geometry(positions=points, indices=triangles.astype(np.int32), normals=normals)
            drawn = pygfx.Mesh(geometry, material)
            self._group.add(drawn)
            self._meshes.append(drawn)
            self._centres.append(mesh.centre)
        self.reach = max((self._reach(record, span.drawn.mesh, span.drawn.body) for span in self._spans), default=0.0)
        self.reach = self.reach or body_size(record)

    def _reach(self, record: FlightRecord, mesh: int, body: Any) -> float:
        if mesh < 0:
            return 0.0
        return float(np.linalg.norm(record.meshes[mesh].vertices * body.scale - body.center_of_mass, axis=1).max())

    def show(self, k: int) -> None:
        """Put it where it is in picture k."""
        pose = self._poses[k]
        self._group.visible = not np.isnan(pose[0])
        if not self._group.visible:
            return
        self._group.local.position = tuple(pose[:3])
        self._group.local.rotation = tuple(pose[3:])
        span = next(span for span in self._spans if span.begin <= k < span.end)
        body = span.drawn.body
        for number, (mesh, centre) in enumerate(zip(self._meshes, self._centres, strict=True)):
            mesh.visible = number == span.drawn.mesh
            if mesh.visible:
                mesh.local.scale = tuple(body.scale)
                mesh.local.position = tuple(body.scale * centre - body.center_of_mass)


def _rgb(colour: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
