"""The Hilbert curve: a number for every cell of a cube, such that cells with neighbouring numbers are neighbours.

Cells are halved along all axes, level by level. On every level the curve passes the eight octants in an order that depends
on where it enters and leaves the cube; these ways to pass are the states of a table.

Source: C. Hamilton, "Compact Hilbert indices", Dalhousie University CS-2006-07, 2006 (Gray codes, entry points and
directions).
"""

from __future__ import annotations

from typing import Any

import numpy as np

LEVELS = 21
"""Halvings of the cube at most: three bits each fit into an int64."""


def _rotated(bits: int, by: int) -> int:
    """Three bits rotated to the left."""
    by %= 3
    return (bits << by | bits >> (3 - by)) & 7


def _gray(number: int) -> int:
    return number ^ (number >> 1)


def _trailing_ones(number: int) -> int:
    count = 0
    while number >> count & 1:
        count += 1
    return count


def _way() -> np.ndarray[Any, Any]:
    """For state (entry, direction) and octant, as a flat table: 8 · the next state + the octant's number on the curve."""
    from_gray = {_gray(number): number for number in range(8)}
    table = np.zeros(3 * 8 * 8, np.int16)
    for entry in range(8):
        for direction in range(3):
            state = 3 * entry + direction
            for octant in range(8):
                number = from_gray[_rotated(octant ^ entry, 3 - (direction + 1) % 3)]
                enters = 0 if number == 0 else _gray(2 * ((number - 1) // 2))
                turns = 0 if number == 0 else _trailing_ones(number if number % 2 else number - 1) % 3
                next_entry = entry ^ _rotated(enters, direction + 1)
                next_state = 3 * next_entry + (direction + turns + 1) % 3
                table[8 * state + octant] = 8 * next_state + number
    return table


WAY = _way()


def curve_key(x: Any, y: Any, z: Any, levels: Any) -> Any:
    """The number of cell (x, y, z), integers of `levels` bits, on the curve."""
    key, state = 0, 0
    for level in range(levels - 1, -1, -1):
        octant = (x >> level & 1) << 2 | (y >> level & 1) << 1 | (z >> level & 1)
        step = WAY[8 * state + octant]
        key = key << 3 | (step & 7)
        state = step >> 3
    return key
