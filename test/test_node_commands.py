# SPDX-License-Identifier: MIT
"""One running node under good, bad and odd commands, services and parameter changes."""

import math
import time

import pytest
from node_client import SECOND, NodeClient, published
from ros_process import running_node

from rigid_proto_ros.bundled import scene_path
from rigid_proto_ros.offline import OfflineRun, read_scene
from rigid_proto_ros.parameters import PARAMETERS
from rigid_proto_ros.scenario import publication_ns

RATE = 50.0


@pytest.fixture(scope="module")
def flying(ros_environment, tmp_path_factory):
    """A node with the T-handle, remapped to another name, and a client of it."""
    log = tmp_path_factory.mktemp("node") / "node"
    arguments = ["--ros-args", "-r", "__node:=handle", "-p", "publish_rate:=50", "--params-file", own_scene(log.parent)]
    with running_node(*arguments, environment=ros_environment, log=log) as process:
        client = NodeClient(ros_environment, "handle")
        client.process = process
        yield client
        client.close()


def own_scene(folder):
    """The T-handle's scene in a section of the remapped name."""
    path = folder / "handle.yaml"
    path.write_text(scene_path("t_handle").read_text().replace("rigid_body:", "/handle:").replace("100.0", "50.0"))
    return path


@pytest.fixture
def client(flying):
    """The client, with the node paused at time 0."""
    assert flying.pause(True).success
    assert flying.trigger("reset").success
    flying.fresh_diagnostics(lambda values: values["sim_time_ns"] == "0" and values["state"] == "paused")
    flying.states.clear()
    flying.odometry.clear()
    return flying


def offline():
    return OfflineRun(read_scene("t_handle", {"publish_rate": RATE}))


def check_free_flight(client, found, least=10):
    """The states received are those of a run without any command."""
    free = offline()
    times = sorted(set(found["pose"]) | set(found["twist"]))
    assert len(times) >= least
    for time_ns in times:
        assert free.advance(time_ns)
        pose, twist = published(free.simulation.state.row)
        assert found["pose"].get(time_ns, pose) == pose
        assert found["twist"].get(time_ns, twist) == twist


REFUSED = (
    ("nonfinite", "wrench", {"force": (math.nan, 0, 0)}),
    ("nonfinite", "poke", {"torque": (0, math.inf, 0)}),
    ("frame", "wrench", {"frame": "mars", "force": (0, 0, 1)}),
    ("frame", "wrench", {"frame": "world;impulse", "force": (0, 0, 1)}),
    ("frame", "poke", {"frame": "vertex/99999999", "force": (0, 0, 1)}),
    ("frame", "poke", {"frame": "normal@tip", "force": (1, 1, 0)}),
    ("magnitude", "poke", {"force": (1e300, 0, 0)}),
    ("magnitude", "wrench", {"torque": (0, 0, 1e20)}),
    ("stamp", "poke", {"stamp_ns": 100_000 * SECOND, "force": (0, 0, 1)}),
    ("ray_miss", "poke", {"frame": "world@ray/50,0,0/1,0,0", "force": (0, 0, 1)}),
)


def test_what_is_refused_is_counted_and_the_body_flies_on_untouched(client):
    before = client.fresh_diagnostics()
    for _ in range(5):
        for _, topic, fields in REFUSED:
            client.wrench(topic, **fields)
    for text in ("{t: 1", "5", "{t: 1, set: {masse: 1}}", "{t: 1, set: {mass: -1}}", "{t: 1, force: [0, 0, 1]}"):
        client.schedule(text)
    sent = 5 * len(REFUSED) + 5
    client.received(int(before["commands_received"]) + sent)
    client.pause(False)
    check_free_flight(client, client.fly_until(2 * SECOND))
    after = client.fresh_diagnostics(lambda v: int(v["refused_total"]) >= int(before["refused_total"]) + sent)
    reasons = [reason for reason, _, _ in REFUSED]
    for reason in set(reasons):
        assert int(after[f"refused_{reason}"]) - int(before[f"refused_{reason}"]) == 5 * reasons.count(reason), reason
    assert int(after["refused_schedule"]) - int(before["refused_schedule"]) == 5
    assert int(after["commands_received"]) - int(before["commands_received"]) == sent


def test_refusals_are_warned_of_at_most_once_a_second(client):
    warned = client.process.errors.count("refused:")
    received = int(client.fresh_diagnostics()["commands_received"])
    start = time.monotonic()
    for _ in range(300):
        client.wrench("wrench", frame="mars")
        time.sleep(0.01)
    client.received(received + 300)
    elapsed_s = time.monotonic() - start
    # One at once, then one for each full second that has passed: however slow the machine, never more.
    assert 2 <= client.process.errors.count("refused:") - warned <= 1 + elapsed_s


def test_stamps_mean_what_they_say(client):
    import time

    before = client.fresh_diagnostics()
    client.pause(False)
    client.fly_until(1 * SECOND)
    client.wrench("poke", 0)
    client.wrench("poke", 1)
    client.wrench("poke", time.time_ns())
    client.wrench("poke", time.time_ns() - 3600 * SECOND)
    after = client.received(int(before["commands_received"]) + 4)
    assert int(after["late"]) - int(before["late"]) == 1
    assert int(after["wall_stamp"]) - int(before["wall_stamp"]) == 2
    assert after["refused_total"] == before["refused_total"]


def test_paused_states_repeat_a_frozen_stamp_and_step_goes_one_publication_on(client):
    client.spin_until(lambda: len(client.states) >= 10, "states of the paused node")
    assert set(client.rows()["pose"]) == {0}
    for k in range(1, 4):
        assert client.trigger("step").success
        found = client.fly_until(publication_ns(k, RATE))
        assert max(found["pose"]) == publication_ns(k, RATE)
    client.pause(False)
    answer = client.trigger("step")
    assert not answer.success and "pause" in answer.message
    check_free_flight(client, client.fly_until(SECOND // 2), least=3)


def test_every_stamp_is_a_publication_time_also_at_3_hz(client):
    try:
        assert client.set(publish_rate=3.0)[0].successful
        client.pause(False)
        found = client.fly_until(3 * SECOND)
        expected = {publication_ns(k, 3.0) for k in range(20)}
        assert set(found["pose"]) <= expected and len(found["pose"]) >= 5
        assert publication_ns(1, 3.0) == 333_333_333
    finally:
        client.set(publish_rate=RATE)


def test_a_held_wrench_times_out_and_pulses_add(client):
    from rigid_proto_ros.poke_script import parse_script

    received = int(client.fresh_diagnostics()["commands_received"])
    text = "[{t: 0.1, wrench: {force: [0.01, 0, 0]}}, {t: 0.2, at: com, force: [0, 0.02, 0], duration: 0.3},"
    text += " {t: 0.3, at: com, force: [0, 0.03, 0], duration: 0.3}]"
    script = parse_script(text)
    for command in script:
        client.wrench(command.kind, command.t_ns, command.frame_id, command.force, command.torque)
    client.received(received + 3)
    client.pause(False)
    found = client.fly_until(5 * SECOND // 2)
    run = OfflineRun(read_scene("t_handle", {"publish_rate": RATE}), script)
    for time_ns in sorted(found["twist"]):
        run.advance(time_ns)
        assert found["twist"][time_ns] == published(run.simulation.state.row)[1]
    mass = run.scenario.setup.body.mass
    final = found["twist"][max(found["twist"])]
    assert final[0] == pytest.approx(0.01 * 1.5 / mass, rel=1e-12)
    assert final[1] == pytest.approx((0.02 * 0.3 + 0.03 * 0.3) / mass, rel=1e-12)


def test_clear_wrench_ends_what_acts_and_leaves_what_is_scheduled(client):
    received = int(client.fresh_diagnostics()["commands_received"])
    client.wrench("wrench", 0, "", (0.01, 0, 0))
    client.wrench("poke", 3 * SECOND, "world;impulse", (0, 0.001, 0))
    client.received(received + 2)
    client.pause(False)
    client.fly_until(SECOND // 5)
    assert client.trigger("clear_wrench").success
    found = client.fly_until(7 * SECOND // 2)["twist"]
    after = [found[time_ns] for time_ns in sorted(found)]
    # It was cleared long before its timeout, which would have given 0.01 N 1.5 s / m.
    mass = offline().scenario.setup.body.mass
    assert 0.0 < after[-1][0] < 0.01 * 1.4 / mass
    assert after[-30][0] == after[-1][0]
    assert after[-1][1] == 0.001 / mass and after[0][1] == 0.0


def test_odometry_carries_the_twist_in_body_axes(client):
    client.trigger("step")
    client.spin_until(lambda: client.odometry and client.odometry[-1].header.stamp.nanosec == 20_000_000, "odometry")
    run = offline()
    run.advance(20_000_000)
    state, message = run.simulation.state, client.odometry[-1]
    assert (message.header.frame_id, message.child_frame_id) == ("world", "handle")
    w = message.twist.twist.angular
    assert [w.x, w.y, w.z] == state.angular_velocity_body.tolist()


def test_the_latched_inertia_reaches_one_who_comes_late(client):
    from geometry_msgs.msg import InertiaStamped
    from rclpy.qos import DurabilityPolicy, QoSProfile

    came = []
    profile = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    subscription = client.node.create_subscription(InertiaStamped, "/handle/inertia", came.append, profile)
    client.spin_until(lambda: came, "inertia")
    client.node.destroy_subscription(subscription)
    body = offline().scenario.setup.body
    assert came[0].header.frame_id == "handle/mesh"
    assert (came[0].inertia.m, came[0].inertia.ixx) == (body.mass, body.inertia[0, 0])
    assert came[0].inertia.com.z == body.center_of_mass[2]


GOOD = (
    ("gravity", [0, 0, -9], [0.0, 0.0, -9.0]),
    ("gravity", "[0, 0, -9.81]", [0.0, 0.0, -9.81]),
    ("gravity", "[0, 1e-3, -1]", [0.0, 1e-3, -1.0]),
    ("scale", 2, [2.0]),
    ("scale", "1", [1.0]),
    ("density", 2, 2.0),
    ("density", "1e-3", 1e-3),
    ("density", "7850", 7850.0),
    ("step", "0.001", 0.001),
)
BAD = (
    *(
        ("gravity", value)
        for value in (1.0, [0.0, 0.0], [0.0, 0.0, math.nan], "[0, 0, inf]", "[0, 0, 0, 0]", "down", True)
    ),
    *(("density", value) for value in (0.0, -1, math.nan, math.inf, "nan", "heavy", True, [1.0], "[1, 2]")),
    *(("step", value) for value in (0.0, -1e-3, 1e99, "soon")),
    ("integrator", "rk5"),
    ("contacts.tip", [0.0, 0.0, 0.0]),
    ("start_paused", True),
    ("masse", 1.0),
)


@pytest.mark.parametrize("atomically", [False, True])
def test_numbers_are_numbers_in_parameter_services(client, atomically):
    names = ["gravity", "scale", "density", "step"]
    before = dict(zip(names, client.get(*names), strict=True))
    try:
        for name, value, expected in GOOD:
            assert client.set(atomically, **{name: value})[0].successful, (name, value)
            assert client.get(name) == [expected]
        held = client.get(*names, "integrator")
        for name, value in BAD:
            (result,) = client.set(atomically, **{name: value})
            assert not result.successful, (name, value)
            assert name.split(".")[-1] in result.reason, result.reason
            assert client.get(*names, "integrator") == held
    finally:
        assert all(result.successful for result in client.set(**before))
        assert client.get(*names) == list(before.values())


def test_several_set_atomically_are_all_refused_for_one(client):
    before = client.get("gravity", "linear_damping")
    assert not client.set(True, gravity=[0.0, 0.0, 1.0], linear_damping=-1.0)[0].successful
    assert client.get("gravity", "linear_damping") == before


def test_every_parameter_is_listed_and_described(client):
    from rcl_interfaces.srv import DescribeParameters, ListParameters

    listed = client.call("list_parameters", ListParameters, ListParameters.Request()).result.names
    assert set(PARAMETERS) | {"contacts.tip", "contacts.left", "contacts.right"} <= set(listed)
    request = DescribeParameters.Request(names=list(PARAMETERS))
    for told in client.call("describe_parameters", DescribeParameters, request).descriptors:
        parameter = PARAMETERS[told.name]
        assert told.description.startswith(parameter.description)
        assert told.additional_constraints == parameter.accepted
        assert told.read_only == (parameter.changes == "read-only")
