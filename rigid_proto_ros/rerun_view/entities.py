# SPDX-License-Identifier: MIT
"""Names, colours and constant styling of what is logged: the writer, the layouts and the reader agree here.

Timelines: ``sim_time`` (simulated time since the run's start) and ``ros_time`` (wall clock when the row was taken).
"""

from __future__ import annotations

SIM_TIME = "sim_time"
ROS_TIME = "ros_time"

WORLD = "world"
BODY = "world/body"
BODY_MESH = "world/body/mesh"
BODY_AXES = "world/body/axes"
CENTRE = "world/centre"
"""The COM with world axes: the place from which views follow the body without turning with it."""

LOADS = "world/loads"
TRAIL = "world/trail"

STATE = "state"
ENERGY = "plots/energy"
ANGULAR_MOMENTUM = "plots/angular_momentum"
ANGULAR_MOMENTUM_ANGLE = "plots/angular_momentum_angle"
ANGULAR_VELOCITY_BODY = "plots/angular_velocity_body"

SCENE = "session/scene"
SESSION_MESH = "session/mesh"
SESSION_BODY = "session/body"
EVENTS = "events"
COMMAND_LOG = "log/commands"
REFUSAL_LOG = "log/refusals"

RED, GREEN, BLUE = (235, 85, 85), (90, 200, 110), (85, 150, 250)
GREY, YELLOW, VIOLET, ORANGE = (190, 190, 190), (240, 200, 70), (190, 120, 245), (250, 150, 60)
MESH_COLOUR = (214, 205, 190)
TRAIL_COLOUR = (250, 205, 95)

LOAD_COLOURS = {"wrench": ORANGE, "poke": (255, 80, 80), "impulse": (255, 70, 200)}
TORQUE_COLOUR = (120, 220, 220)

SERIES = {
    ENERGY: (("translational", BLUE), ("rotational", ORANGE), ("potential", GREEN), ("total", GREY)),
    ANGULAR_MOMENTUM: (("Lx", RED), ("Ly", GREEN), ("Lz", BLUE), ("|L|", GREY)),
    ANGULAR_MOMENTUM_ANGLE: (("angle of L to its start", VIOLET),),
    ANGULAR_VELOCITY_BODY: (("ω1", RED), ("ω2", GREEN), ("ω3", BLUE)),
}
"""Per plotted entity the names and colours of its scalars, in the order in which they are logged."""
