# SPDX-License-Identifier: MIT
"""A sweep on a cluster: complete and the same when a worker dies in the middle of it."""

import os
import signal
import threading
import time

import pytest
from sweep_studies import PULLED, study
from test_sweep_runs import content, expected

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.sweep.run import run_study

distributed = pytest.importorskip("distributed")


@pytest.mark.stress
def test_a_worker_killed_in_mid_run_costs_no_row(tmp_path) -> None:
    own = study(PULLED, samples=320, duration=0.3)
    file = tmp_path / "t.parquet"
    folder = tmp_path / "t.parquet.parts"
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True) as cluster:
        killed = []

        def kill_one() -> None:
            while len(list(folder.glob("*.arrow"))) < 1:
                time.sleep(0.005)
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

        killer = threading.Thread(target=kill_one, daemon=True)
        killer.start()
        metadata = run_study(own, file, dask=cluster.scheduler_address, progress=False)
        killer.join(timeout=180)
    assert killed and metadata["complete"]
    assert content(file) == expected(own)


def test_a_scheduler_that_isnt_there_is_refused(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("rigid_proto_ros.sweep.run.CONNECT_S", 0.3)
    out = str(tmp_path / "t.parquet")
    assert main(["sweep", "box_tensor", "-o", out, "--dask", "tcp://127.0.0.1:9"]) == 2
    assert "--dask" in capsys.readouterr().err
