# SPDX-License-Identifier: MIT
"""One rigid body from a mesh: exact mass properties, motion under wrenches, ROS 2 topics and a Rerun view."""

__version__ = "0.1.0"
