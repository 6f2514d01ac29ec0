# SPDX-License-Identifier: MIT
"""Every topic and service of the node, through real processes and messages."""

import hashlib
import json
from collections import Counter

import numpy as np
import pytest
from command_rig import inertia_message, point_message, vector, wrench_message
from ros_client import stamp_ns
from scipy.spatial.transform import Rotation
from std_srvs.srv import Trigger

from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.commands import ClearWrench, WrenchCommand
from rigid_proto_ros.simulation.simulation import Simulation

SECOND = 10**9
MS = 10**6


def row_of(pose: dict, twist: dict) -> np.ndarray:
    """x, q, v, ω world from a pose and a twist."""
    p, q = pose["pose"]["position"], pose["pose"]["orientation"]
    v, w = twist["twist"]["linear"], twist["twist"]["angular"]
    return np.array([p["x"], p["y"], p["z"], q["x"], q["y"], q["z"], q["w"], *v.values(), *w.values()])


def expected_row(scene: dict, commands, time_ns: int) -> np.ndarray:
    """The same in an offline simulation, for commands (time_ns, topic, frame, force, torque)."""
    scenario = make_scenario(scene)
    simulation = Simulation(scenario.setup)
    for at_ns, topic, frame, force, torque in commands:
        if topic == "clear":
            simulation.submit(ClearWrench(), at_ns)
            continue
        read = parse_frame(frame)
        simulation.submit(WrenchCommand(topic == "wrench", read, force, torque, frame, stamp_ns=at_ns), at_ns)
    state = simulation.advance(time_ns)
    return np.concatenate([state.row[:10], state.angular_velocity])


def test_wrenches_pokes_and_impulses_by_message_move_the_node_as_an_offline_simulation_to_the_bit(rig):
    zero = (0.0, 0.0, 0.0)
    commands = [
        (100 * MS, "wrench", "world@tip", (0.01, 0.0, 0.02), zero),
        (110 * MS, "poke", "world@tip", (0.1, 0.0, 0.0), zero),
        (120 * MS, "poke", "body@left;duration=0.3", (0.0, 0.05, 0.0), zero),
        (120 * MS, "poke", "body@left;duration=0.3", (0.0, 0.05, 0.0), zero),
        (125 * MS, "poke", "normal@vertex/5", (0.2, 0.0, 0.0), zero),
        (130 * MS, "poke", "world@tip;impulse", (1e-3, 0.0, 0.0), (0.0, 1e-6, 0.0)),
        (300 * MS, "wrench", "body", (0.0, 0.01, 0.0), (1e-5, 0.0, 0.0)),
        (500 * MS, "wrench", "", zero, zero),
        (600 * MS, "wrench", "vertex/3", (0.0, 0.01, 0.0), zero),
    ]
    rig.set(real_time_factor=8.0)
    rig.start_over(paused=True)
    for at_ns, topic, frame, force, torque in commands:
        rig.publish(topic, wrench_message(at_ns, frame, force, torque))
    rig.until_received(rig.sent)
    rig.pause(False)
    # The last wrench is held 1.5 s of simulated time: until 2.1 s.
    published = row_of(*rig.state_at(2300 * MS))
    offline = expected_row(rig.scene, [*commands, (2100 * MS, "clear", "", zero, zero)], 2300 * MS)
    assert published[:10].tobytes() == offline[:10].tobytes(), np.abs(published - offline).max()
    # Turned to world axes by another formula.
    assert published[10:] == pytest.approx(offline[10:], rel=1e-14, abs=1e-15)


def test_pose_twist_and_odometry_are_one_state_stamped_with_publication_times(rig):
    rig.start_over(paused=True)
    # Step by step: on a busy machine the middleware, which keeps ten states, would lose some of a node that goes on.
    times = [k * 10 * MS for k in range(1, 21)]
    for time_ns in times:
        assert rig.trigger("step")["success"]
        pose, twist = rig.state_at(time_ns)
        (odom,) = rig.until(lambda time_ns=time_ns: rig.heard("odom", last=1, stamp=time_ns), "odometry")
        row = row_of(pose, twist)
        assert odom["pose"]["pose"] == pose["pose"]
        # An Odometry's twist is in body axes, a TwistStamped's in those of its frame: the world's.
        R = Rotation.from_quat(row[3:7])
        linear, angular = odom["twist"]["twist"]["linear"], odom["twist"]["twist"]["angular"]
        assert R.apply(list(linear.values())) == pytest.approx(row[7:10], abs=1e-13)
        assert R.apply(list(angular.values())) == pytest.approx(row[10:13], abs=1e-12)
        assert (pose["header"]["frame_id"], twist["header"]["frame_id"]) == ("world", "world")
        assert (odom["header"]["frame_id"], odom["child_frame_id"]) == ("world", "rigid_body")
    for topic in ("pose", "twist", "odom"):
        assert sorted({stamp_ns(m) for m in rig.heard(topic)} - {0}) == times


def test_applied_says_when_each_command_began_and_its_wrench_about_the_com_in_the_bodys_frame(rig):
    rig.start_over(paused=True)
    rig.publish("wrench", wrench_message(200 * MS, "tip", (0.0, 1e-3, 0.0)))
    rig.publish("poke", wrench_message(250 * MS, "world@vertex/3;duration=0.125", (0.0, 1e-3, 0.0), (1e-6, 0.0, 0.0)))
    rig.publish("poke", wrench_message(300 * MS, "normal@left;impulse", (1e-4, 0.0, 0.0)))
    rig.publish("poke", wrench_message(0, "world@ray/0,0,3/0,0,-1", (0.0, 0.0, 1e-3)))
    rig.until_received(rig.sent)
    paused_ns = rig.now_ns()
    rig.pause(False)
    applied = sorted(
        rig.until(lambda: len(rig.heard("applied")) >= 4 and rig.heard("applied"), "applied"), key=stamp_ns
    )
    assert [stamp_ns(m) for m in applied] == [paused_ns, 200 * MS, 250 * MS, 300 * MS]
    # A frame that TF knows, and whose origin is the COM.
    assert {m["header"]["frame_id"] for m in applied} == {"rigid_body"}
    scenario = make_scenario(rig.scene)
    body, surface = scenario.setup.body, scenario.setup.surface
    turned = {ns: Rotation.from_quat(list(rig.state_at(ns)[0]["pose"]["orientation"].values())) for ns in (0, 250 * MS)}
    assert paused_ns == 0

    def about_the_com(point, force, torque=(0.0, 0.0, 0.0)) -> list[float]:
        return [*force, *(np.cross(body.point(point), force) + torque)]

    at_corner = turned[250 * MS].inv().apply([[0.0, 1e-3, 0.0], [1e-6, 0.0, 0.0]])
    expected = (
        about_the_com((0.0, 0.0, 0.07), (0.0, 1e-3, 0.0)),
        about_the_com(surface.vertices[3], *at_corner),
        about_the_com((0.0, -0.05, 0.0), 1e-4 * surface.inward_normal([0.0, -0.05, 0.0])),
    )
    said = [[*m["wrench"]["force"].values(), *m["wrench"]["torque"].values()] for m in applied]
    for found, wanted in zip(said[1:], expected, strict=True):
        assert found == pytest.approx(wanted, rel=1e-13, abs=1e-19)
    # The ray comes straight from above, through the axis on which the COM lies.
    assert said[0][:3] == pytest.approx(turned[0].inv().apply([0.0, 0.0, 1e-3]), abs=1e-18)
    # What else was said stands in the log.
    frames = {e["time_ns"]: e["content"]["frame_id"] for e in rig.events() if e["kind"] in ("wrench", "poke")}
    assert frames == {
        0: "world@ray/0,0,3/0,0,-1",
        200 * MS: "tip",
        250 * MS: "world@vertex/3;duration=0.125",
        300 * MS: "normal@left;impulse",
    }


def chain_is_whole(events: list[dict]) -> None:
    """Every line's sha256 is that of all lines so far, each without its own, as the README says."""
    digest = hashlib.sha256()
    for event in events:
        digest.update((json.dumps({k: event[k] for k in ("time_ns", "kind", "content")}) + "\n").encode())
        assert event["sha256"] == digest.hexdigest(), event


def test_events_tell_every_command_change_and_service_in_one_unbroken_chain_since_the_reset(rig):
    rig.trigger("reset")
    rig.publish("wrench", wrench_message(0, "world", (0.0, 0.0, 1e-3)))
    rig.publish("poke", wrench_message(300 * MS, "tip", (0.0, 1e-3, 0.0)))
    rig.publish("string/attach", point_message(0, "body/mesh", (0.0, 0.0, 0.07)))
    rig.publish("string/target", point_message(0, "world", (0.0, 0.0, 0.5)))
    rig.publish("inertia/set", inertia_message(0, "", 0.02, (0, 0, 0), (1e-5, 0, 0, 2e-5, 0, 2.5e-5)))
    rig.schedule(
        "{t: 0.0, set: {gravity: [0.0, 0.0, -1.0]}}", "{t: 0.0, string: release}", "{t: 0, service: clear_wrench}"
    )
    rig.set(atomically=True, mass=1.0, linear_damping=0.001)
    rig.trigger("clear_wrench")
    rig.trigger("string/release")
    rig.pause(True)
    rig.trigger("step")
    rig.pause(False)
    rig.wait_event("poke")
    rig.wait_event("pause", 2)
    events = rig.events()
    once = ("reset", "wrench", "poke", "string_attach", "string_target", "inertia", "step")
    twice = ("set", "string_release", "clear_wrench", "pause")
    assert Counter(event["kind"] for event in events) == {**dict.fromkeys(once, 1), **dict.fromkeys(twice, 2)}
    chain_is_whole(events)
    times = [event["time_ns"] for event in events]
    assert times == sorted(times)
    # A new chain begins at the next reset.
    rig.trigger("reset")
    rig.until(lambda: rig.events()[-1]["kind"] == "reset", "the reset")
    chain_is_whole(rig.events()[-1:])


CONTROLLERS = {
    "poke": lambda k: ("poke", wrench_message(0, "world;impulse", (1e-6, 0.0, 0.0))),
    "string": lambda k: ("string/target", point_message(0, "", (0.0, 1e-3 * (k % 3), 0.3))),
    "schedule": lambda k: ("schedule", {"data": json.dumps({"t": k * 1e-3, "angular_impulse": [1e-6, 0.0, 0.0]})}),
    "wrench": lambda k: ("wrench", wrench_message(0, "", ((1e-3, 0.0, -2e-3)[k % 3], 0.0, 0.0))),
    "thrusters": lambda k: ("thrusters", {"data": [0.1 * (k % 2)]}),
}
"""What each commands at its k-th step, by topic; the last two are followed by a step without a call of the service."""


@pytest.mark.parametrize(("runs", "count"), [(1, 50), pytest.param(20, 1000, marks=pytest.mark.stress)])
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_in_lockstep_every_command_acts_at_the_time_that_it_was_sent_for_and_one_step_follows(
    rig, controller, runs, count
):
    by_command = controller in ("wrench", "thrusters")
    kind = {"string": "string_target", "schedule": "poke"}.get(controller, controller)
    rig.set(publish_rate=1000.0, lockstep=by_command)
    for _ in range(runs):
        rig.start_over(paused=True)
        rig.until(lambda: rig.newest_ns("twist") == 0, "a twist of time 0")
        for k in range(count):
            rig.publish(*CONTROLLERS[controller](k))
            if not by_command:
                answer = rig.call("step", Trigger, pause_s=0.0005).message
                # It says what was taken before.
                assert int(answer.split("; ")[1].split()[0]) == rig.sent
            # The state of a step's end; while paused the present one comes again ten times a second.
            rig.until(lambda k=k: rig.newest_ns("twist") > k * MS, "a later twist", pause_s=0.0005)
            assert rig.newest_ns("twist") == (k + 1) * MS
        events = rig.wait_event(kind, count)
        assert [event["time_ns"] for event in events] == [k * MS for k in range(count)]


def test_inertia_is_latched_and_comes_again_at_every_change_with_its_time(rig):
    scenario = make_scenario(rig.scene)
    mass = scenario.setup.body.mass
    message = rig.until(lambda: (m := rig.heard("inertia", last=1)[0])["inertia"]["m"] == mass and m, "the inertia")
    I, com = scenario.setup.body.inertia, scenario.setup.body.center_of_mass
    assert message["header"]["frame_id"] == "rigid_body/mesh"
    assert message["inertia"] == {
        "m": scenario.setup.body.mass,
        "com": vector(com),
        "ixx": I[0, 0],
        "ixy": I[0, 1],
        "ixz": I[0, 2],
        "iyy": I[1, 1],
        "iyz": I[1, 2],
        "izz": I[2, 2],
    }
    rig.start_over(paused=True)
    before = len(rig.heard("inertia"))
    rig.set(mass=2.0)
    rig.schedule("{t: 0.6, set: {scale: [2.0]}}")
    rig.until_received(rig.sent)
    rig.pause(False)
    heard = rig.until(lambda: len(rig.heard("inertia")) >= before + 2 and rig.heard("inertia"), "inertia twice")
    assert [m["inertia"]["m"] for m in heard[before:]] == [2.0, 2.0]
    assert stamp_ns(heard[before + 1]) == 600 * MS
    assert heard[before + 1]["inertia"]["ixx"] == pytest.approx(4 * heard[before]["inertia"]["ixx"], rel=1e-12)
    # Who comes late gets the last one.
    rig.listen("inertia")
    assert (
        rig.until(lambda: len(rig.heard("inertia")) > len(heard) and rig.heard("inertia"), "latched")[-1] == heard[-1]
    )


def test_an_inertia_message_makes_the_model_explicit_and_the_parameters_follow_together(rig):
    rig.set(ballast__nut=[0.01, 0.0, 0.0, 0.07])
    rig.publish(
        "inertia/set", inertia_message(0, "rigid_body/mesh", 0.5, (0.01, 0.0, 0.02), (1e-3, 1e-5, 0, 2e-3, 0, 2.5e-3))
    )
    rig.wait_event("inertia")
    names = ("inertia_model", "explicit_inertia.mass", "explicit_inertia.center_of_mass", "explicit_inertia.tensor")
    rig.until(lambda: rig.get("inertia_model")["inertia_model"] == "explicit", "the parameters")
    values = rig.get(*names, "ballast.nut")
    assert values["explicit_inertia.mass"] == 0.5
    assert values["explicit_inertia.center_of_mass"] == [0.01, 0.0, 0.02]
    assert values["explicit_inertia.tensor"] == [1e-3, 1e-5, 0.0, 2e-3, 0.0, 2.5e-3]
    assert values["ballast.nut"] == [0.0, 0.0, 0.0, 0.07]
    rig.until(lambda: rig.heard("inertia", last=1)[0]["inertia"]["m"] == 0.5, "the inertia")
    # In the body frame the centre of mass counts from the present one.
    rig.publish("inertia/set", inertia_message(0, "body", 0.5, (0.0, 0.01, 0.0), (1e-3, 1e-5, 0, 2e-3, 0, 2.5e-3)))
    rig.wait_event("inertia", 2)
    expected = [0.01, 0.01, 0.02]
    rig.until(lambda: rig.get(names[2])[names[2]] == pytest.approx(expected, abs=1e-15), "the centre of mass")


def test_schedule_takes_an_entry_of_any_kind_or_a_list_whole_and_refuses_all_else_by_name(rig):
    before = rig.counters()
    good = {
        "{t: 0.5, set: {linear_damping: 0.25}}": ["set"],
        "{t: 0.5, string: release}": ["string_release"],
        "{t: 0.5, service: clear_wrench}": ["clear_wrench"],
        "t: 0.5\nset:\n  step: 0.002": ["set"],
        "{t: 0.5, string: {attach: tip, target: [0, 0, 0.1]}}": ["string_attach", "string_target"],
        "{t: 0.5, force: [0, 0, 1.0e-3]}": ["poke"],
        "{t: 0.5, at: tip, push: 1.0e-3, duration: 0.1}": ["poke"],
        "{t: 0.5, impulse: [0, 0, 1.0e-6], repeat: 2, every: 0.0}": ["poke", "poke"],
        "{t: 0.5, wrench: {at: tip, torque: [0, 0, 1.0e-6]}}": ["wrench"],
        "- {t: 0.4, string: release}\n- {t: 0.4, impulse: [0, 0, 1.0e-6]}": ["string_release", "poke"],
        '[{"t": 0.4, "impulse": [0, 0, 1e-6]}, {"t": 0.4, "set": {"density": 7800}}, {"t": 0.4, "service": "clear_wrench"}]': [
            *("poke", "set", "clear_wrench")
        ],
    }
    bad = {
        "nonsense": 1,
        # A list is taken or refused as a whole, and counts as many as it has entries.
        "[{t: 0.5, string: release}, {t: 0.5, set: {masss: 1.0}}, {t: 0.5, service: clear_wrench}]": 3,
        "[{t: 0.5, string: release}, {t: 0.5, string: {attach: nowhere}}]": 2,
        "[{t: 0.5, string: release}, 5]": 2,
    }
    rig.start_over(paused=True)
    rig.schedule(*good, *bad)
    taken = len(good) + 3
    rig.sent += taken - len(good) + sum(bad.values()) - len(bad)
    rig.until_received(rig.sent)
    rig.pause(False)
    kinds = [kind for kinds in good.values() for kind in kinds]
    for kind in set(kinds):
        rig.wait_event(kind, kinds.count(kind))
    gained = rig.gained(before, "schedule_received", "commands_received")
    assert gained == {
        "schedule_received": taken + sum(bad.values()),
        "commands_received": taken + sum(bad.values()),
        "refused_total": sum(bad.values()),
        "refused_schedule": sum(bad.values()),
    }
    acted = [(event["time_ns"], event["kind"]) for event in rig.events() if event["kind"] != "pause"]
    # Lists as they arrived; then by kind.
    lists = [kinds for text, kinds in good.items() if text[0] in "-["]
    assert [kind for time_ns, kind in acted if time_ns == 2 * SECOND // 5] == [k for kinds in lists for k in kinds]
    ranks = {"string_attach": 2, "string_target": 3, "wrench": 4, "poke": 5}
    single = [ranks.get(kind, 0) for time_ns, kind in acted if time_ns == SECOND // 2]
    assert single == sorted(single) and len(acted) == len(kinds)
    assert rig.get("linear_damping", "step") == {"linear_damping": 0.25, "step": 0.002}


def test_a_list_is_judged_in_the_scene_that_it_makes_and_one_refused_in_any_entry_leaves_no_trace(rig):
    rig.set(integrator="free_body")
    before = rig.counters()
    poke = '{"t": 0.2, "at": "tip", "force": [0, 0, 0.001]}'
    rig.start_over(paused=True)
    rig.schedule(f'[{{"t": 0.1, "set": {{"linear_damping": 0.5}}}}, {poke}, {{"t": 5000, "string": "release"}}]')
    rig.schedule(f"[{poke}]", f'[{{"t": 0.2, "set": {{"integrator": "auto"}}}}, {poke}]')
    rig.sent += 3
    rig.until_received(rig.sent)
    rig.pause(False)
    rig.wait_event("poke")
    assert [event["kind"] for event in rig.events() if event["kind"] != "pause"] == ["set", "poke"]
    gained = rig.gained(before)
    assert gained == {"refused_total": 4, "refused_integrator": 4}


def test_the_string_topics_tie_move_and_release_through_messages(rig):
    rig.set(string__timeout=0.5, string__stiffness=1.0)
    rig.publish("string/attach", point_message(0, "rigid_body/mesh", (0.0, -0.05, 0.0)))
    rig.publish("string/target", point_message(0, "", (0.3, 0.0, 0.2)))
    (target,) = rig.wait_event("string_target")
    rig.until(lambda: rig.now_ns() > target["time_ns"] + 700 * MS, "the timeout")
    rig.pause(True)
    report = rig.diagnostics()
    # The string's energy is gone with it; what it gave to the body stays.
    assert float(report["potential_energy"]) == 0.0
    assert float(report["kinetic_energy"]) > 2.0 * Simulation(make_scenario(rig.scene).setup).kinetic_energy
    assert rig.events("string_attach")[0]["content"]["point"] == [0.0, -0.05, 0.0]
    rig.pause(False)
    rig.set(string__timeout=0.0)
    rig.publish("string/target", point_message(0, "world", (0.3, 0.0, 0.2)))
    rig.wait_event("string_target", 2)
    assert float(rig.diagnostics()["potential_energy"]) > 0.0
    assert rig.trigger("string/release")["success"]
    rig.wait_event("string_release")
    assert float(rig.diagnostics()["potential_energy"]) == 0.0


def test_scene_is_latched_follows_every_change_and_carries_the_meshs_hash(rig):
    scenario = make_scenario(rig.scene)
    text = rig.heard("scene", last=1)[0]["data"]
    assert f"# mesh_sha256: {scenario.body_mesh.mesh.sha256}" in text
    before = len(rig.heard("scene"))
    rig.set(mass=1.25)
    rig.schedule("{t: 0.0, set: {gravity: [0.0, 0.0, -2.0]}}")
    rig.publish("inertia/set", inertia_message(0, "", 0.5, (0.01, 0.0, 0.02), (1e-3, 0, 0, 2e-3, 0, 2.5e-3)))
    texts = rig.until(lambda: len(rig.heard("scene")) >= before + 3 and rig.heard("scene"), "three scenes")[before:]
    assert "mass: 1.25" in texts[0]["data"]
    assert "gravity: [0.0, 0.0, -2.0]" in texts[-1]["data"]
    assert "explicit_inertia.mass: 0.5" in texts[-1]["data"]


@pytest.mark.parametrize("list_first", [True, False])
def test_paused_a_parameter_and_a_list_hold_in_the_order_in_which_they_come(rig, list_first):
    rig.start_over(paused=True)
    if not list_first:
        rig.set(gravity=[0.0, 0.0, 0.0])
    rig.schedule("[{t: 0, set: {gravity: [0, 0, -5]}}]")
    rig.until_received(rig.sent)
    if list_first:
        rig.set(gravity=[0.0, 0.0, 0.0])
    assert rig.trigger("step")["success"]
    _, twist = rig.state_at(10 * MS)
    gravity = 0.0 if list_first else -5.0
    assert twist["twist"]["linear"]["z"] == pytest.approx(0.01 * gravity, rel=1e-9)
    assert list(rig.get("gravity")["gravity"]) == [0.0, 0.0, gravity]


def acceleration(rig) -> float:
    """Along x [m/s²] over states from after the last command has acted."""
    rig.until_received(rig.sent)
    acted_ns = int(rig.diagnostics()["sim_time_ns"]) + 100 * MS
    first, *_, last = rig.until(lambda: len(m := rig.heard("twist", after=acted_ns)) >= 5 and m, "five later twists")
    gained = last["twist"]["linear"]["x"] - first["twist"]["linear"]["x"]
    return round(gained / (1e-9 * (stamp_ns(last) - stamp_ns(first))), 6)


def test_running_the_last_message_acts_however_fast_it_follows(rig):
    """Of two back to back, of a controller's at 1 kHz that ends with zero, and of thrusters on and off at once."""
    rig.set(mass=1.0, wrench_timeout=0.0, real_time_factor=2.0)
    for last in (0.0, 0.3):
        for _ in range(5):
            rig.publish("wrench", *(wrench_message(0, "world", (force, 0.0, 0.0)) for force in (1.0, last)))
            assert acceleration(rig) == pytest.approx(last, abs=1e-5)
    messages = [wrench_message(0, "world", (0.1 + 0.001 * k, 0.0, 0.0)) for k in range(100)]
    for _ in range(3):
        rig.publish("wrench", *messages, wrench_message(0, ""), rate=1000.0)
        assert acceleration(rig) == 0.0
        rig.publish("thrusters", {"data": [1.0]}, {"data": [0.0]})
        assert acceleration(rig) == 0.0


def numbers(vector: dict) -> np.ndarray:
    return np.array(list(vector.values()))


def felt(body, arm, attitude, rate, force_world) -> np.ndarray:
    """Specific force, body axes, at ``arm`` (m from the COM) of a body that falls under a force at its COM.

    Gravity accelerates body and reference alike, so it isn't felt. rate: angular velocity, body axes.
    """
    turning = np.linalg.solve(body.inertia, -np.cross(rate, body.inertia @ rate))
    at_com = Rotation.from_quat(attitude).inv().apply(force_world) / body.mass
    return at_com + np.cross(turning, arm) + np.cross(rate, np.cross(rate, arm))


def test_the_imu_feels_the_exact_specific_force_at_its_contact_and_turns_at_the_body_rate(rig):
    force = np.array([0.0, 0.02, 0.01])
    rig.set(imu_contact="left", gravity=[0.0, 0.0, -9.81], scale=[1.5, 0.8, 2.0], wrench_timeout=0.0)
    rig.listen("imu")
    rig.start_over(paused=True)
    rig.until(lambda: rig.heard("imu"), "the node to know that somebody listens")
    rig.forget("imu")
    rig.publish("wrench", wrench_message(SECOND // 2, "world@com", force))
    rig.until_received(rig.sent)
    rig.pause(False)
    for topic in ("odom", "imu"):
        rig.until(lambda topic=topic: rig.newest_ns(topic) >= SECOND * 7 // 10, f"{topic} of that time")
    body = make_scenario({**rig.scene, "scale": [1.5, 0.8, 2.0]}).setup.body
    arm = body.point(rig.scene["contacts.left"])
    odometry = {stamp_ns(m): m["twist"]["twist"] for m in rig.heard("odom")}
    measured = {stamp_ns(m): m for m in rig.heard("imu")}
    moments = [ns for ns in measured if 0 < ns <= SECOND * 7 // 10 and ns in odometry]
    assert sum(ns <= SECOND // 2 for ns in moments) > 10
    assert sum(ns > SECOND // 2 for ns in moments) > 5
    for ns in moments:
        message = measured[ns]
        assert message["header"]["frame_id"] == "rigid_body/left"
        rate, attitude = numbers(message["angular_velocity"]), list(message["orientation"].values())
        assert message["angular_velocity"] == odometry[ns]["angular"]
        expected = felt(body, arm, attitude, rate, force if ns > SECOND // 2 else np.zeros(3))
        assert np.linalg.norm(expected) > 1.0
        # Measured 2e-15.
        assert numbers(message["linear_acceleration"]) == pytest.approx(expected, rel=1e-12, abs=1e-12)
    # At the centre of mass a body in free fall feels nothing but the force. It is mounted there from the very time on
    # at which the command acts.
    rig.trigger("clear_wrench")
    now_ns = int(rig.diagnostics()["sim_time_ns"])
    rig.forget("imu")
    moved_ns = now_ns + SECOND // 5
    rig.schedule(f"{{t: {moved_ns / SECOND!r}, set: {{imu_contact: ''}}}}")
    rig.until(lambda: rig.newest_ns("imu") > moved_ns + SECOND // 10, "the COM's")
    for message in rig.heard("imu"):
        at_com, place = message["header"]["frame_id"] == "rigid_body", stamp_ns(message)
        assert at_com == (place > moved_ns) or place == moved_ns
        if place > now_ns + SECOND // 10:
            assert (np.abs(numbers(message["linear_acceleration"])).max() == 0.0) == at_com
