# SPDX-License-Identifier: MIT
"""Time as a session: rewind and branch, and the take as files: scene and script, mesh, glTF."""

from __future__ import annotations

import asyncio
import io
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import viser

from ..base.errors import InputError
from ..export.flight_record import FlightRecord, frames, source_of_session
from ..export.gltf import write_gltf
from ..export.tracks import tracks_of
from ..session.as_script import script_of_session
from ..session.replay import play
from .flight import Flight

STEP_S = 0.05
"""[s] Of the rewind slider."""

RATES = ("24", "25", "30", "60")


class SessionTab:
    """The tab of what is kept of the run since the last reset."""

    def __init__(
        self,
        gui: viser.GuiApi,
        tabs: viser.GuiTabGroupHandle,
        flight: Flight,
        say: Callable[[str], None],
    ) -> None:
        self._gui = gui
        self._flight = flight
        self._say = say
        with tabs.add_tab("Record"):
            self._rewind_folder()
            self._save_folder()

    def _rewind_folder(self) -> None:
        gui, flight = self._gui, self._flight
        with gui.add_folder("Rewind"):
            self._back: Any = gui.add_slider(
                "Seconds back", 0.0, 10.0, STEP_S, 0.0, hint="Time stands while the past is shown"
            )
            self._go_on = gui.add_button("Go on from here", disabled=True, hint="With another future")

        @self._back.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                seconds = float(self._back.value)
                if seconds <= 0.0:
                    flight.look_at_present()
                else:
                    flight.look_at(flight.reach_s[1] - seconds)

        @self._go_on.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            await flight.go_on_from_here()

    def draw(self) -> None:
        """How far back one can go grows while the body flies."""
        flight = self._flight
        first_s, last_s = flight.reach_s
        looking = flight.moment_ns is not None
        if not looking:
            available = max(10.0, 10.0 * -(-(last_s - first_s) // 10.0))
            if self._back.max != available:
                self._back.max = available
        back_s = last_s - (flight.moment_ns or 0) * 1e-9 if looking else 0.0
        # What a hand has just set may be more than there is; only what differs by a step is written over it.
        if abs(self._back.value - back_s) > 0.5 * STEP_S:
            self._back.value = min(back_s, self._back.max)
        self._go_on.disabled = not looking

    def _save_folder(self) -> None:
        gui = self._gui
        with gui.add_folder("Take, since the last reset"):
            save = gui.add_button(
                "Save scene and script", hint="What was done by hand; reproduces the motion bit for bit (.zip)"
            )
            rate: Any = gui.add_dropdown("Frames a second", RATES, initial_value="30")
            export = gui.add_button("Save as glTF", hint="For Blender and others (.glb)")
            self._saved = gui.add_markdown("")

        @save.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                await self._saving(event.client, "take.zip", self._take)

        @export.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                await self._saving(event.client, "take.glb", lambda: self._motion(float(rate.value)))

    async def _saving(self, client: viser.ClientHandle, name: str, make: Callable[[], tuple[bytes, str]]) -> None:
        try:
            content, note = await asyncio.to_thread(make)
        except InputError as error:
            self._say(str(error))
            return
        client.send_file_download(name, content, save_immediately=True)
        self._saved.content = note

    def _take(self) -> tuple[bytes, str]:
        saved = script_of_session(self._flight.memory.session())
        scene, packed = saved.scene, io.BytesIO()
        mesh = self._flight.scenario.body_mesh
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            if mesh is not None and mesh.mesh.path == self._flight.scenario.parameters.mesh:
                # Beside the scene, which names it: the file itself may be gone by then.
                name = Path(mesh.mesh.path).name
                archive.writestr(name, Path(mesh.mesh.path).read_bytes())
                scene = scene.replace(mesh.mesh.path, name)
            archive.writestr("scene.yaml", scene)
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
