# SPDX-License-Identifier: MIT
"""The ROS 2 side: a node and a client. Callbacks convert and hand over; one physics thread owns the motion."""
