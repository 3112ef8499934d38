"""Where a way first meets what is left of a convex solid, or of what several have in common, when other convex solids are
cut off: however thin that is, down to rounding.

It is met where the way is in all parts: in the solids, and outside of what is cut off. So the search goes on to where that
may be so of the part that it may be of last, again and again. Into a convex solid these are the safe steps of `way`. A
straight way leaves what is cut off once, and the depth in it is a concave function of the place: there is one root between
a place inside and one outside, and Newton's method comes to it from outside without passing it. A parabola may come out and
go in again, by less than a quarter of its bend: of that some places are looked at, and where Newton's method leads back
inside, the rest is halved.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from particlesim.colliders.way import INTO, MOST_LOOKS, first_root, longest, place_on, way_of
from particlesim.compiler import outlined
from particlesim.laws.registry import Particle, bend, gap, normal

NEVER = 2.0
"""The part of a way at which it comes into nothing."""
LEAST = 2.0**-52
"""The part of a way that a search goes on by at least."""
NEARER, CLOSE = 64, 8
"""Turns of the search for a root, at most, and how deep it is enough to know it, in units of rounding."""
SHORTER = 20
"""How often the way further on is made a quarter."""
PLACES = 16
"""Places at which a way is looked at that may come out of a solid and go in again."""


def is_cut(c: Any) -> bool:
    """Whether all parts of an intersection are convex solids and the outsides of such."""
    return all(bend(part) != 0 for part in c.parts)


@outlined
def cut_contact(c: Any, p: Particle, q: Particle, h: float, slack: float) -> float:
    """`first_contact` of the intersection of convex solids and outsides of such: a place a `grain` further on, if that is in
    it, too, else in a thin part as far as it is known to be. Where one has just rebounded from one side in an edge, another
    side is less deep than rounding tells."""
    w, one = way_of(p, q, h), type(p.x)(1)
    s, found = one - one, one
    for _ in range(MOST_LOOKS * len(c.parts)):
        ahead = max(*[_comes_into(part, p, w, s, slack) for part in c.parts])
        if not ahead > s:
            found = _further(c, p, w, s, slack)
            break
        s = max(ahead, s + type(p.x)(LEAST))
        if not s < 1:
            break
    return max(found, type(p.x)(2.0**-40))


def _further(c: Any, p: Particle, w: Any, s: Any, slack: Any) -> Any:
    """A part of a way after s at which the place is in the intersection, as it is at s, and under the same side."""
    speed, k = longest(w), 0
    more = type(p.x)(c.grain) / speed if speed > 0 else s - s
    n = normal(c, place_on(w, p, s))
    while (k < SHORTER) & (not ((s + more < 1) and _is_under(c, n, place_on(w, p, s + more), slack))):
        more = type(p.x)(0.25) * more
        k += 1
    return s + more


def _is_under(c: Any, n: Any, p: Any, slack: Any) -> Any:
    """Whether a place is in an intersection, under the side with the normal n."""
    m = normal(c, p)
    return gap(c, p) < -slack and n[0] * m[0] + n[1] * m[1] + n[2] * m[2] > type(p.x)(0.5)


def _comes_into(part: Any, p: Particle, w: Any, s: Any, slack: Any) -> Any:
    """From which part of a way on the place may be in a part of the intersection, from s on; s where it is in it."""
    return _comes_in(part, p, w, s, slack) if bend(part) > 0 else _comes_out(part, p, w, s, slack)


def _comes_in(part: Any, p: Particle, w: Any, s: Any, slack: Any) -> Any:
    """`_comes_into` of a convex solid."""
    here = place_on(w, p, s)
    g, n = gap(part, here), normal(part, here)
    b = n[0] * (w.ux + 2 * s * w.cx) + n[1] * (w.uy + 2 * s * w.cy) + n[2] * (w.uz + 2 * s * w.cz)
    a = n[0] * w.cx + n[1] * w.cy + n[2] * w.cz
    return s if g < -slack else s + first_root(a, b, max(g, -slack) + type(g)(INTO) * slack)


@outlined
def _comes_out(part: Any, p: Particle, w: Any, s: Any, slack: Any) -> Any:
    """`_comes_into` of the outside of a convex solid."""
    one, deep = type(p.x)(1), gap(part, place_on(w, p, s))
    if deep < -slack:
        return s
    end, ends = one, gap(part, place_on(w, p, one))
    if not ends < -slack:
        rest, zero = one - s, one - one
        bulge = rest * rest * np.sqrt(w.cx * w.cx + w.cy * w.cy + w.cz * w.cz)
        a, b = max(deep, zero), max(ends, zero)
        if a + b + 2 * np.sqrt(a * b) >= bulge:
            return type(p.x)(NEVER)
        k = 1
        while (k < PLACES) & (not ends < -slack):
            end = s + rest * type(p.x)(k) / type(p.x)(PLACES)
            ends = gap(part, place_on(w, p, end))
            k += 1
        if not ends < -slack:
            return type(p.x)(NEVER)
    return _root_between(part, p, w, s, end, ends, slack)


@outlined
def _root_between(part: Any, p: Particle, w: Any, low: Any, high: Any, deep: Any, slack: Any) -> Any:
    """The part of a way, between two, at which a gap becomes less than rounding; it is as `deep` at the later one."""
    k, half, most = 0, type(p.x)(0.5), -CLOSE * slack
    while (k < NEARER) & (deep < most) & (high - low > LEAST):
        n = normal(part, place_on(w, p, high))
        slope = (
            n[0] * (w.ux + 2 * high * w.cx)
            + n[1] * (w.uy + 2 * high * w.cy)
            + n[2] * (w.uz + 2 * high * w.cz)
        )
        middle = high - (deep - half * most) / slope if slope < 0 else low
        if not ((middle > low) & (middle < high)):
            middle = half * (low + high)
        g = gap(part, place_on(w, p, middle))
        if g < -slack:
            high, deep = middle, g
        else:
            low = middle
        k += 1
    return high
