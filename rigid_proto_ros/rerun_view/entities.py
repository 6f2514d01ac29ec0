# SPDX-License-Identifier: MIT
"""Names of what is logged beside the picture's parts: the writer, the layout and the reader agree here.

Timelines: ``sim_time`` (simulated time since the run's start) and ``ros_time`` (wall clock when the row was taken).
"""

from __future__ import annotations

SIM_TIME = "sim_time"
ROS_TIME = "ros_time"

VIEW = "world/centre/view"
"""The COM with world axes in units of about the body's size, so that cameras suit bodies of any size: a layout is never
sent again, which would undo what somebody has arranged, because the body grows.
"""

STATE = "state"
"""States, exactly."""
STATUS = "status"
"""Below it one lane a track: ``loads``, ``integrator``, ``inertia_model`` and those that the run reports."""
SCENE = "session/scene"
"""The parameters at the run's start."""
SCENE_IN_FORCE = "session/scene_in_force"
"""They again at every change."""
SESSION_MESH = "session/mesh"
SESSION_BODY = "session/body"
EVENTS = "events"
COMMAND_LOG = "log/commands"
REFUSAL_LOG = "log/refusals"
