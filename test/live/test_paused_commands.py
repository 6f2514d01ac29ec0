# SPDX-License-Identifier: MIT
"""What comes while time stands acts at once, in the order in which it comes: the motion and the chain of events are those of
``simulate --script`` with the same commands, listed in that order.
"""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from typing import Any

import pytest
from flights import EventLines

from rigid_proto_ros.base.vectors import StateRow
from rigid_proto_ros.live.live_simulation import LiveSimulation
from rigid_proto_ros.scene.command_codec import MARKS
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import at_contact, expand_entry, parse_script
from rigid_proto_ros.session.check import verify
from rigid_proto_ros.session.messages import PROJECTIONS
from rigid_proto_ros.session.recorded_session import RecordedSession, States, decode_event
from rigid_proto_ros.simulation.commands import TieString
from rigid_proto_ros.simulation.observer import EventLog

PERIOD_NS = 10_000_000
SCENE = {
    "mesh": "t_handle",
    "integrator": "auto",
    "start_paused": True,
    "initial.angular_velocity": [0.5, -2.0, 3.0],
    "contacts.tip": [0.0, 0.0, 0.07],
    "wrench_timeout": 0.03,
    "string.timeout": 0.04,
    "poke_duration": 0.01,
}


def entry_by(draw: random.Random) -> dict[str, Any]:
    """An entry of a script, without its time."""

    def vector(size: float) -> list[float]:
        return [round(draw.uniform(-size, size), 6) for _ in range(3)]

    kinds = {
        "impulse": lambda: {"at": "tip", "impulse": vector(1e-3)},
        "poke": lambda: {"at": "tip", "force": vector(1e-2), **draw.choice(({}, {"duration": 0.02}, {"slot": "a"}))},
        "ray": lambda: {
            "at": {"ray": {"origin": [0.0, draw.choice((0.0, 5.0)), 1.0], "direction": [0.0, 0.0, -1.0]}},
            "impulse": vector(1e-4),
        },
        "wrench": lambda: {"wrench": {"at": "com", "force": vector(1e-2), **draw.choice(({}, {"slot": "b"}))}},
        "tie": lambda: {"string": {"attach": draw.choice(("tip", [0.0, 0.0, 0.0])), "target": vector(0.2)}},
        "move": lambda: {"string": {"target": vector(0.2)}},
        "release": lambda: {"string": "release"},
        "clear": lambda: {"service": "clear_wrench"},
        "state": lambda: {"state": {"linear_velocity": vector(0.1)}},
        **{name: lambda change=change: {"set": change()} for name, change in changes_by(draw).items()},
    }
    return kinds[draw.choice(list(kinds))]()


def changes_by(draw: random.Random) -> dict[str, Any]:
    """Changes of parameters."""
    return {
        "mass": lambda: {"mass": draw.choice((0.1, 0.15, 0.5))},
        "com": lambda: {"ballast.nut": [draw.choice((0.0, 0.01)), 0.0, 0.0, 0.07]},
        "model": lambda: {"inertia_model": draw.choice(("solid", "shell", "bounding_box"))},
        "scale": lambda: {"scale": draw.choice((1.0, 1.5))},
        "timeout": lambda: {"wrench_timeout": draw.choice((0.01, 0.03, 0.2))},
        "gravity": lambda: {"gravity": [0.0, 0.0, draw.choice((0.0, -0.5))]},
    }


class Paused:
    """A simulation that is commanded while its time stands, and the script that says the same."""

    def __init__(self, seed: int) -> None:
        self.draw = random.Random(seed)
        self.lines = EventLines()
        self.live = LiveSimulation(make_scenario(SCENE), observers=[self.lines])
        self.live.announce()
        self.begun = self.live.scenario
        self.script: list[dict[str, Any]] = []
        self.refused_before = 0

    @property
    def now_s(self) -> float:
        return self.live.state.time_ns / 1e9

    def act(self) -> None:
        """Do one thing at random."""
        (what,) = self.draw.choices(
            (self.by_list, self.by_message, self.by_parameter, self.ahead, self.lockstep, self.step, self.reset),
            (6, 4, 5, 4, 2, 4, 0.4),
        )
        what()
        # One truth: what the parameters say is what moves, now.
        assert self.live.loop.simulation.setup is self.live.scenario.setup

    def by_list(self) -> None:
        entries = [{"t": self.now_s, **entry_by(self.draw)} for _ in range(self.draw.choice((1, 1, 2, 3)))]
        self.live.schedule(json.dumps(entries))
        self.script += entries

    def by_message(self) -> None:
        entry = {"t": self.now_s, **entry_by(self.draw)}
        for command in expand_entry(entry, "test"):
            if isinstance(command, TieString) and command.contact:  # which no message names
                command = at_contact(command, self.live.scenario.setup.contacts)
            self.live.call(lambda command=command: self.live.loop.commands.receive("poke", lambda: command))
        self.script.append(entry)

    def by_parameter(self) -> None:
        changes = self.draw.choice(list(changes_by(self.draw).values()))()
        self.live.set_parameters(changes)
        self.script.append({"t": self.now_s, "set": changes})

    def ahead(self) -> None:
        """Entries for where time is going to stand, or between."""
        t = (self.live.state.time_ns + round(self.draw.choice((0.3, 1.0, 1.0, 2.0)) * PERIOD_NS)) / 1e9
        entries = [{"t": t, **entry_by(self.draw)} for _ in range(self.draw.choice((1, 2)))]
        self.live.schedule(json.dumps(entries))
        self.script += entries

    def lockstep(self) -> None:
        """A wrench that is followed by a step."""
        self.live.set_parameters({"lockstep": True})
        entry = {"t": self.now_s, "wrench": {"at": "com", "force": [0.0, self.draw.uniform(-1e-2, 1e-2), 0.0]}}
        self.script += [{"t": self.now_s, "set": {"lockstep": True}}, entry]
        begun_ns = self.live.state.time_ns
        (command,) = expand_entry(entry, "test")
        self.live.call(lambda: self.live.loop.commands.receive("wrench", lambda: command))
        while self.live.state.time_ns == begun_ns or self.live.loop.stepping:
            self.live.loop.tick()
        assert self.live.state.time_ns == begun_ns + PERIOD_NS
        self.live.set_parameters({"lockstep": False})
        self.script.append({"t": self.now_s, "set": {"lockstep": False}})

    def step(self) -> None:
        self.advance(self.draw.choice((1, 1, 3)))

    def advance(self, periods: int) -> None:
        """As the physics thread does, of which there is none here."""
        steps = self.live.loop.steps(periods)
        while next(steps, "made") != "made":
            self.live.loop.tick()

    def reset(self) -> None:
        self.compare()
        self.live.reset()
        self.lines.events.clear()
        self.script.clear()
        self.begun = self.live.scenario
        self.refused_before = sum(self.live.loop.simulation.refused.values())

    def compare(self) -> None:
        """With the run without ROS and clock."""
        self.advance(1)
        simulation, lines = self.live.loop.simulation, EventLines()
        offline = OfflineRun(self.begun, parse_script(json.dumps(self.script)), lines)
        assert offline.advance(simulation.time_ns)
        acted = EventLog()
        for number, line in enumerate(self.lines.lines, 1):
            time_ns, kind, content = decode_event(line, number)
            if kind not in MARKS or kind == "timeout":
                acted.append(time_ns, kind, content)
        assert acted.sha256 == offline.simulation.events.sha256
        assert self.live.state.sha256() == offline.simulation.state.sha256()
        refused = sum(simulation.refused.values()) - self.refused_before
        assert refused == sum(offline.simulation.refused.values())
        assert not offline.simulation.failure


def fly(seed: int) -> None:
    flown = Paused(seed)
    for _ in range(flown.draw.randrange(3, 25)):
        flown.act()
    flown.compare()
    flown.live.stop()


@pytest.mark.parametrize("seed", range(30))
def test_commands_of_a_pause_act_as_a_script_that_lists_them_in_the_order_in_which_they_came(seed):
    fly(seed)


class OfTopics(States):
    """What was published of states: times [ns], topics and rows."""

    topics = ("pose", "twist")

    def __init__(self, published: list[tuple[int, str, list[float]]]) -> None:
        self._published, self.count = published, len(published) // 2
        self.first_ns, self.end_ns = published[0][0], published[-1][0]

    def __iter__(self) -> Iterator[tuple[int, str, list[float]]]:
        return iter(self._published)


@pytest.mark.parametrize("seed", range(8))
def test_states_published_while_time_stands_are_verified_as_those_behind_commands_of_that_instant(seed):
    """As a bag of the topics has them, frozen ones too."""
    flown = Paused(seed)
    published: list[tuple[int, StateRow]] = []
    loop = flown.live.loop
    loop.endpoints.has_subscribers = lambda: True
    loop.endpoints.publish = lambda run: published.append((run.simulation.time_ns, run.simulation.state.row.copy()))
    for _ in range(15):
        flown.draw.choice((flown.by_list, flown.by_parameter, flown.ahead, flown.step))()
        if flown.draw.random() < 0.6:
            loop._paused_publication_ns = 0
            loop.tick()
    flown.advance(1)
    flown.live.stop()
    states = [
        (time_ns, name, list(PROJECTIONS[name](row.tolist())))
        for time_ns, row in published
        for name in ("pose", "twist")
    ]
    session = RecordedSession(scene=flown.begun.text, events=flown.lines.timed, states=OfTopics(states))
    assert verify(session) is None
    # And one that lies behind none of them is found.
    states[-1][2][0] += 1e-12
    assert verify(session) is not None


@pytest.mark.stress
@pytest.mark.parametrize("part", range(10))
def test_a_thousand_pauses_act_as_scripts(part):
    for seed in range(1000 + 100 * part, 1100 + 100 * part):
        fly(seed)
