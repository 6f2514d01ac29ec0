# SPDX-License-Identifier: MIT
"""From the scene's text, as the node says it, to the scenario that it flies."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

from ..base.errors import InputError
from ..scene.declaration import READ_ONLY
from ..scene.parameters import parameter_named
from ..scene.scenario import Scenario, make_scenario
from ..scene.scene_file import read_scene_text


class SceneLoader:
    """Loads the newest text, one after the other: a big mesh is read beside the loop that this runs on.

    scenario: the last one that was loaded; on_loaded is called with each, and refused with the error of others.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        on_loaded: Callable[[Scenario | None, Scenario], None],
        refused: Callable[[InputError], None],
    ) -> None:
        self.scenario: Scenario | None = None
        self._loop = loop
        self._on_loaded = on_loaded
        self._refused = refused
        self._newest = self._loaded = ""
        self._ahead: Scenario | None = None
        self._loading: asyncio.Task[None] | None = None
        self._known = asyncio.Event()

    @property
    def busy(self) -> bool:
        """Whether a text is being taken on."""
        return self._loading is not None

    def load(self, text: str) -> None:
        """Take this on, unless a newer one comes first."""
        self._newest = text
        if self._loading is None:
            self._loading = self._loop.create_task(self._load())

    def string_changed(self, changes: Mapping[str, object]) -> None:
        """Take on parameters of the string as their event says them, before their text comes: what is tied next, in the
        same instant, is decided by them.
        """
        present = self.scenario
        if present is None or not all(name.startswith("string.") for name in changes):
            return
        in_force = present.parameters.named()
        if all(in_force.get(name) == value for name, value in changes.items()):
            return
        try:
            self.scenario = present.with_changes(changes)
        except InputError:
            return  # it isn't this scene's; the text says what is in force
        self._ahead = self.scenario
        if not self.busy:
            self._newest = self._loaded = self.scenario.text
        self._on_loaded(present, self.scenario)

    async def known(self) -> Scenario:
        """Wait until the node's scenario is known."""
        await self._known.wait()
        assert self.scenario is not None
        return self.scenario

    def forget(self) -> None:
        """Take on the next text even if it says what the last one did. Until then the scenario isn't known: somebody
        may change it unheard.
        """
        self._known.clear()
        self._newest = self._loaded = ""
        self._ahead = None

    async def _load(self) -> None:
        try:
            while self._newest != self._loaded:
                text = self._loaded = self._newest
                try:
                    scenario = await asyncio.to_thread(_scenario, self.scenario, read_scene_text(text).values)
                except InputError as error:
                    self._refused(error)
                    continue
                if (
                    self.scenario is not None
                    and self.scenario is self._ahead
                    and scenario.parameters == self.scenario.parameters
                ):
                    continue  # its event came first
                before, self.scenario = self.scenario, scenario
                self._on_loaded(before, scenario)
                self._known.set()
        finally:
            self._loading = None


def _scenario(present: Scenario | None, values: Mapping[str, object]) -> Scenario:
    """What the values describe; from the present one's mesh and moments where they are the same."""
    in_force = {} if present is None else present.parameters.named()
    if present is None or in_force.keys() != values.keys():
        return make_scenario(values)
    changes = {name: value for name, value in values.items() if in_force[name] != value}
    if any(parameter_named(name).changes == READ_ONLY for name in changes):
        return make_scenario(values)
    if "density" in changes and "mass" not in changes:
        changes["mass"] = values["mass"]
    return present.with_changes(changes)
