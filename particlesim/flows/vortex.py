"""Line vortices about an axis: Rankine (solid core) and Lamb–Oseen (viscous core).

With ρ the distance from the axis, Γ the circulation and a the core radius, the fluid turns about the axis with

    Rankine      v_θ = Γ ρ / (2 π a²)  inside the core,  Γ / (2 π ρ)  outside
    Lamb–Oseen   v_θ = Γ / (2 π ρ) (1 − exp(−ρ²/a²))

Source: P. G. Saffman, Vortex Dynamics (1992), sections 2.1 and 13.1. In Lamb's solution a² = 4 ν t; here a is constant.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Gt
from pydantic import field_validator

from particlesim.flows.base import Flow
from particlesim.laws.registry import Matrix, Particle, Vector, law, velocity, velocity_dx
from particlesim.model.units import Metres, SquareMetresPerSecond
from particlesim.model.units import Vector as Vector3
from particlesim.model.vectors import square, unit


class Vortex(Flow):
    """A line vortex with circulation Γ about an axis; positive Γ turns counter-clockwise seen against the axis."""

    type: Literal["vortex"] = "vortex"
    center: Vector3[Metres] = (0.0, 0.0, 0.0)
    """A point on the axis."""
    axis: Vector3[float] = (0.0, 1.0, 0.0)
    """Direction of the axis; its length does not matter."""
    circulation: SquareMetresPerSecond
    """Circulation Γ around the core."""
    core_radius: Annotated[Metres, Gt(0)]
    """Radius a of the core, inside of which the fluid turns like a solid body."""
    profile: Literal["rankine", "lamb_oseen"] = "lamb_oseen"
    """How the core joins the outer flow."""

    @field_validator("axis")
    @classmethod
    def _has_direction(cls, axis: tuple[float, float, float]) -> tuple[float, float, float]:
        unit(axis)
        return axis

    def record(self) -> RankineRecord | LambOseenRecord:
        kind = RankineRecord if self.profile == "rankine" else LambOseenRecord
        return kind(*self.center, *unit(self.axis), self.circulation / (2 * np.pi), square(self.core_radius))


class VortexRecord(NamedTuple):
    """Center [m], unit axis, Γ/2π [m²/s], a² [m²]."""

    cx: float
    cy: float
    cz: float
    ax: float
    ay: float
    az: float
    strength: float
    core2: float


class RankineRecord(VortexRecord):
    """A vortex whose core turns like a solid body."""


class LambOseenRecord(VortexRecord):
    """A vortex whose core joins the outer flow smoothly."""


def across(f: VortexRecord, p: Particle) -> tuple[float, float, float, float]:
    """a × d, the direction of turning times the distance from the axis, and that distance squared."""
    dx, dy, dz = p.x - f.cx, p.y - f.cy, p.z - f.cz
    ux, uy, uz = f.ay * dz - f.az * dy, f.az * dx - f.ax * dz, f.ax * dy - f.ay * dx
    return ux, uy, uz, ux * ux + uy * uy + uz * uz


def turning(
    f: VortexRecord, p: Particle, rate: float, slope: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Gradient of w = ω(ρ²) a × d, with ω = rate and dω/d(ρ²) = slope."""
    dx, dy, dz = p.x - f.cx, p.y - f.cy, p.z - f.cz
    along = dx * f.ax + dy * f.ay + dz * f.az
    ex, ey, ez = (
        2 * slope * (dx - along * f.ax),
        2 * slope * (dy - along * f.ay),
        2 * slope * (dz - along * f.az),
    )
    ux, uy, uz, _ = across(f, p)
    return (
        ux * ex,
        ux * ey - rate * f.az,
        ux * ez + rate * f.ay,
        uy * ex + rate * f.az,
        uy * ey,
        uy * ez - rate * f.ax,
        uz * ex - rate * f.ay,
        uz * ey + rate * f.ax,
        uz * ez,
    )


@law(velocity, RankineRecord)
def rankine_velocity(f: RankineRecord, p: Particle) -> Vector:
    ux, uy, uz, d2 = across(f, p)
    rate = f.strength / max(d2, f.core2)
    return rate * ux, rate * uy, rate * uz


@law(velocity_dx, RankineRecord)
def rankine_gradient(f: RankineRecord, p: Particle) -> Matrix:
    _, _, _, d2 = across(f, p)
    rate = f.strength / max(d2, f.core2)
    slope = -rate / d2 if d2 > f.core2 else 0.0
    return turning(f, p, rate, slope)


@law(velocity, LambOseenRecord)
def lamb_oseen_velocity(f: LambOseenRecord, p: Particle) -> Vector:
    ux, uy, uz, d2 = across(f, p)
    s = d2 / f.core2
    # (1 − e^−s)/s, which is 1 on the axis
    rate = f.strength / f.core2 * (-np.expm1(-s) / s if s > 0 else 1.0)
    return rate * ux, rate * uy, rate * uz


@law(velocity_dx, LambOseenRecord)
def lamb_oseen_gradient(f: LambOseenRecord, p: Particle) -> Matrix:
    _, _, _, d2 = across(f, p)
    s = d2 / f.core2
    shape = -np.expm1(-s) / s if s > 0 else 1.0
    # d/ds (1 − e^−s)/s = (e^−s − shape)/s, by its series −1/2 + s/3 near the axis
    bend = (np.exp(-s) - shape) / s if s > 1e-4 else s / 3 - 0.5
    return turning(f, p, f.strength / f.core2 * shape, f.strength / (f.core2 * f.core2) * bend)
