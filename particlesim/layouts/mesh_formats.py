"""Triangles from files: Wavefront OBJ, Stanford PLY and STL, the last two as text or binary; read by trimesh.

trimesh gets the surface alone, checked: it takes what it can of a broken file, and colours, textures and names may make it
cut a surface into pieces. Faces with more corners become triangles; an STL, which repeats the corners of every triangle, is
welded where they have the same coordinates.
"""

from __future__ import annotations

import functools
import io
import warnings
from pathlib import Path

import numpy as np

from particlesim.colliders.triangulation import three_cornered
from particlesim.errors import UsageError
from particlesim.layouts.input_file import bounded_lines, check_regular, require_memory
from particlesim.layouts.malformed import Malformed
from particlesim.layouts.obj_text import surface_of_obj
from particlesim.layouts.ply_body import surface_of_ply
from particlesim.layouts.stl_text import is_binary, triangles_of_text
from particlesim.model.arrays import Floats, Ints

Surface = tuple[Floats, Ints]

MEMORY = {".obj": 15.0, ".ply": 45.0, ".stl": 20.0}
"""Memory that reading takes at most, by the size of the file, which is largest for text; measured."""

LONGEST_FACE = 1 << 20
"""Bytes of a line: a face may have many corners."""


def read_surface(path: Path) -> Surface:
    """Vertices [n, 3] and triangles [m, 3] of a file, by its ending, without those that name a vertex twice.

    Raises UsageError when it is missing, malformed, or has no triangles; ResourceError when it is too large.
    """
    vertices, triangles = read_triangles(path)
    return vertices, triangles[three_cornered(triangles)]


def read_triangles(path: Path) -> Surface:
    """The same with all triangles of the file. Raises as `read_surface` does."""
    try:
        size = check_regular(path, "a file of triangles", "an .obj, .ply or .stl file")
        kind = path.suffix.lower()
        if kind not in MEMORY:
            raise UsageError(
                f"{path}: unknown ending {path.suffix!r} of a mesh", f"known endings: {', '.join(MEMORY)}"
            )
        return _read(path, kind, path.stat().st_mtime_ns, size)
    except Malformed as error:
        raise UsageError(f"{path}: {error}", error.hint) from None
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from None


@functools.lru_cache(maxsize=4)
def _read(path: Path, kind: str, modified: int, size: int) -> Surface:
    """The file as it is now; a run asks several times for what it holds."""
    vertices, triangles = _load(_surface_of(path, kind, size), kind[1:])
    if not np.isfinite(vertices).all():
        raise Malformed("a vertex is not finite")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise Malformed(f"a face names a vertex that does not exist; there are {len(vertices)}")
    if kind == ".stl":
        vertices, triangles = _welded(vertices, triangles)
    if not three_cornered(triangles).any():
        raise Malformed("it has no triangle with three different corners", "such faces have no area")
    return vertices, triangles


def _surface_of(path: Path, kind: str, size: int) -> bytes:
    """What trimesh is to read. Raises Malformed, UsageError, ResourceError, OSError."""
    with path.open("rb") as file:
        if kind == ".stl" and is_binary(file, size):
            require_memory(path, MEMORY[kind] * size, f"{size:,} bytes of triangles")
            return file.read(size)
        lines = bounded_lines(path, file, LONGEST_FACE)
        require_memory(path, MEMORY[kind] * size, f"{size:,} bytes of triangles")
        if kind == ".stl":
            return triangles_of_text(lines)
        return surface_of_obj(lines) if kind == ".obj" else surface_of_ply(file, size)


def _load(surface: bytes, kind: str) -> Surface:
    """Vertices and triangles by trimesh. Raises Malformed."""
    import trimesh  # late: it takes most of a second, and few scenarios have meshes

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # NumPy warns of text that is no number, and leaves the rest out
            mesh = trimesh.load_mesh(
                io.BytesIO(surface), file_type=kind, process=False, maintain_order=True, skip_materials=True
            )
            vertices = np.array(mesh.vertices, dtype=float).reshape(-1, 3)
            triangles = np.array(mesh.faces, dtype=np.int64).reshape(-1, 3)
    except Exception as error:  # of any kind: what it meets first in a broken file
        raise Malformed(f"trimesh cannot read it: {error}") from None
    if len(triangles) == 0:
        raise Malformed("it has no triangles", "a face names three vertices or more")
    return vertices, triangles


def _welded(corners: Floats, triangles: Ints) -> Surface:
    """One vertex for all corners with the same coordinates, in the order in which the file names them first."""
    _, first, place = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return corners[first[order]], rank[place.reshape(-1)][triangles]
