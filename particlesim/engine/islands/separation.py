"""Soft particles that begin too deep in each other are put apart before the first step.

A start that overlaps, such as places at random, holds an elastic energy that no contact has ever put there: it would fly
apart. So places are changed, not velocities, until no pair overlaps by more than `LEFT` of its smaller radius: overlapping
pairs are moved apart along their centres, in inverse proportion to their masses, all at once and again and again (Jacobi's
iteration on the projections of position based dynamics; M. Müller, B. Heidelberger, M. Hennix, J. Ratcliff, J. Vis. Commun.
Image Represent. 18, 109 (2007)); nobody goes further than `BOLD` of its radius at once, and colliders put back what gets
into them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from particlesim.colliders.gaps import put_outside
from particlesim.compiler import kernel
from particlesim.engine.state.group_state import GroupState
from particlesim.graph.graph import Island
from particlesim.interactions import PairSet
from particlesim.interactions.contact import Contact
from particlesim.model.arrays import Floats, Ints
from particlesim.scenario.box import PeriodicBox

CLASSES = 2.0
"""Ratio of radii within a class of sizes, which is looked through together."""
DEEP = 0.05
"""Overlap beyond which no contact is left as it is, as a part of the smaller radius: laws of contact are for small ones."""
LEFT = 0.01
"""Overlap that pairs are left with."""
BOLD = 0.1
"""How far a particle goes at once, as a part of its radius."""
TURNS = 400
"""Turns at most; what then overlaps has no room."""
AHEAD = 0.2
"""Pairs are looked for this far beyond touching, as a part of the smallest radius, so that a list does for some turns."""


class Separation(NamedTuple):
    """What was put apart: the interaction, how many pairs, how deep the deepest was, how far the furthest went, and how deep
    the deepest is still [m]; whether that is more than it should be, for want of room."""

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
    ahead = AHEAD * float(r[r > 0].min())
    looked = np.full_like(x, np.inf)
    for _ in range(TURNS):
        if not 2 * _furthest(x, looked) < ahead:
            pairs.find(x, ahead)
            looked = x.copy()
        if not pairs.move(x):
            break
        for state, begin, end in zip(states, ends, ends[1:], strict=False):
            _put_out(structure, state, x[begin:end], r[begin:end], free[begin:end])
    left = pairs.find(x, 0.0)
    cramped = bool((left > 2 * LEFT * pairs.smaller).any())
    for state, begin, end in zip(states, ends, ends[1:], strict=False):
        state.x[:, : state.count] = x[begin:end].T
    way = _furthest(x, before)
    return Separation(each.name, number, first, way, float(left.max(initial=0.0)), cramped)


def _furthest(x: Floats, from_: Floats) -> float:
    """The longest way that one has gone [m]."""
    return float(np.sqrt(((x - from_) ** 2).sum(axis=1).max()))


def _lightness(state: GroupState) -> Floats:
    """1/m of all particles of a group, 0 of what is held [1/kg]."""
    free = 1 / state.mass[: state.count].astype(float)
    if state.clocked:
        free[np.isinf(state.start[: state.count])] = 0
    return np.asarray(free)


def _put_out(structure: Island, state: GroupState, x: Floats, r: Floats, free: Floats) -> None:
    """What has got into colliders goes back to their surface; not what is held."""
    member = [group.name for group in structure.groups].index(state.name)
    for collider in structure.colliders[member]:
        if collider.contact == "bounce":
            put_outside(collider.body(), x, r, free, 0.0)


class Pairs:
    """Pairs of spheres with radii [m] and 1/m that may overlap; `side`: of which of two groups each is, None: all touch."""

    def __init__(self, r: Floats, free: Floats, side: Ints | None, box: PeriodicBox | None) -> None:
        self.r, self.free, self.side, self.box = r, free, side, box
        self.i = self.j = np.empty(0, np.int64)

    @property
    def smaller(self) -> Floats:
        """The smaller radius of each pair [m]."""
        return np.minimum(self.r[self.i], self.r[self.j])

    def find(self, x: Floats, ahead: float) -> Floats:
        """Look for those nearer than `ahead` [m], and how deep they overlap."""
        i, j, depth = overlapping(x, np.where(self.r > 0, self.r + ahead / 2, 0.0), self.box)
        kept = self.free[i] + self.free[j] > 0
        if self.side is not None:
            kept &= self.side[i] != self.side[j]
        self.i, self.j = i[kept], j[kept]
        return depth[kept] - ahead

    def move(self, x: Floats) -> bool:
        """Move those at x [n, 3] apart by one turn, in place; whether there was anything too deep."""
        lengths = np.zeros(3) if self.box is None else self.box.as_box().steps
        moves, deep = np.zeros((len(x), 4)), np.zeros(1)
        _push(x, self.r, self.free, self.i, self.j, lengths, moves, deep)
        if deep[0] == 0:
            return False
        _go(x, self.r, moves)
        return True


@kernel
def _push(x: Any, r: Any, free: Any, rows: Any, others: Any, lengths: Any, moves: Any, deep: Any) -> None:
    """`moves[:, :3]`: the sum of what pairs of spheres at x [n, 3] push each by [m], and [:, 3] of how many; `deep[0]`: 1 if
    a pair overlaps by too much. `lengths`: of a periodic box, 0 along others."""
    for k in range(rows.size):
        i, j = rows[k], others[k]
        way = _nearest(lengths, (x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]))
        far = np.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
        allowed = LEFT / 2 * min(r[i], r[j])
        depth = r[i] + r[j] - allowed - far
        if depth > 0:
            if depth > allowed:
                deep[0] = 1.0
            # what has no direction gets one that is not that of others
            turn, aside = 2.399963 * float(i + j), 1.5**-0.5
            scale = 1 / far if far > 0 else 0.0
            u = (
                way[0] * scale if far > 0 else aside * np.cos(turn),
                way[1] * scale if far > 0 else aside * np.sin(turn),
                way[2] * scale if far > 0 else aside * np.cos(2 * turn),
            )
            push = depth / (free[i] + free[j])
            for axis in range(3):
                moves[i, axis] += free[i] * push * u[axis]
                moves[j, axis] -= free[j] * push * u[axis]
            moves[i, 3] += 1.0
            moves[j, 3] += 1.0


def _nearest(lengths: Any, way: Any) -> Any:
    """The shortest of the ways between two places and their images."""
    return tuple(
        d - length * np.floor(d / length + 0.5) if length > 0 else d
        for d, length in zip(way, (lengths[0], lengths[1], lengths[2]), strict=True)
    )


@kernel
def _go(x: Any, r: Any, moves: Any) -> None:
    """Each goes by twice the mean of its moves, where it has several, and no further than is bold."""
    for i in range(r.size):
        share = 1 / max(0.5 * moves[i, 3], 1.0)
        mx, my, mz = share * moves[i, 0], share * moves[i, 1], share * moves[i, 2]
        size, most = np.sqrt(mx * mx + my * my + mz * mz), BOLD * r[i]
        part = most / size if size > most else 1.0
        x[i, 0] += part * mx
        x[i, 1] += part * my
        x[i, 2] += part * mz


def overlapping(x: Floats, r: Floats, box: PeriodicBox | None = None) -> tuple[Ints, Ints, Floats]:
    """All pairs of spheres at x [n, 3] with radii r [n] that overlap, each once, and how deep [m].

    Spheres are looked for among those of their own size and of smaller ones, size by size, so that few large ones do not
    make small ones look far.
    """
    from scipy.spatial import cKDTree

    periods = None if box is None else box.as_box().steps
    if box is not None and periods is not None:
        x = np.mod(x - box.as_box().origin, np.where(periods > 0, periods, np.inf))
    there = np.flatnonzero((r > 0) & np.isfinite(x).all(axis=1))
    sizes = np.floor(np.log(r[there]) / np.log(CLASSES)).astype(np.int64)
    classes = [there[sizes == size] for size in np.unique(sizes)]
    trees = [cKDTree(x[rows], boxsize=periods) for rows in classes]
    ends: list[tuple[Ints, Ints]] = []
    for k, (rows, tree) in enumerate(zip(classes, trees, strict=True)):
        inside = tree.query_pairs(2 * r[rows].max(), output_type="ndarray")
        ends.append((rows[inside[:, 0]], rows[inside[:, 1]]))
        for smaller, other in zip(classes[:k], trees[:k], strict=True):
            near = other.query_ball_point(x[rows], r[rows] + r[smaller].max())
            count = np.array([len(each) for each in near], np.int64)
            if count.any():
                ends.append((np.repeat(rows, count), smaller[np.concatenate(near).astype(np.int64)]))
    i = np.concatenate([np.empty(0, np.int64), *(a for a, _ in ends)])
    j = np.concatenate([np.empty(0, np.int64), *(b for _, b in ends)])
    way = x[i] - x[j]
    if periods is not None:
        way -= periods * np.round(way / np.where(periods > 0, periods, np.inf))
    depth = r[i] + r[j] - np.sqrt((way**2).sum(axis=1))
    touch = depth > 0
    return i[touch], j[touch], depth[touch]
