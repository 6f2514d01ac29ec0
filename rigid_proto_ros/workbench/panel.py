# SPDX-License-Identifier: MIT
"""The tabs of forces and of what is shown."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import viser

from ..picture import style
from .controls import Controls, log_slider, on_slider
from .flight import Flight
from .pointer import Tools

GRAVITIES = {"off": [0.0, 0.0, 0.0], "Earth's": [0.0, 0.0, -9.81], "Moon's": [0.0, 0.0, -1.62]}

FORCE_DECADES = 2.0
"""Of the force's slider, up and down from the force that suits the body."""

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
"""Parts that are seen wherever they are."""

AT_FIRST = ("Angular momentum L",)


class ForcesTab:
    """What acts on the body: the hand's force and string, the start, gravity, and any parameter by its name."""

    def __init__(
        self, gui: viser.GuiApi, tabs: viser.GuiTabGroupHandle, controls: Controls, tools: Tools, flight: Flight
    ) -> None:
        self._tools = tools
        with tabs.add_tab("Forces"):
            with gui.add_folder("By hand"):
                suits = "Of a poke by a click; times a force that suits the body's mass and size"
                force: Any = log_slider(gui, "Force ×", FORCE_DECADES, suits)
                self._force = gui.add_html("")
            with gui.add_folder("Motion"):
                controls.numbers("initial.angular_velocity", "Initial spin [rad/s]", 3)
                controls.checkbox("gyroscopic", "Gyroscopic term ω × Iω")
                gravity = gui.add_button_group("Gravity is", tuple(GRAVITIES))
            with gui.add_folder("Any parameter"):
                controls.any_parameter()
        self._slider = force

        @force.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                tools.force = float(f"{tools.usual_force * 10.0 ** force.value[0]:.3g}")
                self.show_force()

        @gravity.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            flight.set({"gravity": GRAVITIES[gravity.value]})

    def show_force(self) -> None:
        """The poke's force, as it is now."""
        tools = self._tools
        self._force.content = f'<div style="padding: 0 1em; font-size: 0.85em">{tools.force:.3g} N</div>'
        place = on_slider(tools.force / tools.usual_force, FORCE_DECADES)
        if self._slider.value != place:
            self._slider.value = place


class ShowTab:
    """switch(part, shown) shows a part; see_into(on) and dark(on) do what they say. on_shown(name) is told of what is
    switched on.
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
                self._switches[name] = gui.add_checkbox(name, name in AT_FIRST)

        for name, box in self._switches.items():

            @box.on_update
            async def _(_: viser.GuiEvent[Any], name: str = name, box: Any = box) -> None:
                self._set(name, box.value)
                if box.value:
                    on_shown(name)

        @darkened.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            dark(darkened.value)

    def _set(self, name: str, shown: bool) -> None:
        if name == SEE_INTO:
            self._see_into(shown)
        for part in PARTS.get(name, ()):
            self._switch(part, shown)

    def show_for(self, names: Iterable[str]) -> None:
        """Switch on what a scene needs, by names of switches or, where there is none, of parts, and off the rest."""
        wanted = set(names)
        for name, box in self._switches.items():
            box.value = name in AT_FIRST or name in wanted
        self._switch(style.STRING_LINE, style.STRING_LINE in wanted)
