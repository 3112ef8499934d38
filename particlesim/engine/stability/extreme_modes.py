"""Bounds on the modes of a network of couplings, and its extreme modes.

On coordinates y = √m x the couplings of an island are symmetric matrices; sums over the couplings of single particles bound
the largest eigenvalue (`Coupling.loads`), and Lanczos iteration finds modes near both ends of the spectrum.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.interactions.coupling import Coupling

Floats = NDArray[np.float64]

LANCZOS = 48
"""Steps of the iteration for extreme modes."""
SPREAD = 24
"""Modes that are taken from all over the spectrum."""
BY_COMPONENT = 300_000
"""Springs up to which the bound looks at directions; more are added up without, which never gives a smaller bound."""


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


def _ritz(matrix: Any) -> Floats:
    """Unit vectors near eigenvectors of a symmetric matrix, up to that of the largest eigenvalue, by Lanczos iteration from
    a fixed start; shape [at most LANCZOS, n].

    All vectors are kept orthogonal. The top of a network's spectrum is crowded, so that the last vector is a mixture of
    modes near the top; its Rayleigh quotient misses the eigenvalue by about one part in (number of steps)². Those of the
    others are spread over the spectrum.
    """
    y = np.random.default_rng(0).standard_normal(matrix.shape[0])
    basis = np.empty((min(LANCZOS, len(y)) + 1, len(y)))
    basis[0] = y / np.linalg.norm(y)
    diagonal: list[float] = []
    beside: list[float] = []
    for k in range(min(LANCZOS, len(y))):
        y = matrix @ basis[k]
        diagonal.append(float(basis[k] @ y))
        space = basis[: k + 1]
        y -= space.T @ (space @ y)
        y -= space.T @ (space @ y)  # once more: what rounding left
        beside.append(float(np.linalg.norm(y)))
        if beside[-1] <= 1e-12 * max(map(abs, diagonal)):
            break
        basis[k + 1] = y / beside[-1]
    number = len(diagonal)
    small = np.diag(diagonal) + np.diag(beside[: number - 1], 1) + np.diag(beside[: number - 1], -1)
    found = np.linalg.eigh(small)[1].T @ basis[:number]
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])
