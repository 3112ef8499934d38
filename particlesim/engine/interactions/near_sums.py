"""Sums over the lists of near pairs, group by group: the columns that laws read, and the terms of a sum.

The eight members of a group are the lanes of vectors; its candidates follow one by one, in the order of the list.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from particlesim.compiler import atomic_add, lanes, on_stack, outlined
from particlesim.engine.interactions.neighbours.record import FAR, GROUP, IMAGE_SHIFT, MOST, NO_ROOM, TURN
from particlesim.engine.interactions.neighbours.search import AT_ONCE, BATCH, search, sieve
from particlesim.engine.interactions.pair_blocks import Block, energy_in, force_in, pair_of
from particlesim.engine.interactions.pair_matrix import block_terms
from particlesim.engine.state.columns import type_of


def members_of(each: Any, g: Any) -> Any:
    """The members of a group as a `Block`, None for what is not read."""
    first, x = GROUP * g, each.near.x
    rows = (x[0], x[1], x[2], *each.seen[3:])
    return Block(*[None if row is None else row[first : first + GROUP] for row in rows])


def lane(block: Any, i: Any) -> Any:
    """One member of a group as a `Block` of numbers."""
    x = block.x[i]
    numbers = [type_of(x, 0) if row is None else row[i] for row in block[:-1]]
    return Block(*(*numbers, None if block.id is None else block.id[i]))


def candidate(each: Any, entry: Any, shifted: Any) -> Any:
    """The place of a candidate, and what it is as a `Block` of numbers, at its image."""
    near = each.near
    q = entry & (MOST - 1) if shifted else entry
    x, y, z = near.x[0, q], near.x[1, q], near.x[2, q]
    if shifted:
        image = entry >> IMAGE_SHIFT
        x += type_of(x, near.images[0, image])
        y += type_of(x, near.images[1, image])
        z += type_of(x, near.images[2, image])
    seen = each.seen
    rest = [type_of(x, 0) if row is None else row[q] for row in seen[3:-1]]
    return q, Block(*(x, y, z, *rest, None if seen.id is None else seen.id[q]))


def groups_of(each: Any, share: Any) -> Any:
    """The groups that a thread takes where their work is known."""
    groups = each.near.begin.size
    return groups * share.number // share.threads, groups * (share.number + 1) // share.threads


class Summing(NamedTuple):
    """What is summed: an interaction, terms of a pair, the sums [terms, GROUP] of a group, the time, a `Push` or None."""

    each: Any
    terms: Any
    sums: Any
    t: Any
    push: Any


class IntoSums(NamedTuple):
    """Candidates that are in no list are added at once to the sums of their group; `entries`: their room."""

    what: Summing
    entries: Any

    def take(self, near: Any, g: Any, found: Any, number: Any, image: Any) -> None:
        """Add the terms of the candidates in some groups."""
        count = sieve(near, g, found, number, image, self.entries, 0)
        add_candidates(self.what, g, self.entries, 0, count)


def force_terms(each: Any, p: Any, counts: Any) -> Any:
    """Force on the first of a pair."""
    return force_in(each, p)


def energy_terms(each: Any, p: Any, counts: Any) -> Any:
    """Potential energy of a pair, if it counts."""
    return (energy_in(each, p, counts),)


def virial_terms(each: Any, p: Any, counts: Any) -> Any:
    """l ⊗ f of a pair, row by row."""
    f = force_in(each, p)
    return tuple(p.x * y for y in f) + tuple(p.y * y for y in f) + tuple(p.z * y for y in f)


def sum_group(each: Any, g: Any, terms: Any, sums: Any, t: Any, push: Any = None) -> None:
    """Sum up terms of the members of a group with all their candidates, into sums [terms, GROUP]; with a `Push` those of
    the matrix."""
    near, what = each.near, Summing(each, terms, sums, t, push)
    for k in range(sums.shape[0]):
        for i in lanes(GROUP):
            sums[k, i] = 0
    if near.count[g] == NO_ROOM:
        entries = on_stack(1, GROUP * BATCH, np.uint32)[0]
        search(near, g, IntoSums(what, entries))
    else:
        first = near.begin[g]
        add_candidates(what, g, near.candidates, first, first + near.count[g])


@outlined
def add_candidates(what: Any, g: Any, entries: Any, first: Any, last: Any) -> None:
    """Add the terms of candidates [first, last) of some entries with the members of a group to its sums."""
    # images come last
    if what.each.near.box is None or first == last or entries[last - 1] >> IMAGE_SHIFT == 0:
        _add(what, g, entries, first, last, False)
    else:
        _add(what, g, entries, first, last, True)


def _add(what: Any, g: Any, entries: Any, first: Any, last: Any, shifted: Any) -> None:
    each, terms, sums, t, push = what
    near, block, own = each.near, members_of(each, g), on_stack(sums.shape[0], GROUP, sums.dtype)
    rows, x = near.order[GROUP * g : GROUP * g + GROUP], block.x
    mine: Any = None if push is None else on_stack(3, GROUP, sums.dtype)
    if push is not None:
        for i in range(GROUP):
            for axis in range(3):
                mine[axis, i] = push.x[axis, max(rows[i], 0)]
    for k in range(own.shape[0]):
        for i in lanes(GROUP):
            own[k, i] = sums[k, i]
    for j in range(first, last):
        place, other = candidate(each, entries[j], shifted)
        part = None if near.part is None else near.part[place]
        row, there = near.order[place], other.x < FAR
        for i in lanes(GROUP):
            counts = (rows[i] != row) & (x[i] < FAR) & there
            p = pair_of(lane(block, i), other, t)
            if push is None:
                for k, term in enumerate(terms(each, p, counts)):
                    own[k, i] += term if part is None else part * term
            else:  # a matrix is symmetric: who is there for a part of the step counts fully
                u = tuple([mine[axis, i] - push.x[axis, max(row, 0)] for axis in range(3)])
                for k, term in enumerate(terms(each, p, counts, u, push.reach)):
                    own[k, i] += term
    for k in range(own.shape[0]):
        for i in lanes(GROUP):
            sums[k, i] = own[k, i]


@outlined
def pull_on(each: Any, g: Any, t: Any) -> None:
    """Sum up the forces on the members of a group."""
    sums = on_stack(3, GROUP, each.near.x.dtype)
    sum_group(each, g, force_terms, sums, t)
    for i in lanes(GROUP):
        for k in range(3):
            each.pull[GROUP * g + i, k] = sums[k, i]


def pull_all(each: Any, t: Any) -> None:
    """Sum up the forces on the members of all groups; the threads of an island take groups one after another."""
    groups = each.near.begin.size
    while True:
        first = atomic_add(each.near.report, TURN, AT_ONCE)
        if first >= groups:
            break
        for g in range(first, min(first + AT_ONCE, groups)):
            pull_on(each, g, t)


@outlined
def push_on(each: Any, form: Any, g: Any, terms: Any, push: Any, t: Any) -> None:
    """Sum up terms of the matrix for the members of a group."""
    if terms is block_terms:
        _push_on(each, form, g, terms, push, t, on_stack(9, GROUP, each.near.x.dtype))
    else:
        _push_on(each, form, g, terms, push, t, on_stack(3, GROUP, each.near.x.dtype))


def _push_on(each: Any, form: Any, g: Any, terms: Any, push: Any, t: Any, sums: Any) -> None:
    sum_group(each, g, terms, sums, t, push)
    for i in lanes(GROUP):
        for k in range(sums.shape[0]):
            form[GROUP * g + i, k] = sums[k, i]
