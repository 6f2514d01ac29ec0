# SPDX-License-Identifier: MIT
"""Files of placed parts, .gltf, .3mf and .dae: each feature that moves a vertex is read as specified or refused by name."""

import base64
import io
import json
import sys
import zipfile

import numpy as np
import pytest
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES

from rigid_proto_ros.base.errors import MeshError
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mesh.reading import Mesh, load_mesh


@pytest.fixture(autouse=True)
def no_cache(monkeypatch):
    monkeypatch.setenv("RIGID_PROTO_CACHE", "off")


def volume(mesh: Mesh) -> float:
    return mesh_body(mesh).moments.moments("solid").measure


def box_of(mesh: Mesh) -> list[list[float]]:
    return [mesh.vertices.min(axis=0).tolist(), mesh.vertices.max(axis=0).tolist()]


KINDS = {"i1": 5120, "u1": 5121, "<i2": 5122, "<u2": 5123, "<u4": 5125, "<f4": 5126}


class Gltf:
    """A .gltf file of a cube, in parts that a test changes."""

    def __init__(self, vertices=CUBE_VERTICES, kind: str = "<f4", triangles=CUBE_TRIANGLES) -> None:
        self.bytes = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}]}
        self.json |= {"accessors": [], "bufferViews": []}
        self.primitive = {"attributes": {"POSITION": self.add(vertices, kind)}, "indices": self.add(triangles, "<u2")}
        self.json["meshes"] = [{"primitives": [self.primitive]}]

    def view(self, values, kind: str) -> int:
        data = np.asarray(values).astype(kind).tobytes()
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data)})
        self.bytes += data + b"\0" * (-len(data) % 4)
        return len(self.json["bufferViews"]) - 1

    def add(self, values, kind: str) -> int:
        values = np.asarray(values)
        scalar = values.ndim == 1 or np.issubdtype(values.dtype, np.integer) and kind == "<u2"
        width = "SCALAR" if scalar else f"VEC{values.shape[1]}"
        count = values.size if scalar else len(values)
        accessor = {"bufferView": self.view(values, kind), "componentType": KINDS[kind], "count": count, "type": width}
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    @property
    def node(self) -> dict:
        return self.json["nodes"][0]

    def load(self, folder) -> Mesh:
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.bytes).decode()
        self.json["buffers"] = [{"uri": uri, "byteLength": len(self.bytes)}]
        (folder / "a.gltf").write_text(json.dumps(self.json))
        return load_mesh(str(folder / "a.gltf"))


def test_gltf_normalized_integers_are_fractions(tmp_path):
    for kind in ("i1", "u1", "<i2", "<u2"):
        file = Gltf(CUBE_VERTICES * np.iinfo(np.dtype(kind)).max, kind)
        file.json["accessors"][0]["normalized"] = True
        file.json["extensionsRequired"] = ["KHR_mesh_quantization"]
        file.node.update(scale=[2, 2, 2], translation=[1, 0, 0])
        assert box_of(file.load(tmp_path)) == [[1, 0, 0], [3, 2, 2]], kind


def test_gltf_integers_that_are_not_normalized_are_themselves(tmp_path):
    assert volume(Gltf(CUBE_VERTICES * 100, "u1").load(tmp_path)) == 1e6


def test_gltf_sparse_accessors_replace_some_vertices(tmp_path):
    for base in (True, False):
        file = Gltf(CUBE_VERTICES if base else np.zeros((8, 3)))
        moved = np.nonzero(CUBE_VERTICES[:, 2])[0] if base else np.arange(8)
        values = CUBE_VERTICES[moved] * (1, 1, 3)
        file.json["accessors"][0]["sparse"] = {
            "count": len(moved),
            "indices": {"bufferView": file.view(moved, "<u2"), "componentType": 5123},
            "values": {"bufferView": file.view(values, "<f4")},
        }
        if not base:
            del file.json["accessors"][0]["bufferView"]
        assert volume(file.load(tmp_path)) == 3.0


def test_gltf_instances_are_all_there(tmp_path):
    file = Gltf()
    shifts = file.add(np.array([[0.0, 0, 0], [5, 0, 0], [0, 9, 0]]), "<f4")
    scales = file.add(np.array([[1.0, 1, 1], [2, 2, 2], [1, 1, 1]]), "<f4")
    attributes = {"TRANSLATION": shifts, "SCALE": scales}
    file.node["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    mesh = file.load(tmp_path)
    assert volume(mesh) == 10.0 and box_of(mesh) == [[0, 0, 0], [7, 10, 2]]


def test_gltf_nodes_are_placed_one_in_the_other_and_mirrored_ones_face_outward(tmp_path):
    file = Gltf()
    half = 0.5**0.5
    file.json["nodes"] = [
        {"children": [1], "rotation": [0, 0, half, half], "translation": [10, 0, 0]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -2, 0, 3, 0, 0, 1]},
    ]
    mesh = file.load(tmp_path)
    np.testing.assert_allclose(box_of(mesh), [[9, 3, -2], [10, 4, 0]], rtol=0, atol=1e-15)
    body = mesh_body(mesh)
    assert body.moments.moments("solid").measure == pytest.approx(2.0) and not body.verdict.inward


def test_gltf_strips_and_fans_are_triangles(tmp_path):
    file = Gltf(triangles=np.zeros((1, 3), int))
    primitives = []
    for quad in ((0, 1, 2, 3), (4, 6, 5, 7), (0, 4, 1, 5), (2, 3, 6, 7)):
        primitives.append({**file.primitive, "indices": file.add(np.array(quad), "<u2"), "mode": 5})
    for quad in ((0, 2, 6, 4), (1, 5, 7, 3)):
        primitives.append({**file.primitive, "indices": file.add(np.array(quad), "<u2"), "mode": 6})
    file.json["meshes"][0]["primitives"] = [*primitives, {**file.primitive, "mode": 1}]
    assert volume(file.load(tmp_path)) == 1.0


def test_gltf_of_which_something_is_not_read_says_what(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    changes = {
        "EXT_meshopt_compression": lambda f: f.json.update(extensionsRequired=["EXT_meshopt_compression"]),
        "DracoPy": lambda f: (
            f.json["accessors"][0].pop("bufferView"),
            f.primitive.update(extensions={"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}}),
        ),
        "vertex 8": lambda f: f.primitive.update(indices=f.add(CUBE_TRIANGLES + 1, "<u2")),
        "meshes 7": lambda f: f.node.update(mesh=7),
        "nodes -1": lambda f: f.json["scenes"][0].update(nodes=[-1]),
        "skin": lambda f: f.node.update(skin=0),
        "morphed": lambda f: f.node.update(weights=[0.0, 0.5]),
        "twice": lambda f: f.node.update(children=[0]),
        "beyond bufferView": lambda f: f.json["accessors"][0].update(count=9),
        "multiple of 3": lambda f: f.json["accessors"][1].update(count=35),
        "entries": lambda f: f.json["accessors"][0].update(count=10**12),
        "may be truncated": lambda f: f.json["bufferViews"][1].update(byteLength=10**6),
        "KeyError": lambda f: f.json["accessors"][0].pop("count"),
        "TypeError": lambda f: f.json.update(nodes=[1]),
    }
    for words, change in changes.items():
        file = Gltf()
        change(file)
        with pytest.raises(MeshError, match=words):
            file.load(tmp_path)


def test_gltf_extensions_that_only_change_looks_are_no_reason_to_refuse(tmp_path):
    file = Gltf()
    file.json["extensionsRequired"] = ["KHR_materials_unlit", "KHR_texture_transform"]
    assert volume(file.load(tmp_path)) == 1.0


def test_draco_is_read_where_its_package_is(tmp_path):
    draco = pytest.importorskip("DracoPy")
    data = draco.encode(CUBE_VERTICES.astype(np.float32), CUBE_TRIANGLES.astype(np.uint32), quantization_bits=14)
    file = Gltf()
    view = file.view(np.frombuffer(data, np.uint8), "u1")
    file.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    file.json["accessors"][0].pop("bufferView")
    file.primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {"POSITION": 0}}}
    assert volume(file.load(tmp_path)) == pytest.approx(1.0, abs=1e-3)


CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"


def cube_object(number: int, attributes: str = "", triangles=CUBE_TRIANGLES) -> str:
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in CUBE_VERTICES)
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles)
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh>"
    return f'<object id="{number}" {attributes}>{mesh}</object>'


def components(number: int, *references: str) -> str:
    inside = "".join(f"<component {reference}/>" for reference in references)
    return f'<object id="{number}"><components>{inside}</components></object>'


def model(objects: str, *items: str, attributes: str = "") -> str:
    build = "".join(f"<item {item}/>" for item in items)
    names = f'xmlns="{CORE}" xmlns:p="{PRODUCTION}"'
    return f'<model unit="meter" {names} {attributes}><resources>{objects}</resources><build>{build}</build></model>'


def load_3mf(folder, root: str, **others: str) -> Mesh:
    relation = '<Relationship Target="/3D/root.model" Id="r" Type="http://x/3dmodel"/>'
    with zipfile.ZipFile(folder / "a.3mf", "w") as archive:
        archive.writestr("_rels/.rels", f"<Relationships>{relation}</Relationships>")
        archive.writestr("3D/root.model", root)
        for name, text in others.items():
            archive.writestr(f"3D/{name}.model", text)
    return load_mesh(str(folder / "a.3mf"))


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


def test_3mf_supports_are_no_part_of_the_body(tmp_path):
    objects = cube_object(1) + cube_object(2, 'type="support"') + cube_object(3, 'type="solidsupport"')
    root = model(objects, 'objectid="1"', f'objectid="2" {SHIFT}', f'objectid="3" {SHIFT}')
    assert volume(load_3mf(tmp_path, root)) == 1.0


def test_3mf_mirrored_items_face_outward(tmp_path):
    body = mesh_body(load_3mf(tmp_path, model(cube_object(1), 'objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"')))
    assert body.moments.moments("solid").measure == 1.0 and not body.verdict.inward


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


GEOMETRY = (
    '<geometry id="cube"><mesh><source id="s"><float_array id="f" count="24">'
    + " ".join(str(x) for x in CUBE_VERTICES.ravel())
    + '</float_array><technique_common><accessor source="#f" count="8" stride="3"><param name="X" type="float"/>'
    '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
    '<vertices id="v"><input semantic="POSITION" source="#s"/></vertices><triangles count="12" material="m">'
    '<input semantic="VERTEX" source="#v" offset="0"/><p>'
    + " ".join(str(i) for i in CUBE_TRIANGLES.ravel())
    + "</p></triangles></mesh></geometry>"
)
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
    (folder / "a.dae").write_text(
        '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>'
        f'<unit meter="1"/></asset>{libraries}<library_geometries>{geometry}</library_geometries>'
        f'<library_visual_scenes><visual_scene id="scene">{nodes}</visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#scene"/></scene></COLLADA>'
    )
    return load_mesh(str(folder / "a.dae"))


def test_dae_instances_count_whatever_becomes_of_their_material_or_texture(tmp_path):
    nodes = f"<node>{INSTANCE}</node><node><translate>5 0 0</translate>{BOUND.format('gone')}</node>"
    assert volume(load_dae(tmp_path, nodes)) == 2.0
    nodes = f"<node>{BOUND.format('m')}</node><node><scale>2 2 2</scale>{BOUND.format('m')}</node>"
    assert len(load_dae(tmp_path, nodes, libraries=TEXTURED).triangles) == 24


def test_dae_mirrored_nodes_face_outward(tmp_path):
    body = mesh_body(load_dae(tmp_path, f"<node><scale>1 1 -2</scale>{INSTANCE}</node>"))
    assert body.moments.moments("solid").measure == 2.0 and not body.verdict.inward


def test_dae_strips_are_triangles(tmp_path):
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


def test_a_zae_needs_one_document(tmp_path):
    pytest.importorskip("collada")
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("a.txt", "")
    (tmp_path / "a.zae").write_bytes(packed.getvalue())
    with pytest.raises(MeshError, match="0 .dae files"):
        load_mesh(str(tmp_path / "a.zae"))
