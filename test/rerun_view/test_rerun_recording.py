# SPDX-License-Identifier: MIT
"""What a view shows is what the run published: scalars exactly, poses to float32; and Rerun finds it complete."""

from __future__ import annotations

import resource
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
import rerun_flight as flight
from rerun_flight import cells, drawn, record_batches, texts, verified

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.picture import style
from rigid_proto_ros.rerun_view import backend
from rigid_proto_ros.rerun_view.backend import ROS_TIME
from rigid_proto_ros.rerun_view.layout import FlightTraits, blueprint
from rigid_proto_ros.rerun_view.observer import FileRecorder
from rigid_proto_ros.rerun_view.recorders import record
from rigid_proto_ros.session.mailbox import STALLED_S
from rigid_proto_ros.session.recorded_session import RecordedSession
from rigid_proto_ros.simulation.observer import (
    BodyChanged,
    MeshChanged,
    Published,
    Reset,
    SceneChanged,
    Started,
)

COUNT = 101


@pytest.fixture(scope="module")
def states() -> np.ndarray:
    return flight.rows(COUNT)


@pytest.fixture(scope="module")
def recording(tmp_path_factory, states) -> Path:
    path = tmp_path_factory.mktemp("recording") / "session.rrd"
    observer = FileRecorder(str(path))
    flight.fly(observer, states)
    observer.close()
    assert observer.error == ""
    return path


def test_scene_mesh_event_lines_and_refusals_are_shown_in_a_file_that_rerun_finds_complete(recording):
    assert drawn(recording) == [k * flight.PERIOD_NS for k in range(COUNT)]
    assert flight.meshes(recording) == 1
    assert texts(recording, backend.SCENE) == [flight.SCENE]
    assert texts(recording, backend.EVENTS) == [
        "poke 3 N at com, 0.2 s",
        "wrench 3 N at com, 0.2 s",
    ]
    (refusal,) = texts(recording, backend.REFUSALS)
    assert "refused (frame)" in refusal
    assert verified(recording)


def test_every_published_state_has_its_pose_to_float32(recording, states):
    times, translations = cells(recording, style.BODY, "Transform3D:translation")
    _, quaternions = cells(recording, style.BODY, "Transform3D:quaternion")
    assert np.array_equal(times, flight.PERIOD_NS * np.arange(COUNT))
    assert np.array_equal(np.array(translations)[:, 0], states[:, 0:3].astype(np.float32))
    assert np.array_equal(np.array(quaternions)[:, 0], states[:, 3:7].astype(np.float32))


def test_plotted_energies_and_momentum_are_those_of_the_states(recording, states):
    # Independent of the code under test: quaternion by its own product, one state at a time.
    def rotate(q, v):
        t = 2.0 * np.cross(q[:3], v)
        return v + q[3] * t + np.cross(q[:3], t)

    times, energies = cells(recording, style.ENERGY, "Scalars:scalars")
    _, momenta = cells(recording, style.ANGULAR_MOMENTUM, "Scalars:scalars")
    _, angles = cells(recording, style.ANGULAR_MOMENTUM_ANGLE, "Scalars:scalars")
    _, rates = cells(recording, style.ANGULAR_VELOCITY_PRINCIPAL, "Scalars:scalars")
    assert np.array_equal(times, flight.PERIOD_NS * np.arange(COUNT))
    start = None
    for k, row in enumerate(states):
        L = rotate(row[3:7], flight.INERTIA @ row[10:13])
        start = L if start is None else start
        translational = 0.5 * flight.MASS * row[7:10] @ row[7:10]
        rotational = 0.5 * row[10:13] @ flight.INERTIA @ row[10:13]
        potential = -flight.MASS * flight.GRAVITY @ row[0:3]
        # Wholes first, since parts are drawn on them.
        expected = [translational + rotational + potential, translational, rotational, potential]
        assert np.allclose(energies[k], expected, rtol=1e-13, atol=1e-13)
        assert np.allclose(momenta[k], [np.linalg.norm(L), *L], rtol=1e-13, atol=1e-15)
        cosine = np.clip(L @ start / np.linalg.norm(L) / np.linalg.norm(start), -1.0, 1.0)
        assert np.isclose(np.radians(angles[k][0]), np.arccos(cosine), atol=1e-7)
        # In principal axes the energy is a sum of squares, and the largest moment has the last component.
        moments = np.linalg.eigvalsh(flight.INERTIA)
        assert np.isclose(0.5 * moments @ np.square(rates[k]), rotational, rtol=1e-12)
        assert np.isclose(np.linalg.norm(np.multiply(moments, rates[k])), np.linalg.norm(L), rtol=1e-12)


def test_a_change_of_the_body_moves_the_mesh_from_that_time_on(tmp_path, states):
    path = tmp_path / "change.rrd"
    observer = FileRecorder(str(path))
    observer.on(Started(flight.SCENE, flight.VERTICES, flight.TRIANGLES, flight.SHA256))
    observer.on(BodyChanged(0, flight.SETUP))
    observer.on(Published(0, states[0]))
    heavier = flight.setup_of(24.0, flight.COM + 0.01, 2.0 * flight.INERTIA)
    observer.on(BodyChanged(5_000_000, heavier))
    observer.on(Published(flight.PERIOD_NS, states[1]))
    observer.close()
    times, translations = cells(path, style.BODY_MESH, "Transform3D:translation")
    assert times == [0, 5_000_000]
    assert np.allclose(translations[1], translations[0] + flight.COM - heavier.body.center_of_mass, atol=1e-8)
    # The mesh stays in place about its new COM, until the next state too, as in flight.
    for frame in (style.BODY, style.CENTRE):
        times, places = cells(path, frame, "Transform3D:translation")
        assert times == [0, 5_000_000, flight.PERIOD_NS]
        shift = matrix_from_quaternion(states[0, 3:7]) @ np.full(3, 0.01)
        assert np.allclose(np.subtract(places[1], places[0]), shift, atol=1e-8)
    _, attitudes = cells(path, style.BODY, "Transform3D:quaternion")
    assert attitudes[1] == attitudes[0]
    _, energies = cells(path, style.ENERGY, "Scalars:scalars")
    velocity = states[1, 7:10]
    assert np.isclose(energies[1][1], 0.5 * 24.0 * velocity @ velocity, rtol=1e-13)


def test_another_mesh_in_flight_takes_the_place_of_the_first(tmp_path, states):
    path = tmp_path / "meshes.rrd"
    changed = flight.SCENE.replace(flight.SHA256, "ab" * 32)
    observer = FileRecorder(str(path))
    flight.fly(observer, states[:20])
    observer.on(SceneChanged(200_000_000, changed))
    observer.on(MeshChanged(200_000_000, 2.0 * flight.VERTICES, flight.TRIANGLES, "ab" * 32))
    observer.on(BodyChanged(200_000_000, flight.SETUP))
    observer.on(Published(200_000_000, states[20]))
    observer.on(Reset())
    observer.on(Published(0, states[21]))
    observer.close()
    assert (flight.meshes(tmp_path / "meshes.run1.rrd"), flight.meshes(path)) == (2, 1)
    assert texts(tmp_path / "meshes.run1.rrd", backend.SCENE) == [flight.SCENE, changed]
    assert texts(path, backend.SCENE) == [changed]
    first = cells(tmp_path / "meshes.run1.rrd", style.BODY_MESH, "Transform3D:scale")
    second = cells(tmp_path / "meshes.run1.rrd", style.BODY_MESH + "_2", "Transform3D:scale")
    scale = flight.SCALE.tolist()
    assert first[0] == [0, 200_000_000] and np.allclose(first[1], [[scale], [[1e-9] * 3]])
    assert second[0] == [0, 200_000_000] and np.allclose(second[1], [[[1e-9] * 3], [scale]])
    # Nor is it seen earlier by the wall's clock.
    clocks = (
        cells(tmp_path / "meshes.run1.rrd", style.BODY_MESH + end, "Transform3D:scale", ROS_TIME) for end in ("", "_2")
    )
    (first, _), (second, _) = clocks
    assert second[0] <= first[0]


def test_a_mesh_that_comes_again_is_not_logged_again(tmp_path, states):
    """A viewer forgets no mesh: a node whose mesh is changed for an hour would fill it."""
    path = tmp_path / "again.rrd"
    observer = FileRecorder(str(path))
    flight.fly(observer, states[:20])
    for k in range(20, 30):
        sides, sha256 = (2.0, "ab" * 32) if k % 2 == 0 else (1.0, flight.SHA256)
        observer.on(MeshChanged(k * flight.PERIOD_NS, sides * flight.VERTICES, flight.TRIANGLES, sha256))
        observer.on(BodyChanged(k * flight.PERIOD_NS, flight.SETUP))
        observer.on(Published(k * flight.PERIOD_NS, states[k]))
    observer.close()
    assert flight.meshes(path) == 2
    shown, hidden = flight.SCALE.tolist(), [1e-9] * 3
    for entity, first in ((style.BODY_MESH, True), (style.BODY_MESH + "_2", False)):
        times, scales = cells(path, entity, "Transform3D:scale")
        assert times == [0, *(k * flight.PERIOD_NS for k in range(20, 30))]
        turns = [[shown if (k % 2 == 0) == first else hidden] for k in range(11)]
        assert np.allclose(scales, turns)


def test_each_principal_axis_has_its_own_label(recording):
    texts = [
        batch.column("Points3D:labels").to_pylist()
        for entity, static, batch in record_batches(recording)
        if static and entity == f"{style.PRINCIPAL_AXES}/label" and "Points3D:labels" in batch.schema.names
    ]
    assert texts == [[["I₁", "I₂", "I₃"]]]


def test_a_reset_keeps_the_run_before_beside_the_new_one_which_begins_with_what_is_then_in_force(tmp_path, states):
    path = tmp_path / "session.rrd"
    observer = FileRecorder(str(path))
    flight.fly(observer, states[:50])
    changed = flight.SCENE + "    mass: 2.0\n"
    observer.on(SceneChanged(490_000_000, changed))
    observer.on(Reset())
    observer.on(Published(0, states[0]))
    # A run whose time never left 0 isn't kept.
    observer.on(Reset())
    for k, row in enumerate(states[50:60]):
        observer.on(Published(k * flight.PERIOD_NS, row))
    observer.close()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["session.rrd", "session.run1.rrd"]
    before = tmp_path / "session.run1.rrd"
    assert len(drawn(path)) == 10 and len(drawn(before)) == 50
    assert flight.meshes(path) == flight.meshes(before) == 1
    assert texts(before, backend.SCENE)[0] == flight.SCENE and texts(path, backend.SCENE) == [changed]
    assert texts(path, backend.EVENTS) == []
    assert verified(path) and verified(before)


def test_a_file_that_cannot_be_written_is_refused_at_once(tmp_path):
    (tmp_path / "taken").touch()  # no folder can be made where a file is
    (tmp_path / "full.rrd").symlink_to("/dev/full")
    for name in ("taken/session.rrd", "session.mcap", ".", "full.rrd"):
        with pytest.raises(InputError, match="[Nn]o space" if name == "full.rrd" else "record"):
            FileRecorder(str(tmp_path / name))


def test_a_session_that_cannot_be_played_leaves_an_earlier_recording_as_it_was(tmp_path):
    path = tmp_path / "earlier.rrd"
    path.write_bytes(b"RRF2 earlier")
    good = RecordedSession(scene="rigid_body: {ros__parameters: {mesh: book}}")
    broken = RecordedSession(scene=good.scene, events=[(0, "no line of a log")])
    for runs in (
        [broken],
        [good, broken],
        [RecordedSession()],
        [RecordedSession(scene=good.scene, missing=("events",))],
    ):
        with pytest.raises(InputError):
            record(runs, path)
        assert path.read_bytes() == b"RRF2 earlier"


@pytest.mark.parametrize("lost", [False, True], ids=["file there", "file lost too"])
def test_an_error_in_the_recorder_itself_ends_the_recording_whole_and_not_the_run(tmp_path, states, monkeypatch, lost):
    uncaught, errors, path = [], [], tmp_path / "session.rrd"
    monkeypatch.setattr(threading, "excepthook", uncaught.append)
    observer = FileRecorder(str(path), on_error=errors.append)
    flight.fly(observer, states[:20])
    flight.flush(observer)
    if lost:
        path.unlink()
    observer.on(BodyChanged(200_000_000, None))
    for k in range(20, 40):
        observer.on(Published(k * flight.PERIOD_NS, states[k]))
    observer.close()
    assert errors == [observer.error] and not uncaught
    if not lost:
        assert verified(path) and len(drawn(path)) == 20


def test_a_recorder_gets_something_done_with_every_piece_that_it_sends(tmp_path, states, monkeypatch):
    observer, done = FileRecorder(str(tmp_path / "session.rrd")), []
    flight.fly(observer, states[:1])
    flight.flush(observer)
    monkeypatch.setattr(observer._mailbox, "moved", lambda: done.append(threading.get_ident()))
    noted = [(0, Published(k * flight.PERIOD_NS, states[k])) for k in range(1, 9)]
    observer._write(noted)
    assert done.count(threading.get_ident()) > len(noted) + 5
    observer.close()


def test_a_file_that_cannot_grow_in_flight_stops_the_recording_and_keeps_what_is_there(tmp_path):
    # A limit on the file's size stands in for a full disk: the write fails in the same place.
    path, errors, limits = tmp_path / "session.rrd", [], resource.getrlimit(resource.RLIMIT_FSIZE)
    observer = FileRecorder(str(path), on_error=errors.append)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, limits[1]))
    try:
        flight.fly(observer, flight.rows(12_000))
        observer.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert errors == [observer.error] and str(path) in observer.error
    assert not verified(path) and path.stat().st_size


@pytest.mark.parametrize("hangs", ["flush", "disconnect"])
def test_a_library_that_hangs_on_a_full_disk_is_told_of_within_two_seconds(tmp_path, states, monkeypatch, hangs):
    """As Rerun does at times once the thread that writes its file has died."""
    path, released = tmp_path / "session.rrd", threading.Event()
    errors: list[str] = []
    observer = FileRecorder(str(path), on_error=errors.append)
    flight.fly(observer, states[:20])
    flight.flush(observer)

    def full(*_, **__) -> None:
        if hangs == "flush":
            released.wait(20.0)
        raise RuntimeError("File-writer thread shut down prematurely")

    monkeypatch.setattr(rr.RecordingStream, "flush", full)
    if hangs == "disconnect":
        monkeypatch.setattr(rr.RecordingStream, "disconnect", lambda _: released.wait(20.0))

    def told() -> bool:
        observer.on(Published(200_000_000, states[20]))
        return bool(observer.stalled or observer.error)

    flight.wait_for(told)
    assert FileRecorder.period_s + STALLED_S <= 2.0
    try:
        assert str(path) in (observer.stalled if hangs == "flush" else observer.error)
        assert observer.error or not errors
    finally:
        released.set()
        observer.close()


def test_a_lost_file_stops_the_recording_and_is_reported(tmp_path, states):
    folder = tmp_path / "gone"
    folder.mkdir()
    path = folder / "session.rrd"
    errors = []
    observer = FileRecorder(str(path), on_error=errors.append)
    flight.fly(observer, states[:20])
    flight.flush(observer)
    path.unlink()
    folder.rmdir()
    for k in range(20, 40):
        observer.on(Published(k * flight.PERIOD_NS, states[k]))
    flight.flush(observer)
    assert str(path) in observer.error
    for k in range(40, 60):
        observer.on(Published(k * flight.PERIOD_NS, states[k]))
    observer.close()
    assert len(errors) == 1


def test_recordings_are_made_and_given_back_one_at_a_time(tmp_path, monkeypatch):
    """Two of the library's functions at once, each on a thread of its own, were seen to wait for each other for ever."""
    within, together = threading.Lock(), []

    def alone(function):
        def call(*arguments, **options):
            together.append(not within.acquire(blocking=False))
            time.sleep(0.02)
            try:
                return function(*arguments, **options)
            finally:
                within.release()

        return call

    for name in ("new_blueprint", "flush_and_cleanup_orphaned_recordings"):
        monkeypatch.setattr(backend.rerun_bindings, name, alone(getattr(backend.rerun_bindings, name)))
    monkeypatch.setattr(backend.rr, "RecordingStream", alone(backend.rr.RecordingStream))

    def fly(name: str) -> None:
        for run in range(5):
            stream = backend.Stream(rr.FileSink(str(tmp_path / f"{name}.rrd")), f"{name}{run}", name)
            stream.send_layout(blueprint(FlightTraits(), None))
            stream.recording.disconnect()
            backend.forget_closed_recordings()

    recorders = [threading.Thread(target=fly, args=(name,)) for name in ("one", "two")]
    for recorder in recorders:
        recorder.start()
    for recorder in recorders:
        recorder.join()
    assert together == [False] * 30
