# SPDX-License-Identifier: MIT
"""Readouts of a published state are the simulation's own numbers; lessons have what a page needs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hand_session import random_hand_session

from rigid_proto_ros.base.bundled import example_names, scene_names
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.messages.session_messages import PROJECTIONS
from rigid_proto_ros.scene.lessons import lesson, lessons, read_lesson
from rigid_proto_ros.workbench.readouts import angle_between, gravity_energy, readout


def test_readouts_of_a_published_state_are_the_simulations_numbers() -> None:
    simulation = random_hand_session(0, 2.0).simulation
    body, state = simulation.setup.body, simulation.state
    values = state.row.tolist()
    row = np.array([*PROJECTIONS["pose"](values), *PROJECTIONS["twist"](values)])
    shown = readout(row, body.mass, body.inertia, np.array([0.0, 0.0, 1.0]))
    assert shown.kinetic_energy == pytest.approx(simulation.kinetic_energy, rel=1e-13)
    assert np.allclose(shown.momentum, simulation.angular_momentum, rtol=1e-12, atol=1e-18)
    assert np.allclose(shown.angular_velocity_body, state.angular_velocity_body, rtol=1e-13)
    assert shown.momentum_angle == pytest.approx(math.acos(shown.momentum[2] / shown.momentum_norm), abs=1e-7)
    assert gravity_energy(row, 2.0, np.array([0.0, 0.0, -9.81])) == pytest.approx(2.0 * 9.81 * row[2])


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.5, 3.0, math.pi - 1e-6, math.pi])
def test_angles_are_accurate_at_both_ends(angle: float) -> None:
    other = np.array([math.cos(angle), math.sin(angle), 0.0])
    assert angle_between(np.array([2.0, 0.0, 0.0]), 5.0 * other) == pytest.approx(angle, rel=1e-9, abs=1e-16)
    assert angle_between(np.zeros(3), other) == 0.0


def test_every_bundled_scene_is_a_lesson_with_a_title_three_sentences_and_a_reason() -> None:
    found = {one.name: one for one in lessons()}
    assert sorted(found) == scene_names()
    assert len({one.title for one in found.values()}) == len(found)
    for name, one in found.items():
        assert 8 < len(one.title) < 60, name
        assert not one.title.endswith("."), name
        assert all(20 < len(sentence) < 200 for sentence in one.sentences), name
        assert one.sentences[-1].endswith("."), name
        assert len(one.reason) > 60, name
        assert not one.script or one.script in example_names(), name


def test_a_scene_without_a_lessons_head_is_told_what_is_missing(tmp_path) -> None:
    with pytest.raises(InputError, match="scene"):
        lesson("no_such")
    path = tmp_path / "x.yaml"
    path.write_text("# SPDX\n#\n# Title\n#\n# One. Two.\n#\n# Why.\n#\n# Fly it.\nrigid_body: {}\n")
    with pytest.raises(InputError, match="2 sentences"):
        read_lesson(path)
    path.write_text("# Title\nrigid_body: {}\n")
    with pytest.raises(InputError, match="paragraphs"):
        read_lesson(path)
