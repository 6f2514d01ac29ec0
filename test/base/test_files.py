# SPDX-License-Identifier: MIT
"""Files are written whole, and nothing but a file gives its name to one."""

import os
from pathlib import Path

import pytest

from rigid_proto_ros.base import files
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.base.files import check_whole_file, output_file, whole_file


def test_a_pipe_or_a_device_is_left_as_it_is(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="--csv: .*a device or a pipe"):
        check_whole_file("--csv", pipe)
    with pytest.raises(InputError, match="--csv: .*a device or a pipe"), whole_file("--csv", pipe) as beside:
        beside.write_text("x")
    assert pipe.is_fifo() and list(tmp_path.iterdir()) == [pipe]


def test_a_link_stays_one_and_leads_to_the_new_file(tmp_path: Path) -> None:
    """As /dev/stdout may be one."""
    file, link = tmp_path / "folder" / "table.csv", tmp_path / "link.csv"
    file.parent.mkdir()
    file.write_text("old")
    link.symlink_to(file)
    with whole_file("--csv", link) as beside:
        beside.write_text("new")
        assert file.read_text() == "old"
    assert link.is_symlink() and file.read_text() == "new" and list(file.parent.iterdir()) == [file]


def test_a_link_planted_where_the_new_file_begins_is_not_followed(tmp_path, monkeypatch):
    victim = tmp_path / "victim"
    victim.write_text("mine")
    monkeypatch.setattr(files.secrets, "token_hex", lambda _: "guessed")
    (tmp_path / ".table.guessed.csv").symlink_to(victim)
    with pytest.raises(InputError, match="--csv"), whole_file("--csv", tmp_path / "table.csv") as beside:
        beside.write_text("theirs")
    assert victim.read_text() == "mine" and not (tmp_path / "table.csv").exists()


def test_a_current_folder_that_is_gone_is_told_with_the_option(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tmp_path.rmdir()
    with pytest.raises(InputError, match="^--csv: got 'x.csv'"):
        output_file("--csv", "x.csv")
