# SPDX-License-Identifier: MIT
"""Flights from Python: commanded, stepped and recorded as scripts and the node do it, one by one and on all cores."""

import re
from pathlib import Path

import numpy as np
import pytest

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.sweep.flights import Flight, fly_all, fly_study, load_scene, read_command

SCRIPT = [
    {"t": 0.0, "at": "tip", "push": 0.05, "duration": 0.2},
    {"t": 0.1, "wrench": {"torque": [0.0, 0.0, 1e-4], "duration": 0.3, "slot": "wheel"}},
    {"t": 0.1, "impulse": [0.001, 0.0, 0.0]},
    {"t": 0.25, "set": {"gravity": [0.0, 0.0, -1.0]}},
    {"t": 0.3, "thrusters": [0.05, 0.0, 0.02, 0.0]},
    {"t": 0.4, "state": {"position": [1.0, 0.0, 0.0]}},
]


def test_commands_by_hand_fly_as_a_script_does_and_the_recording_verifies(tmp_path) -> None:
    pytest.importorskip("mcap")
    from rigid_proto_ros.session.bag import read_runs
    from rigid_proto_ros.session.check import verify

    scene = load_scene("t_handle")
    with Flight(scene, record=tmp_path / "flight.mcap") as flight:
        for entry in SCRIPT:
            flight.step(entry["t"] - flight.sample().time_ns * 1e-9)
            flight.command({key: value for key, value in entry.items() if key != "t"})
        reached = flight.step(0.2)
    run = OfflineRun(scene, parse_script(str(SCRIPT)))
    run.advance(reached.time_ns)
    assert run.simulation.state.row.tobytes() == reached.row.tobytes()
    (session,) = read_runs(tmp_path / "flight.mcap")
    assert verify(session) is None and len(session.events) == 6


def test_what_cant_be_taken_is_said_at_once_and_what_is_refused_later_at_its_step() -> None:
    flight = Flight(load_scene("t_handle"))
    with pytest.raises(InputError, match="there is no key frce"):
        flight.command({"frce": [0, 0, 1]})
    with pytest.raises(InputError, match="4 numbers, one a thruster"):
        flight.command({"thrusters": [1.0]})
    for _ in range(2):  # each step tells of its own
        flight.command({"at": {"ray": {"origin": [9, 9, 9], "direction": [1, 0, 0]}}, "force": [1, 0, 0]})
        with pytest.raises(InputError, match="1 ray_miss, frame_id: .*a ray that meets"):
            flight.step(0.1)


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_numbers_and_arrays_of_numpy_are_numbers_and_lists(tmp_path, kind) -> None:
    pytest.importorskip("mcap")
    from rigid_proto_ros.session.bag import read_runs
    from rigid_proto_ros.session.check import verify

    vector = np.array([0.125, -0.25, 0.5], kind)

    def flown(number, numbers, path, record="") -> bytes:
        scene = load_scene("t_handle", {"mass": number(2.0), "gravity": numbers, "mesh": path("hammer")})
        with Flight(scene, record=record) as flight:
            flight.command({"t": number(0.0625), "at": {"point": numbers}, "force": numbers, "duration": number(0.5)})
            flight.command({"state": {"angular_velocity": numbers}})
            flight.command({"set": {"gravity": numbers, "density": number(500.0)}})
            flight.command({"string": {"target": numbers}})
            flight.command({"thrusters": [*(abs(x) for x in numbers), number(0.0)]})
            return flight.step(number(0.125)).row.tobytes()

    recording = tmp_path / "flight.mcap"
    assert flown(kind, vector, Path, recording) == flown(float, tuple(vector.tolist()), str)
    (session,) = read_runs(recording)
    assert verify(session) is None
    with pytest.raises(InputError, match="force: got True"):
        Flight(load_scene("t_handle")).command({"force": [True, 0.0, 0.0]})


@pytest.mark.parametrize(
    "entry",
    [
        {1: 2.0},
        {"state": {None: [0.0, 0.0, 1.0]}},
        {"force": [0.0, 0.0, 1.0], "axes": np.zeros(3)},
        {"force": np.zeros((3, 3))},
        {"at": {"vertex": np.arange(2)}, "push": 1.0},
        {"service": np.zeros(2)},
        {"string": np.zeros(2)},
        {"thrusters": np.array(["a"])},
    ],
)
def test_keys_and_values_of_any_type_are_refused_in_one_line(entry) -> None:
    with pytest.raises(InputError, match=r"\Acommand, entry 1.*\Z"):
        Flight(load_scene("t_handle")).command(entry)


def test_a_sample_is_the_callers_own() -> None:
    flight = Flight(load_scene("t_handle"))
    for sample in (flight.sample(), flight.step(0.1)):
        expected = flight.sample().row.tobytes()
        sample.position[:] += 9.0
        assert flight.sample().row.tobytes() == expected


def test_a_recording_is_named_what_it_is(tmp_path) -> None:
    with pytest.raises(InputError, match=r"ends in \.mcap"):
        Flight(load_scene("t_handle"), record=tmp_path / "flight.rrd")
    assert not list(tmp_path.iterdir())


def test_of_an_entry_that_is_refused_nothing_acts() -> None:
    flight = Flight(load_scene("t_handle", {"integrator": "lie_midpoint", "string.attach": [0.0, 0.0, 0.0]}))
    with pytest.raises(InputError, match="a string"):
        flight.command({"string": {"attach": "tip", "target": [0.0, 0.0, 1.0]}})
    flight.command({"set": {"integrator": "auto"}})
    flight.step(0.1)
    assert flight._run.simulation.attach == (0.0, 0.0, 0.0)


PLANS = {
    "nothing": [],
    "a wrench that times out": [{"t": 0.0, "wrench": {"torque": [0.0, 0.0, 1e-4]}}],
    "pokes out of order": [
        {"t": 0.7, "at": "tip", "force": [0.05, 0.0, 0.0]},
        {"t": 0.2, "at": {"vertex": 3}, "push": 0.05, "duration": 0.1},
        {"t": 0.2, "impulse": [0.001, 0.0, 0.0]},
        {"t": 0.0, "wrench": {"torque": [0.0, 1e-4, 0.0], "slot": "wheel", "duration": 0.5}},
    ],
    "a ray": [
        {"t": 0.1, "at": {"ray": {"origin": [0.0, 0.0, 1.0], "direction": [0.0, 0.0, -1.0]}}, "force": [1, 0, 0]}
    ],
    "a change, thrusters, a state and the end of all": SCRIPT,
    "what is behind the end": [{"t": 2.5, "at": "tip", "force": [0.05, 0.0, 0.0]}],
    "what is at the end": [{"t": 2.0, "at": "tip", "force": [0.05, 0.0, 0.0]}],
}


@pytest.mark.parametrize("plan", PLANS)
@pytest.mark.parametrize("record", [False, True])
def test_a_flight_in_one_call_is_that_in_three_and_goes_on_as_it_does(tmp_path, plan, record) -> None:
    pytest.importorskip("mcap")
    scene = load_scene("t_handle")
    heavier = scene.with_changes({"mass": 0.3, "gravity": [0.0, 0.0, -1.0]})
    one, three = (Flight(scene, record=tmp_path / f"{name}.mcap" if record else "") for name in ("one", "three"))
    read = [read_command(entry) for entry in PLANS[plan]]
    for flown in (scene, heavier, heavier):
        reached = one.fly(read, 2.0, flown)
        three.reset(flown)
        for command in read:
            three.command(command)
        assert reached.row.tobytes() == three.step(2.0).row.tobytes() == one.sample().row.tobytes()
        assert reached.time_ns == one.sample().time_ns == 2_000_000_000
        assert one.sensitivity() == three.sensitivity()
        for flight in (one, three):
            flight.command({"at": "tip", "force": [0.0, 0.05, 0.0]})
        assert one.step(1.0).row.tobytes() == three.step(1.0).row.tobytes()
    assert one.fly(PLANS[plan], 2.0).row.tobytes() == reached.row.tobytes()  # entries, and the scene of the last time
    for flight in (one, three):
        flight.close()


def test_a_flight_in_one_call_says_what_three_calls_say() -> None:
    flight = Flight(load_scene("t_handle"))
    with pytest.raises(InputError, match="command 2 at 1 s, .*vertex/0 to vertex"):
        flight.fly([{"t": 0.5, "force": [0, 0, 1]}, {"t": 1.0, "at": {"vertex": 10**6}, "force": [0, 0, 1]}], 2.0)
    assert flight.sample().time_ns == 0
    missed = {"at": {"ray": {"origin": [9, 9, 9], "direction": [1, 0, 0]}}, "force": [1, 0, 0]}
    for _ in range(2):
        with pytest.raises(InputError, match="1 ray_miss, frame_id: .*a ray that meets"):
            flight.fly([missed], 0.1)
    with pytest.raises(InputError, match="a number of seconds from 0"):
        flight.fly([], -1.0)
    with pytest.raises(InputError, match="there is no key frce"):
        flight.fly([{"frce": [0, 0, 1]}], 1.0)
    fast = load_scene("t_handle", {"initial.angular_velocity": [1e99, 1e99, 1e99]})
    with pytest.raises(InputError, match="too fast"):
        flight.fly([{"t": 0.2, "at": "tip", "force": [0.05, 0.0, 0.0]}], 1.0, fast)
    assert flight.fly([], 1.0, load_scene("t_handle")).time_ns == 1_000_000_000


def test_a_study_from_python_has_the_bits_of_flights_one_by_one_and_a_row_that_fails_its_reason() -> None:
    poke, masses = {"t": 0.2, "at": "tip", "force": [0.05, 0.0, 0.0]}, np.array([0.1, 0.15, 1e30, 0.2])
    measure = {"final": ["position", "orientation"]}
    spec = {"scene": "t_handle", "duration": 0.5, "script": [poke], "vary": {"mass": {"list": masses}}}
    table = fly_study({**spec, "measure": measure})
    assert table["mass"].tolist() == masses.tolist() and table["failure"].tolist() == [None] * 4
    flight, read = Flight(load_scene("t_handle")), read_command(poke)
    for row, mass in enumerate(masses):
        flight.reset(load_scene("t_handle", {"mass": mass}))
        flight.command(read)
        reached = flight.step(0.5).row[:7].tolist()
        names = [*(f"position.{axis}" for axis in "xyz"), *(f"orientation.{axis}" for axis in "xyzw")]
        assert [table[name][row] for name in names] == reached
    spins = {"initial.angular_velocity": {"list": [[0.0, 0.0, 1.0], [1e99, 1e99, 1e99]]}}
    good, failed = fly_study({**spec, "vary": spins, "measure": measure})["failure"]
    assert good is None and "too fast" in failed
    with pytest.raises(InputError, match="there is no parameter 'mas'"):
        fly_study({**spec, "vary": {"mas": {"list": [1.0]}}})


def test_a_scene_with_changes_is_the_scene_loaded_with_them_and_leaves_the_first_one_as_it_was() -> None:
    """What a change leaves as it was is shared; what follows from it, a mass set by the density too, is made anew."""
    scene, poke = load_scene("t_handle", {"mass": 0.3}), read_command({"at": "tip", "force": [0.05, 0.0, 0.0]})

    def flown(one) -> bytes:
        flight = Flight(one)
        flight.command(poke)
        return flight.step(1.0).row.tobytes()

    before = flown(scene)
    for changes in (
        {"mass": 0.2},
        {"density": 500},
        {"scale": [2, 1.0, 1.0]},
        {"initial.angular_velocity": (1, 2.0, 3.0), "linear_damping": "0.1"},
        {"ballast.nut": [0.01, 0.0, 0.0, 0.02]},
        {"inertia_model": "explicit", "explicit_inertia.tensor": [1e-4, 0.0, 0.0, 1e-4, 0.0, 1.5e-4]},
        {"integrator": "dop853", "step": 0.002},
    ):
        changed = scene.with_changes(changes)
        loaded = load_scene("t_handle", changes if "density" in changes else {"mass": 0.3, **changes})
        assert flown(changed) == flown(loaded) != before and changed.parameters == loaded.parameters
    assert flown(scene) == before
    for wrong in ({"mass": float("nan")}, {"mass": -1.0}, {"scale": [1.0, float("inf"), 1.0]}, {"mass": True}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            scene.with_changes(wrong)


def test_commands_are_checked_under_the_changes_that_wait_before_them() -> None:
    scene = load_scene("t_handle", {"integrator": "free_body"})
    entries = [
        {"t": 1.0, "set": {"integrator": "auto"}},
        {"t": 2.0, "at": "tip", "force": [0.0, 0.01, 0.0]},
        {"t": 3.0, "set": {"linear_damping": 0.1}},
    ]
    flight, run = Flight(scene), OfflineRun(scene, parse_script(str(entries)))
    for entry in entries:
        flight.command(entry)
    with pytest.raises(InputError, match="free_body"):
        flight.command({**entries[1], "t": 0.9})
    run.advance(4_000_000_000)
    assert flight.step(4.0).row.tobytes() == run.simulation.state.row.tobytes() and not run.simulation.refused


def test_a_motion_that_has_failed_goes_no_further() -> None:
    """A string that pushes, whose knot runs into its free end: every step says so, whatever is commanded."""
    string = {
        "string.attached": True,
        "string.bilateral": True,
        "string.rest_length": 0.5,
        "inertia_model_com": "model",
    }
    inertia = {"inertia_model": "explicit", "mesh": "", "explicit_inertia.mass": 0.1}
    still = {
        "initial.position": [0.2, 0.0, 0.0],
        "initial.linear_velocity": [-20.0, 0.0, 0.0],
        "initial.angular_velocity": [0.0] * 3,
    }
    flight = Flight(load_scene("t_handle", {**string, **inertia, **still}))
    reached = []
    for _ in range(3):
        with pytest.raises(InputError, match="meets its free end"):
            flight.step(0.1)
        flight.command({"state": {"position": [1.0, 0.0, 0.0]}})
        reached.append(flight.sample().time_ns)
    assert 0 < reached[0] == reached[1] == reached[2] < 100_000_000


def reached(scene) -> bytes:
    flight = Flight(scene)
    flight.command({"at": {"vertex": 3}, "force": [0.1, 0.0, 0.2], "duration": 0.1})
    return flight.step(0.2).row.tobytes()


def test_scenes_go_to_other_processes_flown_before_or_not_and_flights_come_back_in_their_order(tmp_path) -> None:
    """Also one of an open mesh, with its hull as substitute, whose file is gone by then."""
    scenes = [load_scene("t_handle", {"mass": mass, "string.attached": True}) for mass in (0.1, 0.2, 0.3, 0.4)]
    mesh = tmp_path / "open.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n")
    scenes.append(load_scene("t_handle", {"mesh": str(mesh), "mesh_fallback": "hull", "ghost.integrator": "rk4"}))
    mesh.unlink()
    flown = [reached(scene) for scene in scenes]
    assert list(fly_all(reached, scenes, workers=2)) == flown
    assert len(set(flown)) == 5


@pytest.mark.parametrize("seconds", [float("nan"), float("inf"), 1e300, -1.0, "1", None])
def test_a_step_that_is_no_time_is_refused(seconds) -> None:
    flight = Flight(load_scene("t_handle"))
    with pytest.raises(InputError, match=r"step: .*seconds from 0"):
        flight.step(seconds)
    assert flight.step(-1e-17).time_ns == 0 and flight.step(0.1).time_ns == 100_000_000


def test_simulated_time_ends_where_that_of_commands_does() -> None:
    """Beyond 146 years it would be later than never."""
    flight = Flight(load_scene("t_handle", {"initial.angular_velocity": [0.0, 0.0, 0.0]}))
    assert flight.step(1e9).time_ns == 10**18
    with pytest.raises(InputError, match=r"ends by 1e\+09 s"):
        flight.step(1.0)
    assert flight.step(0.0).time_ns == 10**18


@pytest.mark.parametrize("entry", ["hello", None, [{"force": [0.0, 0.0, 1.0]}]])
def test_a_command_that_is_no_entry_is_refused(entry) -> None:
    with pytest.raises(InputError, match="command: .*a mapping such as"):
        Flight(load_scene("t_handle")).command(entry)


def test_a_flight_that_was_reset_flies_as_a_new_one_and_a_command_read_once_as_its_entry() -> None:
    scene = load_scene("t_handle")
    entries = [
        {"t": 0.3, "at": "tip", "force": [0.05, 0, 0]},
        {"set": {"mass": 0.3}, "t": 0.5},
        {"impulse": [0, 0, 1e-3]},
    ]
    read = [read_command(entry) for entry in entries]
    again = Flight(scene)
    for other in (scene, scene.with_changes({"mass": 0.2, "string.attached": True}), scene):
        again.reset(other)
        new = Flight(other)
        for entry, command in zip(entries, read, strict=True):
            new.command(entry)
            again.command(command)
        assert again.sample().time_ns == 0
        assert again.step(2.0).row.tobytes() == new.step(2.0).row.tobytes()
    # What was commanded is dropped.
    again.command({"t": 5.0, "force": [1, 0, 0]})
    again.reset(scene)
    assert again.step(6.0).row.tobytes() == Flight(scene).step(6.0).row.tobytes()


def test_each_run_of_a_flight_that_is_reset_is_recorded_and_verified(tmp_path) -> None:
    pytest.importorskip("mcap")
    from rigid_proto_ros.session.bag import read_runs

    path, poke = tmp_path / "s.mcap", read_command({"t": 0.1, "at": "tip", "force": [0.05, 0, 0]})
    with Flight(load_scene("t_handle"), record=path) as flight:
        for number in range(3):
            flight.command(poke)
            flight.step(0.5)
            if number < 2:
                flight.reset(load_scene("t_handle", {"mass": 0.1 + number}))
    assert [len(run.times) for run in read_runs(path)] == [51, 51, 51]
    assert main(["replay", str(path), "--verify"]) == 0


@pytest.mark.parametrize("number", range(3))
def test_what_the_document_shows_runs_as_it_stands(tmp_path, monkeypatch, capsys, number) -> None:
    pytest.importorskip("mcap")
    document = Path(__file__).parents[2] / "docs" / "python.md"
    if not document.is_file():
        pytest.skip("the documents are in a source tree")
    shown = re.findall(r"^```python\n(.*?)^```", document.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    assert len(shown) == 3
    monkeypatch.chdir(tmp_path)
    exec(compile(shown[number], str(document), "exec"), {})
    printed = capsys.readouterr().out.split()
    if number == 2:
        assert float(printed[-1]) == pytest.approx(0.125, abs=1e-6)  # 0.05 N for 50 ms, and 2 cm/s
    assert printed
