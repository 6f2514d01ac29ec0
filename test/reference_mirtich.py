# SPDX-License-Identifier: MIT
"""Mirtich's method as an independent check: volume integrals by projection of each face onto a coordinate plane.

B. Mirtich, "Fast and Accurate Computation of Polyhedral Mass Properties", Journal of Graphics Tools 1(2), 1996:
the divergence theorem turns volume into face integrals, the projection along the normal's largest component into
plane ones, Green's theorem into sums over edges. Normals are Newell's (Sutherland, Sproull, Schumacker 1974), so that
whole polygons go in. Shares no formula with the tetrahedron sums; tests compare the two.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np


def _newell(ring: np.ndarray) -> np.ndarray:
    """Normal (3,) of a ring (k, 3), its length twice the area."""
    following = np.roll(ring, -1, axis=0)
    return np.array(
        [
            np.sum(
                (ring[:, (k + 1) % 3] - following[:, (k + 1) % 3]) * (ring[:, (k + 2) % 3] + following[:, (k + 2) % 3])
            )
            for k in range(3)
        ]
    )


def _projection_integrals(ring: np.ndarray, a: int, b: int) -> dict[str, float]:
    """∫ αᵖ βᵠ over the projection of the ring on the (a, b) plane, p + q ≤ 3: Mirtich's equations 22 to 31."""
    total = dict.fromkeys(("1", "a", "aa", "aaa", "b", "bb", "bbb", "ab", "aab", "abb"), 0.0)
    for p, q in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        a0, b0, a1, b1 = p[a], p[b], q[a], q[b]
        da, db = a1 - a0, b1 - b0
        c1 = a1 + a0
        ca = a1 * c1 + a0**2
        caa = a1 * ca + a0**3
        caaa = a1 * caa + a0**4
        cb = b1 * (b1 + b0) + b0**2
        cbb = b1 * cb + b0**3
        cbbb = b1 * cbb + b0**4
        cab = 3 * a1**2 + 2 * a1 * a0 + a0**2
        kab = a1**2 + 2 * a1 * a0 + 3 * a0**2
        caab = a0 * cab + 4 * a1**3
        kaab = a1 * kab + 4 * a0**3
        cabb = 4 * b1**3 + 3 * b1**2 * b0 + 2 * b1 * b0**2 + b0**3
        kabb = b1**3 + 2 * b1**2 * b0 + 3 * b1 * b0**2 + 4 * b0**3
        total["1"] += db * c1
        total["a"] += db * ca
        total["aa"] += db * caa
        total["aaa"] += db * caaa
        total["b"] += da * cb
        total["bb"] += da * cbb
        total["bbb"] += da * cbbb
        total["ab"] += db * (b1 * cab + b0 * kab)
        total["aab"] += db * (b1 * caab + b0 * kaab)
        total["abb"] += da * (a1 * cabb + a0 * kabb)
    divisor = {"1": 2, "a": 6, "aa": 12, "aaa": 20, "b": -6, "bb": -12, "bbb": -20, "ab": 24, "aab": 60, "abb": -60}
    return {key: total[key] / divisor[key] for key in total}


def mirtich_moments(vertices: np.ndarray, rings: Iterable) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centroid (3,) and inertia (3, 3) about the centroid at unit density.

    vertices (n, 3); rings: vertex numbers of each planar polygon, counterclockwise from outside. Sums are taken about
    the bounding box's centre; polygons without area are passed over.
    """
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    points = vertices - middle
    volume = 0.0
    first, second, product = np.zeros(3), np.zeros(3), np.zeros(3)
    for indices in rings:
        ring = points[indices]
        normal = _newell(ring)
        length = np.linalg.norm(normal)
        if length == 0.0:
            continue
        n = normal / length
        c = int(np.argmax(np.abs(n)))
        a, b = (c + 1) % 3, (c + 2) % 3
        w = -float(n @ ring[0])
        pi = _projection_integrals(ring, a, b)
        na, nb, nc = n[a], n[b], n[c]
        k1, k2, k3, k4 = 1 / nc, nc**-2, nc**-3, nc**-4
        fa, fb = k1 * pi["a"], k1 * pi["b"]
        fc = -k2 * (na * pi["a"] + nb * pi["b"] + w * pi["1"])
        faa, fbb = k1 * pi["aa"], k1 * pi["bb"]
        fcc = k3 * (
            na**2 * pi["aa"] + 2 * na * nb * pi["ab"] + nb**2 * pi["bb"]
            + w * (2 * (na * pi["a"] + nb * pi["b"]) + w * pi["1"])
        )  # fmt: skip
        faaa, fbbb = k1 * pi["aaa"], k1 * pi["bbb"]
        fccc = -k4 * (
            na**3 * pi["aaa"] + 3 * na**2 * nb * pi["aab"] + 3 * na * nb**2 * pi["abb"] + nb**3 * pi["bbb"]
            + 3 * w * (na**2 * pi["aa"] + 2 * na * nb * pi["ab"] + nb**2 * pi["bb"])
            + w**2 * (3 * (na * pi["a"] + nb * pi["b"]) + w * pi["1"])
        )  # fmt: skip
        faab = k1 * pi["aab"]
        fbbc = -k2 * (na * pi["abb"] + nb * pi["bbb"] + w * pi["bb"])
        fcca = k3 * (
            na**2 * pi["aaa"] + 2 * na * nb * pi["aab"] + nb**2 * pi["abb"]
            + w * (2 * (na * pi["aa"] + nb * pi["ab"]) + w * pi["a"])
        )  # fmt: skip
        volume += n[0] * {a: fa, b: fb, c: fc}[0]
        for axis, square, cube, mixed in ((a, faa, faaa, faab), (b, fbb, fbbb, fbbc), (c, fcc, fccc, fcca)):
            first[axis] += n[axis] * square / 2
            second[axis] += n[axis] * cube / 3
            product[axis] += n[axis] * mixed / 2  # ∫ x_axis x_(axis + 1)
    centroid = first / volume
    moment = np.diag(second)
    for k in range(3):
        moment[k, (k + 1) % 3] = moment[(k + 1) % 3, k] = product[k]
    moment -= volume * np.outer(centroid, centroid)
    return volume, centroid + middle, np.trace(moment) * np.eye(3) - moment
