"""Cones, and those that end before their tip.

In the plane of the axis and the particle half a cone is a quadrilateral with three sides that matter: both ends and the
slope. The distance is that to the nearest of them, negative inside.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge

from particlesim.colliders.axial import AxialSolid
from particlesim.colliders.pose import placed
from particlesim.colliders.solid import SolidCollider, is_convex
from particlesim.colliders.triangulation import Triangles, revolved
from particlesim.laws.registry import Particle, Vector, gap, law, normal
from particlesim.model.units import Metres


class Cone(AxialSolid):
    """A cone from its base at `start` to its tip at `end`, or to a smaller or larger circle there."""

    kind: ClassVar[str] = "cone"
    exact: ClassVar[bool] = True

    type: Literal["cone"] = "cone"
    end_radius: Annotated[Metres, Ge(0)] = 0.0
    """Radius at its end: 0 is a tip."""

    def geometry(self) -> Any:
        h = self.length() / 2
        across, slope = 2 * h, self.radius - self.end_radius
        length = float(np.hypot(across, slope))
        record = ConeRecord(h, self.radius, self.end_radius, across / length, slope / length, length)
        return placed(record, self.middle(), self.rotation())

    def farthest(self) -> float:
        return max(map(abs, (*self.start, *self.end))) + max(self.radius, self.end_radius)

    def words(self) -> str:
        to = f", {self.end_radius:g} m at its end" if self.end_radius else ""
        return super().words() + to

    def triangles(self) -> Triangles:
        h = self.length() / 2
        profile = [(0.0, -h), (self.radius, -h), (self.end_radius, h), (0.0, h)]
        return revolved(profile).placed(self.middle(), self.rotation())


class ConeCollider(Cone, SolidCollider):
    """A cone from its base at `start` to its tip at `end`, or to a smaller or larger circle there."""


class ConeRecord(NamedTuple):
    """Half the length along y, about the origin; radii at the lower and the upper end; the unit normal (out, up) of the
    slope, and its length [m]."""

    half: float
    low: float
    high: float
    out: float
    up: float
    length: float


def nearest_side(c: ConeRecord, rho: float, y: float) -> tuple[float, float, float]:
    """Signed distance of a place at distance rho from the axis and height y, and its gradient (out, up)."""
    zero, one = type(rho)(0), type(rho)(1)
    # the end that is nearer, and the way from its nearest place: (beyond, over) outwards and along the axis
    top = y >= 0
    side = one if top else -one
    over = abs(y) - c.half
    beyond = max(rho - (c.high if top else c.low), zero)
    ends = np.sqrt(beyond * beyond + over * over)
    # the slope from (low, −half) to (high, half): across it (out, up), along it (−up, out), past its ends
    x, z = rho - c.low, y + c.half
    height = c.out * x + c.up * z
    t = c.out * z - c.up * x
    past = min(t, zero) + max(t - c.length, zero)
    slope = np.sqrt(height * height + past * past)
    inside = (over <= 0) & (height <= 0)
    flat = ends < slope
    distance = ends if flat else slope
    # on a face the normal is its own; from an edge it is the way to the particle, in units of its length
    face = (distance <= 0) | ((beyond if flat else abs(past)) <= 0)
    k = zero if face else one / distance
    along = beyond if flat else height * c.out - past * c.up
    upwards = side * over if flat else height * c.up + past * c.out
    return (
        (-distance if inside else distance),
        ((zero if flat else c.out) if face else k * along),
        ((side if flat else c.up) if face else k * upwards),
    )


@law(gap, ConeRecord)
def cone_gap(c: ConeRecord, p: Particle) -> float:
    return nearest_side(c, np.sqrt(p.x * p.x + p.z * p.z), p.y)[0] - p.r


@law(normal, ConeRecord)
def cone_normal(c: ConeRecord, p: Particle) -> Vector:
    rho = np.sqrt(p.x * p.x + p.z * p.z)
    _, out, up = nearest_side(c, rho, p.y)
    k = type(rho)(1) / rho if rho > 0 else type(rho)(0)
    return (out * k * p.x if rho > 0 else out), up, out * k * p.z


is_convex(ConeRecord)
