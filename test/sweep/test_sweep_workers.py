# SPDX-License-Identifier: MIT
"""A sweep that was stopped and goes on, and one that a Dask cluster simulates: the same table, to the bit."""

from __future__ import annotations

import os
import pickle
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from sweep_studies import POKES, study

from rigid_proto_ros.base.errors import CommandRefused, InputError
from rigid_proto_ros.base.interrupts import with_this_package
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mesh.locate import resolve_mesh
from rigid_proto_ros.sweep import table, workers
from rigid_proto_ros.sweep.study import Study, read_study
from rigid_proto_ros.sweep.table import SweepInterrupted, metadata_of, run_study

pq = pytest.importorskip("pyarrow.parquet")

MISSING = {"scene": "hammer", "duration": 0.1, "vary": {"mesh": {"grid": ["hammer", "no_such_file.obj"]}}}


def stopped_at(monkeypatch: pytest.MonkeyPatch, own: Study, file: Path, row: int, **options: Any) -> None:
    """Run a study until Ctrl-C comes at this row."""
    write = table.as_arrow

    def interrupted(chunk):
        if len(chunk) and chunk.columns["row"][0] >= row:
            raise KeyboardInterrupt
        return write(chunk)

    with monkeypatch.context() as patched:
        patched.setattr(table, "as_arrow", interrupted)
        patched.setattr(table, "CHUNK_ROWS", 4)
        with pytest.raises(SweepInterrupted):
            run_study(own, file, progress=False, **options)


def test_a_table_that_was_stopped_twice_goes_on_to_the_whole_one(tmp_path, monkeypatch) -> None:
    own, whole, file = study(POKES), tmp_path / "whole.parquet", tmp_path / "stopped.parquet"
    expected = run_study(own, whole, progress=False)
    stopped_at(monkeypatch, own, file, 8)
    assert (metadata_of(file)["rows_done"], metadata_of(file)["complete"]) == (8, False)
    stopped_at(monkeypatch, own, file, 16, resume=True)
    assert metadata_of(file)["rows_done"] == 16

    flown, fly = [], workers.run_chunk
    monkeypatch.setattr(workers, "run_chunk", lambda *args: flown.append(args[1:]) or fly(*args))
    metadata = run_study(own, file, progress=False, resume=True)
    assert min(first for first, _ in flown) == 16
    assert pq.read_table(file).equals(pq.read_table(whole))
    assert {**metadata, "date": ""} == {**expected, "date": ""}

    flown.clear()
    assert run_study(own, file, progress=False, resume=True) == metadata
    assert not flown


def test_a_table_of_another_study_and_no_table_are_not_resumed(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump(POKES, sort_keys=False))
    Path("no.parquet").write_text("no table")
    stopped_at(monkeypatch, read_study("s.yaml"), Path("s.parquet"), 8)
    before = Path("s.parquet").read_bytes()
    assert main(["sweep", "s.yaml", "-o", "no.parquet", "--resume"]) == 2
    assert "--resume: got 'no.parquet'; accepted: the table of a sweep" in capsys.readouterr().err
    for change in ({"seed": 4}, {"duration": 2.5}, {"set": {"gravity": [0, 0, -1.0]}}, {"watch": 11}):
        Path("other.yaml").write_text(yaml.safe_dump({**POKES, **change}, sort_keys=False))
        assert main(["sweep", "other.yaml", "-o", "s.parquet", "--resume"]) == 2
        assert "a table of the same study" in capsys.readouterr().err
    assert Path("s.parquet").read_bytes() == before
    assert main(["sweep", "s.yaml", "--resume"]) == 0
    assert metadata_of(Path("s.parquet"))["complete"]
    assert main(["sweep", "s.yaml", "--resume", "--row", "1"]) == 2
    assert "--resume" in capsys.readouterr().err


def test_a_file_with_another_mesh_is_another_study(tmp_path) -> None:
    part, spec = tmp_path / "part.obj", {**POKES, "set": {"mesh": str(tmp_path / "part.obj")}}
    part.write_bytes(resolve_mesh("book").read_bytes())
    first = study(spec).fingerprint
    assert study(spec).fingerprint == first
    part.write_bytes(resolve_mesh("hammer").read_bytes())
    assert study(spec).fingerprint != first


def test_a_mesh_that_cannot_be_read_fails_its_rows_and_no_others(tmp_path) -> None:
    own = study(MISSING)
    metadata = run_study(own, tmp_path / "t.parquet", progress=False)
    assert (metadata["rows_done"], metadata["rows_failed"]) == (2, 1)
    failures = pq.read_table(tmp_path / "t.parquet")["failure"].to_pylist()
    assert failures[0] is None and "no_such_file.obj" in failures[1]


@pytest.mark.parametrize("error", [InputError("mass", -1, "more"), CommandRefused("stamp", "t", 1, "less")])
def test_a_refusal_comes_whole_from_another_process(error: InputError) -> None:
    found = pickle.loads(pickle.dumps(error))
    assert (type(found), vars(found), str(found)) == (type(error), vars(error), str(error))


# A cluster of processes of this machine


@pytest.fixture(scope="module")
def cluster(tmp_path_factory) -> Iterator[Any]:
    distributed = pytest.importorskip("distributed", reason="distributed is not installed: no cluster")
    environment = {name: os.environ.get(name) for name in with_this_package()}
    os.environ.update(with_this_package())
    try:
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=tmp_path_factory.mktemp("dask")
        ) as own:
            yield own
    finally:
        for name, value in environment.items():
            if value is None:
                del os.environ[name]


def test_a_cluster_that_loses_a_worker_gives_the_same_table(cluster, tmp_path, monkeypatch) -> None:
    # A file that the workers don't find: they began in another folder.
    monkeypatch.chdir(tmp_path)
    Path("part.obj").write_bytes(resolve_mesh("hammer").read_bytes())
    spec = {**POKES, "set": {"mesh": "part.obj", "contacts.tip": [0, 0, 0], "contacts.left": [0, 0, 0]}, "samples": 400}
    own = study(spec)
    here = run_study(own, Path("here.parquet"), progress=False)
    monkeypatch.setattr(table, "CHUNK_ROWS", 10)
    lost, write = [], table.as_arrow

    def one_lost(chunk):
        if len(chunk) and not lost:
            lost.append(next(iter(cluster.workers.values())).pid)
            os.kill(lost[0], signal.SIGKILL)
        return write(chunk)

    monkeypatch.setattr(table, "as_arrow", one_lost)
    there = run_study(own, Path("there.parquet"), dask=cluster.scheduler_address, progress=False)
    assert lost
    assert pq.read_table("there.parquet").equals(pq.read_table("here.parquet"))
    assert {**there, "date": ""} == {**here, "date": ""}


def test_a_mesh_that_cannot_be_read_here_fails_its_rows_there_too(cluster, tmp_path) -> None:
    run_study(study(MISSING), tmp_path / "here.parquet", progress=False)
    run_study(study(MISSING), tmp_path / "there.parquet", dask=cluster.scheduler_address, progress=False)
    assert pq.read_table(tmp_path / "there.parquet").equals(pq.read_table(tmp_path / "here.parquet"))


def test_ctrl_c_leaves_a_table_of_the_cluster_to_go_on_from(cluster, tmp_path, monkeypatch) -> None:
    own, file = study(POKES), tmp_path / "stopped.parquet"
    stopped_at(monkeypatch, own, file, 8, dask=cluster.scheduler_address)
    run_study(own, file, resume=True, dask=cluster.scheduler_address, progress=False)
    run_study(own, tmp_path / "whole.parquet", progress=False)
    assert pq.read_table(file).equals(pq.read_table(tmp_path / "whole.parquet"))


def test_workers_with_other_kernels_are_refused(cluster, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(workers, "stamp", lambda: "of another version")
    with pytest.raises(InputError, match="--dask: got 'a worker with kernels .*'; accepted: .* of another version"):
        run_study(study(POKES), tmp_path / "t.parquet", dask=cluster.scheduler_address, progress=False)
    assert not list(tmp_path.iterdir())


def test_a_script_that_reads_a_mesh_on_the_way_stays_here(cluster, tmp_path) -> None:
    part = tmp_path / "part.obj"
    part.write_bytes(resolve_mesh("hammer").read_bytes())
    own = study({**POKES, "script": [{"t": 0.5, "set": {"mesh": str(part)}}], "vary": {"mass": {"uniform": [1, 2]}}})
    with pytest.raises(InputError, match="--dask: got .*part.obj.*bundled bodies"):
        run_study(own, tmp_path / "t.parquet", dask=cluster.scheduler_address, progress=False)


def test_where_no_scheduler_answers_one_line_says_so(tmp_path, monkeypatch, capsys) -> None:
    pytest.importorskip("distributed", reason="distributed is not installed: no cluster")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(workers, "CONNECT_S", 0.5)
    for address in ("tcp://127.0.0.1:9", "no address:x"):
        began = time.monotonic()
        assert main(["sweep", "flip_map", "--dask", address, "-o", "t.parquet"]) == 2
        assert time.monotonic() - began < 20.0
        captured = capsys.readouterr().err
        assert f"--dask: got {address!r}" in captured and captured.count("\n") == 1
    assert not list(tmp_path.iterdir())
