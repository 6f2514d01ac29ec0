# SPDX-License-Identifier: MIT
"""Parameters of a simulation without ROS change as the node's do."""

from __future__ import annotations

from flights import SECOND

from rigid_proto_ros.scene.offline import OfflineRun
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.simulation.observer import Observer, Refused, SceneChanged

SCRIPT = """
- {t: 0.0, at: com, torque: [0.1, 0.0, 0.0], duration: 1.0}
- {t: 0.5, set: {integrator: free_body}}
- {t: 2.0, set: {gravity: [0.0, 0.0, -1.0]}}
"""


class Scenes(Observer):
    """Notes the scenes that it is told, and what is refused."""

    def __init__(self) -> None:
        self.scenes: list[str] = []
        self.refusals: list[str] = []

    takes = frozenset({SceneChanged, Refused})

    def on(self, event) -> None:
        if isinstance(event, SceneChanged):
            self.scenes.append(event.scene)
        elif isinstance(event, Refused):
            self.refusals.append(event.reason)


def test_a_change_refused_when_it_acts_leaves_the_scene_as_it_is_for_those_after_it() -> None:
    scenes = Scenes()
    run = OfflineRun(make_scenario({"ghost.inertia_model": "bounding_box"}), parse_script(SCRIPT), scenes)
    assert run.advance(3 * SECOND)
    assert scenes.refusals == ["integrator"]
    assert run.scenario.parameters.integrator == run.simulation.setup.integrator.name == "auto"
    assert run.simulation.state.linear_velocity[2] == -1.0
    assert len(scenes.scenes) == 1 and "free_body" not in scenes.scenes[0]
    assert run.ghost is not None and run.ghost.simulation.setup.integrator.name == "auto"


def test_a_step_is_rounded_to_the_nearest_nanosecond() -> None:
    for step_s, step_ns in ((1e-3 + 4e-10, 1_000_000), (1e-3 + 6e-10, 1_000_001), (2e-9, 2), (1.4e-9, 1)):
        assert make_scenario({"step": step_s}).setup.step_ns == step_ns
