# SPDX-License-Identifier: MIT
"""Pictures without a display show the body where the recorded state says it is."""

from __future__ import annotations

import argparse
import errno
import io
import os
import tempfile
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rerun_flight as flight
from PIL import Image

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli import snapshot as command
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.rerun_view import snapshot
from rigid_proto_ros.rerun_view.observer import FileRecorder
from rigid_proto_ros.rerun_view.snapshot import DRIVERS, is_one_colour

pytestmark = pytest.mark.drawn


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("snapshot") / "session.rrd"
    observer = FileRecorder(str(path))
    flight.fly(observer, flight.rows(60))
    observer.close()
    return path


def arguments(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    parser.set_defaults(run=command.run)
    return parser.parse_args(words)


def take(*words: str) -> None:
    args = arguments(*words)
    try:
        assert args.run(args) == 0
    except InputError as error:
        if DRIVERS in str(error):
            pytest.skip(str(error))
        raise


def test_the_body_is_in_the_middle_of_the_flight_view_also_from_a_cut_file(tmp_path):
    picture = tmp_path / "flight.png"
    recording = tmp_path / "session.rrd"
    observer = FileRecorder(str(recording))
    # Without gravity: of a body that falls the path is shown, and the body where it has come to.
    flight.fly(observer, flight.rows(60), flight.setup_of(gravity=np.zeros(3)))
    observer.close()
    recording.write_bytes(recording.read_bytes()[:-2000])
    take(str(recording), "--at", "0.3", "-o", str(picture), "--size", "1000x600")
    with Image.open(picture) as image:
        assert image.size == (1000, 600)
        pixels = np.asarray(image.convert("RGB"), dtype=float)
    # The view of the body takes three fifths of the width, and five sixths of what the bars leave of the height.
    view = pixels[90:460, 10:580]
    drawn = np.abs(view - view[2, -3]).sum(axis=2) > 60
    height, width = drawn.shape
    assert drawn[int(0.45 * height) : int(0.55 * height), int(0.45 * width) : int(0.55 * width)].mean() > 0.9
    assert 0.02 < drawn.mean() < 0.6


def test_a_bag_is_drawn_too_and_the_viewer_leaves_no_files_behind(tmp_path, monkeypatch):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.setenv("TMPDIR", str(temporary))
    pytest.importorskip("mcap")
    bag, picture = tmp_path / "s.mcap", tmp_path / "s.png"
    assert main(["simulate", "t_handle", "--duration", "0.5", "--bag", str(bag)]) == 0
    take(str(bag), "--at", "0.4", "-o", str(picture), "--size", "800x500")
    assert not is_one_colour(picture.read_bytes())
    assert not list(temporary.iterdir())
    args = arguments(str(bag), "--at", "0.6", "-o", str(tmp_path / "x.png"))
    with pytest.raises(InputError, match="^--at: "):
        args.run(args)


@pytest.mark.parametrize(
    ("words", "field"),
    [
        (["--at", "-0.1", "-o", "x.png"], "--at"),
        (["--at", "0.6", "-o", "x.png"], "--at"),
        (["--at", "nan", "-o", "x.png"], "--at"),
        (["--at", "0.1", "-o", "x.jpg"], "-o"),
        (["--at", "0.1", "-o", "taken/x.png"], "-o"),
        (["--at", "0.1", "-o", "x.png", "--size", "wide"], "--size"),
        (["--at", "0.1", "-o", "x.png", "--size", "10x10"], "--size"),
    ],
)
def test_what_cannot_be_drawn_is_refused_with_what_would_be_accepted(recording, tmp_path, monkeypatch, words, field):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").touch()
    args = arguments(str(recording), *words)
    with pytest.raises(InputError, match=f"^{field}: "):
        args.run(args)


def test_a_picture_that_a_full_disk_takes_half_of_leaves_the_earlier_one_as_it_is(recording, tmp_path, monkeypatch):
    def half(path, _):
        path.touch()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    picture = tmp_path / "x.png"
    picture.write_bytes(b"earlier")
    client = nullcontext(SimpleNamespace(set_time=lambda *_, **__: None))
    drawn = {
        "headless_viewer": lambda *_: client,
        "show": lambda *_: None,
        "_stable_picture": lambda _: b"",
        "NOTICE_GONE_S": 0,
    }
    for name, value in {**drawn, "is_one_colour": lambda _: False}.items():
        monkeypatch.setattr(snapshot, name, value)
    monkeypatch.setattr(Path, "write_bytes", half)
    with pytest.raises(InputError, match="^-o: .*No space left"):
        snapshot.take_picture(recording, 0.3, picture)
    assert picture.read_bytes() == b"earlier" and list(tmp_path.iterdir()) == [picture]


def test_a_recording_that_is_not_there_is_refused(tmp_path):
    args = arguments(str(tmp_path / "none.rrd"), "--at", "0", "-o", str(tmp_path / "x.png"))
    with pytest.raises(InputError, match="No such file"):
        args.run(args)


@pytest.mark.parametrize("without", ["any adapter", "Vulkan"])
def test_a_machine_without_drivers_is_told_what_to_install(recording, tmp_path, monkeypatch, without):
    # The Vulkan loader finds no driver at this place.
    monkeypatch.setenv("VK_ICD_FILENAMES", str(tmp_path / "none.json"))
    monkeypatch.setenv("VK_DRIVER_FILES", str(tmp_path / "none.json"))
    if without == "any adapter":
        monkeypatch.setenv("LIBGL_DRIVERS_PATH", str(tmp_path))
        monkeypatch.setenv("WGPU_BACKEND", "vulkan")
    args = arguments(str(recording), "--at", "0.3", "-o", str(tmp_path / "x.png"))
    with pytest.raises(InputError, match="mesa-vulkan-drivers") as refusal:
        args.run(args)
    assert "\n" not in str(refusal.value)


def test_a_picture_of_one_colour_counts_as_blank():
    data = io.BytesIO()
    Image.new("RGB", (300, 200), (24, 27, 34)).save(data, format="png")
    assert is_one_colour(data.getvalue())
