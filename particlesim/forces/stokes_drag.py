"""Stokes drag on a small sphere in a viscous fluid: f = −6 π η r (v − w).

Holds for Reynolds numbers Re = 2 r ρ |v − w| / η well below 1. Source: G. G. Stokes (1851); Landau, Lifshitz, Fluid
Mechanics, § 20.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from annotated_types import Gt
from pydantic import model_validator

from particlesim.flows import AnyFlow
from particlesim.flows.fluids import FLUIDS, FluidName
from particlesim.forces.base import Force
from particlesim.forces.linear_drag import scaled, viscous_dv, viscous_force
from particlesim.laws.registry import (
    Matrix,
    Particle,
    Vector,
    force,
    force_dv,
    force_dx,
    law,
    velocity,
    velocity_dx,
)
from particlesim.model.mistakes import invalid
from particlesim.model.units import KilogramsPerCubicMetre, PascalSeconds


class StokesDrag(Force):
    """Drag on small spheres at low Reynolds number, from the particle's radius and the fluid's viscosity."""

    type: Literal["stokes_drag"] = "stokes_drag"
    fluid: FluidName | None = None
    """Fluid from the table; or give the viscosity."""
    viscosity: Annotated[PascalSeconds, Gt(0)] | None = None
    """Dynamic viscosity η."""
    density: Annotated[KilogramsPerCubicMetre, Gt(0)] | None = None
    """Density ρ of the fluid, used only to warn when the Reynolds number exceeds 1; the fluid's unless given."""
    flow: tuple[AnyFlow, ...] = ()
    """Flows of the fluid, added up; at rest unless given."""

    formula: ClassVar[str] = "f = −6 π η r (v − w)"
    energy: ClassVar[str] = "none: dissipative"

    @model_validator(mode="after")
    def _one_viscosity(self) -> StokesDrag:
        if self.fluid is None and self.viscosity is None:
            raise invalid("needs the fluid's viscosity", allowed='fluid = "water", or viscosity = 1.0e-3')
        if self.fluid is not None and self.viscosity is not None:
            raise invalid(
                "fluid and viscosity contradict each other",
                at=("viscosity",),
                also=[(("fluid",), "the fluid has its own")],
            )
        return self

    @property
    def eta(self) -> float:
        """Dynamic viscosity [Pa s]."""
        return FLUIDS[self.fluid].viscosity if self.fluid is not None else self.viscosity or math.nan

    @property
    def rho(self) -> float | None:
        """Density [kg/m³], None when it is not known."""
        if self.density is not None:
            return self.density
        return FLUIDS[self.fluid].density if self.fluid is not None else None

    def needs_velocity(self) -> bool:
        return True

    def limited(self) -> bool:
        return self.rho is not None

    def excess(self, p: Particle) -> float:
        """The Reynolds number Re = 2 r ρ |v − w| / η."""
        wx, wy, wz = velocity(tuple(flow.record() for flow in self.flow), p)
        return 2 * p.r * (self.rho or 0) * math.hypot(p.vx - wx, p.vy - wy, p.vz - wz) / self.eta

    def beyond(self, excess: float, time: float) -> str:
        return (
            f"Stokes drag holds for Reynolds numbers below 1, and {excess:.3g} was reached at t = {time:.6g} s; "
            'type = "drag" with coefficient = "schiller_naumann" holds further'
        )

    def record(self) -> StokesDragRecord:
        return StokesDragRecord(6 * math.pi * self.eta, tuple(flow.record() for flow in self.flow))

    def needs(self) -> frozenset[str]:
        return frozenset({"radius"})


class StokesDragRecord(NamedTuple):
    """6 π η [Pa s] and the records of the flows."""

    k: float
    flow: tuple[Any, ...]


@law(force, StokesDragRecord)
def stokes_drag_force(f: StokesDragRecord, p: Particle) -> Vector:
    return viscous_force(f.k * p.r, f.flow, p)


@law(force_dx, StokesDragRecord)
def stokes_drag_dx(f: StokesDragRecord, p: Particle) -> Matrix:
    return scaled(f.k * p.r, velocity_dx(f.flow, p))


@law(force_dv, StokesDragRecord)
def stokes_drag_dv(f: StokesDragRecord, p: Particle) -> Matrix:
    return viscous_dv(f.k * p.r)
