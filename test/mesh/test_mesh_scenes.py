# SPDX-License-Identifier: MIT
"""Files of placed parts, .gltf, .3mf and .dae: each feature that moves a vertex is read as specified or refused by name."""

import json
import os
import struct
import zipfile

import numpy as np
import pytest
from judged_meshes import codes, load, volume
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES, GEOMETRY, Gltf, collada, components, cube_object, model, threemf

from rigid_proto_ros.base.errors import MeshError
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mesh import reading
from rigid_proto_ros.mesh.assembly import Assembly
from rigid_proto_ros.mesh.reading import Mesh, load_mesh


def box_of(mesh: Mesh) -> list[list[float]]:
    return [mesh.vertices.min(axis=0).tolist(), mesh.vertices.max(axis=0).tolist()]


def load_3mf(folder, root: str, **others: str) -> Mesh:
    return load(folder, "a.3mf", threemf(root, **others))


def test_gltf_integers_that_are_not_normalized_are_themselves_whatever_the_looks(tmp_path):
    file = Gltf(CUBE_VERTICES * 100, "u1")
    file.json["extensionsRequired"] = ["KHR_mesh_quantization", "KHR_materials_unlit", "KHR_texture_transform"]
    assert volume(load(tmp_path, "a.gltf", file.gltf())) == 1e6


def test_gltf_nodes_are_placed_one_in_the_other_and_mirrored_ones_face_outward(tmp_path):
    file = Gltf()
    half = 0.5**0.5
    file.json["nodes"] = [
        {"children": [1], "rotation": [0, 0, half, half], "translation": [10, 0, 0]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -2, 0, 3, 0, 0, 1]},
    ]
    mesh = load(tmp_path, "a.gltf", file.gltf())
    np.testing.assert_allclose(box_of(mesh), [[9, 3, -2], [10, 4, 0]], rtol=0, atol=1e-15)
    body = mesh_body(mesh)
    assert body.moments.moments("solid").measure == pytest.approx(2.0) and not body.verdict.inward


def test_gltf_of_which_something_is_not_read_says_what(tmp_path):
    changes = {
        "is sparse": lambda f: f.json["accessors"][0].update(sparse={"count": 1}),
        "KeyError: 'bufferView'": lambda f: f.json["accessors"][0].pop("bufferView"),
        "normalized": lambda f: f.json["accessors"][0].update(normalized=True),
        "strips or fans": lambda f: f.primitive.update(mode=5),
        "EXT_mesh_gpu_instancing": lambda f: f.node.update(extensions={"EXT_mesh_gpu_instancing": {}}),
        "EXT_meshopt_compression": lambda f: f.json.update(extensionsRequired=["EXT_meshopt_compression"]),
        "Draco": lambda f: f.primitive.update(extensions={"KHR_draco_mesh_compression": {"bufferView": 0}}),
        "vertex 8": lambda f: f.primitive.update(indices=f.add(CUBE_TRIANGLES + 1, "<u2")),
        "meshes 7": lambda f: f.node.update(mesh=7),
        "nodes -1": lambda f: f.json["scenes"][0].update(nodes=[-1]),
        "skin": lambda f: f.node.update(skin=0),
        "morphed": lambda f: f.node.update(weights=[0.0, 0.5]),
        "twice": lambda f: f.node.update(children=[0]),
        "beyond bufferView": lambda f: f.json["accessors"][0].update(count=9),
        "accessor 0 is VEC2, where VEC3 belongs": lambda f: f.json["accessors"][0].update(type="VEC2"),
        "accessor 0 is SCALAR": lambda f: f.json["accessors"][0].update(type="SCALAR", count=24),
        "accessor 1 is VEC2": lambda f: f.json["accessors"][1].update(type="VEC2", count=18),
        "multiple of 3": lambda f: f.json["accessors"][1].update(count=35),
        "may be truncated": lambda f: f.json["bufferViews"][1].update(byteLength=10**6),
        "KeyError": lambda f: f.json["accessors"][0].pop("count"),
        "TypeError": lambda f: f.json.update(nodes=[1]),
    }
    for words, change in changes.items():
        file = Gltf()
        change(file)
        with pytest.raises(MeshError, match=words):
            load(tmp_path, "a.gltf", file.gltf())


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_gltf_numbers_that_are_not_finite_are_left_to_the_verdict(tmp_path):
    turned = Gltf()
    turned.node["rotation"] = [0, 0, 0, 0]
    assert codes(mesh_body(load(tmp_path, "a.gltf", turned.gltf()))) == {"nonfinite": "error"}
    signalling = np.frombuffer(np.uint32(0x7F800001).tobytes(), "<f4")[0]
    for number in (np.inf, signalling):
        vertices = CUBE_VERTICES.astype("<f4")
        vertices[0, 0] = number
        assert codes(mesh_body(load(tmp_path, "a.gltf", Gltf(vertices).gltf()))) == {"nonfinite": "error"}


SHIFT = 'transform="1 0 0 0 1 0 0 0 1 5 0 0"'


def test_3mf_items_and_components_by_reference_are_placed_once(tmp_path):
    root = model(
        components(2, 'objectid="1"', f'objectid="1" {SHIFT}') + cube_object(1),
        'objectid="2"',
        'objectid="1" transform="1 0 0 0 1 0 0 0 2 0 0 9"',
    )
    mesh = load_3mf(tmp_path, root)
    assert volume(mesh) == 4.0 and box_of(mesh) == [[0, 0, 0], [6, 1, 11]]


def test_3mf_parts_in_files_of_their_own_count_once(tmp_path):
    root = model(
        components(1, 'objectid="1" p:path="/3D/part.model"'), 'objectid="1"', attributes='requiredextensions="p"'
    )
    part = model(cube_object(1) + cube_object(2), 'objectid="1"').replace("meter", "centimeter")
    assert volume(load_3mf(tmp_path, root, part=part)) == pytest.approx(1e-6)
    item = model("", 'objectid="2" p:path="/3D/part.model"')
    assert volume(load_3mf(tmp_path, item, part=part)) == pytest.approx(1e-6)


def test_a_3mf_without_a_relation_is_its_one_model(tmp_path):
    path = tmp_path / "a.3mf"
    for name in ("a", "b"):
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr(f"{name}.model", model(cube_object(1), 'objectid="1"'))
        if name == "a":
            assert volume(load_mesh(str(path))) == 1.0
    with pytest.raises(MeshError, match="2 files .model"):
        load_mesh(str(path))


def test_3mf_units_and_placements_count_along_the_whole_way_from_file_to_file(tmp_path):
    inner = model(cube_object(1) + components(2, f'objectid="1" {SHIFT}'), 'objectid="1"').replace("meter", "inch")
    outer = model(components(1, f'objectid="2" p:path="/3D/inner.model" {SHIFT}'), "").replace("meter", "centimeter")
    mesh = load_3mf(tmp_path, model("", 'objectid="1" p:path="/3D/outer.model"'), inner=inner, outer=outer)
    x = 0.05 + 5 * 0.0254
    assert np.ravel(box_of(mesh)) == pytest.approx([x, 0, 0, x + 0.0254, 0.0254, 0.0254], rel=1e-15)


def test_3mf_supports_are_no_part_of_the_body_and_mirrored_items_face_outward(tmp_path):
    objects = cube_object(1) + cube_object(2, 'type="support"') + cube_object(3, 'type="solidsupport"')
    mirrored = 'objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"'
    body = mesh_body(load_3mf(tmp_path, model(objects, mirrored, f'objectid="2" {SHIFT}', f'objectid="3" {SHIFT}')))
    assert body.moments.moments("solid").measure == 1.0 and not body.verdict.inward


def test_3mf_components_within_each_other_are_multiplied_before_any_is_placed(tmp_path, monkeypatch):
    monkeypatch.setattr(Assembly, "add", lambda *_: pytest.fail("one was placed"))
    nested = "".join(components(k, *[f'objectid="{k - 1}"'] * 30) for k in range(2, 8))
    with pytest.raises(MeshError, match="more than 100000 times"):
        load_3mf(tmp_path, model(cube_object(1) + nested, 'objectid="7"'))


@pytest.mark.parametrize(
    ("root", "words"),
    [
        (model(cube_object(1, triangles=CUBE_TRIANGLES + 1), 'objectid="1"'), "vertex 8"),
        (model(cube_object(1), 'objectid="7"'), "object '7'"),
        (model("", 'objectid="1" p:path="/3D/gone.model"'), "gone.model"),
        (model(components(1, 'objectid="1"'), 'objectid="1"'), "within themselves"),
        (model(cube_object(1), 'objectid="1"', attributes='xmlns:v="http://v" requiredextensions="v"'), "http://v"),
        (model('<object id="1"><booleanshape/></object>', 'objectid="1"'), "booleanshape"),
        (model(cube_object(1).replace("<vertices>", "<beamlattice/><vertices>"), 'objectid="1"'), "beamlattice"),
        (model(cube_object(1), 'objectid="1"').replace('unit="meter"', 'unit="ell"'), "unit ell"),
        (model(cube_object(1).replace('x="0.0"', 'x="o"'), 'objectid="1"'), "ValueError"),
        (model(cube_object(1)), "no faces"),
    ],
)
def test_3mf_of_which_something_is_not_read_says_what(tmp_path, root, words):
    with pytest.raises(MeshError, match=words):
        load_3mf(tmp_path, root)


INSTANCE = '<instance_geometry url="#cube"/>'
BOUND = (
    '<instance_geometry url="#cube"><bind_material><technique_common>'
    '<instance_material symbol="m" target="#{}"/></technique_common></bind_material></instance_geometry>'
)
TEXTURED = (
    '<library_images><image id="i"><init_from>gone.png</init_from></image></library_images>'
    '<library_effects><effect id="e"><profile_COMMON><newparam sid="t"><sampler2D><source>nowhere</source></sampler2D>'
    '</newparam><technique sid="c"><phong><diffuse><texture texture="t" texcoord="x"/></diffuse></phong></technique>'
    "</profile_COMMON></effect></library_effects>"
    '<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>'
)


def load_dae(folder, nodes: str, geometry: str = GEOMETRY, libraries: str = "") -> Mesh:
    pytest.importorskip("collada")
    return load(folder, "a.dae", collada(nodes, geometry, libraries))


def test_dae_instances_count_whatever_becomes_of_their_material_or_texture(tmp_path):
    nodes = f"<node>{INSTANCE}</node><node><translate>5 0 0</translate>{BOUND.format('gone')}</node>"
    assert volume(load_dae(tmp_path, nodes)) == 2.0
    nodes = f"<node>{BOUND.format('m')}</node><node><scale>2 2 2</scale>{BOUND.format('m')}</node>"
    assert len(load_dae(tmp_path, nodes, libraries=TEXTURED).triangles) == 24


def test_a_dae_whose_unit_is_no_number_is_refused(tmp_path):
    pytest.importorskip("collada")
    data = collada(f"<node>{INSTANCE}</node>")
    assert volume(load(tmp_path, "a.dae", data.replace(b'meter="1"', b'meter="0.01"'))) == pytest.approx(1e-6)
    assert volume(load(tmp_path, "a.dae", data.replace(b'meter="1"', b'name="meter"'))) == 1.0
    with pytest.raises(MeshError, match="0,01"):
        load(tmp_path, "a.dae", data.replace(b'meter="1"', b'meter="0,01"'))


def test_dae_strips_are_triangles_and_mirrored_nodes_face_outward(tmp_path):
    body = mesh_body(load_dae(tmp_path, f"<node><scale>1 1 -2</scale>{INSTANCE}</node>"))
    assert body.moments.moments("solid").measure == 2.0 and not body.verdict.inward
    strips = "".join(f"<p>{p}</p>" for p in ("0 1 2 3", "4 6 5 7", "0 4 1 5", "2 3 6 7", "0 2 4 6", "1 5 3 7"))
    head, _, tail = GEOMETRY.partition("<p>")
    head, tail = head.replace("<triangles", "<tristrips"), tail.partition("</p>")[2].replace("triangles", "tristrips")
    assert volume(load_dae(tmp_path, f"<node>{INSTANCE}</node>", head + strips + tail)) == 1.0


@pytest.mark.parametrize(
    ("nodes", "geometry", "words"),
    [
        (f"<node>{INSTANCE}</node>", GEOMETRY.replace("<p>0 ", "<p>8 "), "cube|index"),
        (f"<node>{INSTANCE}</node><node>{INSTANCE.replace('cube', 'gone')}</node>", GEOMETRY, "gone"),
        ('<node><instance_node url="#gone"/></node>', GEOMETRY, "gone|scene"),
        ('<node><instance_controller url="#skin"/></node>', GEOMETRY, "#skin"),
        (f"<node>{INSTANCE}</node>", GEOMETRY.replace("</mesh>", "<spline/></mesh>"), "spline"),
    ],
)
def test_dae_of_which_something_is_not_read_says_what(tmp_path, nodes, geometry, words):
    with pytest.raises(MeshError, match=words):
        load_dae(tmp_path, nodes, geometry)


def test_a_3mf_that_is_no_archive_or_unpacks_to_far_more_than_its_size_is_refused_before_it_is_unpacked(
    tmp_path, monkeypatch
):
    large, lying = threemf(" " * 10_000_000), bytearray(threemf(" " * 10_000_000, method=zipfile.ZIP_BZIP2))
    # What its directory says isn't what it is.
    struct.pack_into("<I", lying, lying.rfind(b"PK\1\2") + 24, 100)
    for data, words in ((b"PK\3\4no archive", "zip file"), (large, "bytes unpacked"), (lying, "compressed by")):
        with pytest.raises(MeshError, match=words):
            load(tmp_path, "a.3mf", bytes(data))
    monkeypatch.setattr(reading, "MAX_BYTES", 40_000)
    with pytest.raises(MeshError, match="at most 40000"):
        load(tmp_path, "a.3mf", threemf(" " * 50_000))


def test_a_gltf_whose_numbers_are_in_a_pipe_is_refused_without_waiting_for_it(tmp_path):
    file = Gltf()
    os.mkfifo(tmp_path / "pipe.bin")
    file.json["buffers"] = [{"uri": "pipe.bin", "byteLength": 1}]
    with pytest.raises(MeshError, match="pipe"):
        load(tmp_path, "a.gltf", json.dumps(file.json).encode())
