"""Where an edge or a triangle comes nearest to a collider, between its corners.

A patch is as thick as the radii of its corners, linear between them, and g(v, w) is the gap of its point x(v, w), which is
that of a particle with the radius there. Patches are cut into smaller ones, in halves or quarters, and what cannot hold the
least gap is left out. With x₀ the middle of a part and x_k its corners, no gap in it is less than

    g₀ + min_k (n·(x_k − x₀) + r₀ − r_k)      beside a convex shape, n its normal at x₀,
    g₀ − max_k |x_k − x₀| + min_k (r₀ − r_k)  beside any.

The former is as good as exact on flat sides, and off by the square of the part's size elsewhere. With the latter parts are
cut until they are as small as `grain`, and the least gap may be missed by that.
Source: E. Hansen, G. W. Walster, Global Optimization Using Interval Analysis (2004), for branch and bound.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.moving import MovingRecord, ride
from particlesim.compiler import kernel, on_stack, outlined
from particlesim.engine.state.columns import type_of
from particlesim.laws.registry import Particle, bend, gap_and_normal, sure_gap

DEPTH = 9
"""How often a patch is cut at most."""
ROOM = 3 * DEPTH + 4
"""Parts that wait to be looked at, at most: three of each cut, and the first four."""
NEARLY = 1e-2
"""By which part of its thickness a least gap beside a convex shape may be missed."""
HALVINGS = 40
"""How often the place of a contact on an edge is halved."""
GRAIN = 0.7
"""By which part of its thickness it may be missed beside others."""


class Patch(NamedTuple):
    """Corners of a triangle [m] and their radii [m]; an edge has its second corner twice."""

    a: Any
    b: Any
    c: Any
    ra: Any
    rb: Any
    rc: Any


class Deepest(NamedTuple):
    """The weights of the second and third corner where the gap is least, this gap, and a number that no gap of the patch is
    below, but for `NEARLY` and `GRAIN` [m]."""

    v: Any
    w: Any
    gap: Any
    safe: Any


def is_convex(shape: Any) -> Any:
    """Whether the gap of a shape is a convex function of the place."""
    return bend(shape) > 0


def own_shape(shape: Any) -> Any:
    """A shape in its own frame."""
    return shape.shape if isinstance(shape, MovingRecord) else shape


def point_on(patch: Any, v: Any, w: Any) -> Any:
    """A point of a patch [m], and the radius there."""
    u = 1.0 - v - w
    x, y, z = (u * p + v * q + w * r for p, q, r in zip(patch.a, patch.b, patch.c, strict=True))
    return x, y, z, u * patch.ra + v * patch.rb + w * patch.rc


def at_point(point: Any, like: Any, t: Any) -> Any:
    """A particle that does not move, in the precision of `like`."""
    x, y, z, r = (type_of(like, number) for number in point)
    none = x - x
    return Particle(x, y, z, none, none, none, type_of(none, 1), r, none, t, type_of(none, 1))


def size_of(patch: Any, v: Any, w: Any) -> Any:
    """The distance of the farthest corner from a point of a patch [m]."""
    x, y, z, _ = point_on(patch, v, w)
    most = 0.0
    for p in (patch.a, patch.b, patch.c):
        d = (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y) + (p[2] - z) * (p[2] - z)
        most = max(most, d)
    return np.sqrt(most)


# In a stack of parts [7, ROOM], a column has the weights of three corners, of an edge those of both ends and its middle, and
# how often the part has been cut.


def lowest_in(shape: Any, patch: Any, stack: Any, k: Any, like: Any, t: Any) -> Any:
    """Of the part in column k of a stack: the middle, the gap there, a bound of all gaps in it, and its size [m]."""
    v, w = (stack[0, k] + stack[2, k] + stack[4, k]) / 3.0, (stack[1, k] + stack[3, k] + stack[5, k]) / 3.0
    middle = point_on(patch, v, w)
    g, n = 0.0, (0.0, 0.0, 0.0)
    if is_convex(shape):
        found, axes = gap_and_normal(shape, at_point(middle, like, t))
        g = float(found)
        n = tuple(0.0 if axis is None else float(axis) for axis in axes)  # type: ignore[assignment]  # three
    else:
        g = float(sure_gap(shape, at_point(middle, like, t)))
    low, thin, most = np.inf, np.inf, 0.0
    for corner in range(3):
        x = point_on(patch, stack[2 * corner, k], stack[2 * corner + 1, k])
        d = x[0] - middle[0], x[1] - middle[1], x[2] - middle[2]
        less = middle[3] - x[3]
        low = min(low, n[0] * d[0] + n[1] * d[1] + n[2] * d[2] + less)
        thin, most = min(thin, less), max(most, d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    most = np.sqrt(most)
    return v, w, g, g + (low if is_convex(shape) else thin - most), most


def cut(face: Any, stack: Any, number: Any) -> Any:
    """Put the parts of the part in column `number` there and behind it; returns how many the stack has then."""
    a, b, c = (stack[0, number], stack[1, number]), (stack[2, number], stack[3, number]), (0.0, 0.0)
    deeper = stack[6, number] + 1.0
    if face:
        c = stack[4, number], stack[5, number]
        ab, bc, ca = _half(a, b), _half(b, c), _half(c, a)
        _put(stack, number, a, ab, ca, deeper)
        _put(stack, number + 1, b, bc, ab, deeper)
        _put(stack, number + 2, c, ca, bc, deeper)
        _put(stack, number + 3, ab, bc, ca, deeper)
        return number + 4
    middle = _half(a, b)
    _put(stack, number, a, middle, _half(a, middle), deeper)
    _put(stack, number + 1, b, middle, _half(b, middle), deeper)
    return number + 2


def _half(a: Any, b: Any) -> Any:
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])


def _put(stack: Any, k: Any, a: Any, b: Any, c: Any, depth: Any) -> None:
    stack[0, k], stack[1, k], stack[2, k], stack[3, k] = a[0], a[1], b[0], b[1]
    stack[4, k], stack[5, k], stack[6, k] = c[0], c[1], depth


@outlined
def deepest(face: Any, shape: Any, patch: Any, inner: Any, beyond: Any, thick: Any, like: Any, t: Any) -> Any:
    """The least gap of a patch to a shape in its own frame. `inner`: how far from its middle the patch is looked at, 1 up to
    its corners; what is farther away than `beyond` [m] is not looked at more closely."""
    stack = on_stack(7, ROOM, np.float64)
    v, w = (1 / 3, 1 / 3) if face else (0.5, 0.0)
    a, b, c = (v - inner * v, w - inner * w), (v + inner * (1.0 - v), w - inner * w), (0.0, 0.0)
    if face:
        c = v - inner * v, w + inner * (1.0 - w)
        _put(stack, 0, a, b, c, 0.0)
    else:
        _put(stack, 0, a, b, (v, w), 0.0)
    best, safe, number = np.inf, np.inf, 1
    while number > 0:
        number -= 1
        x, y, g, low, size = lowest_in(shape, patch, stack, number, like, t)
        if g < best:
            best, v, w = g, x, y
        if low >= beyond:
            safe = min(safe, low)
        elif (
            (low < best - NEARLY * thick)
            & (stack[6, number] < DEPTH)
            & (is_convex(shape) | (size > GRAIN * thick))
        ):
            number = cut(face, stack, number)
    return Deepest(v, w, best, min(safe, best))


def lowest_on_edge(shape: Any, patch: Any, inner: Any, slack: Any, like: Any, t: Any) -> Any:
    """The weight of the second end where the gap of an edge to a convex shape is least: there its slope changes sign; and
    those between which it is greater by no more than `slack` [m]."""
    low, high = 0.5 * (1.0 - inner), 0.5 * (1.0 + inner)
    first, last = low, high
    for _ in range(HALVINGS):
        v = 0.5 * (low + high)
        _, axes = gap_and_normal(shape, at_point(point_on(patch, v, 0.0), like, t))
        slope = patch.ra - patch.rb
        for axis, a, b in zip(axes, patch.a, patch.b, strict=True):
            slope += 0.0 if axis is None else float(axis) * (b - a)
        low, high = (v, high) if slope < 0 else (low, v)
    v = 0.5 * (low + high)
    level = float(sure_gap(shape, at_point(point_on(patch, v, 0.0), like, t))) + slack
    return v, _up_to(shape, patch, v, first, level, like, t), _up_to(shape, patch, v, last, level, like, t)


@outlined
def _up_to(shape: Any, patch: Any, v: Any, end: Any, level: Any, like: Any, t: Any) -> Any:
    """Up to which weight from v towards an end the gap of an edge is no greater than a level."""
    if float(sure_gap(shape, at_point(point_on(patch, end, 0.0), like, t))) <= level:
        return end
    for _ in range(HALVINGS):
        middle = 0.5 * (v + end)
        below = float(sure_gap(shape, at_point(point_on(patch, middle, 0.0), like, t))) <= level
        v, end = (middle, end) if below else (v, middle)
    return v


@kernel
def deepest_of(face: Any, shape: Any, x: Any, r: Any, corners: Any, t: Any, out: Any) -> None:
    """`out` [n]: the least gaps between the corners of triangles, if `face`, or edges to a shape at time t [m], infinite
    where they do not touch it. `x` [3, count] and `r` [count]: particles; `corners` [3, n]: their rows."""
    own = own_shape(shape)
    for k in range(out.size):
        i, j, m = corners[0, k], corners[1, k], corners[2, k]
        like = x[0, i]
        a, b, c = _local(shape, x, i, t), _local(shape, x, j, t), _local(shape, x, m, t)
        patch = Patch(a, b, c, r[i], r[j], r[m])
        v, w = (1 / 3, 1 / 3) if face else (0.5, 0.0)
        out[k] = np.inf
        if float(sure_gap(own, at_point(point_on(patch, v, w), like, t))) < size_of(patch, v, w):
            out[k] = deepest(face, own, patch, 1.0, 0.0, max(patch.ra, patch.rb, patch.rc), like, t).gap


def _local(shape: Any, x: Any, i: Any, t: Any) -> Any:
    """Where particle i is in the frame of a shape."""
    none = x[0, i] - x[0, i]
    p = at_point((x[0, i], x[1, i], x[2, i], none), none, t)
    q = ride(shape, p) if isinstance(shape, MovingRecord) else p
    return q.x, q.y, q.z
