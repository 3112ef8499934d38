"""What rods do to the modes of an island: they remove motions, and their tension makes the others stiffer.

Near a state the free motions of an island with rods are those with J δx = 0. A rod with the force λ (x₁ − x₂) on its first
end has the transverse stiffness −λ = T/L, as a taut string does: a pendulum of length L under T = m g swings with ω² = g/L.
With the forces f at the state, J M⁻¹ Jᵀ λ = −(J M⁻¹ f + |v₁ − v₂|²). Rods put no other limit on a step. As pendulums often
start where their rods bear little, each rod of a connected set with a fixed end is taken to bear the whole load of the set,
unless one of its rods already does.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, VII.1; the Hessian of the Lagrangian on the constraints.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from particlesim.engine.constraints.shake_rattle import Rig
from particlesim.model.arrays import Floats, Ints

DEPENDENT = 1e-12
"""Part of the diagonal that is added, so that rods that depend on each other share what they bear."""

ENOUGH = 1e-6
"""Part by which what a rod bears may miss what hangs on it."""


class RodTensors(NamedTuple):
    """A set of rods near a state: ends i and j, and transverse stiffness [N/m], negative when pushed, each [n]."""

    i: Ints
    j: Ints
    pull: Floats

    @property
    def number(self) -> int:
        """How many there are."""
        return len(self.i)

    def matrices(self, count: int) -> tuple[Any, Any]:
        """Stiffness and damping of all particles as sparse matrices, shape [3 count, 3 count]; those that are pushed count
        as neutral."""
        return self._network(np.maximum(self.pull, 0), count), self._network(np.zeros(self.number), count)

    def jacobians(self, count: int) -> tuple[Any, Any]:
        """∂f/∂x and ∂f/∂v of all particles, exact in the motions that rods leave."""
        return -self._network(self.pull, count), self._network(np.zeros(self.number), count)

    def add_tension(self, total: Floats) -> None:
        """Rods do not load each other here: what they bear is found for all at once (`pulls`)."""

    def loads(self, w: Floats, *, damping: bool, rows: int) -> Iterator[tuple[Ints, list[Floats]]]:
        """As those of springs."""
        if damping:
            return
        part = (w[self.i] + w[self.j]) * np.maximum(self.pull, 0)
        parts = [part] if rows == 1 else [part] * 3 + [np.zeros(self.number)] * 3
        yield self.i, parts
        yield self.j, parts

    def _network(self, values: Floats, count: int) -> Any:
        from scipy.sparse import coo_array

        rows = np.concatenate([self.i, self.j, self.i, self.j])
        columns = np.concatenate([self.i, self.j, self.j, self.i])
        data = np.concatenate([values, values, -values, -values])
        at = [(3 * part[:, None] + np.arange(3)).ravel() for part in (rows, columns)]
        return coo_array((np.repeat(data, 3), tuple(at)), shape=(3 * count, 3 * count)).tocsr()


def pulls(pairs: tuple[Ints, Ints], rig: Rig, order: Ints, columns: Any, force: Floats, w: Floats) -> Floats:
    """The transverse stiffness of every rod [N/m]; `pairs` are rows of the ends, `force` [N] has shape [3, n], w is 1/m.

    Raises ValueError for a state that is not finite.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import spsolve

    x, v = (
        np.stack([column.astype(float) for column in part])
        for part in ((columns.x, columns.y, columns.z), (columns.vx, columns.vy, columns.vz))
    )
    rows = directions(pairs, x)
    first, second = pairs
    turn = ((v[:, first] - v[:, second]) ** 2).sum(axis=0)
    moved = rows @ (np.repeat(w, 3) * force.T.ravel()) + turn
    if not np.isfinite(moved).all():
        raise ValueError("the state is not finite")
    matrix = rows @ diags_array(np.repeat(w, 3)) @ rows.T
    diagonal = matrix.diagonal()
    matrix = matrix + diags_array(np.where(diagonal > 0, DEPENDENT * diagonal, 1.0))
    return _hanging(rig, order, np.atleast_1d(spsolve(matrix.tocsc(), moved)), force)


def _hanging(rig: Rig, order: Ints, pull: Floats, force: Floats) -> Floats:
    """The transverse stiffness [N/m], at least that of a rod that bears the whole load of its connected set, if an end is
    held."""
    free, sets = rig.inverse > 0, np.arange(len(rig.looped))
    slots, rods = (np.repeat(sets, np.diff(borders)) for borders in (rig.slots, rig.rods))
    load = np.sqrt(
        sum(np.bincount(slots, np.where(free, axis[rig.rows], 0.0), len(sets)) ** 2 for axis in force)
    )
    load[np.bincount(slots, ~free, len(sets)) == 0] = 0
    length = np.sqrt(rig.square)
    borne = np.maximum.reduceat(pull[order] * length, rig.rods[:-1])
    slack = (borne < (1 - ENOUGH) * load)[rods]
    found = pull.copy()
    found[order[slack]] = (load[rods] / length)[slack]
    return found


def directions(pairs: tuple[Ints, Ints], x: Floats) -> Any:
    """The rows x₁ − x₂ of all rods [m], a sparse matrix of shape [rods, 3 n]; positions have shape [3, n]."""
    from scipy.sparse import coo_array

    first, second = pairs
    reach = (x[:, first] - x[:, second]).T
    axes = np.arange(3)
    columns = np.concatenate([3 * first[:, None] + axes, 3 * second[:, None] + axes], axis=1)
    rows = np.repeat(np.arange(len(first)), 6)
    values = np.concatenate([reach, -reach], axis=1)
    return coo_array((values.ravel(), (rows, columns.ravel())), shape=(len(first), 3 * x.shape[1])).tocsr()
