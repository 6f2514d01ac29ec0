# SPDX-License-Identifier: MIT
"""The string as commands and parameters tie it, move it, change it and let it go."""

import math

import numpy as np
import pytest
import trimesh
from flights import SECOND, StringSettings, flight
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.motion.string import free_end_at
from rigid_proto_ros.scene.command_codec import of_event
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.commands import Change, ClearWrench, MoveString, ReleaseString, TieString
from rigid_proto_ros.simulation.simulation import Simulation

SCENE = {
    "mesh": "t_handle",
    "density": 7850.0,
    "scale": [2.0, 1.0, 1.5],
    "integrator": "rk4",
    "initial.position": [0.2, -0.1, 0.3],
    "initial.orientation_xyzw": [0.2, -0.4, 0.4, 0.8],
    "initial.angular_velocity": [0.5, -2.0, 3.0],
    "string.stiffness": 3.0,
    "string.timeout": 0.4,
}
MS = 1_000_000


def simulated(**changes) -> tuple[Simulation, object]:
    scenario = make_scenario({**SCENE, **{n.replace("__", "."): v for n, v in changes.items()}})
    return Simulation(scenario.setup), scenario


def effective_mass(body, arm, direction) -> float:
    """1/m_eff = 1/m + (r × n)ᵀ I⁻¹ (r × n), by plain linear algebra."""
    lever = np.cross(arm, direction)
    return 1.0 / (1.0 / body.mass + lever @ np.linalg.solve(body.inertia, lever))


def test_the_first_target_ties_and_is_taken_at_once():
    simulation, _ = simulated()
    assert simulation.string is None
    simulation.submit(MoveString((1.0, 2.0, 3.0)), 100 * MS)
    simulation.advance(100 * MS)
    assert simulation.string is None
    simulation.advance(101 * MS)
    assert simulation.string.free_end(101 * MS).tolist() == [1.0, 2.0, 3.0]
    assert simulation.string.free_end(200 * MS).tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(("after_ms", "ramp_ms"), [(20, 20), (250, 100)])
def test_the_free_end_goes_evenly_over_the_time_since_the_last_target_at_most_a_tenth_of_a_second(after_ms, ramp_ms):
    simulation, _ = simulated()
    simulation.submit(MoveString((0.0, 0.0, 1.0)), 0)
    simulation.submit(MoveString((0.3, -0.6, 1.0)), after_ms * MS)
    # A target in mid-ramp starts from where the free end is.
    half_ns = (after_ms + ramp_ms // 2) * MS
    turned, _ = simulated()
    for at_ns, target in ((0, (0.0, 0.0, 1.0)), (after_ms * MS, (0.3, -0.6, 1.0)), (half_ns, (0.0, 0.0, 2.0))):
        turned.submit(MoveString(target), at_ns)
    turned.advance(half_ns + 1)
    assert turned.string.origin == pytest.approx([0.15, -0.3, 1.0], abs=1e-15)
    for fraction in (0.25, 0.5, 0.75, 1.0, 1.5):
        time_ns = round((after_ms + fraction * ramp_ms) * MS)
        simulation.advance(time_ns)
        done = min(fraction, 1.0)
        assert simulation.string.free_end(time_ns) == pytest.approx([0.3 * done, -0.6 * done, 1.0], abs=1e-15)
        speed = 0.0 if fraction >= 1.0 else 1.0 / (ramp_ms * 1e-3)
        tied = simulation.string
        _, velocity = free_end_at(time_ns, tied.origin, tied.target, tied.begin_ns, tied.end_ns)
        assert velocity == pytest.approx([0.3 * speed, -0.6 * speed, 0.0], abs=1e-12)


def test_it_lets_go_the_timeout_after_the_last_target_and_not_before():
    """To the nanosecond: 0.4 s after the last of three."""
    simulation, _ = simulated()
    for start in (0, 100, 350):
        simulation.submit(MoveString((0.0, 0.0, 1.0)), start * MS)
    simulation.advance(750 * MS)
    assert simulation.string is not None
    before = simulation.angular_momentum
    simulation.advance(750 * MS + 1)
    assert simulation.string is None
    simulation.advance(2 * SECOND)
    # Free from then on.
    assert np.abs(simulation.angular_momentum - before).max() <= 1e-9 * np.abs(before).max()


@pytest.mark.parametrize(
    ("attached", "timeout_s", "change", "release_ms"),
    [
        (False, 0.0, {"string.timeout": 2.0}, 2000),
        (False, 0.0, {"string.timeout": 0.5}, 1000),
        (False, 1.5, {"string.timeout": 2.0}, 2000),
        (False, 1.5, {"string.timeout": 0.0}, None),
        (False, 1.5, {"string.target": [0.0, 0.1, 1.0]}, 2500),
        (False, 1.5, {"string.target": [0.0, 0.1, 1.0], "string.timeout": 0.5}, 1500),
        (False, 0.0, {"string.target": [0.0, 0.1, 1.0]}, None),
        (True, 1.5, {"string.target": [0.0, 0.1, 1.0]}, None),
        (True, 1.5, {"string.timeout": 0.5}, None),
        (False, 0.0, {}, None),
        (True, 1.5, {}, None),
    ],
)
def test_a_string_tied_by_hand_keeps_a_timeout_when_parameters_change_and_one_tied_by_them_has_none(
    attached, timeout_s, change, release_ms
):
    """Its last target comes at 0, the change at 1 s; clear_wrench in between is nothing to it."""
    simulation, scenario = simulated(string__timeout=timeout_s, string__attached=attached)
    if not attached:
        simulation.submit(MoveString((0.0, 0.0, 1.0)), 0)
    simulation.submit(ClearWrench(), SECOND // 2)
    simulation.submit(Change({}, lambda: scenario.with_changes(change).setup), SECOND)
    for time_ms in (1000, 1500, 2000, 2500, 5000):
        simulation.advance(time_ms * MS)
        assert simulation.string is not None
        simulation.advance(time_ms * MS + 1)
        if time_ms == release_ms:
            assert simulation.string is None
            return
        assert simulation.string is not None
    assert release_ms is None


def test_a_string_that_a_reset_ties_again_counts_for_the_integrator_though_it_was_let_go():
    simulation, scenario = simulated(string__attached=True, string__target=[0.0, 0.0, 1.0])
    simulation.submit(ReleaseString(), 100 * MS)
    simulation.advance(SECOND)
    with pytest.raises(CommandRefused, match="free_body"):
        simulation.check_change(scenario.with_changes({"integrator": "free_body"}).setup)
    simulation.check_change(scenario.with_changes({"integrator": "free_body", "string.attached": False}).setup)


def test_a_string_that_a_reset_ties_again_is_not_too_fast_there_wherever_its_knot_is_now():
    """Near the centre of mass it would swing at 4e5 rad/s or little more, at the knot of the reset beyond the limit."""
    tied = {"string__attached": True, "string__attach": [0.0, 0.0, 0.07], "string__target": [0.0, 0.0, 1.0]}
    simulation, scenario = simulated(integrator="auto", string__damping_ratio=0.0, **tied)
    mass, body = scenario.setup.body.mass, scenario.setup.body
    simulation.submit(TieString("mesh", tuple(body.mesh_point((0.0, 0.0, 0.0)).tolist())))
    simulation.advance(SECOND // 100)
    with pytest.raises(CommandRefused, match="string.stiffness"):
        simulation.check_change(scenario.with_changes({"string.stiffness": mass * 4e5**2}).setup)


@pytest.mark.parametrize("frame", ["", "rigid_body", "body/mesh"])
def test_the_knot_is_the_nearest_point_of_the_surface_as_it_is_then(frame):
    """In world, body (metres from the COM) and mesh coordinates, against trimesh's closest points: 1e-12."""
    simulation, scenario = simulated(string__timeout=0.0)
    mesh_point = np.array([0.011, 0.06, 0.09])
    state = Simulation(scenario.setup).advance(300 * MS)
    body = scenario.setup.body
    from_com = mesh_point * np.array(SCENE["scale"]) - body.center_of_mass
    points = {"mesh": mesh_point, "body": from_com, "world": state.position + state.rotation @ from_com}
    word = "mesh" if frame.endswith("/mesh") else "body" if "body" in frame else "world"
    knot = {"frame_id": frame, "point": points[word].tolist()}
    simulation.submit(of_event("string_attach", knot, ("world", "rigid_body")), 300 * MS)
    simulation.submit(MoveString((0.0, 0.0, 1.0)), 301 * MS)
    simulation.advance(302 * MS)
    surface = scenario.setup.surface
    triangles = surface.vertices[surface.triangles]
    candidates = trimesh.triangles.closest_point(triangles, np.tile(mesh_point, (len(triangles), 1)))
    nearest = candidates[np.argmin(np.linalg.norm(candidates - mesh_point, axis=1))]
    assert simulation.string.attach == pytest.approx(nearest, abs=1e-12)
    # And it lies elsewhere than it was asked for.
    assert np.linalg.norm(nearest - mesh_point) > 1e-3


def test_moving_the_knot_of_a_tied_string_keeps_it_tied_with_another_effective_mass():
    simulation, _ = simulated(string__frequency=20.0, string__timeout=0.0)
    simulation.submit(MoveString((0.0, 0.0, 1.0)), 0)
    simulation.submit(TieString("mesh", (0.0, 0.05, 0.0)), 100 * MS)
    simulation.advance(100 * MS)
    first = simulation.string
    simulation.advance(100 * MS + 1)
    second = simulation.string
    assert second.attach != first.attach
    assert second.free_end(100 * MS).tolist() == first.free_end(100 * MS).tolist()
    assert second.stiffness == pytest.approx(second.effective_mass * 400.0, rel=1e-12)
    assert second.effective_mass != first.effective_mass


@pytest.mark.parametrize("frequency", [0.0, 25.0])
def test_stiffness_or_frequency_with_the_damping_ratio_give_k_and_c_from_the_effective_mass_and_hold_them(frequency):
    changes = {"string__frequency": frequency, "string__damping_ratio": 0.7, "string__attached": True}
    simulation, scenario = simulated(**changes, string__attach=[0.0, 0.05, 0.0], string__target=[0.3, 0.2, 1.0])

    def expected(state: State) -> list[float]:
        """k and c of the body as it is, in this state."""
        body = simulation.setup.body
        arm = np.array([0.0, 0.05, 0.0]) * SCENE["scale"] - body.center_of_mass
        away = state.position + state.rotation @ arm - [0.3, 0.2, 1.0]
        mass = effective_mass(body, arm, state.rotation.T @ away / np.linalg.norm(away))
        k = mass * frequency**2 if frequency else SCENE["string.stiffness"]
        return [k, 2 * 0.7 * math.sqrt(k * mass)]

    first = expected(simulation.state)
    for time_ns in (0, SECOND):
        simulation.advance(time_ns)
        assert [simulation.string.stiffness, simulation.string.damping] == pytest.approx(first, rel=1e-12)
    # A change of the body takes them anew, for the body as it is then.
    simulation.submit(Change({}, lambda: scenario.with_changes({"mass": 5.0}).setup))
    then = simulation.state
    simulation.advance(SECOND + 1)
    assert [simulation.string.stiffness, simulation.string.damping] == pytest.approx(expected(then), rel=1e-12)


UNTOUCHED = (
    *({"publish_rate": 50.0}, {"gravity": [0.0, 0.0, -9.81]}, {"wrench_timeout": 2.0}, {"density": SCENE["density"]}),
    *({"string.timeout": 7.0}, {"string.target": [0.1, 0.0, 1.0]}),
)
"""Changes that leave body and spring as they are."""


@pytest.mark.parametrize(
    ("change", "anew"),
    [(change, False) for change in UNTOUCHED]
    + [({"density": 7000.0}, True), ({"scale": [1.0, 1.0, 2.0]}, True), ({"string.attach": [0.01, 0.0, 0.0]}, True)]
    + [({f"string.{name}": value}, True) for name, value in {"damping_ratio": 0.2, "frequency": 8.0}.items()],
)
def test_the_effective_mass_is_computed_anew_when_body_or_string_changes_and_not_with_other_parameters(change, anew):
    simulation, scenario = simulated(string__attached=True, string__attach=[0.0, 0.05, 0.0], string__damping_ratio=0.7)
    simulation.advance(SECOND)
    before = simulation.string
    simulation.submit(Change({}, lambda: scenario.with_changes(change).setup))
    simulation.advance(SECOND + 1)
    after = simulation.string
    assert (after.effective_mass != before.effective_mass) is anew
    assert anew or (after.stiffness, after.damping) == (before.stiffness, before.damping)


def test_with_a_frequency_a_nut_and_a_satellite_are_pulled_alike():
    """The same relative motion for bodies of 1e-3 and 1e6 kg of one shape: 1e-9."""
    ends = []
    for mass in (1e-3, 1e6):
        simulation, _ = simulated(
            mass=mass, string__frequency=12.0, string__attached=True, string__attach=[0.0, 0.05, 0.0]
        )
        ends.append(simulation.advance(2 * SECOND).row)
    assert np.abs(ends[0] - ends[1]).max() <= 1e-9


@pytest.mark.parametrize("released", [True, False], ids=["released", "detached by its parameter"])
def test_a_string_that_was_let_go_is_tied_again_by_the_next_target(released):
    simulation, scenario = simulated(string__attached=True, string__target=[0.0, 0.0, 1.0])
    detached = Change({}, lambda: scenario.with_changes({"string.attached": False}).setup)
    simulation.submit(ReleaseString() if released else detached, 100 * MS)
    simulation.advance(101 * MS)
    assert simulation.string is None
    simulation.submit(MoveString((0.5, 0.0, 0.0)), 200 * MS)
    simulation.advance(201 * MS)
    assert simulation.string.free_end(201 * MS).tolist() == [0.5, 0.0, 0.0]


AT_KNOT = {"mesh": "", "inertia_model": "explicit", "string__target": SCENE["initial.position"]}
"""The free end is where the knot is."""


@pytest.mark.parametrize(("rest_length", "bilateral"), [(0.0, True), (0.5, False), (0.5, True)])
def test_without_a_mesh_the_knot_is_where_it_was_asked_for_and_at_the_free_end_no_singularity(rest_length, bilateral):
    simulation, _ = simulated(
        **AT_KNOT, string__attached=True, string__rest_length=rest_length, string__bilateral=bilateral
    )
    simulation.advance(MS)
    assert not simulation.failure and simulation.state.linear_velocity.tolist() == [0.0, 0.0, 0.0]
    simulation.submit(TieString("mesh", (1.0, 2.0, 3.0)))
    simulation.advance(2 * MS)
    assert simulation.string.attach == (1.0, 2.0, 3.0)
    assert np.isfinite([simulation.potential_energy, simulation.hand_work, simulation.string_heat]).all()


@pytest.mark.parametrize("away", [0.0, 1e-14, 1e-11])
def test_a_string_that_pushes_is_not_tied_where_it_has_no_direction(away):
    """Where steps are chosen: at the start, by parameters, by a target and by a knot; the motion goes on as if nobody had
    tried.
    """
    pushing = {**AT_KNOT, "integrator": "auto", "string__rest_length": 0.5, "string__bilateral": True}
    place = np.array(SCENE["initial.position"]) + [away, 0.0, 0.0]
    pushing["string__target"] = place.tolist()
    moving = {"initial.linear_velocity": [0.0, 1.0, 0.0]}
    with pytest.raises(CommandRefused, match="string target: got .* a target away from the knot"):
        simulated(**pushing, **moving, string__attached=True)
    simulation, scenario = simulated(**pushing, **moving)
    with pytest.raises(CommandRefused, match="away from the knot"):
        simulation.check_change(scenario.with_changes({"string.attached": True}).setup)
    simulation.submit(MoveString(tuple(place)))
    simulation.advance(MS)
    assert simulation.string is None and simulation.refused["integrator"] == 1
    far = tuple(simulation.state.position + [0.0, 0.0, 1.0])
    simulation.submit(MoveString(far))
    simulation.advance(2 * MS)
    knot = simulation.string.attach
    simulation.submit(TieString("world", far))
    simulation.advance(3 * MS)
    assert simulation.string.attach == knot and simulation.refused["integrator"] == 2 and not simulation.failure


def test_the_last_bit_of_a_body_does_not_decide_whether_its_string_is_computed_anew():
    """The same mass by another way: a stiffness that goes by the effective mass, which has changed with the attitude."""
    simulation, scenario = simulated(string__frequency=5.0)
    simulation.submit(MoveString((1.0, 2.0, 3.0)))
    simulation.advance(100 * MS)
    before, mass = simulation.string.stiffness, scenario.setup.body.mass
    for changed in (mass, np.nextafter(mass, np.inf).item(), np.nextafter(mass, 0.0).item()):
        after = scenario.with_changes({"mass": changed})
        simulation.submit(Change({}, lambda after=after: after.setup))
        simulation.act()
        assert simulation.string.stiffness == before
    after = scenario.with_changes({"mass": mass * (1 + 1e-9)})
    simulation.submit(Change({}, lambda: after.setup))
    simulation.act()
    assert simulation.string.stiffness != before


@given(
    st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1), st.sampled_from([0.0, 1.0, 1e3])
)
@settings(deadline=None, max_examples=30)
def test_a_span_that_is_rounding_alone_gives_the_effective_mass_no_direction(attitude, far):
    """The mean of 1/m_eff over all directions."""
    body, arm = make_body(2.0, np.zeros(3), np.diag([0.02, 0.03, 0.04])), np.array([0.1, 0.15, 0.2])
    mean = sum(1.0 / effective_mass(body, arm, n) for n in np.eye(3)) / 3.0
    q, target = np.array(attitude) / np.linalg.norm(attitude), far * np.array([0.3, -0.7, 1.1])
    row = [*(target - matrix_from_quaternion(q) @ arm), *q, *np.zeros(6)]
    string = flight(body, initial=row, string=StringSettings(True, tuple(arm), tuple(target))).string
    assert string.effective_mass == pytest.approx(1.0 / mean, rel=1e-12)


def test_reset_ties_the_string_as_its_parameters_say():
    for attached in (False, True):
        simulation, _ = simulated(string__attached=attached, string__target=[0.0, 0.0, 1.0])
        simulation.submit(TieString("mesh", (0.0, 0.05, 0.0)))
        simulation.submit(MoveString((1.0, 1.0, 1.0)))
        simulation.advance(SECOND // 10)
        assert simulation.string is not None
        simulation.reset()
        assert (simulation.string is not None) == attached
        if attached:
            assert simulation.string.free_end(0).tolist() == [0.0, 0.0, 1.0]
            assert simulation.string.attach == (0.0, 0.0, 0.0)
        assert simulation.hand_work == 0.0


@pytest.mark.parametrize(
    ("kind", "frame", "point", "reason"),
    [
        ("string_target", "body", (0, 0, 0), "frame"),
        ("string_target", "world", (math.nan, 0, 0), "nonfinite"),
        ("string_target", "world", (1e101, 0, 0), "magnitude"),
        ("string_attach", "body/mesh/", (0, 0, 0), "frame"),
        ("string_attach", "body", (0, 0, -math.inf), "nonfinite"),
        ("string_attach", "body/mesh", (0, 0, 1e300), "magnitude"),
    ],
)
def test_odd_string_messages_are_refused_with_their_reason(kind, frame, point, reason):
    with pytest.raises(CommandRefused) as refused:
        of_event(kind, {"frame_id": frame, "point": point})
    assert refused.value.reason == reason


def test_a_target_that_would_pull_beyond_every_measure_is_refused_when_it_takes_effect():
    simulation, _ = simulated()
    simulation.submit(MoveString((0.0, 0.0, 1e20)))
    end = simulation.advance(SECOND)
    assert simulation.refused == {"magnitude": 1}
    untouched, _ = simulated()
    assert (end.row == untouched.advance(SECOND).row).all()


@pytest.mark.parametrize("rest_length", [0.0, 0.1])
@pytest.mark.parametrize("power", range(4, 100, 6))
def test_a_body_that_flies_too_fast_for_any_step_on_a_string_fails_in_bounded_work(power, rest_length):
    """Where no step of a nanosecond tells when the string's law changes, there is no end to shortening it."""
    values = {
        "string.attached": True,
        "string.rest_length": rest_length,
        "initial.linear_velocity": [0, 0, 10.0**power],
    }
    simulation = Simulation(make_scenario({"mesh": "t_handle", **values}).setup)
    simulation.advance(10_000)
    assert simulation.failure or simulation.steps <= 10_000
