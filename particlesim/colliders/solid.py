"""Solids: bodies with an inside and an outside, from which particles stay out, or which they fill as a container.

A solid's record has the laws `gap` and `normal` of what stays outside of it. As a container it has −g of a point, less the
radius of the particle. A particle that is a ball reaches into no corner of a container: there it touches two walls.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple

from pydantic import StrictBool

from particlesim.colliders.base import Collider
from particlesim.colliders.triangulation import Triangles
from particlesim.colliders.way import (
    concave_apart,
    convex_apart,
    convex_contact,
    lipschitz_apart,
    marched_contact,
)
from particlesim.laws.registry import (
    Particle,
    Vector,
    apart,
    bend,
    first_contact,
    gap,
    law,
    normal,
    sure_gap,
    thinnest,
    with_radius,
)
from particlesim.model.base import Model
from particlesim.model.vectors import Vector3


class Solid(Model):
    """A shape that a collider may have, and of which others are put together."""

    kind: ClassVar[str]
    """What the shape is called."""
    convex: ClassVar[bool] = True
    """Whether it has no dents."""
    exact: ClassVar[bool] = False
    """Whether its gap is a distance, or less, everywhere, and known without reading a file."""

    def geometry(self) -> Any:
        """The solid as kernels take it."""
        raise NotImplementedError

    def grain(self) -> float:
        """A ten-thousandth of its smallest radius of curvature [m]: the shortest step of a search along a way."""
        raise NotImplementedError

    def farthest(self) -> float:
        """The farthest coordinate of its surface [m]."""
        raise NotImplementedError

    def waist(self) -> float:
        """How thick it is where it is thinnest [m]; infinite where that is not known."""
        return math.inf

    def round_about(self, axis: Vector3) -> bool:
        """Whether it is the same at any angle about an axis through its pivot."""
        return False

    def words(self) -> str:
        """Where it is and how large."""
        raise NotImplementedError

    def triangles(self) -> Triangles:
        """Its surface for pictures."""
        raise NotImplementedError


def pivot_of(shape: Any) -> Vector3:
    """The place that a motion leads: the centre of a shape, the middle of its axis, a point of a
    plane, or the origin of its file [m]."""
    for name in ("center", "origin", "point"):
        if hasattr(shape, name):
            return getattr(shape, name)
    if hasattr(shape, "middle"):
        return shape.middle()
    return pivot_of(shape.of[0])  # of what is put together


GRAIN = 1e-4
"""Shortest step of a search along a way, in units of the smallest radius of a shape."""
PARTS = 0.25 / GRAIN
"""A length that no part of a shape is thinner than, a quarter of its smallest radius, in units of that step."""


class SolidCollider(Collider):
    """A solid that particles stay out of, or a container that they stay in."""

    inside: StrictBool = False
    """Whether particles stay inside, as in a container, instead of outside."""

    def shape(self) -> Any:
        solid: Any = self
        if not self.inside:
            return solid.geometry()
        return (HollowConvexRecord if solid.convex else HollowRecord)(solid.geometry(), solid.grain())

    def pivot(self) -> Vector3:
        solid: Any = self
        return pivot_of(solid)

    def reach(self) -> float:
        solid: Any = self
        return float(solid.farthest())

    def describe(self) -> str:
        solid: Any = self
        return f"{'inside of ' if self.inside else ''}{solid.words()}"


def is_convex(record: type) -> None:
    """Ways towards shapes with this record are searched as those of convex ones."""
    law(apart, record)(convex_apart)
    law(first_contact, record)(convex_contact)
    law(bend, record)(_bends_up)


def is_concave(record: type) -> None:
    """What lies between two places is no nearer to shapes with this record than both."""
    law(bend, record)(_bends_down)


def _bends_up(c: Any) -> int:
    return 1


def _bends_down(c: Any) -> int:
    return -1


class HollowRecord(NamedTuple):
    """The inside of a solid, and the shortest step of a search [m]."""

    shape: Any
    grain: float


class HollowConvexRecord(NamedTuple):
    """The inside of a convex solid, and the shortest step of a search [m]."""

    shape: Any
    grain: float


AnyHollow = HollowRecord | HollowConvexRecord


def point_of(p: Particle) -> Particle:
    """A particle of no size in its place."""
    return with_radius(p, p.r - p.r)


def hollow_gap(c: AnyHollow, p: Particle) -> float:
    """Distance of a particle's surface from the wall around it [m]."""
    return -gap(c.shape, point_of(p)) - p.r


def hollow_sure_gap(c: AnyHollow, p: Particle) -> float:
    """As `hollow_gap`, of what is sure of the solid's."""
    return -sure_gap(c.shape, point_of(p)) - p.r


def hollow_normal(c: AnyHollow, p: Particle) -> Vector:
    """The way from the wall inwards."""
    x, y, z = normal(c.shape, point_of(p))
    return -x, -y, -z


def hollow_contact(c: AnyHollow, p: Particle, q: Particle, h: float, slack: float) -> float:
    """The part of a step at which a particle first touches the wall around it."""
    return marched_contact(c, p, q, h, slack, c.grain)


def hollow_thinnest(c: AnyHollow) -> float:
    """Walls have no back; but beyond a part of its size the other side may be nearer."""
    return c.grain * PARTS


for _record in (HollowRecord, HollowConvexRecord):
    law(gap, _record)(hollow_gap)
    law(sure_gap, _record)(hollow_sure_gap)
    law(thinnest, _record)(hollow_thinnest)
    law(normal, _record)(hollow_normal)
    law(first_contact, _record)(hollow_contact)
law(apart, HollowRecord)(lipschitz_apart)
law(apart, HollowConvexRecord)(concave_apart)
is_concave(HollowConvexRecord)
