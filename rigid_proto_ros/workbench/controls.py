# SPDX-License-Identifier: MIT
"""Inputs of the page that are the node's parameters: what a user sets goes to the node, what the node has is shown.

The node decides. A value that it refuses goes back to the one in force; one that somebody else sets appears here.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from ..base.errors import InputError
from ..parameters.declarations import parameter_named
from ..scene.yaml_text import scalar
from .flight import Flight

Handle = viser.GuiInputHandle[Any]
Values = Mapping[str, Any]
"""Parameters by name."""
Changes = dict[str, object]

TYPING_S = 0.6
"""[s] A text that hasn't changed for this long is meant as it stands."""

TOUCHED_S = 1.0
"""[s] An input isn't written to this soon after its user touched it: it would jump back under the finger."""

NOTE = '<div style="padding: 0 1em; font-size: 0.85em">{}</div>'
"""A line below a slider: what its factor comes to."""

NEW_WEIGHT = "ballast.weight"
"""A point mass that can be added, beside those of the scene."""


@dataclass
class _Control:
    """handle: the input. shown(values) gives what it shows of parameters; changes(input) what an input means for them,
    None for nothing; it raises InputError for one that can't be read or would have no effect. waits: it was touched,
    and hasn't been taken as meant yet. behind: it may not show what is in force."""

    handle: Any
    shown: Callable[[Values], object]
    changes: Callable[[Any], Changes | None]
    touched_s: float = -1e9
    waits: bool = False
    behind: bool = False


class Controls:
    """The inputs of one page server, which set parameters of what flies."""

    def __init__(self, gui: viser.GuiApi, flight: Flight) -> None:
        self._gui = gui
        self._flight = flight
        self._controls: list[_Control] = []
        self._values: Values = flight.scenario.parameters.named()

    def update(self, values: Values, at_once: bool = False) -> None:
        """Show the parameters in force; ``at_once`` also in inputs that somebody is just using."""
        self._values = values
        for control in self._controls:
            control.behind = True
            if at_once:
                control.touched_s = -1e9
        self.catch_up()

    def catch_up(self) -> None:
        """To be called often: inputs that were in use show what has changed meanwhile."""
        for control in self._controls:
            if control.behind and time.monotonic() > control.touched_s + TOUCHED_S:
                control.behind = control.waits = False
                control.handle.value = control.shown(self._values)

    def settle(self) -> None:
        """Take what was typed last as it stands, before something else is done."""
        for control in self._controls:
            if control.waits:
                self._take(control, control.touched_s)
                control.touched_s = -1e9

    def show_again(self) -> None:
        """Everything as it is in force, after a refusal."""
        self.update(self._values, at_once=True)

    # Kinds of inputs

    def checkbox(self, name: str, label: str) -> Handle:
        """A switch."""
        handle = self._gui.add_checkbox(label, False, hint=_hint(name))
        return self.bind(handle, lambda values: bool(values[name]), lambda value: {name: value})

    def choice(self, name: str, label: str, values: Mapping[str, Any] | None = None) -> Any:
        """One of these values by their names, to which another one that is in force is added; or of the parameter's."""
        values = values or {choice or "none": choice for choice in parameter_named(name).choices}
        known = dict(values)
        handle: Any = self._gui.add_dropdown(label, tuple(known), hint=_hint(name))

        def shown(in_force: Values) -> str:
            value = in_force[name]
            texts = (text for text, one in values.items() if np.array_equal(one, value))
            text = next(texts, None) or " ".join(f"{x:.16g}" for x in np.ravel(value))
            known[text] = value
            options = tuple(dict.fromkeys((*values, text)))
            if handle.options != options:
                handle.options = options
            return text

        return self.bind(handle, shown, lambda text: {name: known[text]})

    def numbers(self, name: str, label: str, length: int = 1, check: Callable[[], None] = lambda: None) -> Handle:
        """Numbers of any size, as text with blanks between them. check() raises InputError while they would have no
        effect.
        """
        handle = self._gui.add_text(label, "", hint=_hint(name))

        def changes(text: object) -> Changes:
            numbers = parse_numbers(text, length)
            if numbers is None:
                raise InputError(label, text, parameter_named(name).accepted)
            check()
            return {name: numbers[0] if parameter_named(name).type == "double" else numbers}

        def shown(values: Values) -> object:
            return " ".join(f"{x:.9g}" for x in np.broadcast_to(values[name], length))

        return self.bind(handle, shown, changes, TYPING_S)

    def any_parameter(self) -> None:
        """One that is chosen by name, as text."""
        name = "mass"
        chosen: Any = self._gui.add_dropdown("Parameter", (name,), hint="Those that can change at any time")
        text: Any = self._gui.add_text("Value", "", hint="Numbers separated by blanks; true or false; a name")

        def shown(values: Values) -> object:
            nonlocal name
            # Each once: a page with two equal options stays blank.
            names = dict.fromkeys((*values, NEW_WEIGHT))
            options = tuple(each for each in names if parameter_named(each).changes != "read-only")
            if chosen.options != options:
                weights = [each for each in options if each.startswith("ballast.")]
                name = weights[0] if len(weights) > 1 or name not in options else name
                chosen.options, chosen.value = options, name
            value = values.get(name, (0.0, 0.0, 0.0, 0.0))
            if isinstance(value, (str, bool)):
                return str(value).lower() if isinstance(value, bool) else value
            return " ".join(f"{x:.9g}" for x in np.ravel(value))

        def changes(typed: str) -> Changes:
            words = typed.replace(",", " ").strip(" []").split()
            array = parameter_named(name).type == "doubles"
            return {name: [scalar(word) for word in words] if array else scalar(typed.strip())}

        async def choose(event: viser.GuiEvent[Any]) -> None:
            nonlocal name
            if event.client is not None:
                self.settle()  # a value that was typed is the former parameter's
                name = chosen.value
                text.value = str(shown(self._values))

        chosen.on_update(choose)

        self.bind(text, shown, changes, TYPING_S)

    def factor(
        self,
        label: str,
        hint: str,
        decades: float,
        shown: Callable[[Values], float],
        changes: Callable[[float], Changes | None],
    ) -> Handle:
        """A slider of how many times of something: shown(values) > 0 gives it, changes(factor) sets it."""
        slider = log_slider(self._gui, label, decades, hint)

        def chosen(value: tuple[float]) -> Changes | None:
            return changes(float(f"{10.0 ** value[0]:.3g}"))

        return self.bind(slider, lambda values: on_slider(shown(values), decades), chosen)

    def bind(
        self,
        handle: Handle,
        shown: Callable[[Values], object],
        changes: Callable[[Any], Changes | None],
        wait_s: float = 0.0,
    ) -> Handle:
        """An input of any kind; see _Control. wait_s: after the last touch, until it is taken as meant."""
        control = _Control(handle, shown, changes)
        self._controls.append(control)

        @handle.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is None:
                return  # we wrote it ourselves
            touched_s = control.touched_s = time.monotonic()
            control.waits = True
            if wait_s:
                asyncio.get_running_loop().call_later(wait_s, self._take, control, touched_s)
            else:
                self._take(control, touched_s)

        return handle

    def _take(self, control: _Control, touched_s: float) -> None:
        if not control.waits or control.touched_s != touched_s:
            return  # taken, or touched again since
        control.waits = False
        try:
            changes = control.changes(control.handle.value)
        except InputError as error:
            self._flight.say(str(error))
            changes = None
        if changes is None:
            control.touched_s = -1e9
            self.update(self._values)
        else:
            self._flight.set(changes)


def _hint(name: str) -> str:
    parameter = parameter_named(name)
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    return f"{parameter.description}{unit} ({name})"


def log_slider(gui: viser.GuiApi, label: str, decades: float, hint: str) -> Handle:
    """A slider of factors whose value is (log10,); viser's slider for one number would show that beside it."""
    marks = tuple((float(k), f"×{10.0**k:g}") for k in range(-int(decades), int(decades) + 1))
    return gui.add_multi_slider(label, -decades, decades, 0.01, (0.0,), hint=hint, marks=marks)


def on_slider(factor: float, decades: float) -> tuple[float]:
    """Where a factor stands on a slider of so many decades up and down."""
    return (round(min(max(math.log10(factor), -decades), decades), 2) if factor > 0.0 else 0.0,)


def parse_numbers(text: object, length: int) -> list[float] | None:
    """As many finite numbers as asked for, separated by blanks or commas; None where the text holds others."""
    words = str(text).replace(",", " ").strip(" []").split()
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return None
    return numbers if len(numbers) == length and all(abs(x) < 1e308 for x in numbers) else None
