# SPDX-License-Identifier: MIT
"""Films: as many pictures as the time takes, of what flies, where it is."""

from __future__ import annotations

import os
import sys

import numpy as np
import pytest

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.export.film import film_motion, pictures
from rigid_proto_ros.export.flight_record import FlightRecord
from rigid_proto_ros.export.state_source import source_of_scene
from rigid_proto_ros.scene.offline import OfflineRun, read_scene

os.environ.setdefault("XDG_RUNTIME_DIR", "/tmp")
pytest.importorskip("pygfx")
imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")

SMALL = (96, 64)


@pytest.fixture(scope="module", autouse=True)
def driver():
    import wgpu

    try:
        wgpu.gpu.request_adapter_sync()
    except RuntimeError as error:
        pytest.skip(f"no Vulkan driver: {error}")


def film_of(file) -> tuple[dict, np.ndarray]:
    """What ffmpeg says of a film, and its pictures (n, height, width, 3)."""
    reader = imageio_ffmpeg.read_frames(str(file))
    about = next(reader)
    width, height = about["size"]
    return about, np.array([np.frombuffer(picture, np.uint8).reshape(height, width, 3) for picture in reader])


@pytest.mark.parametrize("ending", ["mp4", "gif"])
def test_a_part_of_a_flight_is_a_film_of_its_length(ending, tmp_path, capsys):
    file = tmp_path / f"film.{ending}"
    part = ["--from", "0.5", "--to", "1.5", "--fps", "10", "--size", "96x64"]
    assert main(["simulate", "book", "--duration", "2", "--video", str(file), *part]) == 0
    assert "11 pictures, 10 a second" in capsys.readouterr().out
    about, shown = film_of(file)
    assert about["size"] == SMALL and about["fps"] == pytest.approx(10.0)
    assert len(shown) == 11
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


def drawn(scene: str, settings: dict, seconds: float, fps: float) -> np.ndarray:
    scenario, record = read_scene(scene, settings), FlightRecord()
    OfflineRun(scenario, [], record).advance(round(seconds * 1e9))
    motion = film_motion(record, source_of_scene(scenario, []), fps)
    return np.array([picture[..., :3].astype(int) for picture in pictures(record, motion, SMALL)])


def test_a_body_at_rest_stands_still_in_the_middle_and_one_that_turns_does_not():
    still = drawn("hammer", {"initial.angular_velocity": [0.0, 0.0, 0.0]}, 0.4, 5.0)
    assert np.abs(np.diff(still, axis=0)).max() == 0
    # Neither sky nor ground: brighter red than blue, as the body's colour is.
    seen = still[0, :, :, 0] > still[0, :, :, 2] + 5
    assert 0.02 < seen.mean() < 0.6
    assert not (seen[0].any() or seen[-1].any() or seen[:, 0].any() or seen[:, -1].any()), "nothing is cut off"
    turning = drawn("hammer", {"initial.angular_velocity": [0.0, 3.0, 0.0]}, 0.4, 5.0)
    assert np.abs(np.diff(turning, axis=0)).max() > 50


def test_a_fall_out_of_sight_is_followed_and_the_ghost_is_seen():
    fallen = drawn("hammer", {"gravity": [0.0, 0.0, -9.81], "initial.angular_velocity": [0.0, 0.0, 0.0]}, 2.0, 1.0)
    seen = fallen[..., 0] > fallen[..., 2] + 5
    assert (seen.mean(axis=(1, 2)) > 0.005).all()  # measured 0.008, the path beside it 0.009 more
    alone = drawn("true_or_box_tensor", {"ghost.inertia_model": ""}, 1.0, 1.0)
    beside = drawn("true_or_box_tensor", {}, 1.0, 1.0)
    blue = [(film[-1, :, :, 2] > film[-1, :, :, 0] + 40).mean() for film in (alone, beside)]
    assert blue[0] < 0.001 and blue[1] > 0.02


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--video", "a.avi"], ("--video", ".mp4 or .gif")),
        (["--video", "{tmp}/a.mp4", "--fps", "0"], ("--fps", "0.0")),
        (["--video", "{tmp}/a.mp4", "--size", "960"], ("--size", "960", "WIDTHxHEIGHT")),
        (["--video", "{tmp}/a.mp4", "--size", "961x540"], ("--size", "even")),
        (["--video", "{tmp}/a.mp4", "--from", "5"], ("--from", "5.0", "0 to 0.1 s")),
        (["--video", "{tmp}/a.mp4", "--from", "0.08", "--to", "0.02"], ("--to", "0.02")),
        (["--video", "{tmp}/a.mp4", "--from", "-1"], ("--from", "-1.0")),
        (["--size", "960x540"], ("--size", "needs --video")),
        (["--video", "{tmp}/a.mp4", "--with", "trail"], ("--with", "--gltf or --usd")),
    ],
)
def test_what_makes_no_film_is_refused_in_one_line(arguments, words, tmp_path, capsys):
    arguments = [word.replace("{tmp}", str(tmp_path)) for word in arguments]
    assert main(["simulate", "book", "--duration", "0.1", *arguments]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and all(word in err for word in words)
    assert not list(tmp_path.iterdir())


def test_an_interrupted_film_leaves_no_half(tmp_path, monkeypatch, capsys):
    file = tmp_path / "film.mp4"

    def stop(_, record, motion, *rest):
        yield np.zeros((64, 96, 4), np.uint8)
        raise KeyboardInterrupt

    monkeypatch.setattr("rigid_proto_ros.export.film.pictures", lambda *arguments: stop(None, *arguments))
    assert main(["simulate", "book", "--duration", "0.5", "--video", str(file), "--size", "96x64"]) == 0
    assert capsys.readouterr().err.endswith("stopped\n")
    assert not list(tmp_path.iterdir())


def test_a_renderer_that_is_missing_is_named_with_the_extra_that_brings_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pygfx", None)
    assert main(["simulate", "book", "--video", str(tmp_path / "a.mp4")]) == 2
    assert "pip install 'rigid_proto_ros[video]'" in capsys.readouterr().err
