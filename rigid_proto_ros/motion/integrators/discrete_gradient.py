# SPDX-License-Identifier: MIT
"""discrete_gradient: the energy-momentum midpoint rule with a string of any stiffness.

Over a step the string pulls with F = −μ (a + a⁺), a the vector from free end to knot, where μ makes the work of F equal
to the loss of potential exactly (Gonzalez, J. Nonlinear Sci. 6 (1996) 449): μ (l + l⁺) = T with

    T = (V(l⁺) − V(l))/(l⁺ − l) + θ c (l⁺ − l)/h,    V(l) = ½ k max(0, l − rest length)²,

θ the stretched part of the way from l to l⁺; a string that doesn't push has T ≥ 0. Slack and taut need no search: V is
smooth enough for its discrete gradient. The force acts on ½(r + F r) of the knot's arm, which makes angular momentum
about the free end exact too. Attitude and spin: integrators/midpoint_spin.py.

Order 2 while ω_s h is small, bounded energy at any ω_s h: a stiff string becomes an inextensible one, its unresolved
swing along its length wrong in phase. Given μ, what remains is one equation for the mean spin (Newton); μ itself is the
root of a monotone function, bracketed. Rest length 0 has no root to find: the force is linear in a⁺. Where the spin
turns by so much in a step that none is found, or rounding leaves one that doesn't keep the energy, the step is halved
until there is one. Where that takes too many parts the string is taken as inextensible over the step
(integrators/inextensible.py), which always has a solution.

Attitude and displacement carry low words, and everything else about the string is computed as a change
(integrators/knot.py): otherwise roundings of the knot's place, weighed by the tension, add up to 1e-8 of the energy at
1e5 rad/s.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.rotation import multiply, rotate, rotate_inverse
from .. import problem as of
from ..string import NO_DIRECTION
from ..variables import HAND_WORK, HEAT, LOW
from .equations import torque
from .inextensible import inextensible_step, kinetic_energy, potential_energy
from .integrator import ANGULAR_DAMPING, LOADS, STRING, Integrator
from .knot import knot_and_stretch, moved_pair, unit_attitude
from .midpoint_spin import (
    MAX_ITERATIONS,
    ROUNDING,
    gyroscopic_torque,
    half_turned,
    mean_torque,
    newton_correction,
)
from .runge_kutta import is_good
from .stepping import fixed_steps

_PULL_TRIALS = 100
"""Secant steps on the pull; about 5 are used, more only where the string turns slack or taut."""

_MOST_HALVINGS = 12
"""Of a step for which no solution is found: a string that turns the body about within the step."""

_LOSS = 1e-11
"""Of the energy, in one step: what differs by more is no solution but a tension that changes by its own
size within roundings.
"""

_MOST_PARTS = 256
"""Of a step, tried ones included: with 2 µs each a step of 1 ms is made in time."""

# Of the scratch array: mean spin, the force it came to, the vector from free end to knot at the start and its change;
# its length and stretch at the start.
_O, _FORCE, _A, _CHANGE, _LENGTH, _STRETCH, _SIZE = 0, 3, 6, 9, 12, 13, 14


@njit(cache=True, error_model="numpy")
def _momentum(
    y: np.ndarray, p: np.ndarray, h: float, mu: float, rho: float, s: np.ndarray
) -> tuple[float, float, float]:
    """I(ω⁺ − ω) from the mean spin s[0:3] under the pull F = −μ(a + a⁺) + ρ a; keeps F and a⁺ − a in s."""
    ox, oy, oz = s[_O], s[_O + 1], s[_O + 2]
    qx, qy, qz, qw = y[0], y[1], y[2], y[3]
    mx, my, mz, mw = half_turned(qx, qy, qz, qw, ox, oy, oz, h)
    tx, ty, tz = torque(mx, my, mz, mw, ox, oy, oz, p)
    tx, ty, tz = mean_torque(ox, oy, oz, tx, ty, tz, h)
    gx, gy, gz = gyroscopic_torque(ox, oy, oz, p)
    tx, ty, tz = tx + gx, ty + gy, tz + gz
    if p[of.HAS_STRING] != 0.0:
        R, F, G = of.ATTACH, of.ACCELERATION_BODY, of.ACCELERATION_ADDED
        # What the Cayley turn adds to the arm, in the axes of the step's start: 2(v × r + v × (v × r))/(1 + v²), v =
        # ½hω̄.
        vx, vy, vz = 0.5 * h * ox, 0.5 * h * oy, 0.5 * h * oz
        f = 2.0 / (1.0 + (vx * vx + vy * vy + vz * vz))
        cx, cy, cz = vy * p[R + 2] - vz * p[R + 1], vz * p[R] - vx * p[R + 2], vx * p[R + 1] - vy * p[R]
        dx, dy, dz = f * (cx + (vy * cz - vz * cy)), f * (cy + (vz * cx - vx * cz)), f * (cz + (vx * cy - vy * cx))
        turned = rotate(qx, qy, qz, qw, dx, dy, dz)
        push = rotate(mx, my, mz, mw, p[F], p[F + 1], p[F + 2])
        # The mean velocity is (u + ½h(push + F/m))/(1 + ½hc).
        soft = 1.0 / (1.0 + 0.5 * h * p[of.DAMPING_LINEAR])
        give = 0.5 * h * h * soft / p[of.MASS]
        for k in range(3):
            a = s[_A + k]
            free = h * soft * (y[10 + k] + 0.5 * h * (push[k] + p[G + k])) + turned[k]
            change = (free + give * (rho - 2.0 * mu) * a) / (1.0 + give * mu)
            s[_CHANGE + k] = change
            s[_FORCE + k] = rho * a - mu * (2.0 * a + change)
        # The arm's mean in the axes of the step's start; the torque there, and its ½h ω̄ × t.
        bx, by, bz = p[R] + 0.5 * dx, p[R + 1] + 0.5 * dy, p[R + 2] + 0.5 * dz
        fx, fy, fz = rotate_inverse(qx, qy, qz, qw, s[_FORCE], s[_FORCE + 1], s[_FORCE + 2])
        sx, sy, sz = by * fz - bz * fy, bz * fx - bx * fz, bx * fy - by * fx
        tx += sx - 0.5 * h * (oy * sz - oz * sy)
        ty += sy - 0.5 * h * (oz * sx - ox * sz)
        tz += sz - 0.5 * h * (ox * sy - oy * sx)
    return h * tx, h * ty, h * tz


@njit(cache=True, error_model="numpy")
def _solve_spin(y: np.ndarray, p: np.ndarray, h: float, mu: float, rho: float, s: np.ndarray) -> bool:
    """The mean spin under a given pull, from the one in s; returns whether it was found."""
    A, B, C = p[of.MOMENTS], p[of.MOMENTS + 1], p[of.MOMENTS + 2]
    change = 0.0
    # How the knot resists: h² μ/(1 + give μ) per unit of its displacement.
    give = 0.5 * h * h / p[of.MASS]
    extra = h * h * mu / (1.0 + give * mu) if p[of.HAS_STRING] != 0.0 and mu > 0.0 else 0.0
    rx, ry, rz = p[of.ATTACH], p[of.ATTACH + 1], p[of.ATTACH + 2]
    for _ in range(MAX_ITERATIONS):
        ox, oy, oz = s[_O], s[_O + 1], s[_O + 2]
        kx, ky, kz = _momentum(y, p, h, mu, rho, s)
        dx, dy, dz = 2.0 * A * (ox - y[4]) - kx, 2.0 * B * (oy - y[5]) - ky, 2.0 * C * (oz - y[6]) - kz
        ex, ey, ez = newton_correction(ox, oy, oz, dx, dy, dz, h, p, extra, rx, ry, rz)
        s[_O], s[_O + 1], s[_O + 2] = ox + ex, oy + ey, oz + ez
        before, change = change, max(abs(ex), abs(ey), abs(ez))
        size = max(abs(s[_O]), abs(s[_O + 1]), abs(s[_O + 2]))
        if change <= ROUNDING * size or (change <= 64.0 * ROUNDING * size and before != 0.0 and change >= 0.5 * before):
            return True
    return False


@njit(cache=True, error_model="numpy")
def _length_after(s: np.ndarray) -> tuple[float, float]:
    """l⁺, and l⁺ − l = (a⁺ − a)·(a⁺ + a)/(l⁺ + l) without cancellation."""
    square, change = 0.0, 0.0
    for k in range(3):
        after = s[_A + k] + s[_CHANGE + k]
        square += after * after
        change += s[_CHANGE + k] * (s[_A + k] + after)
    length = math.sqrt(square)
    total = length + s[_LENGTH]
    return length, change / total if total > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def _tension(x0: float, change: float, h: float, p: np.ndarray) -> tuple[float, float]:
    """T over a step in which the stretch x0 changes, and the part of the way θ in which the damper works."""
    k, c = p[of.STIFFNESS], p[of.STRING_DAMPING]
    x1 = x0 + change
    if p[of.BILATERAL] != 0.0:
        return 0.5 * k * (x0 + x1) + c * change / h, 1.0
    if x0 <= 0.0 and x1 <= 0.0:
        return 0.0, 0.0
    if x0 >= 0.0 and x1 >= 0.0:
        spring, part = 0.5 * k * (x0 + x1), 1.0
    else:
        # Part of the way is slack: ½k x²/|x₁ − x₀| with the stretched end's x.
        inside = max(x0, x1)
        part = inside / abs(change)
        spring = 0.5 * k * inside * part
    return max(0.0, spring + part * c * change / h), part


@njit(cache=True, error_model="numpy")
def _excess(y: np.ndarray, p: np.ndarray, h: float, mu: float, s: np.ndarray) -> tuple[float, float]:
    """μ(l + l⁺) − T(l⁺), which rises with μ, and l + l⁺. NaN where the spin was not found."""
    if not _solve_spin(y, p, h, mu, 0.0, s):
        return math.nan, math.nan
    length, change = _length_after(s)
    tension, _ = _tension(s[_STRETCH], change, h, p)
    total = s[_LENGTH] + length
    return mu * total - tension, total


@njit(cache=True, error_model="numpy")
def _lightness(y: np.ndarray, p: np.ndarray, s: np.ndarray) -> float:
    """1/m + (r × n)ᵀ I⁻¹ (r × n) with n along a: what the knot yields to a pull."""
    length = s[_LENGTH]
    if length == 0.0:
        return 1.0 / p[of.MASS]
    x, z, w = s[_A] / length, s[_A + 1] / length, s[_A + 2] / length
    nx, ny, nz = rotate_inverse(y[0], y[1], y[2], y[3], x, z, w)
    rx, ry, rz = p[of.ATTACH], p[of.ATTACH + 1], p[of.ATTACH + 2]
    a, b, c = ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx
    return 1.0 / p[of.MASS] + a * a / p[of.MOMENTS] + b * b / p[of.MOMENTS + 1] + c * c / p[of.MOMENTS + 2]


@njit(cache=True, error_model="numpy")
def _solve_pull(y: np.ndarray, p: np.ndarray, h: float, s: np.ndarray) -> float:
    """μ, the spin with it left in s; NaN when there is none."""
    lower, upper = -math.inf, math.inf
    mu = 0.0
    f, total = _excess(y, p, h, mu, s)
    if not math.isfinite(f) or f == 0.0:
        return f
    if p[of.BILATERAL] != 0.0:
        # A push so strong that 1 + ½h²μ/m vanishes is no solution.
        lower = -2.0 * p[of.MASS] / (h * h)
    # The slope of μ(l + l⁺) − T by the mass that the knot shows along the string.
    give = 0.5 * h * h * _lightness(y, p, s)
    stiff = 0.5 * p[of.STIFFNESS] + p[of.STRING_DAMPING] / h
    slope = total * (1.0 + give * stiff)
    old_mu, old_f = mu, f
    for _ in range(_PULL_TRIALS):
        lower, upper = (lower, mu) if f > 0.0 else (mu, upper)
        new = mu - f / slope
        bracketed = not (math.isinf(lower) or math.isinf(upper))
        if not lower < new < upper:
            new = 0.5 * (lower + upper) if bracketed else mu - 2.0 * f / slope
        if new == mu:
            return mu
        old_mu, old_f, mu = mu, f, new
        f, total = _excess(y, p, h, mu, s)
        if not math.isfinite(f):
            return math.nan
        # What rounding of the knot's way does to T: below it f has no sign.
        way = abs(s[_STRETCH]) + abs(s[_CHANGE]) + abs(s[_CHANGE + 1]) + abs(s[_CHANGE + 2])
        if abs(f) <= 8.0 * ROUNDING * (2.0 * stiff * way + abs(mu) * total):
            return mu
        slope = (f - old_f) / (mu - old_mu)
        if abs(f) > 0.5 * abs(old_f) and bracketed:
            # The secant stalls at a kink: halve the bracket next.
            slope = math.nan
        elif not slope > 0.0:
            slope = total * (1.0 + give * stiff)
    return mu


@njit(cache=True, error_model="numpy")
def _keeps_energy(y: np.ndarray, p: np.ndarray, h: float, out: np.ndarray, s: np.ndarray) -> bool:
    """Whether kinetic and potential energy changed by the work of loads and dampers, as a solution's do."""
    ox, oy, oz = s[_O], s[_O + 1], s[_O + 2]
    F, G, c = of.ACCELERATION_BODY, of.ACCELERATION_ADDED, p[of.DAMPING_LINEAR]
    mx, my, mz, mw = half_turned(y[0], y[1], y[2], y[3], ox, oy, oz, h)
    tx, ty, tz = torque(mx, my, mz, mw, ox, oy, oz, p)
    push = rotate(mx, my, mz, mw, p[F], p[F + 1], p[F + 2])
    work, weight = h * (ox * tx + oy * ty + oz * tz), 0.0
    for k in range(3):
        mean = 0.5 * (y[10 + k] + out[10 + k])
        work += h * p[of.MASS] * mean * (push[k] + p[G + k] - c * mean)
        weight += p[of.MASS] * abs(p[G + k])
    before = kinetic_energy(y, p) + potential_energy(s[_STRETCH], p)
    after = kinetic_energy(out, p) + potential_energy(knot_and_stretch(out, p)[4], p)
    heat = out[HEAT] - y[HEAT]
    size = max(before, after) + heat + abs(work) + weight * s[_LENGTH]
    return abs(after - before + heat - work) <= _LOSS * size + 4.0 * ROUNDING * out[HEAT]


@njit(cache=True, error_model="numpy")
def _step(y: np.ndarray, p: np.ndarray, h: float, out: np.ndarray, s: np.ndarray) -> bool:
    """One step from y into out; returns whether a solution was found."""
    s[_O], s[_O + 1], s[_O + 2] = y[4], y[5], y[6]
    if p[of.HAS_STRING] != 0.0:
        s[_A], s[_A + 1], s[_A + 2], s[_LENGTH], s[_STRETCH] = knot_and_stretch(y, p)
    mu, rho = 0.0, 0.0
    found = True
    if p[of.HAS_STRING] == 0.0 or p[of.REST_LENGTH] == 0.0:
        if p[of.HAS_STRING] != 0.0:
            # −½k(a + a⁺) − c(a⁺ − a)/h, as −μ(a + a⁺) + ρ a.
            mu, rho = 0.5 * p[of.STIFFNESS] + p[of.STRING_DAMPING] / h, 2.0 * p[of.STRING_DAMPING] / h
        found = _solve_spin(y, p, h, mu, rho, s)
    else:
        mu = _solve_pull(y, p, h, s)
        found = math.isfinite(mu)
        if found and max(s[_LENGTH], _length_after(s)[0]) < NO_DIRECTION * p[of.REST_LENGTH]:
            mu = 0.0
            found = _solve_spin(y, p, h, mu, rho, s)
    if not found:
        return False
    kx, ky, kz = _momentum(y, p, h, mu, rho, s)
    out[4], out[5], out[6] = y[4] + kx / p[of.MOMENTS], y[5] + ky / p[of.MOMENTS + 1], y[6] + kz / p[of.MOMENTS + 2]
    ox, oy, oz = s[_O], s[_O + 1], s[_O + 2]
    # q ⊗ (v, 1)/n as q and what is added to it, n² = 1 + v².
    vx, vy, vz = 0.5 * h * ox, 0.5 * h * oy, 0.5 * h * oz
    vv = vx * vx + vy * vy + vz * vz
    n = math.sqrt(1.0 + vv)
    turn = multiply(y[0], y[1], y[2], y[3], vx, vy, vz, -vv / (1.0 + n))
    for k in range(4):
        moved_pair(y, out, k, LOW + k, turn[k] / n)
    unit_attitude(out)
    out[13], out[14] = y[13], y[14]
    if p[of.TRANSLATES] != 0.0:
        _translate(y, p, h, out, s)
    return p[of.HAS_STRING] == 0.0 or _keeps_energy(y, p, h, out, s)


@njit(cache=True, error_model="numpy")
def _translate(y: np.ndarray, p: np.ndarray, h: float, out: np.ndarray, s: np.ndarray) -> None:
    """Displacement, velocity and the string's energies from the force in s."""
    ox, oy, oz = s[_O], s[_O + 1], s[_O + 2]
    F, G, c = of.ACCELERATION_BODY, of.ACCELERATION_ADDED, p[of.DAMPING_LINEAR]
    mx, my, mz, mw = half_turned(y[0], y[1], y[2], y[3], ox, oy, oz, h)
    push = rotate(mx, my, mz, mw, p[F], p[F + 1], p[F + 2])
    work = 0.0
    for k in range(3):
        force = s[_FORCE + k] if p[of.HAS_STRING] != 0.0 else 0.0
        a = push[k] + p[G + k] + force / p[of.MASS]
        mean = (y[10 + k] + 0.5 * h * a) / (1.0 + 0.5 * h * c)
        moved_pair(y, out, 7 + k, LOW + 4 + k, h * mean)
        out[10 + k] = y[10 + k] + h * (a - c * mean)
        work += force * p[of.HAND_VELOCITY + k]
    if p[of.HAS_STRING] == 0.0:
        return
    out[HAND_WORK] = y[HAND_WORK] + h * work
    if p[of.REST_LENGTH] == 0.0:
        d0, d1, d2 = s[_CHANGE], s[_CHANGE + 1], s[_CHANGE + 2]
        out[HEAT] = y[HEAT] + p[of.STRING_DAMPING] / h * (d0 * d0 + d1 * d1 + d2 * d2)
        return
    # What the pull took beyond the change of potential.
    _, change = _length_after(s)
    tension, _ = _tension(s[_STRETCH], change, h, p)
    x0, x1 = s[_STRETCH], s[_STRETCH] + change
    if p[of.BILATERAL] == 0.0:
        x0, x1 = max(x0, 0.0), max(x1, 0.0)
    if p[of.STRING_DAMPING] != 0.0:
        out[HEAT] = y[HEAT] + (tension * change - 0.5 * p[of.STIFFNESS] * (x1 - x0) * (x1 + x0))


@njit(cache=True, error_model="numpy")
def _step_in_parts(y: np.ndarray, p: np.ndarray, h: float, out: np.ndarray, part: np.ndarray, s: np.ndarray) -> bool:
    """A step as a chain of shorter ones, halved until a solution is found and doubled again where they
    meet; whether it got through.
    """
    part[:] = y
    halvings, done, whole = 1, 0, 1 << _MOST_HALVINGS
    for _ in range(_MOST_PARTS):
        size = whole >> halvings
        if _step(part, p, h * size / whole, out, s) and is_good(out):
            part[:] = out
            done += size
            if done == whole:
                return True
            while halvings > 0 and done % (2 * (whole >> halvings)) == 0:
                halvings -= 1
        else:
            halvings += 1
            if halvings > _MOST_HALVINGS:
                return False
    return False


@njit(cache=True, error_model="numpy")
def discrete_gradient_steps(y: np.ndarray, p: np.ndarray, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    new, part, scratch = y.copy(), y.copy(), np.zeros(_SIZE)
    for done in range(n):
        found = _step(y, p, h, new, scratch) and is_good(new)
        if not found and not _step_in_parts(y, p, h, new, part, scratch):
            if p[of.HAS_STRING] == 0.0:
                return done
            inextensible_step(y, p, h, new)
            if not is_good(new):
                return done
        y[:] = new
    return n


DISCRETE_GRADIENT = Integrator(
    name="discrete_gradient",
    order=2,
    evaluations=12,
    source="Gonzalez, J. Nonlinear Sci. 6 (1996) 449, with the midpoint rule of Simo and Wong (1991)",
    limits="Bounded energy at any stiffness. A swing along the string that the step doesn't resolve has the wrong "
    "phase; where the string turns the body about many times within a step, the string counts as inextensible.",
    stability_limit=1.0,
    supports=LOADS | {ANGULAR_DAMPING, STRING},
    kernel=discrete_gradient_steps,
    make_methods=fixed_steps,
    stiff=True,
)
