"""Keys along Morton's curve (Morton 1966): the interleaved bits of three integers.

The curve goes through a cube octant by octant, at every level, so that sorted by their keys the particles of every cell are
contiguous.
"""

from __future__ import annotations

from typing import Any

LEVELS = 21
"""Halvings of the cube: three numbers of 21 bits fill a key."""


def spread(v: Any) -> Any:
    """The 21 bits of v, each followed by two zeros."""
    v1 = (v | v << 32) & 0x1F00000000FFFF
    v2 = (v1 | v1 << 16) & 0x1F0000FF0000FF
    v3 = (v2 | v2 << 8) & 0x100F00F00F00F00F
    v4 = (v3 | v3 << 4) & 0x10C30C30C30C30C3
    return (v4 | v4 << 2) & 0x1249249249249249


def whole(x: Any) -> Any:
    """A coordinate in [0, 1] as 21 bits; what is outside, or no number, is put inside."""
    scaled = x * 2097152.0
    inside = scaled if scaled > 0 else 0.0
    return int(inside if inside < 2097151.0 else 2097151.0)


def key(x: Any, y: Any, z: Any) -> Any:
    """The key of a place in the unit cube."""
    return spread(whole(x)) << 2 | spread(whole(y)) << 1 | spread(whole(z))
