# SPDX-License-Identifier: MIT
"""The page without a browser: its own callbacks on one end, a body that flies as far as it is told to on the other."""

from __future__ import annotations

import asyncio
import io
import json
import time
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import chdir, contextmanager
from pathlib import Path

import numpy as np
import pytest
from viser._messages import GuiUpdateMessage
from workbench_page import bare_page

from rigid_proto_ros.live.live_simulation import LiveSimulation
from rigid_proto_ros.mesh.locate import resolve_mesh
from rigid_proto_ros.scene.lessons import lesson
from rigid_proto_ros.scene.scenario import Scenario, nanoseconds, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.simulation.commands import Command
from rigid_proto_ros.workbench import controls
from rigid_proto_ros.workbench import page as page_module
from rigid_proto_ros.workbench.lessons import FREE
from rigid_proto_ros.workbench.main import Workbench
from rigid_proto_ros.workbench.pointer import DrawnPose

PATIENCE_S = 180.0


@contextmanager
def without_waiting() -> Iterator[None]:
    """What a page waits for the sake of people's hands takes no time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page_module, "GRACE_S", 0.0)
        patch.setattr(controls, "TYPING_S", 0.0)
        patch.setattr(controls, "TOUCHED_S", 0.0)
        yield


class FlownPage:
    """A user at the page, by its own callbacks. All times are simulated: no thread advances the body. said: what the
    page says in its corner."""

    def __init__(self, scene: str = "t_handle", lesson: str = "", anew: bool = False) -> None:
        self.live = LiveSimulation(read_scene(scene))
        self.live.announce()
        self.live.loop.begin_ghost()
        self.workbench = Workbench(self.live, lesson=lesson, anew=anew)
        self.page, self.server = self.workbench.page, self.workbench.page.server
        self.said: list[str] = []
        self.page.flight.say = self.said.append
        self.come()
        self.until(lambda: self.page.picture.setup is not None, "body")
        self.fly(0.0)

    def end(self) -> None:
        self.leave()
        self.workbench.close()

    def come(self) -> None:
        """Open the page."""
        self._socket = bare_page(self.server.get_port())
        self.browser = self._socket.__enter__()

    def leave(self) -> None:
        """Close it."""
        self._socket.__exit__(None, None, None)

    def go_away(self) -> None:
        """Close it, and wait until it stops listening."""
        self.leave()
        self.until(lambda: self.page._told not in self.live._observers, "end of listening")

    def come_back(self) -> None:
        """Open it, wait until it hears again, and watch."""
        self.come()
        self.until(lambda: self.page._told in self.live._observers, "page that hears again")
        self.fly(0.1)

    def do(self, function: Callable):
        """Run a function on the page's thread."""

        async def done():
            found = function()
            return await found if asyncio.iscoroutine(found) else found

        return asyncio.run_coroutine_threadsafe(done(), self.server.get_event_loop()).result(PATIENCE_S)

    def until(self, condition: Callable[[], object], what: str):
        deadline = time.monotonic() + PATIENCE_S
        while not (found := self.do(condition)):
            assert time.monotonic() < deadline, f"no {what}; said {self.said}"
            time.sleep(0.005)
        return found

    # What a user does

    @property
    def scenario(self) -> Scenario:
        return self.live.scenario

    def fly(self, seconds: float) -> None:
        """Watch for so long."""
        self.wait_until_asked()
        self.do(lambda: self.advance(seconds))
        self.wait_until_still()

    def advance(self, seconds: float) -> None:
        """What the physics thread does in so long."""
        loop, simulation = self.live.loop, self.live.loop.simulation
        end_ns = simulation.time_ns + nanoseconds(seconds)
        while loop.publications.next_ns <= end_ns:
            loop._budget.begin_tick()
            loop._publish_next()
            assert not simulation.failure
        simulation.advance(end_ns)

    def node(self, part: str):
        """The viser node of a part of the picture."""
        return self.page.backend._nodes[part]

    def wait_until_asked(self) -> None:
        """Until all that was asked for is done."""
        self.do(lambda: asyncio.sleep(0.0))
        self.page.flight._worker.submit(int).result(PATIENCE_S)

    def wait_until_still(self) -> None:
        """The same, and until the page shows what the body does."""
        self.wait_until_asked()
        page, live = self.page, self.live
        self.until(
            lambda: page.flight.moment_ns is not None or page.state.time_ns == live.state.time_ns,
            "page that has heard all",
        )
        self.until(lambda: not self.page._told._queue, "page that has heard all")

    def widget(self, label: str):
        """An input, a button or a button group by its label."""
        found = [w for w in self._widgets() if getattr(w, "label", None) == label]
        assert len(found) == 1, f"{len(found)} inputs are called {label!r}"
        return found[0]

    def _widgets(self):
        return self.server.gui._gui_input_handle_from_uuid.values()

    def set(self, label: str, value) -> None:
        """Write, move, switch or choose."""
        widget = self._usable(label)
        if hasattr(widget, "options"):
            assert value in widget.options, f"{label}: {widget.options}"
        self._update(widget, value)

    def press(self, label: str, of: str = "") -> None:
        """A button; ``of`` a group."""
        self._update(self._usable(of or label), label if of else True)

    def _usable(self, label: str):
        widget = self.widget(label)
        assert widget.visible and not getattr(widget, "disabled", False), label
        return widget

    def _begin_update(self, widget, value) -> Future[None]:
        """As a browser says it."""

        async def update() -> None:
            (client,) = self.server.get_clients()
            message = GuiUpdateMessage(widget._impl.uuid, {"value": value})
            await self.server.gui._handle_gui_updates(client, message)
            await asyncio.sleep(0.01)

        return asyncio.run_coroutine_threadsafe(update(), self.server.get_event_loop())

    def _update(self, widget, value) -> None:
        """Until the page has done what it means."""
        self._begin_update(widget, value).result(PATIENCE_S)
        self.wait_until_still()
        self.do(lambda: asyncio.sleep(0.0))

    def ask(self, name: str) -> None:
        """A lesson of the list from its beginning, with its question."""
        self.set("Lesson", FREE)
        self.set("Lesson", lesson(name).title)
        self.until(lambda: self.page.lessons._asked and not self.page._undrawn, "question")

    def pick(self, name: str) -> None:
        """The same, and the first answer to its question."""
        self.ask(name)
        self.do(lambda: self.page.lessons.answer(0))
        self.fly(0.0)

    def start_over(self) -> None:
        """The first lesson anew; nothing said."""
        self.pick("t_handle")
        self.said.clear()

    def upload(self, name: str, body: str) -> None:
        """A file of this name with the mesh of a bundled body."""
        text = b"# z up\n" + resolve_mesh(body).read_bytes()
        self.do(lambda: self.page.body_tab.upload.take(name, text))

    def begin(self, scene: dict) -> None:
        """A scene by its parameters."""
        assert self.do(lambda: self.page.flight.fly(scene))
        self.fly(0.0)

    def change(self, values: dict) -> None:
        """Set parameters."""
        self.do(lambda: self.page.flight.set(values))
        self.fly(0.0)

    def act(self, entry: dict) -> None:
        """An entry of a poke script, without its time."""
        self.do(lambda: self.page.flight.do(entry))

    @property
    def events(self) -> list[dict]:
        """What was done since the last reset, as the event log has it."""
        return [json.loads(line) for _, line in self.page.flight.memory.session().events]

    def look_back(self, seconds: float) -> None:
        """At the past, or, with 0, at the present."""
        self._update(self.widget("Seconds back"), seconds)
        self.until(lambda: (self.page._drawn_moment_ns is not None) == (seconds > 0.0), "moment")
        if seconds > 0.0:
            self.until(lambda: self.widget("Simulation").options[0] == "Play", "button")

    def click(self, mesh_point, direction=None) -> None:
        """Click on the body, as it is drawn, where it has this point; direction of the view (3,) [world]."""
        state, body = self.page.state, self.page.picture.setup.body
        origin, unit = self.page.backend.origin, self.page.backend.unit
        seen = DrawnPose(0.0, state.position, state.orientation_xyzw, origin.copy(), unit, self.page.picture.setup)
        point = state.position + state.rotation @ body.point(tuple(mesh_point))
        direction = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
        eye = (point - 3.0 * self.page.picture.shape.size * direction - origin) / unit
        assert self.do(lambda: self.page.pointer.click(eye, direction, seen, push=False)), "a click beside the body"
        self.wait_until_still()

    def grab(self, mesh_point) -> np.ndarray:
        """Press on the body at this point; where that is (3,) [world]."""
        state, body = self.page.state, self.page.picture.setup.body
        place = state.position + state.rotation @ body.point(tuple(mesh_point))
        drawn = self._drawn(place)
        self.do(lambda: self.page.pointer.grab(1, drawn, drawn))
        self.wait_until_still()
        return place

    def _drawn(self, place) -> np.ndarray:
        return (np.asarray(place) - self.page.backend.origin) / self.page.backend.unit

    def pull(self, place) -> None:
        """Move the pointer to a place (3,) [world]."""
        self.do(lambda: self.page.pointer.pull(self._drawn(place)))
        self.wait_until_still()

    def let_go(self) -> None:
        self.do(self.page.pointer.let_go)
        self.fly(0.01)

    def reset(self) -> None:
        self.press("Reset", of="Simulation")
        self.fly(0.0)


def flies_again(flown: FlownPage, folder: Path) -> tuple[dict, list[Command], list[str]]:
    """What is saved of the run since the last reset, parameters, commands and mesh files, which give the same motion by
    `simulate` in the folder in which it is unpacked."""
    packed, note = flown.do(lambda: flown.page.session_tab._take())
    assert "simulate scene.yaml --script script.yaml" in note
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        archive.extractall(folder)
        names = sorted(archive.namelist())
    with chdir(folder):
        scenario, script = read_scene("scene.yaml"), parse_script(Path("script.yaml").read_text("utf-8"))
        again = OfflineRun(scenario, script)
        again.advance(flown.live.state.time_ns)
    assert again.simulation.state.row.tobytes() == flown.live.state.row.tobytes()
    return scenario.parameters.named(), script, [name for name in names if not name.endswith(".yaml")]
