# SPDX-License-Identifier: MIT
"""A what-if from any moment: the scene and the pokes written there fly on as the session did."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mcap")

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.rerun_view.session_files import read_runs
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.script import read_script

SECOND = 10**9

SCRIPT = """
- {t: 0.2, wrench: {at: tip, force: [0.0, 0.02, 0.0], torque: [0.0, 1.0e-4, 0.0], axes: body}}
- {t: 0.4, set: {density: 9000.0, gravity: [0.0, 0.0, -0.5]}}
- {t: 0.8, at: tip, push: 0.02, duration: 0.5}
- {t: 0.9, at: left, force: [0.01, 0.0, 0.0], duration: 0.01}
- {t: 1.0, set: {string.attached: true, string.rest_length: 0.2, string.target: [0.0, 0.1, 0.4], string.damping_ratio: 0.0}}
- {t: 3.0, set: {string.attached: false}}
- {t: 3.1, string: {attach: tip, target: [0.0, 0.1, 0.4]}}
"""


@pytest.fixture(scope="module", params=[".mcap", ".rrd"])
def session(request, tmp_path_factory):
    if request.param == ".rrd":
        pytest.importorskip("rerun")
    folder = tmp_path_factory.mktemp("flown")
    (folder / "script.yaml").write_text(SCRIPT)
    path = folder / f"s{request.param}"
    option = "--bag" if request.param == ".mcap" else "--record"
    arguments = ["simulate", "t_handle", "--script", str(folder / "script.yaml"), "--duration", "5"]
    assert main([*arguments, option, str(path)]) == 0
    return path


def fly_on(folder, seconds: float) -> np.ndarray:
    """The end of the branch's own flight."""
    pokes = folder / "x_pokes.yaml"
    run = OfflineRun(read_scene(str(folder / "x.yaml")), read_script(pokes) if pokes.exists() else [])
    assert run.advance(round(seconds * SECOND))
    return run.simulation.state.row


# auto begins its steps anew and errs by accuracy, 1e-9 a second; measured 4e-15 without loads, 5e-10 with them.
@pytest.mark.parametrize("at", [0.0, 0.1, 0.3, 0.45, 0.85, 1.05, 1.75, 2.2])
def test_a_branch_flies_on_as_the_session_did(session, tmp_path, at, capsys):
    until = {0.0: 0.15, 0.1: 0.05, 0.3: 0.08, 0.45: 0.3, 0.85: 0.04, 1.05: 0.5, 1.75: 0.5, 2.2: 0.5}[at]
    assert main(["replay", str(session), "--at", str(at), "--as-scene", str(tmp_path / "x.yaml")]) == 0
    said = capsys.readouterr().out
    (recorded,) = read_runs(session)
    k = recorded.times.tolist().index(round((at + until) * SECOND))
    row = fly_on(tmp_path, until)
    assert np.abs(row - recorded.rows[k]).max() < 2e-9
    acting = 0.2 < at < 1.7
    assert (tmp_path / "x_pokes.yaml").exists() == acting
    assert ("--script" in said) == acting


def test_a_branch_has_the_parameters_in_force(session, tmp_path):
    for at, density in ((0.1, 7850.0), (0.5, 9000.0)):
        assert main(["replay", str(session), "--at", str(at), "--as-scene", str(tmp_path / "x.yaml")]) == 0
        values = read_scene(str(tmp_path / "x.yaml")).parameters.named()
        assert values["density"] == density
        assert values["record"] == ""


def test_a_string_held_by_hand_is_tied_again_as_it_was_and_let_go_in_time(session, tmp_path):
    assert main(["replay", str(session), "--at", "3.5", "--as-scene", str(tmp_path / "x.yaml")]) == 0
    values = read_scene(str(tmp_path / "x.yaml")).parameters.named()
    assert values["string.attached"] and values["initial.string_mass"] > 0.0
    (let_go,) = read_script(tmp_path / "x_pokes.yaml")
    # Tied at 3.1 s, string.timeout 1 s.
    assert (let_go.kind, let_go.t_ns, let_go.changes) == ("set", round(0.6 * SECOND), {"string.attached": False})


def test_a_branch_from_recorded_states_alone_needs_a_scene(session, tmp_path, capsys):
    scene = str(tmp_path / "x.yaml")
    assert main(["replay", str(session), "--at", "1", "--as-scene", scene, "--scene", "t_handle"]) == 0
    assert "isn't recorded" in capsys.readouterr().out
    (recorded,) = read_runs(session)
    start = read_scene(scene).setup.initial
    assert np.abs(start - recorded.rows[recorded.times.tolist().index(SECOND)]).max() < 1e-12


@pytest.mark.parametrize(
    "arguments",
    [["--at", "9"], ["--at", "-1"], ["--at", "nan"], ["--at", "1"], ["--as-scene", "x.yaml"]],
)
def test_a_time_that_is_none_is_refused(session, tmp_path, arguments, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if "--at" in arguments and arguments[1] != "1":
        arguments = [*arguments, "--as-scene", "x.yaml"]
    assert main(["replay", str(session), *arguments]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "x.yaml").exists()
