# SPDX-License-Identifier: MIT
"""Refused input: exit status 2 and one line that names what, where and what would be accepted; through the real commands."""

import errno
import os
import sys
from pathlib import Path

import pytest

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main as rigid_proto
from rigid_proto_ros.parameters.declarations import PARAMETERS
from rigid_proto_ros.ros.arguments import given_arguments, own_arguments
from rigid_proto_ros.ros.main import NodeProcess
from rigid_proto_ros.ros.main import main as rigid_body_node
from rigid_proto_ros.ros.poke_client import main as poke_client

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
MESHES = {
    "missing.obj": (None, "there is no file"),
    "open.obj": (TETRAHEDRON.replace("f 2 3 4\n", ""), "--repair (mesh_repair), --fallback hull|box (mesh_fallback)"),
    "what.part": (TETRAHEDRON, ".obj, .ply, .stl"),
}


def scene_text(lines: str, section: str = "rigid_body") -> str:
    indented = "".join(f"    {line}\n" for line in lines.splitlines())
    return f"{section}:\n  ros__parameters:\n{indented}"


SCENES = {
    "nan_gravity": (scene_text("gravity: [0.0, 0.0, .nan]"), "gravity", "nan", "3 finite numbers"),
    "zero_scale": (scene_text("scale: [1.0, 0.0, 1.0]"), "scale", "0.0", "1e-9 <= |s|"),
    "unknown": (
        scene_text("gravitation: [0.0, 0.0, 1.0]"),
        "gravitation",
        "there is no parameter",
        "did you mean gravity?",
    ),
    "integrator": (scene_text("integrator: rk5"), "integrator", "rk5", "rk4"),
    "text_for_bool": (scene_text("gyroscopic: perhaps"), "gyroscopic", "perhaps", "true or false"),
    "mixed_list": (scene_text("mass: 1.0\ngravity: [0, 0, -9.81]"), "line 4", "[0, 0, -9.81]", "[0.0, 0.0, -9.81]"),
    "no_value": (scene_text("mass:"), "line 3", "mass", "a value"),
    "not_yaml": ("rigid_body: {ros__parameters: ]\n", "line 1", "", "valid YAML"),
    "script": ("- {t: 1.0, force: [0, 0, 1]}\n", "line 1", "a list", "a mapping"),
    "zero_quaternion": (
        scene_text("initial.orientation_xyzw: [0.0, 0.0, 0.0, 0.0]"),
        "initial.orientation",
        "0.0",
        "not all",
    ),
    "contact_word": (scene_text("contacts.world: [0.0, 0.0, 0.0]"), "contacts.world", "world", "none of"),
    "flat_tensor": (
        scene_text('mesh: ""\ninertia_model: explicit\nexplicit_inertia.tensor: [1.0, 0.0, 0.0, 1.0, 0.0, 3.0]'),
        *("", "", ""),
    ),
    "no_mesh": (scene_text('mesh: ""'), "mesh", "explicit"),
}

SCRIPTS = {
    "not_yaml": ("- {t: 1", "line"),
    "mapping": ("script: [{t: 1, force: [0, 0, 1]}]\n", "a list"),
    "repeats of ages": ("[{t: 1, impulse: [1, 0, 0], repeat: 20, every: 1.0e+9}]\n", "entry 1, every"),
    "twice": ("- {t: 1, t: 2, force: [0, 0, 1]}\n", "line 1: got 't twice"),
    "twice_in_json": ('[{"t": 1, "t": 2, "force": [0, 0, 1]}]', "line 1: got 't twice"),
    "text_entry": ("- hello\n", "entry 1"),
    "no_time": ("- {force: [0, 0, 1]}\n", "entry 1, t"),
    "negative_time": ("- {t: -1, force: [0, 0, 1]}\n", "entry 1, t"),
    "nothing": ("- {t: 1, at: com}\n", "entry 1"),
    "unknown_key": ("- {t: 1, farce: [0, 0, 1]}\n", "farce"),
    "unknown_kind": ("- {t: 1, strin: release}\n", "did you mean string?"),
    "short_force": ("- {t: 1, force: [0, 1]}\n", "three numbers"),
    "push_and_axes": ("- {t: 1, push: 1, axes: body}\n", "inward normal"),
    "impulse_and_duration": ("- {t: 1, impulse: [0, 0, 1], duration: 1}\n", "impulses alone"),
    "point": ("- {t: 1, at: {point: [1, 2]}, force: [0, 0, 1]}\n", "point"),
    "vertex": ("- {t: 1, at: {vertex: 123456}, force: [0, 0, 1]}\n", "vertex/0 to vertex/"),
    "contact": ("- {t: 1, at: nose, force: [0, 0, 1]}\n", "tip"),
    "ray": ("- {t: 1, at: {ray: {origin: [0, 0, 0], direction: [0, 0, 0]}}, push: 1}\n", "isn't zero"),
    "push_at_com": ("- {t: 1, at: com, push: 1}\n", "normal"),
    "set_unknown": ("- {t: 1, set: {masse: 5}}\n", "did you mean mass?"),
    "set_value": ("- {t: 1, set: {mass: heavy}}\n", "finite number"),
    "service": ("- {t: 1, service: dance}\n", "clear_wrench"),
    "wrench_impulse": ("- {t: 1, wrench: {impulse: [0, 0, 1]}}\n", "impulse"),
    "huge": ("- {t: 1, force: [0, 0, 1e90]}\n", "at most"),
}


def one_line(capfd, main, arguments) -> str:
    """Run a command's main function, which must refuse its arguments: exit 2 and one line on stderr, which is returned."""
    try:
        status = main(arguments)
    except SystemExit as leaving:
        status = leaving.code
    out, err = capfd.readouterr()
    assert status == 2, (status, out, err)
    assert len(err.splitlines()) == 1 and not out, (out, err)
    return err


@pytest.mark.parametrize("name", MESHES)
def test_a_mesh_that_bounds_no_solid_is_refused(name, tmp_path, capfd):
    text, part = MESHES[name]
    if text is not None:
        (tmp_path / name).write_text(text)
    line = one_line(capfd, rigid_proto, ["simulate", "t_handle", "--set", f"mesh={tmp_path / name}"])
    assert name.split(".")[0] in line and part in line


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        (".", "a folder"),
        ("~nosuchuser/part.obj", "home directory"),
        ("x" * 300 + ".obj", "File name too long"),
        ("package://rigid_proto_ros/" + "x" * 300, "File name too long"),
    ],
)
@pytest.mark.parametrize("command", ["inspect {}", "simulate t_handle --set mesh={}"])
def test_a_mesh_name_that_the_system_itself_refuses_is_refused(command, name, reason, capfd):
    line = one_line(capfd, rigid_proto, command.format(name).split())
    assert name in line and reason in line


def test_a_name_of_bytes_that_are_no_text_is_refused_where_a_library_takes_no_such_name(tmp_path, capfd):
    pytest.importorskip("pyarrow")
    name = str(tmp_path / "caf\udce9.parquet")  # Latin-1
    assert rigid_proto(["simulate", "t_handle", "--duration", "0.1", "--parquet", name]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "caf\\udce9" in line and "accepted: text" in line


@pytest.mark.parametrize("method", ["is_file", "open"])
def test_a_mesh_or_its_folder_that_may_not_be_read_is_refused(method, tmp_path, monkeypatch, capfd):
    def denied(*_):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    (tmp_path / "cow.obj").write_text(TETRAHEDRON)
    monkeypatch.setattr(Path, method, denied)  # root, who may run this, is denied nothing
    line = one_line(capfd, rigid_proto, ["inspect", str(tmp_path / "cow.obj")])
    assert "cow.obj" in line and "Permission denied" in line


def test_a_format_that_needs_a_package_says_so_where_it_is_not_installed(tmp_path, monkeypatch, capfd):
    monkeypatch.setitem(sys.modules, "collada", None)
    (tmp_path / "part.dae").write_bytes(b"<COLLADA/>")
    assert "rigid_proto_ros[meshes]" in one_line(capfd, rigid_proto, ["inspect", str(tmp_path / "part.dae")])


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_that_makes_no_sense_is_refused(name, tmp_path, capfd):
    text, *parts = SCENES[name]
    scene = tmp_path / "scene.yaml"
    scene.write_text(text)
    line = one_line(capfd, rigid_proto, ["simulate", str(scene)])
    assert any(words in line for words in ("accepted: ", "did you mean", "is needed"))
    for part in parts:
        assert part in line


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_with_a_mistake_is_refused(name, tmp_path, capfd):
    text, part = SCRIPTS[name]
    script = tmp_path / "pokes.yaml"
    script.write_text(text)
    assert part in one_line(capfd, rigid_proto, ["simulate", "t_handle", "--script", str(script)])


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["simulate", "nowhere.yaml"], "bundled"),
        (["simulate", "t_handle", "--set", "mass"], "name=value"),
        (["simulate", "t_handle", "--set", "gravty=[0, 0, 1]"], "did you mean gravity?"),
        (["simulate", "t_handle", "--set", "gravity=[0, 0, 1"], "3 finite numbers"),
        (["simulate", "t_handle", "--duration", "-1"], "--duration"),
        (["simulate", "t_handle", "--script", "nowhere.yaml"], "there is no file 'nowhere.yaml'"),
        (
            ["simulate", "t_handle", "--script", "msg_examples/flip_and_pok.yaml"],
            "did you mean msg_examples/flip_and_poke.yaml?",
        ),
        (["simulate"], "SCENE"),
        (["inspct", "book"], "there is no command 'inspct'; one of inspect,"),
        (["inspect", "hamer"], "mesh: there is no file and no bundled mesh 'hamer'; did you mean hammer?"),
        (["simulate", "t_handle", "--set", "inertia_model=boundingbox"], "explicit; did you mean bounding_box?"),
        (["replay", "x.rrd"], "there is no file and no folder 'x.rrd'"),
        (["simulate", "t_handel"], "did you mean t_handle?"),
        (["simulate", "t_handle", "--set", "integrator=RK4"], "did you mean rk4?"),
        (["simulate", "t_handle", "--mesh", "book"], "a parameter is set by --set mesh=VALUE"),
        (["simulate", "t_handle", "--publish-rate", "50"], "a parameter is set by --set publish_rate=VALUE"),
        (["simulate", "t_handle", "--recrod", "x.rrd"], "did you mean --record?"),
        (["simulate", "t_handle", "--bag", "/not/there/x.mcap"], "a folder that exists"),
        (["replay", "x.rrd", "--publish", "state"], "did you mean states?"),
        (["replay", "book.rrd", "hammer.rrd"], "an unexpected argument"),
        (["demo", "--duration", "1"], "--duration"),
        (["sweep", "box_tensor", "-o", "table.csv"], ".parquet"),
    ],
)
def test_a_slip_on_the_command_line_is_refused(arguments, part, capfd):
    assert part in one_line(capfd, rigid_proto, arguments)


@pytest.mark.parametrize("option", ["--record", "--bag", "--set"])
def test_what_is_refused_overwrites_no_recording(option, tmp_path, capfd):
    kept, script = tmp_path / "kept.mcap", tmp_path / "pokes.yaml"
    kept.write_bytes(b"\x89MCAP of an earlier flight")
    script.write_text(SCRIPTS["contact"][0])
    recorded = [option, f"record={kept}" if option == "--set" else str(kept)]
    elsewhere = ["--record", str(script / "x.mcap")] if option == "--bag" else []
    for refused in (["--script", str(script)], elsewhere or ["--set", "mass=-1"], ["--duration", "-1"]):
        one_line(capfd, rigid_proto, ["simulate", "t_handle", *recorded, *refused])
        assert kept.read_bytes() == b"\x89MCAP of an earlier flight"


def test_a_demo_of_an_open_mesh_names_what_helps_and_keeps_the_session_before_it(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    session = Path("out/session.mcap")
    session.parent.mkdir()
    session.write_bytes(b"\x89MCAP of an earlier flight")
    Path("open.obj").write_text(MESHES["open.obj"][0])
    assert "mesh_repair" in one_line(capfd, rigid_proto, ["demo", "--mesh", "open.obj"])
    assert session.read_bytes() == b"\x89MCAP of an earlier flight"


def test_two_recordings_of_one_flight_are_two_files(tmp_path, capfd):
    file = str(tmp_path / "x.mcap")
    for other in (file, str(tmp_path / "y.mcap")):
        assert "one of each" in one_line(capfd, rigid_proto, ["simulate", "t_handle", "--record", file, "--bag", other])
    for wrong in (f"{file},x.bag", "x.txt", f"{file},{file}"):
        assert ".rrd (a view for Rerun)" in one_line(capfd, rigid_proto, ["simulate", "t_handle", "--record", wrong])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("beside", [True, False])
def test_a_view_given_for_a_session_is_answered_with_what_to_give(beside, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    Path("flight.rrd").write_bytes(b"RRF2 as Rerun writes it")
    if beside:
        Path("flight.mcap").touch()
    for words in (
        ["replay", "flight.rrd", "--verify"],
        ["snapshot", "flight.rrd", "--at", "1", "-o", "x.png"],
        ["identify", "flight.rrd"],
        ["replay", "flight.rrd", "--repair", "x.mcap"],
    ):
        told = one_line(capfd, rigid_proto, words)
        assert "flight.rrd is a view for Rerun" in told and "rerun flight.rrd" in told
        assert told.rstrip().endswith("accepted: flight.mcap") if beside else "the .mcap of the same flight" in told


def test_a_scene_records_only_below_the_working_folder_unless_the_command_line_names_the_file(
    tmp_path, monkeypatch, capfd
):
    folder, elsewhere = tmp_path / "here", str(tmp_path / "x.mcap")
    folder.mkdir()
    monkeypatch.chdir(folder)
    scene = folder / "scene.yaml"
    for place in (elsewhere, "../x.mcap", f"out/x.rrd,{elsewhere}"):
        scene.write_text(f"rigid_body: {{ros__parameters: {{mesh: book, record: '{place}'}}}}\n")
        said = one_line(capfd, rigid_proto, ["simulate", str(scene), "--duration", "0.1"])
        assert "x.mcap" in said and "below the working folder" in said
        with pytest.raises(InputError, match="below the working folder"):
            given_arguments(["node", "--ros-args", "--params-file", str(scene)], "rigid_body", print)
    assert [file.name for file in tmp_path.iterdir()] == ["here"]
    for named in (["--record", elsewhere], ["--set", f"record={elsewhere}"]):
        assert rigid_proto(["simulate", str(scene), "--duration", "0.1", *named]) == 0
        Path(elsewhere).unlink()
    named = ["node", "--ros-args", "--params-file", str(scene), "-p", f"record:={elsewhere}"]
    assert given_arguments(named, "rigid_body", print)["record"] == elsewhere
    scene.write_text("rigid_body: {ros__parameters: {mesh: book, record: out/x.mcap}}\n")
    assert rigid_proto(["simulate", str(scene), "--duration", "0.1"]) == 0
    assert (folder / "out" / "x.mcap").exists()


def test_a_binary_file_is_no_scene_script_or_session(tmp_path, capfd):
    binary = tmp_path / "cow.bin"
    binary.write_bytes(bytes(range(256)) * 10)
    for arguments in (["simulate", binary], ["simulate", "t_handle", "--script", binary], ["replay", binary]):
        assert "cow.bin" in one_line(capfd, rigid_proto, [str(a) for a in arguments])


def test_an_unknown_name_under_the_wildcard_is_only_warned_of(tmp_path, capfd):
    scene = tmp_path / "scene.yaml"
    scene.write_text(scene_text("speed_of_light: 3.0", "/**"))
    assert rigid_proto(["simulate", str(scene), "--duration", "0.1"]) == 0
    assert "speed_of_light under /** is not a parameter" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["-p", "gravty:=[0.0, 0.0, 1.0]"], "did you mean gravity?"),
        (["-p", "mass"], "name:=value"),
        (["-p", "gravity:=[0, 0, -9.81]"], "[0.0, 0.0, -9.81]"),
        (["--params-file", "nowhere.yaml"], "nowhere.yaml"),
        (["-p"], "needs a value"),
    ],
)
def test_the_node_refuses_a_slip_before_ros_sees_it(arguments, part, capfd):
    assert part in one_line(capfd, rigid_body_node, ["rigid_body_node", "--ros-args", *arguments])


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--untl", "3"], "did you mean --until?"),
        (["--recrd"], "no option --recrd"),
        (["hammer"], "--ros-args --params-file hammer"),
        (["mesh:=hammer", "--until", "1"], "--ros-args -p mesh:=hammer"),
        (["--until"], "--until"),
        (["--ros-args", "--parms-file", "x.yaml"], "accepted: --params-file FILE"),
        (["--ros-args", "mesh:=book"], "-p NAME:=VALUE"),
        (["--ros-args", "-p", "mass:=1", "--", "--mas"], "no option --mas"),
    ],
)
def test_a_mistyped_option_of_the_node_starts_nothing(arguments, part, capfd):
    assert part in one_line(capfd, rigid_body_node, ["rigid_body_node", *arguments])


def test_help_of_the_node_lists_options_and_parameters_and_starts_nothing(capfd):
    with pytest.raises(SystemExit) as ended:
        rigid_body_node(["rigid_body_node", "--help"])
    assert ended.value.code == 0
    text = capfd.readouterr().out
    assert "--until" in text and all(f"\n  {name}\n" in text for name in PARAMETERS)


def test_what_ros_itself_hands_a_node_is_no_mistake(tmp_path):
    """As `ros2 launch` and `ros2 run` start it, with every kind of ROS argument."""
    scene = tmp_path / "f.yaml"
    scene.write_text(scene_text("mass: 1.0"))
    ros = f"--ros-args -r __node:=a -r __ns:=/b --remap ~/wrench:=/w --params-file {scene} -p mass:=1 --log-level debug"
    ros += " --log-level rigid_body:=info --enable-rosout-logs --disable-stdout-logs -e /enclave"
    assert own_arguments(["node", *ros.split()]).until is None
    assert own_arguments(["node", *ros.split(), "--", "--until", "3"]).until == 3.0
    assert own_arguments(["node", "--until", "3", *ros.split()]).until == 3.0


def test_what_the_system_refuses_a_node_as_it_starts_is_told_in_one_line(monkeypatch, capfd):
    def refused(*_):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), "/nowhere/.cache")

    monkeypatch.setattr(NodeProcess, "_begin", refused)
    assert "/nowhere/.cache" in one_line(capfd, rigid_body_node, ["rigid_body_node"])


@pytest.mark.parametrize("name", ["my part #2.obj", "[v2].obj", 'it\'s: "é" \\1.obj', "- *a.obj", "!x %y.obj"])
def test_a_mesh_of_any_name_reaches_the_node_that_up_starts(name, tmp_path, monkeypatch, capfd):
    started = []
    monkeypatch.setattr("rigid_proto_ros.ros.main.main", lambda argv, as_job: started.append(argv) or 0)
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(TETRAHEDRON)
    assert rigid_proto(["up", "--mesh", name, "--viewer", "none"]) == 0
    (argv,) = started
    assert given_arguments(argv, "rigid_body", pytest.fail)["mesh"] == name


def test_a_density_on_the_nodes_command_line_wins_over_the_scenes_mass(tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text("rigid_body:\n  ros__parameters: {mass: 2.0, density: 1000.0}\n")
    argv = ["--ros-args", "--params-file", str(scene)]
    assert given_arguments(argv, "rigid_body", pytest.fail) == {"mass": 2.0, "density": 1000.0}
    argv += ["-p", "density:=5000.0"]
    assert given_arguments(argv, "rigid_body", pytest.fail) == {"mass": 0.0, "density": 5000.0}
    assert given_arguments([*argv, "-p", "mass:=3.0"], "rigid_body", pytest.fail)["mass"] == 3.0


@pytest.mark.parametrize(
    "arguments", [["nowhere.yaml"], ["poke"], ["poke", "--at", "point/1,2"], ["--lead", "x", "poke"]]
)
def test_the_client_refuses_a_slip(arguments, capfd):
    assert "poke_client" in one_line(capfd, poke_client, arguments)


def test_the_client_without_a_node_says_so(ros_environment, monkeypatch, capfd):
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    line = one_line(capfd, poke_client, ["poke", "--force", "0", "0", "1", "--timeout", "0.1"])
    assert "/rigid_body" in line
