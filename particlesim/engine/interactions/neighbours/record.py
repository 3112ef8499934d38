"""The arrays of neighbour lists, allocated by the caller of the kernels.

The particles of an interaction, its *members*, are kept in an order in which neighbours in space are neighbours in memory
(`sort`). Eight in a row are a *group*; a tree of boxes stands on the groups (`tree`); every group has a list of
*candidates*, all members within the cutoff and the skin of any of its eight (`search`). `refresh` brings all of it up to the
present positions.

An interaction between two sets has two *sections* of whole groups; then only members of the other section are candidates.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

GROUP = 8
"""Members of a group: as many as double precision has lanes in vectors of 512 bits."""
SLICES = 32
"""Parts into which passes over members are cut for threads; results do not depend on it, as long as it is fixed."""
DIGIT = 8
"""Bits that a pass of the sort looks at."""
BLOCK = 4096
"""Candidates for which a thread asks for room at a time."""
ROOM = 24
"""Candidates per member to have room for at first: those of a liquid with a cutoff of some diameters."""
IMAGE_SHIFT = 27
"""Bits of a candidate that are its place; the image is above them."""
MOST = 1 << IMAGE_SHIFT
IMAGES = 27
"""Images of the box that a particle may see: its own and its neighbours, 0, 1 or 2 (that is −1) periods along every axis."""
NO_ROOM = -1
"""The count of a list that has no room."""
FAR = 1e30
"""The position of members that do not act [m]: the dead, those not yet born, the padding of the last group. A member as far
away as that, or whose position is not finite, is no neighbour of any other."""

STALE, OVERFLOW, BUILDS, LIVED, DUE, CAPACITY = range(6)
"""In `report`: whether the lists have to be built anew or found again, whether any had no room, how often they were built,
for how many uses they have lived; whether sums over them are due though nothing may have changed, as others have looked at
them; for how many candidates there is room."""
LOST = 2
"""For STALE: lists are to be found again as they were built last, from `order`, `base` and `skin`."""
POOL, NEXT, TURN, SKIP = 8, 16, 24, 32
"""In `report`, on cache lines of their own: room given away, counters of work that threads take, a flag of the sort."""

SKIN, NARROWEST_SKIN, WIDEST_SKIN = 0.12, 0.04, 0.4
"""A skin that is tuned, at first and within which bounds, as a part of the cutoff. The first is right for a liquid."""
USES = 6, 30
"""For how many sums of forces lists should hold: where they are short, they take as long to build as some sums."""

LOW, HIGH, LEAST, LARGEST, MOVED, MOVED_HIGH = 0, 3, 6, 7, 8, 11
"""Columns of `slots`: lowest and highest place of members, smallest and largest radius, lowest and highest displacement."""
FURTHEST, FURTHEST_DRIFTED = 14, 15
"""Columns of `slots`: the square of the largest displacement, and of the largest about a common one."""
CHANGED, BEGUN_FAR = 16, 17
"""Columns of `slots`: 1 if a number of a member has changed since they were looked at last, else 0; how far members
have been from their places when lists were built, at the beginning of a step."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Neighbours(NamedTuple):
    """Members and their lists. `room` is the number of places, whole groups; those that no member takes are far away.

    `members` [m]: rows of the members in the island, the first section first; `split`: how many are in the first of two
    sections, None for one. `cutoff` [m]: how far two members may be apart, or their surfaces where there are `radii`;
    `skin` [1]: how much further candidates may be [m], `tuned`: for how many uses lists should hold at least and at most,
    None if the skin stays as it is. `box`: periods of the three
    axes, None each where open; None: no axis is periodic.

    `order` [room]: row at every place, −1 for none; `place` [n]: place of every row, −1 for rows that are no members. `x`
    [3, room]: present positions, those of the state plus `wrap` [3, room], None without a box; `base` [3, room]: positions
    when the lists were built; `radii` [room]: radii, or None; `part` [room]: how much of the present step each is there
    (`presence`), None where all always are.

    `boxes` [6, nodes]: lowest and highest corner of every node; `spread` [nodes]: largest radius in it, or None; `levels`:
    where each level begins, the groups first, and the end.

    `begin`, `count` [groups]: where candidates of a group are in `candidates`, and how many, NO_ROOM if that was not enough.
    A candidate is a place; in periodic boxes with the number of its image above IMAGE_SHIFT bits; `images` [3, IMAGES]:
    displacement of every image.

    `keys`, `index` [2, m], `counts`, `slots`, `report`: scratch and reports.
    """

    members: Any
    split: Any
    cutoff: Any
    skin: Any
    tuned: Any
    box: Any
    order: Any
    place: Any
    x: Any
    base: Any
    wrap: Any
    radii: Any
    part: Any
    boxes: Any
    spread: Any
    levels: Any
    begin: Any
    count: Any
    candidates: Any
    images: Any
    keys: Any
    index: Any
    counts: Any
    slots: Any
    report: Any


def new_neighbours(
    members: Ints,
    particles: int,
    cutoff: float,
    skin: float | None = None,
    *,
    uses: tuple[int, int] = USES,
    split: int | None = None,
    box: Sequence[float | None] | None = None,
    radii: bool = False,
    clocked: bool = False,
    dtype: Any = np.float64,
    room: int = 0,
) -> Neighbours:
    """Lists of members, not yet built, in an island of some particles; a skin that is not given is found.

    `uses`: for how many sums lists should hold, at least and at most. `clocked`: whether some may be born or die. `room`:
    candidates to have room for, at least.

    Raises ValueError for more members than a list can name, and for a box that is too small for its images.
    """
    m = len(members)
    sections = (m,) if split is None else (split, m - split)
    groups = max(sum(-(-each // GROUP) for each in sections), 1)  # a first place says what type places have
    places = GROUP * groups
    if places >= MOST:
        raise ValueError(f"neighbour lists have at most {MOST - 1} particles, not {m}")
    if box is not None and all(length is None for length in box):
        box = None
    lengths = () if box is None else tuple(None if each is None else float(each) for each in box)
    widest = WIDEST_SKIN * cutoff if skin is None else skin
    if any(each is not None and each < cutoff + widest for each in lengths):
        raise ValueError("a period of the box is shorter than the cutoff and the skin")
    report = new_report(max(room, ROOM * m + 64 * BLOCK))
    levels = level_starts(groups)
    nodes = levels[-1]
    boxes = np.empty((6, nodes))
    boxes[:3], boxes[3:] = np.inf, -np.inf
    digits = np.arange(IMAGES)
    steps = np.stack([digits % 3, digits // 3 % 3, digits // 9])
    images = (steps - 3 * (steps == 2)) * np.array([[each or 0.0] for each in lengths or (0.0,) * 3])
    return Neighbours(
        np.ascontiguousarray(members, np.int64),
        split,
        float(cutoff),
        np.array([0.0 if skin is None else skin]),
        uses if skin is None else None,
        lengths or None,
        np.full(places, -1, np.int32),
        np.full(particles, -1, np.int32),
        np.full((3, places), FAR, dtype),
        np.full((3, places), FAR, dtype),
        None if box is None else np.zeros((3, places), dtype),
        np.zeros(places, dtype) if radii else None,
        np.zeros(places, dtype) if clocked else None,
        boxes,
        np.zeros(nodes) if radii else None,
        levels,
        np.zeros(groups, np.int64),
        np.zeros(groups, np.int64),
        np.zeros(report[CAPACITY], np.uint32),
        images,
        np.zeros((2, m), np.int64),
        np.zeros((2, m), np.int32),
        np.zeros((SLICES, 1 << DIGIT), np.int64),
        np.zeros((SLICES, 24)),
        report,
    )


def new_report(capacity: int) -> Ints:
    """A report that asks for lists, with room for so many candidates."""
    report = np.zeros(40, np.int64)
    report[STALE], report[CAPACITY] = 1, capacity
    return report


def level_starts(groups: int) -> Ints:
    """Where the levels of a tree on some groups begin, up to the one of at most eight nodes, and where that ends.

    Every level has room for whole families of eight.
    """
    starts, width = [0], max(groups, 1)
    while True:
        starts.append(starts[-1] + -(-width // 8) * 8)
        if width <= 8:
            return np.array(starts, np.int64)
        width = -(-width // 8)


def enlarged(near: Neighbours) -> Neighbours:
    """The same with room for what did not fit, to be built anew; itself where all did."""
    if not near.report[OVERFLOW]:
        return near
    room = max(2 * near.candidates.size, int(near.report[POOL]))
    return near._replace(candidates=np.zeros(room, np.uint32), report=new_report(room))


def candidates_of(near: Neighbours, g: int) -> tuple[Ints, Ints]:
    """Places of the candidates of a group, and the numbers of their images; not for kernels."""
    first = int(near.begin[g])
    entries = near.candidates[first : first + int(near.count[g])].astype(np.int64)
    return entries & MOST - 1, entries >> IMAGE_SHIFT


def renumbered(each: Any, rows: Ints, place: Ints) -> Any:
    """What knows rows in `order` and places of rows in `place`, among particles in another order, whose row k is row
    `rows[k]` of the present one and row `place[k]` of which is k."""
    order = np.where(each.order < 0, each.order, place[each.order]).astype(each.order.dtype)
    return each._replace(order=order, place=each.place[rows])


def take_over(each: Any, other: Any) -> None:
    """Give one the rows and places of another."""
    each.order[:], each.place[:] = other.order, other.place


def forget(near: Neighbours) -> None:
    """Have the lists built anew at their next use."""
    near.report[STALE] = 1


def lasting(near: Neighbours) -> tuple[NDArray[Any], ...]:
    """The arrays from which lists are found again (`found_again`)."""
    kept = (near.order, near.place, near.base, near.wrap, near.skin, near.report)
    return tuple(each for each in kept if each is not None)


def with_lasting(near: Neighbours, arrays: Iterator[NDArray[Any]]) -> Neighbours:
    """The same with the next of other such arrays."""
    order, place, base = next(arrays), next(arrays), next(arrays)
    wrap = None if near.wrap is None else next(arrays)
    return near._replace(
        order=order, place=place, base=base, wrap=wrap, skin=next(arrays), report=next(arrays)
    )


def found_again(near: Neighbours) -> Neighbours:
    """The same after its `lasting` arrays have been set to what they were at another time: candidates, and the tree, are
    found again at the next use, in as much room as there was."""
    if near.report[STALE] == 0:
        near.report[STALE] = LOST
    room = near.report[CAPACITY] = max(int(near.report[CAPACITY]), near.candidates.size)
    return near if room == near.candidates.size else near._replace(candidates=np.zeros(room, np.uint32))


def slice_of(count: Any, k: Any) -> Any:
    """First and last of part k of SLICES about equal ones."""
    return count * k // SLICES, count * (k + 1) // SLICES


def lives(clock: Any, i: Any, t: Any) -> Any:
    """Whether particle i has been alive in the present step, or will be born."""
    if clock is None:
        return True
    return clock.stop[i] > (t if clock.begin is None else clock.begin)


def within_sight(x: Any, y: Any, z: Any) -> Any:
    """Whether a place is nearer than FAR, which no place is that is not finite."""
    return abs(x) + abs(y) + abs(z) < FAR
