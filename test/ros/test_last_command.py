# SPDX-License-Identifier: MIT
"""The last command sent is the one that holds, paused or running, however fast it follows the one before."""

import pytest
from command_rig import wrench_message
from ros_client import stamp_ns

MS = 10**6
PUSH = (1.0, 0.0, 0.0)
LESS = (0.3, 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)


@pytest.fixture
def kilogram(rig):
    """The node flies 1 kg, twice as fast as the clock, and holds wrenches for ever."""
    rig.set(mass=1.0, wrench_timeout=0.0, publish_rate=100.0, real_time_factor=2.0)
    return rig


def acceleration(rig) -> float:
    """Along x [m/s²] over states from after the last command has acted."""
    rig.until_received(rig.sent)
    acted_ns = int(rig.diagnostics()["sim_time_ns"]) + 100 * MS
    first, *_, last = rig.until(lambda: len(m := rig.heard("twist", after=acted_ns)) >= 5 and m, "five later twists")
    gained = last["twist"]["linear"]["x"] - first["twist"]["linear"]["x"]
    return round(gained / (1e-9 * (stamp_ns(last) - stamp_ns(first))), 6)


@pytest.mark.parametrize("forces", [(PUSH, ZERO), (LESS, ZERO, PUSH)])
def test_paused_the_last_wrench_acts_at_the_step(kilogram, forces):
    kilogram.start_over(paused=True)
    kilogram.publish("wrench", *(wrench_message(0, "world", force) for force in forces))
    kilogram.until_received(kilogram.sent)
    assert kilogram.trigger("step")["success"]
    _, twist = kilogram.state_at(10 * MS)
    assert twist["twist"]["linear"]["x"] == pytest.approx(1e-2 * forces[-1][0], rel=1e-12)


@pytest.mark.parametrize("list_first", [True, False])
def test_paused_a_parameter_set_to_its_present_value_holds_after_a_list_that_waits(kilogram, list_first):
    kilogram.start_over(paused=True)
    if not list_first:
        kilogram.set(gravity=[0.0, 0.0, 0.0])
    kilogram.schedule("[{t: 0, set: {gravity: [0, 0, -5]}}]")
    kilogram.until_received(kilogram.sent)
    if list_first:
        kilogram.set(gravity=[0.0, 0.0, 0.0])
    assert kilogram.trigger("step")["success"]
    _, twist = kilogram.state_at(10 * MS)
    assert twist["twist"]["linear"]["z"] == 0.0 and list(kilogram.get("gravity")["gravity"]) == [0.0, 0.0, 0.0]


def test_running_the_last_message_acts_however_fast_it_follows(kilogram):
    """Of two back to back, of a controller's at 1 kHz that ends with zero, and of thrusters on and off at once."""
    for forces in ((PUSH, ZERO), (PUSH, LESS)):
        for _ in range(5):
            kilogram.publish("wrench", *(wrench_message(0, "world", force) for force in forces))
            assert acceleration(kilogram) == pytest.approx(forces[-1][0], abs=1e-5)
    messages = [wrench_message(0, "world", (0.1 + 0.001 * k, 0.0, 0.0)) for k in range(100)]
    for _ in range(3):
        kilogram.publish("wrench", *messages, wrench_message(0, ""), rate=1000.0)
        assert acceleration(kilogram) == 0.0
        kilogram.publish("thrusters", {"data": [1.0]}, {"data": [0.0]})
        assert acceleration(kilogram) == 0.0
