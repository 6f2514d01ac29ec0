# SPDX-License-Identifier: MIT
"""A recording is evidence: any single change of it is found and named, and what can't be decoded is refused."""

from __future__ import annotations

import json
import random
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import randoms

pytest.importorskip("mcap")

from scripts import EVERY_KIND

from rigid_proto_ros.base.bundled import example_names, example_path, scene_names
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.check import verify
from rigid_proto_ros.session.mcap_observer import McapObserver
from rigid_proto_ros.session.messages import FIELDS
from rigid_proto_ros.session.recorded_session import RecordedSession
from rigid_proto_ros.simulation.observer import EventLog

SECOND = 10**9

SCRIPT = EVERY_KIND + "- {t: 1.1, set: {publish_clock: true}}\n"


@pytest.fixture(scope="module")
def session(tmp_path_factory) -> RecordedSession:
    """A run with every kind of command in it, some without effect on the motion."""
    folder = tmp_path_factory.mktemp("flown")
    (folder / "script.yaml").write_text(SCRIPT)
    recorder = McapObserver(folder / "s.mcap", simulated_log=True)
    assert OfflineRun(read_scene("t_handle"), read_script(folder / "script.yaml"), recorder).advance(2 * SECOND)
    recorder.close()
    (read,) = read_runs(folder / "s.mcap")
    assert {json.loads(line)["kind"] for line in read.lines} == {
        *("poke", "wrench", "set", "string_attach", "string_target", "string_release", "clear_wrench")
    }
    assert verify(read) is None
    return read


def leaves(value, path=()) -> list[tuple]:
    """Paths of all fields of an event."""
    if isinstance(value, dict):
        return [leaf for key, inner in value.items() for leaf in leaves(inner, (*path, key))]
    if isinstance(value, list):
        return [leaf for k, inner in enumerate(value) for leaf in leaves(inner, (*path, k))]
    return [path]


def changed_value(value, rng: random.Random):
    """Another value of the same type, as little or as much different as it may be."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + rng.choice((-1, 1, 1_000_003)) if value else 1
    if isinstance(value, float):
        return rng.choice((float(np.nextafter(value, 10.0)), value + 1.0, -value if value else 1e-300))
    at = rng.randrange(len(value)) if value else 0
    return value[:at] + ("0" if value[at : at + 1] != "0" else "1") + value[at + 1 :]


def with_line(session: RecordedSession, number: int, line: str) -> RecordedSession:
    events = list(session.events)
    events[number] = (events[number][0], line)
    return replace(session, events=events)


@given(rng=randoms(use_true_random=False))
@settings(max_examples=20, deadline=None)
def test_a_random_change_of_an_event_is_found_and_named(session, rng):
    number = rng.randrange(len(session.events))
    event = json.loads(session.lines[number])
    path = rng.choice(leaves(event))
    holder = event
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = changed_value(holder[path[-1]], rng)
    difference = verify(with_line(session, number, json.dumps(event)))
    assert difference is not None, path
    assert f"command {number + 1} " in str(difference), (path, difference)


@pytest.mark.parametrize(
    ("force", "words"),
    # The first state after it began at .1 s.
    [(0.02, r"at 0\.11 s: state .* differs"), (1e30, r"at 0\.1 s: command 1 .* refused")],
)
def test_with_hashes_made_to_fit_the_motion_or_a_refusal_still_tells(session, force, words):
    log, events = EventLog(), []
    for number, (time_ns, line) in enumerate(session.events):
        event = json.loads(line)
        if number == 0:
            event["content"]["force"][1] = force
        events.append((time_ns, log.append(event["time_ns"], event["kind"], event["content"])))
    assert re.match(words, str(verify(replace(session, events=events))))


def test_events_added_dropped_or_swapped_are_found(session):
    lines = list(session.events)
    for events in (lines[1:], [*lines[:3], *lines[4:]], [lines[1], lines[0], *lines[2:]], [lines[0], *lines]):
        assert verify(replace(session, events=events)) is not None


class OneBit:
    """States with one bit of one number changed."""

    def __init__(self, states, topic: str, time_ns: int, column: int) -> None:
        self.topics, self.count = states.topics, states.count
        self.first_ns, self.end_ns = states.first_ns, states.end_ns
        self._states, self._topic, self._time_ns, self._column = states, topic, time_ns, column

    def __iter__(self):
        for time_ns, topic, row in self._states:
            changed = np.array(row)
            if (time_ns, topic) == (self._time_ns, self._topic):
                changed.view(np.uint64)[self._column] ^= np.uint64(1)
            yield time_ns, topic, changed


@pytest.mark.parametrize("topic", ["pose", "twist"])
def test_one_bit_of_a_state_is_found(session, topic):
    rng = random.Random(5)
    for _ in range(5):
        published = session.published[topic]
        k, column = rng.randrange(1, len(published)), rng.randrange(published.rows.shape[1])
        time_ns = int(published.times[k])
        difference = verify(replace(session, states=OneBit(session.states, topic, time_ns, column)))
        assert difference is not None and difference.time_ns == time_ns
        name = FIELDS[topic][column]
        assert re.fullmatch(rf"at \S+ s: state \d+, {topic} {name} differs: \S+ recorded, .*", str(difference))
        before = [line for time_ns, line in session.events if time_ns < difference.time_ns]
        assert difference.command == (f"command {len(before)}: {before[-1]}" if before else "")


@pytest.mark.parametrize(
    "line",
    [
        *("", "{", "[]", "null", "[" * 9999, '{"time_ns": 1}'),
        *(f'{{"time_ns": {time}, "kind": "poke", "content": {{}}}}' for time in ('"1"', "9" * 400)),
    ],
)
def test_an_event_that_cannot_be_decoded_is_refused(session, line):
    with pytest.raises(InputError, match="event 3"):
        verify(with_line(session, 2, line))


@pytest.mark.parametrize("scene", scene_names())
def test_every_bundled_scene_is_verified_with_a_script_that_fits(scene, tmp_path):
    read = partial(read_scene, scene, {"publish_rate": 20.0}, warn=lambda text: None)
    for name in example_names():
        # Others have points that this scene's body lacks; the messages to paste among the examples are no scripts.
        try:
            script = read_script(example_path(name))
            OfflineRun(read(), script)
            break
        except InputError:
            continue
    recorder = McapObserver(tmp_path / "s.mcap", simulated_log=True)
    assert OfflineRun(read(), script, recorder).advance(min(script[-1].stamp_ns, 9 * SECOND) + SECOND)
    recorder.close()
    (session,) = read_runs(tmp_path / "s.mcap")
    assert session.events
    assert verify(session) is None, name
