# SPDX-License-Identifier: MIT
"""A lesson as one file: its recorded motion in viser's own player, with its words beside it.

The file holds the player's program and everything that it shows, so that it opens from disk without a server.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from html import escape

import numpy as np
import viser

from ..base.vectors import FloatArray, Vector3
from ..export.flight_record import FlightRecord
from ..picture import style
from ..picture.picture import Picture
from ..scene.lessons import Lesson
from ..simulation.observer import BodyChanged, Event, StringChanged
from .drawing import POKE_SHOWN_NS, ViserBackend
from .lessons import COURSES, Course
from .panel import ALWAYS, PARTS, SEE_INTO
from .room import Room
from .server import LANDSCAPE_PRINT, PRINTED_PICTURE, stop_server

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>
html, body {{ margin: 0; height: 100%; }}
body {{ display: flex; font: 1rem/1.5 system-ui, sans-serif; background: #fff; color: #222; }}
iframe {{ flex: 1; border: 0; min-width: 0; min-height: 0; }}
aside {{ width: min(24rem, 45%); box-sizing: border-box; padding: 1.5rem; overflow: auto; }}
aside {{ border-left: 1px solid #ddd; }}
h1 {{ font-size: 1.35rem; line-height: 1.25; margin: 0 0 1rem; }}
h2 {{ font-size: 1rem; margin: 1.5rem 0 0; }}
summary {{ cursor: pointer; font-weight: 600; }}
small {{ color: #666; }}
@media (max-width: 60rem) and (orientation: portrait) {{
  body {{ flex-direction: column; }}
  aside {{ width: auto; height: 40%; border: 0; border-top: 1px solid #ddd; }}
}}
@media print {{
  html, body, aside {{ display: block; width: auto; height: auto; overflow: visible; border: 0; }}
  iframe {{ width: 100%; height: {height}; }}
}}
{landscape}
</style></head><body><iframe title="the motion" srcdoc="{player}"></iframe>
<aside><h1>{title}</h1>{speed}<p>{question}</p><ol type="A">{choices}</ol>
<details><summary>Show the answer</summary><p><b>{answer}</b> {reason}</p></details>
<h2>To try yourself</h2>{sentences}<p><small>{commands}</small></p></aside></body></html>
"""
"""The player beside the words; above them on a narrow screen that is higher than wide, and on paper."""


def lesson_html(lesson: Lesson, record: FlightRecord) -> str:
    """The file's text. record: the flight, with states as far apart as they are to be played at the lesson's speed."""
    course = COURSES[lesson.name]
    # Its greeting would stand between the lines that the command prints.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", verbose=False)
    try:
        player = _recorded(server, record, course)
    finally:
        stop_server(server)
    # viser 1.1 leaves the canvas of a recording nearly transparent where it has begun to fade it in.
    player = player.replace("</head>", "<style>canvas { opacity: 1 !important; }</style></head>", 1)
    return PAGE.format(
        title=escape(lesson.title),
        height=PRINTED_PICTURE,
        landscape=LANDSCAPE_PRINT,
        player=escape(player),
        question=escape(lesson.question),
        choices="".join(f"<li>{escape(choice)}</li>" for choice in lesson.choices),
        answer="ABC"[lesson.answer],
        reason=escape(lesson.reason),
        sentences="".join(f"<p>{escape(sentence)}</p>" for sentence in lesson.sentences),
        commands=escape(lesson.commands),
        speed=f"<p><small>Played at {course.speed:g} of the real speed.</small></p>" if course.speed != 1.0 else "",
    )


def _recorded(server: viser.ViserServer, record: FlightRecord, course: Course) -> str:
    """The player with the motion in it, and with the parts that the course shows."""
    changes, times_ns, rows, ghosts = record.changes, record.times_ns, record.rows, record.ghosts
    room = Room(server)
    named = (*course.shows, *course.labels)
    shown = {style.BODY_MESH, *ALWAYS, *named, *(part for name in named for part in PARTS.get(name, ()))}
    falls = any(isinstance(event, BodyChanged) and np.any(event.setup.gravity) for event in changes)
    if falls:
        shown.add(style.COM_TRAIL)
    backend = ViserBackend(server.scene, shown, lambda _: None)
    backend.labelled.update(course.labels)
    backend.see_into(SEE_INTO in course.shows)
    picture = Picture(backend, backend.wanted, rate=1_000_000_000)
    picture.poke_shown_ns = round(POKE_SHOWN_NS * course.speed)
    backend.origin = rows[0, 0:3].copy()
    waiting = list(changes)
    serializer = None
    for k, (time_ns, row) in enumerate(zip(times_ns.tolist(), rows, strict=True)):
        while waiting and (serializer is None or waiting[0].time_ns < time_ns) and waiting[0].time_ns <= time_ns:
            picture.on(waiting.pop(0))
        picture.draw(np.array([time_ns]), row[np.newaxis])
        if time_ns in ghosts and picture.ghost is not None:
            picture.draw_ghost(np.array([time_ns]), ghosts[time_ns][np.newaxis])
        backend.finish(1e-9 * time_ns / course.speed)
        if serializer is None:
            low, high = _corners(rows, changes, picture, backend.origin)
            size = backend.unit
            room.furnish(size, low / size, high / size, falls)
            room.place(backend.origin, size)
            backend.see_from(room.far)
            serializer = server.get_scene_serializer()
        if k + 1 < len(times_ns):
            serializer.insert_sleep(1e-9 * float(times_ns[k + 1] - time_ns) / course.speed)
    assert serializer is not None, "a flight has a state at least"
    return serializer.as_html()


def _corners(
    rows: FloatArray, changes: Sequence[Event], picture: Picture, origin: Vector3
) -> tuple[FloatArray, FloatArray]:
    """Two corners (3,) [m, from the origin] of what is to be seen: the body's whole path, and the hand."""
    shape = picture.shape
    reach = 0.0 if shape is None else 0.5 * shape.size
    if shape is not None and shape.tip is not None:
        reach = max(reach, float(np.linalg.norm(shape.tip)))
    strings = [event.string for event in changes if isinstance(event, StringChanged) and event.string is not None]
    hands = np.array([string.target for string in strings], dtype=float).reshape(-1, 3) - origin
    path = rows[:, 0:3] - origin
    low, high = path.min(axis=0) - reach, path.max(axis=0) + reach
    return np.minimum(low, hands.min(axis=0, initial=np.inf)), np.maximum(high, hands.max(axis=0, initial=-np.inf))
