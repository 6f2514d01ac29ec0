# SPDX-License-Identifier: MIT
"""The grammar of a wrench's frame: every form is read back as it is written, anything else is refused and nothing more."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.frames import RESERVED_WORDS, Frame, check_contact_name, contact_point, parse_frame

numbers = st.floats(allow_nan=False, allow_infinity=False)
triples = st.tuples(numbers, numbers, numbers)
points = st.one_of(
    st.just(("com",)),
    st.just(("origin",)),
    st.sampled_from(["left_2", "tip"]).map(lambda name: ("contact", name)),
    st.integers(0, 10**10 - 1).map(lambda i: ("vertex", i)),
    triples.map(lambda p: ("point", p)),
    st.tuples(triples, triples.filter(any)).map(lambda r: ("ray", *r)),
)
options = st.one_of(st.just((None, False)), st.just((None, True)), st.floats(1e-9, 1e9).map(lambda d: (d, False)))
frames = st.builds(
    lambda axes, point, option: Frame(axes, point, *option),
    st.sampled_from(("world", "body", "normal")),
    points,
    options,
).filter(lambda frame: (frame.axes, frame.point) != ("normal", ("com",)))


@given(frames)
def test_every_frame_is_read_back_as_it_is_written(frame):
    assert parse_frame(frame.text) == frame


@settings(max_examples=100, deadline=None)
@given(st.one_of(st.text(), st.text("worldbdynma@/;,.0123456789e+-impulsevtxpotrcg=", max_size=40)))
def test_any_text_is_read_or_refused(text):
    try:
        frame = parse_frame(text)
    except CommandRefused as refusal:
        assert refusal.reason in ("frame", "nonfinite")
        return
    assert parse_frame(frame.text) == frame


@pytest.mark.parametrize(
    ("text", "axes", "point"),
    [
        ("", "world", ("com",)),
        ("world", "world", ("com",)),
        ("body", "body", ("com",)),
        ("map", "world", ("com",)),
        ("robot", "body", ("com",)),
        ("map@tip", "world", ("contact", "tip")),
        ("tip", "body", ("contact", "tip")),
        ("origin", "body", ("origin",)),
        ("vertex/7", "body", ("vertex", 7)),
        ("point/1,-2.5,3e-1", "body", ("point", (1.0, -2.5, 0.3))),
        ("normal@ray/0,0,1/0,0,-1", "normal", ("ray", (0.0, 0.0, 1.0), (0.0, 0.0, -1.0))),
    ],
)
def test_short_forms_mean_what_the_table_says(text, axes, point):
    frame = parse_frame(text, "map", "robot")
    assert (frame.axes, frame.point) == (axes, point)


@pytest.mark.parametrize(
    "text",
    [
        *("world@", "@com", "world@mesh", "World", " world", "world ", "world@com@com", "world@Tip", "normal"),
        *("vertex/-1", "vertex/1.0", "vertex/", "vertex/1/2", "vertex/١", "point/1,2", "point/1,2,3,4", "point/1,2,x"),
        *("point/1, 2,3", "point/nan,0,0", "point/inf,0,0", "point/0x1,0,0", "ray/0,0,0/0,0,0", "ray/0,0,0"),
        *("world;", "world;duration", "world;duration=", "world;duration=0", "world;duration=-1", "world;duration=nan"),
        *("world;duration=1e10", "world;impulse;impulse", "world;impulse;duration=1", "world;duration=1;duration=2"),
        *("world;speed=1", "com\0", "x" * 1025, "mesh", "contact/tip"),
    ],
)
def test_what_is_no_frame_is_refused_as_one(text):
    with pytest.raises(CommandRefused) as refusal:
        parse_frame(text)
    assert refusal.value.reason == "frame"
    assert len(str(refusal.value)) < 3000


def test_a_contact_that_the_body_lacks_is_refused_with_those_it_has():
    assert contact_point("tip", {"tip": (1.0, 2.0, 3.0)}) == (1.0, 2.0, 3.0)
    with pytest.raises(CommandRefused, match="'tp'; accepted: a contact of the body .tip., or com, .*did you mean tip"):
        contact_point("tp", {"tip": (1.0, 2.0, 3.0)})


def test_an_overflowing_number_is_refused_as_not_finite():
    with pytest.raises(CommandRefused) as refusal:
        parse_frame("point/1e999,0,0")
    assert refusal.value.reason == "nonfinite"
    assert math.isfinite(parse_frame("point/1e308,0,0").point[1][0])


def test_a_contact_can_not_take_a_word_of_the_grammar():
    check_contact_name("tip_2")
    for name in (*RESERVED_WORDS, "Tip", "2tip", "_tip", "tip-1", "", "tip\n", "té"):
        with pytest.raises(CommandRefused):
            check_contact_name(name)
