"""The walk down the tree of targets, which finds the cells that act on each cell by their moments.

Every target cell inherits the source cells that are not far from its parent. Those that are far from it act through their
moments; of any other pair the larger cell is opened, until leaves meet leaves. What a cell receives depends on its own
ancestors alone, so threads write no common data, and a sum does not depend on the thread that computes it.

Far is what makes a small error (Dehnen 2014). With p the order, a source cell of strength S and reach ρ_A at distance r
puts into the field at a target cell of radius ρ_B an error of about

    e = S (p + 1) (ρ_A + ρ_B)^p / r^(p+2),

the first terms that are cut off; S ρ_Aⁿ is about the norm of its moments of degree n. A pair is far if e is less than the
tolerance times the size that the field has on the particles of the target, and if the series converges: the sum of the
radii is less than r. With softening, r² becomes r² + ε².

Source: W. Dehnen, "A fast multipole method for stellar dynamics", Comput. Astrophys. Cosmol. 1 (2014) 1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import on_stack, outlined, transpose
from particlesim.compiler.intrinsics import BLOCK
from particlesim.engine.interactions.tree.cells import (
    CHILD,
    CHILDREN,
    FIRST,
    GENERATIONS,
    LAST,
    NEED,
    RADIUS,
    REACH,
    STRENGTH,
    X,
    Y,
    Z,
    count_cells,
)
from particlesim.engine.interactions.tree.direct import (
    FEW,
    SLIM,
    SOURCES,
    TARGETS,
    WIDE,
    add_near,
    add_near_to_few,
    pair,
    vectors_for,
)
from particlesim.engine.interactions.tree.expansions import (
    add_lanes,
    chain,
    derivatives,
    field_numbers,
    field_shifted,
    put,
    taken,
)
from particlesim.engine.interactions.tree.form import (
    field_columns,
    first_degree,
    in_blocks,
    moment_columns,
    order_of,
    root_order,
    softening_reach,
    softening_square,
)
from particlesim.engine.interactions.tree.indices import columns, pieces

PAIRS_FOR_MOMENTS = 0.4
"""How many vectors of pairs cost as much as one cell that acts by its moments, over the square of the order."""


class Room(NamedTuple):
    """Where a thread notes the lists of its walk; [threads, …] for all of them.

    A cell is at most once in a list, so that as many places as cells are enough.
    """

    lists: NDArray[np.int32]
    """[threads, generations + 5, cells + 2 BLOCK]: by generation the sources that its cell hands down; then far, near, not
    far, to be tested, and whether each is far."""
    fields: NDArray[np.float64]
    """[threads, generations, numbers]: the polynomials of the cells that the walk is in."""
    stack: NDArray[np.int64]
    """[threads, 4, 8 generations]: cells to come and their generations; by generation the cell that the walk is in, and how
    many sources its parent has handed down."""
    done: NDArray[np.int64]
    """[threads, 8]: far pairs of cells, pairs of particles, tests."""


class Limits(NamedTuple):
    """What is far."""

    square: float
    """The square of the tolerance: the largest error of a pair of cells relative to the field."""
    widest: float
    """The square of the largest sum of radii over distance."""
    target: float
    """The square of the largest radius of a target over distance."""


class Given(NamedTuple):
    """Where the sums of the sorted particles go."""

    rows: NDArray[np.int32]
    """Which particle each is."""
    field: NDArray[np.float64]
    """[3, n]: gradient of Σ w f."""
    size: NDArray[np.float64]
    """[n]: its length."""
    height: NDArray[np.float64] | None
    """[n]: Σ w f, where it is wanted."""
    scale: float
    """What makes gradients in the unit box those of the world."""
    height_scale: float


def new_room(threads: int, cells: int, numbers: int) -> Room:
    """Room for the walks of threads through so many cells."""
    return Room(
        np.zeros((threads, GENERATIONS + 5, cells + 2 * BLOCK), np.int32),
        np.zeros((threads, GENERATIONS + 1, in_blocks(numbers))),
        np.zeros((threads, 4, 8 * GENERATIONS + 8), np.int64),
        np.zeros((threads, 8), np.int64),
    )


FAR, NEAR, REST, WORK = GENERATIONS + 1, GENERATIONS + 2, GENERATIONS + 3, GENERATIONS + 4
TO_COME, DEPTHS, WITHIN, HANDED = 0, 1, 2, 3


@outlined
def walk(form: Any, cells: Any, s: Any, limits: Any, room: Any, first: Any, last: Any, given: Any) -> None:
    """All sums for the leaves that begin among the sorted particles [first, last).

    `limits`: tolerance and widest opening; `given`: where the sums go. What the room holds of cells that the walk before was
    in, too, is taken from there (`forget_walk`).
    """
    span, stack = cells.span, room.stack
    stack[TO_COME, 0] = 0
    stack[DEPTHS, 0] = 0
    room.lists[0, 0] = 0
    waiting = 1
    stack[HANDED, 0] = 1
    while waiting > 0:
        waiting -= 1
        b, depth = stack[TO_COME, waiting], stack[DEPTHS, waiting]
        leaf = span[b, CHILDREN] == 0
        if stack[WITHIN, depth] != b and (not leaf or first <= span[b, FIRST]):
            stack[WITHIN, depth] = b
            _inherit(form, cells, room, b, depth)
            near, kept = _settle(form, cells, limits, room, b, depth, stack[HANDED, depth])
            if leaf:
                _finish(form, cells, s, room, b, depth, near, given)
            else:
                stack[HANDED, depth + 1] = kept
        if not leaf:
            child = span[b, CHILD] + span[b, CHILDREN]
            while child > span[b, CHILD]:
                child -= 1
                if span[child, FIRST] < last and span[child, LAST] > first:
                    stack[TO_COME, waiting] = child
                    stack[DEPTHS, waiting] = depth + 1
                    waiting += 1


def forget_walk(room: Any) -> None:
    """Before the first walk of a thread through new cells: it is in none."""
    room.stack[WITHIN] = -1


@outlined
def _inherit(form: Any, cells: Any, room: Any, b: Any, depth: Any) -> None:
    """The polynomial of the parent about the centre of its child."""
    row = room.fields[depth]
    if depth == 0:
        row[:] = 0.0
    else:
        begins, place, parent = field_columns(form), cells.place, room.stack[WITHIN, depth - 1]
        v = (place[b, X] - place[parent, X], place[b, Y] - place[parent, Y], place[b, Z] - place[parent, Z])
        field = taken(room.fields[depth - 1], begins)
        put(row, begins, field_shifted(field, v, first_degree(form), order_of(form)))


def _settle(form: Any, cells: Any, limits: Any, room: Any, b: Any, depth: Any, count: Any) -> Any:
    """Settle what can be settled of the sources that a cell has been handed; how many are near, and how many kept for its
    children."""
    span, place, lists = cells.span, cells.place, room.lists
    leaf = span[b, CHILDREN] == 0
    radius = place[b, RADIUS]
    far, near, rest = lists[FAR], lists[NEAR], lists[REST]
    fars, nears, kept = 0, 0, 0
    work = depth
    while count > 0:
        room.done[2] += count
        split = _test(form, place, limits, lists[work], count, b, far, fars, rest)
        fars += split
        others = count - split
        count = 0
        work = WORK
        for i in range(others):
            a = rest[i]
            if span[a, CHILDREN] > 0 and (leaf or place[a, RADIUS] > radius):
                for child in range(span[a, CHILD], span[a, CHILD] + span[a, CHILDREN]):
                    lists[WORK, count] = child
                    count += 1
            elif leaf:
                near[nears] = a
                nears += 1
            else:
                lists[depth + 1, kept] = a
                kept += 1
    if leaf:
        fars, nears = _few_to_near(form, span, far, fars, near, nears, span[b, LAST] - span[b, FIRST])
    if fars > 0:
        room.done[0] += fars
        empty = count_cells(cells)
        for i in range(fars, fars + BLOCK):
            far[i] = empty
        _act(form, cells, far, fars, b, room.fields[depth])
    return nears, kept


def _few_to_near(form: Any, span: Any, far: Any, fars: Any, near: Any, nears: Any, targets: Any) -> Any:
    """Of the far cells those of so few particles that pairs cost a leaf of so many less than moments go to the near ones;
    how many are far, and how many near."""
    most = int(order_of(form) ** 2 * PAIRS_FOR_MOMENTS / vectors_for(targets))
    left = 0
    for i in range(fars):
        a = far[i]
        few = span[a, LAST] - span[a, FIRST] <= most
        near[nears] = a
        far[left] = a
        nears += 1 if few else 0
        left += 0 if few else 1
    return left, nears


@outlined
def _test(
    form: Any, place: Any, limits: Any, work: Any, count: Any, b: Any, far: Any, begin: Any, rest: Any
) -> Any:
    """Append the far ones of `work` to `far`, which has `begin`, and put the others into `rest`; returns how many are
    far."""
    order = order_of(form)
    x, y, z, radius = place[b, X], place[b, Y], place[b, Z], place[b, RADIUS]
    soft, clear = softening_square(form), softening_reach(form)
    need = place[b, NEED]
    scale = float((order + 1) * (order + 1)) * need / limits.square
    wide = limits.widest
    nearest = radius * radius / limits.target
    fars, others = 0, 0
    for i in range(count):
        a = work[i]
        dx, dy, dz = place[a, X] - x, place[a, Y] - y, place[a, Z] - z
        d2 = dx * dx + dy * dy + dz * dz
        r2 = d2 + soft
        both = place[a, RADIUS] + radius
        reach = place[a, REACH] + radius
        t = reach * reach
        e2 = scale * place[a, STRENGTH] * place[a, STRENGTH] * t**order
        is_near = (both * both >= wide * r2) | (nearest >= r2) | (e2 >= r2 ** (order + 2))
        is_far = not (is_near | ((both + clear) * (both + clear) > r2))
        far[begin + fars] = a
        rest[others] = a
        fars += 1 if is_far else 0
        others += 0 if is_far else 1
    return fars


@outlined
def _act(form: Any, cells: Any, far: Any, count: Any, b: Any, row: Any) -> None:
    """Add what far cells do to the polynomial of cell b, as many at a time as fit into a vector; the list ends in as
    many empty ones."""
    order, into, begins = order_of(form), field_columns(form), moment_columns(form)
    place, moments = cells.place, cells.moments
    width, height = in_blocks(begins[-1]), in_blocks(into[-1])
    places, source = on_stack(BLOCK, BLOCK, np.float64), on_stack(width, BLOCK, np.float64)
    lines = columns(0, order)
    sums, slopes = on_stack(height, BLOCK, np.float64), on_stack(lines[-1], BLOCK, np.float64)
    for k in range(height):
        for lane in range(BLOCK):
            sums[k, lane] = 0.0
    x, y, z = place[b, X], place[b, Y], place[b, Z]
    soft = softening_square(form)
    for at in range(0, count, BLOCK):
        some = tuple(far[at + lane] for lane in range(BLOCK))
        transpose(place, some, 0, places, 0)
        for k in range(0, width, BLOCK):
            transpose(moments, some, k, source, k)
        for lane in range(BLOCK):
            v = (x - places[X, lane], y - places[Y, lane], z - places[Z, lane])
            d = derivatives(v, chain(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + soft, order))
            put(slopes[:, lane], lines, d)
        for n, chosen in pieces(first_degree(form), order):
            for lane in range(BLOCK):
                d, m = taken(slopes[:, lane], lines), taken(source[:, lane], begins)
                for k, number in zip(chosen, field_numbers(m, d, n, chosen, order), strict=True):
                    sums[into[n] + k, lane] += number
    add_lanes(row, sums)


def _finish(form: Any, cells: Any, s: Any, room: Any, b: Any, depth: Any, near: Any, given: Any) -> None:
    """The sums of the particles of a leaf, given away."""
    span = cells.span
    first, last = span[b, FIRST], span[b, LAST]
    out = on_stack(4, TARGETS, np.float64)
    row, runs, ends = room.fields[depth], room.lists[NEAR], room.lists[REST]
    place = cells.place[b]
    alone, _ = pair(form.softening, 0.0, root_order(form))
    # Softened, a cell may be far from itself or from one around it: then particles are in their own potential.
    own = 0.0 if _holds(span, runs, near, first) else alone
    room.done[1] += (last - first) * _particles(span, runs, near)
    number = _runs(span, runs, ends, near)
    if place[RADIUS] == 0 and last - first > TARGETS:
        # Many in one place feel the same, but for their own potential.
        add_near(form, s, runs, ends, number, first, place, row, out, WIDE)
        whole = out[3, 0] + s.w[first] * (alone - own)
        for lane in range(1, TARGETS):
            for k in range(3):
                out[k, lane] = out[k, 0]
        for at in range(first, last, TARGETS):
            for lane in range(TARGETS):
                out[3, lane] = whole - s.w[at + lane] * alone
            hand_over(given, out, at, min(at + TARGETS, last))
    else:
        at = first
        while at < last:
            left = last - at
            if left > FEW + SOURCES:
                add_near(form, s, runs, ends, number, at, place, row, out, WIDE)
                taken_now = TARGETS
            elif left > FEW:
                add_near(form, s, runs, ends, number, at, place, row, out, SLIM)
                taken_now = TARGETS // 2
            else:
                add_near_to_few(form, s, runs, ends, number, at, last, place, row, out)
                taken_now = FEW
            end = min(at + taken_now, last)
            for lane in range(end - at):
                out[3, lane] = out[3, lane] - s.w[at + lane] * own
            hand_over(given, out, at, end)
            at = end


def _holds(span: Any, cells: Any, count: Any, i: Any) -> Any:
    """Whether particle i is in any of so many cells."""
    found = False
    for k in range(count):
        found = found | (span[cells[k], FIRST] <= i) & (i < span[cells[k], LAST])
    return found


def _runs(span: Any, leaves: Any, ends: Any, count: Any) -> Any:
    """Where runs of particles that follow each other begin, in place of the leaves that hold them, and end; how many."""
    runs, end = 0, -1
    for k in range(count):
        leaf = leaves[k]
        begin = span[leaf, FIRST]
        if begin != end:
            leaves[runs] = begin
            runs += 1
        end = span[leaf, LAST]
        ends[runs - 1] = end
    return runs


def _particles(span: Any, leaves: Any, count: Any) -> Any:
    """How many particles are in so many leaves."""
    total = 0
    for k in range(count):
        total += span[leaves[k], LAST] - span[leaves[k], FIRST]
    return total


def hand_over(given: Any, out: Any, first: Any, last: Any) -> None:
    """Put the sums of the sorted particles [first, last) where their particles stand, in units of the world."""
    for i in range(first, last):
        j, lane = given.rows[i], i - first
        gx, gy, gz = out[0, lane] * given.scale, out[1, lane] * given.scale, out[2, lane] * given.scale
        given.field[0, j] = gx
        given.field[1, j] = gy
        given.field[2, j] = gz
        given.size[j] = np.sqrt(gx * gx + gy * gy + gz * gz)
        if given.height is not None:
            given.height[j] = out[3, lane] * given.height_scale
