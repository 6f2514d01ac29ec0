# SPDX-License-Identifier: MIT
"""Names, colours and constant styling of what is logged: the writer, the layouts and the reader agree here.

Timelines: ``sim_time`` (simulated time since the run's start) and ``ros_time`` (wall clock when the row was taken).
"""

from __future__ import annotations

from .appearance import (
    BLUE,
    ENERGY_SERIES,
    FORCE_COLOUR,
    GHOST_COLOUR,
    GREEN,
    GREY,
    MOMENTUM_ANGLE_SERIES,
    MOMENTUM_SERIES,
    OMEGA_SERIES,
    ORANGE,
    RED,
    STRING_ENERGY_SERIES,
    VIOLET,
    YELLOW,
)

SIM_TIME = "sim_time"
ROS_TIME = "ros_time"

WORLD = "world"
BODY = "world/body"
BODY_MESH = "world/body/mesh"
BODY_AXES = "world/body/axes"
CENTRE = "world/centre"
"""The COM with world axes: the place from which views follow the body without turning with it."""

VIEW = "world/centre/view"
"""The same in units of about the body's size, so that cameras suit bodies of any size: a layout is never sent again,
which would undo what somebody has arranged, because the body grows.
"""

LOADS = "world/loads"
TRAIL = "world/trail"
"""The path of the vertex farthest from the COM, and that of the COM."""
COM_TRAIL = "world/com_trail"

STRING = "world/string"
HAND = "world/string/hand"
STRING_LINE = "world/string/line"
"""The line of a string that pulls, on through the body."""
STRING_LINE_DISTANCE = "plots/string_line_distance"
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
ANGULAR_VELOCITY_PRINCIPAL = "plots/angular_velocity_principal"
POSITION = "plots/position"
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

SLACK_COLOUR = (150, 150, 150)
GHOST_ALPHA = 110

LOAD_COLOURS = {"wrench": ORANGE, "poke": FORCE_COLOUR, "impulse": (255, 70, 200), "thruster": (90, 220, 255)}
TORQUE_COLOUR = (255, 210, 120)

SERIES = {
    ENERGY: (*ENERGY_SERIES, ("total without string", GREY)),
    ANGULAR_MOMENTUM: MOMENTUM_SERIES,
    ANGULAR_MOMENTUM_ANGLE: MOMENTUM_ANGLE_SERIES,
    DRIFT: (("energy, relative", ORANGE), ("L as a vector, relative", VIOLET)),
    EFFORT: (("steps", BLUE), ("force evaluations", ORANGE)),
    STRING_ENERGY: STRING_ENERGY_SERIES,
    STRING_TENSION: (("string", ORANGE),),
    STRING_LINE_DISTANCE: (("COM to the string's line", YELLOW),),
    GHOST_ANGLE: (("ghost to body", GHOST_COLOUR),),
    ANGULAR_VELOCITY_PRINCIPAL: OMEGA_SERIES,
    POSITION: (("x", RED), ("y", GREEN), ("z", BLUE)),
}
"""Per plotted entity the names and colours of its scalars, in the order in which they are logged."""


def axis_ends(plot: str) -> str:
    """Where the ends of a plot's value axis are logged, for viewers of a flight that goes on."""
    return f"{plot}/axis_ends"
