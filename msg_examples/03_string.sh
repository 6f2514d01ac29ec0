#!/bin/sh
# SPDX-License-Identifier: MIT
# Pull the tip of the T-handle on a rubber band: by a script, then by topics.
# Start the node first, in another terminal: make up
set -e

poke_client "$(dirname "$0")/pull_on_string.yaml" --reset

# Attach the string to a point in mesh coordinates. The first target ties it; it is released 1 s after the last target.
ros2 service call /rigid_body/reset std_srvs/srv/Trigger
ros2 topic pub --once /rigid_body/string/attach geometry_msgs/msg/PointStamped '{header: {frame_id: "rigid_body/mesh"}, point: {z: 0.07}}'
ros2 topic pub --rate 10 --times 30 /rigid_body/string/target geometry_msgs/msg/PointStamped '{point: {z: 0.15}}'
