# SPDX-License-Identifier: MIT
"""Links: a scene and a script in one line, back without a loss, and nothing else through them."""

from __future__ import annotations

import base64
import json
import random
import re
import zlib

import pytest
from hand_session import random_hand_session

from rigid_proto_ros.base.bundled import example_names, example_path, scene_names, scene_path
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scene_file import read_scene_text
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.scene.yaml_text import flow
from rigid_proto_ros.workbench import link
from rigid_proto_ros.workbench.save_as_script import save_as_script


def packed(content) -> str:
    """A link of anything, as somebody who means no good makes one."""
    data = content if isinstance(content, bytes) else json.dumps(content).encode()
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    return "1." + base64.urlsafe_b64encode(packer.compress(data) + packer.flush()).decode().rstrip("=")


@pytest.mark.parametrize("name", scene_names())
def test_every_scene_goes_through_a_link(name: str) -> None:
    text = link.encode(scene_path(name).read_text("utf-8"))
    assert re.fullmatch(r"[A-Za-z0-9._~-]+", text)
    assert len(text) < 1000
    scene, script = link.decode(text)
    assert make_scenario(read_scene_text(scene).values).parameters == read_scene(name).parameters
    assert parse_script(script) == []


def test_every_example_script_goes_through_a_link() -> None:
    scene = scene_path("t_handle").read_text("utf-8")
    scripts = [example_path(name).read_text("utf-8") for name in example_names()]
    scripts = [text for text in scripts if "\n- {t:" in text]
    assert len(scripts) >= 6
    for text in [
        *scripts,
        "{repeat: 3, every: 1.0, seed: 4, script: [{t: 1, at: com, force: [0, 0, 1], jitter: 0.1}]}",
    ]:
        assert parse_script(link.decode(link.encode(scene, text))[1]) == parse_script(text)


def test_a_hand_session_opens_elsewhere_as_the_same_motion() -> None:
    hand = random_hand_session(3, 3.0)
    saved = save_as_script(hand.session())
    scene, script = link.decode(link.encode(saved.scene, saved.script))
    run = OfflineRun(make_scenario(read_scene_text(scene).values), parse_script(script))
    run.advance(hand.now_ns)
    assert run.simulation.state.sha256() == hand.simulation.state.sha256()


@pytest.mark.parametrize("script", [None, [], {"script": None}, {"script": [], "repeat": 2, "every": 1.0}])
def test_a_link_without_commands_has_an_empty_script(script) -> None:
    assert parse_script(link.decode(packed({"scene": {}, "script": script}))[1]) == []


def test_the_address_that_a_link_stands_in_is_read_as_the_link() -> None:
    assert link.decode(f"http://127.0.0.1:8080/?{GOOD}") == link.decode(GOOD)


GOOD = link.encode(scene_path("t_handle").read_text("utf-8"), "- {t: 1.0, at: tip, push: 0.03}")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1.",
        "2" + GOOD[1:],
        GOOD[:-3],
        GOOD + "AAAA",
        GOOD.replace(GOOD[20], "!", 1),
        "1." + "A" * 70_000,
        packed(b"\xff\xfe"),
        packed(b"[" * 100_000),
        packed([]),
        packed({"scene": {}}),
        packed({"scene": [], "script": []}),
        packed({"scene": {"mass": "NaN"}, "script": []}),
        packed({"scene": {"no_such": 1}, "script": []}),
        packed({"scene": {}, "script": [{"t": 0, "no_such": 1}]}),
        packed({"scene": {}, "script": 5}),
        packed({"scene": {}, "script": [5]}),
        packed({"scene": {}, "script": [{"t": 0, "set": {"mesh": "/etc/passwd"}}]}),
        packed({"scene": {}, "script": [{"t": 0, "set": {"record": "x.rrd"}}]}),
        packed({"scene": {"mesh": "../secret.obj"}, "script": []}),
        packed({"scene": {"mesh": "package://rigid_proto_ros/x.obj"}, "script": []}),
        packed({"scene": {"record": "/tmp/x.mcap"}, "script": []}),
        packed({"scene": {"viewer": "native"}, "script": []}),
        packed({"scene": {}, "script": [{"t": 0, "force": [0, 0, 1], "repeat": 1000000, "every": 0.1}]}),
        packed({"scene": {}, "script": [{"t": 0, "wrench": {"force": [0, 0, 1], "duration": 1e9}}]}),
        packed({"scene": {}, "script": {"script": [{"t": 0, "force": [0, 0, 1]}] * 400, "repeat": 400, "every": 1}}),
    ],
)
def test_a_link_that_is_none_or_reaches_beyond_the_body_is_refused(text: str) -> None:
    with pytest.raises(InputError) as refused:
        link.decode(text)
    assert len(str(refused.value)) < 1000


def test_a_bomb_is_refused_without_being_unpacked() -> None:
    bomb = packed(b'{"scene": {}, "script": [' + b" " * 40_000_000 + b"]}")
    assert len(bomb) < link.MAX_LINK
    with pytest.raises(InputError, match="the link holds more than"):
        link.decode(bomb)


def test_damaged_links_are_refused_or_read_and_nothing_else_happens() -> None:
    rng = random.Random(1)
    for _ in range(300):
        letters = list(GOOD)
        for _ in range(rng.randint(1, 4)):
            letters[rng.randrange(len(letters))] = rng.choice("ABCabc012-_.")
        try:
            link.decode("".join(letters))
        except InputError:
            pass


@pytest.mark.parametrize(
    "scene, script",
    [
        ("rigid_body: {ros__parameters: {mesh: /home/me/part.stl}}", ""),
        ("rigid_body: {ros__parameters: {mesh: book}}", "- {t: 0, set: {mesh: part.stl}}"),
        ("rigid_body: {ros__parameters: {mesh: book}}", "- {t: 0"),
        ("rigid_body: {ros__parameters: {mesh: book}}", "- 5"),
    ],
)
def test_what_a_link_cannot_carry_is_refused_when_it_is_made(scene: str, script: str) -> None:
    with pytest.raises(InputError):
        link.encode(scene, script)


def test_a_script_too_long_for_a_link_is_refused_when_it_is_made() -> None:
    rng = random.Random(2)

    def three() -> list[float]:
        return [rng.random() for _ in range(3)]

    entries = [{"t": 0.1, "at": {"point": three()}, "force": three(), "torque": three()} for _ in range(900)]
    script = "".join(f"- {flow(entry)}\n" for entry in entries)
    with pytest.raises(InputError, match="as a file"):
        link.encode("rigid_body: {ros__parameters: {mesh: book}}", script)
