# SPDX-License-Identifier: MIT
"""The parameter ``initial.flight`` as text: what a flight brings along that goes on at time 0.

    {began_ns, state: [13], loads: [...], string: {...}, thrusters: {last_ns, <name>: {...}}}

YAML on one line; times in ns from time 0, those of the past negative. ``replay --as-scene`` and the page's rewind
write it; whoever edits it leaves loads out, or gives them other numbers.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.rotation import Vector
from ..motion.frames import CONTACT_NAME, SLOT_NAME
from ..motion.loads import Load
from ..motion.string import StringSettings, Tied
from ..simulation.commands import slot_name, slot_number
from ..simulation.flight import NEVER, NO_SLOT, UNNAMED_SLOT
from ..simulation.in_flight import FARTHEST_NS, GoingLoad, GoingString, InFlight
from ..simulation.thrusters import Push
from .declaration import HUGE
from .yaml_text import flow, load_plain_yaml

NAME = "initial.flight"

_AXES = ("world", "body", "normal")


def in_flight_text(flight: InFlight) -> str:
    """The text; ``read_in_flight`` gives back the same bits."""
    said: dict[str, object] = {"began_ns": flight.began_ns, "state": list(flight.start)}
    if flight.loads:
        said["loads"] = [_load_fields(going) for going in flight.loads]
    if flight.string is not None:
        said["string"] = _string_fields(flight.string)
    if flight.thrusters:
        named = {name: _push_fields(push) for name, push in flight.thrusters.items()}
        said["thrusters"] = {"last_ns": flight.thrusters_last_ns, **named}
    return flow(said)


def _load_fields(going: GoingLoad) -> dict[str, object]:
    if going.load is None:
        return {"kind": "thruster", "thruster": going.thruster, "began_ns": going.began_ns}
    load = going.load
    said: dict[str, object] = {"kind": "wrench" if going.held else "poke", "began_ns": going.began_ns}
    if not going.held:
        said["ends_ns"] = going.end_ns
    if going.slot > UNNAMED_SLOT:
        said["slot"] = slot_name(going.slot)
    said["axes"] = load.axes
    if load.mesh_point is not None:
        said["point"] = list(load.mesh_point)
    if load.mesh_normal is not None:
        said["normal"] = list(load.mesh_normal)
    return {**said, "force": list(load.force), "torque": list(load.torque)}


def _string_fields(string: GoingString) -> dict[str, object]:
    then, tied = string.settings, string.tied
    parameters = {
        "attached": then.attached,
        "attach": list(then.attach),
        "target": list(then.target),
        "timeout_ns": then.timeout_ns,
    }
    said: dict[str, object] = {"parameters": parameters, "attach": list(string.attach)}
    if tied is not None:
        said["tied"] = {
            "from": tied.origin.tolist(),
            "to": tied.target.tolist(),
            "begin_ns": tied.begin_ns,
            "end_ns": tied.end_ns,
            "last_target_ns": tied.last_target_ns,
            **({} if tied.release_ns is None else {"release_ns": tied.release_ns}),
            "effective_mass": tied.effective_mass,
            "body": string.body,
        }
    return said


def _push_fields(push: Push) -> dict[str, object]:
    said: dict[str, object] = {"force": push.force, "on_ns": push.on_ns}
    return said if push.off_ns == NEVER else {**said, "off_ns": push.off_ns}


@lru_cache(maxsize=8)
def read_in_flight(text: str) -> InFlight | None:
    """What the text says, None where it is empty; raises InputError naming what in it isn't accepted."""
    if not text.strip():
        return None
    whole = _Fields(load_plain_yaml(text, NAME), NAME)
    loads = [_load(_Fields(said, f"{NAME}, loads, {k}")) for k, said in enumerate(whole.list_of("loads"), 1)]
    flight = InFlight(whole.time("began_ns", last=0), whole.numbers("state", 13), tuple(loads))
    string = whole.fields("string")
    thrusters = whole.fields("thrusters")
    whole.nothing_else()
    if string is not None:
        flight = InFlight(flight.began_ns, flight.start, flight.loads, _string(string))
    if thrusters is None:
        return flight
    last_ns = thrusters.time("last_ns", last=0)
    pushes = {name: _push(thrusters.fields(name)) for name in thrusters.names}
    return InFlight(flight.began_ns, flight.start, flight.loads, flight.string, pushes, last_ns)


def _load(said: _Fields) -> GoingLoad:
    kind, began_ns = said.word("kind", ("wrench", "poke", "thruster")), said.time("began_ns", last=0)
    if kind == "thruster":
        going = GoingLoad(began_ns, thruster=said.name("thruster", CONTACT_NAME))
        said.nothing_else()
        return going
    held = kind == "wrench"
    end_ns = NEVER if held else said.time("ends_ns", first=0)
    slot = UNNAMED_SLOT if held else NO_SLOT
    if said.has("slot"):
        slot = slot_number(said.name("slot", SLOT_NAME))
    axes = said.word("axes", _AXES)
    point = said.vector("point") if said.has("point") else None
    normal = said.vector("normal") if axes == "normal" else None
    load = Load(axes, point, said.vector("force"), said.vector("torque"), normal)
    said.nothing_else()
    return GoingLoad(began_ns, load, held, slot, end_ns)


def _string(said: _Fields) -> GoingString:
    then = said.fields("parameters", needed=True)
    settings = StringSettings(
        attached=then.switch("attached"),
        attach=then.vector("attach"),
        target=then.vector("target"),
        timeout_ns=then.time("timeout_ns", first=0),
    )
    then.nothing_else()
    attach, tied = said.vector("attach"), said.fields("tied")
    said.nothing_else()
    if tied is None:
        return GoingString(settings, attach, None)
    begin_ns, end_ns = tied.time("begin_ns", last=0), tied.time("end_ns")
    string = Tied(
        attach=attach,
        origin=np.array(tied.vector("from")),
        target=np.array(tied.vector("to")),
        begin_ns=begin_ns,
        end_ns=max(begin_ns, end_ns),
        last_target_ns=tied.time("last_target_ns", last=0),
        release_ns=tied.time("release_ns", first=0) if tied.has("release_ns") else None,
        effective_mass=tied.number("effective_mass", lower=0.0),
        stiffness=0.0,
        damping=0.0,
        frequency=0.0,
        rest_length=0.0,
        bilateral=False,
    )
    body = tied.whole("body", 0, FARTHEST_NS)
    tied.nothing_else()
    return GoingString(settings, attach, string, body)


def _push(said: _Fields | None) -> Push:
    if said is None:
        raise InputError(f"{NAME}, thrusters", None, "a mapping for each")
    off_ns = said.time("off_ns", first=0) if said.has("off_ns") else NEVER
    push = Push(said.number("force"), said.time("on_ns", last=0), off_ns)
    said.nothing_else()
    return push


class _Fields:
    """A mapping of the text, each value taken once and checked; raises InputError with where it stands."""

    def __init__(self, said: object, where: str) -> None:
        if not isinstance(said, dict) or not all(isinstance(key, str) for key in said):
            raise InputError(where, str(said)[:80], "a mapping, as replay --as-scene writes it")
        self._said, self._where = dict(said), where

    @property
    def names(self) -> list[str]:
        """Of what wasn't taken yet."""
        return list(self._said)

    def has(self, key: str) -> bool:
        """Whether it is there."""
        return key in self._said

    def nothing_else(self) -> None:
        """Raises InputError where there is more than was taken."""
        if self._said:
            raise InputError(self._where, f"there is no key {next(iter(self._said))!r}")

    def _take(self, key: str, accepted: str, good: Callable[[Any], bool]) -> Any:
        value = self._said.pop(key, None)
        if value is None or not good(value):
            raise InputError(f"{self._where}, {key}", None if value is None else str(value)[:80], accepted)
        return value

    def whole(self, key: str, lower: int, upper: int) -> int:
        """A whole number."""
        return self._take(key, f"a whole number, {lower} to {upper}", lambda n: type(n) is int and lower <= n <= upper)

    def time(self, key: str, first: int = -FARTHEST_NS, last: int = FARTHEST_NS) -> int:
        """Nanoseconds from time 0 on."""
        return self.whole(key, first, last)

    def number(self, key: str, lower: float = -HUGE) -> float:
        """A number."""
        return float(self._take(key, f"a finite number >= {lower:g}", lambda x: _is_number(x) and x >= lower))

    def numbers(self, key: str, count: int) -> tuple[float, ...]:
        """So many numbers."""
        found = self._take(
            key,
            f"{count} finite numbers",
            lambda xs: isinstance(xs, list) and len(xs) == count and all(map(_is_number, xs)),
        )
        return tuple(float(x) for x in found)

    def vector(self, key: str) -> Vector:
        """Three numbers."""
        x, y, z = self.numbers(key, 3)
        return x, y, z

    def word(self, key: str, known: tuple[str, ...]) -> str:
        """One of these words."""
        return self._take(key, " or ".join(known), lambda word: word in known)

    def name(self, key: str, pattern: re.Pattern[str]) -> str:
        """A name."""
        accepted = "a name of small letters, digits and _"
        return self._take(key, accepted, lambda name: isinstance(name, str) and bool(pattern.match(name)))

    def switch(self, key: str) -> bool:
        """True or false."""
        return self._take(key, "true or false", lambda value: isinstance(value, bool))

    def list_of(self, key: str) -> list:
        """A list, empty where there is none."""
        return self._take(key, "a list", lambda value: isinstance(value, list)) if key in self._said else []

    def fields(self, key: str, needed: bool = False) -> Any:
        """A mapping below this one, or None."""
        if key not in self._said and not needed:
            return None
        return _Fields(self._said.pop(key, None), f"{self._where}, {key}")


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= HUGE
