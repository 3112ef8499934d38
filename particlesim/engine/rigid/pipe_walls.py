"""Containers that are cylinders, as bodies with edges touch them: the round side and both ends are looked at one by one, as
what is flush with an end is next to that everywhere, and to the side besides."""

from __future__ import annotations

from typing import Any

from particlesim.bodies.pieces import CAPSULE, SPHERE
from particlesim.colliders.cylinder import CylinderRecord
from particlesim.colliders.moving import MovingRecord
from particlesim.colliders.plane import PlaneRecord
from particlesim.colliders.pose import ShiftedRecord
from particlesim.colliders.solid import HollowConvexRecord
from particlesim.engine.rigid.box_walls import PLACED, moved_frame
from particlesim.engine.rigid.rotation import dot

ENDS = 2
LONGER = 4.0
"""How much longer on both sides the pipe is that stands for the side alone, in its radii."""


def is_pipe(shape: Any) -> bool:
    """Whether a collider is the inside of a cylinder."""
    if isinstance(shape, MovingRecord):
        return is_hollow_cylinder(shape.shape)
    return is_hollow_cylinder(shape)


def is_hollow_cylinder(shape: Any) -> bool:
    """Whether a shape is the inside of a cylinder, where it is at the start."""
    if isinstance(shape, HollowConvexRecord) and isinstance(shape.shape, PLACED):
        return isinstance(shape.shape.shape, CylinderRecord)
    return False


def has_edges(s: Any) -> bool:
    """Whether a piece touches with edges, and not by its radius alone."""
    return bool(s.kind != SPHERE and s.kind != CAPSULE)


def side_of(shape: Any) -> Any:
    """The round side of a pipe, as one that is longer."""
    if isinstance(shape, MovingRecord):
        c = shape
        return MovingRecord(side_of(c.shape), c.x, c.y, c.z, c.path, c.spin)
    a = shape.shape
    c = a.shape
    long = CylinderRecord(c.half + LONGER * c.radius, c.radius)
    placed = ShiftedRecord(a.x, a.y, a.z, long) if isinstance(a, ShiftedRecord) else type(a)(*a[:-1], long)
    return HollowConvexRecord(placed, shape.grain)


def end_of(shape: Any, end: Any, t: Any) -> PlaneRecord:
    """The plane of an end of a pipe at a time, with its normal inwards."""
    hollow = shape.shape if isinstance(shape, MovingRecord) else shape
    a = hollow.shape
    x = (a.x, a.y, a.z)
    axis = (0.0, 1.0, 0.0) if isinstance(a, ShiftedRecord) else (a.xy, a.yy, a.zy)
    if isinstance(shape, MovingRecord):
        x, axis = moved_frame(shape, x, axis, t)
    sign = 1.0 - 2.0 * end
    n = (sign * axis[0], sign * axis[1], sign * axis[2])
    return PlaneRecord(n[0], n[1], n[2], dot(n, x) - a.shape.half)
