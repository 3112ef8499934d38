"""The surface in a Wavefront OBJ file: its vertices and faces, and nothing else.

Readers take corners with different normals, textures or materials for different vertices, which tears a surface along its
seams; and they count negative numbers from the end of the file, not from the line. So both are resolved here.
Source: Wavefront, Object Files, appendix B1.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator

from particlesim.layouts.malformed import Malformed, numbers


def surface_of_obj(lines: Iterable[bytes]) -> bytes:
    """Lines `v x y z` and `f a b c ...` with numbers from 1, of lines in which a may also be negative, or `a/b/c`.

    Raises Malformed with the line of the first mistake.
    """
    out, vertices, highest = io.BytesIO(), 0, 0
    for number, line in _joined(lines):
        words = line.partition(b"#")[0].split()
        try:
            if words[:1] == [b"v"]:
                out.write(b"v %b\n" % b" ".join(numbers(words[1:4], 3)))
                vertices += 1
            elif words[:1] == [b"f"]:
                corners = [int(word.partition(b"/")[0]) for word in words[1:]]
                corners = [k if k > 0 else vertices + 1 + k for k in corners]
                if len(corners) < 3 or 0 in [int(word.partition(b"/")[0]) for word in words[1:]]:
                    raise ValueError
                if min(corners) < 1:
                    raise Malformed(
                        f"line {number}: a face names a vertex that does not exist; there are {vertices} above it"
                    )
                highest = max(highest, *corners)
                out.write(b"f %b\n" % b" ".join(b"%d" % k for k in corners))
        except ValueError:
            shown = line[:60].decode(errors="replace").strip()
            raise Malformed(f"line {number} is neither a vertex nor a face: {shown!r}") from None
    if highest == 0:
        raise Malformed("it has no triangles", "a face names three vertices or more")
    if highest > vertices:
        raise Malformed(f"a face names a vertex that does not exist; there are {vertices}")
    return out.getvalue()


def _joined(lines: Iterable[bytes]) -> Iterator[tuple[int, bytes]]:
    """Lines with the number of their beginning; one that ends with a backslash goes on in the next."""
    begun, first = list[bytes](), 0
    for number, line in enumerate(lines, 1):
        first = first if begun else number
        text = line.rstrip(b"\r\n")
        begun.append(text.removesuffix(b"\\"))
        if not text.endswith(b"\\"):
            yield first, b" ".join(begun)
            begun.clear()
    if begun:
        yield first, b" ".join(begun)
