# SPDX-License-Identifier: MIT
"""free_body: torque-free motion, exact to rounding for any time in one step; and free_body_strang, for loads, which
combines the map ``free_step`` with kicks.

In a simulation each sample is one step from the segment's start, so errors don't accumulate. The attitude error is
below 50 ε (1 + |ω|h) rad. World forces at the COM, gravity and linear damping have a separate closed form.

In principal axes the angular velocity is given by Jacobi's elliptic functions, the attitude by a rotation about the
angular momentum. Let A, B, C be the moments and w = (w₁, w₂, w₃), C belonging to the axis about which the angular
momentum circulates in the body, and w₃ ≥ 0:

    P = B|B−A| w₂² + C|C−A| w₃²,  Q = A|C−A| w₁² + B|C−B| w₂²,  ω_p² = |C−B| P/(ABC),
    m = |B−A| Q/(|C−B| P),  m₁ = 1 − m = |C−A| (C|C−B| w₃² − A|B−A| w₁²)/(|C−B| P).

ω after h follows from the addition theorem with S = sn/ω_p, c = cn, d = dn at u = ω_p h, without inversion of an
elliptic integral or division by zero: with D = 1 − β sn² and β = B|B−A| w₂²/P,

    w₁⁺ = (w₁ c − (C−B)/A w₂w₃ S d)/D,  w₂⁺ = (w₂ c d + (C−A)/B w₁w₃ S)/D,  w₃⁺ = (w₃ d − (B−A)/C w₁w₂ S c)/D.

The attitude is R = R_L R_z(ψ) B(M), B(M) the shortest rotation that takes the angular momentum M = (Aw₁, Bw₂, Cw₃) to
the third axis and ψ' = (2E + L w₃)/(L + C w₃): all terms are positive. With dn = (1 − κs²)/(1 + κs²), s = sn of modulus
κ = (1 − √m₁)/(1 + √m₁) (Gauss's transformation), ψ' becomes f_a + f_b s²/(1 + νs²), whose integral from the start of a
period is Carlson's R_J with positive arguments. From any other phase on, the integral is that over the same time from
the start of a period plus an arc tangent (addition theorem of the third kind): a difference of two incomplete integrals
would cancel where both are large, near the middle axis.

Sources: Whittaker, A Treatise on the Analytical Dynamics of Particles and Rigid Bodies (1937), section 69; van Zon and
Schofield, J. Comput. Phys. 225 (2007) 145; Celledoni, Fassò, Säfström and Zanna, SIAM J. Sci. Comput. 30 (2008) 2084;
Byrd and Friedman, Handbook of Elliptic Integrals (1971), 116.03, for the addition theorem; the gauge and the positive
forms are derived here.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.arithmetic import (
    exponent_of,
    inverse_tangent_of,
    nearest_whole,
    pair_add,
    pair_multiply,
    scaled,
    sine_cosine,
    two_product,
    two_sum,
)
from ...base.compilation import copy_numbers, local_numbers, njit
from ...base.rotation import multiply, norm, normalize, rotate
from ...base.vectors import Quaternion, Vector
from ..loads import ANGULAR_DAMPING
from ..problem import (
    MAX_SPEED,
    VARIABLES,
    Variables,
    damping_functions,
    is_good,
    parts_of,
    undamped_torque,
)
from .integrator import LOADS, ONE_STEP, Integrator, Method

ON_SEPARATRIX = 1e-290
"""m₁ of an initial state on the separatrix to all digits: it stays near the middle axis for 670/ω_p, then leaves it. An
initial state known only to rounding does so after 40/ω_p.
"""

NO_SPIN = 1e-140
"""Fraction of the largest component of ω below which another one is set to zero: its square times a ratio of moments
would underflow.
"""


@njit(error_model="numpy", allocates=False)
def free_step(q: Quaternion, w: Vector, moments: Vector, h: float) -> tuple[Quaternion, Vector]:
    """Attitude q and ω = w (principal axes, moments ascending) after h seconds without torque."""
    wx, wy, wz = w
    i1, i2, i3 = moments
    largest = max(abs(wx), abs(wy), abs(wz))
    if largest == 0.0 or h == 0.0:
        return q, w
    # Scaling by powers of two avoids underflow and overflow, and is exact.
    e, f = exponent_of(largest), exponent_of(i3)
    wx, wy, wz, h = scaled(wx, -e), scaled(wy, -e), scaled(wz, -e), scaled(h, e)
    i1, i2, i3 = scaled(i1, -f), scaled(i2, -f), scaled(i3, -f)
    if not math.isfinite(wx + wy + wz + h):
        # The surrounding scheme has diverged; the iterations below would never end.
        return (math.nan, math.nan, math.nan, math.nan), (wx, wy, wz)
    wx = 0.0 if abs(wx) < NO_SPIN else wx
    wy = 0.0 if abs(wy) < NO_SPIN else wy
    wz = 0.0 if abs(wz) < NO_SPIN else wz
    third, first = i3 * (i3 - i2) * wz * wz, i1 * (i2 - i1) * wx * wx
    side = third - first
    if abs(side) < 1e-14 * third:
        # The sign depends on digits lost in double precision.
        side = _side_of_separatrix(i1, i2, i3, wx, wz)
    about_third = side > 0.0 if side != 0.0 else i3 - i2 >= i2 - i1
    if not about_third:
        # A rotation that exchanges the first and the third axis.
        i1, i3 = i3, i1
        wx, wy, wz = wz, -wy, wx
    flipped = wz < 0.0
    if flipped:
        wy, wz = -wy, -wz
    (rx, ry, rz, rw), (wx, wy, wz) = _circulate((i1, i2, i3), (wx, wy, wz), h)
    if flipped:
        wy, wz, ry, rz = -wy, -wz, -ry, -rz
    if not about_third:
        wx, wy, wz = wz, -wy, wx
        rx, ry, rz = rz, -ry, rx
    turned = normalize(*multiply(*q, rx, ry, rz, rw))
    return turned, (scaled(wx, e), scaled(wy, e), scaled(wz, e))


@njit(error_model="numpy", allocates=False)
def _circulate(moments: Vector, w: Vector, h: float) -> tuple[Quaternion, Vector]:
    """The rotation r xyzw (not normalized) over h, and w after it; notation of the module's docstring."""
    A, B, C = moments
    w1, w2, w3 = w
    gba, gcb, gca = abs(B - A), abs(C - B), abs(C - A)
    P = B * gba * w2 * w2 + C * gca * w3 * w3
    Q = A * gca * w1 * w1 + B * gcb * w2 * w2
    rate = math.sqrt(gcb * P / (A * B * C))
    if rate == 0.0 or Q == 0.0 or (w1 == 0.0 and w3 == 0.0):
        # Uniform rotation about w.
        size = norm(w1, w2, w3)
        s, c = sine_cosine(0.5 * size * h)
        s /= size
        return (w1 * s, w2 * s, w3 * s, c), w
    m = gba * Q / (gcb * P)
    m1 = max(gca * abs(_side_of_separatrix(A, B, C, w1, w3)) / (gcb * P), ON_SEPARATRIX)
    # Subtract whole half periods 2K, each of which changes the signs of sn and cn.
    u, K = rate * h, complete_quarter_period(m1)
    whole = nearest_whole(0.5 * u / K)
    odd = int(whole) & 1 != 0
    s, c, d = sn_cn_dn(u - 2.0 * K * whole, m, m1)
    if odd:
        s, c = -s, -c
    S = s / rate
    D = (C * gca * w3 * w3 + B * gba * w2 * w2 * c * c) / P
    v1 = (w1 * c - (C - B) / A * w2 * w3 * S * d) / D
    v2 = (w2 * c * d + (C - A) / B * w1 * w3 * S) / D
    v3 = (w3 * d - (B - A) / C * w1 * w2 * S * c) / D
    # Equal steps repeat the rounding errors of S, c and d; their effect on Q and P is removed, lest it add up.
    excess = 0.5 * (A * gca * (v1 - w1) * (v1 + w1) + B * gcb * (v2 - w2) * (v2 + w2)) / Q
    v1, v2 = v1 - excess * v1, v2 - excess * v2
    share = C * gca * v3 * v3
    # Where the third axis contributes little to P, conserving Q conserves P as well.
    if share > 0.5 * P:
        v3 -= 0.5 * (B * gba * (v2 - w2) * (v2 + w2) + C * gca * (v3 - w3) * (v3 + w3)) / share * v3
    # ψ' = f_a + f_b s²/(1 + νs²); W: the largest w₃, E2: 2E, modulus1: 1 − κ².
    M1, M2, M3 = A * w1, B * w2, C * w3
    L, E2, k1 = norm(M1, M2, M3), w1 * M1 + w2 * M2 + w3 * M3, math.sqrt(m1)
    kappa, modulus1 = m / ((1.0 + k1) * (1.0 + k1)), 4.0 * k1 / ((1.0 + k1) * (1.0 + k1))
    W = math.sqrt(P / (C * gca))
    most = L + C * W
    nu = kappa * A * Q / (gca * most * most)
    f_a, f_b = (E2 + L * W) / most, 2.0 * kappa * W * math.copysign(Q, C - B) / (most * most)
    # Integral over the time from the start of a period: R_J.
    x, y = _gauss_phase(c, s, d, k1)
    if odd:
        x = -x
    xx, yy = x * x, y * y
    integral = x * xx / 3.0 * carlson_rj(yy, yy + modulus1 * xx, 1.0, 1.0 + nu * xx)
    if whole != 0.0:
        integral += whole * 2.0 / 3.0 * carlson_rj(0.0, modulus1, 1.0, 1.0 + nu)
    # Contribution of the initial phase: x0, x1 are sn at the start and the end.
    to_1, to_2 = math.sqrt(A * gca / Q), math.copysign(1.0, C - B) * math.sqrt(B * gcb / Q)
    x0, _ = _gauss_phase(w1 * to_1, w2 * to_2, w3 / W, k1)
    x1, y1 = _gauss_phase(v1 * to_1, v2 * to_2, v3 / W, k1)
    x = -x if odd else x
    d1 = math.sqrt(y1 * y1 + modulus1 * x1 * x1)
    product = x0 * x * x1 / (1.0 + nu * x1 * x1 - nu * x0 * x * y1 * d1)
    root = math.sqrt(nu * (1.0 + nu) * (nu + kappa * kappa))
    angle = root * product
    integral += product if abs(angle) < 1e-9 else inverse_tangent_of(angle, 1.0) / root
    psi = f_a * h + f_b * (1.0 + kappa) / rate * integral
    s, c = sine_cosine(0.5 * psi)
    turned = multiply(-M2, M1, 0.0, L + M3, 0.0, 0.0, s, c)
    return multiply(*turned, B * v2, -A * v1, 0.0, L + C * v3), (v1, v2, v3)


@njit(error_model="numpy", allocates=False)
def _gauss_phase(cn: float, sn: float, dn: float, k1: float) -> tuple[float, float]:
    """sn and cn of Gauss's transformed modulus."""
    s = sn * (1.0 + k1) / (1.0 + dn)
    c = cn * math.sqrt(2.0 * (1.0 + k1) / ((dn + k1) * (1.0 + dn)))
    size = math.sqrt(s * s + c * c)
    return s / size, c / size


@njit(error_model="numpy", allocates=False)
def _side_of_separatrix(A: float, B: float, C: float, w1: float, w3: float) -> float:
    """C(C−B) w₃² − A(B−A) w₁² in pairs of doubles: near the separatrix the motion depends on its last digits."""
    g, g_low = two_sum(C, -B)
    x, x_low = pair_multiply(g, g_low, C, 0.0)
    s, s_low = two_product(w3, w3)
    x, x_low = pair_multiply(x, x_low, s, s_low)
    g, g_low = two_sum(B, -A)
    y, y_low = pair_multiply(g, g_low, A, 0.0)
    s, s_low = two_product(w1, w1)
    y, y_low = pair_multiply(y, y_low, s, s_low)
    distance, _ = pair_add(x, x_low, -y, -y_low)
    return distance


@njit(error_model="numpy", allocates=False)
def free_body_steps(y: Variables, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    q, w, _, _ = parts_of(y)
    moments = p.moments[0], p.moments[1], p.moments[2]
    for done in range(n):
        q, w = free_step(q, w, moments, h)
        if not (abs(w[0]) + abs(w[1]) + abs(w[2]) <= MAX_SPEED and math.isfinite(q[0] + q[1] + q[2] + q[3])):
            return done
        y[0], y[1], y[2], y[3] = q
        y[4], y[5], y[6] = w
    return n


FREE_BODY = Integrator(
    name="free_body",
    order=None,
    evaluations=1,
    source="Jacobi's elliptic functions; see integrators/free_body.py",
    limits="Only torque-free motion, which is exact; the step length has no effect.",
    stability_limit=math.inf,
    supports=frozenset(),
    kernel=free_body_steps,
    ways=(Method(ONE_STEP, free_body_steps, "free_body: one exact step", 1),),
)


# Elliptic functions and integrals without cancellation near the separatrix. Their parameter is m = k² and m₁ = 1 − m,
# both accurate, because there the motion depends on m₁ alone. Sources: Bulirsch, Numerische Mathematik 7 (1965) for sn,
# cn, dn; Carlson, Numerical Algorithms 10 (1995) for R_J; Abramowitz and Stegun, chapters 16 and 17, for the rest.

SMALL_ARGUMENT = 0.03
"""Below it the Maclaurin series of sn, truncated after u⁹, errs by 2e-19 (for m = 1 the next term is 0.0089 u¹¹)."""

_LEVELS = 13
"""Maximum number of Landen transformations."""

_DUPLICATION = 3e-3
"""Relative spread of the arguments at which the error of Carlson's fifth-order series (sixth power) is about 1e-16."""


@njit(error_model="numpy", allocates=False)
def complete_quarter_period(m1: float) -> float:
    """K(m) by the arithmetic-geometric mean, m₁ > 0."""
    a, b = 1.0, math.sqrt(m1)
    while abs(a - b) > 1e-8 * a:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    # The mean of two numbers this close is exact to 1e-17.
    return math.pi / (a + b)


@njit(error_model="numpy", allocates=False)
def sn_cn_dn(u: float, m: float, m1: float) -> tuple[float, float, float]:
    """sn, cn, dn (u | m) for |u| ≤ K, m₁ > 0; cn and dn keep their relative accuracy where they are small."""
    if abs(u) < 1.0:
        return _by_series(u, m)
    if m == 0.0:
        return (*sine_cosine(u), 1.0)
    return _by_landen(u, m1)


@njit(error_model="numpy", allocates=False)
def _by_series(u: float, m: float) -> tuple[float, float, float]:
    """Maclaurin series, after halving u until it is small; then duplication (A&S 16.18)."""
    doublings = 0
    while abs(u) > SMALL_ARGUMENT:
        u *= 0.5
        doublings += 1
    t = u * u
    s = u * (
        1.0
        - t
        / 6.0
        * (
            (1.0 + m)
            - t
            / 20.0
            * (
                (1.0 + m * (14.0 + m))
                - t
                / 42.0
                * (
                    (1.0 + m * (135.0 + m * (135.0 + m)))
                    - t / 72.0 * (1.0 + m * (1228.0 + m * (5478.0 + m * (1228.0 + m))))
                )
            )
        )
    )
    c, d = math.sqrt(1.0 - s * s), math.sqrt(1.0 - m * s * s)
    for _ in range(doublings):
        t = s * s
        s = 2.0 * s * c * d / (1.0 - m * t * t)
        # Separate doubling formulas for cn and dn would double their rounding errors each time.
        c, d = math.sqrt(1.0 - s * s), math.sqrt(1.0 - m * s * s)
    return s, c, d


@njit(error_model="numpy", allocates=False)
def _by_landen(u: float, m1: float) -> tuple[float, float, float]:
    """Bulirsch's sncndn: descending Landen transformations of cot am, which keeps small cn and dn accurate."""
    squeeze = m1
    means, roots = local_numbers(_LEVELS), local_numbers(_LEVELS)
    a, d, c, levels = 1.0, 1.0, 0.0, 0
    while True:
        means[levels] = a
        squeeze = math.sqrt(squeeze)
        roots[levels] = squeeze
        c = 0.5 * (a + squeeze)
        levels += 1
        if abs(a - squeeze) <= 1e-8 * a or levels == _LEVELS:
            break
        squeeze *= a
        a = c
    s, co = sine_cosine(c * u)
    if s == 0.0:
        return s, co, 1.0
    a = co / s
    c *= a
    for level in range(levels - 1, -1, -1):
        b = means[level]
        a *= c
        c *= d
        d = (roots[level] + a) / (b + a)
        a = c / b
    sn = math.copysign(1.0 / math.sqrt(c * c + 1.0), s)
    return sn, c * sn, d


@njit(error_model="numpy", allocates=False)
def _rc_of_one(e: float) -> float:
    """R_C(1, 1 + e), e ≥ 0."""
    if e < 1e-3:
        # Σ (−e)ᵏ/(2k + 1), six terms.
        return 1.0 - e * (1.0 / 3.0 - e * (0.2 - e * (1.0 / 7.0 - e * (1.0 / 9.0 - e / 11.0))))
    root = math.sqrt(e)
    return inverse_tangent_of(root, 1.0) / root


@njit(error_model="numpy", allocates=False)
def carlson_rj(x: float, y: float, z: float, p: float) -> float:
    """R_J(x, y, z, p), 0 ≤ x, y, z ≤ p with at most one of them 0."""
    delta = (p - x) * (p - y) * (p - z)
    total, weight = 0.0, 1.0
    while True:
        mean = (x + y + z + 2.0 * p) / 5.0
        dx, dy, dz = 1.0 - x / mean, 1.0 - y / mean, 1.0 - z / mean
        dp = -0.5 * (dx + dy + dz)
        if max(abs(dx), abs(dy), abs(dz), abs(dp)) < _DUPLICATION:
            break
        rx, ry, rz, rp = math.sqrt(x), math.sqrt(y), math.sqrt(z), math.sqrt(p)
        shift = rx * (ry + rz) + ry * rz
        d = (rp + rx) * (rp + ry) * (rp + rz)
        total += weight / d * _rc_of_one(weight * weight * weight * delta / (d * d))
        weight *= 0.25
        x, y, z, p = 0.25 * (x + shift), 0.25 * (y + shift), 0.25 * (z + shift), 0.25 * (p + shift)
    xyz, pp = dx * dy * dz, dp * dp
    e2 = dx * dy + dx * dz + dy * dz - 3.0 * pp
    e3 = xyz + 2.0 * e2 * dp + 4.0 * pp * dp
    e4 = (2.0 * xyz + e2 * dp + 3.0 * pp * dp) * dp
    e5 = xyz * pp
    series = (
        1.0
        - 3.0 * e2 / 14.0
        + e3 / 6.0
        + 9.0 * e2 * e2 / 88.0
        - 3.0 * e4 / 22.0
        - 9.0 * e2 * e3 / 52.0
        + 3.0 * e5 / 26.0
    )
    return weight * series / (mean * math.sqrt(mean)) + 6.0 * total


# With loads: half a kick, exact free motion, half a kick (Strang splitting). A kick is the effect of loads and damping
# on the velocities at constant attitude. Order 2, time-reversible; its error is proportional to the torque, so it is
# efficient for fast spin under weak loads, at any |ω|h; angular momentum is exact under loads without torque. Source:
# Strang, SIAM J. Numer. Anal. 5 (1968) 506; for rigid bodies McLachlan and Quispel, Acta Numerica 11 (2002) 341.


@njit(error_model="numpy", allocates=False)
def _push(y: Variables, p: np.record) -> tuple[float, ...]:
    """Torque (principal axes) and acceleration (world axes) at the attitude of y: six numbers."""
    tx, ty, tz = undamped_torque((y[0], y[1], y[2], y[3]), p)
    if not p.translates:
        return tx, ty, tz, 0.0, 0.0, 0.0
    own, added = p.acceleration_body, p.acceleration_added
    ax, ay, az = rotate(y[0], y[1], y[2], y[3], own[0], own[1], own[2])
    return tx, ty, tz, ax + added[0], ay + added[1], az + added[2]


@njit(error_model="numpy", allocates=False)
def _kick(y: Variables, p: np.record, h: float, pushed: tuple[float, ...]) -> None:
    """Apply the rates of ``_push`` to ω and the added velocity for h seconds, in place; damping in closed form."""
    angular, linear = p.damping_angular, p.damping_linear
    for k in range(3):
        rate = pushed[k] / p.moments[k]
        if angular == 0.0:
            y[4 + k] += h * rate
        else:
            # ω' = rate − z ω: ω + h φ₁(zh)(rate − z ω).
            z = angular / p.moments[k]
            y[4 + k] += h * damping_functions(z * h)[0] * (rate - z * y[4 + k])
        if p.translates:
            y[10 + k] += h * damping_functions(linear * h)[0] * (pushed[3 + k] - linear * y[10 + k])


@njit(error_model="numpy", allocates=False)
def free_body_strang_steps(y: Variables, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    moments = p.moments[0], p.moments[1], p.moments[2]
    new = local_numbers(VARIABLES)
    copy_numbers(y, new)
    pushed = _push(new, p)
    for done in range(n):
        _kick(new, p, 0.5 * h, pushed)
        q, w, _, _ = parts_of(new)
        (new[0], new[1], new[2], new[3]), (new[4], new[5], new[6]) = free_step(q, w, moments, h)
        if p.translates:
            for k in range(3):
                new[7 + k] += h * new[10 + k]
        # The next step's first half kick uses the same attitude.
        pushed = _push(new, p)
        _kick(new, p, 0.5 * h, pushed)
        if not is_good(new):
            return done
        copy_numbers(new, y)
    return n


FREE_BODY_STRANG = Integrator(
    name="free_body_strang",
    order=2,
    evaluations=1,
    source="Strang, SIAM J. Numer. Anal. 5 (1968) 506",
    limits="No string; the error per step grows with torque times h³; spin alone causes no error.",
    stability_limit=math.inf,
    supports=LOADS | {ANGULAR_DAMPING},
    kernel=free_body_strang_steps,
)
