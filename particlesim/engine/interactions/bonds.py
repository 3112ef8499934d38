"""Springs: their layout, their forces, added up in a fixed order, their breaking, and the other members of an
interaction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from particlesim.bonds import BondSet, record_of
from particlesim.bonds.spring import Pair
from particlesim.compiler import kernel, outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.bond_layout import (
    FIRST,
    HOLES,
    HOLES_END,
    LENGTH,
    OFFSET,
    OWNS_FIRST,
    OWNS_SECOND,
    SECOND,
    chunk_size,
    in_slots,
)
from particlesim.engine.interactions.bond_tensors import Tensors, tensors
from particlesim.engine.interactions.interaction import Floats, Interaction, Ints, Site, rows_after
from particlesim.engine.state.columns import cut, element
from particlesim.errors import UsageError
from particlesim.laws.registry import bond_force, bond_potential
from particlesim.trajectory.topology import Topology

SHORT = 12
"""Springs of a piece below which they are taken one by one: setting up vectors costs more."""


class Breaking(NamedTuple):
    """When bonds break: strain, pull [N] (infinite: never), and when each broke [s], infinity while it holds."""

    strain: float
    pull: float
    when: Any


class Roster(NamedTuple):
    """All bonds of a set since the start, in the order of a trajectory: ids of both ends [n, 2], rest lengths [m], and when
    those broke that are laid out no longer, as they lost an end [s], infinity for the others, [n] each. `number` tells
    which of them every slot has, −1 in holes."""

    number: Any
    pairs: Any
    rest: Any
    when: Any


class BondColumns(NamedTuple):
    """Springs of one law: its record, both ends of each bond, and stiffness [N/m], damping [kg/s] and rest length [m], each
    a number for all or an array, in the slots of `bond_layout`; `holes` are slots without a bond, with ends −1.
    `breaking` is None for bonds that hold, and `roster` for those whose ends do not die.

    `table` lists the pieces of `bond_layout` that a thread works on, and `begin` where those of each chunk
    begin.
    """

    law: tuple[Any, ...]
    i: Any
    j: Any
    k: Any
    c: Any
    rest: Any
    holes: Any
    table: Any
    begin: Any
    breaking: Any
    roster: Any = None


class Bonds(Interaction, BondColumns):
    """Springs of one law, as `BondColumns` have them. Their forces are added chunk by chunk (`add_bonds`), and implicit
    methods have them in runs, too (`implicit.linear_system`)."""

    __slots__ = ()
    by_chunks: ClassVar[bool] = True
    follows: ClassVar[frozenset[str]] = frozenset(("law", "i", "j", "holes", "table", "begin"))

    @property
    def number(self) -> int:
        return int(self.i.size - self.holes.size)

    def energy(self, c: Any, t: float) -> float:
        return float(sum_bonds(self, c))

    @property
    def spends(self) -> bool:
        return bool(np.any(self.c))

    def power(self, c: Any, t: float) -> float:
        return float(damping_power(self, c))

    def linearise(self, c: Any, t: float) -> Tensors:
        real = np.flatnonzero(self.i >= 0)
        columns = (
            np.broadcast_to(np.asarray(each, float), self.i.shape) for each in (self.k, self.c, self.rest)
        )
        return tensors(self.law, self.i[real], self.j[real], tuple(each[real] for each in columns), c)

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        total = np.zeros(3)
        for q in np.flatnonzero((self.i == row) | (self.j == row)):
            i, j = self.i[q], self.j[q]
            apart = (float(column[i]) - float(column[j]) for column in (c.x, c.y, c.z, c.vx, c.vy, c.vz))
            constants = (
                float(column if np.ndim(column) == 0 else column[q]) for column in (self.k, self.c, self.rest)
            )
            pull = np.array(bond_force(self.law, Pair(*map(np.float64, (*apart, *constants)))))
            total += pull if i == row else -pull
        return total

    def laid_again(self, site: Site, place: Ints) -> Self:
        there = np.flatnonzero(self.i >= 0)
        ends, left = rows_after(np.stack([self.i[there], self.j[there]]), place)
        slots = in_slots(ends[0], ends[1], chunk_size(site.whole.count))

        def again(column: Any, hole: Any = 0) -> Any:
            return slots.spread(column[there[left]], hole) if np.ndim(column) else column

        breaking, roster = self.breaking, self.roster
        if breaking is not None:
            breaking = breaking._replace(when=again(self.breaking.when, np.inf))
        if roster is not None:
            lost, when = there[~left], roster.when.copy()
            when[roster.number[lost]] = self.breaking.when[lost]
            roster = roster._replace(number=again(roster.number, -1), when=when)
        return self._replace(
            i=slots.i,
            j=slots.j,
            k=again(self.k),
            c=again(self.c),
            rest=again(self.rest),
            holes=slots.holes,
            table=slots.table,
            breaking=breaking,
            roster=roster,
        )

    def topology(self, name: str, ids: Ints) -> Topology:
        if self.roster is not None:
            return Topology(name, self.roster.pairs, self.roster.rest, self._whens(), breakable=True)
        there = self.i >= 0
        pairs = np.stack([ids[self.i[there]], ids[self.j[there]]], axis=1)
        broke = np.full(len(pairs), np.inf) if self.broke is None else self.broke
        rest = self.rest[there].astype(float)
        return Topology(name, pairs, rest, broke, breakable=self.breaking is not None)

    @property
    def broke(self) -> Floats | None:
        if self.roster is not None:
            return self._whens()
        return None if self.breaking is None else np.asarray(self.breaking.when[self.i >= 0])

    def _whens(self) -> Floats:
        """When every bond of the roster broke [s], infinity while it holds."""
        when, there = self.roster.when.copy(), self.i >= 0
        when[self.roster.number[there]] = self.breaking.when[there]
        return np.asarray(when)

    def without_dead(self, now: Self, c: Any) -> Self:
        if self.roster is None or c.clock is None:
            return self
        lost = np.minimum(c.clock.stop[now.i], c.clock.stop[now.j]) <= now.breaking.when
        gone = (self.i >= 0) & (self.breaking.when != now.breaking.when) & lost
        return self._replace(k=np.where(gone, 0, self.k).astype(self.k.dtype)) if gone.any() else self

    def changing(self) -> tuple[NDArray[Any], ...]:
        return () if self.breaking is None else (self.k, self.c, self.breaking.when)

    def with_changed(self, arrays: Sequence[NDArray[Any]]) -> Self:
        if self.breaking is None:
            return self
        k, c, when = arrays
        return self._replace(k=k, c=c, breaking=self.breaking._replace(when=when))


def pair_of(bond: Any, c: Any, k: Any) -> Any:
    """Bond k as laws see it."""
    i, j = bond.i[k], bond.j[k]
    return Pair(
        c.x[i] - c.x[j],
        c.y[i] - c.y[j],
        c.z[i] - c.z[j],
        c.vx[i] - c.vx[j],
        c.vy[i] - c.vy[j],
        c.vz[i] - c.vz[j],
        element(bond.k, k),
        element(bond.c, k),
        element(bond.rest, k),
    )


def chunks_of(bonds: Any) -> Any:
    """Chunks of particles that pieces of bonds are sorted by; none without bonds."""
    return bonds[0].begin.size - 1 if len(bonds) > 0 else 0


def add_bonds(bonds: Any, c: Any, total: Any, pull: Any, chunk: Any) -> None:
    """Add the forces of the bonds of a chunk to `total`; the sets take turns, so that they share what is in the cache."""
    for bond in bonds:
        for piece in range(bond.begin[chunk], bond.begin[chunk + 1]):
            if bond.table[piece, LENGTH] < SHORT:
                _add_one_by_one(bond, c, total, bond.table[piece])
            else:
                _add_run(bond, c, total, pull, bond.table[piece])


@outlined
def _add_one_by_one(bond: Any, c: Any, total: Any, piece: Any) -> None:
    for k in range(piece[OFFSET], piece[OFFSET] + piece[LENGTH]):
        i, j = bond.i[k], bond.j[k]
        if i < 0:
            continue
        fx, fy, fz = bond_force(bond.law, pair_of(bond, c, k))
        if piece[OWNS_FIRST]:
            total[0, i] += fx
            total[1, i] += fy
            total[2, i] += fz
        if piece[OWNS_SECOND]:
            total[0, j] -= fx
            total[1, j] -= fy
            total[2, j] -= fz


@outlined
def _add_run(bond: Any, c: Any, total: Any, pull: Any, piece: Any) -> None:
    # Forces go to scratch before they are added, because both ends may be among the same particles.
    n, run = piece[LENGTH], run_of(bond, c, piece)
    px, py, pz = pull[0, :n], pull[1, :n], pull[2, :n]
    for k in range(n):
        pair = pair_in(run, k)
        fx, fy, fz = bond_force(bond.law, pair)
        px[k] = fx
        py[k] = fy
        pz[k] = fz
    for q in range(piece[HOLES], piece[HOLES_END]):
        hole = bond.holes[q] - piece[OFFSET]
        px[hole] = py[hole] = pz[hole] = 0
    add_pulls(piece, pull, total)


class Run(NamedTuple):
    """A piece of springs as slices: position and velocity of the first and of the second ends, and k, c and rest length."""

    first: Any
    second: Any
    k: Any
    c: Any
    rest: Any


def run_of(bond: Any, c: Any, piece: Any) -> Any:
    """The springs of a piece as slices: an index such as x[a + k] might be negative, and the check for that stops
    vectorisation."""
    a, b, n = piece[FIRST], piece[SECOND], piece[LENGTH]
    first, last = piece[OFFSET], piece[OFFSET] + n
    return Run(
        (c.x[a : a + n], c.y[a : a + n], c.z[a : a + n], c.vx[a : a + n], c.vy[a : a + n], c.vz[a : a + n]),
        (c.x[b : b + n], c.y[b : b + n], c.z[b : b + n], c.vx[b : b + n], c.vy[b : b + n], c.vz[b : b + n]),
        cut(bond.k, first, last),
        cut(bond.c, first, last),
        cut(bond.rest, first, last),
    )


def pair_in(run: Any, k: Any) -> Any:
    """Spring k of a run as laws see it."""
    xa, ya, za, ua, va, wa = run.first
    xb, yb, zb, ub, vb, wb = run.second
    return Pair(
        xa[k] - xb[k],
        ya[k] - yb[k],
        za[k] - zb[k],
        ua[k] - ub[k],
        va[k] - vb[k],
        wa[k] - wb[k],
        element(run.k, k),
        element(run.c, k),
        element(run.rest, k),
    )


def add_pulls(piece: Any, pull: Any, total: Any) -> None:
    """Add the forces of a piece, in scratch, to the first ends, and take them from the second, where a thread owns them."""
    a, b, n = piece[FIRST], piece[SECOND], piece[LENGTH]
    px, py, pz = pull[0, :n], pull[1, :n], pull[2, :n]
    if piece[OWNS_FIRST]:
        gx, gy, gz = total[0, a : a + n], total[1, a : a + n], total[2, a : a + n]
        for k in range(n):
            gx[k] += px[k]
            gy[k] += py[k]
            gz[k] += pz[k]
    if piece[OWNS_SECOND]:
        gx, gy, gz = total[0, b : b + n], total[1, b : b + n], total[2, b : b + n]
        for k in range(n):
            gx[k] -= px[k]
            gy[k] -= py[k]
            gz[k] -= pz[k]


def break_bonds(bonds: Any, c: Any, share: Any, t: Any) -> None:
    """Take out bonds that are stretched or pulled too far at time t, or that have lost an end by then: they lose their
    stiffness and damping.

    The owner of the first end does; all threads go on when all are done.
    """
    for bond in bonds:
        if bond.breaking is not None:
            for piece in range(len(bond.table)):
                if bond.table[piece, OWNS_FIRST]:
                    _break_piece(bond, c, bond.table[piece], t)
            meet(share.gate, share.threads)


@outlined
def _break_piece(bond: Any, c: Any, piece: Any, t: Any) -> None:
    limits = bond.breaking
    for k in range(piece[OFFSET], piece[OFFSET] + piece[LENGTH]):
        if bond.i[k] >= 0 and limits.when[k] == np.inf:
            p = pair_of(bond, c, k)
            length = np.sqrt(p.x * p.x + p.y * p.y + p.z * p.z)
            fx, fy, fz = bond_force(bond.law, p)
            pull = -(fx * p.x + fy * p.y + fz * p.z)
            lost = lost_an_end(c.clock, bond.i[k], bond.j[k])
            if length - p.rest > limits.strain * p.rest or pull > limits.pull * length or lost <= t:
                limits.when[k] = min(lost, t)
                bond.k[k] = 0
                bond.c[k] = 0


def lost_an_end(clock: Any, i: Any, j: Any) -> Any:
    """When the first of two particles dies [s]."""
    return np.inf if clock is None else min(clock.stop[i], clock.stop[j])


@kernel
def sum_bonds(bond: Any, c: Any) -> float:
    """Potential energy of all bonds of a law [J]."""
    total = 0.0
    for k in range(bond.i.size):
        if bond.i[k] >= 0:
            total += bond_potential(bond.law, pair_of(bond, c, k))
    return total


@kernel
def damping_power(bond: Any, c: Any) -> float:
    """Power of the dampers of all bonds of a law [W]: what their force does beyond that of the springs."""
    total = 0.0
    for k in range(bond.i.size):
        if bond.i[k] >= 0:
            p = pair_of(bond, c, k)
            fx, fy, fz = bond_force(bond.law, p)
            gx, gy, gz = bond_force(bond.law, Pair(p.x, p.y, p.z, p.vx, p.vy, p.vz, p.k, p.c - p.c, p.rest))
            total += float(fx - gx) * p.vx + float(fy - gy) * p.vy + float(fz - gz) * p.vz
    return total


def springs_of(site: Site, bonds: BondSet) -> Bonds:
    """Springs with their ends in rows of the island, and constants in the precision of the run.

    Raises UsageError for those that cannot be, with their place in the scenario.
    """
    with site.scenario.at_springs(bonds.name):
        return _laid_out(site, bonds)


def _laid_out(site: Site, bonds: BondSet) -> Bonds:
    law = bonds.law
    states = [site.state[name] for name in bonds.groups]
    pairs = bonds.find(*(state.position.T.astype(float) for state in states))
    for end, state in enumerate(states):
        if pairs[:, end].max(initial=-1) >= state.count:
            raise UsageError(
                f"{bonds.name}: {state.name!r} has {state.count} particles, "
                f"there is no particle {int(pairs[:, end].max())}"
            )
    i, j = (pairs[:, end] + site.offset[state.name] for end, state in enumerate(states))
    x = site.whole.x.astype(float)
    rest = np.sqrt(((x[:, i] - x[:, j]) ** 2).sum(axis=0))
    if law.rest_length is not None:
        rest = np.full(len(pairs), law.rest_length)
    elif law.break_strain is not None and not rest.all():
        a, b = pairs[int(np.argmin(rest))]
        raise UsageError(
            f"{bonds.name}: particles {a} and {b} are at the same place; a strain needs a length to compare with",
            "give a rest_length, or break_force instead of break_strain",
        )
    k, c = law.constants(_reduced_mass(site, i, j))
    dtype = site.dtype
    slots = in_slots(i, j, chunk_size(site.whole.count))
    mortal = site.mortal(*bonds.groups)
    if law.by_mass or law.breaks or mortal:
        k, c = slots.spread(k.astype(dtype)), slots.spread(c.astype(dtype))
    else:
        k, c = dtype.type(law.stiffness), dtype.type(law.damping)
    breaking = roster = None
    if law.breaks or mortal:
        strain, pull = (dtype.type(np.inf if x is None else x) for x in (law.break_strain, law.break_force))
        breaking = Breaking(strain, pull, np.full(len(slots.i), np.inf))
    if mortal:
        number = slots.in_order(np.arange(len(i)), -1)
        ids, order = site.whole.id, slots.order
        listed = np.stack([ids[i[order]], ids[j[order]]], axis=1)
        roster = Roster(number, listed, rest[order], np.full(len(i), np.inf))
    return Bonds(
        record_of(law),
        slots.i,
        slots.j,
        k,
        c,
        slots.spread(rest.astype(dtype)),
        slots.holes,
        slots.table,
        np.empty(0, np.int64),
        breaking,
        roster,
    )


def _reduced_mass(site: Site, i: Ints, j: Ints) -> Floats:
    """m₁ m₂/(m₁ + m₂) of both ends [kg]; a pinned end is infinitely heavy, and of two pinned ends nothing moves."""
    inverse = site.inverse_mass()
    total = inverse[i] + inverse[j]
    return np.divide(1, total, out=np.zeros_like(total), where=total > 0)
