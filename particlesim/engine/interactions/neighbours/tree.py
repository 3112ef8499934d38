"""The tree over groups: a box around every group, and one around every eight neighbours, level by level.

Groups follow each other on a curve, so eight in a row are close together, and the tree needs no pointers: the children of
node k are nodes 8 k … 8 k + 7 of the level below.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.neighbours.record import FAR, GROUP
from particlesim.engine.state.columns import type_of

SUBTREE = 3
"""Levels above the groups that a thread builds by itself, 8³ groups at a time."""


def _box_groups(near: Any, first: Any, last: Any) -> None:
    """Boxes around groups [first, last); those without living members are empty."""
    nowhere = type_of(near.base[0, 0], FAR)
    for g in range(first, last):
        x0 = y0 = z0 = np.inf
        x1 = y1 = z1 = -np.inf
        largest = 0.0
        for k in range(GROUP * g, GROUP * g + GROUP):
            x, y, z = near.base[0, k], near.base[1, k], near.base[2, k]
            there = x != nowhere
            x0, x1 = x if there & (x < x0) else x0, x if there & (x > x1) else x1
            y0, y1 = y if there & (y < y0) else y0, y if there & (y > y1) else y1
            z0, z1 = z if there & (z < z0) else z0, z if there & (z > z1) else z1
            if near.radii is not None:
                largest = max(largest, near.radii[k])
        _put(near, g, x0, y0, z0, x1, y1, z1, largest)


def _box_families(near: Any, level: Any, first: Any, last: Any) -> None:
    """Boxes around the children of nodes [first, last) of a level above the groups."""
    own, below = near.levels[level], near.levels[level - 1]
    for node in range(first, last):
        x0 = y0 = z0 = np.inf
        x1 = y1 = z1 = -np.inf
        largest = 0.0
        for k in range(below + 8 * node, below + 8 * node + 8):
            x0, x1 = min(x0, near.boxes[0, k]), max(x1, near.boxes[3, k])
            y0, y1 = min(y0, near.boxes[1, k]), max(y1, near.boxes[4, k])
            z0, z1 = min(z0, near.boxes[2, k]), max(z1, near.boxes[5, k])
            if near.radii is not None:
                largest = max(largest, near.spread[k])
        _put(near, own + node, x0, y0, z0, x1, y1, z1, largest)


def _put(near: Any, node: Any, x0: Any, y0: Any, z0: Any, x1: Any, y1: Any, z1: Any, largest: Any) -> None:
    for row, v in enumerate((x0, y0, z0, x1, y1, z1)):
        near.boxes[row, node] = v
    if near.radii is not None:
        near.spread[node] = largest


@outlined
def grow_tree(near: Any, share: Any) -> None:
    """Boxes around all groups and nodes. All threads must call it; the places of all members must be there."""
    groups, top = near.begin.size, near.levels.size - 1
    step = 8**SUBTREE
    for part in range(share.number, -(-groups // step), share.threads):
        first, last = part * step, min(groups, part * step + step)
        _box_groups(near, first, last)
        for level in range(1, min(SUBTREE + 1, top)):
            first, last = first // 8, -(-last // 8)
            _box_families(near, level, first, last)
    meet(share.gate, share.threads)
    if share.number == 0:
        width = -(-groups // step)
        for level in range(SUBTREE + 1, top):
            width = -(-width // 8)
            _box_families(near, level, 0, width)
    meet(share.gate, share.threads)
