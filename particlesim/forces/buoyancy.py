"""Buoyancy (Archimedes): f = −ρ_f V g, with V = 4/3 π r³ unless given.

With a surface, a sphere may be partly immersed. Let h be the depth of its lowest point, 0 ≤ h ≤ 2r: the immersed cap has
the volume V(h) = π (r h² − h³/3) and cuts the surface in an area A(h) = π (2 r h − h²) = dV/dh, so that the potential is
U(h) = ρ_f |g| π (r h³/3 − h⁴/12), and grows with ρ_f |g| V for every metre below that.
Source: any mechanics text; the cap's volume by integration of π (2 r z − z²).
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, NamedTuple

from annotated_types import Gt
from pydantic import model_validator

from particlesim.flows.fluids import FLUIDS, WITH_DENSITY, FluidName
from particlesim.forces.base import Force
from particlesim.forces.gravity import STANDARD_GRAVITY
from particlesim.laws.matrices import outer
from particlesim.laws.registry import (
    ZERO_MATRIX,
    Matrix,
    Particle,
    Vector,
    force,
    force_dv,
    force_dx,
    law,
    potential,
)
from particlesim.model.mistakes import invalid
from particlesim.model.units import CubicMetres, KilogramsPerCubicMetre, Metres, MetresPerSecondSquared
from particlesim.model.units import Vector as Vector3
from particlesim.model.vectors import norm, unit


class Buoyancy(Force):
    """Lift by the weight of the displaced fluid, everywhere or below a surface."""

    type: Literal["buoyancy"] = "buoyancy"
    fluid: FluidName | None = None
    """Fluid from the table; or give the density."""
    density: Annotated[KilogramsPerCubicMetre, Gt(0)] | None = None
    """Density ρ_f of the fluid."""
    volume: Annotated[CubicMetres, Gt(0)] | None = None
    """Displaced volume V; 4/3 π r³ of the particle's radius unless given."""
    surface: Metres | None = None
    """Height of the fluid's surface, measured against gravity from the origin; fluid everywhere unless given."""
    acceleration: Vector3[MetresPerSecondSquared] = (0.0, -STANDARD_GRAVITY, 0.0)
    """Acceleration of free fall g, as in the force of gravity."""

    formula: ClassVar[str] = "f = −ρ_f V g, V = 4/3 π r³ or the immersed part of it"
    energy: ClassVar[str] = "U = ρ_f V g·x without a surface; ρ_f |g| π (r h³/3 − h⁴/12) for immersion h ≤ 2r"

    @model_validator(mode="after")
    def _complete(self) -> Buoyancy:
        if self.fluid is None and self.density is None:
            raise invalid("needs the fluid's density", allowed='fluid = "water", or density = 1000')
        if self.fluid is not None and self.density is not None:
            raise invalid(
                "fluid and density contradict each other", at=("density",), also=[(("fluid",), "given here")]
            )
        if self.fluid is not None and self.fluid not in WITH_DENSITY:
            raise invalid(
                f"no density is tabulated for {self.fluid}", at=("fluid",), hint="give density instead"
            )
        if self.surface is not None and self.volume is not None:
            raise invalid(
                "partial immersion is that of a sphere: it takes its volume from the radius",
                at=("volume",),
                also=[(("surface",), "the surface is given here")],
            )
        if self.surface is not None and norm(self.acceleration) == 0:
            raise invalid("a surface needs a direction of gravity", at=("acceleration",))
        return self

    @property
    def rho(self) -> float:
        """Density of the fluid [kg/m³]."""
        return self.density if self.density is not None else FLUIDS[self.fluid or ""].density or math.nan

    def record(self) -> ImmersedVolumeRecord | ImmersedSphereRecord | FloatingSphereRecord:
        gx, gy, gz = self.acceleration
        if self.surface is not None:
            up = unit((-gx, -gy, -gz))
            return FloatingSphereRecord(*up, self.surface, self.rho * norm(self.acceleration) * math.pi)
        if self.volume is not None:
            k = self.rho * self.volume
            return ImmersedVolumeRecord(k * gx, k * gy, k * gz)
        k = self.rho * 4 / 3 * math.pi
        return ImmersedSphereRecord(k * gx, k * gy, k * gz)

    def needs(self) -> frozenset[str]:
        return frozenset({"radius"} if self.volume is None else ())

    def kink(self) -> str | None:
        return (
            None
            if self.surface is None
            else "its second derivative jumps where a sphere begins to leave the fluid"
        )


class ImmersedVolumeRecord(NamedTuple):
    """Weight of the displaced fluid, ρ_f V g [N]."""

    x: float
    y: float
    z: float


class ImmersedSphereRecord(NamedTuple):
    """4/3 π ρ_f g [N/m³], to be multiplied by r³."""

    x: float
    y: float
    z: float


class FloatingSphereRecord(NamedTuple):
    """Unit vector upwards, height of the surface [m], π ρ_f |g| [N/m³]."""

    ux: float
    uy: float
    uz: float
    surface: float
    k: float


@law(force, ImmersedVolumeRecord)
def immersed_volume_force(f: ImmersedVolumeRecord, p: Particle) -> Vector:
    return -f.x, -f.y, -f.z


@law(potential, ImmersedVolumeRecord)
def immersed_volume_potential(f: ImmersedVolumeRecord, p: Particle) -> float:
    return f.x * p.x + f.y * p.y + f.z * p.z


@law(force, ImmersedSphereRecord)
def immersed_sphere_force(f: ImmersedSphereRecord, p: Particle) -> Vector:
    r3 = -(p.r * p.r * p.r)
    return r3 * f.x, r3 * f.y, r3 * f.z


@law(potential, ImmersedSphereRecord)
def immersed_sphere_potential(f: ImmersedSphereRecord, p: Particle) -> float:
    return p.r * p.r * p.r * (f.x * p.x + f.y * p.y + f.z * p.z)


def immersion(f: FloatingSphereRecord, p: Particle) -> float:
    """Depth of the sphere's lowest point below the surface [m], negative above it."""
    return f.surface - (p.x * f.ux + p.y * f.uy + p.z * f.uz) + p.r


@law(force, FloatingSphereRecord)
def floating_sphere_force(f: FloatingSphereRecord, p: Particle) -> Vector:
    h = max(min(immersion(f, p), p.r + p.r), p.r - p.r)
    k = f.k * h * h * (p.r - h / 3)
    return k * f.ux, k * f.uy, k * f.uz


@law(potential, FloatingSphereRecord)
def floating_sphere_potential(f: FloatingSphereRecord, p: Particle) -> float:
    depth = immersion(f, p)
    h = max(min(depth, 2 * p.r), 0.0)
    below = max(depth - 2 * p.r, 0.0)
    return f.k * (h * h * h * (p.r / 3 - h / 12) + 4 / 3 * p.r * p.r * p.r * below)


@law(force_dx, FloatingSphereRecord)
def floating_sphere_dx(f: FloatingSphereRecord, p: Particle) -> Matrix:
    h = max(min(immersion(f, p), 2 * p.r), 0.0)
    k = -f.k * (2 * p.r * h - h * h)
    return outer((k * f.ux, k * f.uy, k * f.uz), (f.ux, f.uy, f.uz))


@law(force_dv, FloatingSphereRecord)
def floating_sphere_dv(f: FloatingSphereRecord, p: Particle) -> Matrix:
    return ZERO_MATRIX


def _uniform(f: ImmersedVolumeRecord | ImmersedSphereRecord, p: Particle) -> Matrix:
    return ZERO_MATRIX


for _record in (ImmersedVolumeRecord, ImmersedSphereRecord):
    law(force_dx, _record)(_uniform)
    law(force_dv, _record)(_uniform)
