"""Bodies whose surface is the triangles of a file.

Mass, centre and moments of inertia are those of what the triangles enclose; what touches is their convex hull.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Gt
from pydantic import PrivateAttr

from particlesim.bodies.base import BodyShape
from particlesim.bodies.hull import Hull, hull_of
from particlesim.bodies.mass import Solidity, enclosed_by
from particlesim.bodies.pieces import HULL, Piece
from particlesim.bodies.shape import UNTURNED
from particlesim.colliders.content import FromFile
from particlesim.colliders.mesh import require_solid, without_flat
from particlesim.colliders.triangulation import Triangles
from particlesim.errors import UsageError
from particlesim.model.arrays import Floats, Ints
from particlesim.model.units import Number

FILLED = 0.95
"""Part of its hull that a mesh fills at least, or it is told that the hull is what touches."""
MOST_CORNERS = 4096
"""Corners of a hull at most."""
NO_SIZE = (0.0, 0.0, 0.0)


class MeshBody(FromFile, BodyShape):
    """What the triangles of a file (OBJ, PLY or STL) enclose; its convex hull is what touches."""

    kind: ClassVar[str] = "mesh"
    endings: ClassVar[tuple[str, ...]] = (".obj", ".ply", ".stl")

    type: Literal["mesh"] = "mesh"
    scale: Annotated[Number, Gt(0)] = 1.0
    """Metres per unit of the file."""

    _dropped: int = PrivateAttr(default=0)
    _surface: Triangles | None = PrivateAttr(default=None)
    _hull: Hull | None = PrivateAttr(default=None)

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
            corners, faces, self.path, "a rigid body is closed: every edge of its surface has two triangles"
        )
        hull = hull_of(corners[np.unique(solid)], self.path)
        if len(hull.corners) > MOST_CORNERS:
            raise UsageError(
                f"{self.path}: its convex hull has {len(hull.corners):,} corners",
                f"{MOST_CORNERS:,} at most: take a coarser mesh",
            )
        self._surface, self._hull, self._content = Triangles(corners, solid), hull, content

    def hull(self) -> Hull:
        """Its convex hull, in the coordinates of the file in metres."""
        assert self._hull is not None, "the file has not been read"
        return self._hull

    def surface(self, sides: int = 48) -> Triangles:
        assert self._surface is not None, "the file has not been read"
        return self._surface

    def solid(self) -> Solidity:
        return enclosed_by(*self.surface())

    def pieces(self) -> tuple[Piece, ...]:
        hull = self.hull()
        middle = hull.corners.mean(axis=0)
        planes = hull.planes.copy()
        planes[:, 3] -= planes[:, :3] @ middle
        return (
            Piece(
                HULL, NO_SIZE, middle, UNTURNED, hull._replace(corners=hull.corners - middle, planes=planes)
            ),
        )

    def words(self) -> str:
        return f"what {self.path} encloses"

    def filled(self) -> float:
        """Part of its hull that it fills."""
        return self.solid().volume / hull_volume(self.hull())

    def remarks(self) -> tuple[str, ...]:
        found = []
        if self.dropped:
            found.append(f"{self.path}: {self.dropped:,} of its triangles have no area and are left out")
        if self.filled() < FILLED:
            found.append(
                f"{self.path}: bodies touch with the convex hull of their mesh, of which it fills {self.filled():.0%} only; "
                'a shape of type "clump" puts several meshes or other shapes together'
            )
        return tuple(found)


def hull_volume(hull: Hull) -> float:
    """Volume of a hull [m³]: of the pyramids of its faces over a place inside."""
    middle, total = hull.corners.mean(axis=0), 0.0
    for face, (a, b) in enumerate(zip(hull.first[:-1].tolist(), hull.first[1:].tolist(), strict=True)):
        around = hull.corners[hull.loops[a:b]] - middle
        area = 0.5 * np.linalg.norm(np.cross(around[1:-1] - around[0], around[2:] - around[0]).sum(axis=0))
        total += area * (hull.planes[face, 3] - hull.planes[face, :3] @ middle) / 3
    return float(total)
