"""Linear (viscous) drag towards a flow: f = −k (v − w(x, t)).

Stokes drag is the same law with k = 6 π η r; see `stokes_drag`.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from annotated_types import Ge

from particlesim.flows import AnyFlow
from particlesim.forces.base import Force
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
from particlesim.model.units import KilogramsPerSecond


class LinearDrag(Force):
    """Drag proportional to the velocity relative to the fluid."""

    type: Literal["linear_drag"] = "linear_drag"
    coefficient: Annotated[KilogramsPerSecond, Ge(0)]
    """Drag coefficient k."""
    flow: tuple[AnyFlow, ...] = ()
    """Flows of the fluid, added up; at rest unless given."""

    formula: ClassVar[str] = "f = −k (v − w)"
    energy: ClassVar[str] = "none: dissipative, P = −k |v − w|² in a fluid at rest"

    def needs_velocity(self) -> bool:
        return True

    def record(self) -> LinearDragRecord:
        return LinearDragRecord(self.coefficient, tuple(flow.record() for flow in self.flow))


class LinearDragRecord(NamedTuple):
    """k [kg/s] and the records of the flows."""

    k: float
    flow: tuple[Any, ...]


def viscous_force(k: float, flow: Any, p: Particle) -> Vector:
    """−k (v − w)."""
    wx, wy, wz = velocity(flow, p)
    return k * (wx - p.vx), k * (wy - p.vy), k * (wz - p.vz)


def scaled(k: float, a: Matrix) -> Matrix:
    """k times a matrix."""
    return k * a[0], k * a[1], k * a[2], k * a[3], k * a[4], k * a[5], k * a[6], k * a[7], k * a[8]


def viscous_dv(k: float) -> Matrix:
    """−k times the unit matrix."""
    return -k, 0.0, 0.0, 0.0, -k, 0.0, 0.0, 0.0, -k


@law(force, LinearDragRecord)
def linear_drag_force(f: LinearDragRecord, p: Particle) -> Vector:
    return viscous_force(f.k, f.flow, p)


@law(force_dx, LinearDragRecord)
def linear_drag_dx(f: LinearDragRecord, p: Particle) -> Matrix:
    return scaled(f.k, velocity_dx(f.flow, p))


@law(force_dv, LinearDragRecord)
def linear_drag_dv(f: LinearDragRecord, p: Particle) -> Matrix:
    return viscous_dv(f.k)
