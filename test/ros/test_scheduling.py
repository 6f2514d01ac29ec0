# SPDX-License-Identifier: MIT
"""What a scheduled change has to load or compile is done before it is taken, beside the thread that carries the body."""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

from rigid_proto_ros.messages import cdr
from rigid_proto_ros.ros import command_intake, command_queue, warm_up
from rigid_proto_ros.ros.pacing import WorkBudget
from rigid_proto_ros.ros.physics_thread import advance_by
from rigid_proto_ros.ros.services import Services
from rigid_proto_ros.ros.simulation_loop import SimulationLoop
from rigid_proto_ros.ros.step_service import step
from rigid_proto_ros.scene import scenario
from rigid_proto_ros.scene.offline import read_scene
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation import flight_arrays
from rigid_proto_ros.simulation.observer import Observer

MS = 1_000_000


class Subscription:
    """One whose queue is filled here."""

    def __init__(self) -> None:
        self.queue: deque[bytes] = deque()
        self.handle = self
        self.qos_profile = SimpleNamespace(depth=5000)

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        pass

    def take_message(self, message_type, raw: bool):
        return (self.queue.popleft(), {}) if self.queue else None


class Rig:
    """A flight with its intake, and no ROS graph."""

    def __init__(self, monkeypatch) -> None:
        monkeypatch.setattr(command_queue, "_event", lambda subscription, kind: None)
        self.topics: dict[str, Subscription] = {}
        self.published: list[int] = []
        self.loop = SimulationLoop(
            make_scenario({"mesh": "t_handle", "publish_rate": 1000.0, "real_time_factor": 0.0}),
            Observer(),
            lambda state: self.published.append(state.time_ns),
            lambda wall_ns, all_topics: self.intake.take(wall_ns, True),
            print,
        )
        self.intake = command_intake.CommandIntake(self, self.loop, ("world", "rigid_body"), None, self.change, None)
        self.loop.start()

    def get_logger(self):
        return None

    def create_subscription(self, message_type, topic, *_, **__) -> Subscription:
        return self.topics.setdefault(topic.removeprefix("~/"), Subscription())

    def change(self, changes: dict, at_hand):
        return self.loop.change(changes, at_hand=at_hand)

    def schedule(self, text: str) -> None:
        self.topics["schedule"].queue.append(cdr.string(text))

    def tick_until(self, condition) -> None:
        for _ in range(1_000_000):
            if condition():
                return
            self.loop.tick()
        raise AssertionError("it never came")


def test_a_scheduled_mesh_is_loaded_once_and_never_by_the_thread_that_carries_the_body(monkeypatch) -> None:
    rig = Rig(monkeypatch)
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
    rig.topics["poke"].queue.append(cdr.wrench_stamped(0, "world;impulse", (1e-3, 0.0, 0.0), (0.0, 0.0, 0.0)))
    rig.tick_until(lambda: len(rig.published) >= before + 200 and rig.intake.received["poke"])
    assert rig.intake.received["schedule"] == 0
    may_load.set()
    rig.tick_until(lambda: rig.intake.received["schedule"] == 1)
    assert not rig.loop.simulation.refused
    rig.schedule('[{"t": 0, "set": {"mesh": "book"}}]')
    rig.tick_until(lambda: rig.loop.scenario.parameters.mesh == "book")
    assert loaded_by == ["schedule"] * 2


def test_a_scheduled_integrator_is_compiled_beside_the_thread_that_carries_the_body(monkeypatch) -> None:
    rig = Rig(monkeypatch)
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
    rig.tick_until(lambda: rig.intake.received["schedule"] == 2)
    rig.tick_until(lambda: rig.loop.scenario.parameters.gravity == (0.0, 0.0, -1.0))
    assert rig.loop.scenario.parameters.integrator == "rk4"
    assert compiled_by == [("schedule", "rk4")]


@pytest.mark.parametrize("service", ["pause", "step"])
def test_what_a_list_has_to_load_while_time_stands_is_loaded_before_time_goes_on(monkeypatch, service) -> None:
    rig = Rig(monkeypatch)
    load = scenario.mesh_body

    def slow(*arguments, **named):
        time.sleep(0.2)
        return load(*arguments, **named)

    changed_ns: list[int] = []

    class Changes(Observer):
        def body_changed(self, time_ns, body) -> None:
            changed_ns.append(time_ns)

    monkeypatch.setattr(scenario, "mesh_body", slow)
    rig.loop.watch(Changes())
    services = Services(rig.loop, lambda function: function(), rig.intake)
    services._pause(SimpleNamespace(data=True))
    at_ns = rig.loop.simulation.time_ns
    rig.schedule('[{"t": 0, "set": {"mesh": "book"}}]')
    if service == "pause":
        services._pause(SimpleNamespace(data=False))
    else:
        for _ in step(rig.loop, rig.intake):
            rig.loop.tick()
    assert rig.intake.received["schedule"] == 1
    rig.tick_until(lambda: rig.loop.scenario.parameters.mesh == "book")
    assert changed_ns == [at_ns]


def test_a_step_asked_for_while_another_is_made_follows_it(monkeypatch) -> None:
    rig = Rig(monkeypatch)
    rig.loop.pause(True)
    reached_ns = rig.loop.simulation.time_ns
    advance, calls = WorkBudget.advance, itertools.count()
    # As where a tick's time is over before the step is made.
    monkeypatch.setattr(WorkBudget, "advance", lambda *given: next(calls) % 3 != 0 and advance(*given))
    waiting = [advance_by(rig.loop, 5), advance_by(rig.loop, 7)]
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
