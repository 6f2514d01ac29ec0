# SPDX-License-Identifier: MIT
"""The ROS 2 node and its client. Callbacks convert messages; one physics thread owns the motion."""
