# SPDX-License-Identifier: MIT
"""What the node and the simulation don't do, and what it would cost if they did: each with and without, in one run.

Called by node.py; a row is (what is left out, figure, cost when it is done, cost as it is).
"""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from node_processes import client, node

SPIN = "initial.angular_velocity:=[0.05, 0.1, 12.0]"
KILOHERTZ = "publish_rate:=1000.0"


def skips(seconds: float) -> Iterator[tuple[str, str, float, float]]:
    """All rows, the cheap ones first."""
    yield from in_process()
    yield from at_start()
    yield from in_flight(seconds)


def median_us(function: Callable[[], object], count: int = 200) -> float:
    """Median time of a call [µs], after a first one."""
    function()
    times = []
    for _ in range(count):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return 1e6 * statistics.median(times)


def in_process() -> Iterator[tuple[str, str, float, float]]:
    """Single calls, timed in this process."""
    yield ("free body, 100 s: steps of rk4, or one step", "us", flown("rk4"), flown("auto"))
    yield ("body at rest, 100 s: steps of rk4, or none", "us", flown("rk4", 0.0), flown("auto", 0.0))
    yield ("a pose and a twist: message objects serialized, or bytes packed", "us", *packing())
    yield ("a frame for Rerun: the mesh, or a row of a column", "us", *frames())
    vertices, rotation = body("teapot").surface.vertices, np.eye(3)
    yield ("vertices rotated on the CPU in each frame, or never", "us", median_us(lambda: vertices @ rotation.T), 0.0)
    yield ("mass properties at another scale: from the mesh, or from its moments", "us", *rescaling())


def setup(integrator: str, spin: float = 12.0, **values):
    """The T-handle's Setup."""
    from rigid_proto_ros.scene.scenario import make_scenario

    given = {
        "mesh": "t_handle",
        "integrator": integrator,
        "initial.angular_velocity": [0.004 * spin, 0.01 * spin, spin],
    }
    return make_scenario({**given, **values}).setup


def body(name: str):
    """A bundled body's Setup."""
    return setup("auto", mesh=name)


def flown(integrator: str, spin: float = 12.0) -> float:
    """Time of 100 s of flight without commands [µs]."""
    from rigid_proto_ros.simulation.simulation import Simulation

    given = setup(integrator, spin)
    return median_us(lambda: Simulation(given).advance(100_000_000_000), 9)


def packing() -> tuple[float, float]:
    """Message objects against bytes [µs]."""
    from geometry_msgs.msg import PoseStamped, TwistStamped
    from rclpy.serialization import serialize_message

    from rigid_proto_ros.scene import cdr

    row = setup("auto").initial.tolist()

    def objects():
        pose, twist = PoseStamped(), TwistStamped()
        for header in (pose.header, twist.header):
            header.stamp.sec, header.stamp.nanosec, header.frame_id = 1, 2, "world"
        p, o, v, w = pose.pose.position, pose.pose.orientation, twist.twist.linear, twist.twist.angular
        p.x, p.y, p.z, o.x, o.y, o.z, o.w = row[:7]
        v.x, v.y, v.z, w.x, w.y, w.z = row[7:]
        return serialize_message(pose), serialize_message(twist)

    def packed():
        return cdr.stamped_doubles(1, "world", row[:7]), cdr.stamped_doubles(1, "world", row[7:])

    return median_us(objects), median_us(packed)


def frames() -> tuple[float, float]:
    """A mesh logged with each frame against one row of a batch of 500 [µs]."""
    import rerun as rr

    surface = body("teapot").surface
    recording = rr.RecordingStream("node_skips")
    recording.save(str(Path(tempfile.mkdtemp()) / "skips.rrd"))
    mesh = rr.Mesh3D(vertex_positions=surface.vertices, triangle_indices=surface.triangles)
    times, places, turns = np.arange(500.0), np.zeros((500, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (500, 1))

    def rows():
        columns = rr.Transform3D.columns(translation=places, quaternion=turns)
        recording.send_columns("body", [rr.TimeColumn("sim_time", duration=times)], columns)

    return median_us(lambda: recording.log("mesh", mesh), 30), median_us(rows, 30) / 500


def rescaling() -> tuple[float, float]:
    """The teapot's mass properties at another scale: a second pass, and from its moments [µs]."""
    from rigid_proto_ros.mass.from_mesh import mesh_body
    from rigid_proto_ros.mass.moments import solid_moments

    mesh = mesh_body("teapot")
    vertices, triangles, moments = mesh.vertices, mesh.triangles, mesh.moments
    return median_us(lambda: solid_moments(vertices * 1.5, triangles)), median_us(
        lambda: moments.mass_properties("solid", scale=1.5, density=1000.0)
    )


def at_start() -> Iterator[tuple[str, str, float, float]]:
    """From the start of the process to its flight."""
    node().end()
    usual = start_up_s()
    yield ("start of the node: with a recording, or without Rerun", "s", start_up_s(recording()), usual)
    yield (
        "start of the node: mesh checked, or its verdict cached",
        "s",
        start_up_s(RIGID_PROTO_CACHE="off"),
        usual,
    )


def recording() -> str:
    """The parameter that asks for a recording."""
    return f"record:={Path(tempfile.mkdtemp()) / 'skips.rrd'}"


def start_up_s(*parameters: str, count: int = 3, **environment: str) -> float:
    """Median time until the node flies [s]."""
    times = []
    before = dict(os.environ)
    os.environ.update(environment)
    try:
        for _ in range(count):
            began = time.monotonic()
            with node(*parameters, wait_s=0.0):
                times.append(time.monotonic() - began)
    finally:
        os.environ.clear()
        os.environ.update(before)
    return statistics.median(times)


def in_flight(seconds: float) -> Iterator[tuple[str, str, float, float]]:
    """Shares of a core at 1 kHz."""
    with node(KILOHERTZ, SPIN) as process:
        alone = process.cpu_share(seconds)
        with client("subscribe", "pose"), client("subscribe", "twist"):
            time.sleep(2.0)
            two = process.cpu_share(seconds)
            with client("subscribe", "odom"), client("subscribe", "imu"):
                time.sleep(2.0)
                four = process.cpu_share(seconds)
    yield ("pose and twist at 1 kHz: with subscribers, or without", "% of a core", two, alone)
    yield ("odom and imu too: with subscribers, or without", "% of a core", four, two)
    with (
        node(KILOHERTZ, SPIN, "publish_clock:=true") as process,
        client("subscribe", "pose"),
        client("subscribe", "twist"),
    ):
        time.sleep(2.0)
        # /clock is published on request; nobody need listen for its publisher to look.
        yield ("/clock: published, or not", "% of a core", process.cpu_share(seconds), two)
    with node(KILOHERTZ, "integrator:=rk4") as process:
        stepped = process.cpu_share(seconds)
    with node(KILOHERTZ) as process:
        yield (
            "a body at rest at 1 kHz: stepped by rk4, or not stepped",
            "% of a core",
            stepped,
            process.cpu_share(seconds),
        )
