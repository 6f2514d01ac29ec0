# SPDX-License-Identifier: MIT
"""Simulated time: pause, step, reset, pace, clocks, and what a command's stamp means."""

import math
import time

import pytest
from command_rig import point_message, wrench_message
from conftest import held_domain
from ros_client import RosClient, stamp_ns
from ros_process import start_node

from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.simulation import Simulation

SECOND = 10**9
MS = 10**6


def position(pose: dict) -> list[float]:
    return [*pose["pose"]["position"].values(), *pose["pose"]["orientation"].values()]


def test_while_paused_ten_states_a_second_go_out_with_the_frozen_stamp_and_commands_act_at_once(rig):
    frozen_ns = rig.stand()
    before = rig.heard("twist", last=1)[0]["twist"]
    rig.publish("poke", wrench_message(0, "world;impulse", (1e-3, 0.0, 0.0)))
    (poke,) = rig.wait_event("poke")
    assert poke["time_ns"] == frozen_ns
    rig.forget("pose", "twist")
    rig.until(lambda: rig.heard_count("pose") >= 4 <= rig.heard_count("twist"), "states while paused")
    assert {stamp_ns(m) for topic in ("pose", "twist") for m in rig.heard(topic)} == {frozen_ns}
    assert len({tuple(position(m)) for m in rig.heard("pose")}) == 1
    assert all(m["twist"]["linear"]["x"] > before["linear"]["x"] for m in rig.heard("twist"))
    # Parameters and what moves say the same.
    rig.set(mass=0.5)
    assert rig.get("mass") == {"mass": 0.5}
    (changed,) = rig.wait_event("set")
    assert changed["time_ns"] == frozen_ns
    rig.until(lambda: rig.heard("inertia", last=1)[0]["inertia"]["m"] == 0.5, "the inertia")
    assert rig.diagnostics()["state"] == "paused"

    def wait_for(count: int) -> float:
        """When so many more states have been heard."""
        before = rig.heard_count("pose")
        rig.until(lambda: rig.heard_count("pose") >= before + count, "states of a paused node")
        return time.monotonic()

    def counted() -> bool:
        start = wait_for(1)
        return 0.9 < wait_for(10) - start < 1.1

    # On a busy machine time is lost, so any second that goes as it should will do.
    rig.until(counted, "a second with ten states")
    assert rig.pause(False)["success"]


def test_step_goes_on_by_one_publication_period_and_is_refused_while_running(rig):
    assert not rig.trigger("step")["success"]
    rig.start_over(paused=True)
    rig.publish("poke", wrench_message(0, "world@tip;impulse", (1e-3, 0.0, 0.0)))
    rig.until_received(rig.sent)
    for k in range(1, 4):
        answer = rig.trigger("step")
        assert answer["success"]
        rig.until(lambda k=k: rig.heard("pose", last=1, stamp=k * 10 * MS), "the next state")
    assert rig.wait_event("poke")[0]["time_ns"] == 0
    rig.forget("pose")
    assert stamp_ns(rig.until(lambda: rig.heard("pose"), "a state")[-1]) == 30 * MS
    # From an instant between two publications to the next one.
    rig.set(publish_rate=40.0)
    rig.trigger("step")
    rig.until(lambda: rig.heard("pose", last=1, stamp=50 * MS), "the state at 50 ms")


@pytest.mark.parametrize("paused", [True, False], ids=["paused", "running"])
def test_reset_takes_time_and_state_back_drops_what_was_to_come_and_keeps_parameters_and_counters(rig, paused):
    rig.set(wrench_timeout=0.0, string__timeout=0.0, initial__position=[1.0, 2.0, 3.0], linear_damping=0.5)
    rig.publish("wrench", wrench_message(0, "world@tip", (1e-3, 0.0, 0.0)))
    rig.publish("string/target", point_message(0, "", (1.0, 0.0, 0.0)))
    rig.wait_event("wrench")
    rig.wait_event("string_target")
    now = rig.now_ns()
    rig.publish("poke", wrench_message(now + 1800 * SECOND, "tip", (1e-3, 0.0, 0.0)))
    before = rig.counters()
    rig.start_over(paused=paused)
    rig.until(lambda: rig.heard_count("pose") >= 3, "states")
    if not paused:
        rig.until(lambda: rig.now_ns() >= 200 * MS, "time going on")
        # Nothing pulls, nothing pushes: it flies straight on from where it was put.
        pose, twist = rig.state_at(200 * MS)
        assert list(pose["pose"]["position"].values()) == [1.0, 2.0, 3.0]
        assert list(twist["twist"]["linear"].values()) == [0.0, 0.0, 0.0]
    else:
        assert {stamp_ns(m) for m in rig.heard("pose")} == {0}
        assert position(rig.heard("pose", last=1)[0])[:3] == [1.0, 2.0, 3.0]
    after = rig.counters()
    assert {k: v for k, v in after.items() if k.endswith("_received") or k.startswith("refused")} == {
        k: v for k, v in before.items() if k.endswith("_received") or k.startswith("refused")
    }
    assert rig.get("linear_damping", "wrench_timeout") == {"linear_damping": 0.5, "wrench_timeout": 0.0}
    assert rig.diagnostics()["state"] == ("paused" if paused else "flying")


def test_stamps_zero_and_past_mean_now_and_one_of_the_systems_clock_is_told_apart(rig):
    before = rig.counters()
    rig.until(lambda: rig.now_ns() > 50 * MS, "some time")
    wall = time.time_ns()
    day = 24 * 3600 * SECOND
    sent_after = rig.now_ns()
    stamps = {"zero": 0, "past": 1, "before all": -5 * SECOND, "now": wall, "tomorrow": wall + day - 60 * SECOND}
    for stamp in stamps.values():
        rig.publish("poke", wrench_message(stamp, "world@com;impulse", (1e-6, 0.0, 0.0)))
    rig.publish("poke", wrench_message(wall + day + 3600 * SECOND, "world@com;impulse", (1e-6, 0.0, 0.0)))
    gained = rig.gained(before)
    assert gained == {"late": 2, "wall_stamp": 2, "refused_total": 1, "refused_stamp": 1}
    # Told once in the node's life, and counted from then on.
    assert rig.node_process.errors.count("stamped with the system's clock") == 1
    pokes = rig.wait_event("poke", 5)
    assert len(pokes) == 5
    acted_before = int(rig.diagnostics()["sim_time_ns"])
    assert all(sent_after <= event["time_ns"] <= acted_before for event in pokes)
    assert {event["content"]["stamp_ns"] for event in pokes} == set(stamps.values())


def test_a_stamp_ahead_acts_at_exactly_that_nanosecond(rig):
    rig.set(schedule_horizon=2.0)
    rig.start_over(paused=True)
    before = rig.counters()
    rig.publish("poke", wrench_message(123_456_789, "world@com;impulse", (1e-6, 0.0, 0.0)))
    rig.publish("poke", wrench_message(2 * SECOND, "world@com;impulse", (1e-6, 0.0, 0.0)))
    rig.publish("poke", wrench_message(2 * SECOND + 1, "world@com;impulse", (1e-6, 0.0, 0.0)))
    rig.until_received(rig.sent)
    rig.pause(False)
    assert [event["time_ns"] for event in rig.wait_event("poke", 2)] == [123_456_789, 2 * SECOND]
    assert rig.gained(before) == {"refused_total": 1, "refused_stamp": 1}


def test_the_pace_is_the_real_time_factor_and_changes_no_bit_of_the_motion(rig):
    states = []

    def pace() -> float:
        """Simulated time over wall time, between two reports."""
        first, then = rig.diagnostics(), rig.diagnostics()
        return (int(then["sim_time_ns"]) - int(first["sim_time_ns"])) / (then["stamp_ns"] - first["stamp_ns"])

    # On a busy machine time is lost, so any second that goes as it should will do.
    for factor, slowest, fastest in ((0.25, 0.2, 0.3), (4.0, 3.2, 4.8), (0.0, 10.0, math.inf)):
        rig.set(real_time_factor=factor)
        rig.start_over(paused=False)
        states.append(rig.state_at(200 * MS))
        rig.until(lambda at_least=slowest, at_most=fastest: at_least < pace() < at_most, f"pace of {factor}")
    assert states[0] == states[1] == states[2]


def test_clock_is_published_on_request_with_the_states_stamps(rig):
    assert rig.set(publish_clock=True)[0][0]
    rig.listen("/clock", best_effort=True)

    def clocks() -> list[int]:
        return [m["clock"]["sec"] * SECOND + m["clock"]["nanosec"] for m in rig.heard("/clock")]

    rig.until(lambda: rig.heard_count("/clock") >= 20 and clocks()[-1] >= 500 * MS, "/clock")
    assert clocks() == sorted(clocks())
    assert all(c % (10 * MS) == 0 for c in clocks())
    assert rig.set(publish_clock=False)[0][0]
    rig.start_over(paused=False)
    rig.forget("/clock")
    rig.until(lambda: rig.now_ns() >= 300 * MS, "time going on")
    # Those that come late on a busy machine are of the time before the reset.
    assert all(c >= 500 * MS for c in clocks())
    # On again, by the one publisher.
    assert rig.set(publish_clock=True)[0][0]
    rig.until(lambda: rig.heard_count("/clock") >= 5, "/clock again")
    assert len(rig.own.get_publishers_info_by_topic("/clock")) == 1


def test_with_use_sim_time_simulated_time_follows_the_clock_of_another(ros_environment, tmp_path):
    """From where it is when first heard; no time is lost or overrun when it goes in leaps; set back, time goes on.
    Stamps are its time, those of commands too.
    """
    with held_domain() as domain:
        environment = {**ros_environment, "ROS_DOMAIN_ID": str(domain)}
        values = {"use_sim_time": True, "initial.linear_velocity": [1.0, 0.0, 0.0]}
        node = start_node(environment, tmp_path / "node", values, name="often_reporting_node")
        client = RosClient(environment)
        try:
            client.listen("pose", "events")
            client.listen("/diagnostics")
            client.advertise("poke", "schedule")
            client.advertise("/clock", depth=1)

            clock = {"ns": 0}

            def tick(clock_ns: int) -> bool:
                """/clock keeps no message for who misses it: each wait says the time again."""
                clock["ns"] = clock_ns
                sec, nanosec = divmod(clock_ns, SECOND)
                client.publish("/clock", {"clock": {"sec": sec, "nanosec": nanosec}})
                return True

            def report() -> dict:
                """The second new one; stamps are of /clock here, so they don't tell when it was made."""
                before = client.heard_count("/diagnostics")
                client.until(lambda: tick(clock["ns"]) and client.heard_count("/diagnostics") >= before + 2, "a report")
                return client.all_diagnostics(last=1)[0]

            def reaches(simulated_ns: int) -> None:
                client.until(
                    lambda: (
                        tick(clock["ns"])
                        and (reports := client.all_diagnostics(last=1))
                        and int(reports[0]["sim_time_ns"]) == simulated_ns
                    ),
                    f"{simulated_ns} ns",
                )

            start = 5000 * SECOND
            tick(start)
            assert report()["sim_time_ns"] == "0"
            tick(start + 500 * MS)
            reaches(500 * MS)
            client.publish("poke", wrench_message(start + 700 * MS, "world;impulse", (1e-3, 0.0, 0.0)))
            client.schedule("{t: 0.8, impulse: [1.0e-3, 0, 0]}")
            client.until(lambda: tick(clock["ns"]) and report()["commands_received"] == "2", "two commands")
            tick(start + 1234 * MS)
            reaches(1234 * MS)
            tick(start + 100 * MS)
            report()
            tick(start + 300 * MS)
            reaches(1434 * MS)
            last = report()
            assert (last["overruns"], last["real_time_lost_s"]) == ("0", "0.0")
            # /clock's time, set back with it; at 0 before it was heard.
            later = start + 100 * MS - 1234 * MS
            wanted = [start + k * 10 * MS for k in range(124)] + [later + k * 10 * MS for k in range(124, 144)]
            client.until(lambda: client.newest_ns("pose") == wanted[-1], "last state")
            stamps = [stamp_ns(m) for m in client.heard("pose")]
            assert [s for s in stamps if s not in (0, start)] == wanted[1:]
            assert last["stamp_offset_ns"] == str(later)
            assert last["clock_jumps"] == "1" and "/clock jumped by -1.134 s" in node.errors
            client.until(lambda: len(client.events()) >= 5, "last event")
            found = [(e["kind"], e["time_ns"], e["content"].get("offset_ns")) for e in client.events()]
            assert found == [
                ("clock", 0, start),
                ("poke", 700 * MS, None),
                ("poke", 800 * MS, None),
                ("jump", 1234 * MS, None),
                ("clock", 1234 * MS, later),
            ]
        finally:
            client.close()
            assert node.end() == 0


def test_asleep_states_still_go_out_and_it_wakes_at_a_command(rig):
    rig.set(initial__angular_velocity=[0.0] * 3, initial__linear_velocity=[0.0] * 3, gravity=[0.0] * 3)
    rig.start_over(paused=False)
    assert rig.diagnostics()["state"] == "sleeping"
    rig.until(lambda: rig.now_ns() > 0, "time going on")
    rig.forget("pose")
    rig.until(lambda: rig.heard_count("pose") >= 10, "states of a sleeper")
    stamps = [stamp_ns(m) for m in rig.heard("pose")]
    assert stamps == sorted(set(stamps))
    rig.publish("poke", wrench_message(0, "world;impulse", (1.0, 0.0, 0.0)))
    rig.wait_event("poke")
    assert rig.diagnostics()["state"] == "flying"


def test_a_runaway_stops_in_the_last_good_state_says_so_and_flies_again_after_a_reset(rig):
    rig.set(integrator="rk4", step=0.1)
    rig.set(angular_damping=1e6)
    report = rig.until(lambda: (r := rig.diagnostics())["state"] == "paused" and r, "the stop")
    assert report["level"] == 1 and "1e+100" in report["message"]
    pose = rig.heard("pose", last=1)[0]
    assert all(abs(x) < 1e100 for x in position(pose))
    rig.set(angular_damping=0.0, step=0.001)
    rig.start_over(paused=False)
    rig.until(lambda: rig.now_ns() >= 100 * MS, "time going on")
    assert rig.diagnostics()["state"] == "flying"
    offline = Simulation(make_scenario(rig.scene).setup).advance(100 * MS)
    assert position(rig.state_at(100 * MS)[0]) == offline.row[:7].tolist()
