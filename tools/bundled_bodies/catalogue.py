# SPDX-License-Identifier: MIT
"""The bundled bodies, one function each. Lengths in metres; each docstring says where the origin and the axes are, and the size
along x, y and z to a millimetre.
"""

from itertools import pairwise

import numpy as np

from .surfaces import (
    Surface,
    difference,
    extrude,
    lathe,
    loft,
    move,
    refine,
    rounded_box,
    smooth_curve,
    tube,
    union,
    with_cavity,
)

X, Y, Z = np.eye(3)


def t_handle() -> Surface:
    """T-handle: crossbar along y, stem along +z to its tip at (0, 0, 0.07); origin where the two axes meet.

    The stem is the middle principal axis: I_y < I_z < I_x. Size 0.015 x 0.100 x 0.078 m.
    """
    bar = _rounded_ends(
        [(0.0075, -0.0500), (0.0075, -0.0380), (0.0060, -0.0330), (0.0060, 0.0330), (0.0075, 0.0380), (0.0075, 0.0500)],
        0.002,
    )
    stem = _rounded_ends([(0.0050, 0.0), (0.0050, 0.0500), (0.0062, 0.0540), (0.0062, 0.0700)], 0.002)
    collar = np.array([(0.0, 0.0), (0.0070, 0.0), (0.0070, 0.0075), (0.0062, 0.0095), (0.0052, 0.0110), (0.0, 0.0110)])
    return union(move(lathe(bar, 40), axes="zxy"), lathe(stem, 32), lathe(collar, 32))


def tennis_racket() -> Surface:
    """Tennis racket: x from the butt (origin) to the rim, y across the face, z normal to the strings.

    Size 0.684 x 0.263 x 0.033 m.
    """
    centre, half_length, half_width = 0.515, 0.164, 0.126
    angle = 2.0 * np.pi * np.arange(72) / 72
    hoop = np.stack([centre + half_length * np.cos(angle), half_width * np.sin(angle), 0.0 * angle], axis=1)
    frame = tube(hoop, (0.0055, 0.0110), Z, 12, power=3.0, closed=True)
    arms = []
    for side in (1.0, -1.0):
        throat = smooth_curve(
            [
                (0.175, side * 0.007, 0.0),
                (0.24, side * 0.017, 0.0),
                (0.31, side * 0.045, 0.0),
                (0.385, side * 0.0781, 0.0),
                (0.42, side * 0.1026, 0.0),
            ],
            22,
        )
        arms.append(tube(throat, (0.0060, 0.0095), Z, 12, power=3.0))
    station = np.array([0.0, 0.004, 0.012, 0.022, 0.10, 0.18, 0.20, 0.215])
    half = np.array(
        [
            [0.017, 0.015],
            [0.0185, 0.0165],
            [0.0185, 0.0165],
            [0.016, 0.0140],
            [0.0155, 0.0135],
            [0.0155, 0.0135],
            [0.0145, 0.0120],
            [0.011, 0.0095],
        ]
    )
    grip = tube(station[:, None] * X, half, Z, 24, power=3.5)
    strings = _strings(centre, half_length, half_width)
    return union(frame, *arms, grip, *strings)


def hammer() -> Surface:
    """Forged hammer: z from the grip's end (origin) up to the head; its face looks along +x, its peen along -x.

    Size 0.141 x 0.041 x 0.313 m.
    """
    grip = smooth_curve(
        [
            (0.0, 0.014, 0.0105),
            (0.02, 0.0150, 0.0115),
            (0.09, 0.0125, 0.0095),
            (0.17, 0.0095, 0.0070),
            (0.25, 0.0090, 0.0070),
            (0.305, 0.0105, 0.0085),
        ],
        40,
    )
    grip = np.concatenate(
        [[[0.0, 0.0090, 0.0060]], grip * [1.0, 0.85, 0.85] + [0.003, 0.0, 0.0], [[0.313, 0.0080, 0.0060]]]
    )
    shaft = tube(grip[:, :1] * Z, grip[:, 1:], Y, 28, power=2.3)
    # (x, half width along y, half height along z, superellipse power) from the peen's edge to the face
    sections = np.array(
        [
            (-0.0660, 0.0120, 0.0015, 4.0),
            (-0.0650, 0.0135, 0.0030, 4.0),
            (-0.0500, 0.0150, 0.0075, 4.0),
            (-0.0350, 0.0160, 0.0120, 4.5),
            (-0.0220, 0.0165, 0.0160, 5.0),
            (-0.0180, 0.0175, 0.0175, 6.0),
            (0.0, 0.0180, 0.0180, 6.0),
            (0.0180, 0.0175, 0.0175, 6.0),
            (0.0220, 0.0160, 0.0160, 4.0),
            (0.0290, 0.0140, 0.0140, 2.6),
            (0.0340, 0.0140, 0.0140, 2.2),
            (0.0390, 0.0165, 0.0165, 2.0),
            (0.0560, 0.0170, 0.0170, 2.0),
            (0.0600, 0.0165, 0.0165, 2.0),
            (0.0620, 0.0150, 0.0150, 2.0),
        ]
    )
    sections = sections * [1.1, 1.15, 1.15, 1.0]
    angle = 2.0 * np.pi * (np.arange(40) + 0.5) / 40
    cosine, sine = np.cos(angle), np.sin(angle)
    power = sections[:, 3:]
    radius = (np.abs(cosine) ** power + np.abs(sine) ** power) ** (-1.0 / power)
    rings = np.empty((len(sections), 40, 3))
    rings[:, :, 0] = sections[:, :1]
    rings[:, :, 1] = sections[:, 1:2] * radius * cosine
    rings[:, :, 2] = sections[:, 2:3] * radius * sine + 0.290
    return union(shaft, loft(rings))


def l_bracket() -> Surface:
    """Angle bracket with three holes: origin at the outer corner, long leg along x, short leg along z, width along y.

    The hole beside the middle makes all three products of inertia nonzero. Size 0.100 x 0.040 x 0.060 m.
    """
    thickness, long, short, width, fillet = 0.006, 0.100, 0.060, 0.040, 0.008
    bend = np.linspace(-np.pi / 2.0, -np.pi, 7)
    inner = np.stack([thickness + fillet + fillet * np.cos(bend), thickness + fillet + fillet * np.sin(bend)], axis=1)
    outline = np.concatenate(
        [
            [(0.002, 0.0), (long - 0.001, 0.0), (long, 0.001), (long, thickness - 0.001), (long - 0.001, thickness)],
            inner,
            [
                (thickness, short - 0.001),
                (thickness - 0.001, short),
                (0.001, short),
                (0.0, short - 0.001),
                (0.0, 0.002),
            ],
        ]
    )
    # Drawn in the plane (x, z) and swept along -y after the turn, hence the shift by the width.
    plate = extrude(outline, width)
    plate = plate[0][:, [0, 2, 1]] * [1.0, -1.0, 1.0] + [0.0, width, 0.0], plate[1]
    drill = lathe(np.array([(0.0, -0.01), (0.0045, -0.01), (0.0045, 0.02), (0.0, 0.02)]), 32)
    slot = lathe(np.array([(0.0, -0.01), (0.0075, -0.01), (0.0075, 0.02), (0.0, 0.02)]), 40)
    drilled = difference(
        plate,
        move(drill, (0.040, 0.020, 0.0)),
        move(slot, (0.080, 0.012, 0.0)),
        move(drill, (0.0, 0.020, 0.040), "yzx"),
    )
    return refine(drilled, 0.008)


def hollow_box() -> Surface:
    """Closed box about the origin, with a cavity that leaves walls of 5 mm.

    Size 0.200 x 0.120 x 0.080 m.
    """
    return with_cavity(rounded_box((0.20, 0.12, 0.08), 0.004, spans=6), rounded_box((0.19, 0.11, 0.07), 0.002, spans=6))


def book() -> Surface:
    """Hardcover book about the origin: x from the spine to the fore edge, y its height, z its thickness.

    Size 0.154 x 0.210 x 0.030 m.
    """
    width, height, thickness, board, overhang = 0.148, 0.210, 0.030, 0.0025, 0.003
    arc = np.linspace(np.pi / 2.0, 3.0 * np.pi / 2.0, 17)
    half = thickness / 2.0
    outer = np.stack([0.006 * np.cos(arc), half * np.sin(arc)], axis=1)
    inner = np.stack([0.004 * np.cos(arc[::-1]), (half - board) * np.sin(arc[::-1])], axis=1)
    cover = extrude(
        np.concatenate(
            [[(width, half)], outer, [(width, -half), (width, -half + board)], inner, [(width, half - board)]]
        ),
        height,
    )
    fore = np.linspace(-1.0, 1.0, 11)
    edge = np.stack([width - overhang - 0.005 * (1.0 - fore**2), (half - board / 2.0) * fore], axis=1)
    back = np.stack([0.005 * np.cos(arc), (half - board / 2.0) * np.sin(arc)], axis=1)
    pages = move(extrude(np.concatenate([edge, back]), height - 2.0 * overhang), (0.0, 0.0, overhang))
    solid = refine(union(cover, pages), 0.014)
    # The outline's (x, y) is the book's (x, z); a turn about x brings the extrusion to -y.
    turned = solid[0][:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    return turned + [-width / 2.0, height / 2.0, 0.0], solid[1]


def teapot() -> Surface:
    """Solid teapot: origin at the centre of its foot, z up through the knob, spout towards +x, handle towards -x.

    Size 0.270 x 0.161 x 0.142 m.
    """
    belly = smooth_curve(
        [(0.046, 0.006), (0.062, 0.016), (0.078, 0.042), (0.080, 0.062), (0.070, 0.088), (0.050, 0.104)], 21
    )
    lid = smooth_curve(
        [
            (0.0495, 0.1075),
            (0.040, 0.1135),
            (0.022, 0.1195),
            (0.0095, 0.1225),
            (0.0070, 0.1265),
            (0.0105, 0.1330),
            (0.0095, 0.1385),
            (0.0040, 0.1415),
        ],
        24,
    )
    foot = np.array([(0.0, 0.0), (0.020, 0.0), (0.040, 0.0), (0.045, 0.001), (0.046, 0.003)])
    rim = np.array([(0.0530, 0.1045), (0.0540, 0.1060), (0.0525, 0.1075)])
    body = lathe(np.concatenate([foot, belly, rim, lid, [(0.0, 0.1420)]]), 48)
    course = smooth_curve(
        [(0.055, 0.0, 0.040), (0.078, 0.0, 0.045), (0.100, 0.0, 0.064), (0.112, 0.0, 0.090), (0.134, 0.0, 0.108)], 17
    )
    girth = smooth_curve([(0.020, 0.022), (0.018, 0.020), (0.012, 0.013), (0.0085, 0.0095), (0.0080, 0.0090)], 17)
    spout = tube(course, girth, Y, 24)
    grip = smooth_curve(
        [
            (-0.055, 0.0, 0.094),
            (-0.078, 0.0, 0.097),
            (-0.106, 0.0, 0.098),
            (-0.124, 0.0, 0.084),
            (-0.122, 0.0, 0.060),
            (-0.100, 0.0, 0.036),
            (-0.066, 0.0, 0.026),
        ],
        29,
    )
    handle = tube(grip, (0.0055, 0.0085), Y, 16, power=2.5)
    return union(body, spout, handle)


def spinning_top() -> Surface:
    """Spinning top: z from the point (origin) up through the disc to the stem's end at 0.075.

    Size 0.071 x 0.071 x 0.075 m.
    """
    peg = [(0.0, 0.0), (0.0012, 0.0003), (0.0022, 0.0014), (0.0026, 0.0035), (0.0032, 0.0080), (0.0055, 0.0110)]
    disc = smooth_curve(
        [
            (0.010, 0.0135),
            (0.026, 0.0195),
            (0.034, 0.0265),
            (0.0355, 0.0310),
            (0.032, 0.0350),
            (0.019, 0.0385),
            (0.0085, 0.0425),
            (0.0042, 0.0490),
        ],
        30,
    )
    stem = [(0.0034, 0.0560), (0.0034, 0.0640), (0.0036, 0.0720), (0.0030, 0.0742), (0.0016, 0.0750), (0.0, 0.0750)]
    return lathe(np.concatenate([peg, disc, stem]), 56)


BODIES = {
    body.__name__: body for body in (t_handle, tennis_racket, hammer, l_bracket, hollow_box, book, teapot, spinning_top)
}


def _rounded_ends(profile: list[tuple[float, float]], radius: float) -> np.ndarray:
    """Close a lathe profile at both ends with rounded edges; long straight parts are split for rounder triangles."""
    (r0, z0), (r1, z1) = profile[0], profile[-1]
    quarter = np.linspace(0.0, np.pi / 2.0, 5)
    low = np.stack([r0 - radius + radius * np.sin(quarter), z0 + radius - radius * np.cos(quarter)], axis=1)
    high = np.stack([r1 - radius + radius * np.cos(quarter), z1 - radius + radius * np.sin(quarter)], axis=1)
    rows = np.concatenate([low, profile[1:-1], high])
    longest = 0.006
    dense = [rows[:1]]
    for a, b in pairwise(rows):
        parts = max(1, round(float(np.linalg.norm(b - a)) / longest))
        dense.append(a + (b - a) * np.arange(1, parts + 1)[:, None] / parts)
    return np.concatenate([[(0.0, z0)], *dense, [(0.0, z1)]])


def _strings(centre: float, half_length: float, half_width: float) -> list[Surface]:
    """Square strings ending inside the hoop; mains and crosses differ in thickness, so that no faces coincide."""
    pitch, half = 0.024, 0.0009
    strings = []
    for k in range(-5, 6):
        reach = half_length * np.sqrt(1.0 - (k * pitch / half_width) ** 2)
        cuts = pitch * (np.arange(-7, 7) + 0.5)
        cuts = np.concatenate([[-reach], cuts[np.abs(cuts) < reach - 0.004], [reach]])
        path = np.stack([centre + cuts, 0.0 * cuts + k * pitch, 0.0 * cuts], axis=1)
        strings.append(_bar(path, Y * half, Z * half))
    for k in range(-6, 7):
        reach = half_width * np.sqrt(1.0 - (k * pitch / half_length) ** 2)
        cuts = pitch * (np.arange(-5, 5) + 0.5)
        cuts = np.concatenate([[-reach], cuts[np.abs(cuts) < reach - 0.004], [reach]])
        path = np.stack([0.0 * cuts + centre + k * pitch, cuts, 0.0 * cuts], axis=1)
        strings.append(_bar(path, Z * half * 0.8, X * half))
    return strings


def _bar(path: np.ndarray, a: np.ndarray, b: np.ndarray) -> Surface:
    """Bar of rectangular section along a straight path; half axes a and b, with a x b along the path."""
    section = np.array([a + b, b - a, -a - b, a - b])
    return loft(path[:, None] + section)
