# SPDX-License-Identifier: MIT
"""Sessions as .mcap: what is in them equals the simulation, stock readers decode them, and nothing stops the flight."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import sys
import threading
import time
import tracemalloc
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from subprocess import run

import numpy as np
import pytest
import yaml

pytest.importorskip("mcap_ros2")

from conftest import needs_rerun
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory

from rigid_proto_ros.base.bundled import example_path
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.export.flight_record import FlightRecord
from rigid_proto_ros.live.live_simulation import LiveSimulation
from rigid_proto_ros.mesh.locate import resolve_mesh
from rigid_proto_ros.rerun_view.recorders import make_recorders
from rigid_proto_ros.scene.scenario import make_scenario, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun, notify_start
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.check import verify
from rigid_proto_ros.session.mcap_observer import McapObserver
from rigid_proto_ros.session.messages import TOPICS, twist_row
from rigid_proto_ros.session.recorded_session import RecordedSession, StateRows, find_mesh, play
from rigid_proto_ros.simulation.observer import Logged, Observer, Observers, Published, SceneChanged, Started
from rigid_proto_ros.sweep.flights import Flight, load_scene

SECOND = 10**9


class Kept(Observer):
    """States, event lines and scenes as the simulation told them."""

    def __init__(self) -> None:
        self.states: dict[int, list[float]] = {}
        self.lines: list[str] = []
        self.scenes: list[str] = []

    takes = frozenset({Published, Logged, Started, SceneChanged})

    def on(self, event) -> None:
        if isinstance(event, Published):
            self.states[event.time_ns] = event.row.tolist()
        elif isinstance(event, Logged):
            self.lines.append(event.line)
        elif isinstance(event, Started | SceneChanged):
            self.scenes.append(event.scene)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A recorded run with pokes and changes in flight, and what the simulation told."""
    path = tmp_path_factory.mktemp("flown") / "session.mcap"
    kept, recorder = Kept(), McapObserver(path, simulated_log=True)
    scenario = read_scene("t_handle")
    run = OfflineRun(scenario, read_script(example_path("heavier_in_flight")), Observers(recorder, kept))
    assert run.advance(6 * SECOND)
    recorder.close()
    return path, kept


def decoded(path) -> dict[str, list]:
    """(log time, decoded message) by topic, through the stock reader."""
    with open(path, "rb") as stream:
        found: dict[str, list] = {}
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, content in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, content))
    return found


def stamp(header) -> int:
    return header.stamp.sec * SECOND + header.stamp.nanosec


def test_the_stock_reader_decodes_every_state_to_the_bit(flown):
    path, kept = flown
    messages = decoded(path)
    poses, twists = messages["/rigid_body/pose"], messages["/rigid_body/twist"]
    assert [stamp(m.header) for _, m in poses] == [stamp(m.header) for _, m in twists] == list(kept.states)
    for (_, pose), (_, twist), row in zip(poses, twists, kept.states.values(), strict=True):
        p, q, v, w = pose.pose.position, pose.pose.orientation, twist.twist.linear, twist.twist.angular
        assert [p.x, p.y, p.z, q.x, q.y, q.z, q.w] == row[:7]
        assert [v.x, v.y, v.z, w.x, w.y, w.z] == twist_row(row)
        assert pose.header.frame_id == twist.header.frame_id == "world"


def test_events_scene_applied_and_inertia_are_there(flown):
    path, kept = flown
    messages = decoded(path)
    assert [m.data for _, m in messages["/rigid_body/events"]] == kept.lines
    scenes = [m.data for _, m in messages["/rigid_body/scene"]]
    sets = [line for line in kept.lines if json.loads(line)["kind"] == "set"]
    assert len(sets) > 0 and len(scenes) == 1 + len(sets)
    assert scenes[0] == read_scene("t_handle").text
    masses = [m.inertia.m for _, m in messages["/rigid_body/inertia"]]
    assert len(masses) == 1 + len(sets) and len(set(masses)) == len(masses)
    applied = messages["/rigid_body/applied"]
    pokes = [json.loads(line) for line in kept.lines if json.loads(line)["kind"] in ("poke", "wrench")]
    assert [stamp(m.header) for _, m in applied] == [event["time_ns"] for event in pokes]
    assert {m.header.frame_id for _, m in applied} == {"rigid_body"}
    force = applied[0][1].wrench.force
    # In the body's axes.
    assert np.linalg.norm([force.x, force.y, force.z]) == pytest.approx(np.linalg.norm(pokes[0]["content"]["force"]))


def test_viewers_of_bags_find_the_body_its_mesh_and_where_it_is(flown):
    path, kept = flown
    messages = decoded(path)
    for _, message in messages["/tf"]:
        (moved,) = message.transforms
        row, place, turn = kept.states[stamp(moved.header)], moved.transform.translation, moved.transform.rotation
        assert (moved.header.frame_id, moved.child_frame_id) == ("world", "rigid_body")
        assert [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w] == row[:7]
    # Thirty a second at most, whatever is published.
    times = [log for log, _ in messages["/tf"]]
    assert len(times) > 100 and np.diff(times).min() >= SECOND / 30 - 1
    robots = [ElementTree.fromstring(message.data) for _, message in messages["/rigid_body/robot_description"]]
    # One for each mass.
    assert len(robots) == len(messages["/rigid_body/inertia"])
    body = read_scene("t_handle").setup.body
    link = robots[0].find("link")
    assert link.get("name") == "rigid_body" and float(link.find("inertial/mass").get("value")) == body.mass
    assert float(link.find("inertial/inertia").get("ixy")) == body.inertia[0, 1]
    mesh, origin = link.find("visual/geometry/mesh"), link.find("visual/origin")
    assert mesh.get("filename") == resolve_mesh("t_handle").absolute().as_uri()
    assert [float(part) for part in origin.get("xyz").split()] == (-body.center_of_mass).tolist()


@needs_rerun
def test_reruns_converter_of_bags_draws_the_mesh_in_the_frame_that_the_transforms_move(flown, tmp_path):
    from rerun.chunk import RrdReader

    rerun = Path(sys.executable).with_name("rerun")
    run([rerun, "mcap", "convert", flown[0], "-o", tmp_path / "seen.rrd"], check=True, capture_output=True)
    columns: dict[str, set[str]] = {}
    for chunk in RrdReader(tmp_path / "seen.rrd").stream():
        columns.setdefault(chunk.entity_path, set()).update(chunk.to_record_batch().schema.names)
    assert {"Transform3D:translation", "Transform3D:quaternion", "Transform3D:child_frame"} <= columns["/tf"]
    assert {"Asset3D:blob", "CoordinateFrame:frame"} <= columns["/rigid_body/visual_geometries/rigid_body/visual_0"]


def test_a_run_without_a_clock_is_logged_at_simulated_time_in_chunks_of_half_a_second(flown):
    path, kept = flown
    with open(path, "rb") as stream:
        reader = make_reader(stream)
        chunks, (attachment,) = reader.get_summary().chunk_indexes, reader.iter_attachments()
        assert reader.get_header().profile == "ros2"
    assert [log for log, _ in decoded(path)["/rigid_body/pose"]] == list(kept.states)
    # What a cut loses.
    assert max(chunk.message_end_time - chunk.message_start_time for chunk in chunks) <= SECOND // 2
    assert attachment.data == resolve_mesh("t_handle").read_bytes()


def test_a_session_is_read_back_and_verified(flown):
    path, kept = flown
    (session,) = read_runs(path)
    assert session.complete
    assert session.lines == kept.lines
    assert session.times.tolist() == list(kept.states)
    rows = np.array(list(kept.states.values()))
    assert session.rows[:, :10].tobytes() == rows[:, :10].tobytes()
    assert np.abs(session.rows[:, 10:] - rows[:, 10:]).max() < 1e-13  # measured 7e-15: there and back through the world
    assert verify(session) is None


def test_meshes_come_from_inside_where_their_files_are_gone_or_others(tmp_path):
    prism, hammer = tmp_path / "prism.obj", tmp_path / "hammer.obj"
    # A prism on a concave pentagon: its shell depends on which triangles are one polygon.
    corners = ["2 0", "2 2", "1 0.5", "0 2", "0 0"]
    faces = ["5 4 3 2 1", "6 7 8 9 10", *(f"{k} {k % 5 + 1} {k % 5 + 6} {k + 5}" for k in range(1, 6))]
    prism.write_text("\n".join([*(f"v {c} {z}" for z in (0, 1) for c in corners), *(f"f {face}" for face in faces)]))
    hammer.write_text("# mine\n" + resolve_mesh("hammer").read_text())
    session, script = str(tmp_path / "session.mcap"), tmp_path / "script.yaml"
    script.write_text(f"- {{t: 0.2, set: {{mesh: {hammer}}}}}\n- {{t: 0.3, at: com, impulse: [1, 0, 0]}}\n")
    flown = ["book", "--set", f"mesh={prism}", "--set", "inertia_model=shell", "--set", "mass=1"]
    flown += ["--set", "initial.angular_velocity=[1, 2, 3]"]
    flown += ["--script", str(script), "--duration", "0.5", "--record", session]
    assert main(["simulate", *flown]) == 0
    prism.unlink()
    hammer.write_text("# another\n" + resolve_mesh("teapot").read_text())
    assert main(["replay", session, "--verify"]) == 0
    again = str(tmp_path / "again.mcap")
    assert main(["replay", session, "--record", again]) == 0
    Path(session).unlink()
    assert main(["replay", again, "--verify"]) == 0


@pytest.mark.parametrize("name", ["../../x.obj", "x\0y.obj", "x" * 300 + ".obj"])
def test_a_mesh_inside_a_recording_is_read_whatever_its_name(name):
    data = resolve_mesh("book").read_bytes()
    session = RecordedSession(attachments=[(name, data)])
    assert find_mesh(session, "gone.obj", hashlib.sha256(data).hexdigest()).vertices.size


def test_a_recording_takes_the_place_of_an_earlier_one_and_of_no_other_file(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    link = tmp_path / "flight.mcap"
    link.symlink_to("notes.txt")
    os.mkfifo(tmp_path / "pipe.rrd")
    for path in (link, tmp_path / "pipe.rrd"):
        with pytest.raises(InputError, match="something else"):
            make_recorders(str(path))
    assert link.read_text() == "mine"


@pytest.mark.parametrize("first", ["book", "mesh"])
def test_a_mesh_whose_file_changed_before_it_was_set_again_is_each_time_the_one_that_flew(tmp_path, first):
    kept = Kept()
    file, contents = tmp_path / "mesh.obj", [resolve_mesh(name).read_bytes() for name in ("hammer", "l_bracket")]
    file.write_bytes(contents[0])
    scene = load_scene("t_handle", {"mesh": "book" if first == "book" else str(file)})
    flight = Flight(scene, observer=kept)
    for content, mesh in zip((contents[0], contents[0], contents[1]), (file, "teapot", file), strict=True):
        file.write_bytes(content)
        flight.command({"set": {"mesh": str(mesh)}})
        flight.command({"at": {"vertex": 3}, "force": [0.0, 0.0, 1.0]})
        state = flight.step(0.1)
    session = RecordedSession(
        scene=kept.scenes[0],
        events=[(json.loads(line)["time_ns"], line) for line in kept.lines],
        states=StateRows(np.array([state.time_ns]), state.row[None]),
        scenes=kept.scenes,
        attachments=[(file.name, content) for content in contents],
    )
    assert verify(session) is None


@pytest.mark.parametrize(("faces", "setting"), [(5, "mesh_repair=true"), (6, "mesh_repair=false")])
def test_a_mesh_that_was_repaired_or_wound_inward_comes_from_inside(faces, setting, tmp_path):
    mesh, session, script = tmp_path / "box.obj", str(tmp_path / "session.mcap"), tmp_path / "script.yaml"
    vertices = [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 2)]
    inward = ["3 4 2 1", "6 8 7 5", "2 6 5 1", "7 8 4 3", "5 7 3 1", "4 8 6 2"]
    mesh.write_text("\n".join([f"# {tmp_path}", *vertices, *(f"f {face}" for face in inward[:faces])]))
    script.write_text("- {t: 0.1, at: {point: [0.5, 0.5, 2.0]}, push: 1, duration: 0.1}\n")
    setup = [item for value in (f"mesh={mesh}", "mass=1", setting) for item in ("--set", value)]
    assert main(["simulate", "book", *setup, "--script", str(script), "--duration", "0.3", "--record", session]) == 0
    mesh.unlink()
    assert main(["replay", session, "--verify"]) == 0


def test_runs_in_quick_succession_and_changes_at_their_start_are_told_apart(tmp_path, capsys):
    session, again = tmp_path / "session.mcap", tmp_path / "again.mcap"
    values = {
        "mesh": "hammer",
        "publish_rate": 100.0,
        "start_paused": True,
        "initial.angular_velocity": [1.0, 4.0, 2.0],
    }
    live = LiveSimulation(make_scenario({**values, "record": str(session)}))
    live.announce()
    live.start()
    for change, periods in (({"mass": 2.0}, 5), ({}, 0), ({"scale": 2.0}, 3), ({"inertia_model": "shell"}, 4)):
        if change:
            live.set_parameters(change)
        if periods:
            live.step(periods)
        live.reset()
    live.stop()
    assert [len(run.times) for run in read_runs(session)] == [5, 0, 3, 4, 0]
    assert main(["replay", str(session), "--verify"]) == 0
    assert main(["replay", str(session), "--record", str(again)]) == 0
    assert [len(run.times) for run in read_runs(again)] == [5, 0, 3, 4, 0]
    assert main(["replay", str(again), "--verify"]) == 0
    assert capsys.readouterr().out.count("verified") == 2


@needs_rerun
@pytest.mark.parametrize("both", [["--record", "s.mcap,s.rrd"], ["--record", "s.rrd", "--bag", "s.mcap"]])
def test_recording_and_view_of_one_flight_hold_the_same_run_and_a_recording_becomes_either(both, tmp_path, monkeypatch):
    from rerun_flight import drawn, verified

    monkeypatch.chdir(tmp_path)
    arguments = ["simulate", "t_handle", "--script", str(example_path("flip_and_poke")), "--duration", "2"]
    assert main([*arguments, *both]) == 0
    (run,) = read_runs("s.mcap")
    assert drawn(Path("s.rrd")) == run.times.tolist() and verified(Path("s.rrd"))
    assert main(["replay", "s.mcap", "--record", "again.mcap,again.rrd"]) == 0
    (again,) = read_runs("again.mcap")
    assert again.lines == run.lines and again.scene == run.scene
    assert again.published["twist"].rows.tobytes() == run.published["twist"].rows.tobytes()
    assert drawn(Path("again.rrd")) == run.times.tolist() and verified(Path("again.rrd"))


def test_channels_say_what_the_nodes_publishers_offer(flown):
    path, _ = flown
    with open(path, "rb") as stream:
        channels = make_reader(stream).get_summary().channels.values()
    offered = {c.topic.rpartition("/")[2]: yaml.safe_load(c.metadata["offered_qos_profiles"]) for c in channels}
    assert sorted(offered) == sorted(name.strip("/") for name in TOPICS)
    for name, profiles in offered.items():
        (profile,) = profiles
        # The keys in the order in which rosbag2 writes them (rosbag2_storage/qos.cpp).
        assert list(profile) == [
            *("history", "depth", "reliability", "durability", "deadline", "lifespan"),
            *("liveliness", "liveliness_lease_duration", "avoid_ros_namespace_conventions"),
        ]
        latched = name in ("scene", "inertia", "robot_description")
        assert profile["durability"] == ("transient_local" if latched else "volatile")
        assert profile["reliability"] == "reliable" and profile["history"] == "keep_last"
        assert profile["depth"] == (1 if latched else 10 if name in ("pose", "twist") else 1000)
        # What rmw calls infinite.
        assert profile["deadline"] == {"sec": 9223372036, "nsec": 854775807}
    rosbags = pytest.importorskip("rosbags.highlevel")
    with rosbags.AnyReader([path]) as bag:
        latched = {c.topic: c.ext.offered_qos_profiles[0].durability.name == "TRANSIENT_LOCAL" for c in bag.connections}
    kept = [f"/rigid_body/{name}" for name in ("inertia", "robot_description", "scene")]
    assert [topic for topic in sorted(latched) if latched[topic]] == kept


def test_verify_takes_no_more_memory_for_ten_times_as_long_a_recording(tmp_path):
    script, peaks = tmp_path / "script.yaml", []
    for seconds in (1, 10):
        session = tmp_path / f"{seconds}.mcap"
        script.write_text(f"- {{t: 0, at: com, impulse: [1e-6, 0, 0], repeat: {100 * seconds}, every: 0.01}}\n")
        flown = ["--script", str(script), "--duration", str(seconds), "--set", "publish_rate=1000"]
        assert main(["simulate", "t_handle", *flown, "--record", str(session)]) == 0
        tracemalloc.start()
        (run,) = read_runs(session)
        assert verify(run) is None
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert len(run.events) == 100 * seconds
    # Measured: 1.4 and 1.4 MB; in memory a state took 1.8 kB and a command 3 kB, here 30 MB more.
    assert peaks[1] < peaks[0] + 1_000_000, peaks


def test_a_path_that_cannot_be_written_is_refused(tmp_path, capsys):
    full = tmp_path / "full.mcap"
    full.symlink_to("/dev/full")
    for path in (full, full / "s.mcap"):
        with pytest.raises(InputError, match="record"):
            McapObserver(path)
    assert main(["simulate", "book", "--duration", "0.1", "--bag", str(tmp_path / "s.bag")]) == 2
    assert ".mcap" in capsys.readouterr().err
    for option, place in (
        ("--bag", "/proc/s.mcap"),
        ("--record", "/proc/s.mcap"),
        ("--bag", f"{tmp_path}/{'x' * 300}.mcap"),
    ):
        assert main(["simulate", "book", "--duration", "0.1", option, place]) == 2
        out, err = capsys.readouterr()
        assert out == "" and err.startswith(f"rigid_proto simulate: {option}: got '{place}'")
    assert list(tmp_path.iterdir()) == [full]


@pytest.mark.parametrize("ending", ["rrd", "mcap"])
def test_the_command_that_shows_a_recording_can_be_pasted(ending, tmp_path, capsys):
    if ending == "rrd":
        pytest.importorskip("rerun")
    path = tmp_path / "Ünï dir" / f"f ö.{ending}"
    option = "--bag" if ending == "mcap" else "--record"
    assert main(["simulate", "book", "--duration", "0.1", option, str(path)]) == 0
    recorded, told = capsys.readouterr().out.splitlines()[-1].split("; show it with: ")
    seen = ["rigid_proto", "replay", str(path), "--record", str(path.with_suffix(".rrd"))]
    assert recorded == f"recorded {path}"
    assert shlex.split(told) == (seen if ending == "mcap" else ["rerun", str(path)])


def test_a_file_that_takes_nothing_is_told_as_long_as_it_does(tmp_path, monkeypatch):
    flowing, path, deadline = threading.Event(), tmp_path / "s.mcap", time.monotonic() + 180.0
    flush = Writer.flush

    def flush_later(self) -> None:
        flowing.wait()
        flush(self)

    monkeypatch.setattr(Writer, "flush", flush_later)
    observer = McapObserver(path)
    while not observer.stalled:
        assert time.monotonic() < deadline, "nothing is told"
        time.sleep(0.05)
    assert observer.stalled.startswith(f"recording {path}: nothing could be written for ") and not observer.error
    flowing.set()
    while observer.stalled:
        assert time.monotonic() < deadline, "it is told on and on"
        time.sleep(0.05)
    observer.close()
    assert not observer.error


def test_a_converted_session_keeps_the_names_of_its_frames(tmp_path):
    names = ["--set", "world_frame=map", "--set", "body_frame=hull"]
    session, converted = (str(tmp_path / f"{name}.mcap") for name in ("s", "converted"))
    assert main(["simulate", "book", *names, "--duration", "0.1", "--record", session]) == 0
    assert main(["replay", session, "--record", converted]) == 0
    topics = decoded(converted)
    assert {m.header.frame_id for _, m in topics["/rigid_body/pose"]} == {"map"}
    assert {m.header.frame_id for _, m in topics["/rigid_body/inertia"]} == {"hull/mesh"}


def test_no_ghost_is_made_up_for_a_recording_that_was_begun_later():
    scenario, flown = read_scene("true_or_box_tensor"), FlightRecord()
    OfflineRun(scenario, observer=flown).advance(10**8)
    other = scenario.with_changes({"initial.angular_velocity": [1.0, 2.0, 3.0]})
    # A flight that is stepped has no state at 0; of the other scene it can't have come from the start.
    for scene, first in ((scenario, 0), (scenario, 1), (other, 1)):
        session = RecordedSession(scene=scene.text, states=StateRows(flown.times_ns[first:], flown.rows[first:]))
        play(session, told := FlightRecord())
        assert np.array_equal(told.rows, flown.rows[first:])
        assert list(told.ghosts) == (list(flown.ghosts)[first:] if scene is scenario else [])


def test_a_recording_without_states_has_nothing_to_verify(tmp_path, capsys):
    recorder = McapObserver(tmp_path / "empty.mcap")
    notify_start(recorder, read_scene("book"))
    recorder.close()
    assert main(["replay", str(tmp_path / "empty.mcap"), "--verify"]) == 2
    out, err = capsys.readouterr()
    assert "nothing to verify" in err and err.count("\n") == 1 and "verified" not in out


def test_a_folder_with_several_recordings_is_not_taken_for_one_flight(tmp_path, capsys):
    for name in ("one", "two"):
        assert main(["simulate", "book", "--duration", "0.1", "--bag", str(tmp_path / f"{name}.mcap")]) == 0
    assert main(["replay", str(tmp_path)]) == 2
    assert "one of the 2 recordings in this folder" in capsys.readouterr().err
    (tmp_path / "two.mcap").unlink()
    assert main(["replay", str(tmp_path), "--verify"]) == 0


def test_a_node_that_a_recording_does_not_hold_is_refused(tmp_path, capsys):
    session = str(tmp_path / "s.mcap")
    assert main(["simulate", "book", "--duration", "0.2", "--record", session]) == 0
    assert main(["replay", session, "--node", "/rigid_body"]) == 0
    capsys.readouterr()
    assert main(["replay", session, "--node", "other"]) == 2
    assert "one of the recording's: /rigid_body" in capsys.readouterr().err


def test_wrenches_and_thrusters_that_a_change_of_their_timeout_ends_are_verified(tmp_path):
    scene, script, session = tmp_path / "scene.yaml", tmp_path / "script.yaml", tmp_path / "s.mcap"
    scene.write_text("/**:\n  ros__parameters:\n    thrusters: {up: [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]}\n")
    script.write_text(
        "- {t: 0.0, wrench: {force: [1, 0, 0]}}\n- {t: 0.0, thrusters: [0.5]}\n- {t: 0.5, set: {wrench_timeout: 0.1}}\n"
    )
    assert main(["simulate", str(scene), "--script", str(script), "--duration", "1", "--bag", str(session)]) == 0
    (run,) = read_runs(session)
    kinds = [(time_ns, json.loads(line)["kind"]) for time_ns, line in list(run.events)[2:]]
    assert kinds == [(SECOND // 2, "set"), (SECOND // 2, "timeout"), (SECOND // 2, "timeout")]
    assert verify(run) is None
