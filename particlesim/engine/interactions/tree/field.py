"""The field of all particles at all particles, by all threads of a share together."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import atomic_add, kernel, outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.tree.cells import (
    Cells,
    Sorted,
    build,
    count_cells,
    generations,
    new_cells,
    room_for_wide,
    sum_up,
    weigh,
)
from particlesim.engine.interactions.tree.direct import TARGETS
from particlesim.engine.interactions.tree.form import (
    Form,
    Height,
    field_columns,
    in_box,
    moment_columns,
    order_of,
)
from particlesim.engine.interactions.tree.morton import key
from particlesim.engine.interactions.tree.sorting import Keys, new_keys, sort
from particlesim.engine.interactions.tree.walk import Given, Limits, Room, forget_walk, new_room, walk

LEAF = 56
"""Most particles of a leaf, but for those that all have one key."""
_CHUNK = 4096
"""Particles whose sums are made one after the other."""
PARTICLES_PER_CELL = 8
"""Room is for one cell for so many particles, about twice as many as there are. Without room, leaves stay larger: that is
slower, and as exact."""
_TASKS = 128
"""Parts that the walk is cut into, for threads to take one after another."""
_TASK, _TASK_OF_FEW, _FEW_TASKS = 2048, 256, 40
"""Fewest particles of a part; and of one of a few parts, for threads to share few particles evenly."""
_APART = 8
"""Numbers of a line of memory: threads that write side by side would wait for each other."""
FIRST_OPENING = 0.5
"""Widest opening while the size of the field is not known yet."""
RIM = 16.0
"""The largest error that the width of a leaf may make, over the accuracy: few leaves are so wide, and few corners taken."""
LEAST_NEED = 1e-3
"""Errors are relative to the field, or to this part of its mean where that is more."""
FULL = 0
"""Place in `report`: 1 if there was no room for all cells."""


class Tree(NamedTuple):
    """All that a field is computed with, for a number of particles and of threads; nothing in it outlives an evaluation but
    its results."""

    form: Form
    keys: Keys
    sorted: Sorted
    cells: Cells
    room: Room
    borders: NDArray[np.float64]
    """[threads, 8]: smallest and largest coordinates."""
    chunks: NDArray[np.float64]
    """[3, chunks]: sums of |field| over chunks of particles, of how many feel it, and of |w|."""
    next: NDArray[np.int64]
    """[threads · _APART]: how many of its parts of the walk are taken, in a line of memory of its own for each thread."""
    report: NDArray[np.int64]
    field: NDArray[np.float64]
    """[3, n]: ∇ Σ w f at every particle, of all others."""
    height: NDArray[np.float64] | None
    """[n]: Σ w f of all others."""


def new_tree(form: Form, count: int, threads: int) -> Tree:
    """Arrays for so many particles; no results yet."""
    room = count // PARTICLES_PER_CELL + room_for_wide(count) + 64
    return Tree(
        form,
        new_keys(count, threads),
        Sorted(*(np.zeros(count + TARGETS) for _ in Sorted._fields)),
        new_cells(room + 1, moment_columns(form)[-1]),
        new_room(threads, room, field_columns(form)[-1]),
        np.zeros((threads, 8)),
        np.zeros((3, -(-count // _CHUNK))),
        np.zeros(_APART * threads, np.int64),
        np.zeros(8, np.int64),
        np.zeros((3, count)),
        np.zeros(count) if isinstance(form.wanted, Height) else None,
    )


def with_height(tree: Tree) -> tuple[Tree, NDArray[np.float64]]:
    """The same for Σ w f, too, which takes another number of every polynomial, with results of its own; and those."""
    form, count, cells = tree.form._replace(wanted=Height()), tree.field.shape[1], len(tree.cells.span) - 1
    room, height = new_room(1, cells, field_columns(form)[-1]), np.zeros(count)
    return tree._replace(form=form, room=room, height=height, field=np.zeros((3, count))), height


def for_threads(tree: Tree, threads: int) -> Tree:
    """The same for another number of threads: what each has to itself is new."""
    cells = tree.cells.span.shape[0] - 1
    return tree._replace(
        keys=tree.keys._replace(counts=new_keys(0, threads).counts),
        room=new_room(threads, cells, tree.room.fields.shape[2]),
        borders=np.zeros((threads, 8)),
        next=np.zeros(_APART * threads, np.int64),
    )


def sum_field(tree: Any, limits: Any, size: Any, x: Any, y: Any, z: Any, w: Any, share: Any) -> None:
    """Set the field at all particles, of all others; all threads of the share call it, and it is there when it returns.

    `w`: the sources; `limits`: how much error is allowed (`walk.limits_of`); `size`: the length of the field at every
    particle as it was before, which tells what an error means, and is set anew. Where all of it is 0, a first field by
    angles alone is found beforehand.
    """
    count = x.size
    if count == 0:  # before the first birth, and after the last death
        return
    first, last = count * share.number // share.threads, count * (share.number + 1) // share.threads
    lo, side_length = _enclose(tree, x, y, z, first, last, share)
    side = _order(tree, x, y, z, first, last, lo, 1 / side_length, share)
    known, total = _mean(size, w, tree.chunks, share)
    unit = 1 / (side_length * side_length)
    _load(tree, size, x, y, z, w, side, first, last, lo, 1 / side_length, known, share)
    if share.number == 0:
        wide = widest_leaf(order_of(tree.form), limits[3]) * total
        if not build(tree.keys.key[side], tree.sorted.need, count, LEAF, wide, tree.cells):
            tree.report[FULL] = 1
        _empty_cell(tree.cells)
    meet(share.gate, share.threads)
    form = in_box(tree.form, 1 / side_length)
    _from_leaves(tree, sum_up, share)
    if known == 0:
        by_angle = Limits(np.inf, FIRST_OPENING * FIRST_OPENING, 1.0)
        _walk_all(tree, form, by_angle, size, side, unit, 1 / side_length, share)
        known, _ = _mean(size, w, tree.chunks, share)
        _load_needs(tree, size, w, side, first, last, unit, known, share)
        _from_leaves(tree, weigh, share)
    _walk_all(tree, form, Limits(limits[0], limits[1], limits[2]), size, side, unit, 1 / side_length, share)


def widest_leaf(order: int, accuracy: Any) -> Any:
    """The square of the side of a cell over that of the distance of its sources from which it is too wide for an order.

    At its corners the polynomial of a cell of radius ρ is wrong by about (p + 1) (ρ/r)^p of the field of sources at r. Small
    sources make small errors, so the walk takes them for far; but errors of the many in the middle of a set have one sign in
    a cell at its rim, and do not cancel. There the field is g ≈ M/r², and cells are cut until that is RIM times the
    accuracy.
    """
    return 4 / 3 * np.exp(np.log(RIM * accuracy / (order + 1)) * (2 / order))


def _from_leaves(tree: Any, work: Any, share: Any) -> None:
    """Do work on all cells, generation after generation from the last to the first."""
    generation = generations(tree.cells)
    while generation > 0:
        generation -= 1
        begin = tree.cells.begins[generation]
        number = tree.cells.begins[generation + 1] - begin
        work(
            tree.form,
            tree.cells,
            tree.sorted,
            begin + number * share.number // share.threads,
            begin + number * (share.number + 1) // share.threads,
        )
        meet(share.gate, share.threads)


@outlined
def _enclose(tree: Any, x: Any, y: Any, z: Any, first: Any, last: Any, share: Any) -> Any:
    """The lowest corner and the side of a cube that holds all particles."""
    mine = tree.borders[share.number]
    for k, column in enumerate((x, y, z)):
        least, most = float(column[0]), float(column[0])
        for i in range(first, last):
            least = min(least, float(column[i]))
            most = max(most, float(column[i]))
        mine[k] = least
        mine[3 + k] = most
    meet(share.gate, share.threads)
    low, high = (np.inf, np.inf, np.inf), (-np.inf, -np.inf, -np.inf)
    for thread in range(share.threads):
        row = tree.borders[thread]
        low = (min(low[0], row[0]), min(low[1], row[1]), min(low[2], row[2]))
        high = (max(high[0], row[3]), max(high[1], row[4]), max(high[2], row[5]))
    side = max(high[0] - low[0], high[1] - low[1], high[2] - low[2])
    return low, side if side > 0 else 1.0


@outlined
def _order(tree: Any, x: Any, y: Any, z: Any, first: Any, last: Any, lo: Any, scale: Any, share: Any) -> Any:
    """Sort the particles along the curve; returns which side of `keys` has them."""
    keys, index = tree.keys.key[0], tree.keys.rows[0]
    for i in range(first, last):
        keys[i] = key((x[i] - lo[0]) * scale, (y[i] - lo[1]) * scale, (z[i] - lo[2]) * scale)
        index[i] = i
    return sort(tree.keys, first, last, share)


@outlined
def _mean(size: Any, w: Any, chunks: Any, share: Any) -> Any:
    """The mean size of the field where there is something to feel it, 0 if nowhere, and Σ |w|, in an order of their own."""
    number = chunks.shape[1]
    for chunk in range(number * share.number // share.threads, number * (share.number + 1) // share.threads):
        total, number_here, strength = 0.0, 0.0, 0.0
        for i in range(chunk * _CHUNK, min((chunk + 1) * _CHUNK, size.size)):
            feels = w[i] != 0
            total += size[i] if feels else 0.0
            number_here += 1.0 if feels else 0.0
            strength += abs(w[i])
        chunks[0, chunk] = total
        chunks[1, chunk] = number_here
        chunks[2, chunk] = strength
    meet(share.gate, share.threads)
    sum_all, number_all, strength_all = 0.0, 0.0, 0.0
    for chunk in range(number):
        sum_all += chunks[0, chunk]
        number_all += chunks[1, chunk]
        strength_all += chunks[2, chunk]
    meet(share.gate, share.threads)
    return sum_all / max(number_all, 1.0), strength_all


@outlined
def _load(
    tree: Any,
    size: Any,
    x: Any,
    y: Any,
    z: Any,
    w: Any,
    side: Any,
    first: Any,
    last: Any,
    lo: Any,
    scale: Any,
    known: Any,
    share: Any,
) -> None:
    """Copy the particles in the order of the curve, in units of the box."""
    s, index = tree.sorted, tree.keys.rows[side]
    for i in range(first, last):
        j = index[i]
        s.x[i] = (x[j] - lo[0]) * scale
        s.y[i] = (y[j] - lo[1]) * scale
        s.z[i] = (z[j] - lo[2]) * scale
        s.w[i] = w[j]
    _load_needs(tree, size, w, side, first, last, scale * scale, known, share)


@outlined
def _load_needs(
    tree: Any, size: Any, w: Any, side: Any, first: Any, last: Any, unit: Any, known: Any, share: Any
) -> None:
    """1/g² by the field that is known, g in units of the box; 0 where nothing feels it."""
    index, need = tree.keys.rows[side], tree.sorted.need
    least = LEAST_NEED * known
    for i in range(first, last):
        g = max(size[index[i]], least) / unit
        need[i] = 1 / (g * g) if (g > 0) & (w[index[i]] != 0) else 0.0
    meet(share.gate, share.threads)


def _empty_cell(cells: Any) -> None:
    """The cell after the last: far from everything, and without sources."""
    c = count_cells(cells)
    cells.span[c] = 0
    cells.moments[c] = 0.0
    for k in range(3):
        cells.place[c, k] = 9.0


def _walk_all(
    tree: Any, form: Any, limits: Any, size: Any, side: Any, unit: Any, scale: Any, share: Any
) -> None:
    """The sums of all particles: threads take parts of the walk one after another."""
    given = Given(tree.keys.rows[side], tree.field, size, tree.height, unit, scale)
    room = Room(*(each[share.number] for each in tree.room))
    count = size.size
    parts = min(_TASKS, max(count // _TASK, min(count // _TASK_OF_FEW, _FEW_TASKS)) + 1)
    forget_walk(room)
    for turn in range(share.threads):  # its own parts, side by side, then what others have left
        owner = (share.number + turn) % share.threads
        begin, end = parts * owner // share.threads, parts * (owner + 1) // share.threads
        part = begin + atomic_add(tree.next, _APART * owner, 1)
        while part < end:
            walk(
                form,
                tree.cells,
                tree.sorted,
                limits,
                room,
                count * part // parts,
                count * (part + 1) // parts,
                given,
            )
            part = begin + atomic_add(tree.next, _APART * owner, 1)
    meet(share.gate, share.threads)
    tree.next[_APART * share.number] = 0
    meet(share.gate, share.threads)


class Hand(NamedTuple):
    """The thread: as much of `coupled.workspace.Share` as is needed here."""

    number: int
    threads: int
    gate: NDArray[np.int64]


@kernel
def field_of_all(tree: Any, limits: Any, size: Any, x: Any, y: Any, z: Any, w: Any, share: Any) -> None:
    """`sum_field`, to be called by each thread of a team."""
    sum_field(tree, limits, size, x, y, z, w, share)
