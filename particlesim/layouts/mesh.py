"""Layouts that bring their own springs: particles on a grid, and which of them are joined."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from particlesim.errors import UsageError
from particlesim.layouts.base import Layout
from particlesim.model.arrays import Ints

Resolution = Annotated[int, Field(ge=2, le=10_000, strict=True)]

STRUCTURAL = "structural"
SHEAR = "shear"
BEND = "bend"
ANGLE = "angle"
DIHEDRAL = "dihedral"


class Mesh(Layout):
    """A body of particles and springs. The mass of its group is that of the whole body."""

    is_body: ClassVar[bool] = True

    def shape(self) -> tuple[int, ...]:
        """Particles along each axis of the grid; the last one runs fastest."""
        raise NotImplementedError

    def number(self) -> int | None:
        return int(np.prod(self.shape()))

    def pins(self) -> Ints:
        pinned = getattr(self, "pinned", None)
        names = (pinned,) if isinstance(pinned, str) else pinned or ()
        parts = [part for name in names if (part := self.part(name)) is not None]
        return np.unique(np.concatenate([np.empty(0, np.int64), *parts]))

    def hinges(self, kind: str) -> Ints:
        return folds(self.triangles())

    def edges(self, kind: str) -> Ints:
        """Pairs of particles joined by the springs of a kind, shape [springs, 2]."""
        return grid_edges(self.shape(), steps(len(self.shape()), kind))


def grid_triangles(index: Ints) -> Ints:
    """Two triangles for every cell of a grid of particles [rows, columns], with the normal columns × rows, shape [n, 3].

    The diagonals alternate like those of a union jack, so that no direction is preferred.
    """
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    row, column = np.indices(a.shape)
    rising = ((row + column) % 2 == 0)[..., None]
    first = np.where(rising, np.stack([a, b, c], axis=-1), np.stack([a, b, d], axis=-1))
    second = np.where(rising, np.stack([a, c, d], axis=-1), np.stack([b, c, d], axis=-1))
    return np.stack([first, second], axis=2).reshape(-1, 3)


def is_closed(triangles: Ints) -> bool:
    """Whether a surface has an inside: every edge is shared by two triangles that run along it in opposite directions."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    forward = np.sort(edges[:, 0] * (int(triangles.max(initial=0)) + 1) + edges[:, 1])
    backward = np.sort(edges[:, 1] * (int(triangles.max(initial=0)) + 1) + edges[:, 0])
    return len(triangles) > 0 and bool((forward == backward).all())


def require_manifold(triangles: Ints, label: str) -> None:
    """Raises UsageError when several triangles run along an edge in the same direction: more than two share it, or two
    disagree about their front."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    found, number = np.unique(edges, axis=0, return_counts=True)
    worst = int(number.argmax())
    if number[worst] > 1:
        a, b = found[worst]
        raise UsageError(
            f"{label}: {number[worst]} triangles run along the edge between particles {a} and {b} in the same direction",
            "bending and drag need manifold edges, each with one triangle or with two that are wound the same way; "
            "structural springs take any mesh",
        )


def folds(triangles: Ints) -> Ints:
    """Particles of the dihedrals of a surface: for every edge 2–3 of two triangles, 1, 2, 3, 4 of 1–2–3 and 4–3–2, [n, 4].

    Every edge must belong to one or two triangles, which run along it in opposite directions.
    """
    start = np.concatenate([triangles[:, k] for k in range(3)])
    end = np.concatenate([triangles[:, k] for k in (1, 2, 0)])
    apex = np.concatenate([triangles[:, k] for k in (2, 0, 1)])
    forward = start < end
    low, high = np.minimum(start, end), np.maximum(start, end)
    key = low * (int(triangles.max(initial=0)) + 1) + high
    one, other = (np.flatnonzero(side)[np.argsort(key[side], kind="stable")] for side in (forward, ~forward))
    _, a, b = np.intersect1d(key[one], key[other], return_indices=True)
    one, other = one[a], other[b]
    return np.stack([apex[one], start[one], end[one], apex[other]], axis=1)


def steps(axes: int, kind: str) -> list[tuple[int, ...]]:
    """Where on the grid the other ends of a particle's springs are; each spring from one end only.

    Structural: the next particle along an axis. Shear: across the diagonals of faces and cells. Bend: every other
    particle along an axis.
    """
    units = [tuple(int(a == b) for b in range(axes)) for a in range(axes)]
    if kind == STRUCTURAL:
        return units
    if kind == BEND:
        return [tuple(2 * x for x in unit) for unit in units]
    around = np.stack(np.meshgrid(*[[-1, 0, 1]] * axes, indexing="ij"), axis=-1).reshape(-1, axes)
    diagonal = around[np.abs(around).sum(axis=1) > 1]
    # Of a step and its opposite, the one whose first number that is not zero is positive.
    forward = [row for row in diagonal.tolist() if next(x for x in row if x) > 0]
    return [tuple(row) for row in forward]


def grid_edges(shape: tuple[int, ...], offsets: list[tuple[int, ...]]) -> Ints:
    """All pairs of grid points that differ by one of the offsets, shape [pairs, 2]."""
    index = np.arange(int(np.prod(shape)), dtype=np.int64).reshape(shape)
    found = []
    for offset in offsets:
        first = tuple(slice(max(0, -o), n - max(0, o)) for o, n in zip(offset, shape, strict=True))
        second = tuple(slice(max(0, o), n - max(0, -o)) for o, n in zip(offset, shape, strict=True))
        found.append(np.stack([index[first].ravel(), index[second].ravel()], axis=1))
    return np.concatenate(found)
