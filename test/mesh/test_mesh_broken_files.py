# SPDX-License-Identifier: MIT
"""Broken mesh files: each gets its verdict, its exit status and one line that says what is wrong. No silent number."""

import json

import numpy as np
import pytest
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES, moebius, obj, off, ply, ply_binary, stl, stl_text

from rigid_proto_ros.cli.main import main

JUNK = bytes(np.random.default_rng(5).integers(0, 256, 4096, dtype=np.uint8))
TEXT = b"The quick brown fox jumps over the lazy dog.\n" * 40
V, T = CUBE_VERTICES, CUBE_TRIANGLES
FLIPPED = T.copy()
FLIPPED[::4] = FLIPPED[::4, ::-1]
WITH_NAN = V.copy()
WITH_NAN[3, 1] = np.nan
TWO = np.vstack([V, V + 3.0])
FACES_AGAIN = b"element face 6\nproperty list uchar int vertex_indices\nend_header"


def replaced(data: bytes, old: bytes, new: bytes) -> bytes:
    assert old in data
    return data.replace(old, new, 1)


# file name, bytes, what the one line says; the file can't be read, so there is no verdict
UNREADABLE = [
    ("empty.obj", b"", "empty"),
    ("short.stl", b"x" * 50, "84 bytes"),
    ("junk.stl", JUNK, "announces"),
    ("junk.glb", JUNK, "the .glb file can't be read"),
    ("prose.obj", TEXT, "no faces"),
    ("vertices_only.obj", obj(faces=[]), "no faces"),
    ("no_facets.stl", stl(faces=[]), "no faces"),
    ("cut.stl", stl()[:-70], "may be truncated"),
    ("cut_text.stl", stl_text()[:-60], "may be truncated"),
    ("cut_binary.ply", ply_binary()[:-40], "may be truncated"),
    ("more_binary.ply", replaced(ply_binary(), b"face 12", b"face 11"), "17 bytes follow"),
    ("cut_header.ply", ply()[:60], "end_header"),
    ("long.stl", stl() + b"\0" * 33, "33 bytes follow the 12 facets"),
    ("huge.stl", stl(count=4_000_000_000), "announces 4000000000"),
    ("huge.ply", ply(announced=2_000_000_000), "2000000000 rows of face"),
    ("negative.ply", replaced(ply(), b"element face 12", b"element face -12"), "element face -12"),
    ("word.obj", replaced(obj(), b"v 0.0 0.0 1.0", b"v 0.0 zero 1.0"), "zero"),
    ("word.ply", replaced(ply(), b"0.0 0.0 1.0", b"0.0 zero 1.0"), "zero"),
    ("continued.obj", b"v 0 \\\n0 0\nv 1 0 \\\n0\nv 0 one 0\nf 1 2 3\n", "line 5: got 'v 0 one 0'"),
    ("index.obj", replaced(obj(), b"f 1 2 4", b"f 1 2 99"), "vertex 99"),
    ("index_zero.obj", replaced(obj(), b"f 1 2 4", b"f 0 2 4"), "nonzero"),
    ("index_back.obj", replaced(obj(), b"f 1 2 4", b"f -1 -2 -99"), "counted back"),
    ("index.off", replaced(off(), b"3 0 1 3", b"3 0 1 88"), "index outside the range"),
    ("index.ply", replaced(ply(), b"3 0 1 3", b"3 0 1 88"), "vertex 88"),
    ("two_corners.obj", replaced(obj(), b"f 1 2 4", b"f 1 2"), "three or more corners"),
    ("no_corner.obj", obj() + b"f\n", "three or more corners"),
    ("no_coordinate.obj", b"v\n" + obj(), "three coordinates"),
    ("two_corners.ply", ply(faces=[(0, 1)] * 3), "three or more"),
    ("faces_twice.ply", replaced(ply(announced=6), b"end_header", FACES_AGAIN), "declares an element twice"),
    ("no_z.ply", replaced(ply(), b"property double z\n", b""), "x, y, z"),
    ("stl_named.obj", stl_text(), "no faces"),
    ("ply_named.stl", ply(), "announces"),
    ("off_named.ply", off(), "a .ply file"),
    ("packed.stl.gz", stl(), "a file named"),
    ("fraction.ply", replaced(replaced(ply(), b"3 0 1 3", b"3 0 1.5 3"), b"uchar int", b"uchar float"), "vertex 1.5"),
    ("nul.obj", b"#" * 5000 + b"\nv 0 0 \0\0\0\nf 1 1 1\n", "line 2"),
    ("nul.off", b"OFF\n3 1 0\n0 0 0\n\0\0\0 0 0\n1 1 1\n3 0 1 2\n", "could not convert"),
    ("nul.ply", replaced(ply(), b"element face", b"elem\0\0ent face"), "elem??ent"),
    ("name.ply", replaced(ply(announced=99), b"element face", b"element f\x13ce"), "f?ce"),
    ("noextension", obj(), "obj"),
]

# file name, bytes, code of the verdict, words of the one line; the file can be read but bounds no solid
REFUSED = [
    ("nan.obj", obj(WITH_NAN), "nonfinite", "1 of 8 vertices"),
    ("unused_nan.obj", b"v nan 0 inf\n" + obj(faces=T + 1), "nonfinite", "the first is vertex 0"),
    ("nan.stl", stl(WITH_NAN), "nonfinite", "not finite"),
    ("inf.obj", replaced(obj(), b"v 0.0 0.0 1.0", b"v 0.0 1e999 1.0"), "nonfinite", "not finite"),
    ("open.obj", obj(faces=T[:-1]), "open", "3 boundary edges"),
    ("quarter_flipped.obj", obj(faces=FLIPPED), "inconsistent_winding", "inconsistent winding"),
    ("one_body_inward.obj", obj(TWO, [*T, *(T + 8)[:, ::-1]]), "component_inward", "1 of 2 components"),
    ("all_twice.obj", obj(faces=[*T, *T]), "duplicate_faces", "12 duplicate faces"),
    ("one_twice.stl", stl(faces=[*T, T[0]]), "duplicate_faces", "1 duplicate face"),
    ("both_sides.obj", obj(faces=[*T, *T[:, ::-1]]), "zero_volume", "no volume"),
    ("moebius.obj", obj(*moebius()), "inconsistent_winding", "boundary edges"),
    ("flat.obj", obj(V * [1.0, 1.0, 0.0]), "zero_volume", "no volume"),
    ("point.obj", obj(V * 0.0), "zero_volume", "one point"),
    ("huge.obj", obj(V * 1e110), "size", "1e+110 across"),
    ("tiny.obj", obj(V * 1e-110), "size", "1e-110 across"),
    ("fin.obj", obj(np.vstack([V, [[2.0, 2.0, 2.0]]]), [*T, (6, 7, 8)]), "open", "boundary edge"),
]


def inspect(capsys, *arguments: str) -> tuple[int, str, str]:
    status = main(["inspect", *arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def one_line(err: str) -> str:
    assert err.count("\n") == 1 and err.strip().isprintable(), err
    return err


@pytest.mark.parametrize(("name", "data", "words"), UNREADABLE, ids=[row[0] for row in UNREADABLE])
def test_a_file_that_cannot_be_read_says_why_in_one_line(tmp_path, capsys, name, data, words):
    (tmp_path / name).write_bytes(data)
    status, out, err = inspect(capsys, str(tmp_path / name), "--json")
    assert status == 2
    assert out == ""
    assert words in one_line(err)
    assert name in err


@pytest.mark.parametrize(("name", "data", "code", "words"), REFUSED, ids=[row[0] for row in REFUSED])
def test_a_readable_file_without_a_solid_gets_its_verdict_and_no_number(tmp_path, capsys, name, data, code, words):
    (tmp_path / name).write_bytes(data)
    status, out, err = inspect(capsys, str(tmp_path / name), "--json")
    assert status == 2
    report = json.loads(out)
    errors = {finding["code"]: finding["message"] for finding in report["verdict"] if finding["severity"] == "error"}
    assert code in errors
    assert words in " ".join(errors.values())
    assert all(value is None for key, value in report.items() if key != "verdict")
    line = one_line(err)
    if name == "flat.obj":
        assert "use a mesh that isn't flat" in line
    elif code not in ("nonfinite", "size") and "one point" not in words:
        assert "--repair" in line
        assert "--fallback" in line


def test_files_that_only_look_broken_are_read(tmp_path, capsys):
    whole = {
        "crlf.obj": obj().replace(b"\n", b"\r\n"),
        "mac.obj": obj().replace(b"\n", b"\r"),
        "no_last_newline.obj": obj()[:-1],
        "utf8.obj": "# bär\no Gehäuse\n".encode() + obj(),
        "marked.obj": b"\xef\xbb\xbf" + obj(),
        "inverted.obj": obj(faces=T[:, ::-1]),
        "inverted.stl": stl(faces=T[:, ::-1]),
        "zero_area.obj": obj(np.vstack([V, V[:1] / 2]), [*T, (0, 1, 0), (2, 2, 3)]),
        "solid_in_header.stl": b"solid but binary".ljust(80) + stl()[80:],
    }
    for name, data in whole.items():
        path = tmp_path / name
        path.write_bytes(data)
        status, out, err = inspect(capsys, str(path), "--json")
        assert (status, err) == (0, ""), name
        assert json.loads(out)["mass"] == pytest.approx(1000.0, rel=1e-14), name


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("tennis_raket", "did you mean tennis_racket?"),
        ("package://no_such_package/x.obj", "no_such_package"),
        ("package://rigid_proto_ros/none.obj", "none.obj"),
        ("/", "folder"),
        ("", "a bundled name"),
    ],
)
def test_a_name_that_is_no_file_says_what_would_be_one(capsys, name, words):
    status, out, err = inspect(capsys, name)
    assert (status, out) == (2, "") and words in one_line(err)
