# SPDX-License-Identifier: MIT
"""States as tables: what is read back is what was simulated, to the last bit."""

from __future__ import annotations

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.export.flight_record import FlightRecord
from rigid_proto_ros.export.table import STATE_COLUMNS, UNITS, state_columns, write_csv
from rigid_proto_ros.session.bag import read_runs

ENDING = ["--duration", "0.5", "--set", "gravity=[0, 0, -9.81]"]


def read_csv(path) -> tuple[list[str], np.ndarray]:
    head, *lines = path.read_text("utf-8").splitlines()
    return head.split(","), np.array([[float(x) for x in line.split(",")] for line in lines])


@pytest.fixture
def session(tmp_path):
    pytest.importorskip("mcap")
    path = tmp_path / "flight.mcap"
    assert main(["simulate", "t_handle", *ENDING, "--bag", str(path)]) == 0
    return path


def test_a_csv_of_a_session_holds_every_state_to_the_bit_and_simulate_writes_the_same(session, tmp_path):
    replayed, csv, parquet = (tmp_path / name for name in ("new folder/states.csv", "a.csv", "a.parquet"))
    assert main(["replay", str(session), "--csv", str(replayed)]) == 0
    names, table = read_csv(replayed)
    assert names == ["time", *STATE_COLUMNS]
    (run,) = read_runs(session)
    assert np.array_equal(table[:, 0], run.times / 1e9)
    assert np.array_equal(table[:, 1:11], run.rows[:, :10])
    # A bag holds the twist in world axes; the table has the spin in body axes that it was made of.
    assert np.abs(table[:, 11:] - run.rows[:, 10:]).max() < 1e-14 * np.abs(run.rows[:, 10:]).max()
    assert [path.name for path in replayed.parent.iterdir()] == ["states.csv"]
    pq = pytest.importorskip("pyarrow.parquet")
    assert main(["simulate", "t_handle", *ENDING, "--csv", str(csv), "--parquet", str(parquet)]) == 0
    assert csv.read_bytes() == replayed.read_bytes()
    assert np.array_equal(np.column_stack([pq.read_table(parquet)[name].to_numpy() for name in names]), table)


def test_a_parquet_says_its_units(tmp_path):
    pq = pytest.importorskip("pyarrow.parquet")
    out = tmp_path / "a.parquet"
    assert main(["simulate", "book", "--duration", "0", "--parquet", str(out)]) == 0
    metadata = json.loads(pq.read_metadata(out).metadata[b"rigid_proto_ros"])
    assert metadata["units"] == UNITS and metadata["numpy"]


def test_one_json_object_is_all_that_json_prints_beside_an_export(tmp_path, capsys):
    assert main(["simulate", "book", "--duration", "0.1", "--json", "--csv", str(tmp_path / "a.csv")]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["time_ns"] == 100_000_000 and "11 states" in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--csv", "a.txt"], ("--csv", "a.txt", ".csv")),
        (["--parquet", "a.csv"], ("--parquet", ".parquet")),
        (["--csv", "{tmp}/file/a.csv"], ("--csv", "folder that can be made")),
        (["--csv", "{tmp}/folder.csv"], ("--csv", "this is a folder")),
        (["--csv", "/proc/a.csv"], ("--csv", "/proc/a.csv", "a file that can be written")),
        (["--csv", f"{{tmp}}/{'x' * 250}.csv"], ("--csv", "File name too long")),
        (["--parquet", "/proc/a.parquet"], ("--parquet", "/proc/a.parquet", "a file that can be written")),
        (["--gltf", "/proc/a.glb"], ("--gltf", "/proc/a.glb", "a file that can be written")),
        (["--usd", "/proc/a.usda"], ("--usd", "/proc/a.usda", "a file that can be written")),
        (["--gltf", "a.gltf"], ("--gltf", ".glb")),
        (["--gltf", "{tmp}/a.glb", "--fps", "-1"], ("--fps", "-1")),
        (["--gltf", "{tmp}/a.glb", "--fps", "nan"], ("--fps", "nan")),
        (["--fps", "10"], ("--fps", "needs --gltf")),
        (["--usd", "a.usdz"], ("--usd", ".usda or .usdc")),
    ],
)
def test_what_cannot_be_written_is_refused_in_one_line_before_the_flight(arguments, words, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.csv").mkdir()
    arguments = [word.replace("{tmp}", str(tmp_path)) for word in arguments]
    with pytest.raises(SystemExit) as end:  # as argparse ends what it refuses itself
        sys.exit(main(["simulate", "book", "--duration", "0.1", *arguments]))
    assert end.value.code == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and all(word in err for word in words)
    assert {path.name for path in tmp_path.iterdir()} == {"file", "folder.csv"}


def test_an_interrupted_write_leaves_the_old_file_and_no_half(tmp_path):
    def values():
        yield 0.0
        raise KeyboardInterrupt

    out = tmp_path / "a.csv"
    out.write_text("before")
    with pytest.raises(KeyboardInterrupt):
        write_csv(str(out), {"time": SimpleNamespace(tolist=values)})
    assert out.read_text() == "before" and list(tmp_path.iterdir()) == [out]


def test_a_flight_without_a_state_is_refused():
    with pytest.raises(InputError, match="no states to export"):
        state_columns(FlightRecord())


@pytest.mark.parametrize(("module", "file"), [("pxr", "a.usda"), ("pyarrow.parquet", "a.parquet")])
def test_a_library_that_is_missing_is_named_with_the_extra_that_brings_it(module, file, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, module, None)
    option = {"usda": "--usd", "parquet": "--parquet"}[file.partition(".")[2]]
    assert main(["simulate", "book", option, str(tmp_path / file)]) == 2
    assert "pip install 'rigid_proto_ros[export]'" in capsys.readouterr().err
