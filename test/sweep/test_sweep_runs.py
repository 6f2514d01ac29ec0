# SPDX-License-Identifier: MIT
"""A sweep as it is run: whole, stopped, and one row alone."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from sweep_studies import POKES, PULLED, study

from rigid_proto_ros.base.interrupts import with_this_package
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.sweep.rows import run_chunk
from rigid_proto_ros.sweep.study import read_study
from rigid_proto_ros.sweep.table import KEY, run_study

pq = pytest.importorskip("pyarrow.parquet")


def content(file: Path) -> dict[str, list]:
    """Columns of a table as lists."""
    return pq.read_table(file).to_pydict()


def expected(own) -> dict[str, list]:
    """The same of one call over all rows."""
    columns = run_chunk(own, 0, own.rows).columns
    return {name: [None if value != value else value for value in column.tolist()] for name, column in columns.items()}


def test_a_table_holds_every_row_in_order_and_what_it_was_made_with(tmp_path) -> None:
    own, file = study(POKES), tmp_path / "new folder" / "table.parquet"
    metadata = run_study(own, file, progress=False)
    assert content(file) == expected(own)
    kept = json.loads(pq.read_metadata(file).metadata[KEY])
    assert kept == metadata and kept["complete"] and kept["rows_by_compiled_batch"] == own.rows
    assert kept["cpu"] and kept["kernels"] and kept["seed"] == own.seed
    assert [path.name for path in file.parent.iterdir()] == ["table.parquet"]


INTERRUPTED = """
import os, signal, sys, time
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.sweep import table, workers
fly, write = workers.run_chunk, table.as_arrow
def slow(*arguments):
    time.sleep(1.2)
    return fly(*arguments)
def interrupted(chunk):
    if len(chunk) and chunk.columns["row"][0] >= row:
        os.kill(os.getpid(), signal.SIGINT)
    return write(chunk)
workers.run_chunk, table.as_arrow, table.CHUNK_ROWS = slow, interrupted, 4
row = int(sys.argv.pop())
sys.exit(main())
"""
"""A sweep by chunks of four rows that gets Ctrl-C when it comes to a row. What is under way then ends after longer than
an interrupt that nobody handles takes to be raised anew."""


@pytest.mark.parametrize("row", [0, 8])
def test_ctrl_c_leaves_a_readable_table_of_the_rows_before(row: int, tmp_path) -> None:
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(POKES, sort_keys=False))
    command = [sys.executable, "-c", INTERRUPTED, "sweep", "s.yaml", str(row)]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, env=with_this_package())
    assert ran.returncode == 130
    if row == 0:
        assert [path.name for path in tmp_path.iterdir()] == ["s.yaml"]
        return
    assert f"{row} of 24 rows are in s.parquet" in ran.stderr
    assert content(tmp_path / "s.parquet")["row"] == list(range(row))


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


def test_a_row_doesnt_take_the_place_of_its_study(tmp_path, capsys) -> None:
    study = tmp_path / "s.yaml"
    study.write_text(yaml.safe_dump(POKES, sort_keys=False))
    before = study.read_bytes()
    assert main(["sweep", str(study), "--row", "2", "--as-scene", str(study)]) == 2
    assert "--as-scene" in capsys.readouterr().err and study.read_bytes() == before


def test_a_study_that_is_refused_is_one_line_and_exit_2(tmp_path, capsys) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text("scene: t_handle\nduration: 1\nvary: {mass: {uniform: [2, 1]}}\nsamples: 2\n")
    assert main(["sweep", str(file)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "vary.mass.uniform" in said and "a < b" in said
    assert main(["sweep", "flip_map", "--row", "4653"]) == 2
    assert "0 to 4652" in capsys.readouterr().err


@pytest.mark.parametrize("name, begin, end", [("flip_map", 705, 799), ("box_tensor", 740, 760)])
def test_each_measure_of_a_bundled_study_depends_on_its_row(name: str, begin: int, end: int) -> None:
    columns = run_chunk(read_study(name), begin, end).columns
    measured = [
        column for column in columns if column.split(".")[0] in ("flips", "first", "max", "difference", "turned")
    ]
    assert measured
    assert all(len(set(columns[column].tolist())) > 1 for column in measured)


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
    rows = content(Path("s.parquet"))
    assert [reason is None for reason in rows["failure"]] == [True, True, True, False]
    assert "vertex/0 to vertex/" in rows["failure"][3]
    assert len(set(rows["spin.z"][:3])) == 3
    spaced = study(NUDGED, vary={"script.1.at.vertex": {"grid": {"from": 0, "to": 10, "count": 3}}})
    assert run_chunk(spaced, 0, 3).columns["spin.z"].tolist() == rows["spin.z"][:3]
    drawn = run_chunk(study(NUDGED, vary={"script.1.at": "random_vertex"}, samples=5), 0, 5)
    assert drawn.simulated == 5 and len(set(drawn.columns["script.1.at.vertex"])) > 1


def test_a_sweep_without_pyarrow_says_so_before_the_study_is_read(monkeypatch, capsys) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["sweep", "no_study"]) == 2
    assert "pyarrow is missing: pip install 'rigid_proto_ros[sweep]'" in capsys.readouterr().err
