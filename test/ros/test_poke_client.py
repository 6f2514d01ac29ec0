# SPDX-License-Identifier: MIT
"""poke_client: every entry of a script, sent by the real client to a real node, and what it says of what went wrong."""

import json
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import Parameter
from ros_client import RosClient, stamp_ns
from ros_process import RosProcess, from_source, run
from std_msgs.msg import String

from rigid_proto_ros.base.bundled import example_path
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.ros import script_sender
from rigid_proto_ros.ros.poke_client import main as poke_client
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.session.messages import PROJECTIONS

SECOND = 10**9
EVERY_ENTRY = """
- {t: 0.1, at: tip, push: 0.05}
- {t: 0.2, at: {vertex: 7}, force: [0.02, 0.0, 0.0], duration: 0.3}
- {t: 0.3, at: left, force: [0.0, 0.0, 0.02], torque: [0.0, 1.0e-5, 0.0], axes: body}
- {t: 0.4, at: {point: [0.0, 0.0, 0.07]}, impulse: [0.001, 0.0, 0.0], angular_impulse: [0.0, 0.0, 1.0e-6]}
- {t: 0.5, at: {ray: {origin: [0.0, 0.0, 1.0], direction: [0.0, 0.0, -1.0]}}, force: [0.0, 0.0, -0.02]}
- {t: 0.6, at: origin, torque: [0.0, 0.0, 1.0e-4], duration: 0.2}
- {t: 0.7, angular_impulse: [0.0, 0.0, 1.0e-6]}
- {t: 0.8, wrench: {at: tip, force: [0.0, 0.01, 0.0], duration: 1.2}}
- {t: 2.1, wrench: {at: left, push: 0.01}}
- {t: 2.5, string: {attach: tip, target: [0.0, 0.0, 0.1]}}
- {t: 2.7, string: {target: [0.0, 0.05, 0.1]}}
- {t: 2.8, string: release}
- {t: 2.9, at: {point: [0.0, 0.0, 0.07]}, impulse: [0.0, 0.0001, 0.0]}
- {t: 2.9, set: {density: 9000.0, gravity: [0.0, 0.0, -0.1]}}
- {t: 2.9, at: com, impulse: [0.0, 0.0001, 0.0]}
- {t: 3.0, service: clear_wrench}
- {t: 3.1, at: com, impulse: [0.0001, 0.0, 0.0], repeat: 5, every: 0.1, jitter: 0.05, seed: 7}
"""


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "script.yaml"
    path.write_text(EVERY_ENTRY)
    return path


def test_a_dry_run_prints_every_message_that_would_go_out_and_needs_no_node(script, capsys):
    assert poke_client([str(script), "--dry-run"]) == 0
    lines = capsys.readouterr().out.splitlines()
    # One an instant, each an entry of a schedule or several.
    assert sum((parse_script(line) for line in lines), []) == parse_script(EVERY_ENTRY)
    assert len(lines) == 19 and '"at": "tip", "push": 0.05' in lines[0]


def times(text: str) -> list[int]:
    return [c.stamp_ns for c in parse_script(text)]


def test_repeats_come_every_so_often_and_jitter_is_the_same_for_the_same_seed_within_its_bounds():
    assert times("[{t: 1, impulse: [1, 0, 0], repeat: 3, every: 0.25}]") == [SECOND, 5 * SECOND // 4, 3 * SECOND // 2]
    jittered = "[{t: 1, impulse: [1, 0, 0], repeat: 200, every: 1.0, jitter: 0.05, seed: %s}]"
    first = times(jittered % 7)
    assert first == times(jittered % 7) != times(jittered % 8)
    shifts = np.array(first) - SECOND * np.arange(1, 201)
    assert np.abs(shifts).max() <= SECOND // 20
    # Uniform: both ends are reached, and 200 of them hardly ever share a nanosecond.
    assert shifts.min() < -0.04 * SECOND and shifts.max() > 0.04 * SECOND and len(set(shifts)) > 190
    assert min(times("[{t: 0, impulse: [1, 0, 0], repeat: 50, every: 0.001, jitter: 0.02, seed: 1}]")) == 0
    for wrong in ("repeat: 2", "repeat: 1.5, every: 1", "jitter: -1", "repeat: 0", "every: x"):
        with pytest.raises(InputError):
            times(f"[{{t: 1, impulse: [1, 0, 0], {wrong}}}]")


@pytest.fixture
def client(rig, monkeypatch, capsys):
    """Runs poke_client to its end, in this process; returns its status and what it said."""
    monkeypatch.setenv("ROS_DOMAIN_ID", rig.environment["ROS_DOMAIN_ID"])

    def run_client(*arguments) -> tuple[int, str]:
        status = poke_client([*map(str, arguments), "--timeout", "120"])
        return status, capsys.readouterr().out

    return run_client


def flies_as_offline(rig, sent: list, end_ns: int, **changes) -> int:
    """Whether all states heard since the last reset are those of the script's own run, to the bit; how many they are."""
    offline = OfflineRun(make_scenario({**rig.scene, **changes}), sent)
    poses, twists = rig.heard("pose"), {stamp_ns(m): m["twist"] for m in rig.heard("twist")}
    backward = [k for k in range(1, len(poses)) if stamp_ns(poses[k]) < stamp_ns(poses[k - 1])]
    checked = 0
    for message in poses[backward[-1] if backward else 0 :]:
        time_ns = stamp_ns(message)
        if not offline.simulation.time_ns < time_ns <= end_ns or time_ns not in twists:
            continue
        assert offline.advance(time_ns)
        row = offline.simulation.state.row.tolist()
        for name, content in (("pose", message["pose"]), ("twist", twists[time_ns])):
            assert [x for part in content.values() for x in part.values()] == PROJECTIONS[name](row), time_ns
        checked += 1
    assert not offline.simulation.refused
    return checked


@pytest.mark.parametrize("paused", [False, True])
def test_with_reset_every_entry_moves_the_node_as_simulate_moves_it_to_the_bit(rig, script, paused):
    """By the installed program. Held wrenches with a duration outlast the timeout, 0.4 s here."""
    rig.set(real_time_factor=2.0, wrench_timeout=0.4)
    if paused:
        rig.pause(True)
    before, (flown_before,) = rig.counters(), rig.heard("twist", last=1)
    rig.forget("events")
    rig.forget("pose", "twist")
    done = run("poke_client", script, "--reset", "--timeout", 120, environment=rig.environment)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 late, 0 refused" in done.stdout
    sent = parse_script(EVERY_ENTRY)
    rig.state_at(4 * SECOND)
    assert stamp_ns(flown_before) < 4 * SECOND
    assert flies_as_offline(rig, sent, 4 * SECOND, wrench_timeout=0.4) > 300
    # Nothing was paused, a paused node goes on; the reset is an entry, too.
    kinds = [event["kind"] for event in rig.events() if event["kind"] in ("reset", "pause")]
    assert kinds == ["reset", "pause"][: 1 + paused]
    gained = rig.gained(before, "commands_received")
    rig.sent += gained["commands_received"]
    assert gained.keys() == {"commands_received"}
    assert len(sent) + 1 <= gained["commands_received"] <= len(sent) + 20


@pytest.mark.stress
@pytest.mark.parametrize("factor", [1.0, 0.0])
def test_six_thousand_entries_after_a_reset_move_the_node_as_simulate_moves_it_to_the_bit(
    rig, client, tmp_path, factor
):
    text = "- {t: 0.0, impulse: [1.0e-4, 0, 0]}\n- {t: 0.5, at: tip, impulse: [0, 1.0e-6, 0], repeat: 5999, every: 0.001}\n"
    path = tmp_path / "many.yaml"
    path.write_text(text)
    rig.set(real_time_factor=factor)
    rig.forget("pose", "twist")
    status, said = client(path, "--reset")
    assert status == 0 and "sent 6000 poke; 0 late, 0 refused" in said, said
    rig.until(lambda: rig.now_ns() > 7 * SECOND, "the end")
    rig.sent = int(rig.diagnostics()["commands_received"])
    assert flies_as_offline(rig, parse_script(text), 7 * SECOND) > (300 if factor else 3)


def test_a_client_that_is_killed_while_it_sends_leaves_the_node_running(rig, tmp_path):
    path = tmp_path / "many.yaml"
    path.write_text("- {t: 30.0, impulse: [1.0e-6, 0, 0], repeat: 6000, every: 0.001}\n")
    for kills in range(1, 4):
        resets = len(rig.events("reset"))
        killed = RosProcess(
            "poke_client", path, "--reset", "--timeout", 120, environment=rig.environment, log=tmp_path / "killed"
        )
        rig.until(lambda before=resets: len(rig.events("reset")) > before, "the reset")
        killed.end(signal.SIGKILL)
        rig.forget("pose")
        rig.until(lambda: rig.newest_ns("pose") > SECOND // 5, "time going on")
        rig.until(lambda count=kills: rig.node_process.errors.count("nothing came for 1 s") == count, "the warning")
        assert rig.diagnostics()["state"] == "flying"
    rig.sent = int(rig.diagnostics()["commands_received"])


def test_with_reset_all_within_the_horizon_is_there_before_time_goes_on_and_the_rest_waits(rig, client, tmp_path):
    path = tmp_path / "long.yaml"
    path.write_text("".join(f"- {{t: {t}, impulse: [1.0e-6, 0, 0]}}\n" for t in (0, 8)))
    # Between the report that lets the second one go, at about 4 s, and its time lie some 2 s of a clock.
    rig.set_named({"real_time_factor": 2.0, "schedule_horizon": 5.0})
    status, said = client(path, "--reset")
    assert status == 0 and "0 late, 0 refused" in said, said
    rig.sent += 2


def test_without_reset_every_time_counts_from_now_and_the_lead_and_single_commands_come_from_the_line(
    rig, client, tmp_path, monkeypatch
):
    monkeypatch.setattr(script_sender, "STANDSTILL_S", 0.1)
    (tmp_path / "two.yaml").write_text("- {t: 0.1, impulse: [1.0e-6, 0, 0]}\n- {t: 0.35, impulse: [1.0e-6, 0, 0]}\n")
    # While time stands still, so that none comes late.
    rig.start_over(paused=True)
    start_ns = rig.now_ns()
    for words in (
        (tmp_path / "two.yaml",),
        ("poke", "--at", "tip", "--push", 5),
        ("wrench", "--force", 1, 0, 0, "--for", 2),
    ):
        status, said = client(*words, "--lead", 1)
        # Its time doesn't move: the client says so, and waits no longer for the last command to act.
        assert status == 0 and "but simulated time has stopped at 0 s" in said
    rig.sent += 2 + 1 + 1
    rig.until_received(rig.sent)
    rig.pause(False)
    pokes, (wrench,) = rig.wait_event("poke", 3), rig.wait_event("wrench")
    first, second = (e["time_ns"] for e in pokes if "impulse" in e["content"]["frame_id"])
    assert (first - start_ns, second - first) == (SECOND * 11 // 10, SECOND // 4)
    (push,) = (e["content"] for e in pokes if "impulse" not in e["content"]["frame_id"])
    assert (push["frame_id"], push["force"]) == ("normal@tip", [5.0, 0.0, 0.0])
    assert (wrench["content"]["frame_id"], wrench["content"]["force"]) == ("world@com;duration=2.0", [1.0, 0.0, 0.0])


def test_a_node_that_publishes_states_rarely_is_commanded_without_waiting_for_one(rig, client):
    rig.set(publish_rate=0.01)
    status, said = client("poke", "--at", "tip", "--push", 5, "--lead", 1)
    rig.sent += 1
    assert status == 0 and "sent 1 poke; 0 late, 0 refused" in said


def test_what_comes_late_or_is_refused_is_reported_and_makes_exit_1(rig, client, tmp_path):
    (tmp_path / "late.yaml").write_text("- {t: 0.0, impulse: [1.0e-6, 0, 0]}\n")
    # A ray that misses is refused when its time has come, long after all are sent.
    (tmp_path / "refused.yaml").write_text(
        "- {t: 0.0, at: nowhere, force: [1, 0, 0]}\n"
        "- {t: 4.0, at: {ray: {origin: [5, 5, 5], direction: [0, 0, 1]}}, force: [1, 0, 0]}\n"
    )
    rig.set(real_time_factor=4.0)
    status, said = client(tmp_path / "late.yaml", "--lead", 0)
    rig.sent += 1
    assert status == 1 and "1 late, 0 refused" in said
    status, said = client(tmp_path / "refused.yaml", "--reset")
    rig.sent += 2
    assert status == 1 and "0 late, 2 refused (1 frame, 1 ray_miss)" in said


def test_commands_that_somebody_elses_reset_drops_are_reported_and_make_exit_1(rig, client, tmp_path):
    (tmp_path / "dropped.yaml").write_text("- {t: 0.1, impulse: [1.0e-6, 0, 0]}\n- {t: 100, impulse: [1.0e-6, 0, 0]}\n")
    rig.set(real_time_factor=4.0)
    rig.forget("events")

    def reset() -> None:
        rig.wait_event("poke")
        rig.trigger("reset")

    with ThreadPoolExecutor() as other:
        resetting = other.submit(reset)
        status, said = client(tmp_path / "dropped.yaml", "--reset")
        resetting.result()
    rig.sent += 2
    assert status == 1 and "the node was reset or restarted meanwhile: commands that hadn't acted were dropped" in said


@pytest.mark.parametrize(
    ("script", "options"),
    [
        ("- {t: 9, impulse: [1.0e-6, 0, 0]}\n", ["--reset"]),
        # The last one lies too far ahead to be sent.
        ("- {t: 1, impulse: [1.0e-6, 0, 0]}\n- {t: 100, impulse: [1.0e-6, 0, 0]}\n", []),
    ],
)
def test_a_node_that_is_gone_before_the_last_command_acts_is_reported(
    script, options, ros_environment, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    monkeypatch.setattr(script_sender, "STALLED_S", 1.0)
    path = tmp_path / "poke.yaml"
    path.write_text(script)
    with ThreadPoolExecutor() as other, SlowNode(ros_environment, 1) as gone:
        sending = other.submit(poke_client, [str(path), "--node", "tester", *options, "--timeout", "0"])
        gone.until(lambda: gone.received, "the start")
        gone.close()
        assert sending.result() == 2
    assert capsys.readouterr().err.startswith("poke_client: --node: got '/tester'; accepted: ")


@pytest.mark.parametrize("option", [["--push", "5"], ["--for", "2"]])
def test_a_script_takes_none_of_the_options_of_a_single_command(script, option, capsys):
    assert poke_client([str(script), *option, "--dry-run"]) == 2
    assert f"{option[0]}: an option of poke and wrench" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["a b", "lab/"])
def test_a_name_that_no_node_can_have_is_refused_in_one_line(name, ros_environment, monkeypatch, capsys):
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    assert poke_client(["poke", "--at", "tip", "--push", "1", "--node", name]) == 2
    assert capsys.readouterr().err.startswith(f"poke_client: --node: got {name!r}; accepted: a node's name")


@pytest.mark.parametrize("argument", ["--bad", "-r", "-p x"])
def test_ros_arguments_that_are_none_are_refused_in_one_line(argument, capsys):
    words = ["poke", "--at", "tip", "--push", "1", "--ros-args", *argument.split()]
    assert poke_client(words) == 2
    (line,) = capsys.readouterr().err.splitlines()  # rcl writes one of its own beside it
    assert line.startswith("poke_client: ROS arguments: ")


class SlowNode(RosClient):
    """Stands in for a node that is slow to confirm: not before 500 wait for it, or all of ``count`` have come; its
    simulated time stands.
    """

    def __init__(self, environment: dict, count: int, time_ns: int = 0) -> None:
        super().__init__(environment, "/tester")
        self.received = self.entries = self.confirmed = self.most_ahead = 0
        self.lists: list[list[dict]] = []

        def on_schedule(message) -> None:
            self.lists.append(json.loads(message.data))
            self.received += sum("t" in entry for entry in self.lists[-1])
            self.entries += len(self.lists[-1])
            self.most_ahead = max(self.most_ahead, self.entries - self.confirmed)

        def horizon(request, response):
            response.values = [Parameter(name, value=3600.0).get_parameter_value() for name in request.names]
            return response

        node = self.own
        node.create_subscription(String, "~/schedule", on_schedule, 5000)
        node.create_service(GetParameters, "~/get_parameters", horizon)
        diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)

        def report() -> None:
            if self.entries - self.confirmed >= 500 or self.received == count:
                self.confirmed = self.entries
            values = {"commands_received": self.confirmed, "late": 0, "refused_total": 0}
            values["sim_time_ns"] = time_ns
            status = DiagnosticStatus(name="/tester: simulation")
            status.values = [KeyValue(key=k, value=str(v)) for k, v in values.items()]
            diagnostics.publish(DiagnosticArray(status=[status]))

        node.create_timer(0.1, report)


def test_never_more_than_500_commands_are_ahead_of_what_the_node_has_confirmed(
    ros_environment, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    monkeypatch.setattr(script_sender, "STANDSTILL_S", 0.1)
    path = tmp_path / "many.yaml"
    path.write_text("- {t: 1.0, impulse: [1.0e-6, 0, 0], repeat: 1600, every: 0.001}\n")
    with SlowNode(ros_environment, 1600) as slow:
        assert poke_client([str(path), "--node", "tester", "--reset", "--timeout", "0"]) == 0
        assert "the last acts at 2.599 s, but simulated time has stopped at 0 s" in capsys.readouterr().out
        # Beside those by which it says that more follows.
        assert 500 <= slow.most_ahead <= 520
        assert slow.received == 1600
        assert slow.lists[0] == [{"more": True, "service": "reset"}]
        assert [lines[0].get("more", False) for lines in slow.lists] == [True] * (len(slow.lists) - 1) + [False]


def test_a_client_without_a_time_limit_waits_for_a_node_that_starts_later(
    ros_environment, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    path, looking, spin_once = tmp_path / "poke.yaml", threading.Event(), script_sender.rclpy.spin_once

    def spin(*given, **named) -> None:
        looking.set()
        spin_once(*given, **named)

    monkeypatch.setattr(script_sender.rclpy, "spin_once", spin)
    path.write_text("- {t: 0, impulse: [1.0e-6, 0, 0]}\n")
    with ThreadPoolExecutor() as other:
        sending = other.submit(poke_client, [str(path), "--node", "tester", "--reset", "--timeout", "0"])
        while not looking.wait(0.05):
            assert not sending.done()
        with SlowNode(ros_environment, 1, time_ns=1) as late:
            assert sending.result() == 0
            assert late.received == 1
    assert "sent 1 poke; 0 late, 0 refused" in capsys.readouterr().out


LOADED = f"""
import sys
from rigid_proto_ros.base import interrupts
from rigid_proto_ros.cli.executables import poke_client
interrupts.leave = lambda status: status
for *words, expected in (
    ({str(example_path("flip_and_poke"))!r}, "--dry-run", 0),
    ({str(example_path("ballast_in_flight"))!r}, "--dry-run", 0),
    # Everything is there when it has looked for a node in vain.
    ({str(example_path("pull_on_string"))!r}, "--node", "/nobody", "--timeout", "0.1", 2),
):
    sys.argv[1:] = words
    assert poke_client() == expected
print([module for module in ("numba", "scipy") if module in sys.modules])
"""


def test_a_client_starts_without_numba_and_scipy(ros_environment):
    command = [sys.executable, "-c", LOADED]
    done = subprocess.run(command, env=from_source(ros_environment), capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1] == "[]", done.stderr
