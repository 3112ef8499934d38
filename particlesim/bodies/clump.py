"""Bodies put together of several shapes, which are one rigid body of one density.

Where parts overlap, what is there counts once: parts that do not overlap are summed in closed form, others by `union_of`.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from particlesim.bodies.base import BodyShape
from particlesim.bodies.mass import Solidity, together
from particlesim.bodies.mesh import CONVEX, SHARED, MeshBody
from particlesim.bodies.pieces import Piece, overlapping, union_of
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
    """The volume that the triangles of a file (OBJ, PLY or STL) enclose. It touches as its convex hull, or as those of its
    parts, if it has several closed surfaces."""


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

    def solid(self) -> Solidity:
        """Raises UsageError where a mesh with dents overlaps another part."""
        pairs = overlapping(self.placed_pieces())
        for i in sorted({k for pair in pairs for k in pair}):
            part = self.parts[i]
            if isinstance(part, MeshBody) and part.filled() < CONVEX:
                raise UsageError(
                    f"part {i} of a clump, {part.path}, has dents and overlaps another part",
                    "only parts without dents may overlap: what they share is counted once",
                )
        if pairs:
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
