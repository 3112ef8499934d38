"""The tree: cells of sorted particles, and the sums over what is in them.

A cell is a range of the sorted particles that share the first digits of their keys. It is cut where these digits first
differ, so each cell that is cut has at least two children, however dense the particles are. Cells stand generation by
generation, the children of a cell side by side.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import on_stack, outlined
from particlesim.compiler.intrinsics import BLOCK, bits_of, number_of
from particlesim.engine.interactions.tree.expansions import (
    add,
    add_lanes,
    moments_shifted,
    powers,
    scaled,
    taken,
)
from particlesim.engine.interactions.tree.form import BothSigns, in_blocks, moment_columns, order_of
from particlesim.engine.interactions.tree.indices import weights
from particlesim.engine.interactions.tree.morton import LEVELS

GENERATIONS = LEVELS + 1
MOST_WIDE = 8192
FIRST, LAST, CHILD, CHILDREN = 0, 1, 2, 3
X, Y, Z, RADIUS, REACH, STRENGTH, NEED = 0, 1, 2, 3, 4, 5, 6


class Sorted(NamedTuple):
    """Particles along the curve, in units of the box; some more at the end are zero. Shape [n + TARGETS] each."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    w: NDArray[np.float64]
    """Mass or charge, in units of the sum of their sizes."""
    need: NDArray[np.float64]
    """1/g², with g the size of the field that is expected there: how much an error matters."""


class Cells(NamedTuple):
    """The cells of a tree; the one after the last is empty."""

    span: NDArray[np.int32]
    """[cells, 4]: the first of its particles and the first that is not, its first child, how many children."""
    place: NDArray[np.float64]
    """[cells, 8]: centre, radius about it, reach and strength (`walk`), mean need of its particles."""
    moments: NDArray[np.float64]
    """[cells, numbers], filled up to whole vectors."""
    begins: NDArray[np.int64]
    """Where each generation begins; the number of generations and of cells are the last two."""


def new_cells(count: int, numbers: int) -> Cells:
    """Room for so many cells."""
    return Cells(
        np.zeros((count, 4), np.int32),
        np.zeros((count, 8)),
        np.zeros((count, in_blocks(numbers))),
        np.zeros(GENERATIONS + 4, np.int64),
    )


def generations(cells: Any) -> Any:
    """How many generations there are."""
    return cells.begins[GENERATIONS + 2]


def count_cells(cells: Any) -> Any:
    """How many cells there are."""
    return cells.begins[GENERATIONS + 3]


def end_of(key: Any, first: Any, last: Any, shift: Any) -> Any:
    """The first of the sorted keys [first, last) whose digits above `shift` differ from those of the first."""
    digits = key[first] >> shift
    low, step = first, 1
    while low + step < last and key[low + step] >> shift == digits:
        low += step
        step *= 2
    high = min(low + step, last)
    while high - low > 1:
        middle = (low + high) >> 1
        same = key[middle] >> shift == digits
        low = middle if same else low
        high = high if same else middle
    return low + 1


def splitting_shift(a: Any, b: Any) -> Any:
    """How far to shift keys a < b so that only the digits up to the first that differs are left."""
    shift = 0
    differ = (a ^ b) >> 3
    while differ > 0:
        shift += 3
        differ = differ >> 3
    return shift


@outlined
def build(key: Any, need: Any, count: Any, most: Any, wide: Any, cells: Any) -> Any:
    """Cut the particles of sorted keys until a cell has at most so many and is not wide, or all of its keys are equal.

    `need`: 1/g² of the sorted particles; a cell is wide if the square of its side times g is more than `wide`. Returns False
    if there is no room for all cells; one cell after the last is kept free.
    """
    span, room = cells.span, cells.span.shape[0] - 1
    _set_span(span, 0, 0, count)
    done, total, generation, fits = 0, 1, 0, True
    spare = room_for_wide(count)
    cells.begins[0] = 0
    while done < total:
        border = total
        while done < border:
            first, last = span[done, FIRST], span[done, LAST]
            shift = splitting_shift(key[first], key[last - 1])
            many = last - first > most
            if (many | ((spare >= 8) & _is_wide(need[first], shift, wide))) and key[first] != key[last - 1]:
                if total + 8 > room:
                    fits = False
                else:
                    span[done, CHILD] = total
                    while first < last:
                        end = end_of(key, first, last, shift)
                        _set_span(span, total, first, end)
                        total += 1
                        first = end
                    span[done, CHILDREN] = total - span[done, CHILD]
                    spare -= 0 if many else span[done, CHILDREN]
            done += 1
        generation += 1
        cells.begins[generation] = border
    cells.begins[GENERATIONS + 2] = generation
    cells.begins[GENERATIONS + 3] = total
    return fits


def room_for_wide(count: Any) -> Any:
    """How many cells are made at most because cells are wide.

    Particles around a set lie in about as many wide cells however many there are: a few thousand at 1e-5. Where only some of
    them are cut, the others have most of the error of all.
    """
    return min(count // 11, MOST_WIDE)


def _is_wide(need: Any, shift: Any, wide: Any) -> Any:
    """Whether the square of the side of a cell, whose particles differ from the three digits above `shift` on, times the
    field of its first particle is more than `wide`."""
    side = float(1 << shift // 3) * 2.0 ** (1 - LEVELS)
    return side * side > wide * np.sqrt(need) if need > 0 else False


def _set_span(span: Any, c: Any, first: Any, last: Any) -> None:
    span[c, FIRST] = first
    span[c, LAST] = last
    span[c, CHILD] = 0
    span[c, CHILDREN] = 0


def sum_up(form: Any, cells: Any, s: Any, first: Any, last: Any) -> None:
    """Centres, sizes and moments of cells [first, last), of which the children are done."""
    for c in range(first, last):
        _sum_cell(form, cells, s, c)


@outlined
def _sum_cell(form: Any, cells: Any, s: Any, c: Any) -> None:
    span, place = cells.span, cells.place
    row = cells.moments[c]
    row[:] = 0.0
    if span[c, CHILDREN] == 0:
        _centre_of_particles(place, s, c, span[c, FIRST], span[c, LAST])
        _add_particles(form, row, place, s, c, span[c, FIRST], span[c, LAST])
    else:
        begin = span[c, CHILD]
        end = begin + span[c, CHILDREN]
        _centre_of_children(place, span, c, begin, end)
        for child in range(begin, end):
            _add_child(form, cells, row, c, child)
    radius = _radius(s, span[c, FIRST], span[c, LAST], place[c, X], place[c, Y], place[c, Z])
    place[c, RADIUS] = radius
    number = float(span[c, LAST] - span[c, FIRST])
    strength, reach = _estimate(form, row, radius, place[c, SIZE] / np.sqrt(number))
    place[c, STRENGTH] = strength
    place[c, REACH] = reach


def _centre_of_particles(place: Any, s: Any, c: Any, first: Any, last: Any) -> None:
    """Centre by the sizes of the sources; the first particle where there are none. Column STRENGTH: their sum, for the
    parent, until `_estimate`."""
    total, x, y, z, need = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(first, last):
        w = abs(s.w[i])
        total += w
        x += w * s.x[i]
        y += w * s.y[i]
        z += w * s.z[i]
        need += s.need[i]
    some = total > 0
    share = 1 / (total if some else 1.0)
    place[c, X] = x * share if some else s.x[first]
    place[c, Y] = y * share if some else s.y[first]
    place[c, Z] = z * share if some else s.z[first]
    place[c, NEED] = need / (last - first)
    place[c, SIZE] = total


def _centre_of_children(place: Any, span: Any, c: Any, begin: Any, end: Any) -> None:
    total, x, y, z, need = 0.0, 0.0, 0.0, 0.0, 0.0
    for child in range(begin, end):
        w = place[child, SIZE]
        total += w
        x += w * place[child, X]
        y += w * place[child, Y]
        z += w * place[child, Z]
        need += place[child, NEED] * (span[child, LAST] - span[child, FIRST])
    some = total > 0
    share = 1 / (total if some else 1.0)
    place[c, X] = x * share if some else place[begin, X]
    place[c, Y] = y * share if some else place[begin, Y]
    place[c, Z] = z * share if some else place[begin, Z]
    place[c, NEED] = need / (span[c, LAST] - span[c, FIRST])
    place[c, SIZE] = total


IN_ORDER = 0.1
"""The part of moments of random signs below which those of a source vanish by the order of its particles."""
SIZE = 7
"""Column of `place`: Σ |w|."""


def _add_particles(form: Any, row: Any, place: Any, s: Any, c: Any, first: Any, last: Any) -> None:
    """Add the moments of particles, as many at a time as there are lanes, then the lanes one after the other."""
    begins = moment_columns(form)
    numbers = in_blocks(begins[-1])
    sums = on_stack(numbers, BLOCK, np.float64)
    for k in range(numbers):
        for lane in range(BLOCK):
            sums[k, lane] = 0.0
    cx, cy, cz = place[c, X], place[c, Y], place[c, Z]
    for at in range(first, last, BLOCK):
        left = last - at
        for lane in range(BLOCK):
            i = at + lane
            w = s.w[i] if lane < left else 0.0
            t = powers((cx - s.x[i], cy - s.y[i], cz - s.z[i]), order_of(form) - 1)
            add(sums[:, lane], begins, scaled(t, w))
    add_lanes(row, sums)


@outlined
def _add_child(form: Any, cells: Any, row: Any, c: Any, child: Any) -> None:
    begins, place = moment_columns(form), cells.place
    v = (
        place[c, X] - place[child, X],
        place[c, Y] - place[child, Y],
        place[c, Z] - place[child, Z],
    )
    moments = taken(cells.moments[child], begins)
    add(row, begins, moments_shifted(moments, v, order_of(form) - 1))


def _radius(s: Any, first: Any, last: Any, x: Any, y: Any, z: Any) -> Any:
    """The distance of the farthest particle. Floats that are not negative are in the order of their bits as whole numbers,
    whose maximum vectorises."""
    most = 0
    for i in range(first, last):
        dx, dy, dz = s.x[i] - x, s.y[i] - y, s.z[i] - z
        most = max(most, bits_of(dx * dx + dy * dy + dz * dz))
    return np.sqrt(number_of(most))


def _estimate(form: Any, row: Any, radius: Any, random: Any) -> Any:
    """Strength S and reach ρ of a source such that the norms of its moments are at most about S ρⁿ: `walk` says what for.

    `random`: Σ |w|/√n, about what signs at random leave of a sum over n particles. Where signs are in order, as in a
    crystal, low moments may vanish, and tell nothing of those that are cut off.
    """
    begins = moment_columns(form)
    last = order_of(form) - 1
    both = isinstance(form.signs, BothSigns)
    strength = max(abs(row[0]), random) if both else abs(row[0])
    norms = tuple(
        None if begin < 0 or n == 0 else _norm(row, begin, n) for n, begin in enumerate(begins[:-1])
    )
    told = 0.0
    for n, norm in enumerate(norms):
        if norm is not None:
            scale = radius**n
            scaled_norm = norm / (scale if scale > 0 else 1.0)
            strength = max(strength, scaled_norm)
            if n >= last - 1:
                told = max(told, scaled_norm)
    reach = radius if last < 2 or (both and told < IN_ORDER * random) else 0.0
    for n, norm in enumerate(norms):
        if norm is not None and n >= 2 and n >= last - 1:
            reach = max(reach, _root(norm / (strength if strength > 0 else 1.0), n))
    return strength, min(reach, radius)


def _root(x: Any, n: Any) -> Any:
    """x^(1/n) for x ≥ 0."""
    return np.exp(np.log(x) / n) if x > 0 else 0.0


def _norm(row: Any, begin: Any, n: Any) -> Any:
    """The norm of the tensor Σ w x ⊗ … ⊗ x of degree n."""
    return np.sqrt(sum(row[begin + i] * row[begin + i] * each for i, each in enumerate(weights(n))))


def weigh(form: Any, cells: Any, s: Any, first: Any, last: Any) -> None:
    """Mean need of cells [first, last), of which the children are done."""
    span, place = cells.span, cells.place
    for c in range(first, last):
        need = 0.0
        if span[c, CHILDREN] == 0:
            for i in range(span[c, FIRST], span[c, LAST]):
                need += s.need[i]
        else:
            for child in range(span[c, CHILD], span[c, CHILD] + span[c, CHILDREN]):
                need += place[child, NEED] * (span[child, LAST] - span[child, FIRST])
        place[c, NEED] = need / (span[c, LAST] - span[c, FIRST])
