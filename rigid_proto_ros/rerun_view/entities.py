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

STRING = "world/string"
HAND = "world/string/hand"
STRING_TENSION = "plots/string_tension"
STRING_ENERGY = "plots/energy/string"

ANGULAR_VELOCITY = "world/centre/angular_velocity"
MOMENTUM = "world/centre/angular_momentum"
BOUNDING_BOX = "world/body/bounding_box"
INERTIA_BOX = "world/body/equimomental_box"
INERTIA_ELLIPSOID = "world/body/equimomental_ellipsoid"

GHOST = "world/ghost"
GHOST_MESH = "world/ghost/mesh"
GHOST_BOX = "world/ghost/equimomental_box"

POINSOT = "poinsot"
POINSOT_UPRIGHT = "poinsot/upright"
"""Turned so that the invariable plane is a floor."""
POINSOT_BODY = "poinsot/upright/body"
POINSOT_PRINCIPAL = "poinsot/upright/body/principal"
POINSOT_ELLIPSOID = "poinsot/upright/body/principal/ellipsoid"
POINSOT_POLHODE = "poinsot/upright/body/principal/polhode"
POINSOT_SEPARATRIX = "poinsot/upright/body/principal/separatrix"
POINSOT_PLANE = "poinsot/upright/invariable_plane"
POINSOT_OMEGA = "poinsot/upright/angular_velocity"
POINSOT_MOMENTUM = "poinsot/upright/angular_momentum"
POINSOT_HERPOLHODE = "poinsot/upright/herpolhode"

STATE = "state"
ENERGY = "plots/energy"
ANGULAR_MOMENTUM = "plots/angular_momentum"
ANGULAR_MOMENTUM_ANGLE = "plots/angular_momentum_angle"
ANGULAR_VELOCITY_BODY = "plots/angular_velocity_body"
DRIFT = "plots/drift"
EFFORT = "plots/effort"
GHOST_ANGLE = "plots/ghost_angle"

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

RED, GREEN, BLUE = (235, 85, 85), (90, 200, 110), (85, 150, 250)
GREY, YELLOW, VIOLET, ORANGE = (190, 190, 190), (240, 200, 70), (190, 120, 245), (250, 150, 60)
MESH_COLOUR = (214, 205, 190)
TRAIL_COLOUR = (250, 205, 95)
STRING_COLOUR, SLACK_COLOUR = (250, 240, 210), (150, 150, 150)
OMEGA_COLOUR = (90, 230, 230)
MOMENTUM_COLOUR = (190, 120, 245)
GHOST_COLOUR = (120, 180, 255)
GHOST_ALPHA = 110

LOAD_COLOURS = {"wrench": ORANGE, "poke": (255, 80, 80), "impulse": (255, 70, 200)}
TORQUE_COLOUR = (255, 210, 120)

SERIES = {
    ENERGY: (("translational", BLUE), ("rotational", ORANGE), ("gravity", GREEN), ("sum of these", GREY)),
    ANGULAR_MOMENTUM: (("Lx", RED), ("Ly", GREEN), ("Lz", BLUE), ("|L|", GREY)),
    ANGULAR_MOMENTUM_ANGLE: (("angle of L to its start", VIOLET),),
    DRIFT: (("energy, relative", ORANGE), ("L as a vector, relative", VIOLET)),
    EFFORT: (("steps", BLUE), ("force evaluations", ORANGE)),
    STRING_ENERGY: (("string, elastic", YELLOW),),
    STRING_TENSION: (("string", ORANGE),),
    GHOST_ANGLE: (("ghost to body", GHOST_COLOUR),),
    ANGULAR_VELOCITY_BODY: (("ω1", RED), ("ω2", GREEN), ("ω3", BLUE)),
}
"""Per plotted entity the names and colours of its scalars, in the order in which they are logged."""
