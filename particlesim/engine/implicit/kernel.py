"""Implicit steps of an island: one linear solve, or Newton's method.

The unknown is the velocity V of all particles at a time t + c h, with X = X₀ + γ h V. A Newton iteration linearises at
(X, V), without the indefinite part of compressed springs (`linear_system`), and solves for the change of V. That part is
missing in the matrix only, not in the forces, so that a converged step solves the equations of the method; even without
convergence, backward Euler is of first order. Pinned particles have no unknown: they do not move, or follow a path.
"""

from __future__ import annotations

from typing import Any

from particlesim.compiler import kernel
from particlesim.engine.barrier import meet
from particlesim.engine.coupled.forces import evaluate, roll, twist
from particlesim.engine.coupled.kernel import begin_step, end_interval, end_step, inertialess, pauses
from particlesim.engine.implicit.contacts import may_be_held, solve_around
from particlesim.engine.implicit.krylov import clear
from particlesim.engine.implicit.linear_system import BEFORE
from particlesim.engine.implicit.solution import finish, solve_step
from particlesim.engine.implicit.staged import begun
from particlesim.engine.state.columns import block_of, fetch, in_step, recall, span, type_of
from particlesim.engine.step.particle_step import Newtonian
from particlesim.laws.registry import velocity


def evolve_implicit(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    """A step of an island: its equations are solved, and give its end."""
    reach = type_of(h, method.gamma) * h
    begin(method, parts, bonds, c, work, share, t, end, h)
    turn_ahead(c, share, type_of(h, method.node) * h)
    if solve_step(method, parts, bonds, c, work, share, t, end, h, False):
        finish(method, c, work, share, reach, t, end, h)
        turn(c, work.force, share, t, end, h)
    else:
        share.wild[8 * share.number] = 1


def history(memory: Any, i: Any) -> Any:
    """x − x₋ and v − v₋ of particle i, and the step for which they hold; zeros for a method without a past."""
    if len(memory) == 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return recall(memory, i)


def slope_of(dynamics: Any, forces: Any, p: Any, fx: Any, fy: Any, fz: Any) -> Any:
    """Velocity and acceleration of a particle under a force, and which of both the solution begins with."""
    if isinstance(dynamics, Newtonian):
        return p.vx, p.vy, p.vz, p.w * fx, p.w * fy, p.w * fz
    wx, wy, wz = velocity(dynamics.flow, p)
    g, zero = dynamics.gamma, p.x - p.x
    return wx + fx / g, wy + fy / g, wz + fz / g, zero, zero, zero


def begin(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any
) -> None:
    """X₀, V₀ and the first guess; returns when those of all shares are there."""
    if method.slope != 0 or method.past != 0 or inertialess(parts):
        evaluate(parts, bonds, c, work, share, t, None)
    else:
        clear(work.force, share.first, share.last)
    for part in parts:
        begin_part(method, part, c, work, share, t, end, h)
    meet(share.gate, share.threads)


def begin_part(method: Any, part: Any, c: Any, work: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """`begin` for the particles of a group that are in a share."""
    s, force = work.system, work.force
    past, half = type_of(h, method.past), type_of(h, 0.5)
    lean, reach = type_of(h, method.slope) * h, type_of(h, method.gamma) * h
    drift = type_of(h, method.drift) * h + lean
    for i in range(max(share.first, part.first), min(share.last, part.last)):
        _, hi = span(c.clock, i, t, end, h)
        s.free[i], s.held[i] = type_of(h, 1 if hi > 0 else 0), 0
        p = fetch(c, i, t)
        ux, uy, uz, ax, ay, az = slope_of(
            part.dynamics, part.forces, p, force[0, i], force[1, i], force[2, i]
        )
        dx, dy, dz, ex, ey, ez, known = history(c.memory, i)
        if len(c.memory) > 0:
            s.wall[BEFORE, i], s.wall[BEFORE + 1, i], s.wall[BEFORE + 2, i] = ex, ey, ez
        if known != h:  # as from a step before under the same force
            dx, dy, dz = h * (ux - half * h * ax), h * (uy - half * h * ay), h * (uz - half * h * az)
            ex, ey, ez = h * ax, h * ay, h * az
        s.base[0, i], s.base[3, i] = p.x + past * dx + drift * ux, p.vx + past * ex + lean * ax
        s.base[1, i], s.base[4, i] = p.y + past * dy + drift * uy, p.vy + past * ey + lean * ay
        s.base[2, i], s.base[5, i] = p.z + past * dz + drift * uz, p.vz + past * ez + lean * az
        if hi > 0:
            c.vx[i], c.vy[i], c.vz[i] = ux, uy, uz
            if not method.linear:
                c.x[i] = s.base[0, i] + reach * ux
                c.y[i] = s.base[1, i] + reach * uy
                c.z[i] = s.base[2, i] + reach * uz
        led = s.free[i] if method.linear else type_of(h, 0)
        s.lead[0, i], s.lead[1, i], s.lead[2, i] = led * ux, led * uy, led * uz


def turn_ahead(c: Any, share: Any, ahead: Any) -> None:
    """Spheres turn explicitly: by as much as they would at their present rate until the time at which forces are taken."""
    if c.spin is not None:
        s = c.spin
        for i in range(share.first, share.last):
            s.ax[i], s.ay[i], s.az[i] = ahead * s.wx[i], ahead * s.wy[i], ahead * s.wz[i]
        meet(share.gate, share.threads)


def turn(c: Any, force: Any, share: Any, t: Any, end: Any, h: Any) -> None:
    """The end of a step of spinning particles, by the torques of the solved state."""
    if c.spin is not None:
        half, whole = type_of(h, 0.5), type_of(h, 1)
        for i in range(share.first, share.last):
            c.spin.ax[i] = c.spin.ay[i] = c.spin.az[i] = 0
        for lo in range(share.first, share.last, share.chunk):
            hi = min(lo + share.chunk, share.last)
            q = block_of(c, lo, hi)
            roll(q, half, t, end, h)
            twist(q, force[3, lo:hi], force[4, lo:hi], force[5, lo:hi], whole, t, end, h)
            roll(q, half, t, end, h)


@kernel
def step_island_implicit(
    method: Any, parts: Any, bonds: Any, c: Any, work: Any, share: Any, first_step: Any, steps: Any, dt: Any
) -> int:
    """As `step_island`, by an implicit method. What it left in `report` of the system tells how the last step ended."""
    h = type_of(c.x[0], dt)
    for step in range(steps):
        t, end = (first_step + step) * dt, (first_step + step + 1) * dt
        begin_step(c, work, share)
        now = begun(method, c, work, share, h)
        evolve_implicit(now, parts, bonds, in_step(c, t, end), work, share, t, end, h)
        if may_be_held(parts, bonds, c, work, share):
            solve_around(now, parts, bonds, c, work, share, t, end, h)
        if not end_step(parts, bonds, c, work, share, t, end, h):
            return step
        if pauses(share, step, steps):
            return step + 1
    end_interval(parts, bonds, c, work, share, (first_step + steps) * dt)
    return steps
