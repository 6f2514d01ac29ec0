# SPDX-License-Identifier: MIT
"""Every command that a document shows is run by a test, or stands below with the reason why not.

Commands are lines of shell blocks, code in a sentence that begins with a program, rows of tables, the heads of scenes and scripts,
and what action and pre-commit hook start. The numbered examples are run by test_msg_examples.py, and what ``--help`` shows is
parsed by base/test_command_line.py.
"""

from __future__ import annotations

import glob
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from ros_process import RosProcess

import rigid_proto_ros
from rigid_proto_ros.base.bundled import example_names, example_path, scene_path
from rigid_proto_ros.cli.main import COMMANDS as SUBCOMMANDS
from rigid_proto_ros.cli.main import main as rigid_proto
from rigid_proto_ros.ros import poke_client
from rigid_proto_ros.scene.command_codec import of_message
from rigid_proto_ros.scene.scenario import nanoseconds, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun

SOURCE = Path(rigid_proto_ros.__file__).resolve().parent.parent
README = SOURCE / "README.md"
pytestmark = pytest.mark.skipif(not README.is_file(), reason="not run from a source tree")

DOCUMENTS = [
    path
    for pattern in ("*.md", "docs/**/*.md", "page/*.md", "tools/*.md", "benchmarks/*.md", ".github/**/*.md")
    for path in sorted(SOURCE.glob(pattern))
]
PROGRAMS = (
    "cd colcon eval git make npm pip poke_client python rerun rigid_body_node rigid_proto ros2 rosdep source sudo uvx"
)
_IN_HEAD = re.compile(r'(rigid_(?:proto|body_node) (?:"[^"]*"|[^",\n])*?)(?:,|  +|\n|$)')
_CALL = re.compile(rf"(\.venv/bin/|[A-Z]+=\S+ )?({PROGRAMS.replace(' ', '|')}) \S")

INSTALLS = "installs into the machine or from a registry"
ROS2 = "ros2cli comes with ROS alone, which isn't here"
LONG = "takes minutes to hours; developers run it"
VIEWER = "opens the viewer's window, or waits for one"
NOT_RUN = {
    **dict.fromkeys(
        (
            "sudo apt install ros-jazzy-ros-base python3-colcon-common-extensions python3-rosdep python3-venv",
            "rosdep install --from-paths src --ignore-src -y",
            "rosdep install",
            'pip install ".[all]"',
            "pip install 'rigid_proto_ros[dask]'",
            "pip install 'rigid_proto_ros[export]'",
            "pip install 'rigid_proto_ros[identify]'",
            "pip install 'rigid_proto_ros[meshes]'",
            'pip install "rigid_proto_ros[robots]"',
            "pip install 'rigid_proto_ros[sweep]'",
            'python -m pip install --quiet "$GITHUB_ACTION_PATH[meshes]"',
        ),
        INSTALLS,
    ),
    **dict.fromkeys(
        (
            "source /opt/ros/jazzy/setup.bash",
            "cd ~/ws",
            "cd ~/ws/src/rigid_proto_ros",
            "source install/setup.bash",
            *(
                "ros2 bag convert",
                "ros2 bag play",
                "ros2 bag record",
                "ros2 launch",
                "ros2 run",
                "ros2 param",
                "ros2 service",
            ),
            *("ros2 topic", "ros2 param dump", "ros2 param load", "ros2 param set"),
        ),
        ROS2,
    ),
    **dict.fromkeys(
        (
            *(
                "make bench",
                "make soak",
                "make stress",
                "make pictures",
                "make lint test stress bench",
                "make lint test",
            ),
            'make test ARGS="--cov=rigid_proto_ros"',
            "python benchmarks/page_beside_node.py",
            "python benchmarks/heyoka_ratios.py",
        ),
        LONG,
    ),
    **dict.fromkeys(("rerun --connect ADDRESS", "rerun FILE"), VIEWER),
    "source .venv/bin/activate": "changes the reader's shell",
}
"""By exact text, without comments."""

RUN_ELSEWHERE = {
    "make run": (".ci/run", "make run"),
    "make test": (".ci/run", "make test"),
    "make lint": (".ci/run", "make lint"),
    "make release": (".github/workflows/release.yml", "make release"),
    "make setup": ("Makefile", "lint: setup"),
    "make wheel": ("test/test_packaging.py", '"pip", "wheel"'),
    "make site": ("test/page/test_site.py", "static_site"),
    "make build": ("test/test_packaging.py", "colcon"),
    "make kernels": ("test/kernels/test_building.py", "rigid_proto_ros.kernels"),
    "make up": ("test/test_shown_commands.py", '"up"'),
    "make workbench": ("test/test_portable.py", "workbench hammer --no-browser"),
    "colcon build": ("test/test_packaging.py", "colcon"),
    "colcon build --packages-select rigid_proto_ros": ("test/test_packaging.py", "colcon"),
    "uvx --from WHEEL rigid_proto inspect part.stl": ("test/test_packaging.py", "inspect"),
    "uvx --from WHEEL rigid_proto workbench": ("test/test_packaging.py", "workbench"),
    "npm run types": ("test/page/test_motion.py", "tsc"),
    "npm ci && npm run types": ("test/page/test_motion.py", "tsc"),
    "python -m rigid_proto_ros.kernels": ("test/kernels/test_building.py", "rigid_proto_ros.kernels"),
    "python -m rigid_proto_ros.kernels wasm --typescript page/src/kernels.ts": (
        "test/kernels/test_same_bits_in_wasm.py",
        '"wasm", "--typescript"',
    ),
    "python -m rigid_proto_ros.page": ("Makefile", "rigid_proto_ros.page"),
    "python tools/docs_tables.py": ("test/test_readme.py", "docs_tables.main"),
    "python tools/interface_list.py > test/interface.txt": ("test/test_interface_list.py", "interface_list()"),
    "python tools/bits_elsewhere.py": ("Makefile", "tools/bits_elsewhere.py"),
    "PYTHONPATH=test python test/simulation/test_golden_hashes.py --write": (
        "test/simulation/test_golden_hashes.py",
        "--write",
    ),
    'rigid_proto inspect $ARGUMENTS --compare "${files[@]}"': ("test/cli/test_doors.py", "action.yml"),
    "rigid_proto inspect --compare": ("test/cli/test_doors.py", ".pre-commit-hooks.yaml"),
}
"""By exact text, the file that runs it, or what it starts, and words of that file."""

PLACES = {
    "...": "t_handle",
    "MESH": "hammer",
    "NAME": "t_handle",
    "ROBOT": "robot.urdf",
    "SCENE": "t_handle",
    "SCRIPT": "msg_examples/flip_and_poke.yaml",
    "SESSION": "out/session.mcap",
    "T": "0.5",
    "out/NAME.mcap": "out/session.mcap",
    "out/NAME.rrd": "out/session.rrd",
}
"""What a reader puts in the place of a word."""


def blocks(path: Path, *languages: str) -> list[str]:
    """Fenced blocks of a document in one of the languages, without the indentation of a list."""
    found = re.findall(r"^( *)```(\w*)\n(.*?)^\1```", path.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    return [
        "\n".join(line.removeprefix(indent) for line in text.splitlines())
        for indent, language, text in found
        if language in languages
    ]


def shown() -> Iterator[str]:
    """Every command, in the order of the documents, without a comment at its end."""
    for path in DOCUMENTS:
        if path.name == "CHANGELOG.md":  # what was, and may be no more
            continue
        for block in blocks(path, "sh", "bash", "console", ""):
            yield from (line for line in block.splitlines() if line.strip() and not line.startswith("#"))
        prose = re.sub(r"^( *)```.*?^\1```", "", path.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
        yield from (code for code in re.findall(r"`([^`]+)`", re.sub(r"\s*\n\s*", " ", prose)) if _CALL.match(code))
    for name in example_names():
        yield from re.findall(r"^#   (\S.*)$", example_path(name).read_text("utf-8"), re.MULTILINE)
    for path in sorted((SOURCE / "config").glob("**/*.yaml")):
        head = re.sub(r"\n# ?", " ", path.read_text("utf-8"))
        yield from _IN_HEAD.findall(head.partition("/**:")[0])
    for path in sorted((SOURCE / "msg_examples").glob("*.sh")):
        yield from re.findall(r"^ros2 .*$", path.read_text("utf-8"), re.MULTILINE)
    (hook,) = yaml.safe_load((SOURCE / ".pre-commit-hooks.yaml").read_text("utf-8"))
    yield " ".join([hook["entry"], *hook["args"]])
    for step in yaml.safe_load((SOURCE / "action.yml").read_text("utf-8"))["runs"]["steps"]:
        yield from (line.strip() for line in step.get("run", "").splitlines() if _CALL.match(line.strip()))


def without_comment(command: str) -> str:
    return re.sub(r"\s+#.*", "", command.strip())


COMMANDS = list(dict.fromkeys(map(without_comment, shown()))) if README.is_file() else []


def words(command: str) -> list[str]:
    """A command's words as its reader types them, patterns of file names still to be matched."""
    split = shlex.split(command)
    split[0] = split[0].removeprefix(".venv/bin/")
    for k, word in enumerate(split):
        if word == "FILE":
            split[k] = {"--html": "out/place.html", "--as-scene": "out/place.yaml"}.get(split[k - 1], word)
    return [PLACES.get(word, word) for word in split]


def of(program: str) -> list[str]:
    """The commands of a program that are run here."""
    own = [c for c in COMMANDS if c not in NOT_RUN and c not in RUN_ELSEWHERE and not is_a_name(c)]
    return [command for command in own if words(command)[0] == program]


def is_a_name(command: str) -> bool:
    """Whether it only names a command, or one of its options."""
    split = words(command)
    return split[0] == "rigid_proto" and (
        (len(split) == 2 and split[1] in SUBCOMMANDS) or command == "rigid_proto simulate --script"
    )


def stays_up(split: list[str]) -> bool:
    return split[1] in ("up", "workbench") and "--html" not in split


def test_every_shown_command_is_run_or_stands_here_with_the_reason() -> None:
    assert len(COMMANDS) > 200
    runners = ("rigid_proto", "poke_client", "rigid_body_node", "rerun", "ros2")
    here = {command for program in runners for command in of(program)}
    rest = [c for c in COMMANDS if c not in here and c not in NOT_RUN and c not in RUN_ELSEWHERE and not is_a_name(c)]
    assert rest == ["python benchmarks/work_precision.py --help"]
    assert NOT_RUN.keys() | RUN_ELSEWHERE.keys() <= set(COMMANDS), "shown no more"
    assert not NOT_RUN.keys() & RUN_ELSEWHERE.keys()
    for command, (file, holds) in RUN_ELSEWHERE.items():
        assert holds in (SOURCE / file).read_text("utf-8"), (command, file)
    examples = (SOURCE / "test" / "test_msg_examples.py").read_text("utf-8")
    for path in (SOURCE / "msg_examples").glob("[0-9]*"):
        assert f"run({int(path.name[:2])}" in examples, path.name


def test_a_command_that_nothing_runs_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "new.md").write_text(
        "First `pip install it`, then\n\n```sh\ngit status  # clean\n```\n\nand a `word`.\n"
    )
    monkeypatch.setitem(globals(), "DOCUMENTS", [tmp_path / "new.md"])
    new = [without_comment(command) for command in shown()]
    assert new[:2] == ["git status", "pip install it"] and not {*new[:2]} & {*COMMANDS, *NOT_RUN, *RUN_ELSEWHERE}


@pytest.fixture
def in_a_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with the scenes and examples beside it, as commands from the repository's root expect, and what a reader
    has of their own.
    """
    for name in ("config", "msg_examples"):
        (tmp_path / name).symlink_to(SOURCE / name)
    (tmp_path / "poke.yaml").symlink_to(example_path("flip_and_poke"))
    write_robot(tmp_path)
    write_parts(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_robot(folder: Path) -> None:
    """The reader's robot.urdf, and urdf/robot.urdf: two boxes of 2700 kg/m³ with the inertials of their shapes."""
    shapes = {"arm": "<box size='0.3 0.2 0.1'/>", "upper_arm": "<mesh filename='upper_arm.stl'/>"}
    inertia = "<inertia ixx='{:.17g}' ixy='0' ixz='0' iyy='{:.17g}' iyz='0' izz='{:.17g}'/>".format(
        *(np.array([0.2**2 + 0.1**2, 0.3**2 + 0.1**2, 0.3**2 + 0.2**2]) * (16.2 / 12.0))
    )
    inertial = f"<inertial><mass value='16.2'/>{inertia}</inertial>"
    links = "".join(
        f"<link name='{name}'>{inertial}<visual><geometry>{shape}</geometry></visual></link>"
        for name, shape in shapes.items()
    )
    joint = "<joint name='shoulder' type='fixed'><parent link='arm'/><child link='upper_arm'/></joint>"
    for place in (folder, folder / "urdf"):
        place.mkdir(exist_ok=True)
        trimesh.creation.box((0.3, 0.2, 0.1)).export(place / "upper_arm.stl")
        (place / "robot.urdf").write_text(f"<robot name='r'>{links}{joint}</robot>")


def write_parts(folder: Path) -> None:
    """The reader's parts in millimetres, files of parts as docs/reference.md shows one, and an arm with a tool's link."""
    for name, sides in (("body", (60, 40, 20)), ("cover", (60, 40, 4)), ("grip", (30, 30, 60))):
        trimesh.creation.box(sides).export(folder / f"{name}.stl")
    for example in [block for block in blocks(SOURCE / "docs" / "reference.md", "yaml") if "\nparts:" in block]:
        for name in ("whole", "gripper"):
            (folder / f"{name}.yaml").write_text(example)
    (folder / "arm.urdf").write_text((folder / "robot.urdf").read_text().replace("'arm'", "'tool0'"))


@pytest.mark.slow
@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.stress)])
def test_rigid_proto_and_rerun_commands_run(
    in_a_copy: Path,
    ros_environment: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
    whole: bool,
) -> None:
    """In the order of the documents: a later one uses the recording of an earlier one. Sweeps fly thousands of rows: they are for
    the long run. Pictures and files of the page are made in tests of their own, and what stays up has the next test.
    """
    pytest.importorskip("rerun")
    pytest.importorskip("rclpy")
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    for name in ("up",) if whole else ("up", "snapshot", "lesson", "workbench"):
        monkeypatch.setattr(f"rigid_proto_ros.cli.{name}.run", lambda args: 0)
    # As `make run` leaves one, and docs/python.md writes one.
    for file in ("out/session.mcap,out/session.rrd", "flight.mcap"):
        assert rigid_proto(["simulate", "t_handle", "--duration", "1", "--record", file]) == 0
    own, failed = {*of("rigid_proto"), *of("rerun")}, []
    for command in [c for c in COMMANDS if c in own]:
        program, *rest = [name for word in words(command) for name in sorted(glob.glob(word)) or [word]]
        try:
            status = (rerun(rest, whole) if program == "rerun" else run(rest, whole)) or 0
        except SystemExit as end:  # --version
            status = end.code or 0
        if status != 0:
            failed.append((command, capsys.readouterr().err.strip()))
    assert not failed


def run(arguments: list[str], whole: bool) -> int:
    if arguments[0] == "sweep" and not whole or whole and stays_up(["", *arguments]):
        return 0
    return rigid_proto(arguments)


def rerun(arguments: list[str], whole: bool) -> int:
    """Its viewer is for who sits there: the file has to be."""
    if arguments[0] not in ("rrd", "mcap"):
        return int(not Path(arguments[0]).is_file())
    if not whole or len(arguments) < 3:
        return 0
    return subprocess.run([str(Path(sys.executable).parent / "rerun"), *arguments], check=False).returncode


@pytest.mark.slow
@pytest.mark.parametrize("name", [c for c in COMMANDS if is_a_name(c)])
def test_a_command_that_is_named_exists(name: str, capsys: pytest.CaptureFixture) -> None:
    _, command, *options = name.split()
    with pytest.raises(SystemExit) as end:
        rigid_proto([command, "--help"])
    assert end.value.code == 0
    assert all(option in capsys.readouterr().out for option in options)


STAY_UP = [["rigid_proto", "up", "--viewer", "none"]]
if COMMANDS:
    STAY_UP += [pytest.param(words(c), marks=pytest.mark.stress) for c in of("rigid_proto") if stays_up(words(c))]
    STAY_UP += [pytest.param(words(c), marks=pytest.mark.stress) for c in of("rigid_body_node")]


@pytest.mark.slow
@pytest.mark.parametrize("command", STAY_UP, ids=" ".join)
def test_what_stays_up_gets_ready_and_ends_cleanly(
    command: list[str], in_a_copy: Path, ros_environment: dict[str, str]
) -> None:
    """As does ``workbench`` in test_portable.py."""
    pytest.importorskip("rclpy")
    program, *rest = command
    page = rest[0] == "workbench"
    rest += ["--no-browser"] if page else []
    up = RosProcess(program, *rest, environment={**ros_environment, "BROWSER": "true"}, log=in_a_copy / "up")
    try:
        up.wait_for("The workbench is at" if page else "is simulating")
    finally:
        status = up.end()
    assert status in ((0, 130) if program == "rigid_body_node" else (130,))


@pytest.mark.parametrize("command", [c for c in COMMANDS if c.startswith("make ")])
def test_make_target_exists(command: str) -> None:
    makefile = (SOURCE / "Makefile").read_text("utf-8")
    for target in words(command)[1:]:
        assert "=" in target or re.search(rf"^{re.escape(target)}:", makefile, re.MULTILINE), command


def test_make_help_lists_the_targets_that_people_rely_on() -> None:
    said = subprocess.run(["make", "help"], cwd=SOURCE, capture_output=True, text=True, check=True).stdout
    promised = "setup run up workbench test lint bench stress soak pictures build clean"
    assert set(promised.split()) <= {line.split()[0] for line in said.splitlines()}


@pytest.mark.stress
def test_a_benchmark_says_what_it_takes() -> None:
    command = next(c for c in COMMANDS if c.startswith("python benchmarks/") and c.endswith("--help"))
    done = subprocess.run(
        [sys.executable, *words(command)[1:]], cwd=SOURCE, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and "usage:" in done.stdout, done.stderr


@pytest.mark.parametrize("command", of("poke_client") if COMMANDS else [])
def test_poke_client_command_is_read_and_planned(command: str, in_a_copy: Path, capsys: pytest.CaptureFixture) -> None:
    arguments = words(command)[1:]
    if arguments == ["--help"]:
        return
    assert poke_client.main([*arguments, "--dry-run"] if "--dry-run" not in arguments else arguments) == 0, command
    assert capsys.readouterr().out


def test_calls_of_services_and_parameters_are_those_of_the_examples_and_a_launch_has_known_arguments() -> None:
    """test_msg_examples.py makes the same calls of a node; the launch file itself has test/ros/test_launch.py."""
    examples = "\n".join(path.read_text("utf-8") for path in (SOURCE / "msg_examples").glob("*.sh"))
    launch = (SOURCE / "launch" / "rigid_body.launch.py").read_text("utf-8")
    for command in of("ros2"):
        match words(command)[1:]:
            case ["topic", "pub", *_]:
                continue
            case ["service" | "param", *_]:
                assert command in examples.splitlines(), command
            case ["launch", "rigid_proto_ros", "rigid_body.launch.py", *given]:
                for name, value in (one.split(":=") for one in given):
                    assert f'("{name}", ' in launch or f'"{name}",\n' in launch, command
                    if name == "scene":
                        assert scene_path(value).is_file()
            case _:
                raise AssertionError(command)


def published() -> list[tuple[str, str, str, str]]:
    """(command, topic, type, message text) of each ``ros2 topic pub``."""
    found = []
    for command in of("ros2"):
        parts = shlex.split(command)
        if parts[1:3] != ["topic", "pub"] or "string/attach" in command:  # which moves nothing by itself
            continue
        arguments = parts[3:]
        while arguments[0].startswith("--"):
            arguments = arguments[1:] if arguments[0] == "--once" else arguments[2:]
        found.append((command, *arguments[:3]))
    return found


@pytest.mark.parametrize("command, topic, type, text", published() if COMMANDS else [])
def test_message_to_publish_is_accepted_and_moves_the_t_handle(command: str, topic: str, type: str, text: str) -> None:
    pytest.importorskip("rclpy")
    from rclpy.serialization import serialize_message
    from ros_client import COMMANDS, filled

    topic = topic.removeprefix("/rigid_body/")
    message = filled(COMMANDS[topic](), yaml.safe_load(text))
    assert type == f"geometry_msgs/msg/{COMMANDS[topic].__name__}"
    run = OfflineRun(read_scene("t_handle", {"initial.angular_velocity": [0.0, 0.0, 0.0]}))
    run.simulation.submit(of_message(topic, serialize_message(message)))
    run.advance(nanoseconds(0.5))
    assert not run.simulation.refused, command
    state = run.simulation.state
    size = max(abs(state.linear_velocity).max(), abs(state.angular_velocity).max())
    # To be seen, and not to be thrown out of sight.
    assert 0.01 < size < 10.0, command
