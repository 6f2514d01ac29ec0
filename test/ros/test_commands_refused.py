# SPDX-License-Identifier: MIT
"""What the node refuses, each with its reason, and that it flies on untouched: by message, by the group and by fuzz."""

import math
import time

from command_rig import inertia_message, point_message, wrench_message
from hypothesis import HealthCheck, given, settings
from hypothesis.strategies import (
    binary,
    builds,
    characters,
    floats,
    integers,
    just,
    lists,
    one_of,
    sampled_from,
    text,
    tuples,
)
from ros_client import COMMANDS

from rigid_proto_ros.scene import cdr

SECOND = 10**9
HUGE = (1e15, 0.0, 0.0)
NAN, INF = math.nan, math.inf

FRAMES = ("nowhere", "@com", "vertex/99999999", "normal@com", "body/mesh", "tip;impuls", "\x01", "w" * 10_000, "日本")
UNIT = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
REFUSED = {
    "frame": [
        *(("poke", wrench_message(0, frame, (1e-3, 0.0, 0.0))) for frame in FRAMES),
        ("wrench", wrench_message(0, "tip;impulse", (1e-3, 0.0, 0.0))),
        ("poke", wrench_message(0, "normal@tip", (1.0, 1.0, 0.0))),
        ("poke", wrench_message(0, "normal@tip", (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))),
        ("string/target", point_message(0, "body", (0, 0, 0))),
        ("string/attach", point_message(0, "tip", (0, 0, 0))),
        ("inertia/set", inertia_message(0, "world", 1, (0, 0, 0), UNIT)),
    ],
    "nonfinite": [
        ("poke", wrench_message(0, "tip", (NAN, 0, 0))),
        ("wrench", wrench_message(0, "", (0, 0, 0), (-INF, 0, 0))),
        ("poke", wrench_message(0, "point/1e999,0,0", (1, 0, 0))),
        ("string/target", point_message(0, "", (NAN, 0, 0))),
        ("string/attach", point_message(0, "body", (0, INF, 0))),
        ("inertia/set", inertia_message(0, "body", 1, (0, INF, 0), UNIT)),
    ],
    "magnitude": [
        *(("poke", wrench_message(0, frame, HUGE)) for frame in ("", "world@tip", "body;impulse", "normal@tip")),
        ("wrench", wrench_message(0, "", (-1e308, 1e308, 1e308))),
        ("wrench", wrench_message(0, "", (0, 0, 0), (0, 1e12, 0))),
        ("poke", wrench_message(0, "point/1e300,0,0", (1.0, 1.0, 0))),
        ("string/target", point_message(0, "", (1e60, 0, 0))),
        ("string/attach", point_message(0, "body", (1e308, 0, 0))),
    ],
    "schedule": [
        ("schedule", {"data": text})
        for text in (
            "{t: 0, set: {gyroscopic: !!bool x}}",
            "{t: !!int '', set: {density: 2}}",
            "{t: 0, set: {gravity: !!set {1, 2, 3}}}",
            "{t: 0, set: {gravity: {1, 2, 3}}}",
            "{t: 1, set: {gravity: [&a [1, 1, 1], &b [*a, *a, *a], [*b, *b, *b]]}}",
            "{t: 1, set: &a {density: 2, <<: *a}}",
            "{t: 0, set: {density: 2}, repeat: 1000000, every: 0.001}",
            "{t: 0, wrench: {force: [0, 0, 1], duration: -1}}",
            "{t: 0, set: {record: somewhere.mcap}}",
            "{t: 0, set: {mesh: '~nosuchuser/part.obj'}}",
            "{t: 0, set: {mesh: " + 300 * "a" + "}}",
            "{t: 2026-13-45, set: {density: 2}}",
            "{t: .nan, set: {mass: 1}}",
            "{t: 0.5, service: reset}",
            "{t: 0.5, string: release, set: {mass: 1.0}}",
            "{t: 0.5, set: {world_frame: map}}",
            "{t: 0.5, set: {contacts.tip: [0.0, 0.0, 0.0]}}",
            '[{"t": NaN, "string": "release"}]',
            "!!python/object:os.system {t: 0}",
            "[" * 5000,
            "",
            "[]",
        )
    ],
    "ray_miss": [
        ("poke", wrench_message(0, "ray/10,10,10/1,0,0", (1e-3, 0, 0))),
        ("wrench", wrench_message(0, "world@ray/0,0,3/0,0,1", (1e-3, 0, 0))),
    ],
    "thrusters": [("thrusters", {"data": [1.0, 0.0]}), ("schedule", {"data": "{t: 0, thrusters: [1, 0]}"})],
    "state": [("schedule", {"data": "{t: 0, state: {orientation_xyzw: [0, 0, 0, 0]}}"})],
    "tensor": [
        ("inertia/set", inertia_message(0, "", 0.0, (0, 0, 0), UNIT)),
        ("inertia/set", inertia_message(0, "", 1e200, (0, 0, 0), UNIT)),
        ("inertia/set", inertia_message(0, "", 1.0, (0, 0, 0), (1, 0, 0, 1, 0, 3))),
        ("inertia/set", inertia_message(0, "", 1.0, (0, 0, 0), (1e-14, 0, 0, 1, 0, 1))),
        ("inertia/set", inertia_message(0, "", 1.0, (0, 0, 1e200), UNIT)),
    ],
    # Neither past, nor within the horizon, nor within a day of the system's clock.
    "stamp": [
        ("poke", wrench_message(3660 * SECOND, "tip", (1e-3, 0, 0))),
        ("wrench", wrench_message(1_000_000 * SECOND, "tip", (1e-3, 0, 0))),
        ("string/target", point_message(2_147_483_647 * SECOND, "", (0, 0, 0))),
        ("string/attach", point_message(100_000_000 * SECOND, "body", (0, 0, 0))),
        ("inertia/set", inertia_message(100_000_000 * SECOND, "", 1, (0, 0, 0), UNIT)),
        ("schedule", {"data": "{t: 1e8, service: clear_wrench}"}),
    ],
}


def test_everything_is_refused_with_its_reason_and_counted_and_the_body_flies_on(rig):
    before = rig.counters()
    for topic in COMMANDS:
        rig.publish(topic, *(message for commands in REFUSED.values() for t, message in commands if t == topic))
    counts = {f"refused_{reason}": len(commands) for reason, commands in REFUSED.items()}
    total = sum(counts.values())
    # A ray is refused when its poke is to act, a tick after it was taken.
    gained = rig.until(lambda: (now := rig.gained(before)).get("refused_total", 0) >= total and now, "refusals of all")
    assert gained == {"refused_total": total, **counts}
    report = rig.diagnostics()
    assert report["state"] == "flying"
    assert not rig.heard("applied") and not rig.events()
    # Torque-free all the while: not one of them has touched it.
    assert float(report["angular_momentum_drift"]) < 1e-9


def test_refusals_are_warned_of_at_most_once_a_second_also_when_they_are_to_act(rig):
    node = rig.node_process
    warned = node.errors.count("refused:")
    start = time.monotonic()

    def warned_twice() -> bool:
        rig.repeat(["wrench"], wrench_message(0, "mars"), 100, rate=100.0)
        rig.sent += 100
        rig.until_received(rig.sent)
        return node.errors.count("refused:") - warned >= 2

    # A node that got no time takes what has come meanwhile within one second.
    rig.until(warned_twice, "second warning")
    elapsed_s = time.monotonic() - start
    # One at once, then one for each full second that has passed: however slow the machine, never more.
    assert node.errors.count("refused:") - warned <= 1 + elapsed_s
    rig.pause(True)
    rig.publish("poke", wrench_message(0, "world@ray/5,5,5/1,0,0", (1e-3, 0.0, 0.0)))
    rig.until_received(rig.sent)
    rig.pause(False)
    rig.until(lambda: "5.0,5.0,5.0" in node.errors, "a warning")


def test_a_change_that_the_integrator_cant_carry_is_refused_and_counted_naming_those_that_can(rig):
    rig.start_over(paused=False)
    ((accepted, reason),) = rig.set(integrator="free_body")
    assert accepted, reason
    before = rig.counters()
    ((accepted, reason),) = rig.set(gyroscopic=False)
    assert not accepted
    assert "rk4" in reason
    rig.publish("wrench", wrench_message(0, "world@tip", (1e-3, 0, 0)))
    gained = rig.gained(before)
    assert gained == {"refused_total": 2, "refused_integrator": 2}
    assert rig.get("gyroscopic") == {"gyroscopic": True}
    rig.publish("poke", wrench_message(0, "world@tip;impulse", (1e-5, 0, 0)))
    rig.wait_event("poke")


REFUSED_VALUES: list[tuple[dict, str]] = [
    ({"mass": -1.0}, "mass"),
    ({"scale": [0.0, 1.0, 1.0]}, "scale"),
    ({"integrator": "magic"}, "integrator"),
    ({"mesh": "no_such_body"}, "no_such_body"),
    ({"mesh": ""}, "mesh"),
    ({"inertia_model": "explicit", "explicit_inertia.tensor": [1.0, 0, 0, 1.0, 0, 3.0]}, "tensor"),
    ({"ballast.nut": [-1e9, 0.0, 0.0, 0.0]}, "mass"),
    ({"ballast.Nut": [1.0, 0.0, 0.0, 0.0]}, "ballast.Nut"),
    ({"gyroscopic": 1}, "gyroscopic"),
    ({"masss": 1.0}, "did you mean mass"),
    ({"world_frame": "map"}, "world_frame"),
    ({"contacts.tip": [0.0, 0.0, 0.0]}, "contacts.tip"),
    ({"use_sim_time": True}, "use_sim_time"),
    ({"linear_damping": 0.5, "use_sim_time": 3}, "use_sim_time"),
    ({"linear_damping": 0.5, "start_type_description_service": False}, "start_type_description_service"),
    ({"linear_damping": 0.5, "qos_overrides.none": 1}, "qos_overrides.none"),
    ({"gravity": [NAN, NAN, NAN]}, "gravity"),
    ({"scale": ["a", "b"]}, "scale"),
    ({"mesh": [True]}, "mesh"),
    ({"string.attached": True, "ghost.integrator": "free_body"}, "ghost.integrator"),
]


def test_a_refused_parameter_says_why_and_leaves_the_old_value_in_force(rig):
    before = rig.get(*rig.names())
    for values, named in REFUSED_VALUES:
        ((accepted, reason),) = rig.set_named(values, atomically=True)
        assert not accepted and named in reason and "\n" not in reason, values
    assert rig.get(*before) == before


def test_several_set_atomically_are_judged_together_and_refused_together(rig):
    before = rig.get("mass", "step", "linear_damping")
    ((accepted, reason),) = rig.set(mass=2.0, step=0.002, linear_damping=-1.0, atomically=True)
    assert not accepted
    assert "linear_damping" in reason
    assert rig.get(*before) == before
    # One by one, each is judged by itself.
    results = rig.set(mass=2.0, step=0.002, linear_damping=-1.0)
    assert [accepted for accepted, _ in results] == [True, True, False]
    assert rig.get(*before) == {"mass": 2.0, "step": 0.002, "linear_damping": before["linear_damping"]}
    # Together they are fine, alone neither would be.
    assert rig.set(mesh="", inertia_model="explicit", atomically=True)[0][0]
    assert not rig.set(inertia_model="solid")[0][0]
    assert rig.set(mesh="t_handle", inertia_model="solid", atomically=True)[0][0]


DOUBLES = {"wrench": 6, "poke": 6, "string/target": 3, "string/attach": 3, "inertia/set": 10}
odd_frames = sampled_from(FRAMES) | text(characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=40)
odd_stamps = just(0) | integers(-(2**31), 2**31 - 1).map(lambda seconds: seconds * SECOND)
too_short = binary(max_size=39).map(lambda data: cdr._HEADER + data)


def malformed(topic: str):
    """With its topic, a serialized message with odd frame, stamp and numbers, of which one isn't finite."""
    numbers = lists(floats(), min_size=DOUBLES[topic] - 1, max_size=DOUBLES[topic] - 1).map(lambda x: [*x, NAN])
    return tuples(just(topic), builds(cdr.stamped_doubles, odd_stamps, odd_frames, numbers) | too_short)


@given(
    messages=lists(
        one_of(*map(malformed, DOUBLES), tuples(just("schedule"), odd_frames.map(cdr.string) | too_short)), min_size=100
    )
)
@settings(max_examples=3, suppress_health_check=list(HealthCheck))
def test_malformed_messages_are_each_refused_and_leave_the_node_flying(rig, messages):
    before = rig.counters()
    for topic, message in messages:
        rig.publish(topic, message)
    gained = rig.gained(before, "commands_received")
    # A text that happens to be a list counts as many as it has entries.
    assert gained["refused_total"] == gained.pop("commands_received") >= len(messages)
    assert gained.pop("refused_total") == sum(gained[key] for key in gained if key.startswith("refused_"))
    report = rig.diagnostics()
    assert report["state"] == "flying" and float(report["angular_momentum_drift"]) < 1e-8
    assert not rig.heard("applied")
