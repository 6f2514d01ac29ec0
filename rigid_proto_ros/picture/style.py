# SPDX-License-Identifier: MIT
"""Names and styles of the picture's parts and plots, common to all backends.

Colours are RGB of 0 to 255. Vectors in principal axes have components 1, 2, 3 in ascending order of the principal
moments.
"""

from __future__ import annotations

from dataclasses import dataclass

Colour = tuple[int, int, int]

RED, GREEN, BLUE = (235, 85, 85), (90, 200, 110), (85, 150, 250)
GREY, YELLOW, VIOLET, ORANGE = (150, 150, 150), (240, 200, 70), (190, 120, 245), (250, 150, 60)

AXES_COLOURS = (RED, GREEN, BLUE)
"""Colours of the axes x y z and of the principal axes 1 2 3."""
BODY_COLOUR = (214, 205, 190)
GHOST_COLOUR = (120, 180, 255)
OMEGA_COLOUR, MOMENTUM_COLOUR = (60, 190, 190), VIOLET
FLOOR_COLOUR = (110, 110, 110)
STRING_COLOUR, HAND_COLOUR, SLACK_COLOUR = (250, 180, 60), (250, 130, 40), GREY
FORCE_COLOUR, TORQUE_COLOUR = (205, 25, 25), (255, 210, 120)
LOAD_COLOURS = {"wrench": ORANGE, "poke": FORCE_COLOUR, "impulse": (255, 70, 200), "thruster": (90, 220, 255)}
"""By kind of load."""
TRAIL_COLOUR, POINT_TRAIL_COLOUR = (230, 160, 30), (225, 80, 160)
"""Trails of the COM and of one point of the body."""

WORLD = "world"
BODY = "world/body"
"""The body frame: body axes, origin at the COM."""
BODY_MESH = "world/body/mesh"
BODY_AXES = "world/body/axes"
PRINCIPAL_AXES = "world/body/principal_axes"
BOUNDING_BOX = "world/body/bounding_box"
INERTIA_BOX = "world/body/equimomental_box"
INERTIA_ELLIPSOID = "world/body/equimomental_ellipsoid"
FLOOR = "world/floor"
"""Lines at rest, labelled with their spacing, as a scale of sizes and distances."""
CENTRE = "world/centre"
"""A frame at the COM with world axes; views follow it, so that they don't rotate with the body."""
OMEGA = "world/centre/angular_velocity"
MOMENTUM = "world/centre/angular_momentum"
GHOST = "world/ghost"
GHOST_MESH = "world/ghost/mesh"
GHOST_BOX = "world/ghost/equimomental_box"
LOADS = "world/loads"
TRAIL = "world/trail"
"""Trail of the vertex farthest from the COM."""
COM_TRAIL = "world/com_trail"
STRING = "world/string"
HAND = "world/string/hand"
STRING_LINE = "world/string_line"
"""The line of a taut string, extended through the body."""

POINSOT = "poinsot"
"""Poinsot's construction, a separate picture, in units of about its size."""
POINSOT_UPRIGHT = "poinsot/upright"
POINSOT_PLANE = "poinsot/invariable_plane"
POINSOT_OMEGA = "poinsot/upright/angular_velocity"
POINSOT_MOMENTUM = "poinsot/angular_momentum"
POINSOT_HERPOLHODE = "poinsot/upright/herpolhode"
POINSOT_BODY = "poinsot/upright/body"
POINSOT_PRINCIPAL = "poinsot/upright/body/principal"
POINSOT_ELLIPSOID = "poinsot/upright/body/principal/ellipsoid"
POINSOT_POLHODE = "poinsot/upright/body/principal/polhode"


def load_part(kind: str, part: str) -> str:
    """Name of the arrows of a kind of load; part: ``force`` or ``torque``."""
    return f"{LOADS}/{kind}/{part}"


@dataclass(frozen=True)
class Style:
    """Style of a part. colours: one, or one per item. width: radius of lines, arrows and points, in body sizes; in
    Poinsot's picture, in its own unit.
    """

    colours: tuple[Colour, ...]
    width: float = 0.0
    opacity: float = 1.0


STYLES = {
    BODY_MESH: Style((BODY_COLOUR,)),
    BODY_AXES: Style(AXES_COLOURS, 0.006),
    PRINCIPAL_AXES: Style(AXES_COLOURS, 0.006),
    BOUNDING_BOX: Style((GREY,), 0.0025),
    INERTIA_BOX: Style((YELLOW,), opacity=0.3),
    INERTIA_ELLIPSOID: Style((GREEN,), opacity=0.3),
    OMEGA: Style((OMEGA_COLOUR,), 0.009),
    MOMENTUM: Style((MOMENTUM_COLOUR,), 0.012),
    GHOST_MESH: Style((GHOST_COLOUR,), opacity=0.45),
    GHOST_BOX: Style((GHOST_COLOUR,), 0.0025),
    **{load_part(kind, "force"): Style((colour,), 0.012) for kind, colour in LOAD_COLOURS.items()},
    **{load_part(kind, "torque"): Style((TORQUE_COLOUR,), 0.012) for kind in LOAD_COLOURS},
    TRAIL: Style((POINT_TRAIL_COLOUR,), 0.004),
    COM_TRAIL: Style((TRAIL_COLOUR,), 0.004),
    STRING: Style((STRING_COLOUR,), 0.0035),
    HAND: Style((HAND_COLOUR,), 0.02),
    STRING_LINE: Style((YELLOW,), 0.0025),
    POINSOT_PLANE: Style((GREY,), 0.004),
    POINSOT_OMEGA: Style((OMEGA_COLOUR,), 0.025),
    POINSOT_MOMENTUM: Style((MOMENTUM_COLOUR,), 0.02),
    POINSOT_HERPOLHODE: Style((ORANGE,), 0.009),
    POINSOT_ELLIPSOID: Style((BLUE,), opacity=0.45),
    POINSOT_POLHODE: Style((YELLOW,), 0.012),
}

ENERGY = "plots/energy"
ANGULAR_MOMENTUM = "plots/angular_momentum"
ANGULAR_MOMENTUM_ANGLE = "plots/angular_momentum_angle"
ANGULAR_VELOCITY_PRINCIPAL = "plots/angular_velocity_principal"
POSITION = "plots/position"
GHOST_ANGLE = "plots/ghost_angle"
STRING_LINE_DISTANCE = "plots/string_line_distance"
COMMANDED = "plots/commanded"
"""Total force and torque of the acting commands, without the string's."""

ENERGY_SERIES = (("translational", BLUE), ("rotational", ORANGE), ("gravity", GREEN))
TOTAL_ENERGY_SERIES, STRING_ENERGY_SERIES = (("total", GREY),), (("string", YELLOW),)
MOMENTUM_SERIES = (("Lx", RED), ("Ly", GREEN), ("Lz", BLUE), ("|L|", GREY))
OMEGA_SERIES = (("ω₁", RED), ("ω₂", GREEN), ("ω₃", BLUE))
MOMENTUM_ANGLE_SERIES = (("angle of L", VIOLET),)

SERIES = {
    ENERGY: (*ENERGY_SERIES, *TOTAL_ENERGY_SERIES, *STRING_ENERGY_SERIES),
    ANGULAR_MOMENTUM: MOMENTUM_SERIES,
    ANGULAR_MOMENTUM_ANGLE: MOMENTUM_ANGLE_SERIES,
    ANGULAR_VELOCITY_PRINCIPAL: OMEGA_SERIES,
    POSITION: (("x", RED), ("y", GREEN), ("z", BLUE)),
    GHOST_ANGLE: (("ghost to body", GHOST_COLOUR),),
    STRING_LINE_DISTANCE: (("COM to the string's line", YELLOW),),
    COMMANDED: (("|force| [N]", RED), ("|torque| [N m]", VIOLET)),
}
"""Names and colours of the scalars of each plot, in order. The last energy is plotted only with a string."""

WHOLES = ("|L|", "total")
"""Scalars that are the sum or the norm of others in their plot."""

ROUNDING = 1e-9
"""Relative size below which a value is a rounding error, of the arithmetic or of a mesh's coordinates."""

ENERGY_UNIT, OMEGA_UNIT, MOMENTUM_UNIT, ANGLE_UNIT = "J", "rad/s", "kg m²/s", "°"

ENERGY_TITLE = "Energy"
OMEGA_TITLE = "ω in principal axes"
MOMENTUM_TITLE = "L in world axes"
MOMENTUM_ANGLE_TITLE = "Drift of L's direction"
GHOST_ANGLE_TITLE = "Angle of the ghost to the body"


def without_rounding(value: float, largest: float = 1.0) -> float:
    """A value for display; 0 if it is a rounding error compared to ``largest``."""
    return float(value) if abs(value) > ROUNDING * largest else 0.0
