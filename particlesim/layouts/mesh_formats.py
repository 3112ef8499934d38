"""Triangles from files: Wavefront OBJ, Stanford PLY and STL, the last two as text or binary.

Faces with more corners become fans of triangles; an STL, which repeats the corners of every triangle, is welded where they
have the same coordinates. Everything else in the files (normals, colours, materials) is passed over.
Source: Wavefront, Object Files, appendix B1; G. Turk, The PLY Polygon File Format (1994); 3D Systems, StereoLithography
Interface Specification (1989).
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from particlesim.errors import UsageError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Surface = tuple[Floats, Ints]

PLY_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}


class _Malformed(Exception):
    """What is wrong with the text or the bytes of a file."""


def read_surface(path: Path) -> Surface:
    """Vertices [n, 3] and triangles [m, 3] of a file, by its ending.

    Raises UsageError when it is missing, malformed, or has no triangles.
    """
    if not path.is_file():
        what = "is a directory" if path.is_dir() else "does not exist"
        raise UsageError(f"{path} {what}", "the path of a layout is relative to the scenario's folder")
    if path.suffix.lower() not in FORMATS:
        raise UsageError(
            f"{path}: unknown ending {path.suffix!r} of a mesh", f"known endings: {', '.join(FORMATS)}"
        )
    try:
        about = path.stat()
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error}") from None
    return _read(path, about.st_mtime_ns, about.st_size)


@functools.lru_cache(maxsize=4)
def _read(path: Path, modified: int, size: int) -> Surface:
    """The file as it is now; a run asks several times for what it holds."""
    try:
        vertices, triangles = FORMATS[path.suffix.lower()](path.read_bytes())
    except (_Malformed, ValueError, struct.error, OverflowError) as error:
        raise UsageError(f"{path}: {error}", "is it what its ending says, and whole?") from None
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error}") from None
    if len(triangles) == 0:
        raise UsageError(f"{path} has no triangles", "a face names three vertices or more")
    if not np.isfinite(vertices).all():
        raise UsageError(f"{path}: a vertex is not finite")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise UsageError(f"{path}: a face names a vertex that does not exist; there are {len(vertices)}")
    sound = triangles[_sound(triangles)]
    if len(sound) == 0:
        raise UsageError(f"{path} has no triangle with three different corners", "such faces have no area")
    return vertices, sound


def _sound(triangles: Ints) -> NDArray[np.bool_]:
    """Which triangles have three different corners."""
    a, b, c = triangles.T
    return np.asarray((a != b) & (b != c) & (c != a))


def fans(faces: Iterable[Sequence[int]]) -> Ints:
    """Faces of any number of corners as triangles around their first corners, shape [n, 3]."""
    found = [(face[0], face[k], face[k + 1]) for face in faces for k in range(1, len(face) - 1)]
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def read_obj(data: bytes) -> Surface:
    """Lines `v x y z` and `f a b c ...`, where a is a number from 1, or from the end if negative; `a/b/c` is a."""
    vertices: list[tuple[float, float, float]] = []
    faces: list[list[int]] = []
    text = data.decode("utf-8", errors="replace").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].split()
        try:
            if words[:1] == ["v"]:
                x, y, z = (float(word) for word in words[1:4])
                vertices.append((x, y, z))
            elif words[:1] == ["f"]:
                corners = [int(word.split("/")[0]) for word in words[1:]]
                if len(corners) < 3 or 0 in corners:
                    raise ValueError
                faces.append([k - 1 if k > 0 else len(vertices) + k for k in corners])
        except ValueError:
            raise _Malformed(f"line {number} is no vertex and no face: {line[:60]!r}") from None
    return np.array(vertices, float).reshape(-1, 3), fans(faces)


def read_ply(data: bytes) -> Surface:
    """A header that says what follows; the elements `vertex` and `face`, as text or binary of either order."""
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise _Malformed("no PLY header")
    body = data.index(b"\n", end) + 1
    encoding, elements = _ply_header(data[:end].decode("ascii", errors="replace"))
    columns: Callable[[int, list[tuple[str, ...]]], list[list[Sequence[float]]]]
    if encoding == "ascii":
        words = iter(data[body:].split())
        columns = functools.partial(_ply_text, words)
    else:
        order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(encoding)
        if order is None:
            raise _Malformed(f"unknown PLY format {encoding!r}")
        columns = functools.partial(_ply_binary, _Bytes(data, body, order))
    vertices, faces = np.empty((0, 3)), np.empty((0, 3), np.int64)
    for name, count, properties in elements:
        if count > len(data):
            raise _Malformed(f"{count} of {name!r} do not fit into the file")
        rows = columns(count, properties)
        names = [entry[-1] for entry in properties]
        if name == "vertex":
            if not {"x", "y", "z"} <= set(names):
                raise _Malformed("vertices without x, y and z")
            at = [names.index(axis) for axis in "xyz"]
            vertices = np.array([[row[k][0] for k in at] for row in rows], float).reshape(-1, 3)
        elif name == "face":
            lists = [k for k, key in enumerate(names) if key in ("vertex_indices", "vertex_index")]
            if not lists:
                raise _Malformed("faces without vertex_indices")
            faces = fans([[int(k) for k in row[lists[0]]] for row in rows])
    return vertices, faces


def _ply_header(text: str) -> tuple[str, list[tuple[str, int, list[tuple[str, ...]]]]]:
    """The format, and of every element its name, count and properties: (type, name) or (list, count type, type, name)."""
    encoding, elements = "", list[tuple[str, int, list[tuple[str, ...]]]]()
    for words in (line.split() for line in text.splitlines()):
        if words[:1] == ["format"] and len(words) > 1:
            encoding = words[1]
        elif words[:1] == ["element"] and len(words) == 3:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"] and elements:
            kinds = words[2:4] if words[1] == "list" else words[1:2]
            if any(kind not in PLY_TYPES for kind in kinds):
                raise _Malformed(f"unknown property {' '.join(words[1:])!r}")
            elements[-1][2].append(tuple(words[1:]))
    return encoding, elements


def _ply_text(
    words: Iterable[bytes], count: int, properties: list[tuple[str, ...]]
) -> list[list[Sequence[float]]]:
    source = iter(words)
    try:
        return [
            [
                [float(next(source)) for _ in range(int(next(source)) if p[0] == "list" else 1)]
                for p in properties
            ]
            for _ in range(count)
        ]
    except (StopIteration, RuntimeError):
        raise _Malformed("the file ends too early") from None


class _Bytes:
    """Bytes that are read one value after the other."""

    def __init__(self, data: bytes, at: int, order: str) -> None:
        self.data, self.at, self.order = data, at, order

    def take(self, kind: str, count: int) -> Sequence[float]:
        """Numbers of a PLY type."""
        dtype = np.dtype(self.order + PLY_TYPES[kind])
        if count < 0 or self.at + count * dtype.itemsize > len(self.data):
            raise _Malformed("the file ends too early")
        found = np.frombuffer(self.data, dtype, count, self.at)
        self.at += found.nbytes
        return found.tolist()


def _ply_binary(source: _Bytes, count: int, properties: list[tuple[str, ...]]) -> list[list[Sequence[float]]]:
    return [
        [
            source.take(p[2], int(source.take(p[1], 1)[0])) if p[0] == "list" else source.take(p[0], 1)
            for p in properties
        ]
        for _ in range(count)
    ]


def read_stl(data: bytes) -> Surface:
    """Binary: 80 bytes, the number of triangles, 50 bytes for each. Text: lines `vertex x y z`, three to a triangle."""
    number = struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else -1
    if len(data) == 84 + 50 * number:
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
        corners = np.frombuffer(data, record, number, 84)["corners"].astype(float).reshape(-1, 3)
    elif data.lstrip().startswith(b"solid"):
        lines = (line.split() for line in data.splitlines())
        found = [[float(word) for word in words[1:4]] for words in lines if words[:1] == [b"vertex"]]
        if len(found) % 3 or any(len(row) != 3 for row in found):
            raise _Malformed("its vertices are no triangles")
        corners = np.array(found, float).reshape(-1, 3)
    else:
        raise _Malformed("no STL: neither text, nor as long as its number of triangles says")
    _, first, place = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    # Particles in the order in which the file names them first.
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return corners[first[order]], rank[place.reshape(-1)].reshape(-1, 3)


FORMATS: dict[str, Callable[[bytes], Surface]] = {".obj": read_obj, ".ply": read_ply, ".stl": read_stl}
