"""Where a shape is and how it is turned: a shape has a frame of its own, in which its laws are simple.

x = c + R y, with y the place in the shape's frame and R a rotation; lengths, and so gaps, are the same in both.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from pydantic import field_validator

from particlesim.laws.registry import (
    Particle,
    Vector,
    apart,
    bend,
    first_contact,
    gap,
    law,
    least_gap,
    moved_to,
    normal,
    side_from,
    sure_gap,
    thinnest,
)
from particlesim.model.base import Model
from particlesim.model.units import Degrees
from particlesim.model.units import Vector as VectorOf
from particlesim.model.vectors import Vector3, dot, perpendicular, unit

Rows = tuple[Vector3, Vector3, Vector3]
"""A rotation, row by row."""

UNTURNED: Rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Orientation(Model):
    """A turn about an axis through the centre, right-handed."""

    axis: VectorOf[float]
    """The axis; its length does not matter."""
    angle: Degrees
    """How far."""

    @field_validator("axis")
    @classmethod
    def _has_direction(cls, axis: Vector3) -> Vector3:
        unit(axis)
        return axis

    def rotation(self) -> Rows:
        """Its matrix (Rodrigues). Quarter turns about an axis of the frame are exact."""
        n = unit(self.axis)
        turns = self.angle / 90
        quarter = int(turns) % 4 if turns == int(turns) else None
        if quarter is None:
            c, s = math.cos(math.radians(self.angle)), math.sin(math.radians(self.angle))
        else:
            c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter]
        x, y, z = n
        k = 1 - c
        return (
            (c + k * x * x, k * x * y - s * z, k * x * z + s * y),
            (k * x * y + s * z, c + k * y * y, k * y * z - s * x),
            (k * x * z - s * y, k * y * z + s * x, c + k * z * z),
        )


def along(direction: Vector3) -> Rows:
    """A rotation that turns the y axis into a direction."""
    v = unit(direction)
    if v == (0.0, 1.0, 0.0):
        return UNTURNED
    a, b = perpendicular(v)
    return tuple(zip(b, v, a, strict=True))  # type: ignore[return-value]  # columns b, v, a: right-handed


def placed(shape: Any, center: Vector3, rotation: Rows = UNTURNED) -> Any:
    """A shape at a place, turned: as kernels take it."""
    if rotation == UNTURNED:
        return ShiftedRecord(*center, shape)
    return TurnedRecord(*center, *rotation[0], *rotation[1], *rotation[2], shape)


def turned(rotation: Rows, v: Vector3) -> Vector3:
    """R v."""
    return dot(rotation[0], v), dot(rotation[1], v), dot(rotation[2], v)


class ShiftedRecord(NamedTuple):
    """A shape whose frame has its origin at a place [m]."""

    x: float
    y: float
    z: float
    shape: Any


class TurnedRecord(NamedTuple):
    """A shape at a place [m], with the rotation R, row by row."""

    x: float
    y: float
    z: float
    xx: float
    xy: float
    xz: float
    yx: float
    yy: float
    yz: float
    zx: float
    zy: float
    zz: float
    shape: Any


def seen_from(c: ShiftedRecord | TurnedRecord, p: Particle) -> Particle:
    """The particle in the shape's frame: place and velocity."""
    x, y, z = p.x - c.x, p.y - c.y, p.z - c.z
    if isinstance(c, ShiftedRecord):
        return moved_to(p, x, y, z, p.vx, p.vy, p.vz, p.t)
    return moved_to(
        p,
        c.xx * x + c.yx * y + c.zx * z,
        c.xy * x + c.yy * y + c.zy * z,
        c.xz * x + c.yz * y + c.zz * z,
        c.xx * p.vx + c.yx * p.vy + c.zx * p.vz,
        c.xy * p.vx + c.yy * p.vy + c.zy * p.vz,
        c.xz * p.vx + c.yz * p.vy + c.zz * p.vz,
        p.t,
    )


def _gap(c: ShiftedRecord | TurnedRecord, p: Particle) -> float:
    return gap(c.shape, seen_from(c, p))


@law(normal, ShiftedRecord)
def shifted_normal(c: ShiftedRecord, p: Particle) -> Vector:
    return normal(c.shape, seen_from(c, p))


@law(normal, TurnedRecord)
def turned_normal(c: TurnedRecord, p: Particle) -> Vector:
    x, y, z = normal(c.shape, seen_from(c, p))
    return c.xx * x + c.xy * y + c.xz * z, c.yx * x + c.yy * y + c.yz * z, c.zx * x + c.zy * y + c.zz * z


@law(side_from, ShiftedRecord)
def shifted_side_from(c: ShiftedRecord, p: Particle, q: Particle) -> tuple[float, Vector]:
    return side_from(c.shape, seen_from(c, p), seen_from(c, q))


@law(side_from, TurnedRecord)
def turned_side_from(c: TurnedRecord, p: Particle, q: Particle) -> tuple[float, Vector]:
    g, (x, y, z) = side_from(c.shape, seen_from(c, p), seen_from(c, q))
    return g, (c.xx * x + c.xy * y + c.xz * z, c.yx * x + c.yy * y + c.yz * z, c.zx * x + c.zy * y + c.zz * z)


def _apart(c: ShiftedRecord | TurnedRecord, p: Particle, q: Particle, h: float, slack: float) -> bool:
    return apart(c.shape, seen_from(c, p), seen_from(c, q), h, slack)


def _first_contact(
    c: ShiftedRecord | TurnedRecord, p: Particle, q: Particle, h: float, slack: float
) -> float:
    return first_contact(c.shape, seen_from(c, p), seen_from(c, q), h, slack)


def _least_gap(c: ShiftedRecord | TurnedRecord, p: Particle, need: float) -> float:
    return least_gap(c.shape, seen_from(c, p), need)


def _sure_gap(c: ShiftedRecord | TurnedRecord, p: Particle) -> float:
    return sure_gap(c.shape, seen_from(c, p))


def _thinnest(c: ShiftedRecord | TurnedRecord) -> float:
    return thinnest(c.shape)


def _bend(c: ShiftedRecord | TurnedRecord) -> int:
    return bend(c.shape)


for _record in (ShiftedRecord, TurnedRecord):
    law(gap, _record)(_gap)
    law(bend, _record)(_bend)
    law(least_gap, _record)(_least_gap)
    law(sure_gap, _record)(_sure_gap)
    law(thinnest, _record)(_thinnest)
    law(apart, _record)(_apart)
    law(first_contact, _record)(_first_contact)
