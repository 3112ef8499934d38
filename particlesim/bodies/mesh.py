"""Bodies whose surface is the triangles of a file.

Mass, centre and moments of inertia are those of the volume that the triangles enclose; contact is with the convex hull of
each closed surface in the file. So a shape with dents may be cut into convex parts by another program, and still be one
file. Where convex parts overlap, their common volume counts once.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Gt
from pydantic import PrivateAttr

from particlesim.bodies.base import BodyShape
from particlesim.bodies.hull import Hull, hull_of
from particlesim.bodies.mass import Solidity, enclosed_by
from particlesim.bodies.pieces import HULL, Piece, overlapping, union_of
from particlesim.bodies.shape import UNTURNED
from particlesim.colliders.content import FromFile
from particlesim.colliders.mesh import TURN, bounding, require_solid, told_of_flat, without_flat
from particlesim.colliders.overlaps import closed_surfaces
from particlesim.colliders.triangulation import Triangles
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats, Ints
from particlesim.model.units import Number

FILLED = 0.95
"""Part of its hull that a mesh fills at least; below that psim says that it touches as its hull."""
MOST_CORNERS = 4096
"""Corners of a hull at most."""
MOST_PARTS = 256
"""Parts at most."""
CONVEX = 0.999
"""Part of its hulls that a mesh without dents fills at least."""
SHARED = 1e-3
"""Part of the volume that is common to several parts from which psim warns of that."""
NO_SIZE = (0.0, 0.0, 0.0)


class MeshBody(FromFile, BodyShape):
    """The volume that the triangles of a file (OBJ, PLY or STL) enclose. It touches as its convex hull, or as those of its
    parts, if it has several closed surfaces."""

    kind: ClassVar[str] = "mesh"
    endings: ClassVar[tuple[str, ...]] = (".obj", ".ply", ".stl")

    type: Literal["mesh"] = "mesh"
    scale: Annotated[Number, Gt(0)] = 1.0
    """Metres per unit of the file."""

    _dropped: int = PrivateAttr(default=0)
    _surface: Triangles | None = PrivateAttr(default=None)
    _hulls: tuple[Hull, ...] = PrivateAttr(default=())

    @property
    def dropped(self) -> int:
        """Triangles of the file that have no area, and are left out."""
        return self._dropped

    def take(self, content: tuple[Floats, Ints]) -> None:
        """Vertices [n, 3] and triangles [m, 3]. Raises UsageError when they enclose nothing."""
        vertices, faces = content
        corners = self.scale * vertices
        solid, self._dropped = without_flat(corners, faces)
        if len(solid) == 0:
            raise UsageError(f"{self.path}: none of its triangles has an area", "a rigid body has a volume")
        require_solid(
            corners,
            bounding(corners, faces),
            self.path,
            "a rigid body has a volume, and every edge of its surface two triangles",
            TURN,
        )
        hulls = tuple(hull_of(corners[part], self.path) for part in convex_parts(corners, solid))
        if len(hulls) > MOST_PARTS:
            raise UsageError(
                f"{self.path}: it has {len(hulls):,} closed surfaces, each of them a part",
                f"{MOST_PARTS} at most: cut it into fewer parts, or join its surfaces",
            )
        most = max(len(hull.corners) for hull in hulls)
        if most > MOST_CORNERS:
            raise UsageError(
                f"{self.path}: its convex hull has {most:,} corners",
                f"{MOST_CORNERS:,} at most: take a coarser mesh",
            )
        self._surface, self._hulls, self._content = Triangles(corners, solid), hulls, content

    def hulls(self) -> tuple[Hull, ...]:
        """The convex hulls of its parts, in the coordinates of the file in metres."""
        assert self._hulls, "the file has not been read"
        return self._hulls

    def surface(self, sides: int = 48) -> Triangles:
        assert self._surface is not None, "the file has not been read"
        return self._surface

    def solid(self) -> Solidity:
        pieces = self.pieces()
        if self.filled() >= CONVEX and overlapping([(piece,) for piece in pieces]):
            return union_of(list(pieces))
        return enclosed_by(*self.surface())

    def pieces(self) -> tuple[Piece, ...]:
        return tuple(map(_piece, self.hulls()))

    def words(self) -> str:
        return f"what {self.path} encloses"

    def filled(self) -> float:
        """Part of its hulls that it fills."""
        return enclosed_by(*self.surface()).volume / sum(map(hull_volume, self.hulls()))

    def dent(self) -> float:
        """How deep a place of its surface is below its hulls, at most [m]."""
        corners, deepest = self.surface().corners[np.unique(self.surface().faces)], 0.0
        for hull in self.hulls():
            above = corners @ hull.planes[:, :3].T - hull.planes[:, 3]
            deepest = max(deepest, float(-above.max(axis=1).min()))
        return deepest

    def remarks(self) -> tuple[str, ...]:
        found = []
        if self.dropped:
            found.append(told_of_flat(self.path, self.dropped))
        if self.filled() < FILLED:
            found.append(
                f"{self.path}: bodies touch with the convex hull of their mesh, of which it fills {self.filled():.0%} only, "
                f"with dents {self.dent():.3g} m deep; a file of several closed convex parts, or a shape of type "
                '"clump" of meshes and other shapes, touches with each of them'
            )
        shared = 1 - self.volume() / enclosed_by(*self.surface()).volume
        if shared > SHARED:
            found.append(f"{self.path}: its parts share {shared:.1%} of their volume, which counts once")
        return tuple(found)


def convex_parts(corners: Floats, faces: Ints) -> list[Ints]:
    """The corners of every closed surface of triangles that has its fronts outwards; others are hollows in these."""
    parts = closed_surfaces(corners, faces)
    return [np.unique(part) for part in parts if enclosed_by(corners, part).volume > 0]


def _piece(hull: Hull) -> Piece:
    """A hull about its middle."""
    middle = hull.corners.mean(axis=0)
    planes = hull.planes.copy()
    planes[:, 3] -= planes[:, :3] @ middle
    return Piece(HULL, NO_SIZE, middle, UNTURNED, hull._replace(corners=hull.corners - middle, planes=planes))


def hull_volume(hull: Hull) -> float:
    """Volume of a hull [m³]: of the pyramids of its faces over a place inside."""
    middle, total = hull.corners.mean(axis=0), 0.0
    for face, (a, b) in enumerate(zip(hull.first[:-1].tolist(), hull.first[1:].tolist(), strict=True)):
        around = hull.corners[hull.loops[a:b]] - middle
        area = 0.5 * np.linalg.norm(np.cross(around[1:-1] - around[0], around[2:] - around[0]).sum(axis=0))
        total += area * (hull.planes[face, 3] - hull.planes[face, :3] @ middle) / 3
    return float(total)
