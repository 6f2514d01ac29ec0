# SPDX-License-Identifier: MIT
"""Reading meshes: the file's own vertices in the file's own order, polygons kept, known traps of other readers."""

import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from judged_meshes import codes, load, volume
from mesh_files import CUBE_QUADS, CUBE_TRIANGLES, CUBE_VERTICES, obj, off, ply, ply_binary, stl, stl_text

from rigid_proto_ros.base.bundled import body_names
from rigid_proto_ros.base.errors import MeshError
from rigid_proto_ros.mass import from_mesh
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mesh.ascii_floats import as_numbers
from rigid_proto_ros.mesh.reading import load_mesh

WHOLE = {
    "a.obj": obj(),
    "quads.obj": obj(faces=CUBE_QUADS),
    "a.off": off(),
    "a.stl": stl(),
    "text.stl": stl_text(),
    "a.ply": ply(),
    "quads.ply": ply(faces=CUBE_QUADS),
    "little.ply": ply_binary(faces=CUBE_QUADS),
    "big.ply": ply_binary(big=True),
}


@pytest.mark.parametrize("name", WHOLE)
def test_every_format_gives_the_cube_in_file_order(tmp_path, name):
    mesh = load(tmp_path, name, WHOLE[name])
    assert volume(mesh) == 1.0
    assert (mesh.polygon_starts is None) != name.startswith(("quads", "little"))
    if name.endswith("stl"):  # one vertex for corners that are bit-equal, in order of appearance
        order = list(dict.fromkeys(CUBE_TRIANGLES.ravel().tolist()))
        assert mesh.vertices.tolist() == CUBE_VERTICES[order].tolist()
    else:
        assert mesh.vertices.tolist() == CUBE_VERTICES.tolist()
        assert mesh.triangles.tolist() == CUBE_TRIANGLES.tolist()
    assert mesh.sha256 == hashlib.sha256(WHOLE[name]).hexdigest()
    assert mesh_body(mesh).moments.moments("shell").measure == pytest.approx(6.0, rel=1e-15)


def test_stl_corners_that_are_not_bit_equal_stay_apart(tmp_path):
    nudged = np.vstack([CUBE_VERTICES, CUBE_VERTICES[0] + [1e-7, 0.0, 0.0]])
    faces = np.concatenate([[[8, *CUBE_TRIANGLES[0, 1:]]], CUBE_TRIANGLES[1:]])
    assert len(load(tmp_path, "a.stl", stl(nudged, faces)).vertices) == 9


def test_interleaved_negative_obj_indices_count_back_from_the_vertices_so_far(tmp_path):
    text = []
    for a, b, c in CUBE_TRIANGLES:
        text += ["v {} {} {}".format(*CUBE_VERTICES[i]) for i in (a, b, c)]
        text.append("f -3 -2 -1")
    mesh = load(tmp_path, "interleaved.obj", "\n".join(text).encode())
    assert (len(mesh.vertices), volume(mesh)) == (36, 1.0)


def test_obj_corners_with_texture_and_normal_numbers_tabs_and_continued_lines(tmp_path):
    text = obj(faces=CUBE_QUADS).decode()
    text = text.replace("f 1 2 4 3", "f\t1/1/1 2//1 \\\n 4/2 3/3/3 # the first").replace("v ", "v\t")
    text = "mtllib a.mtl\nvt 0 0\nvn 0 0 1\ng side\nusemtl m\ns 1\n" + text + "l 1 2\np 1\n"
    mesh = load(tmp_path, "rich.obj", text.encode())
    assert (volume(mesh), len(mesh.polygon_starts)) == (1.0, 7)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("v 0.0 0.0 0.0\n", "# C:\\models\\\nv 0.0 0.0 0.0\n"),  # a comment continues nowhere
        ("v 0.0 0.0 0.0\n", "v 0.0 0.0 0.0\r"),
        ("\n", "\r"),
        ("v 0.0 0.0 0.0\n", "v 0.0 \\\r0.0 0.0\r"),
    ],
)
def test_obj_lines_end_as_on_any_system_also_within_one_file(tmp_path, old, new):
    text = obj().decode().replace(old, new)
    assert volume(load(tmp_path, "lines.obj", text.encode())) == 1.0


def test_numbers_behind_the_coordinates_of_an_obj_vertex_are_left_aside(tmp_path):
    text = obj().decode().replace("\nf", " 0.1 0.2 0.3\nf", 1).replace("\nv", " 0.1 0.2 0.3\nv")
    assert volume(load(tmp_path, "colours.obj", text.encode())) == 1.0


def test_unreferenced_vertices_are_counted_and_carry_nothing(tmp_path):
    mesh = load(tmp_path, "stray.obj", b"v 100 100 100\n" + obj(faces=CUBE_TRIANGLES + 1))
    assert len(mesh.vertices) == 9
    body = mesh_body(mesh)
    assert body.moments.mass_properties(density=1.0).center_of_mass.tolist() == [0.5, 0.5, 0.5]
    assert codes(body) == {"unreferenced_vertices": "info"}


def test_coff_colours_and_comments_are_skipped(tmp_path):
    lines = off(faces=CUBE_QUADS).decode().splitlines()
    lines[0] = "COFF # with colours"
    lines[2:10] = [line + " 255 0 0 255" for line in lines[2:10]]
    lines[10:] = [line + " 0.5 0.5 0.5" for line in lines[10:]]
    lines.insert(1, "# counts follow\n")
    assert volume(load(tmp_path, "c.off", "\n".join(lines).encode())) == 1.0
    assert volume(load(tmp_path, "d.off", off().replace(b"OFF\n", b"OFF ", 1))) == 1.0


def test_a_ply_of_strips_or_of_polygons_of_several_sizes_is_refused_with_the_remedy(tmp_path):
    mixed = [*CUBE_QUADS[1:], *CUBE_TRIANGLES[:2].tolist()]
    strip = ply(faces=CUBE_QUADS).replace(b"element face", b"element tristrips")
    texts = [ply(faces=mixed), ply_binary(faces=mixed), ply_binary(faces=mixed[::-1], big=True), strip]
    # Sizes of which the sum is that of triangles alone: the faces' numbers betray it, not the file's length.
    texts.append(ply_binary(faces=[CUBE_TRIANGLES[0], CUBE_QUADS[1], (0, 1)]))
    for text in texts:
        with pytest.raises(MeshError, match=r"lists of different|truncated|triangle strips|follow"):
            load(tmp_path, "a.ply", text)
    with pytest.raises(MeshError, match=r"save the mesh as \.obj or \.stl"):
        load(tmp_path, "a.ply", strip)


def test_concave_polygons_are_fanned_exactly(tmp_path):
    outline = [(2.0, 1.0), (0.0, 0.0), (0.5, 1.0), (0.0, 2.0)]
    for start in range(4):
        ring = outline[start:] + outline[:start]
        vertices = [(x, y, z) for z in (0.0, 1.0) for x, y in ring]
        sides = [(i, 4 + i, 4 + (i + 1) % 4, (i + 1) % 4) for i in range(4)]
        body = mesh_body(load(tmp_path, f"dart{start}.obj", obj(vertices, [(0, 1, 2, 3), (7, 6, 5, 4), *sides])))
        assert body.moments.moments("solid").measure == pytest.approx(1.5, rel=1e-15)
        edges = sum(np.hypot(*np.subtract(ring[i], ring[i - 1])) for i in range(4))
        assert body.moments.moments("shell").measure == pytest.approx(3.0 + edges, rel=1e-15)


@given(st.lists(st.one_of(st.floats(allow_nan=False), st.decimals(-1000, 1000, places=6)), min_size=1, max_size=30), st.sampled_from(["{!r}", "{:.6f}", "{:.17e}", "{:+.9G}"]))  # fmt: skip
@settings(deadline=None, max_examples=30)
def test_decimal_numbers_are_read_as_python_reads_them(values, form):
    words = [form.format(float(value)) for value in values]
    read, whole = as_numbers(" \n".join(words).encode())
    assert whole and read.tobytes() == np.array([float(word) for word in words]).tobytes()


@pytest.mark.parametrize(
    "data",
    [
        stl_text().replace(b"\n", b" "),
        stl_text().replace(b"\n", b"\r"),
        b"\xef\xbb\xbf" + stl_text().replace(b"\n", b"\r\n"),
        stl_text().upper(),
        stl_text().replace(b"solid test", b"solid of vertex 1 2 and an endfacet", 1),
        b" \n" * 33_000 + stl_text(),
        b"solid with one facet each".ljust(80) + stl()[80:],
        stl(count=0),  # left for later by what writes facets as they come
        stl() + b"\r\n",
    ],
)
def test_stl_in_every_spelling(tmp_path, data):
    mesh = load(tmp_path, "a.stl", data)
    assert np.array_equal(mesh.vertices[mesh.triangles], CUBE_VERTICES[CUBE_TRIANGLES])


@pytest.mark.parametrize(
    "damaged",
    [b"facet normalsolid 0 0 1", b"facsolid et normal 0 0 1", b"solid facet normal 0 0", b"facet 0 0 1", b"\nsolid\n"],
)
def test_no_facet_of_a_damaged_text_is_left_out_in_silence(tmp_path, damaged):
    lines = stl_text().replace(b"solid test", b"solid", 1).split(b"\n")
    for k in (k for k, line in enumerate(lines) if line.strip().startswith(b"facet")):
        for line_end in (b"\n", b" "):
            with pytest.raises(MeshError, match="36 vertices in 11 whole facets"):
                load(tmp_path, "a.stl", line_end.join([*lines[:k], damaged, *lines[k + 1 :]]))


@pytest.mark.parametrize("kind", ["off", "ply", "stl", "stl_ascii", "glb"])
def test_files_that_trimesh_writes_are_read_as_it_had_them(tmp_path, meshes, kind):
    trimesh = pytest.importorskip("trimesh")
    mesh = load_mesh(str(meshes / "spot.obj"))
    data = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False).export(file_type=kind)
    again = load(tmp_path, "a." + kind.split("_")[0], data.encode() if isinstance(data, str) else data)
    # Single precision, but for .ply and .off.
    corners, expected = again.vertices[again.triangles], mesh.vertices[mesh.triangles]
    assert np.max(np.abs(corners - expected)) <= 1e-7 * np.max(np.abs(expected))


def test_names_of_bundled_bodies_and_package_uris_find_the_same_file():
    assert {"t_handle", "hammer", "hollow_box"} <= set(body_names())
    by_name, by_uri = load_mesh("t_handle"), load_mesh("package://rigid_proto_ros/bodies/t_handle.obj")
    assert (by_name.path, by_name.sha256) == (by_uri.path, by_uri.sha256)


def test_a_second_look_judges_nothing_and_a_cache_that_fails_is_no_error(tmp_path, monkeypatch, own_cache):
    first = mesh_body(load(tmp_path, "a.obj", obj(faces=CUBE_QUADS))).verdict

    def never(*_args, **_options):
        raise AssertionError("done again")

    with monkeypatch.context() as context:
        context.setattr(from_mesh, "check_surface", never)
        assert mesh_body(load_mesh(str(tmp_path / "a.obj"))).verdict == first
    for damage in (b"", b"{", b"[1, 2]", b'{"findings": 3}'):
        for path in from_mesh.folder().iterdir():
            path.write_bytes(damage)
        assert mesh_body(load_mesh(str(tmp_path / "a.obj"))).verdict == first
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert mesh_body(load_mesh(str(tmp_path / "a.obj"))).verdict == first


def test_without_a_cache_nothing_is_kept_and_all_is_judged(tmp_path, monkeypatch, own_cache):
    monkeypatch.setenv("RIGID_PROTO_CACHE", "off")
    assert volume(load(tmp_path, "a.obj", obj())) == 1.0
    assert [path.name for path in tmp_path.iterdir()] == ["a.obj"]
