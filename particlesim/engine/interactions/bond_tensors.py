"""Springs linearised, all at once: their stiffness along and across themselves, bounds and extreme modes of a network.

A spring of stiffness k, length l and rest length L₀ pulls back with k along its direction e, and with k (1 − L₀/l) across
it; its damper acts along it. On coordinates y = √m x a network is the symmetric matrix Σ Bᵀ T B with T the 3 × 3 tensor of a
spring and B y = √w₁ y₁ − √w₂ y₂, w = 1/m (0 for a pinned end). As |B y|² ≤ (w₁ + w₂)(|y₁|² + |y₂|²) in every direction, its
largest eigenvalue is at most the largest of those of Σ (w₁ + w₂) T over the springs of a particle; an endless chain attains
that.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.bonds import StringRecord, StrutRecord

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Tensors(NamedTuple):
    """Springs near a state: ends i and j [n], direction e [3, n], relative velocity [3, n], length, and what pulls back
    along and across [N/m] and the damping [kg/s], each [n]."""

    i: Ints
    j: Ints
    e: Floats
    velocity: Floats
    length: Floats
    along: Floats
    across: Floats
    damping: Floats

    @property
    def number(self) -> int:
        """How many there are."""
        return len(self.i)

    def matrices(self, count: int) -> tuple[Any, Any]:
        """Stiffness and damping of all particles as sparse matrices, shape [3 count, 3 count].

        Springs that are pushed count as neutral across, where they would buckle.
        """
        return network(self, _stiffness(self), count), network(self, _damping(self), count)

    def jacobians(self, count: int) -> tuple[Any, Any]:
        """∂f/∂x and ∂f/∂v of all particles as sparse matrices, exact."""
        by_place, by_velocity = jacobians(self)
        return network(self, by_place, count), network(self, by_velocity, count)

    def add_tension(self, total: Floats) -> None:
        """Add what springs and dampers pull with to the forces on all particles, shape [3, particles] [N]."""
        along = self.across * self.length + self.damping * (self.velocity * self.e).sum(axis=0)
        for axis, pull in enumerate(along * self.e):
            count = total.shape[1]
            total[axis] += np.bincount(self.j, pull, count) - np.bincount(self.i, pull, count)

    def loads(self, w: Floats, *, damping: bool, rows: int) -> Iterator[tuple[Ints, list[Floats]]]:
        """What bounds the stiffness or the damping of particles: which ones [n], and tensors to be added up, as xx, yy, zz,
        xy, xz, yz [n]; of 1 row, a bound on their largest eigenvalue."""
        along, across = (
            (self.damping, np.zeros_like(self.damping))
            if damping
            else (self.along, np.maximum(self.across, 0))
        )
        pull = w[self.i] + w[self.j]
        if rows == 1:
            parts = [pull * np.maximum(along, across)]
        else:
            x, y, z = self.e
            rise, base = pull * (along - across), pull * across
            parts = [
                rise * x * x + base,
                rise * y * y + base,
                rise * z * z + base,
                rise * x * y,
                rise * x * z,
                rise * y * z,
            ]
        yield self.i, parts
        yield self.j, parts


def tensors(law: Any, i: Ints, j: Ints, constants: tuple[Floats, ...], columns: Any) -> Tensors:
    """Springs between particles i and j at the present state; constants k, c and rest length, each [n].

    Strings count as taut and struts as pressed, as they have to be stable when they are. Coincident ends have no direction:
    they pull back in every one.
    """
    k, c, rest = constants
    reach, speed = (
        np.stack([column[i].astype(float) - column[j] for column in part])
        for part in ((columns.x, columns.y, columns.z), (columns.vx, columns.vy, columns.vz))
    )
    length = np.sqrt((reach * reach).sum(axis=0))
    e = np.divide(reach, length, out=np.zeros_like(reach), where=length > 0)
    slack = ((length < rest) & isinstance(law, StringRecord)) | (
        (length > rest) & isinstance(law, StrutRecord)
    )
    across = k * (1 - np.divide(rest, length, out=np.ones_like(length), where=length > 0))
    across[slack] = 0
    across[length == 0] = k[length == 0]
    return Tensors(i, j, e, speed, length, k, across, c)


def jacobians(s: Tensors) -> tuple[Floats, Floats]:
    """Force on the first end by l = x₁ − x₂ and by v₁ − v₂, shapes [n, 3, 3]; exact, so that pushed springs may buckle."""
    outer = np.einsum("an,bn->nab", s.e, s.e)
    flat = np.eye(3) - outer
    inverse = np.divide(s.damping, s.length, out=np.zeros_like(s.length), where=s.length > 0)
    rate = (s.velocity * s.e).sum(axis=0)
    sideways = s.velocity - rate * s.e
    turning = (
        inverse[:, None, None] * np.einsum("an,bn->nab", s.e, sideways)
        + (inverse * rate)[:, None, None] * flat
    )
    by_place = -(s.along[:, None, None] * outer + s.across[:, None, None] * flat) - turning
    return by_place, -s.damping[:, None, None] * outer


def network(s: Any, blocks: Floats, count: int) -> Any:
    """The sparse matrix of all particles from blocks [n, 3, 3] of pairs of rows `s.i`, `s.j`; shape [3 count, 3 count]."""
    from scipy.sparse import coo_array

    ends = np.stack([s.i, s.i, s.j, s.j]), np.stack([s.i, s.j, s.i, s.j])
    rows, columns = (3 * end[:, :, None, None] for end in ends)
    values = np.array([1.0, -1.0, -1.0, 1.0])[:, None, None, None] * blocks
    rows, columns = (
        np.broadcast_to(part, values.shape).ravel()
        for part in (rows + np.arange(3)[:, None], columns + np.arange(3))
    )
    return coo_array((values.ravel(), (rows, columns)), shape=(3 * count, 3 * count)).tocsr()


def _stiffness(s: Tensors) -> Floats:
    outer = np.einsum("an,bn->nab", s.e, s.e)
    across = np.maximum(s.across, 0)
    return (s.along - across)[:, None, None] * outer + across[:, None, None] * np.eye(3)


def _damping(s: Tensors) -> Floats:
    return s.damping[:, None, None] * np.einsum("an,bn->nab", s.e, s.e)
