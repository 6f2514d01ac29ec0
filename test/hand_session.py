# SPDX-License-Identifier: MIT
"""Hands on a body: drags, clicks, sliders and pauses on a core simulation, taken as the node takes them, with its event log."""

from __future__ import annotations

import numpy as np
from flights import EventLines

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.scene.command_codec import of_event
from rigid_proto_ros.scene.scenario import check_inertia, make_scenario, mesh_sha256_of
from rigid_proto_ros.session.recorded_session import RecordedSession
from rigid_proto_ros.simulation.commands import Change, ClearWrench, ReleaseString, WrenchCommand
from rigid_proto_ros.simulation.observer import Reset
from rigid_proto_ros.simulation.simulation import Simulation


class _LinesSinceReset(EventLines):
    takes = EventLines.takes | {Reset}

    def on(self, event) -> None:
        if isinstance(event, Reset):
            self.timed.clear()
        else:
            super().on(event)


class HandSession:
    """A body under hands."""

    def __init__(self, values: dict) -> None:
        self.scenario = make_scenario(values)
        self.first = self.scenario
        self.log = _LinesSinceReset()
        self.simulation = Simulation(self.scenario.setup, self.log)
        self.now_ns = 0

    def wait(self, time_ns: int, every_ns: int = 10_000_000) -> None:
        """Let time pass, states published as it does."""
        until_ns = self.now_ns + time_ns
        while self.now_ns < until_ns:
            self.now_ns = min(until_ns, (self.now_ns // every_ns + 1) * every_ns)
            self.simulation.advance(self.now_ns)
            assert not self.simulation.failure

    def reset(self) -> None:
        """As the service does."""
        self.simulation.reset(self.scenario.setup)
        self.first, self.now_ns = self.scenario, 0

    def load(self, held: bool, frame_id: str, force, torque=(0.0, 0.0, 0.0), stamp_ns: int = 0) -> None:
        """A message of the wrench or the poke topic."""
        frame = parse_frame(frame_id)
        force, torque = tuple(map(float, force)), tuple(map(float, torque))
        self._submit(WrenchCommand(held, frame, force, torque, frame_id, stamp_ns=stamp_ns))

    def tie(self, frame_id: str, point) -> None:
        """A message of ~/string/attach."""
        self._submit(of_event("string_attach", {"frame_id": frame_id, "point": point}))

    def pull(self, point) -> None:
        """A message of ~/string/target."""
        self._submit(of_event("string_target", {"frame_id": "world", "point": point}))

    def release(self) -> None:
        self._submit(ReleaseString())

    def clear(self) -> None:
        self._submit(ClearWrench())

    def set(self, **changes) -> None:
        """A parameter call; dots as two underscores. A refused one changes nothing."""
        named = {name.replace("__", "."): value for name, value in changes.items()}
        if "density" in named:
            named.setdefault("mass", 0.0)
        try:
            scenario = self.scenario.with_changes(named)
            self.simulation.check_change(scenario.setup)
        except InputError:
            return
        self.scenario = scenario
        self._submit(Change(named, lambda: scenario.setup))

    def inertia(self, mass: float, com, tensor) -> None:
        """A message of ~/inertia/set."""
        content = {"stamp_ns": 0, "frame_id": "", "relative": False, "mass": mass, "com": com, "tensor": tensor}

        def apply():
            self.scenario = check_inertia(self.scenario, content)
            return self.scenario.setup

        self._submit(Change(content, apply, "inertia"))

    def pause(self) -> None:
        """The mark that stands in the log: commands now pile up at one instant."""
        self.simulation.log("pause", {"data": True})

    def session(self) -> RecordedSession:
        """As a client has heard it."""
        return RecordedSession(
            scene=self.first.text,
            events=list(self.log.timed),
            times=np.array([self.now_ns]),
            rows=self.simulation.state.row[None].copy(),
            mesh_sha256=mesh_sha256_of(self.first.text),
        )

    def _submit(self, command) -> None:
        self.simulation.submit(command)


SCENE = {
    "mesh": "t_handle",
    "density": 7850.0,
    "initial.angular_velocity": [0.05, 0.1, 12.0],
    "string.stiffness": 1.0,
    "string.damping_ratio": 0.3,
    "contacts.tip": [0.0, 0.0, 0.07],
}


def random_hand_session(seed: int, seconds: float) -> HandSession:
    """Drags, clicks, sliders and pauses as hands make them, the same for a seed."""
    rng = np.random.default_rng(seed)
    hand = HandSession(SCENE)
    end_ns = round(seconds * 1e9)
    while hand.now_ns < end_ns:
        _act(hand, rng)
        hand.wait(int(rng.integers(1, 200_000_000)))
    hand.wait(50_000_000)
    return hand


def _act(hand: HandSession, rng: np.random.Generator) -> None:
    deed = rng.choice(
        ["drag", "click", "push", "hold", "slide", "paused", "inertia", "record"],
        p=[0.2, 0.2, 0.1, 0.1, 0.2, 0.1, 0.05, 0.05],
    )
    if deed == "drag":
        frames = (
            ("body/mesh", [0.0, 0.0, 0.07]),
            ("body", [0.01, 0.0, 0.02]),
            ("world", hand.simulation.state.position),
        )
        frame, point = frames[rng.integers(3)]
        hand.tie(frame, point)
        for _ in range(rng.integers(2, 12)):
            hand.pull(0.1 * rng.normal(size=3))
            hand.wait(int(rng.integers(1, 60_000_000)))
        if rng.random() < 0.7:
            hand.release()
    elif deed in ("click", "push"):
        _click(hand, rng, deed)
    elif deed == "hold":
        hand.load(
            True,
            rng.choice(["", "world@tip", "body@vertex/3", "body"]),
            0.02 * rng.normal(size=3),
            1e-4 * rng.normal(size=3),
        )
        if rng.random() < 0.3:
            hand.wait(100_000_000)
            hand.clear()
    elif deed == "slide":
        for _ in range(rng.integers(1, 6)):
            _slide(hand, rng)
            hand.wait(int(rng.integers(1, 50_000_000)))
    elif deed == "paused":
        hand.pause()
        for _ in range(rng.integers(1, 30)):
            _slide(hand, rng)
        for _ in range(rng.integers(0, 3)):
            _click(hand, rng, "push")
    elif deed == "inertia":
        body = hand.scenario.setup.body
        I = 1.1 * body.inertia
        hand.inertia(
            body.mass, (body.center_of_mass + 0.001).tolist(), [I[0, 0], I[0, 1], I[0, 2], I[1, 1], I[1, 2], I[2, 2]]
        )
    else:
        hand.set(record="somewhere.mcap")


def _click(hand: HandSession, rng: np.random.Generator, deed: str) -> None:
    if deed == "push":
        option = rng.choice([";impulse", ";duration=0.1", ""])
        size = 0.0005 if option == ";impulse" else 0.02
        hand.load(False, f"normal@vertex/{rng.integers(20)}{option}", [size, 0.0, 0.0])
        return
    state = hand.simulation.state
    eye = state.position + np.array([1.0, 0.3, 0.2])
    knot = state.position + state.rotation @ hand.scenario.setup.body.point((0.0, 0.0, 0.03))
    ray = "/".join(",".join(repr(float(x)) for x in v) for v in (eye, knot - eye))
    option = rng.choice([";impulse", ";duration=0.05"])
    size = 0.001 if option == ";impulse" else 0.03
    hand.load(False, f"world@ray/{ray}{option}", size * (knot - eye))


def _slide(hand: HandSession, rng: np.random.Generator) -> None:
    changes = (
        {"mass": float(rng.uniform(0.1, 0.3))},
        {"density": float(rng.uniform(4000.0, 9000.0))},
        {"scale": rng.uniform(0.8, 1.2, 3).tolist()},
        {"ballast.tip": [float(rng.uniform(0.0, 0.03)), 0.0, 0.0, 0.07]},
        {"inertia_model": str(rng.choice(["solid", "shell", "bounding_box", "points"]))},
        {"gravity": [0.0, 0.0, float(rng.uniform(-0.3, 0.0))], "linear_damping": float(rng.uniform(0.0, 0.1))},
        {"string.attached": bool(rng.random() < 0.5), "string.target": (0.1 * rng.normal(size=3)).tolist()},
        {"string.stiffness": float(rng.uniform(0.5, 2.0)), "poke_duration": float(rng.uniform(0.01, 0.1))},
        {"gyroscopic": bool(rng.random() < 0.7)},
    )
    hand.set(**changes[rng.integers(len(changes))])
