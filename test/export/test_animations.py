# SPDX-License-Identifier: MIT
"""A flight as glTF and as USD: played by the formats' own rules, body, ghost and string are where the simulation has them at
every frame, and the body has the mass properties that it has."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from gltf_player import Player, z_up
from mesh_files import Gltf
from PIL import Image
from scipy.spatial.transform import Rotation

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.export.flight_record import FlightRecord, Source, frames, source_of_scene
from rigid_proto_ros.export.gltf import INDICES, TRIANGLES, VERTICES, Document
from rigid_proto_ros.picture.surface import BOX_CORNERS, BOX_TRIANGLES
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import read_script

THROWN = {
    "gravity": [0.0, 0.0, -9.81],
    "initial.linear_velocity": [1.0, 0.5, 4.0],
    "initial.angular_velocity": [3.0, 20.0, 1.0],
    "string.timeout": 10.0,
    "string.rest_length": 0.6,
}
# A string .6 m long is slack at first, pulled taut, let go, and tied once more.
CHANGES = """
- {t: 0.1, string: {target: [0.3, 0.0, 0.3]}}
- {t: 0.21, at: {vertex: 3}, impulse: [0.1, 0.0, 0.05]}
- {t: 0.30000001, set: {scale: [1.5, 1.5, 0.7]}}
- {t: 0.4, string: {target: [0.3, 0.2, 0.5]}}
- {t: 0.45, set: {inertia_model: bounding_box}}
- {t: 0.5000003, string: {target: [0.5, 0.6, 0.5]}}
- {t: 0.7, set: {scale: [-1.0, 1.0, 1.0]}}
- {t: 0.8, string: release}
- {t: 0.9, string: {target: [0.0, 0.3, 0.0]}}
"""
TIMES = np.unique(np.append(np.arange(31) / 30, 0.21))
"""Frames, one of them at the impulse, which bends the path."""


class Stage:
    """A .usda or .usdc as ``Player`` has a .glb."""

    def __init__(self, file: Path) -> None:
        Usd = pytest.importorskip("pxr.Usd")
        self.stage = Usd.Stage.Open(str(file))

    def prim(self, name: str):
        return self.stage.GetPrimAtPath(f"/flight/{name}")

    def box(self, t: float) -> np.ndarray:
        """Two corners of the mesh's box (2, 3) [world]."""
        from pxr import UsdGeom

        mesh = UsdGeom.Mesh(self.prim("body/mesh"))
        low, high = np.array(mesh.GetExtentAttr().Get(), dtype=float)
        world = np.array(mesh.ComputeLocalToWorldTransform(self.code(t)))
        return (np.array([[*low, 1.0], [*high, 1.0]]) @ world)[:, :3]

    def string(self, t: float) -> np.ndarray | None:
        from pxr import UsdGeom

        curve = UsdGeom.BasisCurves(self.prim("string"))
        if curve.ComputeVisibility(self.code(t)) != "inherited":
            return None
        return np.array(curve.GetPointsAttr().Get(self.code(t)), dtype=float)

    def code(self, t: float) -> float:
        return t * self.stage.GetTimeCodesPerSecond()


class Glb(Player):
    def box(self, t: float) -> np.ndarray:
        points = self.mesh_points("body mesh")
        return z_up(self.world("body mesh", np.array([points.min(axis=0), points.max(axis=0)]), t))

    def string(self, t: float) -> np.ndarray | None:
        ends = z_up(self.world("string", self.mesh_points("string"), t))
        return ends if np.ptp(ends, axis=0).max() > 1e-5 else None


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """The folder of flight.glb, flight.usda and flight.usdc, and true boxes and string's ends at each of TIMES."""
    folder = tmp_path_factory.mktemp("flight")
    (folder / "changes.yaml").write_text(CHANGES)
    options = [f"--set={name}={value}" for name, value in THROWN.items()]
    options += ["--script", str(folder / "changes.yaml"), "--duration", "1"]
    for names in (["gltf=flight.glb", "usd=flight.usda"], ["usd=flight.usdc"]):
        files = [f"--{option}={folder / name}" for option, name in (each.split("=") for each in names)]
        assert main(["simulate", "hammer", *options, *files]) == 0
    run = OfflineRun(read_scene("hammer", THROWN), read_script(str(folder / "changes.yaml")))
    truths = []
    for t in TIMES:
        run.advance(round(t * 1e9))
        state, body, tied = run.simulation.state, run.simulation.setup.body, run.simulation.string
        vertices = run.scenario.body_mesh.surface.vertices
        box = np.array([vertices.min(axis=0), vertices.max(axis=0)]) * body.scale - body.center_of_mass
        string = None
        if tied is not None:
            knot = state.position + state.rotation @ body.point(tied.attach)
            string = np.array([tied.free_end(round(t * 1e9)), knot])
        truths.append((box @ state.rotation.T + state.position, string))
    return folder, truths


@pytest.mark.parametrize("name", ["flight.glb", "flight.usda", "flight.usdc"])
def test_mesh_and_string_are_drawn_where_they_are_through_pokes_rescaling_and_other_models(name, flight):
    folder, truths = flight
    file = (Glb if name.endswith(".glb") else Stage)(folder / name)
    worst, tied = 0.0, 0
    for t, (box, string) in zip(TIMES, truths, strict=True):
        worst = max(worst, float(np.linalg.norm(file.box(t) - box, axis=1).max()))
        seen = file.string(t)
        assert (seen is None) == (string is None), t
        if string is not None:
            tied += 1
            worst = max(worst, float(np.linalg.norm(seen - string, axis=1).max()))
    assert worst < 1e-5 and 20 < tied < len(TIMES)  # m, of single precision: measured 7e-7


def record_of(scene: str, settings: dict, seconds: float) -> tuple[FlightRecord, Source]:
    scenario = read_scene(scene, settings)
    record = FlightRecord()
    OfflineRun(scenario, [], record).advance(round(seconds * 1e9))
    return record, source_of_scene(scenario, [])


@pytest.mark.parametrize("fps", [24.0, 240.0])
def test_frames_come_evenly_and_are_the_simulated_states_to_the_bit(fps):
    # 700 rad/s published every 10 ms: more than a turn from state to state.
    settings = {"initial.angular_velocity": [0.0, 3.0, 700.0]}
    record, source = record_of("book", settings, 0.5)
    made, said = frames(record, source, fps)
    assert said == f"{len(made.times_ns)} frames, {fps:g} a second"
    assert np.array_equal(made.times_ns[:-1], np.rint(np.arange(len(made.times_ns) - 1) * 1e9 / fps))
    assert made.times_ns[-1] == 500_000_000
    run = OfflineRun(read_scene("book", settings))
    for time_ns, row in zip(made.times_ns.tolist(), made.rows, strict=True):
        run.advance(time_ns)
        assert np.array_equal(row, run.simulation.state.row)


def test_a_motion_that_cannot_be_simulated_again_is_drawn_as_recorded():
    record, _ = record_of("hammer", THROWN, 0.3)
    _, other = record_of("hammer", {**THROWN, "gravity": [0.0, 0.0, -9.0]}, 0.3)
    for source, reason in ((None, "can't be simulated again"), (other, "isn't reproduced")):
        made, said = frames(record, source, 30.0)
        assert made is record and reason in said


@pytest.mark.parametrize("change", ["mesh: book", "mesh: '', inertia_model: explicit"])
def test_a_flight_of_several_meshes_is_refused(tmp_path, capsys, change):
    (tmp_path / "swap.yaml").write_text(f"- {{t: 0.1, set: {{{change}}}}}")
    words = ["--script", str(tmp_path / "swap.yaml"), "--duration", "0.2", "--gltf", str(tmp_path / "a.glb")]
    assert main(["simulate", "hammer", *words]) == 2
    assert "the mesh changes at 0.1 s" in capsys.readouterr().err


def test_the_ghost_flies_beside_the_body_with_a_centre_of_its_own(tmp_path):
    file = tmp_path / "two.glb"
    settings = ["--set", "inertia_model_com=model", "--duration", "2"]
    assert main(["simulate", "true_or_box_tensor", *settings, "--gltf", str(file)]) == 0
    player = Player(file)
    run = OfflineRun(read_scene("true_or_box_tensor", {"inertia_model_com": "model"}), [], heard := FlightRecord())
    run.advance(2 * 10**9)
    times = list(heard.ghosts)[::10]  # every third frame is a published state
    ghosts = Rotation.from_quat([heard.ghosts[t][3:7] for t in times])

    def apart(name: str) -> float:
        seen = [player.value(player.nodes[name], "rotation", t * 1e-9) for t in times]
        return (Rotation.from_quat(seen).inv() * ghosts).magnitude().max()

    assert apart("ghost") < 1e-6 and apart("body") > np.radians(5)
    nodes = {node["name"]: node for node in player.document["nodes"]}
    true, box = (np.array(nodes[name]["extras"]["center_of_mass"]) for name in ("body", "ghost"))
    assert np.linalg.norm(true - box) == pytest.approx(0.024, abs=5e-4)  # in the lesson: 2.4 cm
    offset = np.array(nodes["body mesh"]["translation"]) - nodes["ghost mesh"]["translation"]
    assert np.allclose(offset, box - true)
    assert nodes["ghost"]["extras"]["inertia_model"] == "bounding_box"
    assert "KHR_physics_rigid_bodies" in player.document["extensionsUsed"]
    for name in ("body", "ghost"):
        own, motion = nodes[name]["extras"], nodes[name]["extensions"]["KHR_physics_rigid_bodies"]["motion"]
        R = Rotation.from_quat(motion["inertiaOrientation"]).as_matrix()
        inertia = R @ np.diag(motion["inertiaDiagonal"]) @ R.T
        assert np.max(np.abs(inertia - own["inertia"])) <= 1e-14 * np.max(own["inertia"])
        assert (motion["mass"], motion["centerOfMass"], motion["isKinematic"]) == (own["mass"], [0, 0, 0], True)


def test_a_ghost_that_is_gone_is_not_seen_until_it_comes_back(tmp_path):
    (tmp_path / "s.yaml").write_text(
        "- {t: 0.5, set: {ghost.inertia_model: ''}}\n- {t: 0.8, set: {ghost.inertia_model: points}}\n"
    )
    files = ["--gltf", str(tmp_path / "two.glb"), "--usd", str(tmp_path / "two.usda")]
    script = ["--script", str(tmp_path / "s.yaml"), "--duration", "1"]
    assert main(["simulate", "true_or_box_tensor", *script, *files]) == 0
    player, stage = Player(tmp_path / "two.glb"), Stage(tmp_path / "two.usda")
    for t, seen in ((0.4, True), (0.55, False), (0.75, False), (0.9, True)):
        assert player.value(player.nodes["ghost mesh"], "scale", t).any() == seen, t
        assert (stage.prim("ghost/mesh").GetAttribute("visibility").Get(stage.code(t)) == "inherited") == seen, t
        assert player.value(player.nodes["body mesh"], "scale", t).all()


def test_the_motion_ends_with_the_simulation_and_not_with_its_last_published_state(tmp_path):
    file = tmp_path / "rare.glb"
    words = ["--set", "publish_rate=0.5", "--duration", "1.01", "--gltf", str(file)]
    assert main(["simulate", "t_handle", *words]) == 0
    player = Player(file)
    times, turns, _ = player.keys("body", "rotation")
    assert len(times) == 32 and times[-1] == pytest.approx(1.01)
    run = OfflineRun(read_scene("t_handle"))
    run.advance(1_010_000_000)
    assert np.allclose(turns[-1], run.simulation.state.orientation_xyzw, atol=1e-7)


def test_frames_have_whole_time_codes_and_show_what_is_there_from_them_on(tmp_path):
    file, script = tmp_path / "tied.usda", tmp_path / "tie.yaml"
    # Frame 2 is at 66666667 ns, rounded up.
    script.write_text("- {t: 0.05, string: {target: [0.0, 0.0, 0.3]}}")
    assert main(["simulate", "hammer", "--script", str(script), "--duration", "0.2", "--usd", str(file)]) == 0
    stage = Stage(file)
    codes = stage.prim("body").GetAttribute("xformOp:translate").GetTimeSamples()
    assert codes == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert stage.string(1.0 / 30.0) is None and stage.string(2.0 / 30.0) is not None


def test_a_body_without_a_mesh_that_does_not_move_is_a_node_with_one_key(tmp_path):
    file = tmp_path / "none.glb"
    explicit = ["--set", "mesh=", "--set", "inertia_model=explicit", "--set", "explicit_inertia.mass=1.0"]
    tensor = ["--set", "explicit_inertia.tensor=[0.1, 0.0, 0.0, 0.2, 0.0, 0.25]"]
    assert main(["simulate", "book", *explicit, *tensor, "--duration", "0", "--gltf", str(file)]) == 0
    player = Player(file)
    assert not player.document.get("meshes")
    assert player.document["nodes"][1]["extras"]["mass"] == 1.0
    assert len(player.keys("body", "translation")[0]) == 1


def painted_cube(file: Path) -> bytes:
    """A .glb of a cube in two parts of a material each, one of them with a picture; returns that picture."""
    packed = io.BytesIO()
    Image.new("RGB", (2, 2), (200, 10, 10)).save(packed, "png")
    document = Document(0)
    for name, colour in (("red", (200, 10, 10)), ("blue", (10, 10, 200))):
        document.material(name, colour)
    picture = packed.getvalue() + bytes(-len(packed.getvalue()) % 4)
    document.data += picture
    view = document.add("bufferViews", buffer=0, byteOffset=0, byteLength=len(picture))
    image = document.add("images", bufferView=view, mimeType="image/png")
    texture = document.add("textures", source=image)
    document.lists["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": texture}
    corners = document.accessor(0.05 * BOX_CORNERS + [0.3, 0.0, 0.1], VERTICES, bounds=True)
    cube = document.node("cube", None)
    for half, material in ((BOX_TRIANGLES[:6], 0), (BOX_TRIANGLES[6:], 1)):
        indices = document.accessor(half.ravel(), INDICES)
        mesh = document.mesh("half", {"POSITION": corners}, indices, TRIANGLES, material)
        document.node(f"half {material}", cube, mesh=mesh)
    file.write_bytes(document.binary())
    return picture


def test_a_glb_keeps_its_materials_and_pictures_and_is_where_the_body_is(tmp_path):
    picture, file = painted_cube(tmp_path / "cube.glb"), tmp_path / "flight.glb"
    settings = {"mesh": str(tmp_path / "cube.glb"), "scale": [2.0, 1.0, 1.0], **THROWN}
    arguments = [f"--set={name}={value}" for name, value in settings.items()]
    assert main(["simulate", "t_handle", "--duration", "0.5", *arguments, "--gltf", str(file), "--fps", "24"]) == 0
    player = Player(file)
    made = player.document
    assert [material["name"] for material in made["materials"]] == ["red", "blue"]
    texture = made["textures"][made["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
    view = made["bufferViews"][made["images"][texture["source"]]["bufferView"]]
    assert player.binary[view["byteOffset"] :][: view["byteLength"]] == picture
    run = OfflineRun(read_scene("t_handle", settings), [])
    for k in (0, 5, 12):
        run.advance(round(k / 24 * 1e9))
        state, body = run.simulation.state, run.simulation.setup.body
        expected = [state.position + state.rotation @ body.point(v) for v in 0.05 * BOX_CORNERS + [0.3, 0.0, 0.1]]
        for name in ("half 0", "half 1"):
            drawn = z_up(player.world(name, player.mesh_points(name), k / 24))
            assert np.abs(drawn - expected).max() < 1e-6


def flown(folder: Path, model: bytes) -> Player:
    (folder / "model.glb").write_bytes(model)
    words = ["--set", f"mesh={folder / 'model.glb'}", "--duration", "0.1", "--gltf", str(folder / "flight.glb")]
    assert main(["simulate", "t_handle", *words]) == 0
    return Player(folder / "flight.glb")


def test_a_glb_with_a_lamp_keeps_it(tmp_path):
    cube, lamps = Gltf(), {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    cube.node.update(name="cube", extensions={"KHR_lights_punctual": {"light": 0}})
    cube.json |= {"extensions": lamps, "extensionsUsed": list(lamps)}
    made = flown(tmp_path, cube.glb()).document
    assert made["extensions"] == lamps and set(made["extensionsUsed"]) == {*lamps, "KHR_physics_rigid_bodies"}


@pytest.mark.parametrize("without", ["scenes", "buffers"])
def test_a_glb_without_a_scene_or_with_its_data_elsewhere_is_drawn_as_the_surface_that_was_flown(without, tmp_path):
    cube = Gltf()
    if without == "scenes":
        # A file that says of no scene what belongs to it shows all its nodes.
        cube.json["scenes"] = []
        model = cube.glb()
    else:
        model = cube.glb(uri=json.loads(cube.gltf())["buffers"][0]["uri"])
    made = flown(tmp_path, model)
    assert "model" not in made.nodes and len(made.document["buffers"]) == 1
    assert np.ptp(made.mesh_points("body mesh"), axis=0) == pytest.approx([1.0, 1.0, 1.0])


def test_usdchecker_finds_what_breaks_its_rules_and_nothing_in_a_flight(flight, tmp_path, capsys):
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdPhysics, UsdValidation

    def broken_rules(stage) -> set[str]:
        context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
        return {error.GetName() for error in context.Validate(stage)}

    stage = Usd.Stage.CreateInMemory()
    UsdPhysics.RigidBodyAPI.Apply(UsdGeom.Scope.Define(stage, "/a").GetPrim())
    assert len(broken_rules(stage)) == 4
    stage = Stage(flight[0] / "flight.usda").stage
    assert not broken_rules(stage)
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetEndTimeCode() / stage.GetTimeCodesPerSecond() == pytest.approx(1.0)
    (tmp_path / "change.yaml").write_text("- {t: 0.05, set: {density: 500.0}}")
    words = ["--script", str(tmp_path / "change.yaml"), "--usd", str(tmp_path / "a.usda"), "--duration", "0.1"]
    assert main(["simulate", "hammer", *words]) == 0
    assert "mass or tensor change: the file has the values at the start" in capsys.readouterr().out


def test_a_physics_engine_that_begins_with_the_stages_numbers_flies_as_the_samples_do(tmp_path):
    pytest.importorskip("pxr")
    from pxr import UsdGeom, UsdPhysics

    file = tmp_path / "flight.usda"
    assert main(["simulate", "thrown_hammer", "--duration", "0.5", "--usd", str(file), "--fps", "50"]) == 0
    run = OfflineRun(read_scene("thrown_hammer"))
    body, state = run.simulation.setup.body, run.simulation.state
    stage = Stage(file)
    prim, mass = stage.prim("body"), UsdPhysics.MassAPI(stage.prim("body"))
    # The prim's origin is the centre of mass, and the mesh hangs below it.
    assert tuple(mass.GetCenterOfMassAttr().Get()) == (0.0, 0.0, 0.0)
    assert mass.GetMassAttr().Get() == pytest.approx(body.mass, rel=1e-6)
    q = mass.GetPrincipalAxesAttr().Get()
    axes = matrix_from_quaternion(np.array([*q.GetImaginary(), q.GetReal()]))
    tensor = axes @ np.diag(mass.GetDiagonalInertiaAttr().Get()) @ axes.T
    assert np.abs(tensor - body.inertia).max() < 1e-6 * np.abs(body.inertia).max()  # single precision: measured 1e-7
    rigid = UsdPhysics.RigidBodyAPI(prim)
    velocity = np.array(rigid.GetVelocityAttr().Get(), dtype=float)
    assert np.allclose(velocity, state.linear_velocity, rtol=1e-6)
    assert np.allclose(np.radians(rigid.GetAngularVelocityAttr().Get()), state.angular_velocity, rtol=1e-6)
    scene = UsdPhysics.Scene(stage.prim("physics_scene"))
    gravity = np.array(scene.GetGravityDirectionAttr().Get()) * scene.GetGravityMagnitudeAttr().Get()
    assert np.allclose(gravity, run.simulation.setup.gravity, rtol=1e-6)
    place = UsdGeom.Xformable(prim).GetOrderedXformOps()[0]
    fallen = np.array(place.Get(0.0)) + 0.5 * velocity + 0.125 * gravity
    assert np.abs(np.array(place.Get(25.0)) - fallen).max() < 1e-5
    assert place.GetNumTimeSamples() == 26
