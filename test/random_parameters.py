# SPDX-License-Identifier: MIT
"""The parameters of a random scene (test/random_scenes.py), and what a script has to know of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from random_numbers import Draw, short

TORQUE, WORLD_TORQUE, BODY_FORCE, DAMPING, STRING, NO_TERM = (
    "torque",
    "world torque",
    "body force",
    "damping",
    "string",
    "no term",
)
LOADS = {TORQUE, WORLD_TORQUE, BODY_FORCE}
CAN: dict[str, set[str]] = {
    "auto": {*LOADS, DAMPING, STRING, NO_TERM},
    "euler": {*LOADS, DAMPING, STRING, NO_TERM},
    "midpoint": {*LOADS, DAMPING, STRING, NO_TERM},
    "rk4": {*LOADS, DAMPING, STRING, NO_TERM},
    "semi_implicit_euler": {*LOADS, DAMPING, STRING},
    "dop853": {*LOADS, DAMPING, STRING},
    "lie_midpoint": {*LOADS, DAMPING},
    "free_body_strang": {*LOADS, DAMPING},
    "taylor": {TORQUE, BODY_FORCE, DAMPING},
    "free_body": set(),
}
"""What each integrator supports."""

BODIES: dict[str, tuple[float, float, dict[str, list[float]]]] = {
    "book": (9.06e-4, 0.13, {"corner": [0.074, 0.105, 0.0138], "spine": [-0.08, 0.0, 0.0]}),
    "hammer": (2.22e-4, 0.17, {"head": [0.0682, 0.0, 0.29], "peen": [-0.0726, 0.0, 0.29], "grip": [0.0, 0.0, 0.0]}),
    "hollow_box": (4.53e-4, 0.12, {"corner": [0.1, 0.05, 0.03], "face": [0.1, 0.0, 0.0]}),
    "l_bracket": (3.56e-5, 0.06, {"long_end": [0.1, 0.02, 0.003], "short_end": [0.003, 0.02, 0.06]}),
    "spinning_top": (7.19e-5, 0.06, {"tip": [0.0, 0.0, 0.0], "stem": [0.0, 0.0, 0.075], "edge": [0.03549, 0.0, 0.031]}),
    "t_handle": (1.92e-5, 0.06, {"tip": [0.0, 0.0, 0.07], "left": [0.0, -0.05, 0.0], "right": [0.0, 0.05, 0.0]}),
    "teapot": (1.76e-3, 0.17, {"spout": [0.134, 0.0, 0.108], "knob": [0.0, 0.0, 0.142]}),
    "tennis_racket": (4.35e-4, 0.37, {"rim": [0.68445, -0.00025, 0.0], "grip": [0.0, 0.0, 0.0]}),
    "": (1e-3, 0.1, {"left": [0.0, -0.1, 0.0], "top": [0.0, 0.0, 0.1]}),
}
"""By mesh, and for none: about the volume [m³] and half the diagonal [m], and contacts."""

MODELS = ("solid", "shell", "points", "bounding_box")
VERTICES = 900
"""So many every bundled body has."""
ACCURACIES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
STEPS = (0.0005, 0.001, 0.002, 0.005, 0.01)


@dataclass
class Making:
    """A scene that is being made. mass [kg] and size [m] are about those of the body, sides its scale. can: what the integrator in
    force supports; needs: what the scene has asked of it so far. ends: times [s] at which something ends.
    """

    draw: Draw
    values: dict[str, Any] = field(default_factory=dict)
    script: list[dict[str, Any]] = field(default_factory=list)
    end_s: float = 1.0
    body: str = ""
    integrator: str = "auto"
    mass: float = 1.0
    size: float = 0.1
    sides: tuple[float, float, float] = (1.0, 1.0, 1.0)
    model: str = "solid"
    needs: set[str] = field(default_factory=set)
    ends: list[float] = field(default_factory=list)
    now_s: float = 0.0
    timeouts: dict[str, float] = field(
        default_factory=lambda: {"wrench_timeout": 1.5, "string.timeout": 1.0, "poke_duration": 0.05}
    )

    @property
    def can(self) -> set[str]:
        return CAN[self.integrator]

    @property
    def _slowness(self) -> float:
        """So much smaller are the speeds of a small body, which would spin too fast for any step."""
        return min(1.0, 10.0 * self.size)

    @property
    def contacts(self) -> list[str]:
        return [name.removeprefix("contacts.") for name in self.values if name.startswith("contacts.")]

    # The scene

    def begin(self) -> None:
        """Draw the parameters."""
        draw, values = self.draw, self.values
        self.end_s = draw.number(0.5, 3.0, 2)
        self.integrator = draw.by_weight({name: 7.5 if name == "auto" else 1.0 for name in CAN})
        if self.integrator != "auto" or draw.chance(0.5):
            values["integrator"] = self.integrator
        self.body = "" if draw.chance(0.07) else draw.pick([name for name in BODIES if name])
        values["mesh"] = self.body
        for name, place in BODIES[self.body][2].items():
            if draw.chance(0.9):
                values[f"contacts.{name}"] = place
        self._inertia()
        if draw.chance(0.5):
            values["gravity"] = self._gravity()
        self._damping(0.22)
        if NO_TERM in self.can and draw.chance(0.1):
            values["gyroscopic"] = False
            self.needs.add(NO_TERM)
        if draw.chance(0.7):
            values["step"] = draw.pick(STEPS)
        if draw.chance(0.6):
            values["accuracy"] = draw.pick(ACCURACIES)
        self._initial()
        if draw.chance(0.5):
            values["wrench_timeout"] = self._timeout("wrench_timeout")
        if draw.chance(0.4):
            values["poke_duration"] = self.timeouts["poke_duration"] = draw.pick(
                (0.01, 0.1, 0.3, draw.number(0.001, 0.5))
            )
        self._thrusters()
        if STRING in self.can and draw.chance(0.5):
            self._string()

    def _scale(self) -> Any:
        draw = self.draw
        kind = draw.by_weight({"one": 4, "three": 3, "mirrored": 3, "alike": 1, "small": 1.2, "large": 1.2})
        if kind == "one":
            return draw.number(0.4, 2.5, 2)
        if kind in ("small", "large"):
            size = 1e-3 if kind == "small" else 1e3
            return (
                size
                if draw.chance(0.5)
                else [size, size, -size]
                if draw.chance(0.3)
                else [size, 2.0 * size, 0.5 * size]
            )
        sides = [draw.number(0.4, 2.5, 2)] * 3 if kind == "alike" else [draw.number(0.4, 2.5, 2) for _ in range(3)]
        if kind == "mirrored":
            if draw.chance(0.25):
                return -sides[0]
            sides[draw.below(3)] *= -1.0
            if draw.chance(0.3):
                sides = [-side for side in sides]
        return sides

    def _take_scale(self, scale: Any) -> None:
        sides = list(scale) if isinstance(scale, list) else [scale] * 3
        self.sides = tuple(abs(side) for side in sides)
        self.size = BODIES[self.body][1] * max(self.sides)

    def _weigh(self) -> None:
        """Find about the mass that the parameters so far mean."""
        values, (x, y, z) = self.values, self.sides
        if self.model == "explicit":
            self.mass = values.get("explicit_inertia.mass", 1.0)
        else:
            self.mass = values.get("mass", 0.0) or values.get("density", 1000.0) * BODIES[self.body][0] * x * y * z

    def _inertia(self) -> None:
        draw, values = self.draw, self.values
        if draw.chance(0.65):
            values["scale"] = self._scale()
        self._take_scale(values.get("scale", 1.0))
        how = draw.by_weight({"density": 5, "mass": 3, "both": 1, "neither": 3})
        if how in ("density", "both"):
            values["density"] = draw.pick((700.0, 1200.0, 2700.0, 7850.0, draw.number(100.0, 9000.0, 1)))
        if how in ("mass", "both"):
            values["mass"] = draw.log(-2, 2)
        self.model = draw.by_weight({"solid": 5, "shell": 3, "points": 3, "bounding_box": 3, "explicit": 2})
        if self.body == "":
            self.model = "explicit"
        if self.model != "solid" or draw.chance(0.3):
            values["inertia_model"] = self.model
        if draw.chance(0.3):
            values["inertia_model_com"] = draw.pick(("solid", "solid", "model"))
        self._weigh()
        if self.model == "explicit":
            values.update(self._explicit())
            self._weigh()
        for name in ("back", "left", "top")[: draw.by_weight({0: 6, 1: 2, 2: 1, 3: 1})]:
            values[f"ballast.{name}"] = self._ballast()

    def _ballast(self) -> list[float]:
        """0 kg now and then; the place in mesh coordinates."""
        mass = 0.0 if self.draw.chance(0.15) else short(self.mass * self.draw.number(0.01, 0.8))
        return [mass, *self.draw.vector(1.2 * BODIES[self.body][1])]

    def _explicit(self) -> dict[str, Any]:
        """Mass and tensor of a few point masses."""
        draw, mass = self.draw, short(self.mass * self.draw.number(0.5, 2.0))
        own, tensor = draw.chance(0.4), [0.0] * 6
        for _ in range(4):
            x, y, z = (draw.number(-1.0, 1.0) * self.size for _ in range(3))
            for k, part in enumerate((y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y)):
                tensor[k] += 0.0 if own and k in (1, 2, 4) else 0.25 * mass * part
        return {
            "explicit_inertia.mass": mass,
            "explicit_inertia.center_of_mass": draw.vector(0.5 * BODIES[self.body][1]),
            "explicit_inertia.tensor": [short(number, 7) for number in tensor],
        }

    def _gravity(self) -> list[float]:
        return [0.0, 0.0, -9.81] if self.draw.chance(0.6) else self.draw.vector(self.draw.pick((0.1, 3.0, 25.0)))

    def _damping(self, p: float) -> None:
        draw = self.draw
        if draw.chance(p):
            self.values["linear_damping"] = short(self.mass * draw.log(-2, 2))
        if DAMPING in self.can and draw.chance(p):
            self.values["angular_damping"] = self._angular_damping()
            self.needs.add(DAMPING)

    def _angular_damping(self) -> float:
        return short(0.1 * self.mass * self.size * self.size * self.draw.log(-2, 2))

    def _orientation(self) -> list[float]:
        draw = self.draw
        if draw.chance(0.3):
            return draw.pick(([0.0, 0.0, 0.0, 1.0], [0.6, 0.0, 0.0, 0.8], [0.0, 2.0, 0.0, 2.0], [1.0, 0.0, 0.0, 0.0]))
        size = draw.pick((1.0, 1.0, 1e-3, 50.0))
        return [short(size * draw.number(-1.0, 1.0)) for _ in range(3)] + [short(size * draw.number(0.1, 1.0))]

    def _spin(self) -> list[float]:
        return self.draw.vector(self.draw.by_weight({6.0: 5, 20.0: 3, 0.5: 1, 300.0: 0.5, 1e-9: 0.3}))

    def _velocity(self) -> list[float]:
        return self.draw.vector(self.draw.by_weight({0.5: 5, 8.0: 2, 300.0: 0.3}))

    def _place(self) -> list[float]:
        return self.draw.vector(self.draw.by_weight({self.size: 3, 1.0: 3, 100.0: 1, 1e6: 0.2}))

    def _initial(self) -> None:
        draw, values = self.draw, self.values
        if draw.chance(0.5):
            values["initial.position"] = self._place()
        if draw.chance(0.6):
            values["initial.orientation_xyzw"] = self._orientation()
        if draw.chance(0.15):
            return
        if draw.chance(0.5):
            values["initial.linear_velocity"] = self._velocity()
        if draw.chance(0.85):
            values["initial.angular_velocity"] = self._spin()

    def _timeout(self, name: str) -> float:
        seconds = self.draw.pick((0.0, 0.05, 0.2, self.draw.number(0.01, 1.0, 2), 5.0))
        self.timeouts[name] = seconds
        return seconds

    def _thrusters(self) -> None:
        draw = self.draw
        if not self.can >= {TORQUE, BODY_FORCE} or not draw.chance(0.22):
            return
        for name in ("a", "b", "c", "d")[: 1 + draw.below(4)]:
            limit = [short(self.mass * draw.number(0.5, 10.0))] if draw.chance(0.6) else []
            self.values[f"thrusters.{name}"] = [
                *self._on_body(),
                *draw.pick(([0, 0, 1.0], [2.0, -1.0, 1.0], [0, -1e-3, 0])),
                *limit,
            ]
        if draw.chance(0.4):
            self.values["thruster.bidirectional"] = True
        if draw.chance(0.4):
            self.values["thruster.minimum_on_time"] = draw.pick((0.01, 0.05, 0.3))

    def _on_body(self) -> list[float]:
        """A point in mesh coordinates, on the surface or anywhere near."""
        places = list(BODIES[self.body][2].values())
        return list(self.draw.pick(places)) if self.draw.chance(0.6) else self.draw.vector(BODIES[self.body][1])

    # The string

    def _string(self) -> None:
        draw, values = self.draw, self.values
        values.update(self._spring())
        if draw.chance(0.6):
            values["string.rest_length"] = self._rest_length()
        if draw.chance(0.3):
            values["string.bilateral"] = True
        if draw.chance(0.5):
            values["string.timeout"] = self._timeout("string.timeout")
        if draw.chance(0.35):
            values["string.attach"] = self._on_body()
        if draw.chance(0.5):
            values["string.attached"] = True
            values["string.target"] = self._target()
            if self.model == "explicit" and draw.chance(0.3):  # the knot is where its free end is
                values["string.attach"] = values["explicit_inertia.center_of_mass"]
                values["string.target"] = values.get("initial.position", [0.0, 0.0, 0.0])
            if draw.chance(0.3):
                values["initial.string_mass"] = short(self.mass * draw.number(0.1, 2.0))
            self.needs.add(STRING)

    def _spring(self) -> dict[str, float]:
        """Stiffness or frequency, and damping ratio."""
        draw, found = self.draw, {}
        rate = draw.by_weight(
            {5.0: 3, 30.0: 4, 300.0: 1.5, 3e3: 0.3 if self.integrator == "auto" else 0.0}
        ) * draw.number(0.3, 2.0)
        how = draw.by_weight({"string.stiffness": 5, "string.frequency": 4, "": 1})
        if how:
            found[how] = short(rate if how == "string.frequency" else self.mass * rate * rate)
        else:
            found["string.stiffness"] = 0.0 if draw.chance(0.1) else short(self.mass * 100.0)
        if draw.chance(0.6):
            found["string.damping_ratio"] = draw.pick((0.0, 0.05, 0.5, 1.0, 2.0))
        return found

    def _rest_length(self) -> float:
        return 0.0 if self.draw.chance(0.2) else short(self.size * self.draw.log(-1, 1))

    def _target(self) -> list[float]:
        """Near the body as it would be without loads."""
        return [
            short(x + dx)
            for x, dx in zip(self._where(), self.draw.vector(self.size * self.draw.pick((0.5, 3.0))), strict=True)
        ]

    def _where(self) -> list[float]:
        t, zero = self.now_s, [0.0, 0.0, 0.0]
        names = ("initial.position", "initial.linear_velocity", "gravity")
        x, v, g = (self.values.get(name, zero) for name in names)
        return [short(x[k] + t * v[k] + 0.5 * t * t * g[k], 6) for k in range(3)]
