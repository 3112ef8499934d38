"""Hard contacts of surfaces and strands: the kind of interaction, and the course of a step.

At the end of a step, when all particles have met their colliders, contacts along its displacements are found (`candidates`,
`closest`), displacements and then velocities are corrected (`response`), and pairs that would still come too close are
searched for: they become contacts, too, or move as one (`zones`). So surfaces that were apart when the run began stay apart
on the straight paths of every step: nothing passes through at any speed. One thread does all of it, except for the search
for near simplices.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.element_tensors import CornerTensors
from particlesim.engine.interactions.hard.walls import put_out_of_bodies
from particlesim.engine.interactions.interaction import Floats, Interaction, Ints, Site
from particlesim.engine.interactions.lifting import book, lifted
from particlesim.engine.interactions.neighbours.record import OVERFLOW, enlarged
from particlesim.engine.interactions.surfaces.candidates import find, find_again, measure
from particlesim.engine.interactions.surfaces.patches import add_patches, has_bulges
from particlesim.engine.interactions.surfaces.record import (
    CONTACTS,
    CROWDED,
    DRIFT,
    EDGES,
    EFFORT,
    FACES,
    LOST,
    PAUSE,
    REACH,
    ROOMIER,
    STALE,
    THIN,
    Beside,
    Candidates,
    Desk,
    Simplices,
    Touches,
    new_beside,
    new_candidates,
    new_desk,
    new_touches,
    room_for,
    simplices_of,
)
from particlesim.engine.interactions.surfaces.response import (
    CALMED,
    MORE_TURNS,
    SETTLED,
    TURNS,
    begin_impulses,
    displace,
    give_impulses,
    list_contacts,
    list_missed,
    lose_sliding,
    prepare,
    weigh,
    widened,
)
from particlesim.engine.interactions.surfaces.walls import (
    add_walls,
    lie_on_walls,
    put_on_walls,
    stand_at_walls,
)
from particlesim.engine.interactions.surfaces.zones import (
    join,
    joined,
    leaning,
    move_zones,
    no_zones,
    stand_on,
    sum_zones,
)
from particlesim.engine.state.columns import STORMER, let_know
from particlesim.interactions import PairSet
from particlesim.layouts.mesh import STRUCTURAL
from particlesim.scenario.reach import has_extent

LOOKS = 4
"""How often what would still come too close becomes a contact; what does so after that moves as one."""
MOST_ZONES = 200
"""Bound on the turns in which zones are joined."""
TAKEN = 16
"""Bit of a mark: that what a method remembers is without the velocity."""
SPRINGS = 4
"""About how many springs take as long as a simplex."""
MANY = 5_000_000
"""Pairs to look at between two pauses: a fraction of a second."""


class SurfaceColumns(NamedTuple):
    """The law, what touches, candidates, contacts of the step, scratch, a report, what is tuned, particles beside colliders,
    the energy that moving particles apart has given them so far [1] [J], and rigid bodies that they touch, None without."""

    law: Any
    simplices: Simplices
    found: Candidates
    touches: Touches
    desk: Desk
    report: Any
    tune: Any
    beside: Beside
    fed: Any
    obstacles: Any = None


class SurfaceContacts(Interaction, SurfaceColumns):
    """Hard contacts of surfaces, strands and single particles, which act between steps."""

    __slots__ = ()
    concludes: ClassVar[bool] = True
    looks_back: ClassVar[bool] = True
    tires: ClassVar[bool] = True
    follows: ClassVar[frozenset[str]] = frozenset(SurfaceColumns._fields) - {"fed"}

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        pass

    def conclude(self, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
        if self.obstacles is not None:
            if share.number == 0:
                put_out_of_bodies(self.obstacles, parts, c, t)
            meet(share.gate, share.threads)
        if share.number == 0 and self.report[EFFORT] >= self.report[PAUSE]:
            self.report[EFFORT] = 0
        find(self, c, before, share, t, h)
        if share.number == 0:
            resolve(self, parts, c, before, share.gate, t, h)
        meet(share.gate, share.threads)

    def tired(self) -> Any:
        return (self.report[EFFORT] >= self.report[PAUSE]) | (self.report[LOST] != 0)

    @property
    def number(self) -> int:
        return 0

    @property
    def effort(self) -> int:
        return SPRINGS * int(self.simplices.corners.shape[1])

    @property
    def cramped(self) -> bool:
        return bool(self.report[LOST])

    def renewed(self) -> Self:
        self.report[STALE], self.report[EFFORT] = 1, 0
        self.beside.clear[:] = -np.inf
        if not self.cramped:
            return self
        found, touches = self.found, self.touches
        if self.report[LOST] == CROWDED:
            found.near.report[OVERFLOW] = 1
            found = found._replace(near=enlarged(found.near))
        else:
            room = ROOMIER * touches.rows.shape[1]
            found = new_candidates(self.simplices, self.desk.mark.size, room)._replace(near=found.near)
            touches = new_touches(room)
        self.report[LOST] = 0
        return self._replace(found=found, touches=touches)

    def after(self, before: Interaction, place: Ints) -> Self:
        # surfaces and strands as they were, without the dead; single particles as they are now
        assert isinstance(before, SurfaceContacts)
        old, new = before.simplices, self.simplices
        free = new.corners[0] == new.corners[1]
        parts, sides = [], []
        for simplices, chosen in ((old, old.corners[0] != old.corners[1]), (new, free)):
            corners = simplices.corners[:, chosen]
            corners = place[corners] if simplices is old else corners
            there = (corners >= 0).all(axis=0)
            face = simplices.face[chosen][there] == 1
            side = np.flatnonzero(chosen)[there] >= (simplices.split or 0)
            corners = corners[:, there]
            parts.append((corners[:, face], corners[:2, ~face]))
            sides.append((side[face].astype(np.int64), side[~face].astype(np.int64)))
        tune = self.tune
        if old.corners.size:
            tune = before.tune.copy()
            tune[THIN] = min(before.tune[THIN], self.tune[THIN])
        triangles, edges = (np.concatenate([parts[0][k], parts[1][k]], axis=1) for k in range(2))
        one, other = (np.concatenate([sides[0][k], sides[1][k]]) for k in range(2))
        return self._replace(
            tune=tune, **laid(self, triangles, edges, None if new.split is None else (one, other))
        )

    @property
    def given(self) -> float:
        return float(self.fed[0])

    def changing(self) -> tuple[Floats, ...]:
        return (self.fed,)

    def with_changed(self, arrays: Sequence[Floats]) -> Self:
        return self._replace(fed=arrays[0])

    def linearise(self, c: Any, t: float) -> CornerTensors:
        return CornerTensors(np.zeros((4, 0), np.int64), np.zeros((0, 0, 4, 3)), np.zeros((0, 3, 3)))

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        return np.zeros(3)


@outlined
def resolve(each: Any, parts: Any, c: Any, before: Any, gate: Any, t: Any, h: Any) -> None:
    """Bring the step from `before` to the present state to an end in which nothing comes too close."""
    s, found, touches, desk, report, tune = (
        each.simplices,
        each.found,
        each.touches,
        each.desk,
        each.report,
        each.tune,
    )
    x, v = (c.x, c.y, c.z), (c.vx, c.vy, c.vz)
    paired = report[FACES] + report[EDGES] > 0
    report[EFFORT] += s.rows.size + report[FACES] + report[EDGES]
    if paired | has_bulges(parts):
        weigh(s, c.m, c.clock, desk)
        list_contacts(s, found, touches, desk, report, tune, c.r, x, before)
        most = prepare(each.law, touches, desk, report, 0, v, before)
        fast, _ = add_patches(each, parts, c, before, t, h, False)
        if report[CONTACTS] > 0:
            most = max(most, fast)
            wide = widened(touches, report, before)
            first, look, missed = 0, 0, 1
            while (missed > 0) & (look < LOOKS):
                add_walls(each, parts, c, t, h)
                turn, going = 0, True
                while going & (turn < TURNS):
                    going = displace(touches, desk, report, x, before, turn % 2) > SETTLED * tune[THIN]
                    turn += 1
                put_on_walls(each, parts, c, t, SETTLED * tune[THIN])
                first = report[CONTACTS]
                if paired:
                    find_again(each, c, before, gate, t, h)
                missed = list_missed(s, found, touches, desk, report, tune, c.r, x, before)
                most = max(most, prepare(each.law, touches, desk, report, first, v, before))
                fast, more = add_patches(each, parts, c, before, t, h, True)
                most, missed = max(most, fast), missed + more
                look += 1
            report[CONTACTS] = first
            report[EFFORT] += look * TURNS * first
            before_impulses(s, desk, c)
            begin_impulses(touches, report)
            turn, going = 0, True
            while going & (turn < MORE_TURNS):
                going = give_impulses(touches, desk, report, v, turn % 2) > CALMED * most
                turn += 1
            lose_sliding(touches, desk, report, v)
            lie_on_walls(each, parts, c, t, SETTLED * tune[THIN], SETTLED * most)
            if missed > 0:
                move_as_one(each, parts, c, before, gate, t, h)
            if wide > 2 * SETTLED * tune[THIN]:  # more than what corrections leave
                book(each.fed, lifted(parts, c, before, desk.mark, t, h))
            after_impulses(s, desk, c)
            if paired:
                measure(s, found, x, before, report, tune)


def before_impulses(s: Any, desk: Any, c: Any) -> None:
    """Take velocities away from what Störmer's rule remembers of particles in contacts, to which `after_impulses` gives the
    new ones."""
    if len(c.memory) == STORMER:
        for j in range(s.rows.size):
            i = s.rows[j]
            if (desk.mark[i] & 1) != 0:
                desk.mark[i] |= TAKEN
                let_know(c.memory, i, -c.vx[i], -c.vy[i], -c.vz[i])


def after_impulses(s: Any, desk: Any, c: Any) -> None:
    """Let the method know how velocities of particles in contacts have changed; it begins again with those that have become
    such on the way."""
    if len(c.memory) > 0:
        for j in range(s.rows.size):
            i = s.rows[j]
            if (desk.mark[i] & TAKEN) != 0:
                let_know(c.memory, i, c.vx[i], c.vy[i], c.vz[i])
            elif (desk.mark[i] & 1) != 0:
                c.memory[-1][i] = 0


def move_as_one(each: Any, parts: Any, c: Any, before: Any, gate: Any, t: Any, h: Any) -> None:
    """Make zones of what would still come too close, until nothing does."""
    s, found, touches, desk, report, tune = (
        each.simplices,
        each.found,
        each.touches,
        each.desk,
        each.report,
        each.tune,
    )
    x, v = (c.x, c.y, c.z), (c.vx, c.vy, c.vz)
    no_zones(s, desk)
    turn = 0
    while turn < MOST_ZONES:
        report[CONTACTS] = 0
        find_again(each, c, before, gate, t, h)
        missed = list_missed(s, found, touches, desk, report, tune, c.r, x, before)
        first, together = report[CONTACTS], joined(touches, desk, report, 0)
        _, more = add_patches(each, parts, c, before, t, h, True)
        turn += 1
        if missed + more == 0 or (together and leaning(touches, desk, report, first)):
            turn = MOST_ZONES
        else:
            join(touches, desk, 0, report[CONTACTS])
            sum_zones(s, desk, x, v, c.m, before)
            stand_on(touches, desk, report, first, s, x, v, before)
            move_zones(s, desk, report, x, v, before)
            stand_at_walls(each, parts, c, t, h)
            move_zones(s, desk, report, x, v, before)


def laid(each: Any, triangles: Ints, edges: Ints, sides: tuple[Ints, Ints] | None) -> dict[str, Any]:
    """Simplices among the particles of an island, and room for what they touch."""
    count = each.desk.mark.size
    simplices = simplices_of(triangles, edges, sides, count)
    room = max(room_for(simplices), each.touches.rows.shape[1])
    return {
        "simplices": simplices,
        "found": new_candidates(simplices, count, room),
        "beside": new_beside(simplices, count, len(each.beside.last)),
        "touches": new_touches(room),
    }


def features_of(group: Any, site: Site) -> tuple[Ints, Ints]:
    """Rows of the triangles [3, n] and of the edges [2, m] with which a group touches: of its surface, or of its strands, or
    its particles, as edges without length. Of surfaces and strands there is none but at the start."""
    offset, count = site.offset[group.name], site.state[group.name].count
    triangles, edges = np.empty((3, 0), np.int64), np.empty((2, 0), np.int64)
    if has_extent(group):
        if not site.began:
            return triangles, edges
        layout = group.layout.open(site.scenario.folder)
        triangles = layout.triangles().T
        if not triangles.size and STRUCTURAL in layout.kinds:
            edges = layout.edges(STRUCTURAL).T
    if not triangles.size and not edges.size:
        edges = np.repeat(np.arange(count, dtype=np.int64)[None], 2, axis=0)
    return triangles + offset, edges + offset


def surfaces_of(site: Site, pairs: PairSet) -> SurfaceContacts:
    """Hard contacts among the surfaces, strands and particles of an island."""
    tables = {group.name: group for group in site.scenario.groups}
    features = [features_of(tables[name], site) for name in pairs.groups]
    triangles, edges = (np.concatenate([each[k] for each in features], axis=1) for k in range(2))
    sides = None
    if pairs.law.between is not None:
        side = [0 if name == pairs.law.between[0] else 1 for name in pairs.groups]
        first, second = (np.repeat(side, [each[k].shape[1] for each in features]) for k in range(2))
        sides = first, second
    count = site.whole.count
    radius = site.whole.radius[:count].astype(float)
    used = np.unique(np.concatenate([triangles.ravel(), edges.ravel()]))
    report, tune = np.zeros(PAUSE + 1, np.int64), np.zeros(DRIFT + 3)
    report[STALE], report[PAUSE] = 1, MANY
    thin = 2 * radius[used].min() if used.size else 1.0
    tune[THIN], tune[REACH] = thin, reach_of(site.place, triangles, edges, thin)
    law = pairs.law.record()
    none = simplices_of(triangles[:, :0], edges[:, :0], None, count)
    found, desk = new_candidates(none, count, 0), new_desk(count)
    # the island may have other groups than these, and seams change shapes: room for each collider of each group
    beside = new_beside(none, count, len(site.scenario.all_colliders) * len(site.scenario.groups))
    made = SurfaceContacts(
        law, none, found, new_touches(0), desk, report, tune, beside, np.zeros(1), site.obstacles
    )
    return made._replace(**laid(made, triangles, edges, sides))


def reach_of(x: Floats, triangles: Ints, edges: Ints, thin: float) -> float:
    """The length by which skins are measured: the smallest height of a typical triangle, the length of a typical edge, or
    the thickness of single particles."""
    if triangles.size:
        a, b, c = (x[:, rows] for rows in triangles)
        twice = np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0)
        longest = np.max([np.linalg.norm(p - q, axis=0) for p, q in ((a, b), (b, c), (c, a))], axis=0)
        heights = np.divide(twice, longest, out=np.zeros_like(twice), where=longest > 0)
        return float(max(np.median(heights), thin))
    lengths = np.linalg.norm(x[:, edges[0]] - x[:, edges[1]], axis=0)
    lengths = lengths[lengths > 0]
    return float(max(np.median(lengths), thin)) if lengths.size else thin
