"""Surfaces and strands that cross or are too close at the start, where a contact should keep them apart.

Surfaces that cross at the start remain crossed: contacts keep everything on the side on which it began.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.diagnosis.crowding import TOUCHING
from particlesim.engine.interactions.surfaces.surface_contacts import SurfaceContacts
from particlesim.engine.islands.coupled import CoupledIsland
from particlesim.engine.islands.overlaps import overlapping
from particlesim.engine.world import World
from particlesim.model.arrays import Floats

PIECE = 1 << 18
"""Pairs that are looked at together."""


class Tangle(NamedTuple):
    """A contact whose simplices cross or are too close: its name; how many pairs cross, and where the first do; how many
    others are too close, how far the closest are apart, how far they should be, and where [m]; the two groups there."""

    label: str
    crossing: int
    place: Floats
    close: int
    distance: float
    thickness: float
    narrow: Floats
    groups: tuple[str, str]


def tangled(world: World) -> list[Tangle]:
    """The contacts of surfaces and strands in which some cross or are too close in the present state."""
    found = []
    for island in world.islands:
        if isinstance(island, CoupledIsland):
            for name, each in zip(island.names, island.interactions, strict=True):
                if isinstance(each, SurfaceContacts) and (tangle := _tangle(island, name, each)) is not None:
                    found.append(tangle)
    return found


def _tangle(island: CoupledIsland, label: str, each: SurfaceContacts) -> Tangle | None:
    x = np.concatenate([state.position for state in island.states]).astype(float)
    r = np.concatenate([state.radius[: state.count] for state in island.states]).astype(float)
    s = each.simplices
    corners = s.corners.T  # [n, 3]
    middle = x[corners].mean(axis=1)
    size = np.linalg.norm(x[corners] - middle[:, None], axis=2).max(axis=1) + r[corners].max(axis=1)
    i, j, _ = overlapping(middle, size)
    i, j = np.minimum(i, j), np.maximum(i, j)
    apart = ~(corners[i][:, :, None] == corners[j][:, None, :]).any(axis=(1, 2))
    if s.split is not None:
        apart &= (i < s.split) & (j >= s.split)
    i, j = i[apart], j[apart]
    crossing, close = np.zeros(len(i), bool), np.zeros(len(i), bool)
    distance, thickness = np.full(len(i), np.inf), np.zeros(len(i))
    for first in range(0, len(i), PIECE):
        part = slice(first, first + PIECE)
        a, b = x[corners[i[part]]], x[corners[j[part]]]
        crossing[part] = _cross(a, b) & (s.face[j[part]] == 1) | _cross(b, a) & (s.face[i[part]] == 1)
        distance[part] = _distance(a, b)
        thickness[part] = r[corners[i[part]]].min(axis=1) + r[corners[j[part]]].min(axis=1)
    close = ~crossing & (distance < thickness * (1 - TOUCHING))
    if not crossing.any() and not close.any():
        return None
    first = int(crossing.argmax())
    least = int(np.where(close, distance / np.where(thickness > 0, thickness, 1), np.inf).argmin())
    shown = first if crossing.any() else least
    borders = np.cumsum([state.count for state in island.states])
    ends = [int(np.searchsorted(borders, corners[k[shown], 0], side="right")) for k in (i, j)]
    names = (island.states[ends[0]].name, island.states[ends[1]].name)
    return Tangle(
        label,
        int(crossing.sum()),
        middle[i[first]],
        int(close.sum()),
        float(distance[least]),
        float(thickness[least]),
        middle[i[least]],
        names,
    )


def _cross(a: Floats, b: Floats) -> NDArray[np.bool_]:
    """Whether edges of simplices a [n, 3, 3] go through triangles b [n, 3, 3]."""
    u, v = b[:, 1] - b[:, 0], b[:, 2] - b[:, 0]
    normal = np.cross(u, v)
    size = (normal * normal).sum(axis=1)
    height = ((a - b[:, :1]) * normal[:, None]).sum(axis=2)
    found = np.zeros(len(a), bool)
    for k, m in ((0, 1), (1, 2), (2, 0)):
        through = (height[:, k] * height[:, m] < 0) & (size > 0)
        part = height[:, k] / np.where(through, height[:, k] - height[:, m], 1)
        w = a[:, k] + part[:, None] * (a[:, m] - a[:, k]) - b[:, 0]
        f = (np.cross(u, w) * normal).sum(axis=1)
        g = (np.cross(w, v) * normal).sum(axis=1)
        found |= through & (f >= 0) & (g >= 0) & (f + g <= size)
    return found


def _distance(a: Floats, b: Floats) -> Floats:
    """The least distance of the edges of two simplices each, and of their corners and the insides of the other [m]."""
    sides = ((0, 1), (1, 2), (2, 0))
    least = np.full(len(a), np.inf)
    for k, m in sides:
        for p, q in sides:
            least = np.minimum(least, _between_edges(a[:, k], a[:, m], b[:, p], b[:, q]))
    for one, other in ((a, b), (b, a)):
        u, v = other[:, 1] - other[:, 0], other[:, 2] - other[:, 0]
        normal = np.cross(u, v)
        size = (normal * normal).sum(axis=1)
        for k in range(3):
            w = one[:, k] - other[:, 0]
            f = (np.cross(u, w) * normal).sum(axis=1)
            g = (np.cross(w, v) * normal).sum(axis=1)
            above = np.abs((w * normal).sum(axis=1)) / np.sqrt(np.where(size > 0, size, 1))
            inside = (size > 0) & (f >= 0) & (g >= 0) & (f + g <= size)
            least = np.where(inside, np.minimum(least, above), least)
    return least


def _between_edges(p: Floats, q: Floats, a: Floats, b: Floats) -> Floats:
    """Distances of edges p–q and a–b, [n, 3] each [m]: of their insides or of their ends, whichever are nearer."""
    d, e, r = q - p, b - a, p - a
    dd, ee, de = (d * d).sum(axis=1), (e * e).sum(axis=1), (d * e).sum(axis=1)
    dr, er = (d * r).sum(axis=1), (e * r).sum(axis=1)
    square = dd * ee - de * de
    s = np.clip(np.divide(de * er - dr * ee, square, out=np.zeros_like(dd), where=square > 0), 0, 1)
    least = np.full(len(p), np.inf)
    for start in (s, np.zeros_like(s), np.ones_like(s)):
        t = np.clip(np.divide(de * start + er, ee, out=np.zeros_like(ee), where=ee > 0), 0, 1)
        back = np.clip(np.divide(de * t - dr, dd, out=np.zeros_like(dd), where=dd > 0), 0, 1)
        gap = r + back[:, None] * d - t[:, None] * e
        least = np.minimum(least, np.linalg.norm(gap, axis=1))
    return np.asarray(least)
