# SPDX-License-Identifier: MIT
"""A simulation in real time, in a thread of its own; without ROS."""
