"""Shapes that are put together, as kernels take them: the union of several, and what several have in common.

The gap of a union is the smallest of those of its parts, that of an intersection the largest. The normal is that of the part
that decides.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.cuts import cut_contact, is_cut
from particlesim.colliders.dents import dented
from particlesim.colliders.solid import PARTS
from particlesim.colliders.way import convex_apart, convex_contact, lipschitz_apart, marched_contact
from particlesim.laws.registry import (
    Particle,
    Vector,
    apart,
    bend,
    first_contact,
    gap,
    gap_and_normal,
    law,
    least_gap,
    normal,
    side_from,
    sure_gap,
    thinnest,
)

MOST_PIECES = 80
"""Pieces that are looked at in turn at most."""
TOUCHES, TOUCHES_COARSELY = 2.0**-44, 2.0**-15
"""How near to a part is on it, in parts of coordinates; the second in single precision."""


class UnionRecord(NamedTuple):
    """Shapes, and the shortest step of a search [m]."""

    parts: tuple[Any, ...]
    grain: float


class IntersectionRecord(NamedTuple):
    """Shapes, and the shortest step of a search [m]."""

    parts: tuple[Any, ...]
    grain: float


def spread(shape: Any) -> Any:
    """What is put together as a union of intersections of pieces, if these are all convex, or the outsides of convex ones,
    and not too many: those are met exactly (`cuts`). The gap is the same."""
    found = _spread(shape)
    if not 1 < sum(map(len, found)) <= MOST_PIECES:
        return shape
    each = tuple(
        pieces[0] if len(pieces) == 1 else IntersectionRecord(pieces, shape.grain) for pieces in found
    )
    return each[0] if len(each) == 1 else UnionRecord(each, shape.grain)


def _spread(shape: Any) -> list[tuple[Any, ...]]:
    """The pieces of a shape: of each of the intersections whose union it is."""
    if isinstance(shape, UnionRecord):
        return [pieces for part in shape.parts for pieces in _spread(part)]
    if not isinstance(shape, IntersectionRecord):
        return [(shape,)]
    choices = [_spread(part) for part in shape.parts]
    every = [piece for found in choices for pieces in found for piece in pieces]
    if (
        all(bend(piece) != 0 for piece in every)
        and math.prod(map(len, choices)) * len(choices) <= MOST_PIECES
    ):
        return [sum(pieces, ()) for pieces in itertools.product(*choices)]
    joint = [
        found[0] if len(found) == 1 else (part,) for part, found in zip(shape.parts, choices, strict=True)
    ]
    return [sum(joint, ())]


def extreme(parts: Any, p: Any, sign: Any) -> Any:
    """Gap and normal of the part whose gap times `sign` is the smallest; the first of equals."""
    g, n = gap_and_normal(parts[0], p)
    if len(parts) == 1:
        return g, n
    f, m = extreme(parts[1:], p, sign)
    first = sign * g <= sign * f
    return (g if first else f), tuple(a if first else b for a, b in zip(n, m, strict=True))


@law(gap, UnionRecord)
def union_gap(c: UnionRecord, p: Particle) -> float:
    return min(*[gap(part, p) for part in c.parts])


@law(bend, IntersectionRecord)
def intersection_bend(c: IntersectionRecord) -> int:
    return 1 if all(bend(part) > 0 for part in c.parts) else 0


@law(gap, IntersectionRecord)
def intersection_gap(c: IntersectionRecord, p: Particle) -> float:
    return max(*[gap(part, p) for part in c.parts])


@law(gap_and_normal, UnionRecord)
def union_gap_and_normal(c: UnionRecord, p: Particle) -> tuple[float, Vector]:
    return extreme(c.parts, p, 1)


@law(gap_and_normal, IntersectionRecord)
def intersection_gap_and_normal(c: IntersectionRecord, p: Particle) -> tuple[float, Vector]:
    return extreme(c.parts, p, -1)


def side_in_common(parts: Any, p: Any, q: Any, least: Any) -> Any:
    """`side_from` of an intersection: of the parts that p touches, those with a gap of `least`, the one that is the farthest
    from q."""
    g, n = side_from(parts[0], p, q)
    g = g if gap(parts[0], p) >= least else -type(g)(np.inf)
    if len(parts) == 1:
        return g, n
    f, m = side_in_common(parts[1:], p, q, least)
    first = g >= f
    return (g if first else f), tuple(a if first else b for a, b in zip(n, m, strict=True))


def nearest_side(parts: Any, p: Any, q: Any) -> Any:
    """`side_from` of a union: that of the part that is the nearest to q."""
    g, n = side_from(parts[0], p, q)
    if len(parts) == 1:
        return g, n
    f, m = nearest_side(parts[1:], p, q)
    first = g <= f
    return (g if first else f), tuple(a if first else b for a, b in zip(n, m, strict=True))


@law(side_from, UnionRecord)
def union_side_from(c: UnionRecord, p: Particle, q: Particle) -> tuple[float, Vector]:
    return nearest_side(c.parts, p, q)


@law(side_from, IntersectionRecord)
def intersection_side_from(c: IntersectionRecord, p: Particle, q: Particle) -> tuple[float, Vector]:
    noise = type(p.x)(TOUCHES_COARSELY if isinstance(p.x, np.float32) else TOUCHES)
    noise = noise * (abs(p.x) + abs(p.y) + abs(p.z) + p.r)
    return side_in_common(c.parts, p, q, gap(c, p) - noise)


@law(normal, UnionRecord)
def union_normal(c: UnionRecord, p: Particle) -> Vector:
    return extreme(c.parts, p, 1)[1]


@law(normal, IntersectionRecord)
def intersection_normal(c: IntersectionRecord, p: Particle) -> Vector:
    return extreme(c.parts, p, -1)[1]


@law(least_gap, UnionRecord)
def union_least_gap(c: UnionRecord, p: Particle, need: float) -> float:
    return min(*[least_gap(part, p, need) for part in c.parts])


@law(sure_gap, UnionRecord)
def union_sure_gap(c: UnionRecord, p: Particle) -> float:
    return min(*[sure_gap(part, p) for part in c.parts])


@law(sure_gap, IntersectionRecord)
def intersection_sure_gap(c: IntersectionRecord, p: Particle) -> float:
    return max(*[sure_gap(part, p) for part in c.parts])


@law(thinnest, UnionRecord)
def union_thinnest(c: UnionRecord) -> float:
    thin = c.grain * PARTS
    for part in c.parts:
        if dented(part):
            thin = min(thin, thinnest(part))
    return thin


@law(thinnest, IntersectionRecord)
def intersection_thinnest(c: IntersectionRecord) -> float:
    return c.grain * PARTS if bend(c) > 0 else 0.0  # what is left of a solid is as thin as it may be


@law(apart, UnionRecord)
def union_apart(c: UnionRecord, p: Particle, q: Particle, h: float, slack: float) -> bool:
    return all(tuple(apart(part, p, q, h, slack) for part in c.parts))


@law(first_contact, UnionRecord)
def union_first_contact(c: UnionRecord, p: Particle, q: Particle, h: float, slack: float) -> float:
    return min(*[first_contact(part, p, q, h, slack) for part in c.parts])


@law(apart, IntersectionRecord)
def intersection_apart(c: IntersectionRecord, p: Particle, q: Particle, h: float, slack: float) -> bool:
    # what misses one part misses the intersection
    one = any(tuple(apart(part, p, q, h, slack) for part in c.parts))
    return one | (convex_apart if bend(c) > 0 else lipschitz_apart)(c, p, q, h, slack)


@law(first_contact, IntersectionRecord)
def intersection_first_contact(
    c: IntersectionRecord, p: Particle, q: Particle, h: float, slack: float
) -> float:
    if bend(c) > 0:  # what convex solids have in common is convex, however thin it is
        return convex_contact(c, p, q, h, slack)
    if is_cut(c):
        return cut_contact(c, p, q, h, slack)
    return marched_contact(c, p, q, h, slack, c.grain)
