#!/bin/sh
# SPDX-License-Identifier: MIT
# Check a mesh and compute its inertia; check and correct the inertials of a robot file.
mkdir -p out

rigid_proto inspect hammer --density 7850 --verify || exit   # against exact rational arithmetic
rigid_proto inspect hammer --density 7850 --urdf || exit     # as a URDF <inertial>

# An arm of 16.2 kg whose tensor has x and y exchanged.
cat > out/robot.urdf <<ROBOT
<robot name="arm">
  <link name="arm">
    <inertial><mass value="16.2"/><inertia ixx="0.135" ixy="0" ixz="0" iyy="0.0675" iyz="0" izz="0.1755"/></inertial>
    <collision><geometry><box size="0.3 0.2 0.1"/></geometry></collision>
  </link>
</robot>
ROBOT
rigid_proto inspect --compare out/robot.urdf   # exit status 1: names the link and the cause
rigid_proto inspect --compare out/robot.urdf --fix out/fixed.urdf
rigid_proto inspect --compare out/fixed.urdf   # exit status 0
