# SPDX-License-Identifier: MIT
"""Frames that are fixed to the body go out on /tf_static.

tf2_msgs isn't in the wheels: its one message stands in, and a node that only makes publishers.
"""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.simulation import Simulation


def test_mesh_and_contacts_go_out_at_the_body(monkeypatch) -> None:
    from rigid_proto_ros.ros.event_publisher import FramesOnBody

    messages = SimpleNamespace(TFMessage=lambda transforms: SimpleNamespace(transforms=transforms))
    monkeypatch.setitem(sys.modules, "tf2_msgs", SimpleNamespace(msg=messages))
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", messages)
    published = []
    node = SimpleNamespace(create_publisher=lambda *_, **__: SimpleNamespace(publish=published.append))
    setup = make_scenario({"mesh": "hammer", "scale": 2.0, "contacts.face": [0.1, 0.0, 0.3]}).setup
    FramesOnBody(node, "base_link", setup.contacts).publish((0, 7), Simulation(setup).snapshot())
    sent = {t.child_frame_id: t for t in published[0].transforms}
    assert set(sent) == {"base_link/mesh", "base_link/face"}
    assert {t.header.frame_id for t in sent.values()} == {"base_link"}
    face = sent["base_link/face"].transform.translation
    assert [face.x, face.y, face.z] == pytest.approx(setup.body.point((0.1, 0.0, 0.3)).tolist(), abs=1e-15)
    mesh = sent["base_link/mesh"].transform.translation
    assert [mesh.x, mesh.y, mesh.z] == (-setup.body.center_of_mass).tolist()
