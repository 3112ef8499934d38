"""Tori: all places within a radius a of a circle of radius R.

The distance is √((ρ − R)² + y²) − a, with ρ the distance from the axis.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Gt
from pydantic import field_validator, model_validator

from particlesim.colliders.pose import along, placed
from particlesim.colliders.solid import GRAIN, Solid, SolidCollider
from particlesim.colliders.triangulation import Triangles, arc, revolved
from particlesim.colliders.way import lipschitz_apart, marched_contact
from particlesim.laws.registry import Particle, Vector, apart, first_contact, gap, law, normal
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import Vector3, parallel, unit


class Torus(Solid):
    """A ring with a round cross-section."""

    kind: ClassVar[str] = "torus"
    convex: ClassVar[bool] = False
    exact: ClassVar[bool] = True

    type: Literal["torus"] = "torus"
    center: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """Centre of the ring."""
    axis: VectorOf[float] = (0.0, 1.0, 0.0)
    """Direction of the hole; its length does not matter."""
    radius: Annotated[Metres, Gt(0)]
    """From the centre of the ring to that of its tube."""
    tube: Annotated[Metres, Gt(0)]
    """Radius of the tube."""

    @field_validator("axis")
    @classmethod
    def _has_direction(cls, axis: Vector3) -> Vector3:
        unit(axis)
        return axis

    @model_validator(mode="after")
    def _has_a_hole(self) -> Torus:
        if self.tube >= self.radius:
            raise invalid(
                "the tube fills the hole of the torus",
                at=("tube",),
                also=[(("radius",), "the ring is this large")],
                allowed=f"less than {self.radius:g} m",
            )
        return self

    def geometry(self) -> Any:
        return placed(TorusRecord(self.radius, self.tube, self.grain()), self.center, along(self.axis))

    def round_about(self, axis: Vector3) -> bool:
        return parallel(axis, self.axis)

    def grain(self) -> float:
        return GRAIN * min(self.tube, self.radius - self.tube)

    def waist(self) -> float:
        return 2 * self.tube

    def farthest(self) -> float:
        return max(map(abs, self.center)) + self.radius + self.tube

    def words(self) -> str:
        x, y, z = self.center
        return f"radius {self.radius:g} m, tube {self.tube:g} m at ({x:g}, {y:g}, {z:g})"

    def triangles(self) -> Triangles:
        ring = arc((self.radius, 0.0), self.tube, -np.pi, np.pi, 48)[:-1]
        return revolved(ring, closed=True).placed(self.center, along(self.axis))


class TorusCollider(Torus, SolidCollider):
    """A ring with a round cross-section."""


class TorusRecord(NamedTuple):
    """Radius of the ring about the y axis, that of its tube, and the shortest step of a search [m]."""

    radius: float
    tube: float
    grain: float


@law(gap, TorusRecord)
def torus_gap(c: TorusRecord, p: Particle) -> float:
    out = np.sqrt(p.x * p.x + p.z * p.z) - c.radius
    return np.sqrt(out * out + p.y * p.y) - c.tube - p.r


@law(normal, TorusRecord)
def torus_normal(c: TorusRecord, p: Particle) -> Vector:
    zero, one = type(p.x)(0), type(p.x)(1)
    rho = np.sqrt(p.x * p.x + p.z * p.z)
    out = rho - c.radius
    d = np.sqrt(out * out + p.y * p.y)
    k = one / d if d > 0 else zero
    side = one / rho if rho > 0 else zero
    a = k * out
    return (a * side * p.x if rho > 0 else a), (k * p.y if d > 0 else one), a * side * p.z


law(apart, TorusRecord)(lipschitz_apart)


@law(first_contact, TorusRecord)
def torus_first_contact(c: TorusRecord, p: Particle, q: Particle, h: float, slack: float) -> float:
    return marched_contact(c, p, q, h, slack, c.grain)
