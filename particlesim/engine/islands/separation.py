"""Soft particles that overlap too much at the start are moved apart before the first step.

Overlaps at the start, as with random positions, hold elastic energy that no work has put there: the particles would fly
apart. So positions are changed, not velocities, until no pair overlaps by more than `LEFT` of its smaller radius:
pairs that do are moved apart along their centres, in inverse proportion to their masses, all at once and again and again
(Jacobi's iteration on the projections of position based dynamics; M. Müller, B. Heidelberger, M. Hennix, J. Ratcliff, J.
Vis. Commun. Image Represent. 18, 109 (2007)). The limits on the displacements of a pair, `BOLD` and `YIELD`, scale those of
both particles alike, so that the centre of mass stays; colliders put back particles that get into them, which does move it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.gaps import put_outside
from particlesim.compiler import kernel
from particlesim.engine.islands.overlaps import overlapping
from particlesim.engine.state.group_state import GroupState
from particlesim.graph.graph import Island
from particlesim.interactions import PairSet
from particlesim.interactions.contact import Contact
from particlesim.model.arrays import Bools, Floats, Ints
from particlesim.process.preparing import preparing
from particlesim.process.signals import held_signals
from particlesim.scenario.box import PeriodicBox

DEEP = 0.05
"""Overlap beyond which no contact is left as it is, as a part of the smaller radius: laws of contact are for small ones."""
LEFT = 0.01
"""Overlap that pairs are left with."""
BOLD = 0.5
"""How far a pair goes apart at once, as a part of its smaller radius."""
YIELD = 0.35
"""How much less a pair goes for each other pair of its two, as all push at once. With 1/2 the iteration never diverges, even
if all push along one line; they seldom do, and less is quicker."""
TURNS = 400
"""Turns at most; what then overlaps has no room."""
AHEAD = 0.5
"""Pairs are looked for among spheres that are larger by this part of their radius, so that a list does for some turns: until
one has gone as far."""


class Separation(NamedTuple):
    """The result of moving pairs apart: the interaction, the number of pairs, the largest overlap, the largest displacement,
    the largest remaining overlap [m], and whether that is too large, for want of room."""

    label: str
    number: int
    depth: float
    way: float
    left: float
    cramped: bool


def separate(structure: Island, states: Sequence[GroupState], box: PeriodicBox | None) -> list[Separation]:
    """Put the particles of an island apart where a soft contact asks for it."""
    found = []
    for each in structure.interactions:
        if isinstance(each, PairSet) and isinstance(each.law, Contact) and each.law.parts:
            if structure.constraints and each.law.overlap == "auto":
                continue
            here = [state for state in states if state.name in each.groups and state.count]
            if here and (done := _separated(each, structure, here, box)) is not None:
                found.append(done)
    return found


def _separated(
    each: PairSet, structure: Island, states: Sequence[GroupState], box: PeriodicBox | None
) -> Separation | None:
    law = each.law
    assert isinstance(law, Contact)
    x = np.concatenate([state.position.astype(float) for state in states])
    r = np.concatenate([state.radius[: state.count].astype(float) for state in states])
    free = np.concatenate([_lightness(state) for state in states])
    ends = np.cumsum([0, *(state.count for state in states)])
    side = None if law.between is None else np.repeat(np.arange(len(states)), np.diff(ends))
    pairs = Pairs(r, free, side, box)
    depth = pairs.find(x, 0.0)
    limit = (DEEP if law.overlap == "auto" else LEFT) * pairs.smaller
    if not (depth > limit).any():
        return None
    before, first, number = x.copy(), float(depth.max()), int((depth > limit).sum())
    looked = np.full_like(x, np.inf)
    with preparing("moving apart particles that overlap at the start"), held_signals() as signals:
        for turn in range(TURNS):
            signals.check()
            if not _holds(x, looked, r, pairs.moved):
                pairs.find(x, AHEAD)
                looked = x.copy()
            if not pairs.move(x):
                break
            loose = free if turn == 0 else np.where(pairs.moved, free, 0.0)
            for state, begin, end in zip(states, ends, ends[1:], strict=False):
                _put_out(structure, state, x[begin:end], r[begin:end], loose[begin:end])
            if turn == 0:  # any may have been inside a collider
                pairs.moved[:] = True
    left = pairs.find(x, 0.0)
    cramped = bool((left > 2 * LEFT * pairs.smaller).any())
    way = _furthest(x, before)
    if box is not None:  # nobody leaves the image of the box in which it was placed
        whole = box.as_box()
        x -= (whole.images(x) - whole.images(before)) * whole.steps
    for state, begin, end in zip(states, ends, ends[1:], strict=False):
        state.x[:, : state.count] = x[begin:end].T
    return Separation(each.name, number, first, way, float(left.max(initial=0.0)), cramped)


def _furthest(x: Floats, from_: Floats) -> float:
    """The longest way that one has gone [m]."""
    return float(np.sqrt(((x - from_) ** 2).sum(axis=1).max()))


def _holds(x: Floats, looked: Floats, r: Floats, moved: Bools) -> bool:
    """Whether no sphere has moved so far since the search for pairs that some may be missing; only those that have `moved`
    in the last turn are looked at."""
    rows = np.flatnonzero(moved & (r > 0))
    return bool((((x[rows] - looked[rows]) ** 2).sum(axis=1) < (AHEAD * r[rows]) ** 2).all())


def _lightness(state: GroupState) -> Floats:
    """1/m of all particles of a group, 0 of what is held [1/kg]."""
    free = 1 / state.mass[: state.count].astype(float)
    if state.clocked:
        free[np.isinf(state.start[: state.count])] = 0
    return np.asarray(free)


def _put_out(structure: Island, state: GroupState, x: Floats, r: Floats, free: Floats) -> None:
    """Put particles that are inside colliders back on their surface, except held ones."""
    member = [group.name for group in structure.groups].index(state.name)
    for collider in structure.colliders[member]:
        if collider.contact == "bounce":
            put_outside(collider.body(), x, r, free, 0.0)


class Pairs:
    """Pairs of spheres with radii [m] and 1/m that may overlap; `side`: of which of two groups each is, None: all touch.
    `moved`: the spheres that the last turn has moved. A pair of two others is as it was, and not measured again."""

    def __init__(self, r: Floats, free: Floats, side: Ints | None, box: PeriodicBox | None) -> None:
        self.r, self.free, self.side, self.box = r, free, side, box
        self.i = self.j = np.empty(0, np.int64)
        self.moved = np.ones(len(r), bool)
        self.those, self.ways = np.empty((0, 2), np.int64), np.empty((0, 4))

    @property
    def smaller(self) -> Floats:
        """The smaller radius of each pair [m]."""
        return np.minimum(self.r[self.i], self.r[self.j])

    def find(self, x: Floats, ahead: float) -> Floats:
        """Look for those that overlap as spheres larger by this part, and how deep they do as they are; less than 0: not."""
        i, j, depth = overlapping(x, (1 + ahead) * self.r, self.box)
        kept = self.free[i] + self.free[j] > 0
        if self.side is not None:
            kept &= self.side[i] != self.side[j]
        self.i, self.j = i[kept], j[kept]
        self.those, self.ways = np.empty((len(self.i), 2), np.int64), np.empty((len(self.i), 4))
        return depth[kept] - ahead * (self.r[self.i] + self.r[self.j])

    def move(self, x: Floats) -> bool:
        """Move those at x [n, 3] apart by one turn, in place; whether there was anything too deep."""
        lengths = np.zeros(3) if self.box is None else self.box.as_box().steps
        crowd, found = np.zeros(len(x)), np.zeros(1, np.int64)
        _measure(
            x, self.r, self.free, self.i, self.j, self.moved, lengths, self.those, self.ways, crowd, found
        )
        self.moved[:] = False
        _push(x, self.free, self.those[: found[0]], self.ways, crowd, self.moved)
        return bool(found[0] > 0)


@kernel
def _measure(
    x: Any,
    r: Any,
    free: Any,
    rows: Any,
    others: Any,
    moved: Any,
    lengths: Any,
    those: Any,
    ways: Any,
    crowd: Any,
    found: Any,
) -> None:
    """Which of the pairs of spheres at x [n, 3] overlap by too much (`those`); for each of these the direction from the
    second to the first and how far they are to go [m] (`ways`); `crowd`: for each sphere, the sum of the reduced masses of
    these pairs, as a part of its mass: a much lighter neighbour hardly counts; `found`: how many there are. `lengths`: of a
    periodic box, 0 along others."""
    end = 0
    for k in range(rows.size):
        i, j = rows[k], others[k]
        if moved[i] | moved[j]:
            way = _nearest(lengths, (x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]))
            far = np.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
            smaller = min(r[i], r[j])
            allowed = LEFT / 2 * smaller
            depth = r[i] + r[j] - allowed - far
            if (
                depth > allowed
            ):  # it goes to half of what is allowed: what neighbours do then may leave it in peace
                # what has no direction gets one that is not that of others
                turn, aside = 2.399963 * float(i + j), 1.5**-0.5
                scale = 1 / far if far > 0 else 0.0
                those[end, 0], those[end, 1] = i, j
                ways[end, 0] = way[0] * scale if far > 0 else aside * np.cos(turn)
                ways[end, 1] = way[1] * scale if far > 0 else aside * np.sin(turn)
                ways[end, 2] = way[2] * scale if far > 0 else aside * np.cos(2 * turn)
                ways[end, 3] = min(depth, BOLD * smaller)
                both = free[i] + free[j]
                crowd[i] += free[i] / both
                crowd[j] += free[j] / both
                end += 1
    found[0] = end


def _nearest(lengths: Any, way: Any) -> Any:
    """The shortest of the ways between two places and their images."""
    return tuple(
        d - length * np.floor(d / length + 0.5) if length > 0 else d
        for d, length in zip(way, (lengths[0], lengths[1], lengths[2]), strict=True)
    )


@kernel
def _push(x: Any, free: Any, those: Any, ways: Any, crowd: Any, moved: Any) -> None:
    """Each pair goes apart by its way, less where its two have other pairs, and both by one factor, so that the centre of
    mass stays. Note which have `moved`."""
    for k in range(those.shape[0]):
        i, j = those[k, 0], those[k, 1]
        moved[i], moved[j] = True, True
        push = ways[k, 3] / ((free[i] + free[j]) * max(YIELD * (crowd[i] + crowd[j]), 1.0))
        for axis in range(3):
            x[i, axis] += free[i] * push * ways[k, axis]
            x[j, axis] -= free[j] * push * ways[k, axis]
