"""Convex pieces that bodies are made of, as contact takes them, and what they enclose together.

Where pieces overlap, the mass there counts once: lines parallel to x are cut by every piece in one stretch, whose union is
exact, and a grid of lines is summed (midpoint rule across, exact along).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from particlesim.bodies.hull import Hull
from particlesim.bodies.mass import Solidity
from particlesim.model.arrays import Floats
from particlesim.model.vectors import Vector3

SPHERE, BOX, CAPSULE, CYLINDER, CONE, HULL = range(6)
"""Kinds of pieces, for kernels."""

TOUCHING = 1e-9
"""Overlap of two parts that counts as none, in units of the smaller one."""
LINES = 256
"""Lines along each side of the box about pieces that overlap."""


class Piece(NamedTuple):
    """A convex piece of a body: x = at + R y, with y in its own frame.

    `size` [m]: a sphere has its radius; a box half its edges; a capsule its
    radius and half its axis, along z, and the radius of the ring that it is part of, 0 for none: x is the axis of the ring
    then, and y away from it; a cylinder its radius and half its length, along z; a cone its radius and length, with its
    centre of mass in the origin and its tip towards z; a hull has none.
    """

    kind: int
    size: Vector3
    at: Floats
    rotation: Floats
    hull: Hull | None = None

    def placed(self, center: Floats, rotation: Floats) -> Piece:
        """In another frame: x = c + R y."""
        return self._replace(at=center + rotation @ self.at, rotation=rotation @ self.rotation)

    def seen_from(self, center: Floats, rotation: Floats) -> Piece:
        """In the frame with this centre and these axes."""
        return self._replace(at=rotation.T @ (self.at - center), rotation=rotation.T @ self.rotation)

    def ball(self) -> float:
        """Radius of a ball about its own origin [m]."""
        a, b, _ = self.size
        if self.kind == HULL:
            assert self.hull is not None
            return float(np.linalg.norm(self.hull.corners, axis=1).max())
        if self.kind == BOX:
            return float(np.linalg.norm(self.size))
        if self.kind == CYLINDER:
            return float(np.hypot(a, b))
        if self.kind == CONE:
            return float(max(np.hypot(a, b / 4), 3 * b / 4))
        return a + b  # a sphere has no axis

    def fineness(self) -> float:
        """Its smallest size [m]."""
        if self.kind == HULL:
            assert self.hull is not None
            return float(self.hull.planes[:, 3].min())
        return min(size for size in (self.size[:2] if self.kind == CAPSULE else self.size) if size > 0)

    def extent(self, direction: Floats) -> tuple[float, float]:
        """From where to where it reaches along a direction [m]."""
        d = self.rotation.T @ direction
        low, high = _support(self, -d), _support(self, d)
        middle = float(self.at @ direction)
        return middle - low, middle + high

    def stretch(self, points: Floats) -> tuple[Floats, Floats]:
        """Where lines along x through places [n, 3] are inside of it: x from there to there [n], nothing where the second is
        below the first."""
        start = (points - self.at) @ self.rotation
        u = self.rotation[0]
        low, high = _cut(self, start, u)
        return points[:, 0] + low, points[:, 0] + high


def _support(piece: Piece, d: Floats) -> float:
    """How far a piece reaches from its origin along a unit direction of its own frame."""
    a, b, _ = piece.size
    if piece.kind == HULL:
        assert piece.hull is not None
        return float((piece.hull.corners @ d).max())
    if piece.kind == BOX:
        return float(np.abs(d) @ np.array(piece.size))
    across = float(np.hypot(d[0], d[1]))
    if piece.kind == CYLINDER:
        return a * across + b * abs(float(d[2]))
    if piece.kind == CONE:
        return max(0.75 * b * float(d[2]), a * across - 0.25 * b * float(d[2]))
    return a + b * abs(float(d[2]))


def _cut(piece: Piece, start: Floats, u: Floats) -> tuple[Floats, Floats]:
    """Lines start + s u in the frame of a piece: s where they enter and leave it; inf and −inf where they miss it."""
    a, b, _ = piece.size
    if piece.kind == BOX:
        planes = [(sign * np.eye(3)[k], piece.size[k]) for k in range(3) for sign in (1.0, -1.0)]
        return _between(planes, start, u)
    if piece.kind == HULL:
        assert piece.hull is not None
        return _between([(plane[:3], float(plane[3])) for plane in piece.hull.planes], start, u)
    if piece.kind == SPHERE:
        return _quadric(np.eye(3), start, u, a * a)
    z = np.array([0.0, 0.0, 1.0])
    round_z = np.diag([1.0, 1.0, 0.0])
    if piece.kind == CYLINDER:
        return _meet(_quadric(round_z, start, u, a * a), _between([(z, b), (-z, b)], start, u))
    if piece.kind == CAPSULE:
        found = [_meet(_quadric(round_z, start, u, a * a), _between([(z, b), (-z, b)], start, u))]
        found += [_quadric(np.eye(3), start - end * b * z, u, a * a) for end in (-1.0, 1.0)]
        lows, highs = zip(*found, strict=True)
        return np.min(lows, axis=0), np.max(highs, axis=0)
    # A cone x² + y² ≤ (a/b)² (z − tip)² below its tip, of which a line may meet the other half as well: by bisection of the
    # convex function on the stretch between the ends that its cylinder and its height leave.
    low, high = _meet(_quadric(round_z, start, u, a * a), _between([(z, 0.75 * b), (-z, 0.25 * b)], start, u))
    return _cone(start, u, a, b, low, high)


def _cone(start: Floats, u: Floats, a: float, b: float, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """The part of stretches of lines that is inside of the slope of a cone: g(s) = ρ − (a/b)(tip − z) ≤ 0 is convex."""
    there = high > low
    low, high = np.where(there, low, 0.0), np.where(there, high, 0.0)

    def g(s: Floats) -> Floats:
        p = start + s[:, None] * u
        return np.hypot(p[:, 0], p[:, 1]) - a / b * (0.75 * b - p[:, 2])

    left, right = low.copy(), high.copy()
    for _ in range(60):  # the least value, by thirds
        one, two = left + (right - left) / 3, right - (right - left) / 3
        better = g(one) < g(two)
        right, left = np.where(better, two, right), np.where(better, left, one)
    best = 0.5 * (left + right)
    there &= g(best) < 0

    def root(outside: Floats) -> Floats:
        inside, done = best.copy(), g(outside) <= 0
        far = outside.copy()
        for _ in range(60):
            middle = 0.5 * (inside + far)
            within = g(middle) <= 0
            inside, far = np.where(within, middle, inside), np.where(within, far, middle)
        return np.where(done, outside, inside)

    return np.where(there, root(low), np.inf), np.where(there, root(high), -np.inf)


def _between(planes: list[tuple[Floats, float]], start: Floats, u: Floats) -> tuple[Floats, Floats]:
    """Where lines are below all planes n·x ≤ d."""
    low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    for n, d in planes:
        room, along = d - start @ n, float(n @ u)
        if along > 0:
            high = np.minimum(high, room / along)
        elif along < 0:
            low = np.maximum(low, room / along)
        else:
            high = np.where(room < 0, -np.inf, high)
    return low, high


def _quadric(form: Floats, start: Floats, u: Floats, bound: float) -> tuple[Floats, Floats]:
    """Where x·A x ≤ bound along lines."""
    a = float(u @ form @ u)
    half = start @ form @ u
    c = np.einsum("ij,jk,ik->i", start, form, start) - bound
    if a <= 1e-30:
        return np.where(c <= 0, -np.inf, np.inf), np.where(c <= 0, np.inf, -np.inf)
    inside = half * half - a * c
    root = np.sqrt(np.maximum(inside, 0.0))
    return np.where(inside > 0, (-half - root) / a, np.inf), np.where(inside > 0, (-half + root) / a, -np.inf)


def _meet(one: tuple[Floats, Floats], two: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    low, high = np.maximum(one[0], two[0]), np.minimum(one[1], two[1])
    return np.where(low < high, low, np.inf), np.where(low < high, high, -np.inf)


def union_of(pieces: list[Piece]) -> Solidity:
    """What pieces enclose together, where overlaps count once."""
    bounds = np.array([[piece.extent(np.eye(3)[axis]) for axis in range(3)] for piece in pieces])
    low, high = bounds[:, :, 0].min(axis=0), bounds[:, :, 1].max(axis=0)
    step = (high - low)[1:] / LINES
    across = low[2] + step[1] * (np.arange(LINES) + 0.5)
    total = np.zeros(10)
    for row in range(LINES):
        y = low[1] + step[0] * (row + 0.5)
        here = [piece for piece, (a, b) in zip(pieces, bounds[:, 1], strict=True) if a < y < b]
        if here:
            points = np.stack([np.zeros(LINES), np.full(LINES, y), across], axis=1)
            total += _row(here, points)
    total *= step.prod()
    volume, center = total[0], total[1:4] / total[0]
    xx, yy, zz, xy, xz, yz = total[4:]
    second = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Solidity(float(volume), center, second - volume * np.outer(center, center))


def _row(pieces: list[Piece], points: Floats) -> Floats:
    """Moments of what pieces hold together of lines along x through places [n, 3]: 1, x, y, z, xx, yy, zz, xy, xz, yz."""
    begin, end = np.moveaxis(np.array([piece.stretch(points) for piece in pieces]), 1, 0)
    order = np.argsort(begin, axis=0)
    begin, end = np.take_along_axis(begin, order, axis=0), np.take_along_axis(end, order, axis=0)
    total, reached = np.zeros(10), np.full(len(points), -np.inf)
    for a, b in zip(begin, end, strict=True):
        first = np.maximum(a, reached)
        there = b > first
        a, b = first[there], b[there]
        y, z = points[there, 1], points[there, 2]
        one, two, three = b - a, (b * b - a * a) / 2, (b**3 - a**3) / 3
        moments = (one, two, y * one, z * one, three, y * y * one, z * z * one, y * two, z * two, y * z * one)
        total += [float(each.sum()) for each in moments]
        reached[there] = b
    return total


def overlapping(parts: Sequence[Sequence[Piece]]) -> list[tuple[int, int]]:
    """Pairs of parts, each of some pieces, that overlap, or may do so."""
    return [
        (i, j)
        for i, j in combinations(range(len(parts)), 2)
        if any(not apart(one, two) for one in parts[i] for two in parts[j])
    ]


def apart(one: Piece, two: Piece) -> bool:
    """Whether two pieces are apart along a direction that is likely to separate them."""
    line = two.at - one.at
    if np.linalg.norm(line) > one.ball() + two.ball():
        return True
    directions = [*_normals(one), *_normals(two), line, *_between_axes(one, two)]
    slack = TOUCHING * min(one.ball(), two.ball())
    for direction in directions:
        size = float(np.linalg.norm(direction))
        if size > 0:
            (a, b), (c, d) = one.extent(direction / size), two.extent(direction / size)
            if c >= b - slack or a >= d - slack:
                return True
    return False


def _normals(piece: Piece) -> list[Floats]:
    """Normals of its flat sides."""
    if piece.kind == BOX:
        return list(piece.rotation.T)
    if piece.kind in (CYLINDER, CONE):
        return [piece.rotation[:, 2]]
    if piece.kind == HULL:
        assert piece.hull is not None
        return list(piece.hull.planes[:, :3] @ piece.rotation.T)
    return []


def _between_axes(one: Piece, two: Piece) -> list[Floats]:
    """From the nearest place of the axis of one to that of the other, and across both."""
    u, w = (
        piece.rotation[:, 2] * (piece.size[1] if piece.kind in (CAPSULE, CYLINDER) else 0.0)
        for piece in (one, two)
    )
    line = two.at - one.at
    s = t = 0.0
    for _ in range(20):
        s = float(np.clip((line + t * w) @ u / (u @ u), -1, 1)) if u @ u > 0 else 0.0
        t = float(np.clip((s * u - line) @ w / (w @ w), -1, 1)) if w @ w > 0 else 0.0
    return [line + t * w - s * u, np.cross(u, w)]
