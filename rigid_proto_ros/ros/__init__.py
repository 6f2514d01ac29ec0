# SPDX-License-Identifier: MIT
"""The ROS 2 side: a node and a client. Callbacks convert messages; one physics thread owns the motion."""
