# SPDX-License-Identifier: MIT
"""Uploads are judged as inspect judges files, and leave nothing behind."""

from __future__ import annotations

import asyncio
import errno
import json
import re
import struct
import tempfile
from pathlib import Path
from types import SimpleNamespace

import pytest
import viser
from mesh_files import CUBE_VERTICES, Gltf, obj

from rigid_proto_ros.base.errors import InputError, MeshError
from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass import from_mesh
from rigid_proto_ros.mass.inspection import as_json
from rigid_proto_ros.mesh.locate import resolve_mesh
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.workbench import body_tab
from rigid_proto_ros.workbench.body_tab import MAX_BYTES, UploadFolder, take_upload

BOOK = resolve_mesh("book").read_bytes()
OPEN = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\n"


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own_cache: None) -> Path:
    """Where temporary files go, and a cache of its own beside it."""
    folder = tmp_path / "tmp"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def test_an_upload_gets_the_verdict_that_inspect_gives(place: Path, capsys: pytest.CaptureFixture) -> None:
    upload = take_upload("my book.obj", BOOK)
    assert main(["inspect", upload.path, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(as_json(upload.inspection)))
    assert upload.refusal == ""
    assert upload.name == "my_book.obj" == Path(upload.path).name
    broken = take_upload("broken.obj", OPEN)
    assert main(["inspect", broken.path, "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["verdict"] == as_json(broken.inspection)["verdict"]
    assert "open" in broken.refusal
    assert any("edge" in line for line in broken.verdict)
    assert broken.size_and_mass("cm") == "0.01 × 0.01 × 0.01 m"


@pytest.mark.parametrize(
    "name, data",
    [
        ("x.txt", b"hello"),
        ("x.obj", b""),
        ("x.stl", b"solid x\nendsolid x\n"),
        ("x.stl", b"\x00" * 80 + struct.pack("<I", 4_000_000_000)),
        ("x.ply", BOOK),
        ("x.glb", b"glTF"),
        ("x.gltf", b'{"buffers": [{"uri": "../../etc/passwd"}]}'),
        ("", BOOK),
    ],
)
def test_what_is_no_mesh_is_refused_and_nothing_is_kept_of_it(place: Path, name: str, data: bytes) -> None:
    with pytest.raises(InputError):
        take_upload(name, data)
    assert not list(place.iterdir())


BUST = obj(CUBE_VERTICES * (200.0, 250.0, 480.0))
"""A box as large as a bust of half a metre, in a file whose numbers are millimetres."""


def test_a_bust_in_millimetres_is_said_to_weigh_24_kg_before_it_flies_and_not_as_much_as_a_mountain(
    place: Path,
) -> None:
    upload = take_upload("bust.obj", BUST)
    assert (upload.likely_unit, upload.up) == ("mm", "y")
    assert upload.size_and_mass("mm") == "0.2 × 0.25 × 0.48 m, 24 kg at 1000 kg/m³"
    assert upload.size_and_mass("m") == "200 × 250 × 480 m, 2.4e+10 kg at 1000 kg/m³"
    values = upload.scene("mm", {})
    body = make_scenario(values).setup
    assert body.body.mass == pytest.approx(24.0, rel=1e-12)
    # Its y is up now, as that of any .obj that doesn't say otherwise.
    assert matrix_from_quaternion(values["initial.orientation_xyzw"])[:, 1] == pytest.approx([0.0, 0.0, 1.0])
    assert not body.initial[7:13].any()
    assert take_upload("bust.obj", b"# made by hand\n# Z-up\n" + BUST).up == "z"


def test_a_verdict_names_what_the_page_has_and_no_options_of_the_command(place: Path) -> None:
    assert take_upload("bust.obj", BUST).verdict == []
    before, _, face = BOOK.rstrip().rpartition(b"\n")
    assert face.startswith(b"f ")
    hole = take_upload("hole.obj", before)
    (line,) = hole.verdict
    assert line.startswith(
        "error: open surface with 3 boundary edges; any way to close it changes volume and tensor by"
    )
    assert line.endswith(" %; mesh_repair welds edges and caps holes")
    assert hole.refusal.endswith(" %; use mesh_repair, mesh_fallback, or another model with mass")
    for upload in (hole, take_upload("open.obj", OPEN)):
        assert "--" not in " ".join([upload.refusal, *upload.verdict])


def test_a_glb_is_taken_in_metres_with_y_up_and_one_that_names_other_files_is_refused(place: Path) -> None:
    cube = Gltf(CUBE_VERTICES * (1.0, 2.0, 3.0))
    upload = take_upload("Box.glb", cube.glb())
    assert (upload.likely_unit, upload.up, upload.refusal) == ("m", "y", "")
    assert upload.size_and_mass("m") == "1 × 2 × 3 m, 6e+03 kg at 1000 kg/m³"
    for uri in ("../../../etc/passwd", "file:///etc/passwd", "http://127.0.0.1/x"):
        with pytest.raises(InputError):
            take_upload("Other.glb", cube.glb(uri=uri))
    assert files(place) == [Path(upload.path)]


class Large(bytes):
    """Bytes that say they are more than they are: 500 MB need not be made to be refused."""

    def __len__(self) -> int:
        return 500_000_000


def test_500_megabytes_are_refused_unwritten_and_unread(place: Path) -> None:
    with pytest.raises(MeshError, match="500000000 bytes"):
        take_upload("large.stl", Large())
    assert not files(place)
    assert MAX_BYTES < 500_000_000


@pytest.mark.parametrize(
    "name", ["../../../etc/passwd.obj", r"..\..\x.obj", "x\0y.obj", "..obj", "é" * 300 + ".OBJ", "<script>.obj"]
)
def test_a_name_leads_nowhere(place: Path, name: str) -> None:
    path = Path(take_upload(name, BOOK).path)
    assert path.resolve() == path and path.parent.parent == place
    assert re.fullmatch(r"[A-Za-z0-9_-]{1,40}\.obj", path.name)


def test_uploads_are_kept_until_the_page_ends_and_nothing_of_them_is_cached(place: Path) -> None:
    server = viser.ViserServer(host="127.0.0.1", verbose=False)
    folder = UploadFolder(server.gui, SimpleNamespace(), None, lambda _: None)
    for k in range(3):
        asyncio.run(folder.take(f"part {k}.obj", OPEN))
    assert {path.name for path in files(place)} == {"part_0.obj", "part_1.obj", "part_2.obj"}
    folder.close()
    server.stop()
    assert not files(place)
    assert from_mesh.folder() is not None
    assert not from_mesh.folder().exists()


def test_an_upload_is_refused_by_a_full_disk_and_one_that_is_checked_when_the_page_ends_is_not_kept(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, said = viser.ViserServer(host="127.0.0.1", verbose=False), []
    folder = UploadFolder(server.gui, SimpleNamespace(), None, said.append)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        asyncio.run(folder.take("part.obj", OPEN))
    assert "No space left on device" in said[0][0] and not list(place.glob("*/*"))
    inspect = body_tab.inspect_mesh
    monkeypatch.setattr(body_tab, "inspect_mesh", lambda body: (folder.close(), inspect(body))[1])
    asyncio.run(folder.take("part.obj", OPEN))
    server.stop()
    assert not list(place.iterdir())
