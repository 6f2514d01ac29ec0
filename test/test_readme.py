# SPDX-License-Identifier: MIT
"""The documents keep their word: commands run, links lead somewhere, tables are the code's, examples are accepted."""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from ros_process import RosProcess

import docs_tables
import rigid_proto_ros
from rigid_proto_ros.base.bundled import example_names, example_path
from rigid_proto_ros.cli.main import main as rigid_proto
from rigid_proto_ros.ros import poke_client
from rigid_proto_ros.scene.command_codec import of_message
from rigid_proto_ros.scene.scenario import nanoseconds, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script, read_script

SOURCE = Path(rigid_proto_ros.__file__).resolve().parent.parent
README = SOURCE / "README.md"
REFERENCE = SOURCE / "docs" / "reference.md"
pytestmark = pytest.mark.skipif(not README.is_file(), reason="not run from a source tree")

DOCUMENTS = sorted([*SOURCE.glob("*.md"), *SOURCE.glob("docs/**/*.md")]) if README.is_file() else []
OWN = ("rigid_proto", "poke_client")
# Installs, and what needs ros2cli: looked at by other tests, or by nobody without a ROS installation.
NOT_RUN = {
    "sudo",
    "source",
    "cd",
    "rosdep",
    "colcon",
    "pip",
    "git",
    "ros2",
    "python",
    "rerun",
    "rigid_body_node",
    "eval",
}
SWEEP = "rigid_proto sweep"
STAYS_UP = ("rigid_proto up", "rigid_proto workbench")


def blocks(path: Path, *languages: str) -> list[str]:
    """Fenced blocks of a document in one of the languages, without the indentation of a list."""
    found = re.findall(r"^( *)```(\w+)\n(.*?)^\1```", path.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    return [
        "\n".join(line.removeprefix(indent) for line in text.splitlines())
        for indent, language, text in found
        if language in languages
    ]


def commands() -> Iterator[str]:
    """Every command line in a shell block of the documents, in a row of the README's tables, in the head of a script and, for
    ``ros2``, in a numbered example.
    """
    for path in DOCUMENTS:
        for block in blocks(path, "sh", "bash", "console"):
            for line in block.splitlines():
                if line.strip() and not line.startswith("#"):
                    yield line.strip()
        if path == README:
            yield from re.findall(
                r"^\|.*`((?:rigid_proto|poke_client) [^`]+)` \|$", path.read_text("utf-8"), re.MULTILINE
            )
    for name in example_names():
        for line in example_path(name).read_text("utf-8").splitlines():
            if re.match(r"#   \S", line):
                yield line[1:].strip()
    for path in sorted((SOURCE / "msg_examples").glob("*.sh")):
        yield from re.findall(r"^ros2 .*$", path.read_text("utf-8"), re.MULTILINE)


COMMANDS = sorted(set(commands())) if DOCUMENTS else []


def words(command: str) -> list[str]:
    """A command's words, a comment at its end left out."""
    return shlex.split(command, comments=True)


def of(*programs: str) -> list[str]:
    return [c for c in COMMANDS if words(c)[0].removeprefix(".venv/bin/") in programs]


@pytest.fixture
def in_a_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with the scenes and examples beside it, as commands from the repository's root expect."""
    for name in ("config", "msg_examples"):
        (tmp_path / name).symlink_to(SOURCE / name)
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
    """The reader's parts in millimetres, the file of parts that docs/reference.md shows, and an arm with a tool's link."""
    for name, sides in (("body", (60, 40, 20)), ("cover", (60, 40, 4)), ("grip", (30, 30, 60))):
        trimesh.creation.box(sides).export(folder / f"{name}.stl")
    text = (SOURCE / "docs" / "reference.md").read_text("utf-8")
    (example,) = [block for block in re.findall(r"```yaml\n(.*?)```", text, re.DOTALL) if "\nparts:" in block]
    for name in ("whole", "gripper"):
        (folder / f"{name}.yaml").write_text(example)
    robot = (folder / "robot.urdf").read_text().replace("'arm'", "'tool0'")
    (folder / "arm.urdf").write_text(robot)


def test_every_command_is_of_a_kind_that_some_test_looks_at() -> None:
    assert len(COMMANDS) > 20
    for command in COMMANDS:
        assert words(command)[0].removeprefix(".venv/bin/") in {*OWN, *NOT_RUN, "make"}, command


@pytest.mark.parametrize("command", of("make"))
def test_make_target_exists(command: str) -> None:
    target = next(word for word in words(command)[1:] if "=" not in word)
    makefile = (SOURCE / "Makefile").read_text("utf-8")
    assert re.search(rf"^{re.escape(target)}:", makefile, re.MULTILINE), command


def test_make_help_lists_the_targets_that_people_rely_on() -> None:
    said = subprocess.run(["make", "help"], cwd=SOURCE, capture_output=True, text=True, check=True).stdout
    promised = "setup run up workbench test lint bench stress soak pictures build clean"
    assert set(promised.split()) <= {line.split()[0] for line in said.splitlines()}


@pytest.mark.slow
@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.stress)])
def test_rigid_proto_commands_run(
    in_a_copy: Path,
    ros_environment: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
    whole: bool,
) -> None:
    """Sweeps fly thousands of rows: they are for the long run. A picture and a lesson are made in tests of their own."""
    pytest.importorskip("rerun")
    pytest.importorskip("rclpy")
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    for name in () if whole else ("snapshot", "lesson"):
        monkeypatch.setattr(f"rigid_proto_ros.cli.{name}.run", lambda args: 0)
    # As `make run` leaves one.
    assert rigid_proto(["simulate", "t_handle", "--duration", "1", "--record", "out/session.mcap"]) == 0
    # In the order of the page: a later one uses the recording of an earlier one.
    run = [c for c in commands() if words(c)[0].removeprefix(".venv/bin/") == "rigid_proto"]
    for command in dict.fromkeys(run):
        if command.startswith(STAYS_UP) or " demo" in command or (not whole and command.startswith(SWEEP)):
            continue
        assert rigid_proto(words(command)[1:]) == 0, (command, capsys.readouterr().err)


@pytest.mark.slow
def test_up_gets_ready_and_ends_cleanly(ros_environment: dict[str, str], tmp_path: Path) -> None:
    """As does the workbench, in test_portable.py."""
    pytest.importorskip("rclpy")
    up = RosProcess("rigid_proto", "up", "--viewer", "none", environment=ros_environment, log=tmp_path / "up")
    try:
        up.wait_for("is simulating")
    finally:
        status = up.end()
    assert status == 130


@pytest.mark.parametrize("command", of("poke_client"))
def test_poke_client_command_is_read_and_planned(command: str, in_a_copy: Path, capsys: pytest.CaptureFixture) -> None:
    arguments = words(command)[1:]
    if arguments == ["--help"]:
        return
    assert poke_client.main([*arguments, "--dry-run"] if "--dry-run" not in arguments else arguments) == 0, command
    assert capsys.readouterr().out


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


@pytest.mark.parametrize("command, topic, type, text", published())
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


def things_to_try() -> list[str]:
    """The commands of README's three things to try."""
    section = README.read_text("utf-8").partition("## Three things to try")[2].partition("\n## ")[0]
    return [line.strip() for line in section.splitlines() if line.strip().startswith("poke_client")]


def test_three_things_to_try_do_what_the_readme_says() -> None:
    scripts = [poke_client._script(poke_client._arguments(words(line)[1:])) for line in things_to_try()]
    poked, braked, pulled = map(flown, scripts)
    # Measured 1.298, 4.052 s; |L| 1.2049 and 0.6050 mN m s.
    assert rhythm(flown([])) == pytest.approx(2.7, abs=0.05)
    assert rhythm(poked) == pytest.approx(1.3, abs=0.05)
    assert rhythm(braked) == pytest.approx(4.0, abs=0.1)
    inertia = read_scene("t_handle").setup.body.inertia
    sizes = [1e3 * np.linalg.norm(inertia @ row[10:13]) for row in (braked[0], braked[-1])]
    assert sizes == pytest.approx([1.2, 0.6], abs=0.01)
    assert pulled[RATE, 2] == 0.0 and pulled[2 * RATE, 2] == pytest.approx(0.12, abs=0.005)
    # Let go after 7 s: no force from then on.
    assert np.ptp(pulled[7 * RATE + 1 :, 7:10], axis=0).max() == 0.0


RATE = 25
"""States a second: a flip's time is known to a period, and many of them give their mean far closer."""


def flown(script: list) -> np.ndarray:
    """State rows of a minute of the T-handle."""
    run, rows = OfflineRun(read_scene("t_handle"), script), []
    for k in range(60 * RATE):
        run.advance(nanoseconds(k / RATE))
        rows.append(run.simulation.state.row.copy())
    return np.array(rows)


def rhythm(rows: np.ndarray) -> float:
    """Mean time between flips [s]: the sign of ω along the stem, in body axes."""
    along = np.sign(rows[:, 12])
    flips = (1 + np.flatnonzero(along[1:] != along[:-1])) / RATE
    return float(np.diff(flips[flips > 4.0]).mean())  # what acts, acts before


def test_true_and_box_tensor_part_as_the_readme_says() -> None:
    text = README.read_text("utf-8")
    stated = float(re.search(r"after 1 s their attitudes differ by (\d+)°", text)[1])
    ends = []
    for model in ("solid", "bounding_box"):
        run = OfflineRun(read_scene("true_or_box_tensor", {"inertia_model": model}))
        run.advance(1_000_000_000)
        ends.append(run.simulation.state.row[3:7])
    # Measured 117.3°.
    assert np.degrees(2.0 * np.arccos(abs(ends[0] @ ends[1]))) == pytest.approx(stated, abs=0.5)


def test_readme_is_short_and_its_first_screen_has_the_picture_and_the_two_commands() -> None:
    lines = README.read_text("utf-8").splitlines()
    assert len(lines) <= 160
    text = "\n".join(lines[:20])
    assert text.index("docs/flight.webp") < text.index("make run") < text.index("make test")


@pytest.mark.parametrize("name", example_names())
def test_example_is_a_script_that_is_simulated_unrefused(name: str) -> None:
    text = example_path(name).read_text("utf-8")
    scene = re.search(r"config/(\w+)\.yaml", text)
    run = OfflineRun(read_scene(scene[1] if scene else "t_handle"), read_script(example_path(name)))
    assert run.advance(nanoseconds(25.0))
    assert not run.simulation.refused
    assert not run.simulation._pending


@pytest.mark.parametrize(
    "block", [b for path in DOCUMENTS for b in blocks(path, "yaml") if b.startswith("- {t:")] or [""]
)
def test_script_in_a_document_flies_unrefused(block: str) -> None:
    script = parse_script(block)
    assert len(script) > 10
    run = OfflineRun(read_scene("t_handle"), script)
    assert run.advance(nanoseconds(15.0))
    assert dict(run.simulation.refused).keys() <= {"ray_miss"}  # whether a ray hits is a matter of the attitude then


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    text = path.read_text("utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith(("http://", "https://", "mailto:")):
            continue
        file, _, anchor = target.partition("#")
        place = path if not file else (path.parent / file).resolve()
        assert place.exists(), f"{path.name}: {target}"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", place.read_text("utf-8"), re.MULTILINE)
            anchors = {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}
            assert anchor in anchors, f"{path.name}: {target}"


def test_frames_of_the_reference_are_read() -> None:
    from rigid_proto_ros.motion.frames import parse_frame

    section = REFERENCE.read_text("utf-8").partition("## Frames and units")[2].partition("\n## ")[0]
    rows = [line.split("|")[2] for line in section.splitlines() if line.startswith("| a ")]
    frames = [code for row in rows for code in re.findall(r"`([^`]+)`", row) if code != "force.x"]
    assert len(frames) >= 10
    for frame in frames:
        parse_frame(frame)


def test_tables_are_the_codes(capsys: pytest.CaptureFixture) -> None:
    assert docs_tables.main(["--check"]) == 0, capsys.readouterr().err
    text = REFERENCE.read_text("utf-8")
    for name in ("topics", "services", "parameters", "bodies"):
        assert f"<!-- table: {name} -->" in text


def test_a_table_that_is_behind_is_written_anew() -> None:
    behind = "before\n<!-- table: services -->\n| old |\n<!-- end -->\nafter\n"
    new = docs_tables.filled(behind)
    assert "| old |" not in new and new.startswith("before\n") and new.endswith("after\n")
    assert docs_tables.filled(new) == new


@pytest.mark.parametrize(
    ("name", "head", "largest"), [("flight.png", b"\x89PNG", 300_000), ("flight.webp", b"RIFF", 2_000_000)]
)
def test_pictures_of_the_documents_are_small(name, head, largest) -> None:
    data = (SOURCE / "docs" / name).read_bytes()
    assert data.startswith(head) and 20_000 < len(data) < largest
