"""Which pairs of hard grains get impulses in a step: all that touch, and what is so near to each other that it may rest."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.interactions.hard.bench import COUNT, NEAR, WANTED, WIDE
from particlesim.engine.interactions.hard.laws import some_rest
from particlesim.engine.interactions.touching import touching
from particlesim.engine.state.columns import type_of

DEEP, NEIGHBOURS, AROUND = 0.05, 0.3, 1.2
"""Overlap at the end of a step, as a part of the smaller radius, from which on neighbours are listed, too, as what is moved
apart comes into them; the gap up to which they are, as a part of the smaller radius; and the sum of both radii with it, at
most, as a part of that sum."""


class Listed(NamedTuple):
    """Pairs of a table that touch, or may lie on each other, go to a list, each once; h: the step [s]; `beside`: the gap up
    to which others do, as a part of the smaller radius."""

    number: Any
    bench: Any
    report: Any
    h: Any
    beside: Any

    def take(self, each: Any, row: Any, other: Any, i: Any, p: Any) -> None:
        """Append a pair once, whatever the rows are by which the two are known at present, with the smaller one first."""
        change = self.bench.change
        margin = type_of(p.x, NEAR * self.h) * max(change[row], change[other])
        margin = max(margin, type_of(p.x, self.beside) * min(p.r1, p.r2))
        gap = np.sqrt(p.x * p.x + p.y * p.y + p.z * p.z) - p.r1 - p.r2
        if (each.near.place[row] < each.near.place[other]) & (gap < margin):
            k, sign = self.report[COUNT], type_of(p.x, 1 if row < other else -1)
            if k < self.bench.rows.shape[1]:
                self.bench.rows[0, k], self.bench.rows[1, k] = min(row, other), max(row, other)
                self.bench.table[k] = self.number
                self.bench.shift[0, k] = sign * p.x
                self.bench.shift[1, k] = sign * p.y
                self.bench.shift[2, k] = sign * p.z
            self.report[COUNT] = k + 1


def list_touching(tables: Any, each: Any, c: Any, before: Any, t: Any, h: Any) -> bool:
    """List all pairs that touch, and those so near to each other that they may be at rest, in the order of the lists;
    returns whether neighbours are among them, too.

    What lies on something is carried, with what it lies on, by rounding and by what turns have not found: without those that
    do not touch at this moment, others would fall into them.
    """
    note_changes(each, c, before)
    list_pairs(tables, each, h, 0.0, t, WIDE)
    crowded = some_rest(each.laws) and deepest(each, c) > DEEP
    if crowded:
        list_pairs(tables, each, h, NEIGHBOURS, t, AROUND)
    return crowded


def list_pairs(tables: Any, each: Any, h: Any, beside: Any, t: Any, wide: Any) -> None:
    """List all pairs at rest, or with gaps up to a part of the smaller radius, and up to `wide` times the sum of both."""
    each.report[COUNT] = 0
    for table in tables:
        if table.law.restitution < 1:
            list_table(table, each, h, beside, t, wide)
        else:  # elastic ones come to no rest, and need no neighbours
            list_table(table, each, 0.0, 0.0, t, wide)
    each.report[WANTED] = max(each.report[WANTED], each.report[COUNT])
    each.report[COUNT] = min(each.report[COUNT], each.bench.rows.shape[1])


@outlined
def list_table(table: Any, each: Any, h: Any, beside: Any, t: Any, wide: Any) -> None:
    """`list_pairs` for those of one table."""
    for g in range(table.near.begin.size):
        touching(table, g, Listed(table.rank, each.bench, each.report, h, beside), t, wide)


@outlined
def deepest(each: Any, c: Any) -> float:
    """The deepest overlap of pairs in the list, as a part of the smaller radius."""
    most, bench = 0.0, each.bench
    for k in range(each.report[COUNT]):
        i, j = bench.rows[0, k], bench.rows[1, k]
        # from one to the other: not yet what is to be added to that
        x, y, z = (float(bench.shift[axis, k]) for axis in range(3))
        least = float(min(c.r[i], c.r[j]))
        if least > 0:
            most = max(most, (float(c.r[i] + c.r[j]) - np.sqrt(x * x + y * y + z * z)) / least)
    return most


def smallest_radius(each: Any, c: Any) -> float:
    """The smallest radius of all pairs [m]."""
    least = np.inf
    for k in range(each.report[COUNT]):
        least = min(least, float(min(c.r[each.bench.rows[0, k]], c.r[each.bench.rows[1, k]])))
    return least


@outlined
def note_changes(each: Any, c: Any, before: Any) -> None:
    """By how much velocities have changed in the step, 0 where all contacts are elastic: there nothing rests."""
    change, rests = each.bench.change, some_rest(each.laws)
    for i in range(change.size):
        x, y, z = c.vx[i] - before[3, i], c.vy[i] - before[4, i], c.vz[i] - before[5, i]
        change[i] = np.sqrt(x * x + y * y + z * z) if rests else x - x
