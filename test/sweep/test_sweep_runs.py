# SPDX-License-Identifier: MIT
"""A sweep as it is run: whole, stopped, killed and resumed, one row alone, and pictures of the table."""

import json
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from conftest import ENDINGS
from ros_process import command as start_of
from sweep_studies import POKES, PULLED, study

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.sweep.chunk import run_chunk
from rigid_proto_ros.sweep.run import chunk_rows, run_study
from rigid_proto_ros.sweep.table import metadata_of

pq = pytest.importorskip("pyarrow.parquet")


def content(file: Path) -> dict[str, list]:
    """Columns of a table as lists."""
    return pq.read_table(file).to_pydict()


def expected(own) -> dict[str, list]:
    """The same of one call over all rows."""
    columns = run_chunk(own, 0, own.rows).columns
    return {name: [None if value != value else value for value in column.tolist()] for name, column in columns.items()}


@pytest.fixture
def long_run(tmp_path):
    """The command of a run of many small chunks, its files, and the study."""
    spec = {**PULLED, "samples": 320, "duration": 0.3}
    file = tmp_path / "long.yaml"
    file.write_text(yaml.safe_dump(spec, sort_keys=False))
    out = tmp_path / "long.parquet"
    command = start_of("rigid_proto", "sweep", file, "-o", out, "--threads", "1")
    return command, out, study(spec)


def signalled(command: list[str], out: Path, parts: int, number: int) -> tuple[int, str]:
    """Status and errors of a run that was sent a signal once so many parts were there; begun anew if it came too late."""
    folder = out.with_name(out.name + ".parts")
    while True:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while len(list(folder.glob("*.arrow"))) < parts and process.poll() is None:
            time.sleep(0.005)
        process.send_signal(number)
        _, said = process.communicate()
        if not (out.exists() and metadata_of(out)["complete"]):
            return process.returncode, said
        assert process.returncode in (0, -number), said
        out.unlink()


def test_a_killed_run_is_resumed_without_a_row_lost_or_done_twice(long_run) -> None:
    command, out, own = long_run
    signalled(command, out, 2, signal.SIGKILL)
    folder = out.with_name(out.name + ".parts")
    kept = {path.name: path.stat().st_mtime_ns for path in folder.glob("*.arrow")}
    assert kept and not out.exists()
    # Without --resume the finished parts are not thrown away, with another study they are not taken.
    assert main(["sweep", command[5], "-o", str(out)]) == 2
    # The workers of the killed run may still end a chunk, but nobody writes it.
    assert main([*command[4:], "--resume"]) == 0
    assert content(out) == expected(own)
    assert not folder.exists()
    metadata = metadata_of(out)
    assert metadata["complete"] and metadata["rows_by_simulation"] == own.rows
    assert metadata["cpu"] and metadata["numba"] and metadata["seed"] == own.seed
    before = out.stat().st_mtime_ns
    assert main(["sweep", command[5], "-o", str(out), "--resume"]) == 0
    assert out.stat().st_mtime_ns == before


@pytest.mark.stress
def test_ctrl_c_leaves_a_readable_table_and_a_run_to_resume(long_run) -> None:
    command, out, own = long_run
    status, said = signalled(command, out, 1, signal.SIGINT)
    assert status == 130 and "--resume" in said
    done = content(out)["row"]
    assert 0 < len(done) < own.rows and sorted(set(done)) == done
    other = study(PULLED, samples=330, duration=0.3)
    with pytest.raises(Exception, match="rows of another study"):
        run_study(other, out, resume=True, progress=False)
    run_study(own, out, resume=True, progress=False, workers=1)
    assert content(out) == expected(own)


def test_one_core_and_many_write_the_same_table(tmp_path) -> None:
    own = study(POKES)
    assert chunk_rows(own, 1) != chunk_rows(own, 3)
    for workers in (1, 3):
        run_study(own, tmp_path / f"{workers}.parquet", workers=workers, progress=False)
    assert content(tmp_path / "1.parquet") == content(tmp_path / "3.parquet") == expected(own)


@pytest.mark.parametrize("spec", [POKES, PULLED], ids=["pokes", "string"])
def test_a_row_written_as_a_scene_flies_to_the_same_bits(spec, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump(spec, sort_keys=False))
    assert main(["sweep", "s.yaml", "--row", "2", "--as-scene", "row.yaml", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    words = row["fly"].split()
    assert words[:2] == ["rigid_proto", "simulate"]
    assert main([*words[1:], "--json"]) == 0
    flown = json.loads(capsys.readouterr().out)
    assert flown["position"] == [row[f"position.{axis}"] for axis in "xyz"]
    if spec is POKES:
        assert flown["orientation_xyzw"] == [row[f"orientation.{axis}"] for axis in "xyzw"]
        assert flown["linear_velocity"] == [row[f"velocity.{axis}"] for axis in "xyz"]
        assert flown["angular_velocity_body"] == [row[f"spin.{axis}"] for axis in "xyz"]


def test_a_study_that_is_refused_is_one_line_and_exit_2(tmp_path, capsys) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text("scene: t_handle\nduration: 1\nvary: {mass: {uniform: [2, 1]}}\nsamples: 2\n")
    assert main(["sweep", str(file)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "vary.mass.uniform" in said and "a < b" in said
    assert main(["sweep", "flip_map", "--row", "4653"]) == 2
    assert "0 to 4652" in capsys.readouterr().err


NUDGED = {
    "scene": "t_handle",
    "script": [{"t": 0.1, "at": {"vertex": 0}, "impulse": [0.001, 0.0, 0.0]}],
    "duration": 0.2,
    "vary": {"script.1.at.vertex": {"grid": [0, 5, 10, 10**6]}},
    "measure": {"final": ["spin"], "flips": True},
}
"""The last row fails: the body has no such vertex."""


def test_vertices_of_a_grid_are_flown_and_failed_rows_are_counted(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump(NUDGED))
    assert main(["sweep", "s.yaml"]) == 0
    said = capsys.readouterr().out
    assert "4 rows in s.parquet" in said and "1 of them failed" in said
    assert main(["sweep", "s.yaml", "--resume", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows_failed"] == 1
    rows = content(Path("s.parquet"))
    assert [reason is None for reason in rows["failure"]] == [True, True, True, False]
    assert "vertex/0 to vertex/" in rows["failure"][3]
    assert len(set(rows["spin.z"][:3])) == 3
    spaced = study(NUDGED, vary={"script.1.at.vertex": {"grid": {"from": 0, "to": 10, "count": 3}}})
    assert run_chunk(spaced, 0, 3).columns["spin.z"].tolist() == rows["spin.z"][:3]


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_row_that_is_refused_overwrites_nothing(ending, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump(NUDGED))
    kept = Path(f"kept{ending}")
    kept.write_bytes(b"an earlier flight")
    assert main(["sweep", "s.yaml", "--row", "3", "--record", str(kept)]) == 2
    assert "vertex/0 to vertex/" in capsys.readouterr().err
    assert kept.read_bytes() == b"an earlier flight"


def test_pictures_of_a_table_are_the_same_file_again(tmp_path, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    vary = {"mass": {"grid": [0.1, 0.2, 0.3]}, "initial.angular_velocity.z": {"grid": [1.0, 2.0]}}
    spec = {"scene": "t_handle", "duration": 0.1, "vary": vary, "measure": {"max": ["kinetic_energy"]}}
    Path("s.yaml").write_text(yaml.safe_dump(spec, sort_keys=False))
    plot = "x=mass,y=initial.angular_velocity.z,color=max.kinetic_energy"
    for name in ("a.svg", "b.svg"):
        assert main(["sweep", "s.yaml", "-o", "t.parquet", "--resume", "--plot", f"{plot},to={name}"]) == 0
    assert Path("a.svg").read_bytes() == Path("b.svg").read_bytes()
    assert "max.kinetic_energy" in Path("a.svg").read_text() or "<path" in Path("a.svg").read_text()
    assert main(["sweep", "s.yaml", "-o", "t.parquet", "--resume", "--plot", "x=mass,y=nothing"]) == 2


@pytest.mark.parametrize(
    ("plot", "words"),
    [
        ("x=nope,y=spin.z", "x=nope"),
        ("x=row,y=spin.z,color=nope", "color=nope"),
        ("x=failure,y=spin.z,log=x", "failure is text"),
    ],
)
def test_a_picture_that_no_table_can_give_is_refused_before_anything_flies(
    plot, words, tmp_path, monkeypatch, capsys
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump(NUDGED))
    assert main(["sweep", "s.yaml", "--plot", plot]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and words in said
    assert [path.name for path in tmp_path.iterdir()] == ["s.yaml"]


@pytest.mark.parametrize("axis", ["x", "color"])
def test_nothing_above_zero_has_no_logarithmic_axis(axis, tmp_path, monkeypatch, capsys) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump(NUDGED))
    plot = "x=flips,y=spin.z" if axis == "x" else "x=row,y=spin.z,color=flips"
    assert main(["sweep", "s.yaml", "--plot", f"{plot},log={axis}"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"log={axis}" in said and "flips in s.parquet has none" in said
    assert Path("s.parquet").exists() and not Path("s.svg").exists()


def test_one_row_is_recorded_with_all_that_a_flight_shows(tmp_path, capsys) -> None:
    chunk = pytest.importorskip("rerun.chunk")
    file = tmp_path / "row.rrd"
    assert main(["sweep", "box_tensor", "--row", "7", "--record", str(file), "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert row["row"] == 7 and row["failure"] is None and np.isfinite(row["difference.attitude"])
    entities = {str(c.entity_path) for c in chunk.RrdReader(file).stream()}
    assert "/world/body" in entities and any("angular_momentum" in entity for entity in entities)
