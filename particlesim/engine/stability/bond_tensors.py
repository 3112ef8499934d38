"""Springs linearised, all at once: their stiffness along and across themselves, bounds and extreme modes of a network.

A spring of stiffness k, length l and rest length L₀ pulls back with k along its direction e, and with k (1 − L₀/l) across
it; its damper acts along it. On coordinates y = √m x a network is the symmetric matrix Σ Bᵀ T B with T the 3 × 3 tensor of a
spring and B y = √w₁ y₁ − √w₂ y₂, w = 1/m (0 for a pinned end). As |B y|² ≤ (w₁ + w₂)(|y₁|² + |y₂|²) in every direction, its
largest eigenvalue is at most that of Σ (w₁ + w₂) T over the springs of some particle, which an endless chain reaches.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from particlesim.bonds import StringRecord, StrutRecord
from particlesim.engine.interactions.bonds import Bonds

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LANCZOS = 48
"""Steps of the iteration for extreme modes."""
SPREAD = 24
"""Modes that are taken from all over the spectrum."""
BY_COMPONENT = 300_000
"""Springs up to which the bound looks at directions; more are added up without, which never gives a smaller bound."""


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


class Coupling(Protocol):
    """What joins particles, linearised: springs, hinges, or triangles."""

    @property
    def number(self) -> int: ...
    def matrices(self, count: int) -> tuple[Any, Any]: ...
    def jacobians(self, count: int) -> tuple[Any, Any]: ...
    def loads(self, w: Floats, *, damping: bool, rows: int) -> Iterator[tuple[Ints, list[Floats]]]: ...


def tensors(bond: Bonds, columns: Any) -> Tensors:
    """A set of springs at the present state.

    Strings count as taut and struts as pressed, as they have to be stable when they are. Coincident ends have no direction:
    they pull back in every one.
    """
    real = np.flatnonzero(bond.i >= 0)
    i, j = bond.i[real], bond.j[real]
    reach, speed = (
        np.stack([column[i].astype(float) - column[j] for column in part])
        for part in ((columns.x, columns.y, columns.z), (columns.vx, columns.vy, columns.vz))
    )
    k, c, rest = (
        np.broadcast_to(np.asarray(column, float), bond.i.shape)[real]
        for column in (bond.k, bond.c, bond.rest)
    )
    length = np.sqrt((reach * reach).sum(axis=0))
    e = np.divide(reach, length, out=np.zeros_like(reach), where=length > 0)
    slack = ((length < rest) & isinstance(bond.law, StringRecord)) | (
        (length > rest) & isinstance(bond.law, StrutRecord)
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


def network(s: Tensors, blocks: Floats, count: int) -> Any:
    """The sparse matrix of all particles from blocks of springs [n, 3, 3]; shape [3 count, 3 count]."""
    from scipy.sparse import coo_array

    ends = np.stack([s.i, s.i, s.j, s.j]), np.stack([s.i, s.j, s.i, s.j])
    rows, columns = (3 * end[:, :, None, None] for end in ends)
    values = np.array([1.0, -1.0, -1.0, 1.0])[:, None, None, None] * blocks
    rows, columns = (
        np.broadcast_to(part, values.shape).ravel()
        for part in (rows + np.arange(3)[:, None], columns + np.arange(3))
    )
    return coo_array((values.ravel(), (rows, columns)), shape=(3 * count, 3 * count)).tocsr()


def bound(sets: Sequence[Coupling], w: Floats, *, damping: bool) -> float:
    """At least the largest eigenvalue of a network's stiffness [1/s²], or of its damping [1/s]; w is 1/m, shape [n]."""
    rows = np.zeros((6 if sum(s.number for s in sets) <= BY_COMPONENT else 1, len(w)))
    for s in sets:
        for at, parts in s.loads(w, damping=damping, rows=len(rows)):
            for row, part in zip(rows, parts, strict=True):
                row += np.bincount(at, part, len(w))
    rows = rows[:, w > 0]
    if len(rows) == 1 or not rows.size:
        return float(rows.max(initial=0.0))
    xx, yy, zz, xy, xz, yz = np.abs(rows)
    # Row sums (Gershgorin) and the trace both bound the largest eigenvalue of a particle's tensor.
    sums = np.maximum(np.maximum(xx + xy + xz, yy + xy + yz), zz + xz + yz)
    return float(np.minimum(sums, xx + yy + zz).max())


def extreme_modes(sets: Sequence[Coupling], w: Floats) -> Floats:
    """Stiffness k [1/s²] and damping d [1/s] of the stiffest mode, the most damped one, and one between, and of some that
    are spread over the spectrum of the stiffness; shape [modes, 2]."""
    from scipy.sparse import diags_array

    root = diags_array(np.sqrt(np.repeat(w, 3)))
    parts = [s.matrices(len(w)) for s in sets]
    stiffness, damping = (sum(root @ part[k] @ root for part in parts) for k in (0, 1))
    *others, stiffest = _ritz(stiffness)
    modes = [stiffest]
    if damping.count_nonzero():
        modes.append(_ritz(damping)[-1])
        frequency = float(np.sqrt(max(stiffest @ (stiffness @ stiffest), 0.0)))
        modes.append(_ritz(stiffness + frequency * damping)[-1])
    modes += [others[k] for k in np.unique(np.linspace(0, len(others) - 1, SPREAD).astype(int)) if others]
    return np.array([[y @ (stiffness @ y), y @ (damping @ y)] for y in modes])


def _stiffness(s: Tensors) -> Floats:
    outer = np.einsum("an,bn->nab", s.e, s.e)
    across = np.maximum(s.across, 0)
    return (s.along - across)[:, None, None] * outer + across[:, None, None] * np.eye(3)


def _damping(s: Tensors) -> Floats:
    return s.damping[:, None, None] * np.einsum("an,bn->nab", s.e, s.e)


def _ritz(matrix: Any) -> Floats:
    """Unit vectors near eigenvectors of a symmetric matrix, up to that of the largest eigenvalue, by Lanczos iteration from
    a fixed start; shape [at most LANCZOS, n].

    All vectors are kept orthogonal. The top of a network's spectrum is crowded, so that the last vector is a mixture of
    modes near the top; its Rayleigh quotient misses the eigenvalue by about one part in (number of steps)². Those of the
    others are spread over the spectrum.
    """
    y = np.random.default_rng(0).standard_normal(matrix.shape[0])
    basis = [y / np.linalg.norm(y)]
    diagonal: list[float] = []
    beside: list[float] = []
    for _ in range(min(LANCZOS, len(y))):
        y = matrix @ basis[-1]
        diagonal.append(float(basis[-1] @ y))
        space = np.array(basis)
        y -= space.T @ (space @ y)
        y -= space.T @ (space @ y)  # once more: what rounding left
        beside.append(float(np.linalg.norm(y)))
        if beside[-1] <= 1e-12 * max(map(abs, diagonal)):
            break
        basis.append(y / beside[-1])
    number = len(diagonal)
    small = np.diag(diagonal) + np.diag(beside[: number - 1], 1) + np.diag(beside[: number - 1], -1)
    found = np.linalg.eigh(small)[1].T @ np.array(basis[:number])
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])
