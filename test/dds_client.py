# SPDX-License-Identifier: MIT
"""A client that knows nothing of ROS: Cyclone DDS, an independent vendor's middleware, in a process of its own.

Reads one line of JSON: {node, commands: [[topic, stamp_ns, frame_id, force, torque] or [string topic, stamp_ns, frame_id,
point], ...], until_ns}. Sends the commands when
all topics have a reader, waits until states stamped ``until_ns`` have come, and prints poses and twists by stamp as JSON.
"""

import json
import os
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Wrench(IdlStruct, typename="geometry_msgs::msg::dds_::Wrench_"):
    force: Vector3
    torque: Vector3


@dataclass
class WrenchStamped(IdlStruct, typename="geometry_msgs::msg::dds_::WrenchStamped_"):
    header: Header
    wrench: Wrench


@dataclass
class PointStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PointStamped_"):
    header: Header
    point: Point


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: Pose


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TwistStamped_"):
    header: Header
    twist: Twist


RELIABLE = Qos(Policy.Reliability.Reliable(duration(seconds=10)), Policy.History.KeepAll)


def stamp_ns(message) -> int:
    """A header's stamp [ns]."""
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def main(node: str, commands: list, until_ns: int) -> dict:
    """Send the commands and collect the states that follow, until both topics have reached ``until_ns``."""
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))

    def topic(name, data_type):
        return Topic(participant, f"rt/{node}/{name}", data_type)

    topics = {
        "wrench": WrenchStamped,
        "poke": WrenchStamped,
        "string/target": PointStamped,
        "string/attach": PointStamped,
    }
    wanted = {command[0] for command in commands}
    writers = {name: DataWriter(participant, topic(name, topics[name]), qos=RELIABLE) for name in wanted}
    pose = DataReader(participant, topic("pose", PoseStamped), qos=RELIABLE)
    twist = DataReader(participant, topic("twist", TwistStamped), qos=RELIABLE)
    found = {"pose": {}, "twist": {}}
    deadline = time.monotonic() + 150.0
    sent = False
    while min(max(found["pose"], default=-1), max(found["twist"], default=-1)) < until_ns:
        if time.monotonic() > deadline:
            raise TimeoutError(f"sent: {sent}, {[(name, max(times, default=None)) for name, times in found.items()]}")
        time.sleep(0.005)
        for message in pose.take(N=1000):
            p, q = message.pose.position, message.pose.orientation
            found["pose"][stamp_ns(message)] = [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
        for message in twist.take(N=1000):
            v, w = message.twist.linear, message.twist.angular
            found["twist"][stamp_ns(message)] = [v.x, v.y, v.z, w.x, w.y, w.z]
        ready = found["pose"] and found["twist"] and all(w.get_matched_subscriptions() for w in writers.values())
        if ready and not sent:
            sent = True
            for name, ns, frame, *values in commands:
                header = Header(Time(*divmod(ns, 1_000_000_000)), frame)
                if topics[name] is PointStamped:
                    writers[name].write(PointStamped(header, Point(*values[0])))
                else:
                    force, torque = values
                    writers[name].write(WrenchStamped(header, Wrench(Vector3(*force), Vector3(*torque))))
            print("sent", flush=True)
    return found


if __name__ == "__main__":
    job = json.loads(sys.stdin.readline())
    print(json.dumps(main(job["node"], job["commands"], job["until_ns"])))
