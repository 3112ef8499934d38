"""What follows the header of a PLY file: rows of numbers and lists, as text or binary, held against the header.

Source: G. Turk, The PLY Polygon File Format (1994).
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from particlesim.layouts.malformed import Malformed
from particlesim.layouts.ply_header import TYPES, Element, Header, read_header

LARGEST_ROW = 1 << 30
"""Bytes. NumPy has no larger types."""


def surface_of_ply(file: BinaryIO, size: int) -> bytes:
    """A file with plain names, whose rows are as its header says; a binary one whose lists differ in length becomes text.

    Raises Malformed.
    """
    header = read_header(file)
    for element in header.elements:
        least = _least_bytes(element, header.order)
        if element.number * least > size - header.size:
            raise Malformed(f"{element.number:,} of {element.name!r} do not fit into the file")
    body = file.read(size - header.size)
    if header.order == "":
        return header.plain() + _lines(header, body)
    used = _even_length(header, body)
    if used is None:
        return header.plain("") + _as_text(header, body)
    return header.plain() + body[:used]


def _least_bytes(element: Element, order: str) -> int:
    """Bytes of a row whose lists are empty; a number and a space as text."""
    return sum(np.dtype(TYPES[p.count or p.type]).itemsize if order else 2 for p in element.properties)


def _lines(header: Header, body: bytes) -> bytes:
    """A line per row. Raises Malformed when one has too few or too many words."""
    lines = (line for line in body.splitlines() if line.strip())
    out = io.BytesIO()
    for element in header.elements:
        lists = [p.count is not None for p in element.properties]
        for row in range(element.number):
            line = next(lines, None)
            if line is None:
                raise Malformed(f"it ends too early, at number {row} of {element.name!r}")
            words = line.split()
            try:
                wanted = 0
                for is_list in lists:
                    wanted += (_count(words[wanted]) if is_list else 0) + 1
                if wanted != len(words):
                    raise ValueError
            except (ValueError, IndexError):
                shown = line[:60].decode(errors="replace")
                raise Malformed(
                    f"number {row} of {element.name!r} is not as the header says: {shown!r}"
                ) from None
            out.write(line + b"\n")
    return out.getvalue()


def _count(word: bytes) -> int:
    """The length of a list, whose words follow. Raises ValueError."""
    if not word.isdigit() or len(word) > 9:
        raise ValueError
    return int(word)


def _even_length(header: Header, body: bytes) -> int | None:
    """Bytes that all elements take if the lists of a property are all as long as its first; None if they are not."""
    at = 0
    for element in header.elements:
        fields: list[tuple[str, str, tuple[int, ...]]] = []
        counts: list[tuple[str, int]] = []
        for k, entry in enumerate(element.properties):
            if entry.count is None:
                fields.append((f"p{k}", header.order + TYPES[entry.type], ()))
                continue
            start = at + np.dtype(fields).itemsize
            kind = np.dtype(header.order + TYPES[entry.count])
            if element.number == 0 or start + kind.itemsize > len(body):
                return None
            length = int(np.frombuffer(body, kind, 1, start)[0])
            least = start + length * np.dtype(TYPES[entry.type]).itemsize
            if length < 0 or least > min(len(body), LARGEST_ROW):
                return None
            counts.append((f"n{k}", length))
            fields += [(f"n{k}", kind.str, ()), (f"p{k}", header.order + TYPES[entry.type], (length,))]
        dtype = np.dtype(fields)
        if at + element.number * dtype.itemsize > len(body):
            return None
        if counts:
            rows = np.frombuffer(body, dtype, element.number, at)
            if any((rows[name] != length).any() for name, length in counts):
                return None
        at += element.number * dtype.itemsize
    return at


def _as_text(header: Header, body: bytes) -> bytes:
    """The numbers of a binary file as text, a line per row: lists of different lengths are read from text alone."""
    out, at = io.BytesIO(), 0

    def take(kind: str, count: int) -> list[float]:
        nonlocal at
        dtype = np.dtype(header.order + TYPES[kind])
        if count < 0 or at + count * dtype.itemsize > len(body):
            raise Malformed("it ends too early, or a list is longer than the file")
        found: list[float] = np.frombuffer(body, dtype, count, at).tolist()
        at += count * dtype.itemsize
        return found

    def words(element: Element) -> Iterator[float]:
        for entry in element.properties:
            length = 1
            if entry.count is not None:
                (length,) = (int(number) for number in take(entry.count, 1))
                yield length
            yield from take(entry.type, length)

    for element in header.elements:
        for _ in range(element.number):
            out.write(" ".join(map(repr, words(element))).encode() + b"\n")
    return out.getvalue()
