# SPDX-License-Identifier: MIT
"""What ROS users expect of any node: names, types, QoS, descriptors, namespaces, several at once, and warnings."""

import importlib.util
import itertools
import resource
import socket
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import often_reporting_node
import pytest
import rclpy
import yaml
from command_rig import point_message, wrench_message
from rcl_interfaces.srv import DescribeParameters
from ros_client import COMMANDS, LATCHED, TOPICS, RosClient
from ros_process import running_node
from std_msgs.msg import String

from node_interface import INTERFACES, PUBLISHED, SERVED, SUBSCRIBED
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.live.live_simulation import LiveSimulation
from rigid_proto_ros.parameters.declarations import PARAMETERS, READ_ONLY, is_ros_parameter
from rigid_proto_ros.ros.arguments import given_arguments
from rigid_proto_ros.ros.diagnostics import WARNING_S, Diagnostics
from rigid_proto_ros.ros.main import make_viewer, open_page
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scene_file import read_scene_file, read_scene_text
from rigid_proto_ros.simulation.simulation import Simulation

KEYS = {
    *("sim_time_ns", "stamp_offset_ns", "publish_rate", "overruns", "real_time_lost_s", "wrench_received"),
    *("poke_received", "string_received", "inertia_received", "commands_received", "refused_total", "refused_frame"),
    *("refused_nonfinite", "refused_magnitude", "refused_stamp", "refused_ray_miss", "refused_tensor"),
    *("refused_integrator", "refused_schedule", "refused_thrusters", "refused_state", "late", "wall_stamp"),
    *("messages_lost", "queue_full", "kinetic_energy", "potential_energy", "angular_momentum_norm"),
    *("angular_momentum_drift", "integrator", "state", "recording", "resets", "clock_jumps"),
}
NODE = "/rigid_body"
OF_RCLPY = {
    SUBSCRIBED: {"/clock"},  # with use_sim_time
    PUBLISHED: {"/rosout", "/parameter_events"},
    SERVED: {
        *(f"{NODE}/{verb}_parameters" for verb in ("describe", "get", "list", "set")),
        *(f"{NODE}/{name}" for name in ("get_parameter_types", "get_type_description", "set_parameters_atomically")),
    },
}
"""What every rclpy node has."""


def test_a_node_without_viewer_and_recording_loads_none_of_their_libraries(rig) -> None:
    libraries = Path(f"/proc/{rig.node_process.pid}/maps").read_text()
    assert "rclpy" in libraries
    assert not [name for name in ("rerun", "pyarrow", "zstandard") if name in libraries]


def test_a_running_node_has_exactly_the_listed_topics_and_services(rig) -> None:
    """With everything on request switched on: the shared node has a thruster."""
    switches = {i.on_request: True for i in INTERFACES if i.on_request in PARAMETERS}
    assert rig.set_named(switches, atomically=True)[0][0]
    looks = {
        SUBSCRIBED: rig.own.get_subscriber_names_and_types_by_node,
        PUBLISHED: rig.own.get_publisher_names_and_types_by_node,
        SERVED: rig.own.get_service_names_and_types_by_node,
    }
    missing = {package for package in ("tf2_msgs",) if importlib.util.find_spec(package) is None}
    for direction, look in looks.items():
        listed = {
            i.name.replace("~", NODE): i.type
            for i in INTERFACES
            if i.direction == direction and i.type.partition("/")[0] not in missing
        }

        def found(look=look, own=OF_RCLPY[direction]) -> dict[str, str]:
            return {name: types[0] for name, types in look("rigid_body", "/") if name not in own}

        rig.until(lambda listed=listed, found=found: listed.keys() <= found().keys(), f"all that is {direction}")
        assert found() == listed


def test_all_topics_are_reliable_and_overridable_states_keep_10_commands_5000_and_the_latched_ones_the_last(rig):
    def side_of_the_node(name: str) -> list:
        look = rig.own.get_subscriptions_info_by_topic if name in COMMANDS else rig.own.get_publishers_info_by_topic
        return [end.qos_profile for end in look(rig.name(name)) if end.node_name == "rigid_body"]

    for name in TOPICS.keys() - {"/clock", "/diagnostics"}:
        (profile,) = rig.until(lambda name=name: side_of_the_node(name), f"the node's side of {name}")
        durability = "TRANSIENT_LOCAL" if name in LATCHED else "VOLATILE"
        assert (profile.reliability.name, profile.durability.name) == ("RELIABLE", durability)
    # The middleware doesn't tell how many it keeps; the parameters that override it do.
    depths = dict.fromkeys(COMMANDS, 5000) | dict.fromkeys(("pose", "twist", "odom", "imu"), 10)
    depths |= dict.fromkeys(LATCHED, 1) | dict.fromkeys(("applied", "events"), 1000)
    assert depths.keys() == TOPICS.keys() - {"/clock", "/diagnostics"}
    ends = {name: "subscription" if name in COMMANDS else "publisher" for name in depths}
    names = [f"qos_overrides.{rig.name(name)}.{end}" for name, end in ends.items()]
    assert list(rig.get(*(f"{name}.depth" for name in names)).values()) == list(depths.values())
    assert set(rig.get(*(f"{name}.history" for name in names)).values()) == {"keep_last"}


def test_every_parameter_has_a_descriptor_with_description_bounds_and_read_only_mark(rig):
    for descriptor in rig.call("describe_parameters", DescribeParameters, names=list(PARAMETERS)).descriptors:
        declared = PARAMETERS[descriptor.name]
        assert declared.description in descriptor.description
        assert descriptor.read_only == (declared.changes == READ_ONLY)
        if declared.type == "double" and declared.upper < float("inf"):
            (bounds,) = descriptor.floating_point_range
            assert (bounds.from_value, bounds.to_value) == (declared.lower, declared.upper)


def test_diagnostics_have_all_their_keys_and_warn_for_one_report_after_a_refusal(rig):
    report = rig.diagnostics()
    assert report["name"] == "/rigid_body: simulation"
    assert report.keys() >= KEYS
    kinds = ("wrench", "poke", "string", "inertia", "schedule", "thrusters")
    assert int(report["commands_received"]) == sum(int(report[f"{kind}_received"]) for kind in kinds) == rig.sent
    before = report["stamp_ns"]
    rig.publish("poke", wrench_message(0, "nowhere", (1.0, 0, 0)))
    rig.until_received(rig.sent)
    counted = rig.diagnostics()["stamp_ns"]
    rig.until(lambda: len(rig.all_diagnostics(after=counted)) >= 2, "reports")
    reports = rig.all_diagnostics(after=before)
    counts = [int(r["refused_total"]) for r in reports]
    told = [k for k in range(1, len(counts)) if counts[k] > counts[k - 1]] or [0]
    assert reports[told[0]]["level"] == 1
    # The counter stays, the warning goes unless the machine itself was late.
    assert counts == sorted(counts)
    for earlier, later in zip(reports[told[0] :], reports[told[0] + 1 :], strict=False):
        if all(earlier[k] == later[k] for k in ("overruns", "real_time_lost_s", "refused_total")):
            assert later["level"] == 0


def dumped(rig, folder) -> Path:
    """As ros2 param dump writes it: all parameters of the list and get services, dots as levels, under the node's name."""
    tree: dict = {}
    for name, value in rig.get(*rig.names()).items():
        node = tree
        *levels, last = name.split(".")
        for level in levels:
            node = node.setdefault(level, {})
        node[last] = value
    path = folder / "dump.yaml"
    path.write_text(yaml.dump({"/rigid_body": {"ros__parameters": tree}}, default_flow_style=False))
    return path


def test_a_dump_of_a_running_node_is_its_scene(rig, tmp_path):
    changes = {"mass": 1.5, "ballast.nut": [0.1, 0.0, 0.0, 0.07], "gravity": [0.0, 0.0, -1.0], "string.stiffness": 7.0}
    rig.set_named(changes, atomically=True)

    def told() -> str:
        """The scene, once it has the changes."""
        text = rig.heard("scene", last=1)[0]["data"]
        return text if changes.items() <= read_scene_text(text).values.items() else ""

    first = make_scenario(read_scene_text(rig.until(told, "the scene")).values)
    assert first.parameters == make_scenario({**rig.scene, **first.parameters.named()}).parameters
    dump = dumped(rig, tmp_path)
    offline = {n: v for n, v in read_scene_file(dump).values.items() if not is_ros_parameter(n)}
    online = given_arguments(["--ros-args", "--params-file", str(dump)], "rigid_body", pytest.fail)
    for values in (offline, {n: v for n, v in online.items() if not is_ros_parameter(n)}):
        assert make_scenario(values).parameters == first.parameters


def test_a_ballast_is_deleted_as_ros2_param_delete_does_it(rig):
    """By a parameter without a value, as that command sends it; nothing else can be deleted."""
    before = rig.heard("inertia", last=1)[0]["inertia"]
    rig.set_named({"ballast.nut": [0.1, 0.0, 0.0, 0.07]})
    rig.until(lambda: rig.heard("inertia", last=1)[0]["inertia"]["m"] == pytest.approx(before["m"] + 0.1), "the nut")
    assert rig.set_named({"ballast.nut": None}) == [[True, ""]]
    rig.until(lambda: rig.heard("inertia", last=1)[0]["inertia"] == before, "the body as it was")
    assert "ballast.nut" not in rig.names()
    rig.set_named({"mass": 2.0})  # parameters that follow don't bring it back
    rig.until(lambda: rig.heard("inertia", last=1)[0]["inertia"]["m"] == 2.0, "the mass")
    assert "ballast.nut" not in rig.names()
    for name in ("mass", "contacts.tip", "ballast.nut"):
        ((accepted, reason),) = rig.set_named({name: None})
        assert not accepted and name in reason, (name, reason)


def test_a_nodes_own_dump_can_be_loaded_and_what_differs_acts(rig):
    """What ros2 param load sends: one set_parameters request with all of a file, which sets one after another."""
    own = rig.get(*rig.names())
    own["gravity"] = [0.0, 0.0, -1.0]
    # What waits and sets none of them makes no difference.
    rig.schedule("[{t: 1000, impulse: [0, 0, 0.001]}, {t: 1000, set: {string.stiffness: 7}}]")
    rig.until_received(rig.sent)
    del own["string.stiffness"]
    assert {tuple(result) for result in rig.set_named(own)} == {(True, "")}
    (event,) = rig.wait_event("set")
    assert event["content"] == {"gravity": [0.0, 0.0, -1.0]}
    results = rig.set_named({"inertia_model": "shell", "masss": 1.0, "mesh": "book", "viewer": "web"})
    assert [accepted for accepted, _ in results] == [True, False, True, False]
    assert "did you mean mass" in results[1][1]
    assert "viewer" in results[3][1]
    assert rig.get("inertia_model", "mesh") == {"inertia_model": "shell", "mesh": "book"}


def test_two_nodes_of_one_domain_do_not_mix(rig, tmp_path):
    hammer = {"mesh": "hammer", "world_frame": "map", "qos_overrides./lab/tool/pose.publisher.depth": 3}
    names = ("-r", "__node:=tool", "-r", "__ns:=/lab", "-r", "~/poke:=/lab/hit")
    rig.forget("inertia")
    with (
        RosClient(rig.environment, "/lab/tool") as tool,
        running_node(rig.environment, tmp_path / "tool", hammer, *names),
    ):
        tool.listen("odom", "events", "inertia", "/diagnostics")
        tool.advertise("/lab/hit")
        before = rig.counters()
        # The names of its own frames, beside the words for them.
        for frame in ("tool@com", "map@com", "map", "lab/tool", "world", "body@origin"):
            tool.publish("/lab/hit", wrench_message(0, f"{frame};impulse", (1.0, 0.0, 0.0)))
        tool.until(lambda: len(tool.events()) == 6, "the pokes")
        report = tool.diagnostics()
        assert (report["poke_received"], report["refused_total"]) == ("6", "0")
        assert report["name"] == "/lab/tool: simulation"
        assert rig.gained(before, "poke_received") == {} and rig.events() == []
        odometry = tool.until(lambda: tool.heard("odom", last=1), "odometry")[0]
        assert (odometry["header"]["frame_id"], odometry["child_frame_id"]) == ("map", "lab/tool")
        inertia = tool.until(lambda: tool.heard("inertia"), "its inertia")[0]
        assert inertia["header"]["frame_id"] == "lab/tool/mesh"
        # What a user overrides is of that topic alone.
        depths = [f"qos_overrides./lab/tool/{topic}.publisher.depth" for topic in ("pose", "twist")]
        assert list(tool.get(*depths).values()) == [3, 10]
        tool.trigger("reset")
        tool.until(lambda: tool.events()[-1]["kind"] == "reset", "the reset")
        assert rig.events() == [] and rig.heard("inertia") == []


def test_a_port_that_a_scene_names_is_asked_for_and_a_default_one_may_move(monkeypatch):
    """What is asked for and taken is refused, and a free one found and printed, where it is served: test_rerun_live.py,
    test_live_who_may.py.
    """
    pytest.importorskip("rerun")
    monkeypatch.setattr("rigid_proto_ros.rerun_view.live_view.LiveView", lambda viewer, **given: given)
    default = PARAMETERS["web_port"].default
    for named, asked in ((9191, 9191), (default, None)):
        viewer = make_viewer(make_scenario({"viewer": "web", "web_port": named}), Mock())
        assert (viewer["rerun_port"], viewer["web_port"]) == (None, asked)


def test_a_report_is_read_between_two_ticks_so_that_its_values_belong_together(monkeypatch) -> None:
    live = LiveSimulation(make_scenario({"mesh": "t_handle", "start_paused": True}))
    node = Mock()
    node.create_publisher().get_subscription_count.return_value = 0
    node.get_node_names_and_namespaces.return_value = node.get_topic_names_and_types.return_value = []
    report = Diagnostics(node, live, SimpleNamespace(messages_lost=0, queue_full=0))._report
    threads: list[str] = []
    seen = property(lambda _: threads.append(threading.current_thread().name) or 0.0)
    monkeypatch.setattr(Simulation, "angular_momentum_drift", seen)
    live.start()
    report()
    live.stop()
    report()  # none of what has ended
    assert threads == ["physics"]


def test_a_page_whose_port_is_taken_is_refused_by_the_parameters_name():
    pytest.importorskip("websockets")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        live = LiveSimulation(make_scenario({"viewer": "workbench", "workbench_port": port}))
        with pytest.raises(InputError, match=f"workbench_port: got {port}"):
            open_page(SimpleNamespace(live=live, get_logger=Mock()))


# What goes wrong in flight is said where a ROS user hears it: in the log, in diagnostics, in parameters


def test_a_publisher_with_incompatible_qos_on_a_command_topic_is_warned_of(rig):
    rig.advertise("string/target#2", wait=False, best_effort=True)
    said = "a publisher on /rigid_body/string/target offers incompatible QoS (last policy: RELIABILITY)"
    rig.until(lambda: said in rig.node_process.errors, "a warning")


def test_a_publisher_of_another_type_on_a_command_topic_is_warned_of(rig):
    # In a context of its own: one participant has one type on a topic.
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=int(rig.environment["ROS_DOMAIN_ID"]))
    other = rclpy.create_node("other", context=context, start_parameter_services=False, enable_rosout=False)
    other.create_publisher(String, "/rigid_body/string/target", 10)
    said = (
        "a publisher on /rigid_body/string/target has the type std_msgs/msg/String, not geometry_msgs/msg/PointStamped"
    )
    rig.until(lambda: said in rig.node_process.errors, "a warning")
    other.destroy_node()
    context.try_shutdown()


def test_publishers_that_replace_each_others_wrench_are_warned_of_and_those_with_slots_are_not(rig):
    said = "several publishers on /rigid_body/wrench replace each other's commands; with ;slot="
    before = rig.node_process.errors.count(said)
    for k, slot in enumerate(("left", "right", ""), 2):
        rig.advertise(f"wrench#{k}")
        assert rig.node_process.errors.count(said) == before
        rig.publish(f"wrench#{k}", wrench_message(0, f"world@com;slot={slot}" if slot else "world"))
        rig.sent += 1
        rig.until_received(rig.sent)
    rig.publish("wrench", wrench_message(0, "world"), wrench_message(0, "world"))
    rig.until_received(rig.sent)
    rig.until(lambda: rig.node_process.errors.count(said) == before + 1, "one warning")


def test_the_log_has_a_line_for_pause_resume_reset_and_the_ends_of_a_recording(rig, tmp_path):
    path = tmp_path / "flight.mcap"
    rig.set(record=str(path))
    rig.pause(True)
    rig.trigger("reset")
    rig.pause(False)
    rig.set(record="")
    wanted = (
        *(f"a recording to {path} begins", "paused at ", "reset: simulated time is 0", "resumed at 0 s"),
        f"the recording to {path} ends",
    )

    def told() -> bool:
        lines = iter(rig.node_process.errors.splitlines())
        return all(any("[INFO]" in line and words in line for line in lines) for words in wanted)

    rig.until(told, "the lines in this order")


def test_the_timeout_of_a_string_is_an_event(rig):
    rig.set(string__timeout=0.2, string__stiffness=1.0)
    rig.publish("string/target", point_message(0, "", (0.0, 0.0, 0.2)))
    (tied,), (released,) = rig.wait_event("string_target"), rig.wait_event("timeout")
    assert released["content"] == {"string": True}
    assert released["time_ns"] == tied["time_ns"] + 200_000_000


def test_another_node_of_the_same_name_is_warned_of_once(rig):
    said = "another node is called /rigid_body,"
    assert rig.node_process.errors.count(said) == 0
    other = rclpy.create_node(
        "rigid_body", context=rig.own.context, start_parameter_services=False, enable_rosout=False
    )
    rig.until(lambda: said in rig.node_process.errors, "a warning")
    rig.forget("/diagnostics")
    rig.until(lambda: len(rig.all_diagnostics()) > 1, "two reports")
    other.destroy_node()
    assert rig.node_process.errors.count(said) == 1


def test_real_time_that_is_given_up_is_warned_of_and_not_every_second(rig):
    said = "of real time given up"
    before, start, began_ns = rig.node_process.errors.count(said), time.monotonic(), time.time_ns()
    # 10⁹ steps a second: some hundred times more than there is time for.
    rig.set(integrator="rk4", step=1e-9)
    lost_s = float(rig.diagnostics()["real_time_lost_s"])
    rig.until(lambda: float(rig.diagnostics()["real_time_lost_s"]) > lost_s + 1.0, "a second lost")
    # On a busy machine one of an earlier test may have come just before: then the next is WARNING_S later.
    rig.until(lambda: rig.node_process.errors.count(said) > before, "a warning")
    elapsed_s = time.monotonic() - start
    assert rig.node_process.errors.count(said) - before <= 2 + elapsed_s // WARNING_S
    # Each report that finds more lost, or more published late, is a warning, and says so.
    reports = rig.all_diagnostics(after=began_ns)
    for key, words in (("real_time_lost_s", "s behind real time"), ("overruns", "published late")):
        grown = [b for a, b in itertools.pairwise(reports) if float(b[key]) > float(a[key])]
        assert grown and all(report["level"] == 1 and words in report["message"] for report in grown)


@pytest.mark.skipif(importlib.util.find_spec("tf2_msgs") is not None, reason="tf2_msgs is installed")
def test_that_tf_lacks_its_messages_is_warned_of_once_and_not_at_every_change_of_a_parameter(rig):
    for gravity in (1.0, 2.0, 3.0):
        assert rig.set(publish_tf=True, gravity=[0.0, 0.0, -gravity]) == [[True, ""]] * 2
    assert rig.node_process.errors.count("tf2_msgs isn't installed") == 1


def test_a_fixed_step_too_long_for_the_motion_is_a_warning_as_long_as_it_is_in_force(rig):
    assert rig.set(integrator="rk4", step=0.5) == [[True, ""]] * 2
    report = rig.diagnostics()
    assert report["level"] == 1, report
    assert all("rk4: |w| step = 6" in report[words] for words in ("message", "warning"))
    rig.set(integrator="auto")
    assert not rig.diagnostics()["warning"]


@pytest.mark.parametrize("name", ["flight.mcap", "flight.rrd"])
def test_a_recording_that_stops_is_told_by_log_diagnostics_and_parameter_until_another_begins(rig, tmp_path, name):
    path, unlimited, began_ns = tmp_path / name, (resource.RLIM_INFINITY, resource.RLIM_INFINITY), time.time_ns()
    assert rig.set(record=str(path), publish_rate=200.0) == [[True, ""]] * 2
    assert rig.diagnostics()["recording"] == str(path)
    try:
        # As on a full disk: the file grows by some kilobytes more, and the log less.
        size = max(path.stat().st_size, len(rig.node_process.errors.encode()))
        resource.prlimit(rig.node_process.pid, resource.RLIMIT_FSIZE, (size + 50_000, unlimited[1]))
        rig.until(lambda: "recording" in rig.diagnostics()["message"], "a warning")
        # So long after the last write that went well comes one that doesn't; then 2 s of reports.
        failing_ns = path.stat().st_mtime_ns + (500_000_000 if name == "flight.mcap" else 5_000_000_000)
        since = [report for report in rig.all_diagnostics(after=failing_ns) if "recording" not in report["message"]]
        assert len(since) <= 2.0 / often_reporting_node.REPORT_S
        rig.until(lambda: "recording stopped" in rig.diagnostics()["message"], "the end of the recording")
        report = rig.diagnostics()
        assert (report["level"], report["recording"]) == (1, "")
        # The table of parameters follows what has happened.
        rig.until(lambda: rig.get("record") == {"record": ""}, "the parameter to follow")
        assert "[WARN]" in rig.node_process.errors and f"recording stopped: {path}" in rig.node_process.errors
    finally:
        resource.prlimit(rig.node_process.pid, resource.RLIMIT_FSIZE, unlimited)
    again = tmp_path / "again.mcap"
    assert rig.set(record=str(again)) == [[True, ""]]
    report = rig.diagnostics()
    assert "recording stopped" not in report["message"]
    assert report["recording"] == str(again)
    # One a period, and none beside it for what has changed; a late one doesn't delay those behind it.
    stamps = [report["stamp_ns"] for report in rig.all_diagnostics(after=began_ns)]
    assert len(stamps) - 2 <= (stamps[-1] - stamps[0]) * 1e-9 / often_reporting_node.REPORT_S
