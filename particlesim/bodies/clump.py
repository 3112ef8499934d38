"""Bodies put together of several shapes, which are one rigid body of one density.

Where parts overlap, what is there counts once: parts that do not overlap are summed in closed form, others by `union_of`.
"""

from __future__ import annotations

from itertools import combinations
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from particlesim.bodies.base import BodyShape
from particlesim.bodies.mass import Solidity, together
from particlesim.bodies.mesh import MeshBody
from particlesim.bodies.pieces import BOX, CAPSULE, CONE, CYLINDER, HULL, Piece, union_of
from particlesim.bodies.shape import UNTURNED as STRAIGHT
from particlesim.bodies.shape import (
    BallBody,
    BoxBody,
    CapsuleBody,
    ConeBody,
    CylinderBody,
)
from particlesim.colliders.pose import Orientation
from particlesim.colliders.triangulation import Triangles, joined
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats
from particlesim.model.base import Model
from particlesim.model.units import Metres, Vector
from particlesim.model.variants import Tagged

TOUCHING = 1e-9
"""Overlap of two parts that counts as none, in units of the smaller one."""
SHARED = 1e-3
"""Part of the volume that parts share which is told."""
CONVEX = 0.999
"""Part of its hull that a mesh without dents fills at least."""


class Placed(Model):
    """A shape at a place of a clump."""

    offset: Vector[Metres] = (0.0, 0.0, 0.0)
    """Where the origin of its frame is in that of the clump."""
    orientation: Orientation | None = None
    """How it is turned about that origin."""

    def rotation(self) -> Floats:
        """From its frame to that of the clump."""
        return STRAIGHT if self.orientation is None else np.array(self.orientation.rotation())


class BallPart(Placed, BallBody):
    """A ball."""


class BoxPart(Placed, BoxBody):
    """A cuboid."""


class CapsulePart(Placed, CapsuleBody):
    """A cylinder with round ends, along z before it is turned."""


class CylinderPart(Placed, CylinderBody):
    """A cylinder with flat ends, along z before it is turned."""


class ConePart(Placed, ConeBody):
    """A cone, its tip towards z before it is turned, its centre of mass in the origin of its frame."""


class MeshPart(Placed, MeshBody):
    """What the triangles of a file (OBJ, PLY or STL) enclose; what touches is its convex hull, or those of its parts, if it
    has several closed surfaces."""


AnyPart = Annotated[
    BallPart | BoxPart | CapsulePart | CylinderPart | ConePart | MeshPart,
    Tagged("type"),
]


class ClumpBody(BodyShape):
    """Several shapes as one body."""

    type: Literal["clump"] = "clump"
    parts: tuple[AnyPart, ...] = Field(min_length=1, max_length=512)
    """The shapes: tables with a type, the keys of that shape, an `offset` and an `orientation`."""

    def placed_pieces(self) -> list[list[Piece]]:
        """The convex pieces of every part, in the frame of the clump."""
        return [
            [piece.placed(np.array(part.offset), part.rotation()) for piece in part.pieces()]
            for part in self.parts
        ]

    def pieces(self) -> tuple[Piece, ...]:
        return tuple(piece for pieces in self.placed_pieces() for piece in pieces)

    def overlapping(self) -> list[tuple[int, int]]:
        """Pairs of parts that overlap, or may do so."""
        pieces = self.placed_pieces()
        return [
            (i, j)
            for i, j in combinations(range(len(pieces)), 2)
            if any(not apart(one, two) for one in pieces[i] for two in pieces[j])
        ]

    def solid(self) -> Solidity:
        """Raises UsageError where a mesh with dents overlaps another part."""
        overlapping = self.overlapping()
        for i in sorted({k for pair in overlapping for k in pair}):
            part = self.parts[i]
            if isinstance(part, MeshBody) and part.filled() < CONVEX:
                raise UsageError(
                    f"part {i} of a clump, {part.path}, has dents and overlaps another part",
                    "only parts without dents may overlap: what they share is counted once",
                )
        if overlapping:
            return union_of(list(self.pieces()))
        return together(self._solids())

    def _solids(self) -> list[Solidity]:
        return [part.solid().seen(np.array(part.offset), part.rotation()) for part in self.parts]

    def surface(self, sides: int = 48) -> Triangles:
        found = []
        for part in self.parts:
            corners, faces = part.surface(sides)
            found.append(Triangles(np.array(part.offset) + corners @ part.rotation().T, faces))
        return joined(found)

    def words(self) -> str:
        return f"{len(self.parts)} shapes as one body"

    def remarks(self) -> tuple[str, ...]:
        found = [remark for part in self.parts for remark in part.remarks()]
        shared = 1 - self.volume() / sum(solid.volume for solid in self._solids())
        if shared > SHARED:
            found.append(f"parts of a clump share {shared:.1%} of their volume, which counts once")
        return tuple(dict.fromkeys(found))


def apart(one: Piece, two: Piece) -> bool:
    """Whether two pieces are apart along a direction that is likely to separate them."""
    line = two.at - one.at
    if np.linalg.norm(line) > one.ball() + two.ball():
        return True
    directions = [*_normals(one), *_normals(two), line, *_between_axes(one, two)]
    slack = TOUCHING * min(one.ball(), two.ball())
    for direction in directions:
        size = float(np.linalg.norm(direction))
        if size > 0:
            (a, b), (c, d) = one.extent(direction / size), two.extent(direction / size)
            if c >= b - slack or a >= d - slack:
                return True
    return False


def _normals(piece: Piece) -> list[Floats]:
    """Normals of its flat sides."""
    if piece.kind == BOX:
        return list(piece.rotation.T)
    if piece.kind in (CYLINDER, CONE):
        return [piece.rotation[:, 2]]
    if piece.kind == HULL:
        assert piece.hull is not None
        return list(piece.hull.planes[:, :3] @ piece.rotation.T)
    return []


def _between_axes(one: Piece, two: Piece) -> list[Floats]:
    """From the nearest place of the axis of one to that of the other, and across both."""
    u, w = (
        piece.rotation[:, 2] * (piece.size[1] if piece.kind in (CAPSULE, CYLINDER) else 0.0)
        for piece in (one, two)
    )
    line = two.at - one.at
    s = t = 0.0
    for _ in range(20):
        s = float(np.clip((line + t * w) @ u / (u @ u), -1, 1)) if u @ u > 0 else 0.0
        t = float(np.clip((s * u - line) @ w / (w @ w), -1, 1)) if w @ w > 0 else 0.0
    return [line + t * w - s * u, np.cross(u, w)]
