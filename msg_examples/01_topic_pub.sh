#!/bin/sh
# SPDX-License-Identifier: MIT
# Push the T-handle by messages on topics. Start the node first, in another terminal: make up
set -e

ros2 service call /rigid_body/reset std_srvs/srv/Trigger

# A push of 0.05 N for half a second where a ray from (1, 0, 0) along -x first meets the body.
ros2 topic pub --once /rigid_body/poke geometry_msgs/msg/WrenchStamped '{header: {frame_id: "world@ray/1,0,0/-1,0,0;duration=0.5"}, wrench: {force: {x: -0.05}}}'

# A push of 0.05 N along the inward normal at the contact "tip", for poke_duration (0.05 s).
ros2 topic pub --once /rigid_body/poke geometry_msgs/msg/WrenchStamped '{header: {frame_id: "normal@tip"}, wrench: {force: {x: 0.05}}}'

# An impulse of 0.001 N s along world z at a point in mesh coordinates, which acts at once.
ros2 topic pub --once /rigid_body/poke geometry_msgs/msg/WrenchStamped '{header: {frame_id: "world@point/0,0.05,0;impulse"}, wrench: {force: {z: 0.001}}}'

# A force along world x through the centre of mass, held until wrench_timeout (1.5 s) after the last message.
ros2 topic pub --times 3 /rigid_body/wrench geometry_msgs/msg/WrenchStamped '{header: {frame_id: "world"}, wrench: {force: {x: 0.02}}}'

# A torque about the z axis of the body, which turns with the body. It replaces the force.
ros2 topic pub --times 3 /rigid_body/wrench geometry_msgs/msg/WrenchStamped '{header: {frame_id: "body"}, wrench: {torque: {z: 0.0002}}}'
