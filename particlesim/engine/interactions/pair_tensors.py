"""Interactions of pairs linearised: all matrices of a few particles, and a bound for many.

On coordinates y = √m x the stiffness of a pair is the tensor (w₁ + w₂) T along its relative coordinate, with T = −∂f/∂l
and w = 1/m. Where there are many particles, the bound of each is the larger of two stiffnesses: that of its stiffest pair,
and that of the sum of (w₁ + w₂) T over all its pairs. The first limits the step of two bodies in a close encounter, the
second that of a lattice in which neighbours move against each other.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, outlined
from particlesim.engine.interactions.bond_tensors import network
from particlesim.engine.interactions.interaction import lone, prepare_elements
from particlesim.engine.interactions.pair_blocks import force_in, pair_of, particle_of, slopes_in
from particlesim.engine.state.columns import presence
from particlesim.laws.pair import is_central, pair_force_dv, pair_force_dx, square

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class PairTensors(NamedTuple):
    """An interaction of pairs near a state: its record, the particles, and the time [s]."""

    each: Any
    c: Any
    t: float

    @property
    def number(self) -> int:
        """How many pairs there are."""
        return int(self.each.number)

    def matrices(self, count: int) -> tuple[Any, Any]:
        """Stiffness and damping of all particles as sparse matrices, shape [3 count, 3 count]: the symmetric parts."""
        by_place, by_velocity = self.jacobians(count)
        return -0.5 * (by_place + by_place.T), -0.5 * (by_velocity + by_velocity.T)

    def jacobians(self, count: int) -> tuple[Any, Any]:
        """∂f/∂x and ∂f/∂v of all particles as sparse matrices, exact."""
        ends = Ends(*self.each.list_pairs(self.c))
        blocks = np.zeros((2, 9, len(ends.i)))
        pair_jacobians(self.each, self.c, ends.i, ends.j, self.t, blocks)
        by_place, by_velocity = (network(ends, part.T.reshape(-1, 3, 3), count) for part in blocks)
        return by_place, by_velocity

    def add_tension(self, total: Floats) -> None:
        """Add its forces on all particles to those that rods have to bear, shape [3, particles] [N]."""
        total += forces_in(self.each, self.c, self.t)

    def loads(self, w: Floats, *, damping: bool, rows: int) -> Iterator[tuple[Ints, list[Floats]]]:
        """A bound for every particle that is looked at, alike in all directions."""
        at, stiff, damped = self.each.bounds(self.c, w, self.t)
        most, none = damped if damping else stiff, np.zeros(len(at))
        yield at, [most] if rows == 1 else [most, most, most, none, none, none]


class Ends(NamedTuple):
    """Rows of the first and of the second particles of pairs, [n]."""

    i: Ints
    j: Ints


def pair_between(each: Any, c: Any, i: Any, j: Any, t: Any) -> Any:
    """Two particles as laws see them."""
    return pair_of(particle_of(each, c, i), particle_of(each, c, j), t, False, each.box)


@kernel
def pair_jacobians(each: Any, c: Any, first: Any, second: Any, t: Any, out: Any) -> None:
    """Jacobians of pairs by place and by velocity, into out [2, 9, pairs]; 0 for those that are too far apart."""
    for q in range(first.size):
        p = pair_between(each, c, first[q], second[q], t)
        for k, entry in enumerate(slopes_in(each, p, pair_force_dx)):
            out[0, k, q] = entry
        for k, entry in enumerate(slopes_in(each, p, pair_force_dv)):
            out[1, k, q] = entry


def forces_in(each: Any, c: Any, t: float) -> NDArray[Any]:
    """The forces of a set on all particles [N], shape [3, n]."""
    total = np.zeros((3 if c.spin is None else 6, c.x.size), c.x.dtype)
    all_forces(each, c, lone(c.x.size), total, t)
    return total[:3]


def power_of(each: Any, c: Any, t: float) -> float:
    """The power of the forces of a set on all particles [W], of each for as far as it is there in the present step."""
    power = forces_in(each, c, t) * np.stack([c.vx, c.vy, c.vz])
    if c.clock is not None and c.clock.begin is not None:
        there = np.empty(c.x.size)
        parts_of_step(c, there)
        power = np.where(there > 0, power, 0) * there  # a force on what is not there may be infinite
    return float(power.sum(dtype=float))


@kernel
def parts_of_step(c: Any, out: Any) -> None:
    """The part of the present step in which each particle is there, into out [n]."""
    for i in range(c.x.size):
        out[i] = presence(c.clock, i)


@kernel
def all_forces(each: Any, c: Any, share: Any, total: Any, t: Any) -> None:
    """Add the forces of a set on all particles; `share` is the whole island."""
    prepare_elements((each,), c, share, t)
    type(each).add_forces(each, c, total, 0, c.x.size, t)


@outlined
def add_bounds(each: Any, c: Any, w: Any, i: Any, j: Any, t: Any, out: Any) -> None:
    """Take a pair into account for particle i: into out [14], sums of −(w₁ + w₂) (∂f/∂x + its transpose)/2 as xx, yy, zz,
    xy, xz, yz and the largest size of one; and the same of ∂f/∂v."""
    p = pair_between(each, c, i, j, t)
    weight = -(w[i] + w[j])
    for k, generic in enumerate((pair_force_dx, pair_force_dv)):
        a = slopes_in(each, p, generic)
        tensor = (a[0], a[4], a[8], 0.5 * (a[1] + a[3]), 0.5 * (a[2] + a[6]), 0.5 * (a[5] + a[7]))
        size = 0.0
        for row, entry in enumerate(tensor):
            part = float(weight * entry)
            out[7 * k + row] += part
            size += part * part if row < 3 else 2 * part * part
        if k == 0 and is_central(each.law):
            # its eigenvalues are k across the pair, twice, and the rest of the trace along it
            fx, fy, fz = force_in(each, p)
            s = square(p)
            across = (fx * p.x + fy * p.y + fz * p.z) / s if s > 0 else a[0]
            along = a[0] + a[4] + a[8] - 2 * across
            out[6] = max(out[6], float(weight * across), float(weight * along))
        else:
            out[7 * k + 6] = max(out[7 * k + 6], np.sqrt(size))


def tensor_bounds(out: Floats) -> tuple[Floats, Floats]:
    """From what `add_bounds` found, shape [14, n]: the largest stiffness [1/s²] and damping [1/s] of every particle."""
    found = []
    for xx, yy, zz, xy, xz, yz, steepest in (out[:7], out[7:]):
        tensors = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)
        finite = np.isfinite(tensors).all(axis=(1, 2))
        largest = np.full(len(tensors), np.inf)
        largest[finite] = np.linalg.eigvalsh(tensors[finite])[:, 2]
        found.append(np.maximum(np.maximum(largest, steepest), 0.0))
    return found[0], found[1]
