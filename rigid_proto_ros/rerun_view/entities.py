# SPDX-License-Identifier: MIT
"""Names of what is logged beside the picture's parts: the writer, the layout and the reader agree here.

Timelines: ``sim_time`` (simulated time since the run's start) and ``ros_time`` (wall clock when the row was taken).
"""

from __future__ import annotations

SIM_TIME = "sim_time"
ROS_TIME = "ros_time"

STATE = "state"
"""States, exactly."""
SCENE = "session/scene"
"""The parameters at the run's start."""
SESSION_MESH = "session/mesh"
"""The mesh that the run began with, exactly."""
EVENTS = "events"
"""Event lines as logged."""
REFUSALS = "log/refusals"
ACCURACY = "log/accuracy"
"""Why the motion is held to less than its accuracy."""
