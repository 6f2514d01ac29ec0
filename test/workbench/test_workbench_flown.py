# SPDX-License-Identifier: MIT
"""The page by its own callbacks: what is drawn, said and done, on a body that flies as far as it is told to."""

from __future__ import annotations

import html
import json
import threading
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: no interactive page")

from flown_page import PATIENCE_S, FlownPage, flies_again
from mesh_files import CUBE_QUADS, obj
from workbench_page import bare_page

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.mesh.locate import resolve_mesh
from rigid_proto_ros.picture import style
from rigid_proto_ros.scene.lessons import lesson
from rigid_proto_ros.scene.scenario import make_scenario, read_scene
from rigid_proto_ros.simulation.observer import Published, SceneChanged
from rigid_proto_ros.simulation.simulation import Simulation
from rigid_proto_ros.workbench import pointer
from rigid_proto_ros.workbench.flight import RunMemory
from rigid_proto_ros.workbench.lessons import COURSES
from rigid_proto_ros.workbench.page import CLASS_LABELS
from rigid_proto_ros.workbench.panel import CENTRE_OF_MASS, SEE_INTO, motion_words
from rigid_proto_ros.workbench.readouts import DRIFT, ENERGY, PLOTTED_S, ROTATIONAL, SPEED, TRANSLATIONAL


def test_a_lesson_that_asks_begins_at_its_time_0_with_its_ghost_however_fast_time_goes(
    flown: FlownPage, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = flown.live.begin

    def begin_and_go_on(scenario) -> None:
        begin(scenario)
        if not flown.live.paused:
            flown.advance(0.1)  # what the physics thread does before it is asked for anything else

    monkeypatch.setattr(flown.live, "begin", begin_and_go_on)
    for _ in range(2):
        flown.ask("true_or_box_tensor")
        ghost, start = flown.node(style.GHOST), flown.scenario.setup.initial
        assert flown.live.state.time_ns == flown.page.state.time_ns == 0
        assert np.allclose(np.roll(ghost.wxyz, -1), start[3:7])
        outer, inner = (node.vertices[node.faces] for node in map(flown.node, (style.BODY_MESH, style.GHOST_MESH)))
        outward = np.cross(outer[:, 1] - outer[:, 0], outer[:, 2] - outer[:, 0])
        apart = flown.node(style.GHOST_MESH).position - flown.node(style.BODY_MESH).position
        assert np.einsum("ij,ij->i", inner.mean(axis=1) + apart - outer.mean(axis=1), outward).max() < 0.0
        flown.do(lambda: flown.page.lessons.answer(0))
        flown.fly(1.0)
        assert not np.allclose(np.roll(ghost.wxyz, -1), start[3:7])
    # A page that comes back shows it, too.
    flown.go_away()
    flown.come_back()
    assert flown.node(style.GHOST_MESH).visible
    # Of the ghost no past is kept, so none is shown beside the body's.
    flown.look_back(0.5)
    flown.until(lambda: style.GHOST_MESH not in flown.page.backend._nodes, "past without a ghost")
    flown.look_back(0.0)
    flown.until(lambda: flown.node(style.GHOST_MESH).visible, "ghost")
    # One that another client switches off meanwhile is gone.
    flown.look_back(0.5)
    flown.live.set_parameters({"ghost.inertia_model": ""})
    flown.wait_until_still()
    flown.look_back(0.0)
    flown.until(lambda: flown.page._drawn_moment_ns is None and not flown.page._undrawn, "present")
    assert style.GHOST_MESH not in flown.page.backend._nodes and flown.page._ghost_state() is None


def test_a_near_miss_of_the_centre_of_mass_ticks_nothing_and_the_speed_is_read_off(flown: FlownPage) -> None:
    flown.pick("com_or_rim")
    com = flown.scenario.setup.body.center_of_mass
    # Of the throat's rim, a seventh of the racket off.
    flown.act({"at": {"point": (com + [0.1, 0.0, 0.0]).tolist()}, "force": [0, 0, -1.0]})
    flown.fly(0.1)
    assert flown.page.lessons._progress.done == 0
    flown.reset()
    flown.act({"force": [0, 0, -1.0]})
    flown.fly(0.1)
    assert flown.page.lessons._progress.done == 1
    speed = float(np.linalg.norm(flown.live.state.linear_velocity))
    assert float(flown.page.readings.values[SPEED].split()[0]) == pytest.approx(speed, rel=1e-3) and speed > 0.0
    flown.until(lambda: SPEED in flown.page.lessons._numbers.content, "speed in the lesson's room")


def test_nothing_of_the_body_before_stays_when_another_scene_begins(flown: FlownPage) -> None:
    flown.change({"ballast.nut": [0.1, 0.0, 0.0, 0.05]})
    flown.wait_until_still()
    assert "nut" in flown.scenario.parameters.ballast
    flown.pick("teapot")
    parameters = flown.scenario.parameters
    assert not parameters.ballast
    assert not parameters.thrusters
    assert set(parameters.contacts) == set(read_scene("teapot").parameters.contacts)

    def drawn() -> list[str]:
        return [n for n in flown.server.scene._handle_from_node_name if n.startswith(f"/{style.BODY_MESH}")]

    assert len(drawn()) == 1
    flown.begin({"mesh": "", "inertia_model": "explicit"})
    assert not drawn()


def test_an_upload_flies_alone_and_its_take_holds_it(flown: FlownPage, tmp_path) -> None:
    folder = flown.page.body_tab.upload
    flown.upload("my hammer.obj", "hammer")
    assert folder.present is not None and folder.present.up == "z"
    flown.press("Simulate it")
    flown.fly(0.0)
    parameters = flown.scenario.parameters
    assert not parameters.contacts and not parameters.thrusters and not parameters.ballast
    flown.act({"at": {"point": [0.06, 0.0, 0.29]}, "force": [1.0, 0.0, 0.0]})
    flown.fly(1.0)
    values, _, files = flies_again(flown, tmp_path)
    assert [values["mesh"]] == files == ["my_hammer.obj"]


OPEN_BOX = b"# z up\n" + obj(faces=CUBE_QUADS[:-1])
"""A cube of a metre that lacks a side."""


def test_words_of_an_uploaded_file_are_words_on_the_page_and_neither_html_nor_markdown(flown: FlownPage) -> None:
    body = flown.page.body_tab
    for word in ("<script>", "![](//x.y)"):
        flown.do(lambda word=word: body.upload.take("a.obj", f"v {word} 0 0".encode()))
        assert html.unescape(body._verdict.content).startswith(f"- refused: a.obj line 1: got 'v {word} 0 0'")
        assert not set("<![") & set(body._verdict.content)


@pytest.mark.parametrize(("stand_in", "parameter"), [("it repaired", "mesh_repair"), ("its hull", "mesh_fallback")])
def test_for_an_open_mesh_the_page_offers_repair_or_hull_and_flies_it(
    flown: FlownPage, stand_in: str, parameter: str
) -> None:
    body = flown.page.body_tab
    flown.do(lambda: body.upload.take("open box.obj", OPEN_BOX))
    assert "refused" in body._verdict.content and "boundary" in body._verdict.content
    assert "1 × 1 × 1 m" in body.upload._size.content
    assert not flown.widget("Simulate it").visible
    flown.press(stand_in, of="Simulate")
    flown.fly(0.0)
    parameters = flown.scenario.parameters
    assert parameters.mesh.endswith("open_box.obj") and parameters.named()[parameter] in (True, "hull")
    assert flown.scenario.setup.body.mass == pytest.approx(1000.0) and not flown.said


def test_what_was_done_before_a_reset_is_no_part_of_what_is_saved(flown: FlownPage, tmp_path: Path) -> None:
    push = {"at": {"point": [0.0, 0.0, 0.068]}, "force": [0.0, 1.0, 0.0]}
    flown.change({"mass": 0.2})
    flown.act(push)
    flown.fly(0.5)
    flown.reset()
    flown.act(push)
    flown.fly(0.5)
    values, script, files = flies_again(flown, tmp_path)
    assert values["mass"] == 0.2 and [command.kind for command in script] == ["poke"]
    # A bundled mesh stays a name.
    assert resolve_mesh(values["mesh"]) == resolve_mesh("t_handle") and not files


def test_what_is_done_after_going_back_is_saved_from_there(flown: FlownPage, tmp_path: Path) -> None:
    for force, seconds in (([0.0, 1.0, 0.0], 1.0), ([0.0, 0.0, 2.0], 1.0)):
        flown.act({"at": "tip", "force": force})
        flown.fly(seconds)
    flown.look_back(1.5)
    # The space bar goes on from there, as Play does.
    (space_bar,) = (c for c in flown.server.gui._command_handle_from_uuid.values() if c.hotkey == "space")
    flown.do(lambda: space_bar._impl.trigger_cb[0](None))
    flown.fly(0.3)
    flown.act({"at": "tip", "force": [1.0, 0.0, 0.0]})
    flown.fly(0.7)
    _, script, _ = flies_again(flown, tmp_path)
    assert [command.force for command in script] == [(1.0, 0.0, 0.0)]


def test_one_can_go_back_five_minutes_and_the_oldest_goes_first() -> None:
    memory = RunMemory("rigid_body")
    memory.on(SceneChanged(0, make_scenario({}).text))
    row = np.zeros(13)
    for k in range(40_000):
        memory.on(Published(k * 10_000_000, row))
    times = memory.session().times
    assert times[-1] == 39_999 * 10_000_000 and times[-1] - times[0] == pytest.approx(300e9, rel=1e-4)


def test_a_take_is_saved_as_gltf_with_a_key_for_each_frame(flown: FlownPage) -> None:
    flown.fly(1.0)
    content, _ = flown.page.session_tab._motion(25.0)
    document = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    assert document["meshes"] and len(document["animations"]) == 1
    keys = document["accessors"][document["animations"][0]["samplers"][0]["input"]]
    assert keys["count"] == 26 and keys["max"] == [pytest.approx(1.0)]


def test_the_energies_of_a_spinning_nut_are_read_off_and_those_that_rounding_leaves_are_not(flown: FlownPage) -> None:
    nut = {"mesh": "", "inertia_model": "explicit", "explicit_inertia.mass": 3e-4}
    nut |= {
        "explicit_inertia.tensor": [1e-9, 0.0, 0.0, 1.1e-9, 0.0, 1.2e-9],
        "initial.angular_velocity": [0.0, 0.0, 1.0],
    }
    flown.begin({**nut, "initial.linear_velocity": [1e-10, 0.0, 0.0]})
    flown.fly(0.1)
    values = flown.page.readings.values
    assert (values[ROTATIONAL], values[TRANSLATIONAL]) == ("6e-10 J", "0 J")


def test_plots_are_drawn_against_seconds_before_now_also_after_a_jump_of_time(flown: FlownPage) -> None:
    for seconds in (30.0, 5.0):
        flown.fly(seconds)
        tab = flown.page.readout_tab
        for plot in filter(lambda plot: plot.shown, tab._columns):
            drawn = flown.until(lambda plot=plot: len(plot._handle.data[0]) > 10 and plot._handle.data, "plot")
            assert plot._handle.scales["x"]["range"] == (-PLOTTED_S, 0.0)
            assert drawn[0][-1] == 0.0
            assert drawn[0][0] >= -PLOTTED_S
        flown.reset()


def test_a_branch_begins_at_the_moment_looked_at_to_which_reset_returns(flown: FlownPage) -> None:
    flown.fly(3.0)
    before = flown.page.flight.memory.session()
    flown.look_back(2.0)
    moment_ns = flown.page.flight.moment_ns
    assert moment_ns == pytest.approx(1_000_000_000, abs=10_000_000)
    flown.press("Play", of="Simulation")
    flown.fly(0.5)
    k = before.times.tolist().index(moment_ns)
    # Undisturbed it does again what it did: the exact free flight from the recorded state.
    assert np.abs(flown.live.state.row - before.rows[k + 50]).max() < 1e-9
    flown.reset()
    assert np.array_equal(flown.live.state.row[:7], before.rows[k][:7])


def test_the_energy_holds_the_string_of_its_moment_also_of_one_that_is_looked_back_at(flown: FlownPage) -> None:
    flown.fly(0.2)
    flown.until(lambda: flown.page.readout_tab._free.shown, "plot without a string")
    assert not flown.page.readout_tab._held.shown
    flown.act({"string": {"attach": "tip", "target": [0.3, 0.0, 0.2]}})
    flown.fly(0.2)
    tab = flown.page.readout_tab
    flown.until(lambda: tab._held.shown and not tab._free.shown, "plot with the string's energy")
    simulation = flown.live.loop.simulation
    tied = simulation.string.potential_energy(simulation.setup.body, simulation.state)
    total, held = flown.page.readings.samples[-1][4:6]
    assert held == pytest.approx(tied, rel=1e-9) and tied > 0.0
    flown.fly(0.1)
    flown.act({"string": "release"})
    flown.fly(0.5)
    assert flown.page.readings.samples[-1][5] == 0.0
    flown.look_back(0.6)
    assert flown.until(lambda: flown.page.state.time_ns == 400_000_000, "state of the past")
    assert float(flown.page.readings.values[ENERGY].split()[0]) == pytest.approx(total, rel=1e-4)
    assert flown.page.picture.string.tied
    # Nor does what is looked back at let the next lesson's time begin before its question is answered.
    flown.set("Lesson", lesson("book").title)
    flown.until(lambda: flown.page.lessons._asked, "question")
    flown.fly(0.0)
    assert flown.live.paused and flown.page.lessons._asked


@pytest.mark.parametrize("paused", [False, True])
def test_the_last_page_that_closes_while_it_looks_back_leaves_the_body_as_it_was(
    flown: FlownPage, paused: bool
) -> None:
    page = flown.page
    flown.do(lambda: page.flight.pause(paused))
    flown.fly(1.0)
    flown.look_back(0.5)
    flown.wait_until_asked()
    assert flown.live.paused
    flown.go_away()
    flown.wait_until_asked()
    assert page.flight.moment_ns is None and flown.live.paused == paused
    flown.come_back()


def test_a_page_that_comes_back_shows_nothing_that_ended_or_began_while_none_was_there(flown: FlownPage) -> None:
    page = flown.page
    flown.live.schedule('[{"t": 0, "wrench": {"force": [0.01, 0, 0], "torque": [0, 0.01, 0], "duration": 0.3}}]')
    flown.fly(0.2)
    arrow = flown.node("world/loads/wrench/force")
    assert page._words() == "a force acts" and arrow.visible
    flown.go_away()
    flown.advance(1.0)
    flown.come_back()
    assert page._words() == "free rotation, exact" and not arrow.visible
    assert float(page.readings.values[DRIFT].rstrip("°")) > 1.0
    flown.go_away()
    flown.live.reset()
    flown.come_back()
    flown.fly(2.0)
    assert page.readings.values[DRIFT] == "0°"


def test_a_browser_that_comes_while_the_page_stops_listening_is_told_of_the_body(flown: FlownPage, monkeypatch) -> None:
    remove, within, free, removed = flown.live.remove_observer, *(threading.Event() for _ in range(3))

    def remove_later(observer) -> None:
        within.set()
        free.wait()
        remove(observer)
        removed.set()

    monkeypatch.setattr(flown.live, "remove_observer", remove_later)
    flown.leave()
    within.wait()
    flown.come()
    flown.until(flown.server.get_clients, "browser")
    free.set()
    removed.wait()
    flown.until(lambda: flown.page._told in flown.live._observers, "page that hears again")
    flown.fly(0.1)


def test_where_the_first_browser_is_refused_the_body_by_a_busy_machine_the_next_one_gets_it(
    flown: FlownPage, monkeypatch
) -> None:
    page, add, asked = flown.page, flown.live.add_observer, []

    def refuse_first(observer) -> None:
        asked.append(observer)
        if len(asked) == 1:
            raise InputError("request", "the simulation was too busy")
        add(observer)

    flown.go_away()
    monkeypatch.setattr(flown.live, "add_observer", refuse_first)
    with bare_page(flown.server.get_port()):
        flown.until(lambda: asked, "first browser")
        flown.come()
        flown.until(page._open.is_set, "page for the second browser")
    flown.fly(0.1)


def test_while_paused_what_is_done_by_hand_acts_in_its_order(flown: FlownPage) -> None:
    flown.press("Pause", of="Simulation")
    place = flown.live.state.position + [0.0, 0.0, 0.2]
    flown.act({"string": {"target": place.tolist()}})
    flown.act({"force": [1.0, 0.0, 0.0]})
    flown.act({"string": "release"})
    flown.wait_until_still()
    flown.press("Play", of="Simulation")
    flown.fly(0.1)
    kinds = [event["kind"] for event in flown.events]
    assert [kind for kind in kinds if kind not in ("pause", "reset")] == ["string_target", "poke", "string_release"]


def string_events(flown: FlownPage) -> list[str]:
    return [event["kind"] for event in flown.events if event["kind"].startswith("string")]


def test_the_string_is_of_the_page_that_grabbed_first_and_goes_with_it(flown: FlownPage) -> None:
    pointer, place = flown.page.pointer, np.zeros(3)
    flown.grab((0.0, 0.045, 0.0))
    flown.do(lambda: pointer.grab(2, place, place))
    flown.do(lambda: pointer.left(2))
    flown.fly(0.1)
    assert string_events(flown) == ["string_attach", "string_target"] and flown.live.loop.simulation.string
    flown.do(lambda: pointer.left(1))
    flown.fly(0.1)
    assert string_events(flown)[-1] == "string_release" and flown.live.loop.simulation.string is None
    flown.do(lambda: pointer.grab(2, place, place))
    flown.fly(0.1)
    assert string_events(flown)[-2:] == ["string_attach", "string_target"]
    flown.let_go()


def test_a_hand_that_stands_still_goes_on_holding_longer_than_the_strings_timeout(flown: FlownPage) -> None:
    flown.change({"string.timeout": 0.15})
    place = flown.grab((0.0, 0.045, 0.0))
    flown.pull(place + [0.0, 0.0, 0.1])
    for _ in range(3):
        said = flown.live.loop.commands.received["schedule"]
        flown.until(lambda said=said: flown.live.loop.commands.received["schedule"] > said, "word of the hand")
        flown.fly(0.1)
    assert set(string_events(flown)) == {"string_attach", "string_target"}
    assert flown.live.loop.simulation.string is not None
    flown.let_go()


@pytest.mark.parametrize("speed", [0.1, 5.0])
def test_a_still_hand_says_where_it_is_within_the_strings_timeout_at_any_speed(
    flown: FlownPage, monkeypatch: pytest.MonkeyPatch, speed: float
) -> None:
    flown.live.set_parameters({"real_time_factor": speed})
    now_s = time.monotonic()
    monkeypatch.setattr(pointer, "time", SimpleNamespace(monotonic=lambda: now_s))
    flown.grab((0.0, 0.045, 0.0))
    now_s += 0.5 * flown.scenario.parameters.string.timeout / speed
    flown.do(flown.page.pointer.hold)
    assert flown.page.pointer._drag.last_target_s == now_s
    flown.let_go()


def test_an_input_that_is_refused_says_why_and_shows_what_is_in_force_as_one_that_is_set_elsewhere_does(
    flown: FlownPage,
) -> None:
    field = flown.widget("Density [kg/m³]")
    for typed, why in (("two", "accepted: "), ("-1", "Refused: density"), ("1e+300", "Refused: density")):
        before = field.value
        flown.set("Density [kg/m³]", typed)
        flown.until(lambda: flown.said, "refusal")
        assert why in flown.said[0] and typed in flown.said.pop()
        flown.until(lambda before=before: field.value == before, "density that is in force")
    flown.live.set_parameters({"density": 1234.5})
    flown.until(lambda: field.value == "1234.5", "density set elsewhere")


@pytest.mark.parametrize(
    ("values", "parameter"),
    [
        ({"density": 5000.0}, "mass"),
        ({"mass": 0.4}, "mass"),
        ({"inertia_model": "explicit", "explicit_inertia.mass": 0.4}, "explicit_inertia.mass"),
    ],
)
def test_a_factor_is_ten_to_its_slider_that_of_the_mass_without_the_ballast(
    flown: FlownPage, values: dict, parameter: str
) -> None:
    scene = {"mesh": "t_handle", "ballast.weight": [0.6, 0.0, 0.0, 0.0], **values}
    flown.begin(scene)
    own = flown.scenario.setup.body.mass - 0.6
    assert flown.widget("Mass ×").value == (0.0,)
    flown.set("Mass ×", (1.0,))
    flown.fly(0.0)
    assert flown.scenario.parameters.named()[parameter] == pytest.approx(10.0 * own, rel=1e-12)
    assert flown.scenario.setup.body.mass == pytest.approx(10.0 * own + 0.6)
    assert flown.widget("Mass ×").value == (1.0,)
    hand = flown.page.pointer
    flown.set("Force ×", (-0.5,))
    assert hand.force == pytest.approx(10.0**-0.5 * hand.usual_force, rel=5e-3)


def test_the_status_line_says_in_plain_words_what_the_body_does() -> None:
    for values, motion, words in (
        ({}, (0, False, False, False), "free rotation, exact"),
        ({}, (2, True, False, False), "2 forces act"),
        ({}, (0, True, False, False), "string attached"),
        ({}, (0, False, True, True), "paused"),
        ({}, (0, False, True, False), "at rest"),
        ({"gravity": [0.0, 0.0, -9.81]}, (0, False, False, False), "free fall"),
        ({"gyroscopic": False, "integrator": "rk4"}, (0, False, False, False), "free rotation, without ω × Iω"),
    ):
        assert motion_words(make_scenario(values), *motion) == words


def test_a_pushed_body_shows_the_force_and_at_most_three_labels(flown: FlownPage) -> None:
    flown.click((0.0, 0.0, 0.068), flown.live.state.rotation @ np.array([0.0, -1.0, 0.0]))
    flown.fly(0.03)
    backend = flown.page.backend
    assert backend._nodes[style.load_part("poke", "force")].visible
    written = [label for label in backend._labels if label.visible]
    assert 1 <= len(written) <= 3
    sizes = []
    for on in (True, False):
        flown.set("Class mode", on)
        sizes += {label.font_screen_scale for label in written}
    assert sizes == [CLASS_LABELS, 1.0], "in class mode they are larger"
    flown.fly(2.0)
    assert not backend._nodes[style.load_part("poke", "force")].visible


def test_names_stay_at_their_contacts_when_the_body_changes_and_when_the_past_is_shown(flown: FlownPage) -> None:
    flown.pick("hammer")
    page = flown.page

    def named_where_they_are() -> None:
        state, setup, backend = page.state, page.picture.setup, page.backend
        labels = {label.text: label.position for label in backend._labels if label.visible}
        for name in ("head", "grip"):
            place = state.position + state.rotation @ setup.body.point(setup.contacts[name])
            assert np.allclose(labels[name], (place - backend.origin) / backend.unit, atol=1e-9), name

    # The box's centre of mass is 8 cm from that of the solid.
    for label, value in (("Model", "bounding_box"), ("Size ×", (0.3,)), ("Model", "solid")):
        flown.set(label, value)
        flown.fly(0.5)
        named_where_they_are()
    flown.look_back(1.2)
    named_where_they_are()


def test_a_body_that_is_changed_while_time_stands_is_drawn_so_at_once_and_a_click_hits_it(flown: FlownPage) -> None:
    flown.press("Pause", of="Simulation")
    flown.set("Size ×", (0.5,))
    flown.wait_until_still()
    assert flown.page.picture.setup is flown.scenario.setup
    flown.click((0.0, 0.0, 0.065), flown.live.state.rotation @ np.array([0.0, -1.0, 0.0]))
    flown.press("Play", of="Simulation")
    flown.fly(0.02)
    (poke,) = (event["content"] for event in flown.events if event["kind"] == "poke")
    assert float(poke["frame_id"].split(",")[2]) == pytest.approx(0.065, abs=1e-6), (
        "mesh coordinates, whatever the scale"
    )


def test_of_a_tensor_no_rounding_is_shown(flown: FlownPage) -> None:
    entries = [float(entry) for entry in flown.widget("Tensor").value.split()]
    assert [entry == 0.0 for entry in entries] == [False, True, True, False, True, False]
    assert "| 0 % |" in flown.page.body_tab._table.content, "the masses of the two models"


def test_a_body_of_any_size_fills_the_picture_alike_and_grows_in_sight(flown: FlownPage) -> None:
    backend, picture = flown.page.backend, flown.page.picture
    assert backend.unit == picture.shape.size
    before = backend.unit
    flown.set("Size ×", (np.log10(1.5),))
    flown.fly(0.1)
    assert backend.unit == before and picture.shape.size == pytest.approx(1.5 * before)
    flown.set("Size ×", (np.log10(9.0),))
    flown.fly(0.1)
    assert backend.unit == picture.shape.size


@pytest.mark.parametrize("name", sorted(COURSES))
def test_a_lesson_begins_with_its_body_whole_and_large_and_names_at_most_three_things(
    flown: FlownPage, name: str
) -> None:
    flown.ask(name)
    page, setup = flown.page, flown.scenario.setup
    backend = page.backend
    flown.do(lambda: page.tick(time.monotonic()))  # with the labels of this lesson

    def seen(points) -> np.ndarray:
        """World points (n, 3) [m] in half heights of the picture, across and up."""
        camera = flown.server.initial_camera
        away = camera.look_at - camera.position
        away /= np.linalg.norm(away)
        right = np.cross(away, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        from_camera = (np.asarray(points) - backend.origin) / backend.unit - camera.position
        depth = from_camera @ away * np.tan(0.5 * camera.fov)
        return np.column_stack([from_camera @ right, from_camera @ np.cross(right, away)]) / depth[:, np.newaxis]

    vertices = flown.scenario.body_mesh.mesh.vertices * setup.body.scale - setup.body.center_of_mass

    def body_seen() -> np.ndarray:
        """The body's vertices in the picture, none of which is below the floor."""
        vertices_now = page.state.position + vertices @ page.state.rotation.T
        assert ((vertices_now - backend.origin)[:, 2] / backend.unit).min() > page.room._floor.position[2]
        return seen(vertices_now)

    drawn = body_seen()
    assert np.abs(drawn).max() < 1.0
    attached = bool(setup.scene.string_attached)
    moves_away = setup.gravity.any() or attached
    # The least are the top on a string seven times its length, and the spinning top.
    assert np.ptp(drawn, axis=0).max() / 2.0 > (0.07 if moves_away else 0.29), "of the height"
    if attached:
        assert np.abs(seen([setup.scene.string_target])).max() < 1.0, "the nail is beside the picture"
        assert backend._nodes[style.STRING].visible and backend._nodes[style.HAND].visible
    if setup.gravity.any():
        trial = Simulation(setup)
        path = [trial.advance(round(0.1e9 * k)).position for k in range(11)]
        assert np.abs(seen(path)).max() < 1.0, "the path leaves the picture"
    assert page.room._wall.visible == (bool(setup.gravity.any()) and not attached)
    labels = [node for node in backend._labels if node.visible]
    assert len(labels) <= 3
    arrows = {part: backend._nodes.get(part) for part in (style.MOMENTUM, style.OMEGA)}
    drawn_arrows = {part for part, node in arrows.items() if node is not None and node.visible}
    assert drawn_arrows <= set(page.lessons.course.labels), "an arrow without a name"
    depth = np.linalg.norm(flown.server.initial_camera.position) * np.tan(0.5 * flown.server.initial_camera.fov)
    thin = [part for part in drawn_arrows if 2.0 * arrows[part].shaft_radius < 0.008 * depth]
    assert not thin, "arrows less than three of 800 pixels thick"
    places = [backend.origin + backend.unit * np.array(node.position) for node in labels]
    assert np.abs(seen(np.reshape(places, (-1, 3)))).max(initial=0.0) < 1.0, "a label is beside the picture"
    assert 3 <= len(page.lessons.course.numbers) <= 5
    one, text = lesson(name), page.lessons._text
    assert flown.live.paused and page.state.time_ns == 0
    assert one.question in text.content and not any(sentence in text.content for sentence in one.sentences)
    opacity = backend._nodes[style.BODY_MESH].opacity
    assert (opacity is not None) == (SEE_INTO in page.lessons.course.shows)
    if CENTRE_OF_MASS in page.lessons.course.shows and opacity is None:
        towards = (page.state.position - backend.origin) / backend.unit - flown.server.initial_camera.position
        eye = -backend.unit * towards @ page.state.rotation
        hit = setup.surface.ray_hit(setup.body.mesh_point(eye), -eye / setup.body.scale)
        nearer = hit is not None and np.linalg.norm(eye - setup.body.point(hit)) < np.linalg.norm(eye)
        assert not nearer, "the body hides the mark of the centre of mass"
    axes = backend._nodes.get(style.PRINCIPAL_AXES)
    is_round = name in ("spinning_top", "top_on_string")
    assert (axes is not None and axes.visible) == is_round, "what is round is seen to spin by its axes alone"
    course = page.lessons.course
    assert page._com.visible == (CENTRE_OF_MASS in course.shows), "the mark answers the question before it is asked"
    line = backend._nodes.get(style.STRING_LINE)
    assert (line is not None and line.visible) == (style.STRING_LINE in page.lessons.course.shows)
    flown.press(f"A   {one.choices[0]}")
    assert not flown.live.paused and "You said **A**" in text.content
    flown.until(lambda: page._com.visible == (CENTRE_OF_MASS in course.shows + course.reveals), "centre of mass")
    assert all(sentence in text.content for sentence in one.sentences)
    for _ in range(8):
        flown.fly(0.25)
        assert np.abs(body_seen()).max() < 1.05, f"the body is beside the picture at {1e-9 * page.state.time_ns} s"
    ghost = backend._nodes.get(style.GHOST_MESH)
    assert (ghost is not None and ghost.visible) == (flown.scenario.ghost is not None), "a ghost of the lesson before"


def test_before_time_begins_the_body_is_seen_above_the_floor() -> None:
    class Waiting(FlownPage):
        def fly(self, seconds: float):
            pass

    flown = Waiting("t_handle")
    try:
        page = flown.page
        flown.until(lambda: (arrow := page.backend._nodes.get(style.MOMENTUM)) and arrow.visible, "arrow of L")
        assert page.room._floor.position[2] < -0.5
    finally:
        flown.end()


def test_a_lesson_that_is_picked_while_the_page_is_busy_begins_when_it_no_longer_is(flown: FlownPage) -> None:
    page, done = flown.page, threading.Event()
    flown.do(lambda: page.flight.ask(lambda: done.wait(PATIENCE_S), "computing"))
    picking = flown._begin_update(flown.widget("Lesson"), lesson("hammer").title)
    flown.until(lambda: "computing …" in page.bar._line.content, "word of what is waited for")
    done.set()
    picking.result(PATIENCE_S)
    flown.until(lambda: page.lessons._asked, "question")
    assert resolve_mesh(flown.scenario.parameters.mesh) == resolve_mesh("hammer")
    assert lesson("hammer").question in page.lessons._text.content
    flown.do(lambda: page.lessons.answer(0))
    flown.fly(0.5)
    assert flown.page.state.time_ns == 500_000_000


def test_a_gravity_whose_square_is_0_is_no_reason_not_to_draw(flown: FlownPage) -> None:
    flown.begin({"mesh": "hammer", "gravity": [1e-300, 0.0, 0.0]})
    flown.fly(0.1)
    assert flown.page.picture.setup is flown.scenario.setup


def test_an_error_in_drawing_is_told_once_and_does_not_end_the_page(flown: FlownPage, monkeypatch, caplog) -> None:
    draw, failures = flown.page.backend.finish, iter("123")

    def finish(now_s: float) -> None:
        if next(failures, ""):
            raise ValueError("not drawn")
        draw(now_s)

    monkeypatch.setattr(flown.page.backend, "finish", finish)
    flown.fly(0.5)
    flown.until(lambda: f"{0.5:.2f} s" in flown.page.bar._line.content, "time on the bar")
    assert [record.exc_info[0] for record in caplog.records if record.exc_info] == [ValueError]


def test_light_is_left_to_viser(flown: FlownPage) -> None:
    # The player of a recording goes back to viser's own at every loop: with any other light the picture would change.
    told = {type(m).__name__ for m in flown.server._websock_server._broadcast_buffer.message_from_id.values()}
    assert "GridMessage" in told
    assert not {name for name in told if "Light" in name or name in ("EnvironmentMapMessage", "FogMessage")}


def test_what_is_switched_on_while_time_stands_is_drawn(flown: FlownPage) -> None:
    flown.do(lambda: flown.page.flight.pause(True))
    flown.until(lambda: flown.live.paused, "pause")
    flown.set("Angular velocity ω", False)

    def drawn() -> bool:
        node = flown.page.backend._nodes.get(style.OMEGA)
        return node is not None and node.visible

    assert not drawn()
    flown.set("Angular velocity ω", True)
    flown.until(drawn, "arrow of ω")
    flown.set("Angular velocity ω", False)
    flown.do(lambda: flown.page.flight.pause(False))


def test_a_picture_that_is_higher_than_wide_is_seen_from_further_off(flown: FlownPage) -> None:
    room = flown.page.room

    def distance(width: int, height: int) -> float:
        client = SimpleNamespace(camera=SimpleNamespace(image_width=width, image_height=height), atomic=nullcontext)
        room.look(client)
        return float(np.linalg.norm(client.camera.position - client.camera.look_at))

    assert distance(800, 400) == distance(400, 400) == pytest.approx(0.5 * distance(400, 800))
