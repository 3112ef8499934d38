"""The first 48 bytes of an HDF5 file (superblock version 3): who has it open, and how long it is.

A process that is killed while it writes leaves its mark "open for writing" in the file, and HDF5 then refuses
every ordinary opening. These functions read the mark and remove it.

Source: HDF5 File Format Specification 3.0, section II.A "Disk Format: Level 0A"; the checksum is Bob Jenkins'
lookup3 `hashlittle` (http://burtleburtle.net/bob/c/lookup3.c), which the specification names for metadata.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from particlesim.trajectory.places import open_regular

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_LENGTH = 48
_FLAGS = 11
_SHARED = 4  # in the flags
_END_OF_FILE = slice(28, 36)
_CHECKSUM = slice(44, 48)
_MASK = 0xFFFFFFFF


@dataclass(frozen=True)
class Superblock:
    """`marked`: a writer has, or had, the file open; `shared`: such that others may read it (SWMR). `end`: its length
    [bytes] as the file tells it."""

    version: int
    marked: bool
    end: int
    shared: bool = False


def read_superblock(path: Path) -> Superblock | None:
    """The superblock of `path`, or None when the file is no HDF5 or its header is damaged.

    Files with a superblock older than version 3 carry no mark; for them `end` is 0 (not looked up).
    """
    with open_regular(path) as file:
        head = file.read(_LENGTH)
    if head[:8] != SIGNATURE or len(head) < _LENGTH:
        return None
    if head[8] < 3:
        return Superblock(version=head[8], marked=False, end=0)
    if not _intact(head):
        return None
    end: int = struct.unpack("<Q", head[_END_OF_FILE])[0]
    return Superblock(head[8], bool(head[_FLAGS]), end, bool(head[_FLAGS] & _SHARED))


def clear_mark(path: Path) -> None:
    """Remove the writer's mark from a file that no process writes, and set its length to the real one.

    The length matters: a killed writer may have left a smaller one, and the next process that opens the file for writing
    would overwrite the last frames.
    """
    with path.open("r+b") as file:
        head = unmarked(file)
        file.seek(0)
        file.write(head)


def unmarked(file: BinaryIO) -> bytes:
    """The superblock of an open file without a mark, and with the file's real length."""
    file.seek(0)
    head = bytearray(file.read(_LENGTH))
    if len(head) < _LENGTH or head[:8] != SIGNATURE or not _intact(bytes(head)):
        raise ValueError("no HDF5 superblock of version 3")
    head[_FLAGS] = 0
    head[_END_OF_FILE] = struct.pack("<Q", file.seek(0, 2))
    head[_CHECKSUM] = struct.pack("<I", lookup3(bytes(head[: _CHECKSUM.start])))
    return bytes(head)


def _intact(head: bytes) -> bool:
    """Version 3 with 8-byte addresses, and a checksum that agrees."""
    stored: int = struct.unpack("<I", head[_CHECKSUM])[0]
    return head[8] == 3 and head[9] == 8 and lookup3(head[: _CHECKSUM.start]) == stored


def lookup3(key: bytes) -> int:
    """Jenkins' 32-bit hash `hashlittle` of `key` with initial value 0."""
    a = b = c = (0xDEADBEEF + len(key)) & _MASK
    start = 0
    while len(key) - start > 12:
        x, y, z = struct.unpack_from("<III", key, start)
        a, b, c = _mix((a + x) & _MASK, (b + y) & _MASK, (c + z) & _MASK)
        start += 12
    if start == len(key):
        return c
    x, y, z = struct.unpack("<III", key[start:].ljust(12, b"\0"))
    return _final((a + x) & _MASK, (b + y) & _MASK, (c + z) & _MASK)


def _rotate(x: int, n: int) -> int:
    return ((x << n) | (x >> (32 - n))) & _MASK


def _mix(a: int, b: int, c: int) -> tuple[int, int, int]:
    # a, b, c change places after every round, so one line serves the six rounds of the original.
    for n in (4, 6, 8, 16, 19, 4):
        a = ((a - c) & _MASK) ^ _rotate(c, n)
        c = (c + b) & _MASK
        a, b, c = b, c, a
    return a, b, c


def _final(a: int, b: int, c: int) -> int:
    for n in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - _rotate(b, n)) & _MASK
        a, b, c = b, c, a
    # Seven rounds leave the last one's result, c of the original, in b.
    return b
