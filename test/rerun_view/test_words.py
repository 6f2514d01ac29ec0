# SPDX-License-Identifier: MIT
"""Lines of the event log in words."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("rerun")

from scripts import EVERY_KIND

from rigid_proto_ros.rerun_view.words import words_of
from rigid_proto_ros.scene.command_codec import EVENT_KINDS, MARKS
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.simulation.observer import Logged, Observer

ZERO = [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("kind", "content", "words"),
    [
        ("poke", ("world@tip;duration=0.1", [0.03, 0.0, 0.0], ZERO), "poke 0.03 N at tip, 0.1 s"),
        ("poke", ("world@right;impulse", [0.0, 3e-4, 4e-4], ZERO), "poke 0.0005 N s at right"),
        ("wrench", ("body;slot=hand", [0.0, 0.0, 2.0], [0.0, 1.0, 0.0]), "wrench 2 N and 1 N m at com, slot hand"),
        ("wrench", ("", ZERO, ZERO), "wrench 0 N at com"),
        ("poke", ("vertex/7", [1.0, 0.0, 0.0], ZERO), "poke 1 N at vertex/7"),
        (
            "string_attach",
            {"frame_id": "body/mesh", "point": [0.0, 0.0, 0.07]},
            "string tied at (0, 0, 0.07) (body/mesh)",
        ),
        ("string_target", {"point": [0.1, 0.0, -2.0]}, "string's free end to (0.1, 0, -2) m"),
        ("string_release", {}, "string released"),
        ("set", {"mass": 0.5, "gravity": [0.0, 0.0, -9.81]}, "mass = 0.5, gravity = (0, 0, -9.81)"),
        ("pause", {"data": True}, "paused"),
        ("pause", {"data": False}, "resumed"),
        ("jump", {"by_ns": -6_500_000_000}, "/clock jumped by -6.5 s"),
        ("reset", {}, "reset"),
    ],
)
def test_an_event_is_said_in_words(kind, content, words):
    if isinstance(content, tuple):
        content = dict(zip(("frame_id", "force", "torque"), content, strict=True))
    assert words_of(json.dumps({"time_ns": 0, "kind": kind, "content": content, "sha256": ""})) == words


def test_every_event_of_a_flight_has_words():
    class Listening(Observer):
        takes = frozenset({Logged})
        lines: list[str] = []

        def on(self, event):
            if isinstance(event, Logged):
                self.lines.append(event.line)

    run = OfflineRun(read_scene("t_handle"), parse_script(EVERY_KIND), Listening())
    run.advance(5_000_000_000)
    kinds = {json.loads(line)["kind"] for line in Listening.lines}
    assert kinds <= {*EVENT_KINDS, *MARKS} and len(kinds) > 6
    for line in Listening.lines:
        said = words_of(line)
        assert said and "{" not in said and len(said) < 90, said
