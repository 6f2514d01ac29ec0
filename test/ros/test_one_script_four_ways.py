# SPDX-License-Identifier: MIT
"""A random scene with its script flies alike, to the bit: by simulate, by poke_client to a node, by a recording of that node
whose commands are sent again, and by each recording's own check.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import count, islice
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("mcap")

from random_scenes import Scene, random_scene
from ros_client import RosClient
from ros_process import run, running_node

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import expand_script
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.recorded_session import RecordedSession, decode_event

FEWEST = 3
"""Entries of a script that is worth four flights."""


def flies(scene: Scene) -> bool:
    """Whether nothing of a scene is refused, at its start or in flight."""
    try:
        flight = OfflineRun(make_scenario(scene.values), expand_script(scene.script))
    except InputError:
        return False
    return flight.advance(scene.end_ns) and not flight.simulation.refused and len(scene.script) >= FEWEST


def acted(session: RecordedSession, end_ns: int) -> list:
    """What a run's events say of commands, but for the recording's own."""
    events = [decode_event(line, number) for number, line in enumerate(session.lines, 1)]
    return [e for e in events if e[1] not in ("reset", "pause") and "record" not in e[2] and e[0] < end_ns]


@pytest.mark.parametrize("flights", [1, pytest.param(10, marks=pytest.mark.stress)])
def test_a_script_flies_alike_by_simulate_client_recording_and_replay(ros_environment, tmp_path, monkeypatch, flights):
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    for number, scene in islice(((k, s) for k in count(1) if flies(s := random_scene(k))), flights):
        folder = tmp_path / str(number)
        folder.mkdir()
        four_ways(ros_environment, folder, scene)


def four_ways(environment: dict[str, str], folder: Path, scene: Scene) -> None:
    """Fly a scene in all four ways and compare them."""
    scene_file, script = folder / "scene.yaml", folder / "script.yaml"
    values = make_scenario(scene.values).parameters.named()  # of their declared types
    scene_file.write_text(json.dumps({"/**": {"ros__parameters": {name: values[name] for name in scene.values}}}))
    script.write_text(json.dumps(scene.script))
    offline, sent, again = paths = [folder / f"{way}.mcap" for way in ("simulate", "client", "replay")]
    arguments = ["--script", str(script), "--duration", str(scene.end_ns / 1e9), "--bag", str(offline)]
    assert main(["simulate", str(scene_file), *arguments]) == 0

    def record(path: Path, send: Callable[[], None]) -> None:
        names = ("--params-file", scene_file)
        with RosClient(environment) as client, running_node(environment, path, {"record": str(path)}, *names):
            client.meet()
            send()
            client.until(lambda: int(client.diagnostics()["sim_time_ns"]) >= scene.end_ns, "the end of the script")
            client.set(record="")

    def by_client() -> None:
        done = run("poke_client", script, "--reset", "--timeout", 120, environment=environment)
        assert done.returncode == 0, done.stdout + done.stderr

    record(sent, by_client)
    record(again, lambda: main(["replay", str(sent), "--publish", "commands"]))
    for path in paths:
        assert main(["replay", str(path), "--verify"]) == 0, path
    flown = [read_runs(path)[-1] for path in paths]
    for other in flown[1:]:
        assert acted(other, scene.end_ns) == acted(flown[0], scene.end_ns)
        for name, rows in flown[0].published.items():
            states = other.published[name]
            at = {time: k for k, time in enumerate(states.times.tolist())}
            common = [
                (k, at[time]) for k, time in enumerate(rows.times.tolist()) if 0 < time < scene.end_ns and time in at
            ]
            assert len(common) > len(rows.times) // 2
            for k, j in common:
                assert rows.rows[k].tobytes() == states.rows[j].tobytes(), (name, rows.times[k])
