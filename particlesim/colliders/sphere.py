"""Spheres: balls that particles stay out of, or hollow ones that they stay in.

Gap of a particle of radius r, with d its distance from the centre: g = d − R − r outside, g = R − r − d inside.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Gt

from particlesim.colliders.pose import UNTURNED
from particlesim.colliders.solid import GRAIN, HollowConvexRecord, Solid, SolidCollider, is_concave, is_convex
from particlesim.colliders.triangulation import Triangles, arc, revolved
from particlesim.laws.registry import Particle, Vector, gap, law, normal, surface
from particlesim.model.units import Metres
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import Vector3


class Sphere(Solid):
    """A ball."""

    kind: ClassVar[str] = "sphere"
    exact: ClassVar[bool] = True

    type: Literal["sphere"] = "sphere"
    center: VectorOf[Metres] = (0.0, 0.0, 0.0)
    """Centre of the sphere."""
    radius: Annotated[Metres, Gt(0)]
    """Radius of the sphere."""

    def geometry(self) -> Any:
        return BallRecord(*self.center, self.radius)

    def round_about(self, axis: Vector3) -> bool:
        return True

    def grain(self) -> float:
        return GRAIN * self.radius

    def waist(self) -> float:
        return 2 * self.radius

    def farthest(self) -> float:
        return max(map(abs, self.center)) + self.radius

    def words(self) -> str:
        x, y, z = self.center
        return f"radius {self.radius:g} m at ({x:g}, {y:g}, {z:g})"

    def triangles(self) -> Triangles:
        profile = arc((0.0, 0.0), self.radius, -np.pi / 2, np.pi / 2, 48)
        return revolved(profile).placed(self.center, UNTURNED)


class SphereCollider(Sphere, SolidCollider):
    """A ball that particles stay out of, or a hollow one that they stay in."""

    def shape(self) -> BallRecord | BowlRecord:
        """The sphere as kernels take it: solid or hollow."""
        return (BowlRecord if self.inside else BallRecord)(*self.center, self.radius)

    def moved_shape(self) -> Any:
        """A bowl that moves is searched for along the way."""
        return HollowConvexRecord(self.geometry(), self.grain()) if self.inside else self.geometry()


class BallRecord(NamedTuple):
    """Centre and radius of a solid sphere [m]."""

    x: float
    y: float
    z: float
    radius: float


class BowlRecord(NamedTuple):
    """Centre and radius of a hollow sphere [m]."""

    x: float
    y: float
    z: float
    radius: float


def distance(c: BallRecord | BowlRecord, p: Particle) -> float:
    """From the centre of the sphere to that of the particle [m]."""
    x, y, z = p.x - c.x, p.y - c.y, p.z - c.z
    return np.sqrt(x * x + y * y + z * z)


def outwards(c: BallRecord | BowlRecord, p: Particle) -> Vector:
    """Unit vector from the centre of the sphere to the particle; upwards in the centre itself."""
    d = distance(c, p)
    one = type(d)(1)
    k = one / d if d > 0 else one
    return k * (p.x - c.x), (k * (p.y - c.y) if d > 0 else one), k * (p.z - c.z)


@law(gap, BallRecord)
def ball_gap(c: BallRecord, p: Particle) -> float:
    return distance(c, p) - c.radius - p.r


@law(gap, BowlRecord)
def bowl_gap(c: BowlRecord, p: Particle) -> float:
    return c.radius - p.r - distance(c, p)


@law(normal, BallRecord)
def ball_normal(c: BallRecord, p: Particle) -> Vector:
    return outwards(c, p)


@law(normal, BowlRecord)
def bowl_normal(c: BowlRecord, p: Particle) -> Vector:
    x, y, z = outwards(c, p)
    return -x, -y, -z


# From the centre outwards, and not by −g n, which is rounded as the gap is that a fast particle has at the end of its step.


@law(surface, BallRecord)
def ball_surface(c: BallRecord, p: Particle) -> Vector:
    x, y, z = outwards(c, p)
    d = c.radius + p.r
    return c.x + d * x, c.y + d * y, c.z + d * z


@law(surface, BowlRecord)
def bowl_surface(c: BowlRecord, p: Particle) -> Vector:
    x, y, z = outwards(c, p)
    room = c.radius - p.r
    d = room if room > 0 else room - room  # a particle that does not fit stays in the middle
    return c.x + d * x, c.y + d * y, c.z + d * z


is_convex(BallRecord)
is_concave(BowlRecord)
