# SPDX-License-Identifier: MIT
"""What robot people expect beside pose and twist: /tf, /tf_static and a marker."""

import json
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy")

from rclpy.serialization import deserialize_message
from visualization_msgs.msg import Marker

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.live.pacing import Stamps
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.parameters.declarations import Parameters
from rigid_proto_ros.ros import marker
from rigid_proto_ros.ros.marker import BodyMarker
from rigid_proto_ros.ros.publishers import StatePublisher
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.simulation.commands import Change


def test_the_transform_is_the_pose(monkeypatch):
    """tf2_msgs isn't in the wheels: its one message stands in, and a node that only makes publishers."""
    published, fixed = [], []

    def publisher(message_type, topic, *_, **__):
        sent = {"/tf": published.append, "/tf_static": fixed.append}.get(topic, lambda message: None)
        return SimpleNamespace(publish=sent, get_subscription_count=lambda: 1)

    messages = SimpleNamespace(TFMessage=lambda transforms: SimpleNamespace(transforms=transforms))
    monkeypatch.setitem(sys.modules, "tf2_msgs", SimpleNamespace(msg=messages))
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", messages)
    node = SimpleNamespace(create_publisher=publisher)
    states, run = (
        StatePublisher(node, ("world", "body"), Stamps()),
        OfflineRun(make_scenario({"contacts.tip": (0.0, 0.0, 0.07), "contacts.left": (0.0, -0.05, 0.0)})),
    )
    states.configure(Parameters(publish_tf=True))
    state = State(3_000_000_007, np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.9, 0, 0, 0, 0, 0, 0]))
    run.simulation.advance(state.time_ns)
    run.simulation._arrays.row[:] = state.row
    states.pack_all(run)
    assert not published
    assert states.find_subscribers()
    states.publish(run)
    states.configure(Parameters())
    states.find_subscribers()
    states.publish(run)
    ((transform,),) = (message.transforms for message in published)
    assert (transform.header.stamp.sec, transform.header.stamp.nanosec) == (3, 7)
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "body")
    t, r = transform.transform.translation, transform.transform.rotation
    assert [t.x, t.y, t.z, r.x, r.y, r.z, r.w] == state.row[:7].tolist()
    # Frames that messages name, once for a body, and again for another one.
    (once,) = fixed
    body, contacts = run.simulation.setup.body, run.simulation.setup.contacts
    places = {t.child_frame_id: t for t in once.transforms}
    assert places.keys() == {"body/mesh", *(f"body/{name}" for name in contacts)} and contacts
    for name, point in {"mesh": np.zeros(3), **contacts}.items():
        sent = places[f"body/{name}"]
        t, r = sent.transform.translation, sent.transform.rotation
        assert sent.header.frame_id == "body" and (r.x, r.y, r.z, r.w) == (0, 0, 0, 1)
        assert [t.x, t.y, t.z] == body.point(point).tolist()
    run.submit([Change({"scale": (2.0,)})])
    run.advance(run.simulation.time_ns + 1)
    states.configure(Parameters(publish_tf=True))
    states.find_subscribers()
    states.publish(run)
    moved = {t.child_frame_id: t.transform.translation for t in fixed[-1].transforms}
    assert len(fixed) == 2 and moved["body/tip"].z == pytest.approx(2 * places["body/tip"].transform.translation.z)


def marked_at(data: bytes) -> tuple[Marker, np.ndarray]:
    """A marker, and its corners (n, 3) in the world."""
    marker = deserialize_message(data, Marker)
    p, q = marker.pose.position, marker.pose.orientation
    turned = matrix_from_quaternion(np.array([q.x, q.y, q.z, q.w]))
    corners = np.array([[c.x, c.y, c.z] for c in marker.points]).reshape(-1, 3)
    return marker, corners @ turned.T + [p.x, p.y, p.z]


def test_the_marker_is_the_mesh_at_its_pose_and_names_the_file_of_a_large_one(monkeypatch):
    monkeypatch.setattr(marker, "PERIOD_S", 0.0)
    run = OfflineRun(
        make_scenario(
            {"scale": (1.0, 2.0, 0.5), "gravity": (0.0, 0.0, -1.0), "initial.angular_velocity": (1.0, 2.0, 3.0)}
        )
    )
    run.advance(400_000_000)
    made, state = BodyMarker(("map", "lab/tool"), Stamps(offset_ns=5)), run.simulation.state
    told, corners = marked_at(made.message(run, state.time_ns, state.row.tolist()))
    stamp = told.header.stamp
    assert (told.header.frame_id, told.ns, stamp.sec, stamp.nanosec) == ("map", "lab/tool", 0, 400_000_005)
    assert (told.type, told.action, told.color.a) == (Marker.TRIANGLE_LIST, Marker.ADD, 1.0)
    body, mesh = run.simulation.setup.body, run.scenario.body_mesh.mesh
    world = state.position + (mesh.vertices * [1.0, 2.0, 0.5] - body.center_of_mass) @ state.rotation.T
    assert corners == pytest.approx(world[mesh.triangles.ravel()], abs=1e-15)
    # Of a large mesh its file, whose origin is where the mesh's is.
    monkeypatch.setattr(marker, "MOST_TRIANGLES", 10)
    told, _ = marked_at(BodyMarker(("map", "lab/tool"), Stamps()).message(run, state.time_ns, state.row.tolist()))
    assert told.type == Marker.MESH_RESOURCE and not told.points
    assert told.mesh_resource == f"file://{mesh.path}" and told.mesh_resource.endswith("t_handle.obj")
    assert [told.scale.x, told.scale.y, told.scale.z] == [1.0, 2.0, 0.5]
    origin = state.position - state.rotation @ body.center_of_mass
    p = told.pose.position
    assert [p.x, p.y, p.z] == pytest.approx(origin.tolist(), abs=1e-15)


def test_of_large_parts_the_marker_shows_the_boxes(monkeypatch, tmp_path):
    monkeypatch.setattr(marker, "PERIOD_S", 0.0)
    monkeypatch.setattr(marker, "MOST_TRIANGLES", 10)
    (tmp_path / "whole.yaml").write_text("parts: {a: {mesh: hammer}, b: {mesh: book, position: [0.5, 0, 0]}}")
    run = OfflineRun(make_scenario({"mesh": str(tmp_path / "whole.yaml"), "scale": (1.0, 2.0, 0.5)}))
    state, mesh = run.simulation.state, run.scenario.body_mesh.mesh
    told, corners = marked_at(BodyMarker(("map", "tool"), Stamps()).message(run, 0, state.row.tolist()))
    assert told.type == Marker.TRIANGLE_LIST and len(corners) == 2 * 36
    vertices = mesh.vertices * [1.0, 2.0, 0.5] - run.simulation.setup.body.center_of_mass
    count = len(mesh.parts[0].mesh.vertices)
    for shown, own in ((corners[:36], vertices[:count]), (corners[36:], vertices[count:])):
        assert shown.min(axis=0) == pytest.approx(own.min(axis=0), abs=1e-15)
        assert shown.max(axis=0) == pytest.approx(own.max(axis=0), abs=1e-15)


def test_markers_are_made_thirty_times_a_second_and_none_without_a_mesh(monkeypatch):
    run, clock = OfflineRun(make_scenario({})), SimpleNamespace(now_s=5.0)
    monkeypatch.setattr(marker, "time", SimpleNamespace(monotonic=lambda: clock.now_s))
    made, row, count = BodyMarker(("world", "body"), Stamps()), run.simulation.state.row.tolist(), 0
    for _ in range(200):
        clock.now_s += 0.01
        count += made.message(run, 0, row) is not None
    assert 60 <= count <= 61
    bare = {"mesh": "", "inertia_model": "explicit", "explicit_inertia.tensor": (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)}
    assert BodyMarker(("world", "body"), Stamps()).message(OfflineRun(make_scenario(bare)), 0, row) is None


@pytest.mark.parametrize("name", ["rigid_body.rviz", "foxglove_layout.json"])
def test_arrangements_for_other_viewers_show_topics_that_the_node_has(name):
    source = Path(__file__).parent.parent.parent
    text = (source / "config" / name).read_text("utf-8")
    (json.loads if name.endswith("json") else yaml.safe_load)(text)
    shown = set(re.findall(r"/rigid_body/([a-z]+)", text))
    listed = (source / "test" / "interface.txt").read_text("utf-8")
    assert {"marker", "pose"} <= shown <= set(re.findall(r"^published ~/(\w+)", listed, re.MULTILINE))
