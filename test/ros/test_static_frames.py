# SPDX-License-Identifier: MIT
"""Frames that are fixed to body or world: the node's own go out, and a wrench in anybody's is the one it stands for.

tf2_msgs isn't in the wheels: its one message stands in, and a node that only makes publishers and subscriptions.
"""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")

from geometry_msgs.msg import TransformStamped

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.loads import resolve_load
from rigid_proto_ros.ros.pacing import Stamps
from rigid_proto_ros.scene.command_codec import frame_names
from rigid_proto_ros.scene.parameters import Parameters
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.simulation import Simulation

HALF = 0.5**0.5


def link(parent: str, child: str, origin=(0.0, 0.0, 0.0), attitude=(0.0, 0.0, 0.0, 1.0)) -> TransformStamped:
    transform = TransformStamped()
    transform.header.frame_id, transform.child_frame_id = parent, child
    t, q = transform.transform.translation, transform.transform.rotation
    t.x, t.y, t.z = origin
    q.x, q.y, q.z, q.w = attitude
    return transform


@pytest.fixture
def static(monkeypatch):
    """The frames of a scaled body with a contact; what was published; and a way to be told of others' frames."""
    from rigid_proto_ros.ros.static_frames import StaticFrames

    messages = SimpleNamespace(TFMessage=lambda transforms: SimpleNamespace(transforms=transforms))
    monkeypatch.setitem(sys.modules, "tf2_msgs", SimpleNamespace(msg=messages))
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", messages)
    published, heard = [], []
    node = SimpleNamespace(
        create_publisher=lambda *_, **__: SimpleNamespace(publish=published.append),
        create_subscription=lambda _type, _topic, callback, _qos: heard.append(callback),
    )
    scenario = make_scenario({"mesh": "hammer", "scale": 2.0, "contacts.face": [0.1, 0.0, 0.3]})
    frames = StaticFrames(node, ("odom", "base_link"), scenario.setup.contacts, Stamps())
    return frames, scenario.setup, published, lambda *links: heard[0](SimpleNamespace(transforms=list(links)))


def test_mesh_and_contacts_go_out_at_the_body_and_again_when_it_changes(static) -> None:
    frames, setup, published, _ = static
    simulation = Simulation(setup)
    frames.body_changed(7, simulation.snapshot())
    sent = {t.child_frame_id: t for t in published[0].transforms}
    assert set(sent) == {"base_link/mesh", "base_link/face"}
    assert {t.header.frame_id for t in sent.values()} == {"base_link"}
    face = sent["base_link/face"].transform.translation
    assert [face.x, face.y, face.z] == pytest.approx(setup.body.point((0.1, 0.0, 0.3)).tolist(), abs=1e-15)
    mesh = sent["base_link/mesh"].transform.translation
    assert [mesh.x, mesh.y, mesh.z] == (-setup.body.center_of_mass).tolist()


def test_a_wrench_in_a_frame_fixed_to_the_body_is_the_same_wrench_in_body_axes(static) -> None:
    frames, setup, _, hear = static
    # A flange turned a quarter about z, and a tool on it turned a quarter about x.
    hear(link("base_link", "flange", (0.0, 0.2, 0.0), (0.0, 0.0, HALF, HALF)))
    hear(link("flange", "tool", (0.1, 0.0, 0.0), (HALF, 0.0, 0.0, HALF)))
    read = frames.read("tool;duration=0.5", setup.body, (1.0, 2.0, 3.0), (0.0, 0.0, 4.0))
    # Tool y is flange z, tool z is flange -y; flange x is body y, flange y is body -x.
    assert read.force == pytest.approx((3.0, 1.0, 2.0)) and read.torque == pytest.approx((4.0, 0.0, 0.0))
    assert read.frame.axes == "body" and read.frame.duration_s == 0.5
    load = resolve_load(read.frame, read.force, read.torque, setup.body, setup.surface, {}, None)
    assert load.arm(setup.body) == pytest.approx(np.array([0.0, 0.3, 0.0]), abs=1e-12)


def test_a_frame_fixed_to_the_world_gives_its_axes(static) -> None:
    frames, setup, _, hear = static
    hear(link("odom", "table", (5.0, 0.0, 0.0), (0.0, 0.0, HALF, HALF)))
    read = frames.read("table", setup.body, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert read.frame_id == "world@com" and read.force == pytest.approx((0.0, 1.0, 0.0))


def test_a_frame_that_is_fixed_to_neither_is_refused(static) -> None:
    frames, setup, _, hear = static
    hear(link("a", "b"), link("b", "a"), link("moon", "crater"))
    for name, said in (("crater", "fixed|fixes"), ("unheard", "fixes"), ("a", "chain")):
        with pytest.raises(CommandRefused, match=said):
            frames.read(name, setup.body, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_one_setting_names_the_frames_as_rep_105_does() -> None:
    assert frame_names(Parameters(), "lab/drone") == ("world", "drone")
    assert frame_names(Parameters(frames="rep105"), "lab/drone") == ("odom", "base_link")
    assert frame_names(Parameters(frames="rep105", world_frame="map", body_frame="tool"), "drone") == ("map", "tool")
