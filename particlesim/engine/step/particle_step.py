"""One step of one particle, for every family of methods and both kinds of dynamics; inlined into the block kernel.

`advance(method, dynamics, forces, p, h, memory)` returns the particle after a step of h and the method's memory.
The coefficients come from `particlesim.integrators`; here is what a kick, a drift and a Runge–Kutta stage are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from particlesim.integrators.adaptive import EmbeddedRecord
from particlesim.integrators.base import CompositionRecord, RungeKuttaRecord, VerletRecord
from particlesim.laws.registry import force, moved_to, velocity


class Newtonian(NamedTuple):
    """Second-order dynamics: x' = v, v' = f/m."""


class Overdamped(NamedTuple):
    """Dynamics without inertia: x' = w(x, t) + f/γ, with γ the drag coefficient [kg/s], w the fluid's velocity."""

    gamma: float
    flow: tuple[Any, ...]


class Tracer(NamedTuple):
    """A particle that moves with the fluid: x' = w(x, t)."""

    flow: tuple[Any, ...]


class Rate(NamedTuple):
    """Time derivative of a particle's position and velocity."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float


def restart(memory: Any) -> Any:
    """A method's memory after something else changed the velocity: its last number is 0, so that it does not hold."""
    if len(memory) == 0:
        return memory
    return (*memory[:-1], memory[-1] - memory[-1])


def newtonian(dynamics: Any, forces: Any, p: Any) -> Rate:
    """x' = v, v' = f/m."""
    fx, fy, fz = force(forces, p)
    return Rate(p.vx, p.vy, p.vz, fx * p.w, fy * p.w, fz * p.w)


def overdamped(dynamics: Any, forces: Any, p: Any) -> Rate:
    """x' = w(x, t) + f/γ."""
    fx, fy, fz = force(forces, p)
    wx, wy, wz = velocity(dynamics.flow, p)
    g = dynamics.gamma
    return Rate(wx + fx / g, wy + fy / g, wz + fz / g, g - g, g - g, g - g)


def tracer(dynamics: Any, forces: Any, p: Any) -> Rate:
    """x' = w(x, t)."""
    wx, wy, wz = velocity(dynamics.flow, p)
    return Rate(wx, wy, wz, wx - wx, wy - wy, wz - wz)


RATES: dict[type, Callable[..., Rate]] = {Newtonian: newtonian, Overdamped: overdamped, Tracer: tracer}
"""For each kind of dynamics the rate of change of a particle, a function of (dynamics, forces, p)."""


def derivative(dynamics: Any, forces: Any, p: Any) -> Rate:
    """Rate of change of a particle under its forces."""
    return RATES[type(dynamics)](dynamics, forces, p)


def moved(p: Any, h: Any, r: Any, t: Any) -> Any:
    """The particle after h times a rate, at time t; a rate of None leaves it in place."""
    if r is None:
        return moved_to(p, p.x, p.y, p.z, p.vx, p.vy, p.vz, t)
    return moved_to(
        p,
        p.x + h * r.x,
        p.y + h * r.y,
        p.z + h * r.z,
        p.vx + h * r.vx,
        p.vy + h * r.vy,
        p.vz + h * r.vz,
        t,
    )


def accumulate(w: Any, r: Any, rest: Any) -> Any:
    """w r + rest, where rest may be None."""
    if rest is None:
        return Rate(w * r.x, w * r.y, w * r.z, w * r.vx, w * r.vy, w * r.vz)
    return Rate(
        rest.x + w * r.x,
        rest.y + w * r.y,
        rest.z + w * r.z,
        rest.vx + w * r.vx,
        rest.vy + w * r.vy,
        rest.vz + w * r.vz,
    )


def weigh(row: Any, slopes: Any) -> Any:
    """Σ row_j slopes_j, None where the whole row is None."""
    if len(row) == 0:
        return None
    if row[-1] is None:
        return weigh(row[:-1], slopes[:-1])
    return accumulate(row[-1], slopes[-1], weigh(row[:-1], slopes[:-1]))


def displaced(p: Any, h: Any, row: Any, slopes: Any, t: Any) -> Any:
    """The particle moved by h Σ row_j slopes_j, at time t. A single slope costs one multiplication of h."""
    used = [j for j, weight in enumerate(row) if weight is not None]
    if len(used) == 1:
        return moved(p, row[used[0]] * h, slopes[used[0]], t)
    return moved(p, h, weigh(row, slopes), t)


def stages(a: Any, c: Any, dynamics: Any, forces: Any, p: Any, h: Any, slopes: Any) -> Any:
    """The slopes of all stages: k_i = f(t + c_i h, y + h Σ_j a_ij k_j)."""
    if len(a) == 0:
        return slopes
    q = displaced(p, h, a[0], slopes, p.t + c[0] * h)
    slope = derivative(dynamics, forces, q)
    return stages(a[1:], c[1:], dynamics, forces, p, h, (*slopes, slope))


def kick(fraction: Any, forces: Any, p: Any, h: Any) -> Any:
    """v += fraction h f/m."""
    if fraction is None:
        return p
    fx, fy, fz = force(forces, p)
    k = fraction * h * p.w
    return moved_to(p, p.x, p.y, p.z, p.vx + k * fx, p.vy + k * fy, p.vz + k * fz, p.t)


def drift(fraction: Any, p: Any, h: Any) -> Any:
    """x += fraction h v, t += fraction h."""
    if fraction is None:
        return p
    s = fraction * h
    return moved_to(p, p.x + s * p.vx, p.y + s * p.vy, p.z + s * p.vz, p.vx, p.vy, p.vz, p.t + s)


def compose(kicks: Any, drifts: Any, forces: Any, p: Any, h: Any) -> Any:
    """Kick, drift, kick, drift ... in the order of the composition."""
    if len(kicks) == 0:
        return p
    q = drift(drifts[0], kick(kicks[0], forces, p, h), h)
    return compose(kicks[1:], drifts[1:], forces, q, h)


def composition(method: Any, dynamics: Any, forces: Any, p: Any, h: Any, memory: Any) -> Any:
    """A step of kicks and drifts."""
    return compose(method.kicks, method.drifts, forces, p, h), memory


def runge_kutta(method: Any, dynamics: Any, forces: Any, p: Any, h: Any, memory: Any) -> Any:
    """A step along the weighted mean of the slopes of its stages."""
    slopes = stages(method.a, method.c, dynamics, forces, p, h, ())
    return moved(p, h, weigh(method.b, slopes), p.t + h), memory


def verlet(method: Any, dynamics: Any, forces: Any, p: Any, h: Any, memory: Any) -> Any:
    """A step of the Størmer–Verlet method, which remembers the last displacement over h."""
    fx, fy, fz = force(forces, p)
    k = h * p.w
    ax, ay, az = k * fx, k * fy, k * fz
    ux, uy, uz, known = memory
    # (x_n − x_{n−1})/h, or its value after a (re)start: v_0 − ½ h a_0. A step of no length (h = 0, which ends exactly
    # at an impact) must not take the 0 of `restart` for its own.
    go_on = (known == h) & (known > 0)
    ux = ux if go_on else p.vx - method.half * ax
    uy = uy if go_on else p.vy - method.half * ay
    uz = uz if go_on else p.vz - method.half * az
    ux, uy, uz = ux + ax, uy + ay, uz + az
    q = moved_to(
        p,
        p.x + h * ux,
        p.y + h * uy,
        p.z + h * uz,
        ux + method.half * ax,
        uy + method.half * ay,
        uz + method.half * az,
        p.t + h,
    )
    return q, (ux, uy, uz, h)


class BentRecord(NamedTuple):
    """The path of a step by another method: the velocity changes by `turn` in a unit of time [m/s²], and the position at a
    time s after the beginning is s² `bend` [m/s²] off the straight line. `late`: what its velocities lack to be those of its
    places, if they change with these by `turn` [m/s]; None if that does not matter."""

    turn: Any
    bend: Any
    late: Any = None


def bent(method: Any, dynamics: Any, forces: Any, p: Any, h: Any, memory: Any) -> Any:
    """A part of a way that is known."""
    (x, y, z), (ax, ay, az) = method.bend, method.turn
    place = p.x + h * (p.vx + h * x), p.y + h * (p.vy + h * y), p.z + h * (p.vz + h * z)
    return moved_to(p, *place, p.vx + h * ax, p.vy + h * ay, p.vz + h * az, p.t + h), memory


STEPS: dict[type, Callable[..., Any]] = {
    CompositionRecord: composition,
    RungeKuttaRecord: runge_kutta,
    EmbeddedRecord: runge_kutta,
    VerletRecord: verlet,
    BentRecord: bent,
}
"""For each kind of method its step, a function of (method, dynamics, forces, p, h, memory)."""


def advance(method: Any, dynamics: Any, forces: Any, p: Any, h: Any, memory: Any) -> Any:
    """One step of h: the particle after it, and the method's memory."""
    return STEPS[type(method)](method, dynamics, forces, p, h, memory)
