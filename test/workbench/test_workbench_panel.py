# SPDX-License-Identifier: MIT
"""Inputs show what is in force and say why they do nothing; what is saved holds all its meshes."""

from __future__ import annotations

import asyncio
import json
import math
import shutil
import threading
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: no interactive page")

from flown_page import FlownPage, flies_again
from mesh_files import Gltf

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.mesh.locate import resolve_mesh
from rigid_proto_ros.picture import style
from rigid_proto_ros.workbench import controls
from rigid_proto_ros.workbench.controls import NEW_WEIGHT
from rigid_proto_ros.workbench.panel import SPEEDS
from rigid_proto_ros.workbench.readouts import GHOST_ANGLE


def every_option_is_there_once(flown: FlownPage) -> None:
    """A page with two equal options in one list stays blank."""
    lists = [widget.options for widget in flown._widgets() if hasattr(widget, "options")]
    assert len(lists) > 5
    for options in lists:
        assert len(set(options)) == len(options), options


def test_a_weight_that_is_added_is_an_option_once_as_is_one_of_the_scene(flown: FlownPage) -> None:
    every_option_is_there_once(flown)
    flown.set("Parameter", NEW_WEIGHT)
    flown.set("Value", "0.05 0 0 0.05")
    assert flown.scenario.parameters.ballast == {"weight": (0.05, 0.0, 0.0, 0.05)}
    flown.set("Parameter", "mass")
    every_option_is_there_once(flown)
    flown.begin({"mesh": "hammer", NEW_WEIGHT: [0.1, 0.0, 0.0, 0.0]})
    every_option_is_there_once(flown)


def test_any_speed_that_is_in_force_is_shown_and_another_can_be_chosen(flown: FlownPage) -> None:
    speed = flown.widget("Speed")
    for factor, shown in ((100.0, "100"), (0.3, "0.3"), (1.0 + 1e-9, "1.000000001"), (0.25, "1/4"), (0.0, "0")):
        flown.set("Parameter", "real_time_factor")
        flown.set("Value", repr(factor))
        assert (speed.value, flown.scenario.parameters.real_time_factor) == (shown, factor)
        assert tuple(speed.options) == tuple(dict.fromkeys((*SPEEDS, shown)))
        every_option_is_there_once(flown)
    flown.set("Speed", "1")
    assert flown.scenario.parameters.real_time_factor == 1.0
    assert (speed.value, tuple(speed.options)) == ("1", tuple(SPEEDS))


def test_the_gravity_in_force_is_shown_by_its_name_or_its_numbers(flown: FlownPage) -> None:
    gravity = flown.widget("Gravity")
    for numbers, shown in (("0 0 -9.81", "Earth's, 9.81 m/s²"), ("0 0 -3.7", "0 0 -3.7"), ("0 0 0", "none")):
        flown.set("Parameter", "gravity")
        flown.set("Value", numbers)
        assert gravity.value == shown
        every_option_is_there_once(flown)
    flown.set("Gravity", "Moon's, 1.62 m/s²")
    assert flown.scenario.setup.gravity.tolist() == [0.0, 0.0, -1.62]


def test_size_and_mass_in_force_are_said_with_their_units(flown: FlownPage) -> None:
    flown.begin({"mesh": "hollow_box", "mass": 2.0})
    flown.set("Size ×", (math.log10(2.0),))
    sides = " × ".join(f"{side:.3g}" for side in 2.0 * flown.scenario.setup.surface.extent)
    assert f">{sides} m, 2 kg<" in flown.page.body_tab._size_and_mass.content


def test_a_ghost_with_another_tensor_is_chosen_beside_the_model_and_is_there_from_the_reset_on(
    flown: FlownPage,
) -> None:
    assert flown.widget("Ghost").value == "none"
    flown.set("Ghost", "bounding_box")
    flown.reset()
    flown.fly(1.0)
    assert flown.node(style.GHOST_MESH).visible
    assert GHOST_ANGLE in flown.page.readings.values


@pytest.fixture
def slowly_typed(monkeypatch: pytest.MonkeyPatch):
    """A page that waits for a minute after the last key."""
    monkeypatch.setattr(controls, "TYPING_S", 60.0)
    page = FlownPage()
    yield page
    page.end()


def test_what_was_just_typed_is_taken_before_another_parameter_is_chosen_or_time_begins_anew(slowly_typed) -> None:
    flown = slowly_typed
    flown.set("Parameter", "mass")
    flown.set("Value", "0.25")
    flown.set("Parameter", "density")
    assert flown.scenario.parameters.mass == 0.25 and flown.widget("Value").value == "7850"
    flown.set("Initial spin [rad/s]", "0 0 5")
    flown.press("Reset", of="Simulation")
    assert list(flown.scenario.parameters.initial.angular_velocity) == [0.0, 0.0, 5.0]
    assert flown.live.state.time_ns == 0 and np.linalg.norm(flown.live.state.angular_velocity) == pytest.approx(5.0)
    # What is typed for one scene is nothing to the next.
    flown.set("Density [kg/m³]", "3")
    flown.begin({"mesh": "hammer", "density": 2000.0})
    assert flown.scenario.parameters.density == 2000.0 and flown.widget("Density [kg/m³]").value == "2000"
    flown.press("Reset", of="Simulation")
    assert flown.scenario.parameters.density == 2000.0 and not flown.said


def test_a_file_that_is_uploaded_while_another_is_prepared_can_be_simulated(flown: FlownPage) -> None:
    folder, page = flown.page.body_tab.upload, flown.page
    text = b"# z up\n" + resolve_mesh("hammer").read_bytes()
    flown.do(lambda: folder.take("first.obj", text))

    held = threading.Event()

    async def uploads_meanwhile() -> None:
        page.flight.ask(lambda: held.wait(60.0))
        flying = asyncio.ensure_future(folder._fly({}))
        await asyncio.sleep(0.0)
        await folder.take("second.obj", text)
        await flying

    threading.Timer(0.5, held.set).start()
    flown.do(uploads_meanwhile)
    flown.fly(0.0)
    assert flown.scenario.parameters.mesh.endswith("first.obj")
    assert folder.present.name == "second.obj"
    flown.press("Simulate it")
    flown.fly(0.0)
    assert flown.scenario.parameters.mesh.endswith("second.obj")


def test_an_input_that_was_in_use_shows_later_what_somebody_else_has_set_meanwhile(
    flown: FlownPage, monkeypatch
) -> None:
    switch = flown.widget("Gyroscopic term ω × Iω")
    monkeypatch.setattr(controls, "TOUCHED_S", 3600.0)
    flown.set("Gyroscopic term ω × Iω", False)
    flown.live.set_parameters({"gyroscopic": True})
    flown.fly(0.1)
    assert switch.value is False
    monkeypatch.undo()
    flown.until(lambda: switch.value is True, "what is in force")


def test_an_input_that_is_refused_before_the_page_was_told_anything_shows_what_is_in_force(flown: FlownPage) -> None:
    fresh = controls.Controls(flown.server.gui, flown.page.flight)
    density = fresh.numbers("density", "ρ")
    flown.set("ρ", "none")
    assert density.value == f"{flown.scenario.parameters.density:g}" and flown.said.pop().startswith("ρ: got 'none'")
    density.remove()


def test_a_fault_of_the_program_is_said(flown: FlownPage, monkeypatch, caplog) -> None:
    monkeypatch.setattr(flown.live, "reset", lambda: 1 / 0)
    flown.press("Reset", of="Simulation")
    flown.until(lambda: flown.said == ["Failed: ZeroDivisionError: division by zero"], "fault")
    assert "in <lambda>" in caplog.text


def test_a_density_is_refused_while_a_tensor_is_in_force(flown: FlownPage) -> None:
    flown.set("Tensor", "1e-3 0 0 2e-3 0 2.5e-3")
    flown.until(lambda: flown.scenario.parameters.inertia_model == "explicit", "tensor")
    flown.wait_until_still()
    before = flown.scenario
    flown.set("Density [kg/m³]", "1000")
    assert flown.scenario is before and flown.widget("Density [kg/m³]").value == f"{before.parameters.density:g}"
    (said,) = flown.said
    assert said.startswith("Density: ") and "explicit" in said and "Mass ×" in said and "Model" in said
    flown.set("Model", "solid")
    flown.set("Density [kg/m³]", "1000")
    assert flown.scenario.parameters.density == 1000.0 and len(flown.said) == 1


# What is saved


@pytest.mark.parametrize("name", ["part.obj", "größe.obj", 'a "b".obj', "~x.obj"])
def test_a_mesh_of_any_path_is_saved_with_its_run(
    flown: FlownPage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    here = tmp_path / "here"
    here.mkdir()
    shutil.copy(resolve_mesh("hammer"), here / name)
    monkeypatch.chdir(here)
    mesh = name if name == "part.obj" else str(here / name)
    flown.begin({"mesh": mesh, "initial.angular_velocity": [1.0, 2.0, 3.0]})
    flown.fly(0.3)
    values, _, files = flies_again(flown, tmp_path / "elsewhere")
    assert [values["mesh"]] == files


def test_the_mesh_of_the_start_and_those_of_later_changes_are_saved(flown: FlownPage, tmp_path: Path) -> None:
    folder = flown.page.body_tab.upload
    flown.upload("x.obj", "hammer")
    flown.press("Simulate it")
    flown.fly(0.2)
    flown.set("Body", "book")
    flown.fly(0.2)
    # Another file of the same name, given in flight.
    flown.upload("x.obj", "tennis_racket")
    second = folder.present.path
    flown.change({"mesh": second})
    flown.fly(0.2)
    values, script, files = flies_again(flown, tmp_path)
    assert values["mesh"] == "x.obj" and files == ["x.obj", "x_2.obj"]
    assert [command.content["mesh"] for command in script] == ["book", "x_2.obj"]


def test_nothing_is_saved_without_a_mesh_that_is_gone_or_that_reads_other_files(
    flown: FlownPage, tmp_path: Path
) -> None:
    gone = tmp_path / "gone.obj"
    shutil.copy(resolve_mesh("hammer"), gone)
    flown.begin({"mesh": str(gone)})
    flown.set("Body", "book")
    flown.fly(0.1)
    gone.unlink()
    with pytest.raises(InputError, match=r"gone\.obj"):
        flown.page.session_tab._take()
    cube = Gltf()
    (tmp_path / "two.bin").write_bytes(cube.bytes)
    document = {**cube.json, "buffers": [{"uri": "two.bin", "byteLength": len(cube.bytes)}]}
    (tmp_path / "two.gltf").write_text(json.dumps(document))
    flown.begin({"mesh": str(tmp_path / "two.gltf")})
    flown.fly(0.1)
    with pytest.raises(InputError, match=r"two\.gltf.*\.glb"):
        flown.page.session_tab._take()


def test_one_can_go_on_from_the_past_of_an_upload_when_another_file_was_uploaded(flown: FlownPage) -> None:
    folder = flown.page.body_tab.upload
    flown.upload("first.obj", "hammer")
    first = folder.present.path
    flown.press("Simulate it")
    flown.fly(1.0)
    flown.set("Body", "hammer")
    flown.fly(1.0)
    flown.upload("second.obj", "book")
    flown.look_back(1.5)
    flown.press("Play", of="Simulation")
    flown.fly(0.3)
    assert not flown.said and flown.scenario.parameters.mesh == first
