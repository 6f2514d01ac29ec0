# SPDX-License-Identifier: MIT
"""The time bar, which is always visible, and the tabs for forces, for the run since the last reset, and for display."""

from __future__ import annotations

import asyncio
import copy
import hashlib
import io
import tempfile
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import viser

from ..base.bundled import body_names
from ..base.errors import InputError
from ..base.files import read_bounded
from ..export.flight_record import FlightRecord, frames, source_of_session
from ..export.gltf import write_gltf
from ..export.tracks import tracks_of
from ..mesh.locate import resolve_mesh
from ..mesh.reading import MAX_BYTES, read_mesh
from ..picture import style
from ..scene.scenario import Scenario, mesh_sha256_of, scene_text
from ..scene.scene_file import read_scene_text
from ..session.as_script import SceneAndScript, script_of_session
from ..session.recorded_session import play
from .body_tab import shown_name
from .controls import NOTE, Controls, log_slider, on_slider
from .flight import Flight
from .pointer import Pointer
from .server import MARK

SPEEDS = {"1/100": 0.01, "1/20": 0.05, "1/10": 0.1, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "5": 5.0}
"""Simulated seconds per second, as the bar names them."""

PAUSE, PLAY, STEP, RESET = "Pause", "Play", "Step", "Reset"

TIME_S = 0.1
"""[s] Between two updates of the time that is shown."""

REWIND_STEP_S = 0.05
"""[s] Step of the rewind slider."""

RATES = ("24", "25", "30", "60")

GRAVITIES = {"none": [0.0] * 3, "Earth's, 9.81 m/s²": [0.0, 0.0, -9.81], "Moon's, 1.62 m/s²": [0.0, 0.0, -1.62]}

FORCE_DECADES = 2.0
"""Range of the force's slider in decades, up and down from the force that suits the body."""

SEE_INTO, CENTRE_OF_MASS, PATHS = "See into the body", "Centre of mass", "Paths of the COM and of a point"

PARTS: dict[str, tuple[str, ...]] = {
    CENTRE_OF_MASS: (CENTRE_OF_MASS,),
    "Principal axes": (style.PRINCIPAL_AXES,),
    "Inertia ellipsoid and box": (style.INERTIA_ELLIPSOID, style.INERTIA_BOX),
    "Angular momentum L": (style.MOMENTUM,),
    "Angular velocity ω": (style.OMEGA,),
    PATHS: (style.COM_TRAIL, style.TRAIL),
}
"""Parts of the picture by the name of their switch."""

ALWAYS = (style.STRING, style.HAND, style.LOADS, style.GHOST_MESH)
"""Parts that are always shown."""


class TimeBar:
    """Shared by all pages."""

    def __init__(self, gui: viser.GuiApi, controls: Controls, flight: Flight) -> None:
        self._flight = flight
        self._words, self._due_s = "", 0.0
        with gui.add_folder("Time"):
            self._line = gui.add_html("")
            play = gui.add_button_group("Simulation", (PAUSE, STEP, RESET))
            self.speed = controls.choice("real_time_factor", "Speed", SPEEDS)
        self._play: Any = play

        @play.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            controls.settle()
            if play.value == RESET:
                flight.reset()
            elif play.value == STEP:
                if flight.leave_past():
                    return  # Time stands in the present, as after a pause.
                if flight.paused:
                    flight.step()
                else:
                    flight.pause(True)
            else:
                await self.play_or_pause()

        # Browsers send no key that is typed into an input.
        @gui.add_command("Pause or resume; after rewinding, continue from there", hotkey="space").on_trigger
        async def _(_: Any) -> None:
            await self.play_or_pause()

    async def play_or_pause(self) -> None:
        """Pause or resume; if the past is shown, continue from there."""
        if self._flight.moment_ns is not None:
            await self._flight.go_on_from_here()
        else:
            self._flight.pause(not self._flight.paused)

    def show(self, now_s: float, time_s: float, words: str) -> None:
        """Show the simulated time, ten times a second at most, and what the body is doing; now_s: the wall's time."""
        flight = self._flight
        label = PLAY if flight.paused or flight.moment_ns is not None else PAUSE
        if self._play.options[0] != label:
            self._play.options = (label, STEP, RESET)
        if words == self._words and now_s < self._due_s:
            return
        self._words, self._due_s = words, now_s + TIME_S
        self._line.content = f'<div class="{MARK}"><b>{time_s:.2f} s</b> <span>{words}</span></div>'


def motion_words(scenario: Scenario, loads: int, tied: bool, at_rest: bool, paused: bool) -> str:
    """State of the motion in words. loads: how many loads act; tied: whether a string is tied."""
    setup = scenario.setup
    if paused:
        return "paused"
    if loads:
        words = "a force acts" if loads == 1 else f"{loads} forces act"
    elif tied:
        words = "string attached"
    elif at_rest:
        words = "at rest"
    elif setup.gravity.any():
        words = "free fall"
    else:
        words = "free rotation"
        if setup.integrator.name in ("auto", "free_body") and not (
            setup.scene.linear_damping or setup.scene.angular_damping
        ):
            words += ", exact"
    return words if setup.scene.gyroscopic else f"{words}, without ω × Iω"


class ForcesTab:
    """Loads on the body: the force of a click, initial spin, gravity, and any parameter by its name."""

    def __init__(self, gui: viser.GuiApi, tabs: viser.GuiTabGroupHandle, controls: Controls, pointer: Pointer) -> None:
        self._pointer = pointer
        with tabs.add_tab("Forces"):
            with gui.add_folder("By hand"):
                suits = "Force of a click, relative to a force that suits the body's mass and size"
                force: Any = log_slider(gui, "Force ×", FORCE_DECADES, suits)
                self._force = gui.add_html("")
            with gui.add_folder("Motion"):
                controls.numbers("initial.angular_velocity", "Initial spin [rad/s]", 3)
                controls.checkbox("gyroscopic", "Gyroscopic term ω × Iω")
                controls.choice("gravity", "Gravity", GRAVITIES)
            with gui.add_folder("Any parameter"):
                controls.any_parameter()

        self._slider = force

        async def change(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                pointer.force = float(f"{pointer.usual_force * 10.0 ** force.value[0]:.3g}")
                self.show_force()

        force.on_update(change)

    def show_force(self) -> None:
        """The poke's force, as it is now."""
        pointer = self._pointer
        self._force.content = NOTE.format(f"{pointer.force:.3g} N")
        self._slider.value = on_slider(pointer.force / pointer.usual_force, FORCE_DECADES)


class SessionTab:
    """The tab for the recording of the run since the last reset."""

    def __init__(self, gui: viser.GuiApi, tabs: viser.GuiTabGroupHandle, flight: Flight) -> None:
        self._flight = flight
        with tabs.add_tab("Record"):
            with gui.add_folder("Rewind"):
                hint = "Simulated time is paused while the past is shown; Play goes on from there"
                self._back: Any = gui.add_slider("Seconds back", 0.0, 10.0, REWIND_STEP_S, 0.0, hint=hint)
            with gui.add_folder("Recording since the last reset"):
                hint = "The commands given on this page; they reproduce the motion bit for bit (.zip)"
                save = gui.add_button("Save scene and script", hint=hint)
                rate: Any = gui.add_dropdown("Frames a second", RATES, initial_value="30")
                export = gui.add_button("Save as glTF", hint="For Blender and others (.glb)")
                self._saved = gui.add_markdown("")

        @self._back.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                seconds = float(self._back.value)
                if seconds <= 0.0:
                    flight.look_at_present()
                else:
                    flight.look_at(flight.reach_s[1] - seconds)

        @save.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                await self._saving(event.client, "take.zip", self._take)

        @export.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                await self._saving(event.client, "take.glb", lambda: self._motion(float(rate.value)))

    def draw(self) -> None:
        """Update the range of the rewind slider, which grows with the run."""
        flight = self._flight
        first_s, last_s = flight.reach_s
        looking = flight.moment_ns is not None
        if not looking:
            available = max(10.0, 10.0 * -(-(last_s - first_s) // 10.0))
            if self._back.max != available:
                self._back.max = available
        back_s = last_s - (flight.moment_ns or 0) * 1e-9 if looking else 0.0
        # The user may have set more than is available; the value is overwritten only if it differs by a step.
        if abs(self._back.value - back_s) > 0.5 * REWIND_STEP_S:
            self._back.value = min(back_s, self._back.max)

    async def _saving(self, client: viser.ClientHandle, name: str, make: Callable[[], tuple[bytes, str]]) -> None:
        try:
            content, note = await asyncio.to_thread(make)
        except InputError as error:
            self._flight.say(f"Not saved: {error}")
            return
        client.send_file_download(name, content, save_immediately=True)
        self._saved.content = note

    def _take(self) -> tuple[bytes, str]:
        saved, meshes = with_meshes(script_of_session(self._flight.memory.session()))
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in meshes.items():
                archive.writestr(name, content)
            archive.writestr("scene.yaml", saved.scene)
            archive.writestr("script.yaml", saved.script)
        note = f"{len(saved.entries)} commands. Unpack, then:\n\n`rigid_proto simulate scene.yaml --script script.yaml`"
        return packed.getvalue(), note

    def _motion(self, rate: float) -> tuple[bytes, str]:
        session = self._flight.memory.session()
        record = FlightRecord()
        play(session, record)
        made, report = frames(record, source_of_session(session), rate)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "take.glb"
            write_gltf(str(file), made, tracks_of(made))
            return file.read_bytes(), report


def with_meshes(saved: SceneAndScript) -> tuple[SceneAndScript, dict[str, bytes]]:
    """A run whose scene and script name meshes in their own folder, and these files by name: the original ones may no
    longer exist later. Bundled meshes stay as they are.

    Raises InputError for a mesh that can't be read, or isn't in one file.
    """
    values: dict[str, Any] = dict(read_scene_text(saved.scene).values)
    entries: list[dict[str, Any]] = copy.deepcopy(saved.entries)
    names: dict[str, str] = {}
    files: dict[str, bytes] = {}
    for changes in (values, *(entry["set"] for entry in entries if "set" in entry)):
        mesh = changes.get("mesh", "")
        if mesh in ("", *body_names()):
            continue
        if mesh not in names:
            path = resolve_mesh(mesh)
            content = read_bounded(path, MAX_BYTES, "mesh", "a mesh file")
            if read_mesh(content, path).sha256 != hashlib.sha256(content).hexdigest():
                accepted = "a file that holds the whole mesh, such as a .glb: others that it reads aren't saved with it"
                raise InputError("mesh", mesh, accepted)
            name, suffix = shown_name(path.name)
            stem, number = name.removesuffix(f".{suffix}"), 1
            while name in files:
                number += 1
                name = f"{stem}_{number}.{suffix}"
            names[mesh], files[name] = name, content
        changes["mesh"] = names[mesh]
    return SceneAndScript(scene_text(values, mesh_sha256_of(saved.scene)), entries), files


class ShowTab:
    """switch(part, shown) shows or hides a part; see_into(on) makes the body transparent, dark(on) selects the dark
    theme. on_shown(name) is called when something is switched on.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        tabs: viser.GuiTabGroupHandle,
        switch: Callable[[str, bool], None],
        see_into: Callable[[bool], None],
        dark: Callable[[bool], None],
        on_shown: Callable[[str], None],
    ) -> None:
        self._switch = switch
        self._see_into = see_into
        self._switches: dict[str, Any] = {}
        with tabs.add_tab("Show"):
            darkened = gui.add_checkbox("Dark", False)
            for name in (SEE_INTO, *PARTS):
                self._switches[name] = gui.add_checkbox(name, False)

        for name, box in self._switches.items():

            async def show_part(_: viser.GuiEvent[Any], name: str = name, box: Any = box) -> None:
                self._set(name, box.value)
                if box.value:
                    on_shown(name)

            box.on_update(show_part)

        @darkened.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            dark(darkened.value)

    def _set(self, name: str, shown: bool) -> None:
        if name == SEE_INTO:
            self._see_into(shown)
        for part in PARTS.get(name, ()):
            self._switch(part, shown)

    def show_for(self, names: Iterable[str]) -> None:
        """Switch on what a scene needs, by names of switches or of parts, and the rest off."""
        wanted = set(names)
        for name, box in self._switches.items():
            box.value = not wanted.isdisjoint((name, *PARTS.get(name, ())))
        self._switch(style.STRING_LINE, style.STRING_LINE in wanted)

    def switch_on(self, names: Iterable[str]) -> None:
        """Turn these switches on, by their names."""
        for name in names:
            self._switches[name].value = True
