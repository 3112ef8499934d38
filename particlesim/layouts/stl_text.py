"""The triangles in an STL file. Source: 3D Systems, StereoLithography Interface Specification (1989)."""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import BinaryIO

from particlesim.layouts.malformed import Malformed, numbers

HEADER, TRIANGLE = 84, 50
"""Bytes of a binary file: 80 that are free and the number of triangles, then so many for each."""


def is_binary(file: BinaryIO, size: int) -> bool:
    """Whether a file is as long as the number of triangles says that it would hold as a binary one.

    Raises Malformed when it is no text either.
    """
    start = file.read(HEADER)
    file.seek(0)
    if len(start) == HEADER and size == HEADER + TRIANGLE * int.from_bytes(start[80:], "little"):
        return True
    if not start.lstrip()[:5].lower() == b"solid":
        raise Malformed("no STL: neither text, nor as long as its number of triangles says")
    return False


def triangles_of_text(lines: Iterable[bytes]) -> bytes:
    """One solid, with the corners of all of them: their names, which may be any text, are left out.

    Raises Malformed with the line of the first mistake.
    """
    out, corners, ended = io.BytesIO(), 0, False
    out.write(b"solid\n")
    for number, line in enumerate(lines, 1):
        words = line.split()
        keyword = words[0].lower() if words else b""
        if keyword == b"vertex":
            try:
                out.write(b"vertex %b\n" % b" ".join(numbers(words[1:], 3)))
            except ValueError:
                shown = line[:60].decode(errors="replace").strip()
                raise Malformed(f"line {number}: a vertex has three coordinates: {shown!r}") from None
            corners += 1
        elif keyword == b"endfacet" and corners % 3:
            raise Malformed(f"line {number}: its vertices are no triangles")
        ended = keyword == b"endsolid" or (ended and not words)
    if not ended:
        raise Malformed("it ends too early, without endsolid")
    if corners % 3:
        raise Malformed("its vertices are no triangles")
    out.write(b"endsolid\n")
    return out.getvalue()
