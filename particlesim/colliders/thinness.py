"""Walls that are left between parts of what is put together, where they are thinner than contact is sure to meet.

Places are taken all over the surfaces of the parts. Those that are on the surface of the whole are thin where a place as far
behind them as a limit is out of it again, and the surface there looks the other way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.combination import Combination
from particlesim.colliders.cuts import is_cut
from particlesim.colliders.gaps import gaps_and_normals_of
from particlesim.colliders.parts import IntersectionRecord, UnionRecord
from particlesim.model.arrays import Floats

PLACES = 4000
"""On the surface of each part, about."""
ON = 1e-9
"""How far from the surface of the whole places are on it, as a part of its size."""
OPPOSITE = -0.98
"""The cosine of the angle between both sides of a wall, at most: others are sharp edges, which end in nothing."""


class Thin(NamedTuple):
    """How thick a wall is [m], and where."""

    thickness: float
    place: Floats


def thinnest_wall(solid: Combination, limit: float) -> Thin | None:
    """The thinnest wall that is found in a solid, if that is thinner than a limit [m]."""
    whole, found = solid.geometry(), None
    rounding = ON * solid.farthest()
    for x in _places(solid):
        gaps, normals = _look(whole, x)
        on = np.abs(gaps) < rounding
        x, n = x[on], normals[on]
        if len(x):
            behind, other = _look(whole, x - limit * n)
            thin = (behind > 0) & (np.einsum("ij,ij->i", n, other) < OPPOSITE)
            if thin.any():
                k = int(np.argmax(np.where(thin, behind, -np.inf)))
                if found is None or limit - behind[k] < found.thickness:
                    found = Thin(max(limit - float(behind[k]), 0.0), x[k])
    return found


def step_of_search(solid: Combination) -> float:
    """The shortest step of the search for impacts on a solid [m]; 0 where they are found without one."""
    return solid.grain() if _is_searched(solid.geometry()) else 0.0


def _is_searched(shape: Any) -> bool:
    if isinstance(shape, UnionRecord):
        return any(map(_is_searched, shape.parts))
    return isinstance(shape, IntersectionRecord) and not is_cut(shape)


def _places(solid: Combination) -> Iterator[Floats]:
    """Places on the surfaces of all parts [n, 3] [m]."""
    for part in solid.of:
        if isinstance(part, Combination):
            yield from _places(part)
        else:
            surface = solid.surface_of(part)
            corners = surface.corners[surface.faces]
            if len(corners):
                fine = max(math.isqrt(PLACES // len(corners)), 1) + 2
                shares = [(a, b, fine - a - b) for a in range(1, fine) for b in range(1, fine - a)]
                x = np.concatenate(
                    [sum(s * corners[:, k] for k, s in enumerate(each)) / fine for each in shares]
                )
                gaps, normals = _look(part.geometry(), x)
                yield x - gaps[:, None] * normals  # triangles are chords


def _look(shape: Any, places: Floats) -> tuple[Floats, Floats]:
    """Gaps [n] [m] and normals [n, 3] of places."""
    x, y, z = np.ascontiguousarray(places.T, float)
    gaps, normals = np.empty(x.size), np.empty((x.size, 3))
    gaps_and_normals_of(shape, x, y, z, gaps, normals)
    return gaps, normals
