"""Hard contacts: particles that overlap at the end of a step and approach get impulses, and are moved apart.

Pairs are taken one after the other, in the order of the lists and then backwards, until none approaches (Gauss–Seidel). With
w = 1/m, n from the second to the first and v_n = (v₁ − v₂)·n < 0 a pair gets

    j = −(1 + e) v_n/(w₁ + w₂),   v₁ += w₁ j n,   v₂ −= w₂ j n,

and across n, by Coulomb, the impulse that stops sliding if that is at most μ_s j, else μ_k j. The surfaces slide over each
other at u = v_t − s (r₁ ω₁ + r₂ ω₂) × n with s = |l|/(r₁ + r₂), and the impulse u/((1 + 5 s²/2) (w₁ + w₂)) stops them, which
is 2/7 u/(w₁ + w₂) where spheres just touch; its torque turns both. Rolling friction stops what rolls as far as μ_r j allows
(`friction`). So momentum and angular momentum are kept, and energy never grows, pair by pair. Colliders on which particles
lie take part in the turns.

An approach as slow as forces bring about within two steps counts as rest, with e = 0 (`turns`). What rests begins with what
it has been given in the last step, and may take it back (`memory`). Where turns do not settle, clusters with few pairs are
solved at once, as at rest (`at_once`).

Several tables of contact act together (`laws`): the first one has the bench on which the impulses of all are found.

Impulses act where forces do in a step, in its middle for most methods: along the normals there, and particles move on from
there by as much. Then what still overlaps is moved apart (`apart`). Those that move far in a step have met what was on their
way before all that (`swift`).

Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988); E. Guendelman, R. Bridson,
R. Fedkiw, ACM Trans. Graph. 22, 871 (2003), for impacts before contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from particlesim.compiler import outlined
from particlesim.engine.barrier import meet
from particlesim.engine.interactions.contacts import hold_stuck, with_masses
from particlesim.engine.interactions.hard.apart import (
    DONE,
    FAR,
    ROUGHLY,
    SLACK,
    begin_apart,
    move_apart,
    move_on,
    moves_apart,
    shift_from_walls,
    shift_pairs,
)
from particlesim.engine.interactions.hard.asleep import asleep_by, let_sleep, nobody_sleeps, wake_all
from particlesim.engine.interactions.hard.at_once import GIVEN, NUMBER, choose, find, rates
from particlesim.engine.interactions.hard.bench import COUNT, WANTED, Bench, new_bench
from particlesim.engine.interactions.hard.laws import Laws, laws_of, some_rest, tables_of
from particlesim.engine.interactions.hard.listing import list_touching, smallest_radius
from particlesim.engine.interactions.hard.memory import (
    UNNOTICED,
    Known,
    book_moves,
    known_by,
    new_known,
    note_impulses,
    note_speeds,
    recall,
    remember,
    start,
    take_back,
    there_is,
    with_room,
)
from particlesim.engine.interactions.hard.overheard import Overheard, overhear, overheard_of
from particlesim.engine.interactions.hard.paying import note_potentials, pay_for_lifts
from particlesim.engine.interactions.hard.slides import slide_on
from particlesim.engine.interactions.hard.swift import hasten
from particlesim.engine.interactions.hard.turns import (
    SETTLED,
    give_impulses,
    look_at,
    mark_pairs,
    push_pairs,
    rub_pairs,
)
from particlesim.engine.interactions.hard.walls import (
    leave_walls,
    push_from_walls,
    push_off_walls,
    put_on_walls,
    put_out,
    put_out_of_bodies,
    rub_walls,
    watch_walls,
)
from particlesim.engine.interactions.hard.ways import Ways, new_ways
from particlesim.engine.interactions.interaction import Floats, Interaction, Ints, Site
from particlesim.engine.interactions.lifting import book, lifted, stored
from particlesim.engine.interactions.near_pairs import NearLists, bring_up, near_pairs_of
from particlesim.engine.interactions.neighbours.record import Neighbours, enlarged, forget
from particlesim.engine.interactions.pair_blocks import Block
from particlesim.engine.state.columns import in_step
from particlesim.graph.graph import methods_of
from particlesim.interactions import PairSet

PAIRS, SIDES, SOME = 8, 3, 64
"""Room at first: pairs per particle, twice what dense packings of equal spheres have; sides of colliders per particle; and
what comes to both."""
TURNS, MOST_TURNS, ROUGHLY_SETTLED = 20, 60, 0.02
"""Turns through all pairs in a step at most; how many there may be while approaches are not settled even roughly, to this
part of the largest that forces have brought about, in the root mean square. What is left is solved at once, or goes on in
the next step."""
SINKS, SINK_TURNS = 0.01, 200
"""How much a turn takes from how far some would sink in the step, as a part of the smallest radius, from which on there are
more turns; and how many there may be then."""
ONE, OTHER, MEETS = 1, 2, 2
"""Bits of the two sides, and by how many those are above them which a side meets."""
MOST_ROUNDS = 2
"""Rounds of impulses found at once and their friction, each of which changes what the other needs."""


class ImpulseColumns(NamedTuple):
    """Hard contacts of one law: the first ten as in `NearColumns`; the number of their table among those of the island.

    Then what all of an island have in common, which is that of the first of them, and empty for others: room to work in, a
    report; the energy that moving particles apart has given them so far [J], and how often one has had too many impacts in a
    step [2]; what contacts at rest have been given, and who sleeps; the laws.

    The ways of swift particles, which all of an island share; on which side of the contacts particles are [n]: bits of what
    they are, and two bits above them of what they meet; what emitters hear of them."""

    law: Any
    least: Any
    most: Any
    a: Any
    b: Any
    ids: Any
    near: Neighbours
    seen: Block
    pull: Any
    box: Any
    rank: Any
    bench: Bench
    report: Any
    fed: Any
    known: Known
    asleep: Any
    laws: Laws
    ways: Ways
    side: Any
    heard: Overheard | None = None


class Impulses(NearLists, ImpulseColumns):
    """Hard contacts, which act between steps, all tables of an island together. One thread gives the impulses, after all
    have found the pairs."""

    __slots__ = ()
    prepares: ClassVar[bool] = False
    looks_back: ClassVar[bool] = True
    jointly: ClassVar[bool] = True
    follows: ClassVar[frozenset[str]] = frozenset(ImpulseColumns._fields) - {
        "report",
        "fed",
        "known",
        "asleep",
    }

    def add_forces(self, c: Any, total: Any, first: Any, last: Any, t: Any) -> None:
        pass

    def hasten(
        self, sets: Any, alone: bool, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any
    ) -> None:
        hasten(sets, alone, parts, c, before, share, t, h)

    def conclude_all(self, sets: Any, parts: Any, c: Any, before: Any, share: Any, t: Any, h: Any) -> None:
        for each in sets:
            hold_stuck(each, c, share)
            bring_up(each, in_step(c, t, t), share, t)  # who is not there touches nobody
        if share.number == 0:
            resolve(sets, sets[0], parts, c, before, t, h)
        meet(share.gate, share.threads)

    def renewed(self) -> Self:
        forget(self.near)
        return self.roomier()

    def roomier(self) -> Self:
        near = enlarged(self.near)
        found = self if near is self.near else self._replace(near=near)
        pairs, walls = self.report[WANTED:]
        return found._with_room(int(pairs) * 5 // 4, int(walls) * 5 // 4) if self.cramped else found

    @property
    def cramped(self) -> bool:
        pairs, walls = self.report[WANTED:]
        return bool(pairs > self.bench.rows.shape[1] or walls > self.bench.wall.size)

    def _with_room(self, pairs: int, walls: int) -> Self:
        """The same with room for so many pairs and particles at colliders at least."""
        pairs, walls = max(pairs, self.bench.rows.shape[1]), max(walls, self.bench.wall.size)
        if (pairs, walls) == (self.bench.rows.shape[1], self.bench.wall.size):
            return self
        self.report[WANTED:] = 0
        bench = new_bench(
            pairs,
            walls,
            self.bench.ends.size,
            self.bench.mark.size,
            self.bench.normal.dtype,
            self.bench.rolled is not None,
        )
        return self._replace(bench=bench, known=with_room(self.known, pairs + walls))

    def after(self, before: Interaction, place: Ints) -> Self:
        assert isinstance(before, Impulses)
        self.fed[:] = before.fed
        if not self.leads:
            return self
        known = known_by(before.known, place, self.bench.mark.size, self.known.partner.size)
        asleep = asleep_by(before.asleep, place, self.bench.mark.size)
        return self._replace(known=known, asleep=asleep)._with_room(
            before.bench.rows.shape[1], before.bench.wall.size
        )

    def among(self, rows: Ints, place: Ints) -> Self:
        found = super().among(rows, place)._replace(side=self.side[rows], heard=self._heard_among(rows))
        if not self.leads:
            return found
        known = known_by(self.known, place, rows.size, self.known.partner.size)
        return found._replace(known=known, asleep=asleep_by(self.asleep, place, rows.size))

    def _heard_among(self, rows: Ints) -> Overheard | None:
        heard = self.heard
        return None if heard is None else heard._replace(owner=heard.owner[rows], id=heard.id[rows])

    def bring_back(self, there: Self, rows: Ints, place: Ints) -> None:
        super().bring_back(there, rows, place)
        if not self.leads:
            return
        known = known_by(there.known, rows, rows.size, self.known.partner.size)
        for mine, theirs in zip(there_is(self.known), there_is(known), strict=True):
            mine[:] = theirs
        self.asleep[:, rows] = there.asleep

    @property
    def leads(self) -> bool:
        """Whether it has what all hard contacts of the island have in common."""
        return int(self.rank) == 0

    @property
    def slack(self) -> float:
        return SLACK

    @property
    def given(self) -> float:
        return float(self.fed[0])

    @property
    def stopped(self) -> int:
        return int(self.fed[1])

    def changing(self) -> tuple[Floats, ...]:
        return (self.fed, self.asleep, *there_is(self.known))

    def with_changed(self, arrays: Sequence[Floats]) -> Self:
        return self._replace(fed=arrays[0], asleep=arrays[1], known=Known(*arrays[2:]))

    def force_on(self, c: Any, row: int, t: float) -> Floats:
        return np.zeros(3)


def resolve(tables: Any, each: Any, parts: Any, c: Any, before: Any, t: Any, h: Any) -> None:
    """Impulses and displacements of all pairs that touch, of all tables; `each`: the first of these."""
    crowded = list_touching(tables, each, c, before, t, h)
    mark_pairs(each)
    walls = watch_walls(each, parts, c, before, crowded, t, h)
    if each.report[COUNT] > 0:
        calm = look_at(each, c, before, walls, h)
        for table in tables:
            if table.heard is not None:
                overhear(each, table, c, t, h)
        note_speeds(each, c)
        if recall(each, c, walls):
            start(each, c, walls)
            take_back(each, c, walls, 0.0)
        turn, going, rough, small = 0, True, True, ROUGHLY_SETTLED / SETTLED * float(calm)
        sinks, smallest = False, smallest_radius(each, c)
        while going & ((turn < TURNS) | (rough & (turn < MOST_TURNS)) | (sinks & (turn < SINK_TURNS))):
            worst, squares = give_impulses(each, c, turn % 2)
            push_off_walls(each, parts, c, t)
            going, rough = worst > calm, squares > small * small * each.report[COUNT]
            sinks = float(h) * worst > SINKS * smallest
            turn += 1
        low = stored(parts, c, each.bench.mark, t)
        if going & some_rest(each.laws):
            chosen = choose(each, c, each.report[COUNT], walls, calm)
            rest_at_once(each, parts, c, t, chosen, walls, calm)
            settle(each, c, before, walls, h)
            slide_on(each, parts, c, before, t, h)
            note_potentials(each, parts, c, t)
            apart_at_once(each, parts, c, t, chosen, walls)
        else:
            settle(each, c, before, walls, h)
            slide_on(each, parts, c, before, t, h)
            note_potentials(each, parts, c, t)
        turn, most, inside, far = 0, 0.0, 0.0, 0.0
        while moves_apart(turn, most):
            most = move_apart(each, c, turn)
            put_out_of_bodies(each.ways.obstacles, parts, c, t)
            inside = put_on_walls(each, parts, c, t)
            far = max(far, most)
            turn += 1
        leave_walls(each, parts, c, t, inside)
        if far > FAR:
            put_out(each, parts, c, t)
        paid = pay_for_lifts(each, parts, c, before, walls, t, h)
        let_sleep(each, parts, c, before, walls, t, h)
        # not what steps take away from overlaps, and forces bring back
        stores = max(stored(parts, c, each.bench.mark, t) - low, 0.0)
        book(each.fed, max(min(lifted(parts, c, before, each.bench.mark, t, h), stores) - paid, 0.0))
        note_impulses(each, c, before)
    else:
        put_out_of_bodies(each.ways.obstacles, parts, c, t)
        remember(each, walls)
        wake_all(each)


@outlined
def settle(each: Any, c: Any, before: Any, walls: Any, h: Any) -> None:
    """Conclude what impulses have done."""
    book_moves(each, c, before, h)
    take_back(each, c, walls, UNNOTICED)
    remember(each, walls)
    move_on(each, c, h)


@outlined
def rest_at_once(each: Any, parts: Any, c: Any, t: Any, chosen: Any, walls: Any, calm: Any) -> None:
    """Impulses of chosen clusters at once, as at rest, and the friction that goes with them."""
    bench, pairs = each.bench, each.report[COUNT]
    if chosen.pairs > 0:
        k = 0
        while k < (1 if each.laws.friction is None else MOST_ROUNDS):
            rates(bench, c, chosen, pairs)
            find(bench.desk, each.a, chosen, float(calm))
            push_pairs(each, c, pairs)
            push_from_walls(each, c, pairs, walls)
            rub_walls(each, parts, c)
            if each.laws.friction is not None:
                rub_pairs(each, c, pairs)
            k += 1


@outlined
def apart_at_once(each: Any, parts: Any, c: Any, t: Any, chosen: Any, walls: Any) -> None:
    """Displacements of chosen clusters at once."""
    bench, pairs = each.bench, each.report[COUNT]
    if chosen.pairs > 0:
        farthest = begin_apart(each, c, chosen)
        find(bench.desk, each.a, chosen, ROUGHLY * farthest)
        shift_pairs(each, c, pairs)
        shift_from_walls(each, c, pairs, walls)
        put_on_walls(each, parts, c, t)
        for k in range(chosen.pairs):
            bench.desk.contacts[GIVEN, bench.desk.of[NUMBER, k]] = DONE


def impulses_of(site: Site, pairs: PairSet) -> Impulses:
    """Hard contacts among the particles of an island."""
    found = with_masses(site, near_pairs_of(site, pairs))
    count, colliders = site.whole.count, len(site.scenario.all_colliders)
    laws, names = laws_of(site), [each.name for each in tables_of(site)]
    rank, rolls = names.index(pairs.name), laws.rolling is not None
    mine = count if rank == 0 else 0  # the first one has room for all
    room, sides = PAIRS * mine + SOME, (SIDES * mine if colliders else 0) + SOME
    bench = new_bench(room, sides, colliders * len(site.state) + 1, mine, site.dtype, rolls)
    known = new_known(room + sides, mine, site.dtype, rolls)
    lag = methods_of(site.scenario)[pairs.groups[0]].lag
    ways, side = (
        site.common.setdefault("ways", new_ways(count, lag, site.obstacles)),
        sides_of(found.near, count),
    )
    heard = overheard_of(site, pairs.groups)
    report, fed, asleep = np.zeros(3, np.int64), np.zeros(2), nobody_sleeps(mine)
    return Impulses(*found, rank, bench, report, fed, known, asleep, laws, ways, side, heard)


def sides_of(near: Neighbours, count: int) -> Ints:
    """On which side of contacts particles are: all on one, which meets itself, or on two that meet each other."""
    side = np.zeros(count, np.int64)
    side[near.members] = ONE + (ONE << MEETS)
    if near.split is not None:
        side[near.members[: near.split]] = ONE + (OTHER << MEETS)
        side[near.members[near.split :]] = OTHER + (ONE << MEETS)
    return side
