# SPDX-License-Identifier: MIT
"""A simulation in real time on its own thread; without ROS."""
