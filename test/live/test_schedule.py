# SPDX-License-Identifier: MIT
"""What a scheduled change has to load or compile is done before it is taken, beside the thread that carries the body."""

from __future__ import annotations

import itertools
import threading
import time

import pytest
from ros_process import READY_S

from rigid_proto_ros.live import warm_up
from rigid_proto_ros.live.endpoints import Endpoints
from rigid_proto_ros.live.live_simulation import LiveSimulation
from rigid_proto_ros.live.pacing import WorkBudget
from rigid_proto_ros.scene import scenario
from rigid_proto_ros.scene.command_codec import load_command
from rigid_proto_ros.scene.offline import read_scene
from rigid_proto_ros.scene.parameters import ZERO
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation import flight_arrays
from rigid_proto_ros.simulation.observer import BodyChanged, Observer

MS = 1_000_000


class Rig(Endpoints):
    """A flight that is ticked here."""

    def __init__(self) -> None:
        self.published: list[int] = []
        values = {"mesh": "t_handle", "publish_rate": 1000.0, "real_time_factor": 0.0}
        self.live = LiveSimulation(make_scenario(values), endpoints=self)
        self.loop, self.commands = self.live.loop, self.live.commands
        self.loop.start()

    def publish(self, state) -> None:
        self.published.append(state.time_ns)

    def has_subscribers(self) -> bool:
        return True

    def schedule(self, text: str) -> None:
        self.commands.receive_schedule(lambda: text)

    def tick_until(self, condition) -> None:
        deadline = time.monotonic() + READY_S
        while not condition():
            assert time.monotonic() < deadline, "it never came"
            self.loop.tick()


def test_a_scheduled_mesh_is_loaded_once_and_never_by_the_thread_that_carries_the_body(monkeypatch) -> None:
    rig = Rig()
    may_load, loaded_by = threading.Event(), []
    load = scenario.mesh_body

    def slow(*arguments, **named):
        loaded_by.append(threading.current_thread().name)
        may_load.wait()
        return load(*arguments, **named)

    monkeypatch.setattr(scenario, "mesh_body", slow)
    rig.schedule('{"t": 3000, "set": {"mesh": "book"}}')
    rig.tick_until(lambda: loaded_by)
    before = len(rig.published)
    # The mesh isn't there, and the body flies on; what comes by other ways is taken meanwhile.
    rig.commands.receive("poke", lambda: load_command(False, "world;impulse", (1e-3, 0.0, 0.0), ZERO))
    rig.tick_until(lambda: len(rig.published) >= before + 200 and rig.loop.simulation.events.count)
    assert rig.commands.received["schedule"] == 0
    may_load.set()
    rig.tick_until(lambda: rig.commands.received["schedule"] == 1)
    assert not rig.loop.simulation.refused
    rig.schedule('[{"t": 0, "set": {"mesh": "book"}}]')
    rig.tick_until(lambda: rig.loop.scenario.parameters.mesh == "book")
    assert loaded_by == ["schedule"] * 2


def test_a_scheduled_integrator_is_compiled_beside_the_thread_that_carries_the_body(monkeypatch) -> None:
    rig = Rig()
    may_compile, compiled_by = threading.Event(), []

    def slow(setup) -> None:
        compiled_by.append((threading.current_thread().name, setup.integrator.name))
        may_compile.wait()

    monkeypatch.setattr(warm_up, "warm_up", slow)
    rig.schedule('{"t": 0, "set": {"integrator": "rk4"}}')
    rig.schedule('{"t": 0, "set": {"gravity": [0, 0, -1]}}')
    rig.tick_until(lambda: compiled_by)
    before = len(rig.published)
    rig.tick_until(lambda: len(rig.published) >= before + 200)
    assert rig.loop.scenario.parameters.integrator == "auto"
    may_compile.set()
    # What was scheduled after it is taken after it.
    rig.tick_until(lambda: rig.commands.received["schedule"] == 2)
    rig.tick_until(lambda: rig.loop.scenario.parameters.gravity == (0.0, 0.0, -1.0))
    assert rig.loop.scenario.parameters.integrator == "rk4"
    assert compiled_by == [("schedule", "rk4")]


@pytest.mark.parametrize("service", ["pause", "step"])
def test_what_a_list_has_to_load_while_time_stands_is_loaded_before_time_goes_on(monkeypatch, service) -> None:
    rig = Rig()
    load = scenario.mesh_body

    def slow(*arguments, **named):
        time.sleep(0.2)
        return load(*arguments, **named)

    changed_ns: list[int] = []

    class Changes(Observer):
        takes = frozenset({BodyChanged})

        def on(self, event) -> None:
            if isinstance(event, BodyChanged):
                changed_ns.append(event.time_ns)

    monkeypatch.setattr(scenario, "mesh_body", slow)
    rig.loop.watch(Changes())
    rig.live.pause(True)
    at_ns = rig.loop.simulation.time_ns
    rig.schedule('[{"t": 0, "set": {"mesh": "book"}}]')
    if service == "pause":
        rig.live.pause(False)
    else:
        for _ in rig.live.steps():
            rig.loop.tick()
    assert rig.commands.received["schedule"] == 1
    rig.tick_until(lambda: rig.loop.scenario.parameters.mesh == "book")
    assert changed_ns == [at_ns]


def test_a_step_asked_for_while_another_is_made_follows_it(monkeypatch) -> None:
    rig = Rig()
    rig.loop.pause(True)
    reached_ns = rig.loop.simulation.time_ns
    advance, calls = WorkBudget.advance, itertools.count()
    # As where a tick's time is over before the step is made.
    monkeypatch.setattr(WorkBudget, "advance", lambda *given: next(calls) % 3 != 0 and advance(*given))
    waiting = [rig.loop.steps(5), rig.loop.steps(7)]
    while waiting:
        waiting = [steps for steps in waiting if next(steps, True) is None]
        rig.loop.tick()
    assert rig.loop.simulation.time_ns == reached_ns + 12 * MS


def test_the_flights_kernels_are_compiled_without_any_integrator(monkeypatch) -> None:
    """So that at the first start another process compiles the integrators at the same time."""

    def refuse(*_) -> None:
        raise AssertionError("an integrator was compiled")

    monkeypatch.setattr(flight_arrays, "provide_kernel", refuse)
    warm_up.compile_flight(read_scene("top_on_string", {"integrator": "rk4", "linear_damping": 0.1}).setup)
