# SPDX-License-Identifier: MIT
"""The documents keep their word: links lead somewhere, tables are the code's, examples are accepted; their commands have
test_shown_commands.py.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from test_shown_commands import DOCUMENTS, blocks, words

import docs_tables
import rigid_proto_ros
from rigid_proto_ros.base.bundled import example_names, example_path
from rigid_proto_ros.ros import poke_client
from rigid_proto_ros.scene.scenario import nanoseconds, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script, read_script

SOURCE = Path(rigid_proto_ros.__file__).resolve().parent.parent
README = SOURCE / "README.md"
REFERENCE = SOURCE / "docs" / "reference.md"
pytestmark = pytest.mark.skipif(not README.is_file(), reason="not run from a source tree")


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
