# SPDX-License-Identifier: MIT
"""What comes with a mesh's bytes: files that they take, units that they state, limits."""

import json
import struct

import mesh_files as mf
import numpy as np
import pytest
from judged_meshes import load, volume

from rigid_proto_ros.base.errors import MeshError
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.inspection import inspect_mesh
from rigid_proto_ros.mesh import assembly, reading
from rigid_proto_ros.mesh.reading import load_mesh


def write_gltf(folder, vertices: np.ndarray) -> None:
    """model.gltf and model.bin of a cube; the .gltf is the same for any vertices."""
    made = mf.Gltf(vertices)
    folder.mkdir(exist_ok=True)
    buffers = [{"uri": "model.bin", "byteLength": len(made.bytes)}]
    (folder / "model.gltf").write_text(json.dumps({**made.json, "buffers": buffers}))
    (folder / "model.bin").write_bytes(made.bytes)


def test_every_file_that_was_read_is_in_the_caches_key(tmp_path, own_cache):
    for name, scale, expected in (("a", 1.0, 1.0), ("b", 2.0, 8.0), ("a", 1.0, 1.0), ("a", 3.0, 27.0)):
        write_gltf(tmp_path / name, scale * mf.CUBE_VERTICES)
        assert volume(load_mesh(str(tmp_path / name / "model.gltf"))) == pytest.approx(expected, rel=1e-12)
    assert volume(load_mesh(str(tmp_path / "a" / "model.gltf"))) == pytest.approx(27.0, rel=1e-12)
    (tmp_path / "a" / "model.bin").unlink()
    with pytest.raises(MeshError):
        volume(load_mesh(str(tmp_path / "a" / "model.gltf")))


@pytest.mark.parametrize(
    ("name", "stated", "unit"),
    [
        ("a.dae", '<unit name="inch" meter="0.0254"/>', 0.0254),
        ("b.dae", '<unit name="meter" meter="1"/>', 1.0),
        ("c.dae", "", 1.0),
        ("a.3mf", "", 1e-3),
        ("b.3mf", 'unit="inch"', 0.0254),
        ("c.3mf", 'unit="meter"', 1.0),
    ],
)
def test_a_unit_that_the_file_states_is_taken_and_said(tmp_path, name, stated, unit):
    if name.endswith("dae"):
        pytest.importorskip("collada")
        scene = mf.collada('<node><instance_geometry url="#cube"/></node>')
        data = scene.replace(b'<unit meter="1"/>', stated.encode())
    else:
        data = mf.threemf(mf.model(mf.cube_object(1), 'objectid="1"').replace('unit="meter"', stated))
    mesh = load(tmp_path, name, data)
    assert mesh.unit == unit
    inspection = inspect_mesh(mesh_body(mesh))
    assert inspection.volume == pytest.approx(unit**3, rel=1e-12)
    said = [finding.message for finding in inspection.findings if finding.code == "stated_unit"]
    assert (len(said) == 1 and f"{unit:g} m" in said[0]) if unit != 1.0 else not said


def test_a_mesh_beyond_the_limit_is_refused(tmp_path, monkeypatch):
    for module in (reading, assembly):
        monkeypatch.setattr(module, "MAX_TRIANGLES", 11)
    for name, data in (("a.obj", mf.obj()), ("a.stl", mf.stl()), ("a.ply", mf.ply()), ("a.glb", mf.Gltf().glb())):
        with pytest.raises(MeshError, match="11"):
            load(tmp_path, name, data)


def test_a_binary_ply_with_several_lists_and_one_in_big_endian_are_read(tmp_path):
    for order, word in (("<", "little"), (">", "big")):
        header = f"ply\nformat binary_{word}_endian 1.0\nelement vertex 8\n"
        header += "".join(f"property double {axis}\n" for axis in "xyz")
        header += "element face 6\nproperty list uint int vertex_indices\nproperty uchar flags\n"
        header += "property list uchar float texcoord\nend_header\n"
        rows = b"".join(struct.pack(f"{order}3d", *v) for v in mf.CUBE_VERTICES)
        for quad in mf.CUBE_QUADS:
            rows += struct.pack(f"{order}I4iBB8f", 4, *quad, 7, 8, *[0.5] * 8)
        assert volume(load(tmp_path, "a.ply", header.encode() + rows)) == 1.0
        with pytest.raises(MeshError, match="truncated"):
            load(tmp_path, "cut.ply", (header.encode() + rows)[:-3])


def xaml(matrix: str) -> bytes:
    points = " ".join(f"{x},{y},{z}" for x, y, z in mf.CUBE_VERTICES)
    corners = " ".join(str(i) for i in mf.CUBE_TRIANGLES.ravel())
    return (
        '<ModelVisual3D xmlns="http://schemas.microsoft.com/winfx/2006/xaml/presentation"><ModelVisual3D.Transform>'
        f'<MatrixTransform3D Matrix="{matrix}"/></ModelVisual3D.Transform><ModelVisual3D.Content><GeometryModel3D>'
        f'<GeometryModel3D.Geometry><MeshGeometry3D Positions="{points}" Normals="{points}" TriangleIndices="{corners}"/>'
        "</GeometryModel3D.Geometry></GeometryModel3D></ModelVisual3D.Content></ModelVisual3D>"
    ).encode()


def test_a_format_without_a_reader_here_is_read_by_trimesh(tmp_path):
    pytest.importorskip("lxml")
    path = tmp_path / "a.xaml"
    path.write_bytes(xaml("2 0 0 0 0 2 0 0 0 0 2 0 5 6 7 1"))
    mesh = load_mesh(str(path))
    assert mesh.vertices.tolist() == (2.0 * mf.CUBE_VERTICES + [5.0, 6.0, 7.0]).tolist()
    assert volume(load_mesh(str(path))) == 8.0
    path.write_bytes(b"<a/>")
    with pytest.raises(MeshError, match=r"a\.xaml"):
        load_mesh(str(path))

    path = tmp_path / "points.xyz"
    path.write_text("0 0 0\n1 0 0\n0 1 0\n0 0 1\n")
    with pytest.raises(MeshError, match="PointCloud"):
        load_mesh(str(path))
