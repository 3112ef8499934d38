"""Cylinders with flat ends.

In the plane of the axis and the particle a cylinder is a rectangle: with q = (ρ − R, |y| − h), h half the length and ρ the
distance from the axis, the distance is |max(q, 0)| outside and max(q) inside.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from particlesim.colliders.axial import AxialSolid
from particlesim.colliders.pose import placed
from particlesim.colliders.solid import SolidCollider, is_convex
from particlesim.colliders.triangulation import Triangles, revolved
from particlesim.laws.registry import Particle, Vector, gap, law, normal


class Cylinder(AxialSolid):
    """A cylinder with flat ends."""

    kind: ClassVar[str] = "cylinder"
    exact: ClassVar[bool] = True

    type: Literal["cylinder"] = "cylinder"

    def geometry(self) -> Any:
        return placed(CylinderRecord(self.length() / 2, self.radius), self.middle(), self.rotation())

    def triangles(self) -> Triangles:
        h, r = self.length() / 2, self.radius
        return revolved([(0.0, -h), (r, -h), (r, h), (0.0, h)]).placed(self.middle(), self.rotation())


class CylinderCollider(Cylinder, SolidCollider):
    """A cylinder with flat ends."""


class CylinderRecord(NamedTuple):
    """Half the length along y, about the origin, and the radius [m]."""

    half: float
    radius: float


@law(gap, CylinderRecord)
def cylinder_gap(c: CylinderRecord, p: Particle) -> float:
    zero = type(p.x)(0)
    out, over = np.sqrt(p.x * p.x + p.z * p.z) - c.radius, abs(p.y) - c.half
    a, b = max(out, zero), max(over, zero)
    return np.sqrt(a * a + b * b) + min(max(out, over), zero) - p.r


@law(normal, CylinderRecord)
def cylinder_normal(c: CylinderRecord, p: Particle) -> Vector:
    zero, one = type(p.x)(0), type(p.x)(1)
    rho = np.sqrt(p.x * p.x + p.z * p.z)
    out, over = rho - c.radius, abs(p.y) - c.half
    a, b = max(out, zero), max(over, zero)
    length = np.sqrt(a * a + b * b)
    outside = length > 0
    k = one / length if outside else zero
    up = over >= out
    a = k * a if outside else (zero if up else one)
    b = k * b if outside else (one if up else zero)
    side = one / rho if rho > 0 else zero
    return (a * side * p.x if rho > 0 else a), (b if p.y >= 0 else -b), a * side * p.z


is_convex(CylinderRecord)
