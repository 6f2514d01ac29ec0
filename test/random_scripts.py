# SPDX-License-Identifier: MIT
"""The script of a random scene (test/random_scenes.py): loads, string, thrusters, states and changes in flight."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from random_numbers import short
from random_parameters import (
    ACCURACIES,
    BODIES,
    BODY_FORCE,
    CAN,
    DAMPING,
    MODELS,
    NO_TERM,
    STEPS,
    STRING,
    TORQUE,
    VERTICES,
    WORLD_TORQUE,
    Making,
)

MOST_ENTRIES = 18


class Scripting(Making):
    """A scene whose parameters are drawn, and that gets its script."""

    def fly(self) -> None:
        """Draw the entries of the script, in order of time."""
        draw = self.draw
        if draw.chance(0.08):
            return
        most = draw.by_weight({3: 4, 8: 4, MOST_ENTRIES: 2})
        gaps = draw.pick(((0.0, 0.05), (0.02, 0.3), (0.02, 0.3), (0.3, 1.0)))
        while len(self.script) < most and self.now_s <= self.end_s:
            self._pass_time(gaps)
            entry = {"t": self.now_s, **self._entry()}
            self.script.append(entry)
        if draw.chance(0.1):
            self.script.sort(key=lambda entry: -entry["t"])

    def _pass_time(self, gaps: tuple[float, float]) -> None:
        """To the next entry: at once, when something ends, after a gap or a long one in which things time out."""
        draw = self.draw
        coming = [end for end in self.ends if self.now_s <= end <= self.end_s]
        how = draw.by_weight(
            {"at once": 2.0 if self.script else 1.0, "end": 3.0 if coming else 0.0, "gap": 5.0, "long": 0.3}
        )
        if how == "end":
            self.now_s = draw.pick(coming)
        elif how != "at once":
            self.now_s += draw.number(*((0.6, 1.5) if how == "long" else gaps))
        self.now_s = round(self.now_s, 6)

    def _ends_after(self, seconds: float) -> None:
        self.ends.append(round(self.now_s + seconds, 9))

    def _entry(self) -> dict[str, Any]:
        thrusters = any(name.startswith("thrusters.") for name in self.values)
        has_string = STRING in self.can
        kind = self.draw.by_weight(
            {
                self._poke: 26,
                self._held: 16,
                self._string_entry: 20
                if has_string and any("string." in name for name in self.values)
                else 3 * has_string,
                self._thrust: 12 if thrusters else 0,
                self._set: 24,
                self._state: 5,
                self._clear: 4,
            }
        )
        return kind()

    def _repeated(self) -> dict[str, Any]:
        draw = self.draw
        if not draw.chance(0.12):
            return {}
        found: dict[str, Any] = {"repeat": 2 + draw.below(5), "every": draw.pick((0.01, 0.1, draw.number(0.005, 0.3)))}
        if draw.chance(0.5):
            found |= {"jitter": draw.pick((0.005, 0.05)), "seed": draw.below(100)}
        return found

    def _poke(self) -> dict[str, Any]:
        draw = self.draw
        if draw.chance(0.35):
            return {**self._at(), **self._impulses(), **self._repeated()}
        duration = draw.pick((0.001, 0.05, 0.2, draw.number(0.001, 0.8))) if draw.chance(0.7) else None
        self._ends_after(duration or self.timeouts["poke_duration"])
        slot = {"slot": draw.pick(("a", "left_hand"))} if draw.chance(0.15) else {}
        lasting = {} if duration is None else {"duration": duration}
        return {**self._load(), **lasting, **slot, **self._repeated()}

    def _held(self) -> dict[str, Any]:
        draw, wrench = self.draw, self._load()
        if draw.chance(0.15) and "push" not in wrench:
            wrench = {"force": [0.0, 0.0, 0.0]}
        if draw.chance(0.4):
            wrench["slot"] = draw.pick(("a", "b", "left_hand"))
        if draw.chance(0.25):
            wrench["duration"] = draw.pick((0.1, 0.5, draw.number(0.001, 1.0)))
        self._ends_after(wrench.get("duration", self.timeouts["wrench_timeout"]))
        return {"wrench": wrench, **self._repeated()}

    def _at(self, centre: bool = False) -> dict[str, Any]:
        """Where a load acts; ``centre``: at the COM alone."""
        draw, mesh = self.draw, self.body != ""
        kind = (
            "com"
            if centre
            else draw.by_weight(
                {
                    "com": 4,
                    "": 1,
                    "origin": 1.5,
                    "contact": 4 if self.contacts else 0,
                    "vertex": 3 if mesh else 0,
                    "point": 3,
                    "ray": 1.2 if mesh else 0,
                }
            )
        )
        match kind:
            case "":
                return {}
            case "contact":
                return {"at": draw.pick(self.contacts)}
            case "vertex":
                return {"at": {"vertex": draw.below(VERTICES)}}
            case "point":
                return {"at": {"point": self._on_body()}}
            case "ray":
                return {"at": self._ray(draw.number(0.0, 0.6))}
        return {"at": kind}

    def _ray(self, aside: float) -> dict[str, Any]:
        """From afar towards where the body would be without loads, to so many sizes aside."""
        where, away = self._where(), [0.0, 0.0, 0.0]
        while not any(away):
            away = self.draw.vector(4.0 * self.size)
        bent = self.draw.vector(aside * self.size)
        origin = [short(x + d, 6) for x, d in zip(where, away, strict=True)]
        return {"ray": {"origin": origin, "direction": [short(b - d) for b, d in zip(bent, away, strict=True)]}}

    def _impulses(self) -> dict[str, Any]:
        draw, found = self.draw, {}
        what = draw.by_weight({"impulse": 5, "angular_impulse": 2, "both": 2})
        if what != "angular_impulse":
            found["impulse"] = draw.vector(short(self.mass * self._slowness * draw.pick((0.05, 0.5, 2.0))))
        if what != "impulse":
            found["angular_impulse"] = draw.vector(short(self.mass * self.size * self.size * draw.pick((0.5, 5.0))))
        if draw.chance(0.4):
            found["axes"] = draw.pick(("body", "body", "world"))
        return found

    def _load(self) -> dict[str, Any]:
        """A force, torque or push that the integrator supports, and where it acts."""
        draw, can = self.draw, self.can
        force = draw.vector(short(self.mass * self._slowness * draw.pick((0.1, 2.0, 30.0))))
        torque = draw.vector(short(self.mass * self.size * self.size * draw.pick((0.5, 10.0, 100.0))))
        if {TORQUE, BODY_FORCE} <= can and self.body and draw.chance(0.18):
            where = self._at()
            if where.get("at", "com") != "com":
                self.needs |= {TORQUE, BODY_FORCE}
                return {**where, "push": draw.pick((1.0, -1.0)) * max(map(abs, force))}
        axes = "body" if draw.chance(0.4) else "world"
        if axes == "body" and not {TORQUE, BODY_FORCE} <= can or not can:
            axes = "world"
        if axes == "world" and WORLD_TORQUE not in can:
            if not can or draw.chance(0.5):
                return {**self._at(centre=True), "force": force}
            axes = "body"
        self.needs |= {TORQUE, BODY_FORCE} if axes == "body" else {WORLD_TORQUE}
        what = draw.by_weight({"force": 5, "torque": 3, "both": 2})
        found = self._at()
        if what != "torque":
            found["force"] = force
        if what != "force":
            found["torque"] = torque
        if axes == "body" or draw.chance(0.3):
            found["axes"] = axes
        return found

    def _string_entry(self) -> dict[str, Any]:
        draw = self.draw
        kind = draw.by_weight({"target": 5, "attach": 2, "both": 3, "release": 2})
        if kind == "release":
            return {"string": "release"}
        entry: dict[str, Any] = {}
        if kind != "target":
            entry["attach"] = draw.pick(self.contacts) if self.contacts and draw.chance(0.5) else self._on_body()
        if kind != "attach":
            entry["target"] = self._target()
            self.needs.add(STRING)
            self._ends_after(0.1)
            self._ends_after(self.timeouts["string.timeout"])
        return {"string": entry, **(self._repeated() if kind == "target" else {})}

    def _thrust(self) -> dict[str, Any]:
        draw = self.draw
        count = sum(name.startswith("thrusters.") for name in self.values)
        self.needs |= {TORQUE, BODY_FORCE}
        self._ends_after(self.timeouts["wrench_timeout"])
        self._ends_after(self.values.get("thruster.minimum_on_time", 0.0))
        forces = [0.0 if draw.chance(0.35) else short(self.mass * draw.number(-2.0, 8.0)) for _ in range(count)]
        return {"thrusters": forces, **self._repeated()}

    def _state(self) -> dict[str, Any]:
        draw, state = self.draw, {}
        if draw.chance(0.4):
            state["position"] = self._place()
        if draw.chance(0.4):
            state["orientation_xyzw"] = self._orientation()
        if draw.chance(0.4):
            state["linear_velocity"] = self._velocity()
        if draw.chance(0.5) or not state:
            state["angular_velocity"] = self._spin()
        return {"state": state}

    def _clear(self) -> dict[str, Any]:
        return {"service": "clear_wrench"}

    # Changes in flight

    def _set(self) -> dict[str, Any]:
        changes: dict[str, Any] = {}
        for _ in range(self.draw.by_weight({1: 6, 2: 2, 3: 1})):
            changes |= self._change()
        return {"set": changes}

    def _change(self) -> dict[str, Any]:
        draw = self.draw
        mesh, string = self.body != "", STRING in self.can
        kind: Callable[[], dict[str, Any]] = draw.by_weight(
            {
                self._set_mass: 3,
                self._set_scale: 2.5,
                self._set_model: 3 if mesh else 0,
                self._set_explicit: 2,
                self._set_ballast: 3,
                self._set_environment: 4,
                self._set_integrator: 3,
                self._set_steps: 2,
                self._set_timeout: 2.5,
                self._set_spring: 4 if string else 0,
                self._set_string: 5 if string else 0,
                self._set_mesh: 1.2,
                self._set_other: 0.8,
            }
        )
        return kind()

    def _set_mass(self) -> dict[str, Any]:
        draw = self.draw
        if draw.chance(0.5):
            changes = {"mass": short(self.mass * draw.number(0.3, 3.0))}
        else:
            changes = {"density": short(self.values.get("density", 1000.0) * draw.number(0.3, 3.0))}
        if self.model != "explicit":
            self.mass = changes.get("mass", self.mass)
        return changes

    def _set_scale(self) -> dict[str, Any]:
        draw = self.draw
        sides = [short(side * draw.number(0.7, 1.4, 2)) for side in self.sides]
        if draw.chance(0.25):
            sides[draw.below(3)] *= -1.0
        scale: Any = sides[0] if draw.chance(0.4) else sides
        self._take_scale(scale)
        return {"scale": scale}

    def _set_model(self) -> dict[str, Any]:
        self.model = self.draw.pick(MODELS)
        changes = {"inertia_model": self.model}
        if self.draw.chance(0.4):
            changes["inertia_model_com"] = self.draw.pick(("solid", "model"))
        return changes

    def _set_explicit(self) -> dict[str, Any]:
        self.model = "explicit"
        return {"inertia_model": "explicit", **self._explicit()}

    def _set_ballast(self) -> dict[str, Any]:
        return {f"ballast.{self.draw.pick(('back', 'left', 'top', 'nut'))}": self._ballast()}

    def _set_environment(self) -> dict[str, Any]:
        draw = self.draw
        kind = draw.by_weight(
            {
                "gravity": 4,
                "linear_damping": 3,
                "angular_damping": 3 if DAMPING in self.can else 0,
                "gyroscopic": 2 if NO_TERM in self.can else 0,
            }
        )
        if kind == "gravity":
            return {kind: self._gravity() if draw.chance(0.8) else [0.0, 0.0, 0.0]}
        if kind == "gyroscopic":
            self.needs.add(NO_TERM)
            return {kind: draw.chance(0.5)}
        if kind == "angular_damping":
            self.needs.add(DAMPING)
            return {kind: self._angular_damping() if draw.chance(0.75) else 0.0}
        return {kind: short(self.mass * draw.log(-2, 2)) if draw.chance(0.75) else 0.0}

    def _set_integrator(self) -> dict[str, Any]:
        fitting = [name for name, can in CAN.items() if can >= self.needs]
        self.integrator = self.draw.pick(fitting)
        return {"integrator": self.integrator}

    def _set_steps(self) -> dict[str, Any]:
        if self.draw.chance(0.5):
            return {"accuracy": self.draw.pick(ACCURACIES)}
        return {"step": self.draw.pick(STEPS)}

    def _set_timeout(self) -> dict[str, Any]:
        if self.draw.chance(0.3):
            self.timeouts["poke_duration"] = self.draw.pick((0.01, 0.1, 0.4))
            return {"poke_duration": self.timeouts["poke_duration"]}
        return {"wrench_timeout": self._timeout("wrench_timeout")}

    def _set_spring(self) -> dict[str, Any]:
        spring = self._spring()
        return {name: number for name, number in spring.items() if self.draw.chance(0.7)} or spring

    def _set_string(self) -> dict[str, Any]:
        draw = self.draw
        match draw.by_weight({"rest_length": 3, "bilateral": 2, "timeout": 3, "target": 3, "attach": 2, "attached": 3}):
            case "rest_length":
                return {"string.rest_length": self._rest_length()}
            case "bilateral":
                return {"string.bilateral": draw.chance(0.6)}
            case "timeout":
                return {"string.timeout": self._timeout("string.timeout")}
            case "target":
                return {"string.target": self._target()}
            case "attach":
                return {"string.attach": self._on_body()}
        self.needs.add(STRING)
        return {"string.attached": draw.chance(0.6)}

    def _set_mesh(self) -> dict[str, Any]:
        self.body = self.draw.pick([name for name in BODIES if name])
        self.size = BODIES[self.body][1] * max(self.sides)
        return {"mesh": self.body}

    def _set_other(self) -> dict[str, Any]:
        """What changes nothing before the next reset, or nothing of the motion."""
        return self.draw.pick(
            (
                {"initial.linear_velocity": [1.0, 0.0, 0.0]},
                {"publish_rate": 30.0},
                {"ghost.inertia_model": "bounding_box"},
                {"initial.string_mass": 0.1},
                {"explicit_inertia.tensor": [2.0, 0.0, 0.0, 2.0, 0.0, 2.0]},
            )
        )
