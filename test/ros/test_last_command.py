# SPDX-License-Identifier: MIT
"""The last command sent is the one that holds, paused or running, however fast it follows the one before."""

import pytest
from command_rig import Commanded, stamp_ns, wrench_message
from conftest import held_domain

MS = 10**6
PUSH = (1.0, 0.0, 0.0)
LESS = (0.3, 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)
SCENE = {
    "mesh": "",
    "inertia_model": "explicit",
    "explicit_inertia.mass": 1.0,
    "explicit_inertia.tensor": [1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
    "wrench_timeout": 0.0,
    "publish_rate": 200.0,
    "thrusters.a": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
}


@pytest.fixture(scope="module")
def kilogram(ros_environment, tmp_path_factory):
    """A node that flies 1 kg and holds wrenches for ever."""
    with held_domain() as domain:
        folder = tmp_path_factory.mktemp("kilogram")
        rig = Commanded({**ros_environment, "ROS_DOMAIN_ID": str(domain)}, folder, scene=SCENE)
        rig.advertise("thrusters")
        yield rig
        rig.close()


def acceleration(rig) -> float:
    """Along x [m/s²] over the newest states heard, all from after the last command has acted."""
    rig.until_received(rig.sent)
    acted_ns = int(rig.diagnostics()["sim_time_ns"]) + 100 * MS
    rig.until(lambda: rig.now_ns() > acted_ns + 100 * MS, "states after it")
    first, *_, last = rig.heard("twist", last=10)
    gained = last["twist"]["linear"]["x"] - first["twist"]["linear"]["x"]
    return round(gained / (1e-9 * (stamp_ns(last) - stamp_ns(first))), 6)


@pytest.mark.parametrize("forces", [(PUSH, ZERO), (PUSH, LESS), (ZERO, LESS), (LESS, ZERO, PUSH)])
def test_paused_the_last_wrench_acts_at_the_step(kilogram, forces):
    kilogram.start_over(paused=True)
    kilogram.publish("wrench", *(wrench_message(0, "world", force) for force in forces))
    kilogram.until_received(kilogram.sent)
    assert kilogram.trigger("step")["success"]
    _, twist = kilogram.state_at(5 * MS)
    assert twist["twist"]["linear"]["x"] == pytest.approx(5e-3 * forces[-1][0], rel=1e-12)


@pytest.mark.parametrize("forces", [(PUSH, ZERO), (PUSH, LESS)])
def test_running_the_last_of_two_wrenches_back_to_back_acts(kilogram, forces):
    kilogram.start_over(paused=False)
    for _ in range(20):
        kilogram.publish("wrench", *(wrench_message(0, "world", force) for force in forces))
        assert acceleration(kilogram) == pytest.approx(forces[-1][0], abs=1e-5)


def test_a_controller_at_1_khz_whose_last_message_is_zero_leaves_nothing_acting(kilogram):
    kilogram.start_over(paused=False)
    for _ in range(5):
        messages = [wrench_message(0, "world", (0.1 + 0.001 * k, 0.0, 0.0)) for k in range(100)]
        kilogram.do("publish", topic=kilogram.name("wrench"), messages=[*messages, wrench_message(0, "")], rate=1000.0)
        kilogram.sent += len(messages) + 1
        assert acceleration(kilogram) == 0.0


def test_thrusters_that_are_switched_on_and_off_at_once_are_off(kilogram):
    kilogram.start_over(paused=False)
    for _ in range(5):
        Commanded.publish(kilogram, "thrusters", {"data": [1.0]}, {"data": [0.0]})
        kilogram.sent += 2
        assert acceleration(kilogram) == 0.0
