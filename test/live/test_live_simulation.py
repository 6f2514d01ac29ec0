# SPDX-License-Identifier: MIT
"""A body in real time without ROS: commands, time, parameters, observers and a recording from any thread."""

from __future__ import annotations

import ctypes
import json
import platform
import struct
import sys
import threading
import time

import numpy as np
import pytest
from conftest import ENDINGS, needs_rerun

from rigid_proto_ros.base.errors import CommandRefused, InputError
from rigid_proto_ros.live.live_simulation import LiveSimulation
from rigid_proto_ros.live.pacing import SLICE_NS
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.parameters.declarations import ZERO
from rigid_proto_ros.rerun_view.recorders import record
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.session.as_script import script_of_session
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.check import NotVerifiableError, verify
from rigid_proto_ros.simulation.commands import ThrusterCommand, WrenchCommand
from rigid_proto_ros.simulation.observer import BodyChanged, Logged, Observer, Published

PERIOD_NS = 10_000_000


class Watcher(Observer):
    """Keeps the times of what it is told, and the lines of events."""

    def __init__(self, *takes: type) -> None:
        self.takes = frozenset(takes)
        self.times: list[int] = []
        self.lines: list[str] = []

    def on(self, event) -> None:
        if isinstance(event, Logged):
            self.lines.append(event.line)
        elif type(event) in self.takes:
            self.times.append(event.time_ns)


@pytest.fixture
def watcher():
    return Watcher(Published, Logged)


@pytest.fixture
def live(watcher):
    """A body at rest, paused, with a contact."""
    scenario = make_scenario({"mesh": "t_handle", "start_paused": True, "contacts.tip": [0.0, 0.0, 0.07]})
    live = LiveSimulation(scenario, observers=[watcher])
    live.announce()
    live.start()
    yield live
    live.stop()


def submit(live: LiveSimulation, command: WrenchCommand | ThrusterCommand) -> None:
    """As if its message had come now."""
    live.call(lambda: live.loop.commands.receive(command.kind, lambda: command))


@pytest.mark.parametrize("late", [False, True], ids=["list first", "list last"])
@pytest.mark.parametrize("changed", [{"mass": 5.0}, {"gravity": [0.0, 0.0, -7.0]}], ids=["another", "the same"])
def test_parameters_and_lists_of_a_pause_act_at_once_in_the_order_in_which_they_come(live, watcher, changed, late):
    scheduled = json.dumps([{"t": 0, "set": changed}])
    given = {"gravity": [0.0, 0.0, -3.0]}
    for act in (lambda: live.schedule(scheduled), lambda: live.set_parameters(given))[:: -1 if late else 1]:
        act()
    setup, parameters = live.loop.simulation.setup, live.scenario.parameters
    assert setup is live.scenario.setup
    gravity = changed.get("gravity", given["gravity"]) if late else given["gravity"]
    assert setup.gravity.tolist() == list(parameters.gravity) == gravity
    if "mass" in changed:
        assert setup.body.mass == 5.0
    kinds = [json.loads(line)["content"] for line in watcher.lines if json.loads(line)["kind"] == "set"]
    assert kinds == [changed, given][:: -1 if late else 1]


def test_parameters_that_what_acts_cannot_take_are_refused_and_stay_what_they_were(live):
    live.schedule("[{t: 0, wrench: {at: tip, force: [0.01, 0, 0]}}]")
    with pytest.raises(CommandRefused, match="taylor"):
        live.set_parameters({"integrator": "taylor", "linear_damping": 0.5})
    assert live.call(lambda: dict(live.loop.simulation.refused)) == {"integrator": 1}
    assert live.scenario.parameters.integrator == "auto" and live.scenario.parameters.linear_damping == 0.0
    assert live.loop.simulation.setup.integrator.name == "auto"
    live.set_parameters({"linear_damping": 0.5})
    live.step()
    assert live.loop.simulation.setup.scene.linear_damping == 0.5


@pytest.mark.parametrize("first", ["inertia_model", "scale"])
def test_parameters_set_while_time_stands_act_one_after_another(live, first):
    changes = {"inertia_model": {"inertia_model": "shell"}, "scale": {"scale": 2.0}}
    order = [first, *(name for name in changes if name != first)]
    for name in order:
        live.set_parameters(changes[name])
    live.step()
    listed = [{"t": 0.0, "set": changes[name]} for name in order]
    run = OfflineRun(make_scenario({"mesh": "t_handle"}), parse_script(json.dumps(listed)))
    assert run.advance(PERIOD_NS)
    # The other model moves the centre of mass within the mesh, which has been scaled by then or not.
    assert np.any(live.state.position != 0.0)
    assert live.state.row.tobytes() == run.simulation.state.row.tobytes()
    assert live.scenario.parameters.inertia_model == "shell" and live.scenario.parameters.scale == (2.0,)


def test_commands_are_checked_in_the_scene_that_parameters_have_made(live):
    live.set_parameters({"integrator": "taylor", "mass": 1e-12})
    live.step()
    live.set_parameters({"integrator": "auto", "mass": 1.0})
    submit(live, WrenchCommand(False, parse_frame("world@tip"), (0.0, 0.0, 0.01), ZERO))
    submit(live, WrenchCommand(False, parse_frame("world;impulse"), (1e4, 0.0, 0.0), ZERO))
    live.step()
    assert not live.loop.simulation.refused and live.state.linear_velocity[0] == pytest.approx(1e4, rel=1e-9)


def test_commands_are_checked_under_the_changes_that_wait_before_them(live):
    live.set_parameters({"integrator": "free_body"})
    live.step()
    with pytest.raises(CommandRefused, match="rk4"):
        live.set_parameters({"gyroscopic": False})
    entries = [{"t": 0.02, "set": {"integrator": "auto"}}, {"t": 0.03, "at": "tip", "force": [0.0, 0.0, 0.1]}]
    for entry in (*entries, {"t": 0.04, "set": {"angular_damping": 1e-6}}):
        live.schedule(json.dumps([entry]))
    held = WrenchCommand(True, parse_frame("world@tip"), (0.0, 0.01, 0.0), ZERO, stamp_ns=30_000_000)
    submit(live, held)
    with pytest.raises(CommandRefused, match="free_body"):
        live.schedule(json.dumps([{**entries[1], "t": 0.015}]))
    live.step(5)
    assert live.call(lambda: dict(live.loop.simulation.refused)) == {"integrator": 2}
    assert live.scenario.parameters.angular_damping == 1e-6 and live.state.linear_velocity[1] > 0.0


def test_a_reset_and_the_list_that_it_heads_are_taken_together_or_not_at_all(live, watcher):
    live.step(3)
    refused = [{"service": "reset"}, {"t": 0.01, "impulse": [1, 0, 0]}, {"t": 0.0, "at": "nowhere", "force": [1, 0, 0]}]
    with pytest.raises(CommandRefused, match="nowhere"):
        live.schedule(json.dumps(refused))
    assert live.state.time_ns == 3 * PERIOD_NS and live.loop.resets == 0
    with pytest.raises(CommandRefused, match="entry 3"):
        live.schedule(
            '[{"service": "reset", "more": true}, {"t": 0, "impulse": [1, 0, 0]}, {"t": 0, "forse": [1, 0, 0]}]'
        )
    for single in ("{t: 0, service: reset}", "[{t: 0, impulse: [1, 0, 0]}, {t: 0, service: reset}]"):
        with pytest.raises(CommandRefused, match="heads a list"):
            live.schedule(single)
    watcher.lines.clear()
    live.schedule(json.dumps(refused[:2]))
    assert live.state.time_ns == 0 and live.loop.resets == 1 and live.paused
    live.step(2)
    assert [json.loads(line)["kind"] for line in watcher.lines] == ["reset", "step", "poke"]
    assert live.loop.commands.received["schedule"] == 3 + 3 + 1 + 2 + 2


@pytest.mark.parametrize("factor", [1.0, 0.0])
def test_a_list_that_says_more_keeps_time_at_0_until_the_last_one_has_come(live, watcher, factor):
    live.set_parameters({"real_time_factor": factor})
    live.pause(False)
    live.schedule('[{"service": "reset", "more": true}]')
    for k in range(5):
        time.sleep(0.3)  # 1.5 s in all: each list keeps it for another second
        live.schedule(json.dumps([{"more": True, "t": 0.02 - 0.001 * k, "impulse": [1e-3, 0, 0]}]))
        assert live.state.time_ns == 0
    live.schedule("[{t: 0.001, impulse: [1, 0, 0]}]")
    while live.state.time_ns < 3 * PERIOD_NS:
        time.sleep(0.01)
    live.pause(True)
    told = [json.loads(line) for line in watcher.lines]
    assert [event["time_ns"] for event in told if event["kind"] == "poke"][-6:] == [
        k * 10**6 for k in (1, 16, 17, 18, 19, 20)
    ]
    assert live.loop.commands.late == 0


def test_time_goes_on_with_a_warning_where_a_list_that_was_announced_does_not_come(live):
    warned = []
    live.endpoints.warn = warned.append
    live.pause(False)
    live.schedule('[{"service": "reset", "more": true}]')
    begun = time.monotonic()
    while live.state.time_ns == 0:
        time.sleep(0.01)
    assert time.monotonic() - begun > 0.9
    assert len(warned) == 1 and "nothing came for 1 s" in warned[0]


@pytest.mark.parametrize("paused", [False, True])
def test_without_anybody_who_looks_the_thread_sleeps_until_something_is_due(monkeypatch, paused):
    scenario = make_scenario({"mesh": "t_handle", "publish_rate": 1000.0, "start_paused": paused})
    live, ticks = LiveSimulation(scenario), []
    tick = live.loop.tick
    monkeypatch.setattr(live.loop, "tick", lambda arrived: (ticks.append(time.monotonic()), tick(arrived)))
    live.start()
    time.sleep(3.0)
    assert len(ticks) <= 10
    if not paused:
        # What is scheduled acts when it is due, though nobody waits for a state.
        due_ns = live.call(lambda: live.loop.simulation.time_ns) + 200_000_000
        live.schedule(json.dumps({"t": due_ns / 1e9, "wrench": {"force": [1, 0, 0], "duration": 0.1}}))
        begun = time.monotonic()
        while not live.loop.simulation.events.count:
            time.sleep(0.001)
        assert time.monotonic() - begun < 0.45, "before the next of the rare wake-ups"
        assert live.loop.pace.real_time_lost_s == 0.0 and live.loop.pace.overruns == 0
    live.stop()


def test_in_lockstep_a_refused_message_steps_too(live):
    live.set_parameters({"lockstep": True})
    for command in (
        WrenchCommand(True, parse_frame("world@nowhere"), (1.0, 0.0, 0.0), ZERO),
        ThrusterCommand((1.0, 2.0, 3.0)),
    ):
        reached_ns = live.state.time_ns
        with pytest.raises(CommandRefused):
            submit(live, command)
        deadline = time.monotonic() + 20.0
        while live.state.time_ns < reached_ns + PERIOD_NS:
            assert time.monotonic() < deadline, "no step within 20 s"
            time.sleep(0.01)


def test_two_simulations_in_one_process_have_nothing_in_common(live):
    other = LiveSimulation(make_scenario({"mesh": "hammer", "start_paused": True}), "other")
    other.start()
    submit(live, WrenchCommand(False, parse_frame("world@tip;impulse"), (1.0, 0.0, 0.0), ZERO))
    with pytest.raises(CommandRefused):
        live.schedule("{t: -1, force: [1, 0, 0]}")
    live.step()
    other.step(2)
    assert live.state.linear_velocity[0] > 0.0 and live.state.time_ns == PERIOD_NS
    assert not other.state.row[7:13].any() and other.state.time_ns == 2 * PERIOD_NS
    assert not other.loop.commands.received and not other.loop.simulation.refused
    assert other.loop.simulation.events.count == 1, "its own step"
    other.stop()


def test_time_runs_pauses_steps_and_starts_anew(live, watcher):
    live.step(3)
    assert live.state.time_ns == 3 * PERIOD_NS and live.paused
    live.pause(False)
    with pytest.raises(InputError, match="pause it first"):
        live.step()
    while live.state.time_ns < 10 * PERIOD_NS:
        time.sleep(0.01)
    live.pause(True)
    reached_ns = live.state.time_ns
    time.sleep(0.05)
    assert live.state.time_ns == reached_ns
    live.reset()
    assert live.state.time_ns == 0
    assert watcher.times[:10] == [k * PERIOD_NS for k in range(1, 11)]


def test_a_request_that_waits_at_the_end_is_refused_and_so_is_one_that_comes_later(live):
    within, ended, refused = threading.Event(), threading.Event(), []

    def publish(_) -> None:
        within.set()
        ended.wait()

    live.endpoints.publish = publish
    within.wait()

    def ask() -> None:
        with pytest.raises(InputError, match="request: the simulation has ended"):
            live.call(int)
        refused.append(True)

    asking, stopping = threading.Thread(target=ask), threading.Thread(target=live.stop)
    for thread, begun in ((asking, lambda: live._requests), (stopping, lambda: live._stopping)):
        thread.start()
        while not begun():
            time.sleep(0.01)
    ended.set()
    stopping.join()
    asking.join()
    ask()
    assert refused == [True, True]


def test_before_the_start_one_request_is_served_after_another(monkeypatch):
    """The page's first browser may come while the node announces its body."""
    live, guest = LiveSimulation(make_scenario({"mesh": "t_handle"})), Watcher(Logged)
    coming, watch = threading.Thread(target=live.add_observer, args=(guest,)), live.loop.watch

    def watch_late(observer) -> None:
        monkeypatch.undo()
        coming.start()
        coming.join(0.3)  # in vain
        watch(observer)

    monkeypatch.setattr(live.loop, "watch", watch_late)
    live.announce()
    coming.join()
    live.reset()
    assert [json.loads(line)["kind"] for line in guest.lines] == ["reset"]


def test_what_anybody_sets_is_told_so_that_the_nodes_own_parameters_follow(live):
    told = []
    live.endpoints.parameters_changed = lambda: told.append(live.scenario.parameters.mass)
    live.set_parameters({"mass": 3.0})
    assert told == [3.0]


def test_an_observer_that_comes_in_flight_is_told_and_one_that_leaves_is_not(live, watcher):
    live.step(2)
    guest = Watcher(Published)
    live.add_observer(guest)
    live.step(2)
    live.remove_observer(guest)
    live.step(2)
    assert [t // PERIOD_NS for t in watcher.times] == [1, 2, 3, 4, 5, 6]
    assert [t // PERIOD_NS for t in guest.times] == [3, 4]


def test_a_recording_that_begins_at_time_0_after_other_commands_is_not_taken_for_a_changed_one(live, tmp_path):
    path = tmp_path / "flight.mcap"
    live.reset()
    live.schedule("{t: 0, impulse: [1, 0, 0]}")
    live.set_parameters({"record": str(path)})
    live.pause(False)
    while not live.state.time_ns:
        time.sleep(0.01)
    live.reset()
    live.pause(True)
    live.step(3)
    live.stop()
    first, second = read_runs(path)
    assert first.times[0] == PERIOD_NS and json.loads(first.lines[0])["content"] == {"record": str(path)}
    with pytest.raises(NotVerifiableError, match="begins at 0.01 s, in the middle of a run"):
        verify(first)
    assert verify(second) is None


def test_a_recording_that_is_begun_with_another_change_in_a_run_without_events_is_verified(tmp_path):
    path = tmp_path / "flight.mcap"
    live = LiveSimulation(make_scenario({"mesh": "t_handle", "initial.angular_velocity": [0.1, 5.0, 0.1]}))
    live.announce()
    live.start()
    while not live.state.time_ns:
        time.sleep(0.01)
    live.set_parameters({"record": str(path), "mass": 5.0, "angular_damping": 1e-3})
    began_ns = live.state.time_ns
    while live.state.time_ns < began_ns + 5 * PERIOD_NS:
        time.sleep(0.01)
    live.stop()
    (run,) = read_runs(path)
    assert json.loads(run.lines[0])["content"]["mass"] == 5.0
    assert verify(run) is None


def test_a_reset_between_the_requests_that_begin_a_recording_leaves_it_verifiable(live, tmp_path, monkeypatch):
    path, call, resets = tmp_path / "flight.mcap", live.call, iter([False, True])

    def call_and_reset(function):
        found = call(function)
        if next(resets, False):
            call(live.loop.reset)
        return found

    live.step()
    monkeypatch.setattr(live, "call", call_and_reset)
    live.set_parameters({"record": str(path)})
    monkeypatch.undo()
    live.step(2)
    live.stop()
    run = read_runs(path)[-1]
    assert json.loads(run.lines[0])["kind"] == "reset"
    assert verify(run) is None


def test_a_recording_that_takes_the_place_of_a_lost_one_is_not_given_up_for_it(live, tmp_path, monkeypatch):
    live.set_parameters({"record": str(tmp_path / "lost.mcap")})
    live._recorders[0].error, call = "lost", live.call

    def call_later(function):
        monkeypatch.undo()
        live.set_parameters({"record": str(tmp_path / "next.mcap")})
        return call(function)

    monkeypatch.setattr(live, "call", call_later)
    live.give_up_failed_recording()
    assert live.scenario.parameters.record == str(tmp_path / "next.mcap")


def test_a_recording_that_is_lost_while_time_stands_can_be_begun_again_and_ended_in_flight(live, tmp_path):
    path = tmp_path / "flight.mcap"
    live.set_parameters({"record": str(path)})
    path.unlink()
    deadline = time.monotonic() + 60.0
    while live.scenario.parameters.record:
        assert time.monotonic() < deadline, "nobody has noticed"
        time.sleep(0.05)
        live.give_up_failed_recording()
    live.step()
    assert live.scenario.parameters.record == ""
    live.set_parameters({"record": str(path)})
    live.step(2)
    live.set_parameters({"record": ""})
    live.step()
    (run,) = read_runs(path)
    assert (np.asarray(run.times) // PERIOD_NS).tolist() == [2, 3]


def test_a_lost_recording_is_begun_again_by_its_own_name(live, tmp_path):
    path = tmp_path / "flight.mcap"
    live.set_parameters({"record": str(path)})
    live._recorders[0].error = "lost"
    live.set_parameters({"record": str(path)})
    live.step()
    live.set_parameters({"record": ""})
    assert len(read_runs(path)) == 1
    assert not live.recording_trouble


def test_what_was_done_behind_the_last_state_is_in_a_converted_session_too(live, tmp_path):
    path, converted = tmp_path / "flight.mcap", tmp_path / "converted.mcap"
    live.set_parameters({"record": str(path), "wrench_timeout": 0.05})
    live.schedule("{t: 0, wrench: {force: [1, 0, 0]}}")
    live.step(4)
    live.schedule("{t: 0, set: {mass: 2.0}}")
    live.schedule("{t: 0, impulse: [1, 0, 0]}")
    # Time comes to where the wrench times out, and no further.
    live.call(lambda: live.loop.simulation.advance(5 * PERIOD_NS))
    live.call(lambda: live.loop.simulation.log("pause", {"data": True}))
    live.stop()
    (run,) = read_runs(path)
    assert [json.loads(line)["kind"] for line in run.lines[-3:]] == ["set", "poke", "pause"]
    record([run], converted)
    (again,) = read_runs(converted)
    assert again.lines == run.lines
    assert verify(run) is None and verify(again) is None
    assert len(script_of_session(run).entries) == 4


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_file_that_is_being_recorded_is_refused_for_a_second_recording_by_any_name_and_anybody(
    live, tmp_path, ending
):
    path = tmp_path / f"flight{ending}"
    live.set_parameters({"record": str(path)})
    live.step(3)
    other = LiveSimulation(make_scenario({"mesh": "t_handle", "record": str(path)}))
    for begin in (lambda: live.set_parameters({"record": f"{tmp_path}/./flight{ending}"}), other.announce):
        with pytest.raises(InputError, match="another file than the one that is being recorded"):
            begin()
    live.step(2)
    live.set_parameters({"record": ""})
    if ending == ".mcap":
        (run,) = read_runs(path)
        assert (np.asarray(run.times) // PERIOD_NS).tolist() == [1, 2, 3, 4, 5]
    other.announce()
    other.stop()


def test_a_step_of_a_motion_that_has_failed_is_refused_with_the_reason(live):
    live.schedule("{t: 0, state: {linear_velocity: [9.9e99, 0, 0], position: [9.9e99, 0, 0]}}")
    for _ in range(2):
        with pytest.raises(InputError, match="until a reset: the motion passed 1e\\+100"):
            live.step(100)
    with pytest.raises(InputError, match="pause: stopped in the last good state until a reset"):
        live.pause(False)
    assert live.paused
    live.reset()
    assert live.step() == PERIOD_NS
    live.pause(False)
    assert not live.paused


@pytest.mark.parametrize("behind", ["", "{t: 0.156, force: [0, 0, 1]}"])
def test_a_recording_of_a_motion_that_failed_is_verified_with_what_was_asked_for_afterwards(live, tmp_path, behind):
    """It fails at 0.156 s, where a command acts or none."""
    path = tmp_path / "flight.mcap"
    live.set_parameters({"record": str(path), "integrator": "euler", "publish_rate": 10.0})
    live.schedule(f"[{{t: 0.15, state: {{angular_velocity: [1e4, 2e4, 3e4]}}}}, {behind}]")
    for _ in range(2):
        with pytest.raises(InputError, match="until a reset"):
            live.step(3)
        assert live.state.time_ns == 156_000_000
    live.stop()
    (run,) = read_runs(path)
    assert json.loads(run.lines[-1])["kind"] == "step"
    assert list(run.events)[-1][0] > run.end_ns
    assert verify(run) is None


def test_a_run_after_a_reset_that_takes_a_waiting_change_of_the_mesh_with_it_is_verified(live, tmp_path):
    path = tmp_path / "flight.mcap"
    live.set_parameters({"record": str(path)})
    live.step(2)
    live.set_parameters({"mesh": "hammer"})
    live.reset()
    live.schedule("{t: 0, at: {vertex: 3}, push: 1}")
    live.step(2)
    live.set_parameters({"record": ""})
    assert verify(read_runs(path)[-1]) is None


@needs_rerun
def test_a_view_comes_and_goes_beside_a_recording_that_goes_on(live, tmp_path):
    from rerun_flight import drawn, verified

    session, view = tmp_path / "flight.mcap", tmp_path / "flight.rrd"
    for names in (f"{session}", f"{session},{view}", f"{session}", ""):
        live.set_parameters({"record": names})
        live.step(2)
    (run,) = read_runs(session)
    assert (np.asarray(run.times) // PERIOD_NS).tolist() == [1, 2, 3, 4, 5, 6]
    assert run.complete and verify(run) is None
    assert verified(view) and drawn(view) == [3 * PERIOD_NS, 4 * PERIOD_NS]


@needs_rerun
@pytest.mark.parametrize("lost", ["mcap", "rrd"])
def test_of_recording_and_view_one_goes_on_where_the_other_is_lost(live, tmp_path, lost):
    from rerun_flight import drawn, verified

    files = {ending: tmp_path / f"flight.{ending}" for ending in ("mcap", "rrd")}
    live.set_parameters({"record": f"{files['mcap']}, {files['rrd']}"})
    live.step(2)
    files[lost].unlink()
    deadline = time.monotonic() + 60.0
    while "," in live.scenario.parameters.record:
        assert time.monotonic() < deadline, "nobody has noticed"
        time.sleep(0.05)
        live.give_up_failed_recording()
    (left,) = (file for ending, file in files.items() if ending != lost)
    assert live.scenario.parameters.record == str(left)
    assert str(files[lost]) in live.recording_trouble
    live.step(2)
    live.set_parameters({"record": ""})
    assert not live.recording_trouble
    if lost == "rrd":
        (run,) = read_runs(left)
        assert run.complete and verify(run) is None
        assert (np.asarray(run.times) // PERIOD_NS).tolist() == [1, 2, 3, 4]
    else:
        assert verified(left) and drawn(left) == [k * PERIOD_NS for k in (1, 2, 3, 4)]


def test_a_recording_is_begun_when_nothing_else_can_be_refused_any_more(tmp_path):
    path = tmp_path / "flight.mcap"
    path.write_bytes(b"\x89MCAP of an earlier flight")
    live = LiveSimulation(make_scenario({"mesh": "t_handle", "record": str(path)}))
    assert path.read_bytes() == b"\x89MCAP of an earlier flight"
    live.announce()
    live.stop()
    assert read_runs(path)[0].complete


@needs_rerun
def test_a_recording_from_the_start_shows_the_string_that_is_tied_from_the_start(tmp_path):
    from rerun_flight import cells

    from rigid_proto_ros.picture import style

    path = str(tmp_path / "flight.rrd")
    tied = {"string.attached": True, "string.target": [0.0, 0.0, 1.0]}
    live = LiveSimulation(make_scenario({"mesh": "t_handle", "start_paused": True, "record": path, **tied}))
    live.announce()
    live.start()
    live.step(2)
    live.stop()
    times, energies = cells(path, style.ENERGY, "Scalars:scalars")
    assert len(times) == 2 and cells(path, style.STRING, "LineStrips3D:strips")[0] == times
    # Of its 50 N/m, stretched by 1 m: 25 J, part of which the body has after 10 ms.
    total, *_, string = energies[0]
    assert total == pytest.approx(25.0, rel=0.1) and 10.0 < string < total


def test_a_reset_tells_of_the_body_anew_with_its_own_time(live):
    bodies = Watcher(BodyChanged)
    live.step(3)
    live.add_observer(bodies)
    live.reset()
    assert bodies.times == [3 * PERIOD_NS, 0]


@pytest.mark.parametrize("end", ["stop", "reset", "another recording"])
def test_a_floor_of_the_accuracy_that_arises_in_the_last_moments_is_in_the_recording(live, tmp_path, end):
    path = tmp_path / "flight.mcap"
    live.set_parameters({"record": str(path), "accuracy": 1e-12})
    live.step()
    # What a flight costs and is held to is told every 50 ms; this comes 20 ms after it was.
    live.schedule("{t: 0, angular_impulse: [0.5, 0.7, -0.3]}")
    live.step(2)
    floor = live.call(lambda: live.loop.simulation.accuracy_floor)
    assert "rounding of the spin" in floor
    if end == "reset":
        live.reset()
    elif end == "another recording":
        live.set_parameters({"record": str(tmp_path / "next.mcap")})
    live.stop()
    assert read_runs(path)[0].accuracy_floor == floor


def slice_of(thread: int) -> int:
    """Of this thread, by its number in the system [ns]."""
    attributes = ctypes.create_string_buffer(48)
    number = {"x86_64": 315, "aarch64": 275}[platform.machine()]
    assert ctypes.CDLL(None).syscall(number, thread, attributes, 48, 0) == 0  # sched_getattr
    return struct.unpack("IIQiIQQQ", attributes.raw)[5]


@pytest.mark.skipif(
    not sys.platform.startswith("linux") or tuple(map(int, platform.release().split(".")[:2])) < (6, 12),
    reason="time slices can be chosen on Linux 6.12 and later",
)
def test_the_physics_thread_asks_for_short_time_slices(live):
    (thread,) = (thread for thread in threading.enumerate() if thread.name == "physics")
    live.call(lambda: None)
    assert slice_of(thread.native_id) == SLICE_NS < slice_of(threading.get_native_id())


@pytest.mark.parametrize("changes", [{}, {"body_frame": "thing"}, {"world_frame": "map"}])
def test_a_contact_that_a_frame_would_hide_is_refused(live, changes):
    for frame in (changes.get("world_frame", "world"), changes.get("body_frame", "bolt")):
        if frame != "world":
            scenario = make_scenario({"mesh": "t_handle", **changes, f"contacts.{frame}": [0.0, 0.0, 0.07]})
            with pytest.raises(InputError, match=f"contacts.{frame}"):
                LiveSimulation(scenario, name="bolt")
    with pytest.raises(InputError, match="contacts.rigid_body"):
        live.begin(make_scenario({"mesh": "t_handle", "contacts.rigid_body": [0.0, 0.0, 0.07]}))
    assert "tip" in live.scenario.parameters.contacts
