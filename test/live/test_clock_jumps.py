# SPDX-License-Identifier: MIT
"""A clock that simulated time follows may jump: ahead, nothing moves in between; back, what waits is dropped."""

from __future__ import annotations

import json

import numpy as np
import pytest
from flights import EventLines

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.live.live_simulation import LiveSimulation
from rigid_proto_ros.live.pacing import Stamps
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.parameters.declarations import ZERO
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.session.as_script import script_of_session
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.check import verify
from rigid_proto_ros.simulation.commands import WrenchCommand

SECOND = 10**9
MS = 10**6
START = 5000 * SECOND


class Followed:
    """A simulation whose ticks are made here, after a clock that is set here."""

    def __init__(self, **values) -> None:
        self.clock_ns = START
        self.lines, self.warned = EventLines(), []
        scenario = make_scenario({"mesh": "t_handle", "publish_rate": 100.0, **values})
        self.live = LiveSimulation(scenario, observers=[self.lines], stamps=Stamps(lambda: self.clock_ns))
        self.live.endpoints.warn = self.warned.append
        self.live.announce()
        self.live.loop.start()
        self.run(0.5)

    def run(self, seconds: float, spacing_ns: int = 10 * MS) -> None:
        """The clock goes on evenly."""
        for _ in range(round(seconds * SECOND / spacing_ns)):
            self.jump(spacing_ns)

    def jump(self, by_ns: int) -> None:
        self.clock_ns += by_ns
        self.live.loop.tick()

    def send(self, stamp_ns: int, frame: str = "world;impulse", held: bool = False) -> None:
        """A message with a stamp of the clock."""
        command = WrenchCommand(held, parse_frame(frame), (1e-3, 0.0, 0.0), ZERO, frame, stamp_ns=stamp_ns)
        self.live.call(lambda: self.live.loop.commands.receive(command.kind, lambda: command))

    @property
    def events(self) -> list[tuple[str, int]]:
        return [(event["kind"], event["time_ns"] // MS) for event in map(json.loads, self.lines.lines)]


def test_ahead_nothing_moves_pulses_end_and_what_was_due_acts_at_the_end_in_its_order(tmp_path):
    path = tmp_path / "flight.mcap"
    flown = Followed(**{"record": str(path), "initial.linear_velocity": [1.0, 0.0, 0.0], "wrench_timeout": 3.0})
    flown.send(0, "world;duration=2.0")
    flown.send(0, "world", held=True)
    flown.send(START + 900 * SECOND)
    flown.live.schedule("[{t: 1200, set: {mass: 2}}]")
    flown.live.schedule("[{t: 700, set: {mass: 1}}]")
    flown.live.schedule("[{t: 800, set: {gravity: [0, 0, -1]}}]")
    flown.run(0.1)
    before = flown.live.state
    flown.jump(1000 * SECOND)
    flown.live.loop.catch_up()
    after = flown.live.state
    assert after.time_ns == flown.clock_ns - START == 1000_600 * MS
    assert (after.position == before.position).all() and not flown.live.loop.simulation.acting
    flown.run(0.1)
    assert flown.events == [
        ("clock", 0),
        *(("wrench", 500), ("poke", 500), ("jump", 600), ("timeout", 1000_600)),
        *(("set", 1000_600), ("set", 1000_600), ("poke", 1000_600)),
    ]
    assert flown.live.scenario.parameters.mass == 1.0
    assert len(flown.warned) == 1 and "/clock jumped by +1000 s" in flown.warned[0]
    assert flown.live.loop.pace.jumps == 1
    flown.live.stop()
    (session,) = read_runs(path)
    assert np.diff(session.times).max() > 999 * SECOND, "no state in between"
    assert verify(session) is None
    with pytest.raises(InputError, match="a jump of /clock"):
        script_of_session(session)


def test_back_stamps_go_with_the_clock_and_what_waits_is_dropped(tmp_path):
    path = tmp_path / "flight.mcap"
    flown = Followed(record=str(path))
    flown.send(START + 8 * SECOND)
    flown.jump(-6 * SECOND)
    flown.run(1.0)
    assert not flown.live.loop.simulation._pending
    assert flown.live.state.time_ns + flown.live.stamps.offset_ns == flown.clock_ns
    flown.send(flown.clock_ns + SECOND // 2)
    flown.run(20.0)
    assert flown.events == [("clock", 0), ("jump", 500), ("clock", 500), ("poke", 2000)]
    assert len(flown.warned) == 1 and "/clock jumped by -6 s" in flown.warned[0]
    flown.live.stop()
    (session,) = read_runs(path)
    assert verify(session) is None


def test_a_clock_with_wide_steps_does_not_jump_and_its_time_is_flown():
    flown = Followed(**{"initial.linear_velocity": [1.0, 0.0, 0.0]})
    for spacing_s in (0.1, 0.5, 2.0, 5.0, 5.0, 20.0):
        flown.run(10 * spacing_s, round(spacing_s * SECOND))
    assert flown.live.loop.pace.jumps == 0
    assert flown.live.state.position[0] == pytest.approx(flown.live.state.time_ns * 1e-9, rel=1e-9)
