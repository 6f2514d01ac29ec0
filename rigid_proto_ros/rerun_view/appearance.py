# SPDX-License-Identifier: MIT
"""Colours, names and units of what is shown, the same on the interactive page and in Rerun.

Colours are RGB of 0 to 255. Vectors in principal axes have components 1, 2, 3 in ascending order of the principal
moments.
"""

from __future__ import annotations

RED, GREEN, BLUE = (235, 85, 85), (90, 200, 110), (85, 150, 250)
GREY, YELLOW, VIOLET, ORANGE = (150, 150, 150), (240, 200, 70), (190, 120, 245), (250, 150, 60)

AXES_COLOURS = (RED, GREEN, BLUE)
"""Of axes x y z, and of principal axes 1 2 3."""
BODY_COLOUR = (214, 205, 190)
GHOST_COLOUR = (120, 180, 255)
OMEGA_COLOUR, MOMENTUM_COLOUR = (60, 190, 190), VIOLET
STRING_COLOUR, HAND_COLOUR = (250, 180, 60), (250, 130, 40)
FORCE_COLOUR = (205, 25, 25)
TRAIL_COLOUR, POINT_TRAIL_COLOUR = (230, 160, 30), (225, 80, 160)
"""Paths of the centre of mass and of one point of the body."""

ENERGY_SERIES = (("translational", BLUE), ("rotational", ORANGE), ("gravity", GREEN))
STRING_ENERGY_SERIES, TOTAL_ENERGY_SERIES = (("string", YELLOW),), (("total", GREY),)
"""Energies by name and colour, in the order in which they are plotted."""
MOMENTUM_SERIES = (("Lx", RED), ("Ly", GREEN), ("Lz", BLUE), ("|L|", GREY))
OMEGA_SERIES = (("ω₁", RED), ("ω₂", GREEN), ("ω₃", BLUE))
MOMENTUM_ANGLE_SERIES = (("angle of L", VIOLET),)

ENERGY_UNIT, OMEGA_UNIT, MOMENTUM_UNIT, ANGLE_UNIT = "J", "rad/s", "kg m²/s", "°"

ENERGY_TITLE = "Energy"
OMEGA_TITLE = "ω in principal axes"
MOMENTUM_TITLE = "L in world axes"
MOMENTUM_ANGLE_TITLE = "Drift of L's direction"
GHOST_ANGLE_TITLE = "Angle of the ghost to the body"


def css(colour: tuple[int, int, int]) -> str:
    """A colour as browsers write it."""
    return "rgb({},{},{})".format(*colour)
