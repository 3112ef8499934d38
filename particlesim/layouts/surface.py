"""A body from the triangles of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Gt
from pydantic import PrivateAttr, StringConstraints

from particlesim.layouts.base import Placed
from particlesim.layouts.mesh import BEND, DIHEDRAL, STRUCTURAL, Mesh, folds, require_manifold
from particlesim.layouts.mesh_formats import read_surface
from particlesim.model.arrays import Floats, Ints
from particlesim.model.units import Metres, MetresPerSecond, Number, Vector
from particlesim.sampling.random_streams import Streams


class SurfaceFile(Mesh):
    """A particle at every vertex of a file of triangles (OBJ, PLY or STL), relative to the scenario's folder.

    Structural springs are the edges of the triangles; bend springs join the two corners opposite a common edge, dihedrals
    resist its folding. Faces with more corners are cut into triangles. Vertices that no face names are left out, and so are
    normals, colours and textures. The file is read by trimesh.
    """

    kinds: ClassVar[tuple[str, ...]] = (STRUCTURAL, BEND, DIHEDRAL)

    type: Literal["mesh"] = "mesh"
    path: Annotated[str, StringConstraints(min_length=1, max_length=4096)]
    """The file; its ending (.obj, .ply, .stl) says what it is."""
    origin: Vector[Metres] = (0.0, 0.0, 0.0)
    """Where the origin of the file's coordinates is."""
    scale: Annotated[Number, Gt(0)] = 1.0
    """Metres per unit of the file."""
    velocity: Vector[MetresPerSecond] = (0.0, 0.0, 0.0)
    """Velocity of all its particles."""

    _vertices: Floats | None = PrivateAttr(default=None)
    _triangles: Ints | None = PrivateAttr(default=None)

    def open(self, folder: Path | None) -> SurfaceFile:
        path = Path(self.path)
        if not path.is_absolute() and folder is not None:
            path = folder / path
        vertices, triangles = read_surface(path)
        used, named = np.unique(triangles, return_inverse=True)
        opened = self.model_copy()
        opened._vertices, opened._triangles = vertices[used], named.reshape(-1, 3)
        return opened

    def number(self) -> int | None:
        return None if self._vertices is None else len(self._vertices)

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        assert self._vertices is not None, "open() comes first"
        position = np.array(self.origin)[:, None] + self.scale * self._vertices[first : first + count].T
        return Placed(position, np.repeat(np.array(self.velocity)[:, None], count, axis=1))

    def edges(self, kind: str) -> Ints:
        assert self._triangles is not None, "open() comes first"
        if kind == BEND:
            return self.hinges(DIHEDRAL)[:, [0, 3]]
        t = self._triangles
        ends = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
        return np.unique(ends, axis=0)

    def hinges(self, kind: str) -> Ints:
        require_manifold(self.triangles(), self.path)
        return folds(self.triangles())

    def triangles(self) -> Ints:
        assert self._triangles is not None, "open() comes first"
        return self._triangles
