"""Flocks of birds by three rules: keep your distance, fly as your neighbours do, stay with them.

    f = (S (1 − r/d)₊/r − C w) l − A w v,   w = 1 − r/R for r < R,   l = x₁ − x₂, v = v₁ − v₂, r = |l|

S separates birds that are nearer than d, A aligns their velocities and C draws them together, as far as a bird sees, R.
Reynolds takes the mean over the neighbours; here it is the sum over them, weighted by nearness, so that what one bird does
to another the other does to the first, and the flock as a whole keeps its momentum.
Source: C. W. Reynolds, Flocks, herds, and schools: a distributed behavioral model, Computer Graphics 21(4), 25 (1987).
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt
from pydantic import model_validator

from particlesim.interactions.base import PairInteraction
from particlesim.laws.pair import Pair, pair_force, pair_force_dv, pair_force_dx, square
from particlesim.laws.registry import Matrix, Vector, law
from particlesim.model.mistakes import invalid
from particlesim.model.units import KilogramsPerSecond, Metres, Newtons, NewtonsPerMetre


class Flocking(PairInteraction):
    """Birds of a flock, fish of a school: separation, alignment and cohesion."""

    type: Literal["flocking"] = "flocking"
    sight: Annotated[Metres, Gt(0)]
    """How far a bird sees, R."""
    distance: Annotated[Metres, Ge(0)] = 0.0
    """Distance d that birds keep from each other."""
    separation: Annotated[Newtons, Ge(0)] = 0.0
    """Force S with which they do so when they touch."""
    alignment: Annotated[KilogramsPerSecond, Ge(0)] = 0.0
    """A: force for a difference in velocity."""
    cohesion: Annotated[NewtonsPerMetre, Ge(0)] = 0.0
    """C: force towards others for their distance."""

    unused: ClassVar[tuple[str, ...]] = ("shift",)
    formula: ClassVar[str] = (
        "f = (S (1 − r/d)₊/r − C w) l − A w v, w = 1 − r/R, l = x₁ − x₂, v = v₁ − v₂, r = |l|"
    )
    energy: ClassVar[str] = "none: alignment dissipates, and birds steer by their own strength"

    @model_validator(mode="after")
    def _within_sight(self) -> Flocking:
        if self.distance > self.sight:
            raise invalid(
                "birds cannot keep a distance beyond their sight",
                at=("distance",),
                also=[(("sight",), "here")],
            )
        if self.separation > 0 and self.distance == 0:
            raise invalid(
                "separation needs a distance", at=("separation",), allowed="distance = 1.0 (m), say"
            )
        if self.shift != "none":
            raise invalid("a shift is for laws with an energy", at=("shift",))
        return self

    def record(self) -> FlockingRecord:
        nearest = 1 / self.distance if self.distance > 0 else 1.0
        return FlockingRecord(1 / self.sight, nearest, self.separation, self.alignment, self.cohesion)

    def needs_velocity(self) -> bool:
        return self.alignment > 0

    def reach(self) -> float | None:
        return self.sight if self.cutoff is None else min(self.sight, self.cutoff)

    def singular(self) -> bool:
        return False


class FlockingRecord(NamedTuple):
    """1/R, 1/d [1/m], S [N], A [kg/s], C [N/m]."""

    sight: float
    near: float
    separation: float
    alignment: float
    cohesion: float


def weights(f: FlockingRecord, p: Pair) -> tuple[float, float, float, float]:
    """The distance; how near a pair is to the end of sight, w; and f = a l − A w v with a and its derivative by r."""
    r = np.sqrt(square(p))
    w = max(1 - r * f.sight, r - r)
    part = 1 - r * f.near
    close = f.separation if part > 0 else r - r
    seen = f.cohesion * f.sight if w > 0 else r - r
    return r, w, close * part / r - f.cohesion * w, seen - close / (r * r)


@law(pair_force, FlockingRecord)
def flocking_force(f: FlockingRecord, p: Pair) -> Vector:
    _, w, a, _ = weights(f, p)
    b = -f.alignment * w
    return a * p.x + b * p.vx, a * p.y + b * p.vy, a * p.z + b * p.vz


@law(pair_force_dx, FlockingRecord)
def flocking_dx(f: FlockingRecord, p: Pair) -> Matrix:
    r, w, a, rise = weights(f, p)
    b = f.alignment * f.sight if w > 0 else r - r
    # rows of a 1 + (a' l + b' v) lᵀ/r
    x, y, z = ((rise * s + b * v) / r for s, v in ((p.x, p.vx), (p.y, p.vy), (p.z, p.vz)))
    return (
        a + x * p.x,
        x * p.y,
        x * p.z,
        y * p.x,
        a + y * p.y,
        y * p.z,
        z * p.x,
        z * p.y,
        a + z * p.z,
    )


@law(pair_force_dv, FlockingRecord)
def flocking_dv(f: FlockingRecord, p: Pair) -> Matrix:
    _, w, _, _ = weights(f, p)
    b, zero = -f.alignment * w, w - w
    return b, zero, zero, zero, b, zero, zero, zero, b
