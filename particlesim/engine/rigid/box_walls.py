"""Colliders that are boxes, as bodies touch them: solid ones as another box, with edges that cross edges, and rooms as six
planes."""

from __future__ import annotations

from typing import Any

from particlesim.bodies.pieces import BOX
from particlesim.colliders.box import BoxRecord
from particlesim.colliders.moving import MovingRecord, frame_at, out_of
from particlesim.colliders.plane import PlaneRecord
from particlesim.colliders.pose import ShiftedRecord, TurnedRecord
from particlesim.colliders.solid import HollowConvexRecord
from particlesim.engine.rigid.pieces import Solid
from particlesim.engine.rigid.rotation import dot

SIDES = 6
"""Sides of a room."""
PLACED = (ShiftedRecord, TurnedRecord)
"""Shapes with a frame of their own."""


def is_box(shape: Any) -> bool:
    """Whether a collider is a solid box."""
    if isinstance(shape, MovingRecord):
        return is_placed_box(shape.shape)
    return is_placed_box(shape)


def is_room(shape: Any) -> bool:
    """Whether a collider is the inside of a box."""
    if isinstance(shape, MovingRecord):
        return is_hollow_box(shape.shape)
    return is_hollow_box(shape)


def is_placed_box(shape: Any) -> bool:
    """Whether a shape is a box, where it is at the start."""
    if isinstance(shape, PLACED):
        return isinstance(shape.shape, BoxRecord)
    return False


def is_hollow_box(shape: Any) -> bool:
    """Whether a shape is the inside of a box, where it is at the start."""
    if isinstance(shape, HollowConvexRecord):
        return is_placed_box(shape.shape)
    return False


def box_of(shape: Any, t: Any, number: Any) -> Solid:
    """A solid box at a time, with the sizes of the piece of that number."""
    if isinstance(shape, MovingRecord):
        return moved(shape, placed_box(shape.shape, number), t)
    return placed_box(shape, number)


def room_of(shape: Any, t: Any, number: Any) -> Solid:
    """The box around a room at a time."""
    if isinstance(shape, MovingRecord):
        return moved(shape, placed_box(shape.shape.shape, number), t)
    return placed_box(shape.shape, number)


def placed_box(shape: Any, number: Any) -> Solid:
    """A box where it is at the start."""
    c = shape.shape
    size, x = (c.x, c.y, c.z), (shape.x, shape.y, shape.z)
    if isinstance(shape, TurnedRecord):
        r = (shape.xx, shape.xy, shape.xz, shape.yx, shape.yy, shape.yz, shape.zx, shape.zy, shape.zz)
    else:
        r = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    return Solid(number, BOX, size, x, r)


def moved(shape: Any, s: Any, t: Any) -> Solid:
    """A box that is led, at a time."""
    f = frame_at(shape, t, 0.0)
    a = out_of(f.rows, (s.x[0] - shape.x, s.x[1] - shape.y, s.x[2] - shape.z))
    r = s.r
    u = out_of(f.rows, (r[0], r[3], r[6]))
    v = out_of(f.rows, (r[1], r[4], r[7]))
    w = out_of(f.rows, (r[2], r[5], r[8]))
    x = (f.x + a[0], f.y + a[1], f.z + a[2])
    return Solid(s.number, s.kind, s.size, x, (u[0], v[0], w[0], u[1], v[1], w[1], u[2], v[2], w[2]))


def moved_frame(shape: Any, x: Any, u: Any, t: Any) -> Any:
    """Where a place, and a direction, of a shape that is led are at a time."""
    f = frame_at(shape, t, 0.0)
    a = out_of(f.rows, (x[0] - shape.x, x[1] - shape.y, x[2] - shape.z))
    return (f.x + a[0], f.y + a[1], f.z + a[2]), out_of(f.rows, u)


def plane_of(s: Any, side: Any) -> PlaneRecord:
    """The plane of one of the sides of a room, with its normal inwards."""
    axis, sign = side // 2, 1.0 - 2.0 * (side % 2)
    r = s.r
    u = (r[0], r[3], r[6]) if axis == 0 else ((r[1], r[4], r[7]) if axis == 1 else (r[2], r[5], r[8]))
    half = s.size[0] if axis == 0 else (s.size[1] if axis == 1 else s.size[2])
    n = (sign * u[0], sign * u[1], sign * u[2])
    return PlaneRecord(n[0], n[1], n[2], dot(n, s.x) - half)
