"""The header of a PLY file: which elements follow, of which properties.

Source: G. Turk, The PLY Polygon File Format (1994).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import BinaryIO

from particlesim.layouts.malformed import Malformed

LONGEST = 1 << 16
"""Bytes. Headers have hundreds."""

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
"""NumPy's types by PLY's."""

FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class Property:
    """A number of an element, or a list of numbers if the type of their count is given."""

    name: str
    type: str
    count: str | None = None


@dataclass(frozen=True)
class Element:
    """Rows of properties."""

    name: str
    number: int
    properties: tuple[Property, ...]


@dataclass(frozen=True)
class Header:
    """The byte order of binary numbers, "" for text; the elements in their order; the bytes that the header takes."""

    order: str
    elements: tuple[Element, ...]
    size: int

    def plain(self, order: str | None = None) -> bytes:
        """The header again, with names for the surface only: others may mean colours or textures, which tear it."""
        order = self.order if order is None else order
        words = [f"ply\nformat {next(name for name, o in FORMATS.items() if o == order)} 1.0"]
        for k, element in enumerate(self.elements):
            name = element.name if element.name in ("vertex", "face") else f"element{k}"
            words.append(f"element {name} {element.number}")
            wanted = {"vertex": "xyz", "face": CORNERS}.get(element.name, ())
            for n, entry in enumerate(element.properties):
                kinds = entry.type if entry.count is None else f"list {entry.count} {entry.type}"
                words.append(f"property {kinds} {entry.name if entry.name in wanted else f'property{n}'}")
        return ("\n".join([*words, "end_header"]) + "\n").encode()


def read_header(file: BinaryIO) -> Header:
    """The header at the beginning of a file, which stands behind it then. Raises Malformed."""
    data = file.read(LONGEST)
    lines = data.splitlines(keepends=True)
    if not lines or lines[0].strip() != b"ply":
        raise Malformed("no PLY header")
    if b"end_header" not in data:
        raise Malformed(f"no PLY header: its end is missing within {LONGEST:,} bytes")
    order, elements, properties, size = None, list[Element](), list[Property](), len(lines[0])
    for number, line in enumerate(lines[1:], 2):
        size += len(line)
        words = line.decode("ascii", errors="replace").split()
        match words:
            case ["end_header"] if order is not None:
                file.seek(size)
                return Header(order, _checked(elements), size)
            case ["format", name, _] if name in FORMATS and order is None:
                order = FORMATS[name]
            case ["format", name, *_]:
                raise Malformed(f"line {number}: unknown PLY format {name!r}")
            case ["element", name, count] if count.isdecimal() and len(count) < 19:
                properties = []
                elements.append(Element(name, int(count), ()))
            case ["property", *kinds, name] if elements and _is_known(kinds):
                properties.append(Property(name, kinds[-1], kinds[1] if len(kinds) == 3 else None))
                elements[-1] = Element(elements[-1].name, elements[-1].number, tuple(properties))
            case ["property", *rest]:
                raise Malformed(f"line {number}: unknown property {' '.join(rest)!r}")
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                shown = line[:60].decode(errors="replace").strip()
                raise Malformed(f"line {number} does not belong into a PLY header: {shown!r}")
    raise Malformed("no PLY header: no line is end_header")


def _is_known(kinds: list[str]) -> bool:
    """Whether words are the type of a number, or of a list, whose count is an integer."""
    match kinds:
        case [kind]:
            return kind in TYPES
        case ["list", count, kind]:
            return kind in TYPES and TYPES.get(count, "f")[0] != "f"
    return False


def _checked(elements: list[Element]) -> tuple[Element, ...]:
    """Elements that hold a surface. Raises Malformed."""
    for element in elements:
        names = [entry.name for entry in element.properties]
        if len(set(names)) < len(names):
            raise Malformed(f"a property of {element.name!r} occurs twice")
        if element.number and not names:
            raise Malformed(f"the element {element.name!r} has no properties")
    for name, what in (("vertex", "vertices"), ("face", "faces")):
        if (found := sum(element.name == name for element in elements)) != 1:
            raise Malformed(f"it has {'no' if found == 0 else 'several elements of'} {what}")
    vertex, face = (next(e for e in elements if e.name == name) for name in ("vertex", "face"))
    if not {"x", "y", "z"} <= {p.name for p in vertex.properties if p.count is None}:
        raise Malformed("vertices without x, y and z")
    lists = [p for p in face.properties if p.name in CORNERS]
    if len(lists) != 1 or lists[0].count is None or TYPES[lists[0].type][0] == "f":
        raise Malformed("faces without vertex_indices", "they are a list of integers")
    if vertex.number == 0 or face.number == 0:
        raise Malformed("it has no triangles", "a face names three vertices or more")
    return tuple(elements)
