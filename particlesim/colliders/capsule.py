"""Capsules: all places within a radius of a line from one point to another.

The distance is that to the nearest point of the line, less the radius.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from particlesim.colliders.axial import AxialSolid
from particlesim.colliders.pose import placed
from particlesim.colliders.solid import SolidCollider, is_convex
from particlesim.colliders.triangulation import Triangles, arc, revolved
from particlesim.laws.registry import Particle, Vector, gap, law, normal


class Capsule(AxialSolid):
    """A cylinder with a half-sphere at both ends, which are beyond `start` and `end`."""

    kind: ClassVar[str] = "capsule"
    exact: ClassVar[bool] = True

    type: Literal["capsule"] = "capsule"

    def waist(self) -> float:
        return 2 * self.radius

    def geometry(self) -> Any:
        return placed(CapsuleRecord(self.length() / 2, self.radius), self.middle(), self.rotation())

    def triangles(self) -> Triangles:
        h, r = self.length() / 2, self.radius
        profile = [*arc((0.0, -h), r, -np.pi / 2, 0.0, 24), *arc((0.0, h), r, 0.0, np.pi / 2, 24)]
        return revolved(profile).placed(self.middle(), self.rotation())


class CapsuleCollider(Capsule, SolidCollider):
    """A cylinder with a half-sphere at both ends, which are beyond `start` and `end`."""


class CapsuleRecord(NamedTuple):
    """Half the length of the line, along y about the origin, and the radius [m]."""

    half: float
    radius: float


@law(gap, CapsuleRecord)
def capsule_gap(c: CapsuleRecord, p: Particle) -> float:
    y = max(abs(p.y) - c.half, type(p.x)(0))
    return np.sqrt(p.x * p.x + y * y + p.z * p.z) - c.radius - p.r


@law(normal, CapsuleRecord)
def capsule_normal(c: CapsuleRecord, p: Particle) -> Vector:
    zero, one = type(p.x)(0), type(p.x)(1)
    y = max(abs(p.y) - c.half, zero)
    d = np.sqrt(p.x * p.x + y * y + p.z * p.z)
    k = one / d if d > 0 else one
    up = k * y
    return (k * p.x if d > 0 else one), (up if p.y >= 0 else -up), k * p.z


is_convex(CapsuleRecord)
