"""Aerodynamic drag: f = −½ ρ c_d A |u| u with u = v − w the velocity relative to the fluid.

ρ is a number, a fluid's density, or the standard atmosphere by altitude; c_d a number or Schiller and Naumann's law for
spheres, which joins Stokes drag at low Reynolds number to the constant 0.44 above Re = 1000; A = π r² unless given.

Jacobian, with s = |u|: ∂f/∂v = −½ ρ A [c_d s 1 + d(c_d s)/ds u uᵀ/s]. At u = 0 it is 0 for constant c_d, and Stokes'
−6 π η r for Schiller and Naumann's, whose product c_d s stays finite.
Source: Landau, Lifshitz, Fluid Mechanics, § 45; L. Schiller, A. Naumann, VDI-Zeitschrift 77, 318 (1933).
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le
from pydantic import model_validator

from particlesim.flows import AnyFlow
from particlesim.flows.fluids import FLUIDS, FluidName, require_density
from particlesim.forces.base import Force
from particlesim.forces.drag_laws import (
    Constant,
    SchillerNaumann,
    Sphere,
    StandardAtmosphere,
    cross_section,
    density,
    density_slope,
    drag_slope,
    drag_speed,
)
from particlesim.laws.matrices import outer, product, with_diagonal
from particlesim.laws.registry import (
    Matrix,
    Particle,
    Vector,
    force,
    force_dv,
    force_dx,
    law,
    moved_to,
    velocity,
    velocity_dx,
)
from particlesim.model.base import Model
from particlesim.model.mistakes import invalid
from particlesim.model.units import (
    KelvinDifference,
    KilogramsPerCubicMetre,
    Metres,
    Number,
    PascalSeconds,
    SquareMetres,
)


class Atmosphere(Model):
    """The International Standard Atmosphere by altitude (y), with offsets."""

    type: Literal["standard_atmosphere"] = "standard_atmosphere"
    sea_level: Metres = 0.0
    """The y of sea level."""
    temperature_offset: Annotated[KelvinDifference, Ge(-100), Le(100)] = 0.0
    """Difference from the standard temperature, in kelvin; air and its vapour are modelled within 100 K of it."""
    humidity: Annotated[Number, Ge(0), Le(1)] = 0.0
    """Relative humidity, 0 to 1."""


class Drag(Force):
    """Aerodynamic (quadratic) drag relative to the flow."""

    type: Literal["drag"] = "drag"
    fluid: FluidName | None = None
    """Fluid from the table, for its density and viscosity."""
    density: Annotated[KilogramsPerCubicMetre, Gt(0)] | Atmosphere | None = None
    """Density ρ of the fluid: a number, or the standard atmosphere by altitude; the fluid's unless given."""
    viscosity: Annotated[PascalSeconds, Gt(0)] | None = None
    """Dynamic viscosity η, for the Reynolds number of "schiller_naumann"; the fluid's unless given."""
    coefficient: Annotated[Number, Ge(0)] | Literal["schiller_naumann"] = 0.47
    """Drag coefficient c_d (sphere 0.47, cube 1.05, streamlined 0.01 to 0.05), or a sphere's law by Reynolds number."""
    area: Annotated[SquareMetres, Gt(0)] | None = None
    """Cross-section A; π r² of the particle's radius unless given."""
    flow: tuple[AnyFlow, ...] = ()
    """Flows of the fluid, added up; at rest unless given."""

    formula: ClassVar[str] = "f = −½ ρ c_d A |u| u, u = v − w"
    energy: ClassVar[str] = "none: dissipative"

    @model_validator(mode="after")
    def _complete(self) -> Drag:
        if self.density is None:
            require_density(self.fluid)
        if self.coefficient == "schiller_naumann":
            if self.fluid is None and self.viscosity is None:
                raise invalid(
                    "schiller_naumann needs the viscosity", at=("coefficient",), allowed="fluid or viscosity"
                )
            if isinstance(self.density, Atmosphere):
                raise invalid(
                    "schiller_naumann needs one density everywhere",
                    at=("coefficient",),
                    also=[(("density",), "this one changes with altitude")],
                )
        elif self.viscosity is not None:
            raise invalid('viscosity acts only with coefficient = "schiller_naumann"', at=("viscosity",))
        return self

    @property
    def rho(self) -> float:
        """Density of the fluid [kg/m³], at sea level for the standard atmosphere."""
        if isinstance(self.density, Atmosphere):
            return FLUIDS["air"].density or math.nan
        if self.density is not None:
            return self.density
        return FLUIDS[self.fluid or ""].density or math.nan

    def needs_velocity(self) -> bool:
        return True

    def record(self) -> DragRecord:
        rho: Constant | StandardAtmosphere = Constant(self.rho)
        if isinstance(self.density, Atmosphere):
            rho = StandardAtmosphere(
                self.density.sea_level, self.density.temperature_offset, self.density.humidity
            )
        c_d: Constant | SchillerNaumann
        if self.coefficient == "schiller_naumann":
            eta = self.viscosity if self.viscosity is not None else FLUIDS[self.fluid or ""].viscosity
            c_d = SchillerNaumann(eta / self.rho)
        else:
            c_d = Constant(float(self.coefficient))
        area = Sphere(math.pi) if self.area is None else Constant(self.area)
        return DragRecord(0.5, rho, c_d, area, tuple(flow.record() for flow in self.flow))

    def needs(self) -> frozenset[str]:
        sized = self.area is None or self.coefficient == "schiller_naumann"
        return frozenset({"radius"} if sized else ())

    def kink(self) -> str | None:
        if self.coefficient != "schiller_naumann":
            return None
        return "the coefficient of Schiller and Naumann jumps at a Reynolds number of 1000"


class DragRecord(NamedTuple):
    """½, and the records of density, drag coefficient, cross-section and flows."""

    half: float
    density: tuple[Any, ...]
    coefficient: tuple[Any, ...]
    area: tuple[Any, ...]
    flow: tuple[Any, ...]


def relative(flow: Any, p: Particle) -> Particle:
    """The particle with its velocity relative to the fluid."""
    wx, wy, wz = velocity(flow, p)
    return moved_to(p, p.x, p.y, p.z, p.vx - wx, p.vy - wy, p.vz - wz, p.t)


def drag_dv(f: Any, p: Particle) -> Matrix:
    """∂f/∂v of aerodynamic drag."""
    q = relative(f.flow, p)
    speed = np.sqrt(q.vx * q.vx + q.vy * q.vy + q.vz * q.vz)
    k = -f.half * density(f.density, p) * cross_section(f.area, p)
    d = k * drag_speed(f.coefficient, q)
    e = k * drag_slope(f.coefficient, q) / speed if speed > 0 else 0.0
    v = (q.vx, q.vy, q.vz)
    return with_diagonal(d, outer((e * v[0], e * v[1], e * v[2]), v))


@law(force, DragRecord)
def drag_force(f: DragRecord, p: Particle) -> Vector:
    q = relative(f.flow, p)
    s = -f.half * density(f.density, p) * cross_section(f.area, p) * drag_speed(f.coefficient, q)
    return s * q.vx, s * q.vy, s * q.vz


@law(force_dx, DragRecord)
def drag_dx(f: DragRecord, p: Particle) -> Matrix:
    # Through the flow, −∂f/∂v ∂w/∂x, and through the density, f (dρ/dy)/ρ in the column of y.
    a = product(drag_dv(f, p), velocity_dx(f.flow, p))
    fx, fy, fz = drag_force(f, p)
    s = density_slope(f.density, p) / density(f.density, p)
    return -a[0], s * fx - a[1], -a[2], -a[3], s * fy - a[4], -a[5], -a[6], s * fz - a[7], -a[8]


@law(force_dv, DragRecord)
def drag_by_velocity(f: DragRecord, p: Particle) -> Matrix:
    return drag_dv(f, p)
