# SPDX-License-Identifier: MIT
"""A scene and a poke script for any mesh, sized by its own mass and extent, so that a nut and a ship both show something."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

SPIN = 4.0
"""rad/s about the middle axis: a flip or two in ten seconds for most bodies."""

DRIFT = 0.12
"""Body diagonals a second that the push at the COM gives: it stays in the picture."""


def write_demo(mesh: str, folder: Path) -> tuple[Path, Path]:
    """Write demo_scene.yaml and demo_pokes.yaml into ``folder``; returns both paths.

    The body spins about its middle principal axis, a little off; pokes act at the COM and at the vertex farthest from it.
    Raises InputError for a mesh that can't fly.
    """
    from ..scene.scenario import make_scenario

    scenario = make_scenario({"mesh": str(Path(mesh).resolve()) if Path(mesh).exists() else mesh})
    body, surface = scenario.setup.body, scenario.setup.surface
    points = surface.vertices - body.center_of_mass
    farthest = int(np.argmax((points * points).sum(axis=1)))
    diagonal = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    spin = SPIN * (body.principal_axes[:, 1] + 0.02 * body.principal_axes[:, 0] + 0.02 * body.principal_axes[:, 2])
    push = body.mass * DRIFT * diagonal
    # A torque that would turn the body by its own spin in a second, about its stiffest axis.
    torque = 0.5 * SPIN * float(body.principal_moments[0])
    scene = {
        "rigid_body": {
            "ros__parameters": {
                "mesh": scenario.parameters.mesh,
                "initial": {"angular_velocity": [float(w) for w in spin]},
            }
        }
    }
    script = [
        {"t": 1.0, "at": "com", "impulse": [push, 0.0, 0.0]},
        {"t": 2.5, "at": {"vertex": farthest}, "push": 0.5 * push, "duration": 0.3},
        {"t": 4.0, "wrench": {"torque": [0.0, 0.0, torque], "axes": "body", "duration": 1.0}},
        {"t": 6.5, "at": "com", "impulse": [-push, 0.0, 0.3 * push]},
    ]
    scene_path, script_path = folder / "demo_scene.yaml", folder / "demo_pokes.yaml"
    scene_path.write_text(yaml.safe_dump(scene, sort_keys=False), encoding="utf-8")
    script_path.write_text(yaml.safe_dump(script, sort_keys=False, default_flow_style=None), encoding="utf-8")
    return scene_path, script_path
