"""What rods do to the modes of an island: they take motions away, and what pulls on them makes the others stiffer.

Near a state the free motions of an island with rods are those with J δx = 0. A rod with the force λ (x₁ − x₂) on its first
end pulls back across itself with −λ = T/L, as a taut string does: a pendulum of length L under T = m g swings with ω² = g/L.
With the forces f at the state, J M⁻¹ Jᵀ λ = −(J M⁻¹ f + |v₁ − v₂|²). Rods put no other limit on a step.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, VII.1; the Hessian of the Lagrangian on the constraints.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.rod_system import Members, RodSystem
from particlesim.engine.spring_tensors import Tensors

Floats = NDArray[np.float64]

DEPENDENT = 1e-12
"""Part of the diagonal that is added, so that rods that depend on each other share what they bear."""


def pulls(system: RodSystem, columns: Any, force: Floats, w: Floats) -> dict[str, Tensors]:
    """Every set of rods as springs that pull back with T/L, negative when pushed; `force` [N] has shape [3, n], w is 1/m.

    Raises ValueError for a state that is not finite.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import spsolve

    x, v = (
        np.stack([column.astype(float) for column in part])
        for part in ((columns.x, columns.y, columns.z), (columns.vx, columns.vy, columns.vz))
    )
    rows = directions(system, x)
    moved = (rows * np.repeat(w, 3)) @ force.T.ravel()
    first, second = (
        np.concatenate([getattr(each, key) for each in system.members]) for key in ("first", "second")
    )
    turn = ((v[:, first] - v[:, second]) ** 2).sum(axis=0)
    if not np.isfinite(moved + turn).all():
        raise ValueError("the state is not finite")
    matrix = (rows * np.repeat(w, 3)) @ rows.T
    diagonal = matrix.diagonal()
    matrix = matrix + diags_array(np.where(diagonal > 0, DEPENDENT * diagonal, 1.0))
    size = np.atleast_1d(spsolve(matrix.tocsc(), -(moved + turn)))
    found, begin = {}, 0
    for each in system.members:
        mine = size[begin : (begin := begin + len(each.first))]
        found[each.made.name] = _tensors(each, x, v, -mine)
    return found


def _tensors(each: Members, x: Floats, v: Floats, across: Floats) -> Tensors:
    i, j = each.first, each.second
    reach = x[:, i] - x[:, j]
    length = np.sqrt((reach**2).sum(axis=0))
    return Tensors(i, j, reach / length, v[:, i] - v[:, j], length, across, across, np.zeros(len(i)))


def directions(system: RodSystem, x: Floats) -> Any:
    """The rows x₁ − x₂ of all rods [m], a sparse matrix of shape [rods, 3 n]; positions have shape [3, n]."""
    from scipy.sparse import coo_array

    first, second = (
        np.concatenate([getattr(each, key) for each in system.members]) for key in ("first", "second")
    )
    reach = (x[:, first] - x[:, second]).T
    axes = np.arange(3)
    columns = np.concatenate([3 * first[:, None] + axes, 3 * second[:, None] + axes], axis=1)
    rows = np.repeat(np.arange(len(first)), 6)
    values = np.concatenate([reach, -reach], axis=1)
    return coo_array((values.ravel(), (rows, columns.ravel())), shape=(len(first), 3 * x.shape[1])).tocsr()


def free_motions(rows: Floats) -> Floats:
    """An orthonormal basis of the motions that rods, with rows [rods, n], leave; shape [n, motions]."""
    _, sizes, basis = np.linalg.svd(rows)
    rank = int((sizes > 1e-9 * sizes.max(initial=0.0)).sum())
    return np.asarray(basis[rank:].T)


def bounding(s: Tensors) -> Tensors:
    """A set of rods for bounds: those that are pushed count as neutral."""
    pull = np.maximum(s.across, 0)
    return s._replace(along=pull, across=pull)
