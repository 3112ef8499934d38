"""Implicit steps of independent particles: Newton's method with exact 3 × 3 Jacobians.

The unknown is the velocity V at a time t + c h, with X = X₀ + γ h V. A particle for which no solution is found becomes NaN,
so that its block is restored and the step that failed is found; `unsolved` then gives the residual and the iterations.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import kernel, outlined
from particlesim.engine.state.columns import fetch, recall, span, type_of
from particlesim.engine.step.particle_step import STEPS, Newtonian, Overdamped, derivative
from particlesim.integrators.implicit import ImplicitRecord
from particlesim.laws.registry import force, force_dv, force_dx, moved_to, times, velocity, velocity_dx

ROUNDING = 8
"""Residuals of this many rounding errors of position and velocity count as zero."""
EPSILON = {float: 2.0**-52, np.float64: 2.0**-52, np.float32: 2.0**-23}
"""The rounding error of 1 in each precision."""
GROWTH = 4.0
"""Growth of the residual in an iteration beyond which half of the change is taken back."""
HALVINGS = 6
"""How often that is done in a row."""


class Equation(NamedTuple):
    """Residual V − V₀ − γ h a [m/s], −1 times its derivative by V beyond the unit matrix, and the part of it by position."""

    residual: tuple[float, float, float]
    slope: tuple[float, ...]
    by_place: tuple[float, ...]


class Start(NamedTuple):
    """X₀, V₀, the first guess of V, and γ h: how long V takes X₀ to X, and the acceleration there V₀ to V."""

    x: tuple[float, float, float]
    v: tuple[float, float, float]
    guess: tuple[float, float, float]
    reach: float


class Solution(NamedTuple):
    """The particle at the solved time, whether it solves the equations, the relative residual, and iterations."""

    particle: Any
    solved: bool
    left: float
    iterations: int


def implicit(method: Any, dynamics: Any, forces: Any, p: Any, h: Any, memory: Any) -> Any:
    """A step whose equations are solved; one that has no solution leaves the particle not finite."""
    found = solved(method, dynamics, forces, p, h, memory)
    q = new_state(method.ahead, p, found.particle, p.t + h)
    wild = type_of(q.x, 0 if found.solved else np.nan)
    q = moved_to(q, q.x + wild, q.y, q.z, q.vx, q.vy, q.vz, q.t)
    return q, recollected(memory, p, q, h)


STEPS[ImplicitRecord] = implicit


def new_state(ahead: Any, p: Any, q: Any, t: Any) -> Any:
    """The particle at the end of the step from the solved one, which may be its middle."""
    if ahead is None:
        return moved_to(q, q.x, q.y, q.z, q.vx, q.vy, q.vz, t)
    return moved_to(
        q,
        ahead * q.x - p.x,
        ahead * q.y - p.y,
        ahead * q.z - p.z,
        ahead * q.vx - p.vx,
        ahead * q.vy - p.vy,
        ahead * q.vz - p.vz,
        t,
    )


def recollected(memory: Any, p: Any, q: Any, h: Any) -> Any:
    """The memory of a two-step method: the changes of position and velocity, and the step."""
    if len(memory) == 0:
        return memory
    return (
        q.x - p.x,
        q.y - p.y,
        q.z - p.z,
        q.vx - p.vx,
        q.vy - p.vy,
        q.vz - p.vz,
        h,
    )


def start(method: Any, dynamics: Any, forces: Any, p: Any, h: Any, memory: Any) -> Any:
    """X₀ and V₀ of a step, and the first guess."""
    if isinstance(dynamics, Newtonian) and method.slope is None and method.past is None:
        return Start((p.x, p.y, p.z), (p.vx, p.vy, p.vz), (p.vx, p.vy, p.vz), method.gamma * h)
    if method.slope is not None:
        r, k = derivative(dynamics, forces, p), method.slope * h
        return Start(
            (p.x + k * r.x, p.y + k * r.y, p.z + k * r.z),
            (p.vx + k * r.vx, p.vy + k * r.vy, p.vz + k * r.vz),
            (r.x, r.y, r.z),
            method.gamma * h,
        )
    if method.past is None:
        r = derivative(dynamics, forces, p)
        return Start((p.x, p.y, p.z), (p.vx, p.vy, p.vz), (r.x, r.y, r.z), method.gamma * h)
    # A first step is by the trapezoidal rule, which gives no energy to a spring however stiff, as a past under the present
    # force would: (ω h)² / 16 times what there is. Without inertia such a past gives none, and damps what is stiff.
    r, k = derivative(dynamics, forces, p), method.past
    first = type_of(h, 0.5 if isinstance(dynamics, Newtonian) else 1 / 3) * h
    dx, dy, dz, ux, uy, uz, known = memory
    go_on = (known == h) & (known > 0)
    dx, ux = k * dx if go_on else first * r.x, k * ux if go_on else first * r.vx
    dy, uy = k * dy if go_on else first * r.y, k * uy if go_on else first * r.vy
    dz, uz = k * dz if go_on else first * r.z, k * uz if go_on else first * r.vz
    return Start(
        (p.x + dx, p.y + dy, p.z + dz),
        (p.vx + ux, p.vy + uy, p.vz + uz),
        (r.x, r.y, r.z),
        method.gamma * h if go_on else h - first,
    )


def equation(dynamics: Any, forces: Any, p: Any, s: Any) -> Any:
    """The equations of a step at a particle's position and velocity."""
    if isinstance(dynamics, Newtonian):
        fx, fy, fz = force(forces, p)
        k = s.reach * p.w
        by_place = scaled_sum(k, force_dx(forces, p), k - k, force_dx(forces, p))
        slope = scaled_sum(s.reach, by_place, k, force_dv(forces, p))
        u, v, w = s.v
        return Equation((p.vx - u - k * fx, p.vy - v - k * fy, p.vz - w - k * fz), slope, by_place)

    if isinstance(dynamics, Overdamped):
        fx, fy, fz = force(forces, p)
        u, v, w = velocity(dynamics.flow, p)
        one = type_of(s.reach, 1)
        k = one / dynamics.gamma
        by_place = scaled_sum(one, velocity_dx(dynamics.flow, p), k, force_dx(forces, p))
        slope = scaled_sum(s.reach, by_place, k - k, by_place)
        return Equation((p.vx - u - k * fx, p.vy - v - k * fy, p.vz - w - k * fz), slope, by_place)

    u, v, w = velocity(dynamics.flow, p)
    one = type_of(s.reach, 1)
    gradient = velocity_dx(dynamics.flow, p)
    by_place = scaled_sum(one, gradient, one - one, gradient)
    slope = scaled_sum(s.reach, by_place, one - one, by_place)
    return Equation((p.vx - u, p.vy - v, p.vz - w), slope, by_place)


def scaled_sum(a: Any, m: Any, b: Any, n: Any) -> Any:
    """a M + b N, in the precision of a."""
    return (
        a * type_of(a, m[0]) + b * type_of(a, n[0]),
        a * type_of(a, m[1]) + b * type_of(a, n[1]),
        a * type_of(a, m[2]) + b * type_of(a, n[2]),
        a * type_of(a, m[3]) + b * type_of(a, n[3]),
        a * type_of(a, m[4]) + b * type_of(a, n[4]),
        a * type_of(a, m[5]) + b * type_of(a, n[5]),
        a * type_of(a, m[6]) + b * type_of(a, n[6]),
        a * type_of(a, m[7]) + b * type_of(a, n[7]),
        a * type_of(a, m[8]) + b * type_of(a, n[8]),
    )


def solution_of(s: Any, x: Any, y: Any, z: Any) -> Any:
    """Solve (1 − S) δ = (x, y, z) by the adjugate; not finite where the matrix is singular."""
    one = type_of(x, 1)
    a, b, c = one - s[0], -s[1], -s[2]
    d, e, f = -s[3], one - s[4], -s[5]
    g, h, i = -s[6], -s[7], one - s[8]
    ax, ay, az = e * i - f * h, c * h - b * i, b * f - c * e
    bx, by, bz = f * g - d * i, a * i - c * g, c * d - a * f
    cx, cy, cz = d * h - e * g, b * g - a * h, a * e - b * d
    k = one / (a * ax + b * bx + c * cx)
    return k * (ax * x + ay * y + az * z), k * (bx * x + by * y + bz * z), k * (cx * x + cy * y + cz * z)


def placed(p: Any, s: Any, vx: Any, vy: Any, vz: Any, t: Any) -> Any:
    """The particle with a velocity V at X₀ + γ h V."""
    x, y, z = s.x
    return moved_to(p, x + s.reach * vx, y + s.reach * vy, z + s.reach * vz, vx, vy, vz, t)


def length(x: Any, y: Any, z: Any) -> Any:
    """|(x, y, z)|."""
    return np.sqrt(x * x + y * y + z * z)


@outlined
def solved(method: Any, dynamics: Any, forces: Any, p: Any, h: Any, memory: Any) -> Any:
    """Solve the equations of a step."""
    s, t = start(method, dynamics, forces, p, h, memory), p.t + method.node * h
    u, v, w = s.guess
    if method.newton is None:
        e = equation(dynamics, forces, moved_to(p, p.x, p.y, p.z, u, v, w, t), s)
        rx, ry, rz = e.residual
        gx, gy, gz = times(e.by_place, u, v, w)
        dx, dy, dz = solution_of(e.slope, s.reach * gx - rx, s.reach * gy - ry, s.reach * gz - rz)
        return Solution(placed(p, s, u + dx, v + dy, w + dz, t), True, 0.0, 1)
    small = ROUNDING * EPSILON[type(p.x)]
    q = placed(p, s, u, v, w, t)
    dx, dy, dz = u - u, v - v, w - w
    first, last, taken, halved, iterations = 0.0, np.inf, 1.0, 0, 0
    while True:
        e = equation(dynamics, forces, q, s)
        rx, ry, rz = e.residual
        size = float(length(rx, ry, rz))
        first = size if iterations == 0 else first
        scale = length(q.x, q.y, q.z) + s.reach * (length(q.vx, q.vy, q.vz) + length(*s.v))
        # What moves less in a step than places are rounded is still accelerated.
        rounded = (iterations > 0) & (s.reach * size <= small * scale)
        if size <= method.newton.tolerance * first or rounded:
            return Solution(q, True, size / first if first > 0 else 0.0, iterations)
        if size > GROWTH * last and halved < HALVINGS:
            halved, taken = halved + 1, 0.5 * taken
            back = type_of(q.x, -taken)
        elif iterations == method.newton.limit or not size < np.inf:
            return Solution(q, False, size / first, iterations)
        else:
            dx, dy, dz = solution_of(e.slope, -rx, -ry, -rz)
            last, halved, taken, iterations = size, 0, 1.0, iterations + 1
            back = type_of(q.x, 1)
        q = placed(p, s, q.vx + back * dx, q.vy + back * dy, q.vz + back * dz, t)


@kernel
def unsolved(program: Any, c: Any, i: Any, t: Any, end: Any, dt: Any) -> Any:
    """The relative residual, and iterations, where particle i has no solution in the step; (0, 0) where it has."""
    begin, h = span(c.clock, i, t, end, type_of(c.x[i], dt))
    p = fetch(c, i, begin)
    found = solved(program.method, program.dynamics, program.forces, p, h, recall(c.memory, i))
    if found.solved:
        return 0.0, 0
    return found.left, found.iterations
