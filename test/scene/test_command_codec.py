# SPDX-License-Identifier: MIT
"""Commands in their four forms: each way there and back gives the same command."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.frames import Frame
from rigid_proto_ros.parameters.declarations import Parameters
from rigid_proto_ros.scene import cdr
from rigid_proto_ros.scene.command_codec import MARKS, frame_names, of_event, of_message
from rigid_proto_ros.scene.script import (
    entry_of,
    expand_schedule,
    expand_script,
    parse_script,
    read_schedule,
    schedules,
    script_text,
)
from rigid_proto_ros.simulation.commands import (
    Change,
    ClearWrench,
    Command,
    MoveString,
    ReleaseString,
    SetState,
    ThrusterCommand,
    TieString,
    WrenchCommand,
)

NODE = ("map", "top")
numbers = st.floats(-1e6, 1e6)
triples = st.tuples(numbers, numbers, numbers)
times = st.integers(0, 10**13)
points = st.one_of(
    st.sampled_from([("com",), ("origin",), ("contact", "tip"), ("contact", "left_end"), ("contact", "n")]),
    st.tuples(st.just("vertex"), st.integers(0, 10**9)),
    st.tuples(st.just("point"), triples),
    st.tuples(st.just("ray"), triples, triples.filter(any)),
)
slots = st.sampled_from([{}, {"slot": "left"}, {"slot": "a_1"}, {"slot": "y"}])
lasting = st.floats(1e-9, 1e9).map(lambda s: {"duration_s": s})
options = st.one_of(slots, st.just({"impulse": True}), st.builds(lambda a, b: a | b, lasting, slots))
values = st.one_of(numbers, st.booleans(), st.integers(-(10**9), 10**9), st.sampled_from(["rk4", "on", "1e3", ""]))
changes = st.dictionaries(
    st.sampled_from(["mass", "gravity", "string.target", "integrator", "ballast.nut"]),
    st.one_of(values, st.lists(numbers, min_size=1, max_size=4)),
    min_size=1,
)


@st.composite
def loads(draw) -> WrenchCommand:
    """A wrench or a poke in its frame's own words."""
    held, axes, point = draw(st.booleans()), draw(st.sampled_from(["world", "body", "normal"])), draw(points)
    if axes == "normal" and point == ("com",):
        point = ("origin",)
    force, torque = draw(triples), draw(triples)
    if axes == "normal":
        force, torque = (force[0], 0.0, 0.0), (0.0, 0.0, 0.0)
    frame = Frame(axes, point, **draw(slots if held else options))
    return WrenchCommand(held, frame, force, torque, frame.text, stamp_ns=draw(times))


others = st.one_of(
    st.builds(lambda t, p: MoveString(p, "world", stamp_ns=t), times, triples),
    st.builds(lambda t, p: TieString("mesh", p, "body/mesh", stamp_ns=t), times, triples),
    st.builds(lambda t, c: Change(c, stamp_ns=t), times, changes),
    st.builds(lambda t, f: ThrusterCommand(f, stamp_ns=t), times, triples),
    st.builds(lambda t, p: SetState({"position": p}, stamp_ns=t), times, triples),
    st.builds(lambda t, kind: kind(stamp_ns=t), times, st.sampled_from([ReleaseString, ClearWrench])),
)


def told(kind: str, time_ns: int, frame_id: str, **content) -> Command:
    return of_event(kind, {"stamp_ns": time_ns, "frame_id": frame_id, **content})


inertias = st.builds(
    lambda t, f, n: told("inertia", t, f, mass=n[0], com=n[1:4], tensor=n[4:]),
    times,
    st.sampled_from(["", "body", "body/mesh"]),
    st.lists(numbers, min_size=10, max_size=10),
)
knots = st.builds(
    lambda t, f, p: told("string_attach", t, f, point=p), times, st.sampled_from(["", "body", "world"]), triples
)
commands = st.one_of(loads(), others, inertias, knots)


def can_be_an_entry(command: Command) -> bool:
    try:
        entry_of(command)
    except InputError:
        return False
    return True


@given(commands)
def test_a_command_comes_back_from_its_line_in_the_log(command: Command) -> None:
    again = of_event(command.kind, json.loads(json.dumps(command.content)))
    assert replace(again, stamp_ns=command.stamp_ns) == command
    assert again.rank == command.rank
    if "stamp_ns" in command.content:
        assert again.stamp_ns == command.stamp_ns


@given(st.sampled_from(["wrench", "poke"]), times, st.sampled_from(["", "top@tip", "map"]), triples, triples)
def test_a_message_and_the_line_that_tells_of_it_are_one_command(topic, time_ns, frame_id, force, torque) -> None:
    command = of_message(topic, cdr.wrench_stamped(time_ns, frame_id, force, torque), NODE)
    assert command.content == {"stamp_ns": time_ns, "frame_id": frame_id, "force": list(force), "torque": list(torque)}
    assert of_event(topic, command.content, NODE) == command


@given(st.one_of(loads(), others).filter(can_be_an_entry))
def test_a_command_comes_back_from_its_entry_in_a_script(command: Command) -> None:
    entry = {"t": command.stamp_ns / 1e9, **entry_of(command)}
    assert expand_script([entry]) == [command]
    for text in (script_text([entry]), json.dumps([entry])):
        assert parse_script(text) == [command]


@given(st.lists(st.one_of(loads(), others).filter(can_be_an_entry), max_size=8))
def test_a_script_is_sent_as_it_is_listed_each_instant_in_one_message(listed) -> None:
    script = sorted(listed, key=lambda command: command.stamp_ns)
    sent = [(time_ns, expand_schedule(read_schedule(json.dumps(entries)))) for time_ns, entries in schedules(script)]
    assert [command for _, commands in sent for command in commands] == script
    assert [time_ns for time_ns, _ in sent] == sorted({command.stamp_ns for command in script})


def test_a_poke_in_the_frame_of_the_nodes_own_name_is_read_as_the_node_reads_it() -> None:
    content = {"stamp_ns": 0, "frame_id": "rigid_body@tip", "force": [1, 0, 0], "torque": [0, 0, 0]}
    for body in ("rigid_body", "lab/rigid_body"):
        assert of_event("poke", content, ("world", body)).frame == Frame("body", ("contact", "tip"))
    content["frame_id"] = "lab/rigid_body@tip"
    assert of_event("poke", content, ("world", "lab/rigid_body")).frame == Frame("body", ("contact", "tip"))


@pytest.mark.parametrize(
    ("world", "body", "node", "refused"),
    [
        ("world", "world", "tool", "body_frame"),
        ("world", "", "lab/world", "body_frame"),
        ("map", "world", "tool", "body_frame"),
        ("world", "", "com", "body_frame"),
        ("body", "", "tool", "world_frame"),
        ("normal", "", "tool", "world_frame"),
        ("tool", "", "tool", "body_frame"),
    ],
)
def test_a_frame_whose_name_means_something_else_in_a_command_is_refused(world, body, node, refused) -> None:
    with pytest.raises(InputError, match=f"^{refused}: "):
        frame_names(Parameters(world_frame=world, body_frame=body), node)
    assert frame_names(Parameters(world_frame="map", body_frame="body"), node) == ("map", "body")
    # Two bodies of one name don't share a frame on /tf.
    assert frame_names(Parameters(), "/lab/tool") == ("world", "lab/tool")


def test_what_moves_nothing_has_no_command_and_what_is_damaged_is_named() -> None:
    for mark in MARKS:
        assert of_event(mark, {}, NODE) is None
    for kind, content in (
        ("poke", {"frame_id": "", "force": [1, 2], "torque": [0, 0, 0]}),
        ("wrench", {"frame_id": 5, "force": [1, 2, 3], "torque": [0, 0, 0]}),
        ("string_target", {"frame_id": "world"}),
        ("inertia", {"frame_id": "", "mass": 1.0, "com": [0, 0, 0], "tensor": [1]}),
        ("leap", {}),
    ):
        with pytest.raises(InputError):
            of_event(kind, content, NODE)
