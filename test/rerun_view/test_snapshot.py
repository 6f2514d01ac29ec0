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
from rigid_proto_ros.rerun_view.snapshot import DRIVERS, is_one_colour
from rigid_proto_ros.session.bag import read_runs

pytestmark = pytest.mark.drawn


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("snapshot") / "session.mcap"
    assert main(["simulate", "hollow_box", "--duration", "0.59", "--record", str(path)]) == 0
    return path


def run(*words: str) -> None:
    """The command; raises what it refuses."""
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    assert command.run(parser.parse_args(words)) == 0


def take(*words: str) -> None:
    """The same; without drivers the test skips."""
    try:
        run(*words)
    except InputError as error:
        if DRIVERS in str(error):
            pytest.skip(str(error))
        raise


def test_of_a_bag_the_body_is_in_the_middle_of_the_flight_view_and_the_viewer_leaves_no_files(tmp_path, monkeypatch):
    pytest.importorskip("mcap")
    temporary, bag, picture = (tmp_path / name for name in ("temporary", "s.mcap", "s.png"))
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.setenv("TMPDIR", str(temporary))
    # Without gravity: of a body that falls the path is shown, and the body where it has come to.
    assert main(["simulate", "hollow_box", "--duration", "0.5", "--bag", str(bag)]) == 0
    with pytest.raises(InputError, match="^--at: "):
        take(str(bag), "--at", "0.6", "-o", str(picture))
    take(str(bag), "--at", "0.3", "-o", str(picture), "--size", "1000x600")
    assert not list(temporary.iterdir())
    with Image.open(picture) as image:
        assert image.size == (1000, 600)
        pixels = np.asarray(image.convert("RGB"), dtype=float)
    # The view of the body takes three fifths of the width, and of the height that the bars leave.
    view = pixels[30:340, 10:580]
    drawn = np.abs(view - view[2, -3]).sum(axis=2) > 60
    height, width = drawn.shape
    assert drawn[int(0.45 * height) : int(0.55 * height), int(0.45 * width) : int(0.55 * width)].mean() > 0.9
    assert 0.02 < drawn.mean() < 0.6


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
    with pytest.raises(InputError, match=f"^{field}: "):
        take(str(recording), *words)


def one_colour() -> bytes:
    """A picture in which nothing is."""
    Image.new("RGB", (60, 60)).save(picture := io.BytesIO(), "PNG")
    return picture.getvalue()


@pytest.fixture
def opened(monkeypatch):
    """Times of the states in what a viewer was given, in which nothing is drawn."""
    shown = []
    client = nullcontext(SimpleNamespace(set_time=lambda *_, **__: None))
    stand_in = {
        "headless_viewer": lambda *_: client,
        "show": lambda _, path: shown.append(flight.drawn(path)),
        "_stable_picture": lambda _: one_colour(),
        "NOTICE_GONE_S": 0,
        "is_one_colour": lambda _: False,
    }
    for name, value in stand_in.items():
        monkeypatch.setattr(snapshot, name, value)
    return shown


def test_the_viewer_is_given_what_is_whole_of_a_cut_file(recording, tmp_path, opened):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(recording.read_bytes()[:-2000])
    take(str(cut), "--at", "0.3", "-o", str(tmp_path / "x.png"))
    (times,) = opened
    (run,) = read_runs(cut)
    assert times == run.times.tolist() and not run.complete


def test_a_picture_that_a_full_disk_takes_half_of_leaves_the_earlier_one_as_it_is(
    recording, tmp_path, opened, monkeypatch
):
    def half(path, _):
        path.touch()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    picture = tmp_path / "x.png"
    picture.write_bytes(b"earlier")
    monkeypatch.setattr(Path, "write_bytes", half)
    with pytest.raises(InputError, match="^-o: .*No space left"):
        run(str(recording), "--at", "0.3", "-o", str(picture))
    assert picture.read_bytes() == b"earlier" and list(tmp_path.iterdir()) == [picture]


def test_a_recording_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no file"):
        run(str(tmp_path / "none.mcap"), "--at", "0", "-o", str(tmp_path / "x.png"))


@pytest.mark.parametrize("without", ["any adapter", "Vulkan"])
def test_a_machine_without_drivers_is_told_what_to_install(recording, tmp_path, monkeypatch, without):
    # The Vulkan loader finds no driver at this place.
    monkeypatch.setenv("VK_ICD_FILENAMES", str(tmp_path / "none.json"))
    monkeypatch.setenv("VK_DRIVER_FILES", str(tmp_path / "none.json"))
    if without == "any adapter":
        monkeypatch.setenv("LIBGL_DRIVERS_PATH", str(tmp_path))
        monkeypatch.setenv("WGPU_BACKEND", "vulkan")
    with pytest.raises(InputError, match="mesa-vulkan-drivers") as refusal:
        run(str(recording), "--at", "0.3", "-o", str(tmp_path / "x.png"))
    assert "\n" not in str(refusal.value)


def test_a_picture_of_one_colour_counts_as_blank():
    data = io.BytesIO()
    Image.new("RGB", (300, 200), (24, 27, 34)).save(data, format="png")
    assert is_one_colour(data.getvalue())
