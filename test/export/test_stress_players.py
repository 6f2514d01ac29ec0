# SPDX-License-Identifier: MIT
"""Exported files in other people's hands: Khronos' validator, and three.js in Chromium.

Both come from the npm registry into a folder of pytest's cache when this first runs; without npm, node, the registry or
Chromium these tests skip and say so.
"""

from __future__ import annotations

import functools
import http.server
import json
import shutil
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from test_gltf import CHANGES, THROWN, angles_between

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.export.flight_record import FlightRecord, frames, source_of_session
from rigid_proto_ros.rerun_view.session_files import read_runs
from rigid_proto_ros.session.replay import play

pytestmark = [pytest.mark.stress]

PACKAGES = ("gltf-validator@2.0.0-dev.3.10", "three@0.187.0")

VALIDATE = """
const validator = require('gltf-validator'), fs = require('fs');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(r => console.log(JSON.stringify(r.issues)));
"""

PAGE = """<!doctype html><script type="importmap">
{"imports": {"three": "/node_modules/three/build/three.module.js"}}</script><script type="module">
import * as THREE from 'three';
import {GLTFLoader} from '/node_modules/three/examples/jsm/loaders/GLTFLoader.js';
window.play = async (url, names, times) => {
  const gltf = await new GLTFLoader().loadAsync(url), mixer = new THREE.AnimationMixer(gltf.scene), poses = {};
  for (const clip of gltf.animations) { const a = mixer.clipAction(clip); a.setLoop(THREE.LoopOnce); a.clampWhenFinished = true; a.play(); }
  for (const name of names) poses[name] = [];
  const p = new THREE.Vector3(), q = new THREE.Quaternion(), s = new THREE.Vector3();
  for (const t of times) {
    mixer.setTime(t); gltf.scene.updateMatrixWorld(true);
    for (const name of names) { gltf.scene.getObjectByName(name).matrixWorld.decompose(p, q, s); poses[name].push([...p, ...q]); }
  }
  return poses;
};
window.ready = true;
</script>"""


@pytest.fixture(scope="module")
def modules(request) -> Path:
    if not shutil.which("npm") or not shutil.which("node"):
        pytest.skip("node and npm are not installed")
    folder = Path(request.config.cache.mkdir("exports_npm"))
    if not (folder / "node_modules" / "three").is_dir():
        done = subprocess.run(
            ["npm", "install", "--prefix", folder, "--no-audit", "--no-fund", *PACKAGES],
            capture_output=True,
            timeout=300,
        )
        if done.returncode:
            pytest.skip(f"npm reached no registry: {done.stderr.decode()[-200:]}")
    return folder


@pytest.fixture(scope="module")
def session(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("flight")
    script = folder / "changes.yaml"
    script.write_text(CHANGES)
    settings = [f"--set={name}={value}" for name, value in THROWN.items()]
    options = ["--script", str(script), "--duration", "1", "--bag", str(folder / "flight.mcap")]
    assert main(["simulate", "hammer", *settings, *options]) == 0
    return folder / "flight.mcap"


SCENES = ("t_handle", "book", "hammer", "teapot", "true_or_box_tensor", "top_on_string", "hollow_box", "plumb_line")


@pytest.mark.parametrize("flight", [["replay", ""], *(["simulate", scene, "--duration", "2"] for scene in SCENES)])
def test_khronos_validator_finds_no_error_and_no_warning(modules, session, flight, tmp_path):
    file = tmp_path / "flight.glb"
    command, what, *options = flight
    assert main([command, what or str(session), "--gltf", str(file), *options]) == 0
    found = json.loads(
        subprocess.run(
            ["node", "-e", VALIDATE, file], cwd=modules, capture_output=True, check=True, timeout=120, text=True
        ).stdout
    )
    assert (found["numErrors"], found["numWarnings"]) == (0, 0), found


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def page(modules):
    sync_api = pytest.importorskip("playwright.sync_api")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("there is no browser to drive: sudo apt install chromium")
    (modules / "index.html").write_text(PAGE)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(modules)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with sync_api.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page()
        page.goto(f"http://127.0.0.1:{server.server_address[1]}/index.html")
        page.wait_for_function("window.ready === true", timeout=60_000)
        yield page
        browser.close()
    server.shutdown()


def test_three_js_shows_the_body_where_the_session_has_it_at_every_frame(modules, session, page):
    file = modules / "played.glb"
    assert main(["replay", str(session), "--gltf", str(file), "--fps", "240"]) == 0
    (run,) = read_runs(session)
    record = FlightRecord()
    play(run, record)
    made, _ = frames(record, source_of_session(run), 240.0)
    # At a change one instant has two states, and a player shows the later one.
    apart = np.diff(made.times_ns, append=2 * 10**9) > 1000
    times, rows = made.times_ns[apart] * 1e-9, made.rows[apart]
    played = page.evaluate("([u, n, t]) => window.play(u, n, t)", ["/played.glb", ["body"], times.tolist()])["body"]
    played = np.array(played)
    # y up: (x, y, z) is shown at (x, z, −y), turned by the same quarter turn.
    places = rows[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    assert np.linalg.norm(played[:, :3] - places, axis=1).max() < 1e-6
    half = np.sqrt(0.5)
    x, y, z, w = rows[:, 3:7].T
    turned = half * np.column_stack([x - w, y + z, z - y, w + x])
    assert angles_between(played[:, 3:], turned).max() < 1e-5
