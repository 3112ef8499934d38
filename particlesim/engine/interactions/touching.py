"""Pairs of particles that touch, found among the candidates of neighbour lists.

The eight members of a group are tested against a candidate at once, as the lanes of vectors; pairs that touch are passed to
a *sink*, one by one, in the order of the lists, which depends on the state alone. Every pair comes twice, once for each of
the two.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import lanes, on_stack, outlined
from particlesim.engine.interactions.near_sums import candidate, lane, members_of
from particlesim.engine.interactions.neighbours.record import FAR, GROUP, IMAGE_SHIFT, NO_ROOM
from particlesim.engine.interactions.neighbours.search import BATCH, search, sieve
from particlesim.engine.interactions.pair_blocks import pair_of
from particlesim.engine.state.columns import type_of


class Normal(NamedTuple):
    """The unit vector n from the second to the first of a pair, and how deep they overlap [m]."""

    x: Any
    y: Any
    z: Any
    overlap: Any


def normal_of(p: Any, row: Any, other: Any) -> Any:
    """The normal of a pair that touches; along x where their centres coincide, away from the one with the larger row."""
    r = np.sqrt(p.x * p.x + p.y * p.y + p.z * p.z)
    one = type_of(r, 1)
    apart = r > 0
    by = one / (r if apart else one)
    side = -one if row < other else one
    return Normal(
        by * p.x if apart else side,
        by * p.y if apart else r - r,
        by * p.z if apart else r - r,
        p.r1 + p.r2 - r,
    )


class _Unlisted(NamedTuple):
    """Candidates that are in no list are looked at at once; `entries`: their room."""

    each: Any
    entries: Any
    sink: Any
    t: Any
    wide: Any

    def take(self, near: Any, g: Any, found: Any, number: Any, image: Any) -> None:
        """Look at the candidates in some groups."""
        count = sieve(near, g, found, number, image, self.entries, 0)
        _look(self.each, g, self.entries, 0, count, self.sink, self.t, self.wide)


def touching(each: Any, g: Any, sink: Any, t: Any, wide: Any = None) -> None:
    """Give a sink all pairs of a member of group g that touch: `take(sink, each, row, other, pair)`; those that would if
    their radii were `wide` times as large, unless that is None."""
    near = each.near
    if near.count[g] == NO_ROOM:
        entries = on_stack(1, GROUP * BATCH, np.uint32)[0]
        search(near, g, _Unlisted(each, entries, sink, t, wide))
    else:
        first = near.begin[g]
        _look(each, g, near.candidates, first, first + near.count[g], sink, t, wide)


@outlined
def _look(each: Any, g: Any, entries: Any, first: Any, last: Any, sink: Any, t: Any, wide: Any) -> None:
    near = each.near
    if near.box is None or first == last or entries[last - 1] >> IMAGE_SHIFT == 0:  # images come last
        _look_at(each, g, entries, first, last, sink, t, wide, False)
    else:
        _look_at(each, g, entries, first, last, sink, t, wide, True)


def _look_at(
    each: Any, g: Any, entries: Any, first: Any, last: Any, sink: Any, t: Any, wide: Any, shifted: Any
) -> None:
    near, block, depth = each.near, members_of(each, g), on_stack(1, GROUP, each.near.x.dtype)[0]
    rows, x, y, z, r = near.order[GROUP * g : GROUP * g + GROUP], block.x, block.y, block.z, block.r
    for j in range(first, last):
        place, other = candidate(each, entries[j], shifted)
        row = near.order[place]
        deepest = type_of(other.x, 0)
        for i in lanes(GROUP):
            dx, dy, dz, reach = x[i] - other.x, y[i] - other.y, z[i] - other.z, r[i] + other.r
            reach = reach if wide is None else type_of(reach, wide) * reach
            there = (rows[i] != row) & (x[i] < FAR) & (other.x < FAR)
            depth[i] = reach * reach - (dx * dx + dy * dy + dz * dz) if there else type_of(dx, 0)
        for i in lanes(GROUP):
            deepest = max(deepest, depth[i])
        if deepest > 0:
            for i in range(GROUP):
                if depth[i] > 0:
                    type(sink).take(sink, each, rows[i], row, i, pair_of(lane(block, i), other, t))


def line_between(c: Any, i: Any, j: Any, shift: Any, k: Any) -> Any:
    """From particle j to particle i of pair k: the unit vector, along x for coincident centres, and the distance."""
    x = c.x[i] - c.x[j] + shift[0, k]
    y = c.y[i] - c.y[j] + shift[1, k]
    z = c.z[i] - c.z[j] + shift[2, k]
    r = np.sqrt(x * x + y * y + z * z)
    one, apart = type_of(r, 1), r > 0
    by = one / (r if apart else one)
    return by * x if apart else -one, by * y, by * z, r


def overlap_at(c: Any, places: Any, i: Any, j: Any, shift: Any) -> Any:
    """How far two particles overlap at some places [m]; negative where they do not."""
    dx, dy, dz = (x[i] - x[j] + shift[axis] for axis, x in enumerate(places))
    return c.r[i] + c.r[j] - np.sqrt(dx * dx + dy * dy + dz * dz)
