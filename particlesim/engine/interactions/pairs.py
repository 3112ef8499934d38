"""Interactions of all pairs, summed directly: every particle looks at every other.

A thread sums the forces on its own particles from all sources, so nothing is shared for writing, and every sum runs over the
sources in their order: the same bits for any number of threads. Each pair is computed twice; its two forces are opposite to
rounding.

Targets are taken in blocks, each with its sums in vectors, and sources follow one by one: sums are vectorised without
changing their order. A block is always full, padded with copies at its beginning or end, and begins at a multiple of its
size, so that every particle has the same lane of a block, whichever thread sums its forces.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, lanes, much, on_stack, outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.coincident import refuse_coincident
from particlesim.engine.interactions.interaction import Floats, Interaction, Ints, Site
from particlesim.engine.interactions.pair_blocks import (
    BY_DIVIDER,
    FEW,
    TARGETS,
    energy_in,
    force_in,
    gathered,
    pair_in,
    particle_of,
)
from particlesim.engine.interactions.pair_matrix import (
    ROWS,
    multiply_direct,
    new_direct_form,
    stiffen_direct,
)
from particlesim.engine.interactions.pair_tensors import PairTensors, add_bounds, power_of, tensor_bounds
from particlesim.engine.state.columns import presence, type_of
from particlesim.engine.step.records import as_precision
from particlesim.errors import UsageError
from particlesim.graph.graph import methods_of
from particlesim.integrators import Method
from particlesim.interactions import PairInteraction, PairSet
from particlesim.laws.pair import pair_potential
from particlesim.laws.registry import has_law
from particlesim.model.vectors import square

MOST_LOOKED_AT = 50_000_000
"""Pairs that are looked at for the largest stable step: about a second; of more particles, some, evenly spread."""
WORTH_COMPILING = 100_000
"""Pairs from which `psim check`, too, compiles what looks at them: a second of plain Python."""
MOST_FEW = 16
"""Targets up to which blocks are narrow."""
PAIRS_PER_SPRING = 4
"""About how many pairs take as long as a spring."""


class Last(NamedTuple):
    """The last sum of forces, so that none is taken twice, as at the end of a step of a leapfrog and the beginning of the
    next: where particles were, and how fast if the law reads it, three or six of [n], the forces on them [3, n], and for
    every thread, on a cache line of its own, whether some of its particles have moved since."""

    seen: Any
    pull: Any
    moved: Any


class PairColumns(NamedTuple):
    """An interaction of pairs: the record of its law; `spans` [k, 4], first and last row of targets and of their sources;
    squares of the distances above which and below which it acts [m²], None where there is no such limit, the first 0 of a
    law without a value at one place, and the least number of one that has no direction there; what it keeps of
    every particle, [n], and ids, None where the law does not read them; how many pairs there are;
    periods of the box [m], None along axes that have none, None without a box; the `Last` sum, None where none is kept."""

    law: tuple[Any, ...]
    spans: Any
    least: Any
    most: Any
    a: Any
    b: Any
    ids: Any
    pairs: int
    box: Any = None
    last: Any = None


class DirectPairs(Interaction, PairColumns):
    """An interaction of all pairs, each of which is looked at in every sum of forces."""

    __slots__ = ()
    follows: ClassVar[frozenset[str]] = frozenset(PairColumns._fields)
    numbers: ClassVar[int] = ROWS
    prepares: ClassVar[bool] = True

    def stiffen(self, form: Any, c: Any, s: Any, first: Any, last: Any, t: Any, reach: Any) -> None:
        stiffen_direct(self, form, c, s, first, last, t, reach)

    def multiply(self, form: Any, x: Any, y: Any, first: Any, last: Any) -> None:
        multiply_direct(self, form, x, y, first, last)

    def new_form(self, dtype: Any) -> NDArray[Any]:
        return new_direct_form(self, dtype)

    def prepare(self, c: Any, share: Any, t: Any) -> None:
        if self.last is not None:
            kept = self.last
            kept.moved[8 * share.number] = has_moved(kept, c, share.first, share.last)
            meet(share.gate, share.threads)
            moved = False
            for k in range(share.threads):
                moved = moved | (kept.moved[8 * k] != 0)
            if moved:
                for i in range(share.first, share.last):
                    for axis in range(3):
                        kept.pull[axis, i] = 0
                sum_on(self, c, kept.pull, share.first, share.last, t)
            meet(share.gate, share.threads)

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        if self.last is None:
            sum_on(self, c, total, first, last, t)
        else:
            for axis in range(3):
                for i in range(first, last):
                    total[axis, i] += self.last.pull[axis, i]

    @property
    def number(self) -> int:
        return int(self.pairs)

    @property
    def effort(self) -> int:
        return 2 * self.number // PAIRS_PER_SPRING

    def in_team(self, threads: int) -> Self:
        if self.last is None:
            return self
        return self._replace(last=self.last._replace(moved=np.zeros(8 * threads, np.int64)))

    def energy(self, c: Any, t: float) -> float | None:
        return None if self.spends else float(sum_pairs(self, c))

    @property
    def spends(self) -> bool:
        return not has_law(pair_potential, self.law)

    def power(self, c: Any, t: float) -> float:
        return power_of(self, c, t)

    def virial(self, c: Any, t: float) -> Floats:
        """Σ l ⊗ f over all pairs [J], shape [3, 3]; the pressure that the forces make is its trace over 3 V."""
        out = np.zeros(9)
        virial_of_pairs(self, c._replace(clock=None), t, out)
        return out.reshape(3, 3)

    def linearise(self, c: Any, t: float) -> PairTensors:
        return PairTensors(self, c, t)

    def list_pairs(self, c: Any) -> tuple[Ints, Ints]:
        """Both ends of all pairs, each pair once, whether they are near or far."""
        found = [np.empty((2, 0), np.int64)]
        for a, b, first, last in self.spans.tolist():
            found.append(np.stack([part.ravel() for part in np.mgrid[a:b, first:last]]))
        i, j = np.concatenate(found, axis=1)
        once = i < j
        return i[once], j[once]

    def bounds(self, c: Any, w: Floats, t: float) -> tuple[Ints, Floats, Floats]:
        """Rows of particles that are looked at, and largest stiffness [1/s²] and damping [1/s] of each; w is 1/m."""
        n = len(w)
        stride = max(1, -(-2 * self.number // MOST_LOOKED_AT))
        rows = np.arange(0, n, stride)
        out = np.zeros((14, len(rows)))
        with much(n * len(rows) > WORTH_COMPILING):
            pair_bounds(self, c, w, rows, out, t)
        return rows, *tensor_bounds(out)

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        total = np.zeros((3, c.x.size), c.x.dtype)
        one_force(self, c, total, row, t)
        return np.asarray(total[:, row].astype(float))


def sum_on(each: Any, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
    """Sum up the forces on particles [first, last), and add them to total [3, n]."""
    for k in range(len(each.spans)):
        lowest, highest, source, end = (each.spans[k, j] for j in range(4))
        lo, hi = max(first, lowest), min(last, highest)
        if highest - lowest <= MOST_FEW:
            for start in range(lowest + (lo - lowest) // FEW * FEW, hi, FEW):
                add_few(each, c, total, start, lo, hi, source, end, t)
        else:
            for start in range(lo // TARGETS * TARGETS, hi, TARGETS):
                add_block(each, c, total, start, lo, hi, source, end, t)


def has_moved(kept: Any, c: Any, first: Any, last: Any) -> Any:
    """Whether particles [first, last) are not as in the last sum; from now on they are."""
    moved = False
    for seen, column in zip(kept.seen, (c.x, c.y, c.z, c.vx, c.vy, c.vz), strict=False):
        for i in range(first, last):
            moved = moved | (seen[i] != column[i])
            seen[i] = column[i]
    return moved


@outlined
def add_block(
    each: Any, c: Any, total: Any, start: Any, first: Any, last: Any, begin: Any, end: Any, t: Any
) -> None:
    """Add the forces of sources [begin, end) on those particles of the block from `start` that are among [first, last)."""
    _add_block(each, c, total, start, first, last, begin, end, t, TARGETS)


@outlined
def add_few(
    each: Any, c: Any, total: Any, start: Any, first: Any, last: Any, begin: Any, end: Any, t: Any
) -> None:
    """`add_block` for a narrow block."""
    _add_block(each, c, total, start, first, last, begin, end, t, FEW)


def _add_block(
    each: Any,
    c: Any,
    total: Any,
    start: Any,
    first: Any,
    last: Any,
    begin: Any,
    end: Any,
    t: Any,
    width: Any,
) -> None:
    """The forces on a block of `width` particles."""
    lo, hi = max(start, first), min(start + width, last)
    block, sums = gathered(each, c, start, lo, hi, width), on_stack(3, width, c.x.dtype)
    gx, gy, gz = sums[0], sums[1], sums[2]
    few = ((0, FEW, False),)
    many = ((0, BY_DIVIDER, False), (BY_DIVIDER, TARGETS - BY_DIVIDER, True))
    parts = few if width == FEW else many
    for i in lanes(width):
        gx[i] = gy[i] = gz[i] = 0
    for j in range(begin, end):
        part = type_of(gx[0], presence(c.clock, j))
        if part > 0:
            other = particle_of(each, c, j)
            for begins, number, by_products in parts:
                for lane in lanes(number):
                    i = begins + lane
                    fx, fy, fz = force_in(each, pair_in(block, i, other, t, by_products, each.box))
                    gx[i] += weighed(c.clock, part, fx)
                    gy[i] += weighed(c.clock, part, fy)
                    gz[i] += weighed(c.clock, part, fz)
    for i in range(lo, hi):
        total[0, i] += gx[i - start]
        total[1, i] += gy[i - start]
        total[2, i] += gz[i - start]


def weighed(clock: Any, part: Any, force: Any) -> Any:
    """The force of a particle that is there for a part of the step, 1 without a clock."""
    return force if clock is None else part * force


@kernel
def pair_bounds(each: Any, c: Any, w: Any, rows: Any, out: Any, t: Any) -> None:
    """`add_bounds` for some particles with all their sources, into out [14, rows]."""
    for q in range(rows.size):
        i = rows[q]
        for k in range(len(each.spans)):
            if each.spans[k, 0] <= i < each.spans[k, 1]:
                for j in range(each.spans[k, 2], each.spans[k, 3]):
                    if j != i and presence(c.clock, j) > 0:
                        add_bounds(each, c, w, i, j, t, out[:, q])


@kernel
def one_force(each: Any, c: Any, total: Any, row: Any, t: Any) -> None:
    """Add the force on a single particle."""
    sum_on(each, c, total, row, row + 1, t)


@outlined
def block_energy(each: Any, c: Any, lo: Any, hi: Any, begin: Any, end: Any) -> Any:
    """Potential energy of particles [lo, hi), at most a block of them, with sources [begin, end) [J]."""
    block, sums = gathered(each, c, lo, lo, hi), on_stack(1, TARGETS, np.float64)
    u = sums[0]
    for i in range(TARGETS):
        u[i] = 0
    for j in range(begin, end):
        other = particle_of(each, c, j)
        for i in lanes(TARGETS):
            u[i] += float(energy_in(each, pair_in(block, i, other, 0.0, False, each.box), lo + i != j))
    total = 0.0
    for i in range(hi - lo):
        total += u[i]
    return total


@kernel
def sum_pairs(each: Any, c: Any) -> float:
    """Potential energy of all pairs [J]: that of all targets with their sources counts every pair twice."""
    total = 0.0
    for k in range(len(each.spans)):
        first, last, begin, end = each.spans[k, 0], each.spans[k, 1], each.spans[k, 2], each.spans[k, 3]
        for lo in range(first, last, TARGETS):
            total += block_energy(each, c, lo, min(lo + TARGETS, last), begin, end)
    return 0.5 * total


@outlined
def add_virial(each: Any, c: Any, lo: Any, hi: Any, begin: Any, end: Any, t: Any, out: Any) -> None:
    """Add half of Σ l ⊗ f of particles [lo, hi), at most a block of them, with sources [begin, end) to out [9]."""
    block, sums = gathered(each, c, lo, lo, hi), on_stack(9, TARGETS, np.float64)
    for k in range(9):
        for i in range(TARGETS):
            sums[k, i] = 0
    for j in range(begin, end):
        other = particle_of(each, c, j)
        for i in lanes(TARGETS):
            p = pair_in(block, i, other, t, False, each.box)
            for row, length in enumerate((p.x, p.y, p.z)):
                for column, force in enumerate(force_in(each, p)):
                    sums[3 * row + column, i] += float(length * force)
    for k in range(9):
        for i in range(hi - lo):
            out[k] += 0.5 * sums[k, i]


@kernel
def virial_of_pairs(each: Any, c: Any, t: Any, out: Any) -> None:
    """Σ l ⊗ f over all pairs [J], into out [9]."""
    for k in range(len(each.spans)):
        first, last, begin, end = each.spans[k, 0], each.spans[k, 1], each.spans[k, 2], each.spans[k, 3]
        for lo in range(first, last, TARGETS):
            add_virial(each, c, lo, min(lo + TARGETS, last), begin, end, t, out)


def pairs_of(site: Site, pairs: PairSet, *, again: bool = True) -> DirectPairs:
    """An interaction among the particles of an island; `again` if the last sum of forces is worth to be kept.

    Raises UsageError for two at one place, if they have no force there.
    """
    law = pairs.law
    spans = spans_of(site, pairs)
    if law.singular() and site.began:
        with site.scenario.at_interaction(pairs.name):
            refuse_coincident(site, pairs)
    number = sum((b - a) * (d - c) for a, b, c, d in spans.tolist()) // 2
    if pairs.law.between is None:
        number -= sum(site.state[name].count for name in pairs.groups) // 2
    again = again and not (law.random() or law.changes() or site.whole.clocked)
    again = again and method_among(site, pairs).revisits
    kept = None if not again else new_last(law, site.whole.count, site.dtype)
    return DirectPairs(*(*what_acts(site, pairs, spans), number, periods_of(site, pairs), kept))


def method_among(site: Site, pairs: PairSet) -> Method:
    """The method that steps the particles of an interaction, the same for all."""
    return methods_of(site.scenario)[pairs.groups[0]]


def new_last(law: PairInteraction, count: int, dtype: Any) -> Last:
    """Room for the last sum of so many particles, which are nowhere yet."""
    seen = tuple(np.full(count, np.nan, dtype) for _ in range(6 if law.needs_velocity() else 3))
    return Last(seen, np.zeros((3, count), dtype), np.zeros(8, np.int64))


def what_acts(site: Site, pairs: PairSet, spans: Any) -> tuple[Any, ...]:
    """The columns of an interaction that say what acts, from `law` to `ids`, however its forces are summed."""
    law, dtype, grid = pairs.law, site.dtype, site.scenario.grid
    record = as_precision(law.in_steps(grid.dt, site.scenario.simulation.seed), dtype)
    reach = law.reach()
    least = None if _acts_at_once(law, dtype) else dtype.type(0 if law.singular() else np.finfo(dtype).tiny)
    with np.errstate(over="ignore"):  # an infinite one cuts nothing
        most = None if reach is None else dtype.type(square(reach))
    own = np.zeros((2, site.whole.count), dtype)
    for name in pairs.groups:
        first, count = site.offset[name], site.state[name].count
        own[:, first : first + count] = np.array(law.numbers_of(name))[:, None]
    a, b = own if own.any() else (None, None)
    # those of laws that are new at every sum, too: the sums of these are never kept
    ids = site.whole.id[: site.whole.count] if law.random() or law.changes() else None
    return record, spans, least, most, a, b, ids


def _acts_at_once(law: PairInteraction, dtype: np.dtype[Any]) -> bool:
    """Whether a law and its derivatives have values at one place, as where a sum meets the particle itself.

    A softening must keep them within the numbers of a precision: ε⁻⁵, or ε⁻ⁿ⁻³ of a power law. What is taken off for a
    force of 0 at the cutoff has no direction there.
    """
    softening = dtype.type(getattr(law, "softening", 1.0))
    with np.errstate(all="ignore"):
        finite = bool(np.isfinite(dtype.type(1) / softening ** (getattr(law, "exponent", 2.0) + 3)))
    return law.everywhere() and finite and law.shift != "force"


def periods_of(site: Site, pairs: PairSet) -> tuple[float | None, ...] | None:
    """Periods of the box [m], None along axes that have none; None without a box.

    Raises UsageError where particles that touch are too large for the nearest image to be enough.
    """
    box = site.scenario.simulation.box
    if box is None:
        return None
    periods = box.as_box().periods
    shortest = min(each for each in periods if each is not None)
    if pairs.law.touching():
        radii = [site.state[name].attribute("radius") for name in pairs.groups]
        largest = max((float(each.max()) for each in radii if len(each)), default=0.0)
        if 2 * largest > shortest / 2:
            with site.scenario.at_interaction(pairs.name):
                raise UsageError(
                    f"{pairs.name}: particles with a radius of {largest:g} m touch over more than half of the box",
                    f"radii up to {shortest / 4:g} m, or a larger box",
                )
    return periods


def spans_of(site: Site, pairs: PairSet) -> Any:
    """Rows of targets and of their sources, shape [k, 4]; groups that follow on each other are one stretch."""
    stretches = [
        (site.offset[name], site.offset[name] + site.state[name].count)
        for name in sorted(pairs.groups, key=site.offset.__getitem__)
    ]
    if pairs.law.between is not None:
        (a, b), (c, d) = stretches
        return np.array([(a, b, c, d), (c, d, a, b)], np.int64)
    joined: list[tuple[int, int]] = []
    for first, last in stretches:
        if joined and joined[-1][1] == first:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return np.array([(*targets, *sources) for targets in joined for sources in joined], np.int64)
