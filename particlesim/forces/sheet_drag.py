"""Drag on the triangles of a surface, such as cloth in wind, each as a flat plate.

With the plate's unit normal n, its area A, and u = w − v the velocity of the fluid relative to it (w at its middle, v the
mean of its corners), split into u_n = (u·n) n across and u_t = u − u_n along the plate:

    f = ½ ρ A (c_n |u_n| u_n + c_t |u_t| u_t),   a third of it on every corner.

The parts do not know of each other (independence principle). It does not matter which way n points. On a closed surface
(a jelly, a closed mesh) only the side that faces the wind is pushed: where the outward normal points with u, there is no
normal part.
Source: S. F. Hoerner, Fluid-Dynamic Drag (1965), chapter 3; G. I. Taylor, Proc. R. Soc. A 214, 158 (1952).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt
from pydantic import model_validator

from particlesim.bonds.base import Ties
from particlesim.flows import AnyFlow
from particlesim.flows.fluids import FLUIDS, FluidName, require_density
from particlesim.forces.base import Force
from particlesim.laws.matrices import outer, with_diagonal
from particlesim.laws.registry import (
    Matrix,
    Particle,
    Vector,
    add,
    law,
    triangle_force,
    triangle_force_dv,
    velocity,
)
from particlesim.model.units import KilogramsPerCubicMetre, Number


class SheetDrag(Force):
    """Drag on the surface of cloth, jelly and meshes: wind fills a sail, and still air slows a falling sheet."""

    type: Literal["sheet_drag"] = "sheet_drag"
    fluid: FluidName | None = None
    """Fluid from the table, for its density."""
    density: Annotated[KilogramsPerCubicMetre, Gt(0)] | None = None
    """Density ρ of the fluid; the fluid's unless given."""
    normal_coefficient: Annotated[Number, Ge(0)] = 1.2
    """Drag coefficient c_n of flow across the surface (a square plate: 1.2)."""
    tangential_coefficient: Annotated[Number, Ge(0)] = 0.02
    """Drag coefficient c_t of flow along the surface, friction on both sides together."""
    flow: tuple[AnyFlow, ...] = ()
    """Flows of the fluid, added up; at rest unless given."""

    formula: ClassVar[str] = "f = ½ ρ A (c_n |u_n| u_n + c_t |u_t| u_t), u = w − v"
    energy: ClassVar[str] = "none: dissipative"
    on_surfaces: ClassVar[bool] = True

    @model_validator(mode="after")
    def _complete(self) -> SheetDrag:
        if self.density is None:
            require_density(self.fluid)
        return self

    @property
    def rho(self) -> float:
        """Density of the fluid [kg/m³]."""
        return self.density if self.density is not None else FLUIDS[self.fluid or ""].density or 0.0

    def needs_velocity(self) -> bool:
        return True

    def record(self) -> SheetDragRecord:
        return self.surface_record(False)

    def over(self, label: str, group: str) -> SurfaceSet:
        return SurfaceSet(label, (group,), self)

    def surface_record(self, closed: bool) -> SheetDragRecord:
        """The record for an open or a closed surface."""
        k = 0.5 * self.rho
        return SheetDragRecord(
            k * self.normal_coefficient,
            k * self.tangential_coefficient,
            1.0 if closed else 0.0,
            tuple(flow.record() for flow in self.flow),
        )


class SheetDragRecord(NamedTuple):
    """½ ρ c_n and ½ ρ c_t [kg/m³], 1 for a closed surface and 0 for an open one, and the records of flows."""

    normal: float
    tangential: float
    closed: float
    flow: tuple[Any, ...]


class Triangle(NamedTuple):
    """A triangle: its vector area ½ (x₂ − x₁) × (x₃ − x₁) [m²], and a particle at its middle with its mean velocity."""

    x: float
    y: float
    z: float
    middle: Particle


@dataclass(frozen=True)
class SurfaceSet(Ties):
    """The triangles of a group under a force on its surface: the force's label, the group, and the force."""

    name: str
    groups: tuple[str]
    law: SheetDrag

    @property
    def group(self) -> str:
        """The group whose surface it is."""
        return self.groups[0]

    @property
    def feeds(self) -> bool:
        return bool(self.law.flow)  # the wind

    def needs_velocity(self) -> bool:
        return True


@law(triangle_force, SheetDragRecord)
def sheet_drag_force(f: SheetDragRecord, s: Triangle) -> Vector:
    wx, wy, wz = velocity(f.flow, s.middle)
    ux, uy, uz = wx - s.middle.vx, wy - s.middle.vy, wz - s.middle.vz
    square = s.x * s.x + s.y * s.y + s.z * s.z
    area = np.sqrt(square)
    across = (ux * s.x + uy * s.y + uz * s.z) / square if square > 0 else square - square  # u·n / A
    tx, ty, tz = ux - across * s.x, uy - across * s.y, uz - across * s.z
    leeward = f.closed * across > 0
    n = area - area if leeward else f.normal * square * abs(across) * across
    t = f.tangential * area * np.sqrt(tx * tx + ty * ty + tz * tz)
    return n * s.x + t * tx, n * s.y + t * ty, n * s.z + t * tz


@law(triangle_force_dv, SheetDragRecord)
def sheet_drag_dv(f: SheetDragRecord, s: Triangle) -> Matrix:
    # −∂f/∂u, with ½ ρ A (2 c_n |u_n| n nᵀ + c_t (|u_t| (1 − n nᵀ) + u_t u_tᵀ/|u_t|)): negative (semi-)definite.
    wx, wy, wz = velocity(f.flow, s.middle)
    ux, uy, uz = wx - s.middle.vx, wy - s.middle.vy, wz - s.middle.vz
    square = s.x * s.x + s.y * s.y + s.z * s.z
    area = np.sqrt(square)
    across = (ux * s.x + uy * s.y + uz * s.z) / square if square > 0 else square - square  # u·n / A
    tx, ty, tz = ux - across * s.x, uy - across * s.y, uz - across * s.z
    speed = np.sqrt(tx * tx + ty * ty + tz * tz)
    leeward = f.closed * across > 0
    t = f.tangential * area * speed
    n = (area - area if leeward else 2 * f.normal * abs(across)) - (t / square if square > 0 else t)
    e = f.tangential * area / speed if speed > 0 else speed
    across_it = outer((n * s.x, n * s.y, n * s.z), (s.x, s.y, s.z))
    along_it = outer((e * tx, e * ty, e * tz), (tx, ty, tz))
    return tuple(-each for each in with_diagonal(t, add(across_it, along_it)))
