# SPDX-License-Identifier: MIT
"""Random scenes over the parameters of the motion and the entries of a script: a seed means the same scene everywhere.

No number comes from the package, so that a scene stays what it is whatever becomes of the package. Sizes of loads follow from what
test/random_parameters.py knows of the bodies, so that most scenes move at speeds of meters and turns a second. About a tenth of the
scenes are refused at the start, in about a sixth something is refused in flight, and some move until they pass all bounds.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from random_numbers import Draw, short
from random_parameters import STRING, WORLD_TORQUE
from random_scripts import Scripting

SECOND = 10**9

AT_START = """
{"inertia_model": "explicit", "explicit_inertia.tensor": [1.0, 0.0, 0.0, 1.0, 0.0, 2.1]}
{"inertia_model": "explicit", "explicit_inertia.tensor": [1.0, 0.0, 0.0, -1.0, 0.0, 1.0]}
{"inertia_model": "explicit", "explicit_inertia.tensor": [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]}
{"inertia_model": "explicit", "explicit_inertia.tensor": [1.0, 2.0, 0.0, 1.0, 0.0, 1.0]}
{"mesh": "t_handle", "inertia_model": "points", "scale": [1.0, 1e-8, 1e-8]}
{"mesh": "", "inertia_model": "shell"}
{"scale": 0.0}
{"scale": [1.0, 1e-10, 1.0]}
{"scale": [2.0, 2.0]}
{"scale": 2e9}
{"integrator": "auto", "linear_damping": 1e60}
{"integrator": "auto", "angular_damping": 1e60}
{"integrator": "auto", "string.attached": true, "string.frequency": 1e8}
{"integrator": "auto", "string.attached": true, "string.frequency": 0.0, "string.stiffness": 1e29}
{"integrator": "auto", "string.attached": true, "string.frequency": 1e5, "string.damping_ratio": 1e5}
{"integrator": "free_body", "angular_damping": 0.1}
{"integrator": "taylor", "string.attached": true}
{"integrator": "lie_midpoint", "gyroscopic": false}
{"integrator": "rk5"}
{"initial.orientation_xyzw": [0.0, 0.0, 0.0, 0.0]}
{"initial.orientation_xyzw": [0.0, 0.0, 1.0]}
{"accuracy": 0.0}
{"step": -0.001}
{"densitiy": 1000.0}
{"density": 0.0}
{"mass": -1.0}
{"ballast.top": [-0.1, 0.0, 0.0, 0.0]}
{"thrusters.a": [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]}
{"gravity": [0.0, 0.0, "down"]}
{"imu_contact": "elbow"}
"""
"""Parameters that are refused, a line each."""

IN_SCRIPT = """
{"at": "elbow", "force": [1.0, 0.0, 0.0]}
{"at": {"vertex": 100000}, "force": [1.0, 0.0, 0.0]}
{"at": "com", "push": 1.0}
{"at": "com", "force": [1e30, 0.0, 0.0]}
{"at": "com", "impulse": [1e30, 0.0, 0.0]}
{"force": [1.0, 0.0]}
{"force": [1.0, 0.0, 0.0], "impulse": [1.0, 0.0, 0.0]}
{"force": [1.0, 0.0, 0.0], "slot": "Hand"}
{"force": [1.0, 0.0, 0.0], "duration": -0.1}
{"force": [1.0, 0.0, 0.0], "repeat": 3}
{"at": {"ray": {"origin": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 0.0]}}, "force": [1.0, 0.0, 0.0]}
{"thrusters": [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]}
{"string": {"attach": "elbow"}}
{"string": {"pull": [0.0, 0.0, 1.0]}}
{"state": {"orientation_xyzw": [0.0, 0.0, 0.0, 0.0]}}
{"state": {"place": [0.0, 0.0, 0.0]}}
{"set": {"contacts.new": [0.0, 0.0, 0.0]}}
{"set": {"inertia_model": "explicit", "explicit_inertia.tensor": [1.0, 0.0, 0.0, 1.0, 0.0, 2.1]}}
{"set": {"mesh": "", "inertia_model": "solid"}}
{"set": {"scale": 0.0}}
{"set": {"gravity": [0.0, 0.0]}}
{"set": {}}
{"service": "reset"}
{"set": {"integrator": "free_body", "angular_damping": 0.1}}
"""
"""Entries for which a script is refused before the flight, a line each."""


@dataclass(frozen=True)
class Scene:
    """values: parameters by name, as in a scene file. script: entries of a poke script, as YAML has them."""

    values: dict[str, Any]
    script: list[dict[str, Any]]
    end_ns: int


def random_scene(seed: int) -> Scene:
    """The scene of this seed."""
    making = Spoiling(Draw(seed))
    making.begin()
    making.fly()
    making.spoil()
    return Scene(making.values, making.script, round(making.end_s * SECOND))


class Spoiling(Scripting):
    """A scene with parameters and script, to which is added what is refused, or what ends the motion."""

    def spoil(self) -> None:
        """Spoil some scenes, and leave the others as they are."""
        kind = self.draw.by_weight(
            {None: 76.0, self._refuse_start: 8.0, self._refuse_in_flight: 13.0, self._diverge: 2.0}
        )
        if kind is not None:
            kind()

    def _add(self, *entries: dict[str, Any]) -> None:
        """Entries at a time of the flight, behind others of that time."""
        t = self.draw.pick([entry["t"] for entry in self.script]) if self.script and self.draw.chance(0.5) else 0.0
        t = t or self.draw.number(0.0, 0.8 * self.end_s)
        for entry in entries:
            self.script.append({"t": t, **entry})

    def _refuse_start(self) -> None:
        draw = self.draw
        if draw.chance(0.55):
            self.values |= json.loads(draw.pick(AT_START.strip().splitlines()))
        else:
            self._add(json.loads(draw.pick(IN_SCRIPT.strip().splitlines())))

    def _refuse_in_flight(self) -> None:
        kinds = [*self._wrong_loads(), *(self._wrong_strings() if STRING in self.can else ())]
        if not kinds:  # the integrator takes neither: nothing comes of it
            rest = {"wrench": {"at": "com", "force": [0.0, 0.0, 0.0]}}
            kinds = [(rest, {"set": {"string.attached": False}})]
        self._add(*self.draw.pick(kinds))

    def _wrong_loads(self) -> list[tuple[dict[str, Any], ...]]:
        """Rays that miss, a load too large where its ray meets the body, and an integrator that can't take one that acts."""
        if WORLD_TORQUE not in self.can:
            return []
        force = [short(self.mass), 0.0, 0.0]
        held = {"wrench": {"at": {"point": [0.01, 0.0, 0.0]}, "force": force, "duration": 0.5}}
        kinds: list[tuple[dict[str, Any], ...]] = [
            (held, {"set": {"integrator": self.draw.pick(("taylor", "free_body"))}})
        ]
        if self.body:
            far = self.size * 1e3
            miss = {"ray": {"origin": [short(x + far) for x in self._where()], "direction": [0.0, 1.0, 0.1]}}
            huge = short(3e14 * self.mass)
            kinds += [
                ({"at": miss, "force": force},),
                ({"at": miss, "impulse": force}, {"wrench": {"at": miss, "push": 1.0}}),
                ({"at": self._ray(0.0), "impulse": [huge, 0.0, huge]},),
            ]
        return kinds

    def _wrong_strings(self) -> list[tuple[dict[str, Any], ...]]:
        """Targets too far, a string too fast, an integrator that takes none, and a tensor that a refused change was to mend."""
        target, good = {"string": {"target": self._target()}}, [1.0, 0.0, 0.0, 1.0, 0.0, 1.0]
        cannot = self.draw.pick(("taylor", "lie_midpoint", "free_body_strang", "free_body"))
        fast = 1e7 if self.integrator == "auto" else 5.0
        bad: dict[str, Any] = {
            "explicit_inertia.tensor": [1.0, 0.0, 0.0, 1.0, 0.0, 3.0],
            "inertia_model": "bounding_box",
        }
        mend = {
            "integrator": "lie_midpoint",
            "gyroscopic": True,
            "string.attached": False,
            "explicit_inertia.tensor": good,
        }
        kinds: list[tuple[dict[str, Any], ...]] = [
            (target, {"set": {"integrator": cannot}}),
            (target, {"set": {"string.frequency": fast}}, {"string": {"target": [1e30, 0.0, 0.0]}}),
            ({"set": {"string.frequency": 100.0}}, {"string": {"target": [1e14, 0.0, 0.0]}}),
            ({"set": {"string.frequency": 100.0}}, target, {"string": {"target": [0.0, 1e20, 0.0]}}),
        ]
        if self.body:
            kinds += [({"set": bad}, target, {"set": mend}, {"set": {"inertia_model": "explicit"}})]
        if self.integrator == "auto":
            fast_knot = {"string": {"attach": self._on_body(), "target": self._target()}}
            kinds += [
                ({"set": {"string.frequency": 1e8}}, fast_knot),
                (target, {"set": {"string.damping_ratio": 1e6, "string.frequency": 1e4}}),
            ]
        return kinds

    def _diverge(self) -> None:
        """Too fast at once, damping or a string too fast for the step."""
        draw, values = self.draw, self.values
        if draw.chance(0.3):
            values["initial.linear_velocity"] = [9.9e99, 0.0, 0.0]
            values["gravity"] = [9.9e99, 0.0, 0.0]
        elif draw.chance(0.4) or STRING not in self.can:
            values["integrator"] = draw.pick(("euler", "rk4", "midpoint"))
            values["angular_damping"] = short(1e3 * self.mass * self.size * self.size)
            values |= {"step": 0.01, "initial.angular_velocity": [3.0, 2.0, 1.0]}
        else:
            integrator = draw.pick(("euler", "rk4", "dop853", "semi_implicit_euler"))
            values |= {"string.attached": True, "string.target": self._target(), "string.rest_length": 0.0}
            values |= {"integrator": integrator, "string.frequency": 3e3, "step": 0.01, "gyroscopic": True}
