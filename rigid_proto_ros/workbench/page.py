# SPDX-License-Identifier: MIT
"""The page: what all browsers show, and what they do to the body.

Everything here runs on viser's event loop, so nothing needs a lock but the queue that the physics thread fills. While
no browser is connected the page isn't told anything.
"""

from __future__ import annotations

import asyncio
import functools
import logging
import time
from collections import deque

import numpy as np
import viser

from ..base.rotation import matrix_from_quaternion
from ..base.vectors import FloatArray, IntArray, StateRow, Vector3
from ..live.live_simulation import LiveSimulation
from ..motion.state import State
from ..picture import style
from ..picture.picture import Picture
from ..simulation.observer import (
    BodyChanged,
    Event,
    GhostChanged,
    GhostPublished,
    LoadBegan,
    LoadEnded,
    MeshChanged,
    Observer,
    Published,
    Refused,
    Reset,
    SceneChanged,
    ShownLoad,
    Started,
    StringChanged,
)
from ..simulation.setup import Setup
from ..simulation.simulation import Simulation
from .body_tab import BodyTab
from .controls import Controls
from .drawing import POKE_SHOWN_NS, ViserBackend
from .flight import SCENE, Flight
from .lessons import Course, LessonPanel
from .panel import ALWAYS, CENTRE_OF_MASS, ForcesTab, SessionTab, ShowTab, TimeBar, motion_words
from .pointer import DrawnPose, Pointer, suggested_force
from .readouts import Readings, ReadoutTab
from .room import Room, fall_s
from .server import CLASS_STYLE

FRAME_S = 0.02
"""[s] Between two looks at what the simulation has told."""

GRACE_S = 2.0
"""[s] After the last browser left: a page that is loaded anew finds what it showed."""

TRAIL_NS = 4_000_000_000
"""[ns] Of the past that is drawn with a moment of it."""

FORESEEN_S = 3.0
"""[s] Of the motion of a body on a string, that the picture makes room for."""

COM_SIZE = 0.025
"""Radius of the centre of mass as drawn, in body sizes."""

AT_COM, AWAY = 0.03, 0.2
"""Body sizes from the COM at which a force's line passes: through it, and clear of it."""

DESCRIBED = (style.INERTIA_BOX, style.INERTIA_ELLIPSOID)
"""Parts that are said only when the body changes, so always, whether they are switched on or not."""

CONTACTS = f"{style.BODY}/contacts"

CLASS_LABELS = 1.6
"""Size of the picture's labels in class mode, in their usual one."""

_logger = logging.getLogger(__name__)


class Told(Observer):
    """Takes what the physics thread tells, for the page's thread, and of which jump (``Flight``)."""

    takes = frozenset(
        {
            *(Started, MeshChanged, BodyChanged, GhostChanged, SceneChanged, Reset, Published, GhostPublished),
            *(LoadBegan, LoadEnded, StringChanged, Refused),
        }
    )

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._queue: deque[tuple[Event, str]] = deque()

    def on(self, event: Event) -> None:
        """Keep it; rows of states are the teller's own."""
        if isinstance(event, (Published, GhostPublished)):
            event = event._replace(row=event.row.copy())
        if type(event) in self.takes:
            self._queue.append((event, self._flight.jump))

    def take(self) -> list[tuple[Event, str]]:
        """All that was told since the last call, in order."""
        return [self._queue.popleft() for _ in range(len(self._queue))]


class Page:
    """live: what flies. lesson: name of the bundled scene that it flies, or empty. anew: it begins anew when the first
    browser is there to see it.
    """

    def __init__(self, server: viser.ViserServer, live: LiveSimulation, lesson: str = "", anew: bool = False) -> None:
        self._begins_anew = anew
        self.server = server
        self.live = live
        self.flight = Flight(
            live, self._say, lambda: self.controls.show_again(), before_jump=lambda: self.pointer.let_go()
        )
        live.add_observer(self.flight.memory)
        self._told = Told(self.flight)
        self._listening = False
        # The picture, and the hand in it.
        self.room = Room(server)
        shown = {style.BODY_MESH, CONTACTS, *ALWAYS}
        self.backend = ViserBackend(server.scene, shown, lambda node: self.pointer.attach(node))
        self.picture = Picture(self.backend, lambda name: name in DESCRIBED or self.backend.wanted(name))
        self._com = server.scene.add_icosphere(
            f"/{style.CENTRE}/com", COM_SIZE, (30, 30, 30), cast_shadow=False, visible=False
        )
        self.pointer = Pointer(self.flight)
        self.pointer.attach_com(self._com)
        # What is known of the motion.
        self.state = live.state
        self._scenario = live.scenario
        self._strings: list[StringChanged] = []
        self._ghost_row: StateRow | None = None
        self._drawn_moment_ns: int | None = None
        self._new_scene = True
        self._dragged = False
        self._mesh_sha256 = ""
        self._resets_heard = 0
        self._undrawn = True
        self._unit, self._home = self.backend.unit, self.backend.origin
        self.readings = Readings()
        self._make_panel()
        self._open, self._coming_and_going = asyncio.Event(), asyncio.Lock()
        if lesson:
            self.lessons.name(lesson)
        server.on_client_connect(self._on_connect)
        server.on_client_disconnect(self._on_disconnect)

    def _say(self, text: str) -> None:
        """A line in the corner of all browsers."""
        for client in self.server.get_clients().values():
            client.add_notification("Workbench", text, auto_close_seconds=10.0)

    def _make_panel(self) -> None:
        gui, flight = self.server.gui, self.flight
        self.controls = Controls(gui, flight)
        self.bar = TimeBar(gui, self.controls, flight)
        self._class_style = gui.add_html("", order=-9.0)
        tabs = gui.add_tab_group()
        self.lessons = LessonPanel(
            gui,
            tabs,
            flight,
            self.readings,
            self._on_lesson,
            lambda switches: self.show_tab.switch_on(switches),
            self._for_class,
        )
        self.body_tab = BodyTab(gui, tabs, self.controls, flight, self._fly)
        self.forces_tab = ForcesTab(gui, tabs, self.controls, self.pointer)
        self.readout_tab = ReadoutTab(gui, tabs, self.readings)
        self.session_tab = SessionTab(gui, tabs, flight)
        self.show_tab = ShowTab(
            gui,
            tabs,
            self._switch,
            self.backend.see_into,
            self.room.paint,
            lambda name: self.lessons.did(f"show {name}"),
        )

    async def run(self) -> None:
        """Draw for as long as the server runs."""
        told = ""
        while True:
            await self._open.wait()
            started = time.monotonic()
            try:
                self.tick(started)
            except Exception as error:
                # The next states may be drawn all the same.
                if repr(error) != told:
                    told = repr(error)
                    _logger.exception("the page could not be drawn")
            await asyncio.sleep(max(0.002, started + FRAME_S - time.monotonic()))

    def close(self) -> None:
        """Leave nothing on the disk."""
        self.flight.close()
        self.body_tab.upload.close()

    # Browsers come and go

    async def _on_connect(self, client: viser.ClientHandle) -> None:
        self.room.look(client)
        async with self._coming_and_going:
            if not self._listening:
                await self._begin_to_listen()

    async def _begin_to_listen(self) -> None:
        self._new_scene = True
        # What acts now is told anew; what has ended meanwhile was not heard.
        self._forget_drawn()
        if self.live.loop.resets != self._resets_heard:
            self.readings.restart()
        await asyncio.to_thread(self.live.add_observer, self._told)
        self._listening = True
        self._open.set()
        begins_anew, self._begins_anew = self._begins_anew, False
        if begins_anew and self.lessons.lesson is not None:
            await self.lessons.begin()
        else:
            self.lessons.show()
            if begins_anew:
                self.flight.reset()

    async def _on_disconnect(self, client: viser.ClientHandle) -> None:
        self.pointer.left(client.client_id)
        await asyncio.sleep(GRACE_S)
        async with self._coming_and_going:
            if not self.server.get_clients() and self._listening:
                self._listening = False
                self._open.clear()
                self.flight.look_at_present()
                await asyncio.to_thread(self.live.remove_observer, self._told)
                self._resets_heard = self.live.loop.resets

    # What the simulation tells

    def tick(self, now_s: float) -> None:
        """Take what the simulation has told, and draw it."""
        events = self._told.take()
        if self.flight.moment_ns is not None and any(isinstance(event, Reset) for event, _ in events):
            self.flight.look_at_present()  # another client's reset: the run that is looked back at is over
        looking = self.flight.moment_ns is not None
        with self.server.atomic():
            if looking:
                for event, jump in events:
                    if isinstance(event, (SceneChanged, Refused)):
                        self._on(event, jump)
                self._draw_past()
            else:
                if self._drawn_moment_ns is not None:
                    self._return_to_present()
                self._take(events)
            self.backend.finish(now_s)
        state, setup = self.state, self.picture.setup
        if setup is not None:
            place = self.backend.origin.copy(), self.backend.unit
            self.pointer.drawn(DrawnPose(now_s, state.position, state.orientation_xyzw, *place, setup))
        self.pointer.hold()
        self.controls.catch_up()
        self.lessons.draw(now_s)
        self.readout_tab.draw(now_s)
        failure = self.live.loop.simulation.failure
        words = "the past" if looking else f"⚠ {failure}" if failure else self._words()
        self.bar.show(now_s, self.state.time_ns * 1e-9, self.flight.waited_for or words)
        self.session_tab.draw()

    def _words(self) -> str:
        simulation = self.live.loop.simulation
        tied = simulation.string is not None
        loads = len(self.picture.loads.acting)
        return motion_words(self._scenario, loads, tied, simulation.at_rest, self.live.paused)

    def _take(self, events: list[tuple[Event, str]]) -> None:
        times: list[int] = []
        rows: list[StateRow] = []
        for event, jump in events:
            if isinstance(event, Published):
                times.append(event.time_ns)
                rows.append(event.row)
            elif isinstance(event, GhostPublished):
                self._ghost_row = event.row
            else:
                self._draw(times, rows)
                times, rows = [], []
                self._on(event, jump)
                self._undrawn = True
        self._draw(times, rows)
        state = self.live.state
        if self._undrawn and (self.live.paused or state.time_ns == 0):
            # What was told last, as a string, is drawn with a state that may have been drawn without it.
            self.picture.redraw()
            # While time stands, or hasn't begun because kernels are being compiled, nothing is published.
            self._draw([state.time_ns], [state.row])

    def _on(self, event: Event, jump: str) -> None:
        match event:
            case Started() | MeshChanged():
                self.picture.on(event)
                self.pointer.forget_poses()
                # A run that continues from its past has its mesh read anew.
                self._new_scene |= event.mesh_sha256 != self._mesh_sha256
                self._mesh_sha256 = event.mesh_sha256
            case BodyChanged():
                self.backend.is_new |= self._new_scene
                self.picture.on(event)
                self.backend.is_new = False
                self._label_contacts()
                self._body_changed()
            case GhostChanged(time_ns, setup):
                self.picture.set_ghost(time_ns, setup)
                self._ghost_row = None
            case SceneChanged():
                self._scene_changed(jump)
            case Reset():
                self._reset(jump)
            case LoadBegan() | LoadEnded():
                factor = float(self._scenario.parameters.real_time_factor) or 1.0
                self.picture.poke_shown_ns = round(POKE_SHOWN_NS * factor)
                self.picture.on(event)
                if isinstance(event, LoadBegan) and event.load.kind in ("poke", "impulse"):
                    self._poked(event.load)
            case StringChanged():
                self._strings.append(event)
                self.picture.on(event)
                if event.string is not None:
                    self._dragged |= self.pointer.dragging
                elif self._dragged:
                    self._dragged = False
                    self.lessons.did("drag")
            case Refused(message=message):
                self.flight.say(f"Refused: {message}")
                self.controls.show_again()

    def _body_changed(self) -> None:
        scenario = self.live.scenario
        if self._new_scene:
            self._new_scene = False
            self._furnish(scenario.setup)
            size = self.picture.shape.size if self.picture.shape else 1.0
            self.pointer.usual_force = self.pointer.force = suggested_force(scenario, size)
            self.forces_tab.show_force()
        elif self.backend.unit != self._unit:
            self._furnish(scenario.setup)
        self._unit = self.backend.unit

    def _poked(self, load: ShownLoad) -> None:
        size = self.picture.shape.size if self.picture.shape else 1.0
        force = self.state.rotation.T @ load.force if load.axes == "world" else load.force
        strength = float(np.linalg.norm(force))
        self.lessons.did("poke")
        if strength > 0.0:
            lever = float(np.linalg.norm(np.cross(load.point, force))) / strength / size
            self.lessons.did("poke com" if lever < AT_COM else "poke away" if lever > AWAY else "poke between")

    def _scene_changed(self, jump: str) -> None:
        before, self._scenario = self._scenario, self.live.scenario
        self._new_scene |= jump == SCENE
        if not jump:
            self.lessons.changed(before, self._scenario)
        # First: the body of a new scene is what the factors are shown relative to.
        self.body_tab.changed(self._scenario, self._new_scene)
        self.controls.update(self._scenario.parameters.named(), at_once=self._new_scene)

    def _reset(self, jump: str) -> None:
        self._forget_drawn()
        self.pointer.forget_poses()
        self.pointer.forget()
        self.readings.restart()
        self._strings.clear()
        self.backend.origin = self.room.follow(self.live.state.position, self._home, self.backend.unit)
        if not jump:
            self.lessons.did("reset")

    def _forget_drawn(self) -> None:
        self.picture.restart()
        self.backend.forget()
        self._dragged = False

    # Drawing

    def _draw(self, times: list[int], rows: list[StateRow]) -> None:
        setup = self.picture.setup
        if not times or setup is None:
            return
        last = rows[-1]
        self._undrawn = False
        self.state = State(times[-1], last)
        self._follow(last[0:3])
        picture = self.picture
        held = self._string_energies(np.array(times), np.array(rows))
        picture.draw(np.array(times), np.array(rows))
        ghost = self._ghost_state()
        if ghost is not None:
            picture.draw_ghost(np.array(times[-1:]), ghost[np.newaxis])
        for time_ns, row, energy in zip(times[:-1], rows[:-1], held[:-1], strict=True):
            if self.readings.is_due(time_ns):
                self.readings.take(setup, State(time_ns, row), energy, None)
        self.readings.take(setup, self.state, held[-1], ghost)
        self.lessons.watched(times)

    def _ghost_state(self) -> StateRow | None:
        """The ghost's state (13,): as it was published last, or where it begins."""
        ghost = self.live.loop.ghost
        if self.picture.ghost is None or ghost is None:
            return None
        return ghost.simulation.state.row if self._ghost_row is None else self._ghost_row

    def _string_energies(self, times: IntArray, rows: FloatArray) -> list[float]:
        """Of the string at each of the times (n,), of states (n, 13) [J]."""
        string = self.picture.string
        if not string.was_tied:
            return [0.0] * len(times)
        held: list[float] = string.rows(times, rows, matrix_from_quaternion(rows[:, 3:7])).held.tolist()
        return held

    def _draw_past(self) -> None:
        moment_ns = self.flight.moment_ns
        if moment_ns == self._drawn_moment_ns or moment_ns is None:
            return
        if self._drawn_moment_ns is None:
            # Of the ghost no past is kept.
            self.picture.set_ghost(moment_ns, None)
        self._drawn_moment_ns = moment_ns
        setup = self.flight.memory.setup_at(moment_ns)
        self._draw_body(moment_ns, setup)
        times, rows = self.flight.past_rows(TRAIL_NS)
        self.picture.restart()
        self.backend.forget()
        self.state = State(moment_ns, rows[-1])
        self._follow(rows[-1][0:3])
        for change in self._strings:
            if change.time_ns <= moment_ns:
                self.picture.on(change)
        held = self._string_energies(times, rows)
        self.picture.draw(times, rows)
        self.readings.look_at(setup, self.state, held[-1])

    def _draw_body(self, time_ns: int, setup: Setup) -> None:
        """Draw the body of this setup from now on, as it was at ``time_ns``."""
        drawn, surface = self.picture.setup, setup.surface
        if drawn is setup:
            return
        if drawn is None or drawn.surface is not surface:
            vertices, triangles = (None, None) if surface is None else (surface.vertices, surface.triangles)
            self.picture.on(MeshChanged(time_ns, vertices, triangles, ""))
        self.picture.on(BodyChanged(time_ns, setup))
        self._label_contacts()
        if self.backend.unit != self._unit:
            self._furnish(setup)
            self._unit = self.backend.unit

    def _return_to_present(self) -> None:
        self._drawn_moment_ns = None
        self._draw_body(self.live.state.time_ns, self.live.scenario.setup)
        self._forget_drawn()
        loop = self.live.loop

        def introduce() -> None:
            simulation, ghost = loop.simulation, loop.ghost
            simulation.introduce(self._told)
            if ghost is not None:
                ghost.announce()
            self._told.on(Published(simulation.time_ns, simulation.state.row))

        self.flight.ask(functools.partial(self.live.call, introduce))

    def _follow(self, position: Vector3) -> None:
        if not self.pointer.dragging:
            self.backend.origin = self.room.follow(position, self.backend.origin, self.backend.unit)
        self.room.place(self.backend.origin, self.backend.unit)

    def _furnish(self, setup: Setup) -> None:
        """Make room for what is going to be seen, and look at it."""
        shape = self.picture.shape
        size = shape.size if shape is not None else 1.0
        start = setup.initial[0:3]
        points = [start]
        falls, held = bool(setup.gravity.any()), bool(setup.scene.string_attached)
        if falls or held:
            trial, foreseen_s = Simulation(setup), FORESEEN_S if held else fall_s(setup)
            for k in range(1, 41):
                points.append(trial.advance(round(foreseen_s * 1e9 * k / 40)).position)
        places = np.array(points)
        low, high = places.min(axis=0) - 0.5 * size, places.max(axis=0) + 0.5 * size
        if held:
            low, high = np.minimum(low, setup.scene.string_target), np.maximum(high, setup.scene.string_target)
        self.backend.origin = self._home = np.array(start)
        unit = self.backend.unit
        self.room.furnish(unit, (low - start) / unit, (high - start) / unit, falls and not held)
        self.backend.see_from(self.room.far)

    # What the panel asks for

    def _for_class(self, on: bool) -> None:
        self._class_style.content = CLASS_STYLE if on else ""
        self.backend.scale_labels(CLASS_LABELS if on else 1.0)
        self.bar.speed.visible = not on

    def _switch(self, part: str, shown: bool) -> None:
        if part == CENTRE_OF_MASS:
            self._com.visible = shown
        else:
            self.backend.switch(part, shown)
            # Also while time stands.
            self.picture.redraw()
            self._undrawn = True
            if self._drawn_moment_ns is not None:
                self._drawn_moment_ns = -1

    async def _fly(self, values: dict[str, object]) -> bool:
        taken = await self.flight.fly(values)
        if taken:
            self.lessons.leave()
        return taken

    def _on_lesson(self, course: Course) -> None:
        self.show_tab.show_for((*course.shows, *course.labels))
        self.backend.labelled = {CONTACTS, *course.labels}
        self._label_contacts()

    def _label_contacts(self) -> None:
        """Name the contacts that the lesson mentions, where they are on the body as it is drawn."""
        setup = self.picture.setup
        if setup is not None:
            named = [name for name in self.lessons.course.labels if name in setup.contacts]
            points = np.array([setup.body.point(setup.contacts[name]) for name in named]).reshape(-1, 3)
            self.backend.labels(CONTACTS, np.array([len(named)]), points, named)
