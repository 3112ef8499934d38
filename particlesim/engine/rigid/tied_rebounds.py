"""Impacts of particles that hang on springs to bodies, on colliders and on each other.

Such a particle begins its own step with all of the velocity Δv that its springs give it in this step, though at an impact
they have given it but a part; the rest comes afterwards, and is turned around with what it has. With the time r that is left
of the step then the energy is wrong by −2 r f·n |v·n|, of first order in the step, with the normal n.

So after that step the velocity along n is put right. Two that have come together at u moved apart by D; a, along n and over
the reduced mass, is the mean of what springs give at both ends of that displacement, whose energy it has changed. Such steps
keep E − h² w·K w/8, with the stiffness K of the springs and the velocity w relative to the body. So with κ = h² K along n,
and p = h² n·K w/4, both over the reduced mass, where half a step before the end tells K w, an elastic impact changes the
velocity along n by Δ:

    ½ (1 − κ/4) Δ² − (u + p) Δ − a D = 0,

and another one by (1 + e)/2 of that, with 2 D/(1 + e). It keeps the energy also where the force changes on that way, or
turns against the velocity, as that of a damper does: else an impact gives k u² h²/6 in the mean, with a stiffness k.

What has happened in that step is seen from its ends. What hits a collider comes to it and leaves it, and both ways at these
speeds take the step together (`MISSES`); two that hit each other would have met, and one gets what the other one loses. What
turns around for other reasons, on a taut rope, is not among these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.colliders.moving import MovingRecord, frame_at, surface_velocity
from particlesim.compiler import kernel, outlined
from particlesim.engine.rigid.bodies import row
from particlesim.engine.rigid.loads import rows_of
from particlesim.engine.rigid.narrow import minus
from particlesim.engine.rigid.probing import away, probe
from particlesim.engine.rigid.rotation import dot
from particlesim.engine.rigid.support import AROUND, Support, bucket, is_in, new_cells, sort_in
from particlesim.engine.state.group_state import GroupState
from particlesim.laws.registry import gap
from particlesim.model.arrays import Floats, Ints

MISSES = 0.2
"""By how much of the step the two ways of an impact may miss it: where they bend, and as other forces change speeds."""
LIGHTEST, HEAVIEST = 0.2, 2.0
"""How much the velocity along the normal counts, 1 − κ/4: at the limit of stability it would not at all."""
NEXT = 1e-6
"""How far two are moved apart at least, as a part of their way in the step: less is rounding, and gives nothing."""
NOTICED = 0.05
"""An impact changes a velocity by more than this part of what springs give in the step."""
SAME_FACE = 0.9
"""The cosine of the angle between two normals of a collider from which on they are those of one face of it."""
EACH = 8
"""Impacts of one particle in a step, at most."""

Pulls = Mapping[str, tuple[Ints, Floats]]
"""Of every group rows, in their order, and the forces of springs to bodies on these [N], shape [n, 3]."""


class Crowd(NamedTuple):
    """Particles in a step: their kinds, as colliders and contacts know them, radii, inverse masses, 0 of those that nothing
    moves, and which are still there (1) [n]; places and velocities before it, and after it [3, n]."""

    kind: Any
    radius: Any
    w: Any
    here: Any
    x: Any
    v: Any
    there: Any
    after: Any


class Impacts(NamedTuple):
    """Impacts in a step: the particle, and the one that it has hit, −1 where that is a collider (`who` [2, n]); the normal
    towards the particle [3, n]; the speeds at which they came together and parted [m/s], and by how much that has moved them
    apart [m] (`how` [3, n])."""

    who: Any
    normal: Any
    how: Any


class Flight(NamedTuple):
    """Particles of one group before their own step: ids, their kind, places and velocities [3, n]; which of them, in their
    order, hang on springs, what bodies have given these of their velocities, by how much all else is expected to change
    them [3, number of those], and which of these contacts have pressed among bodies."""

    state: GroupState
    ids: Ints
    kind: int
    x: NDArray[np.floating[Any]]
    v: NDArray[np.floating[Any]]
    hang: Ints
    given: Floats
    awaited: Floats
    pressed: NDArray[np.bool_]

    def struck(self) -> NDArray[np.bool_]:
        """After the step: which of those on springs something else has moved, too, as an impact does."""
        rows = rows_of(self.state, self.ids[self.hang])
        blow = self.state.v[:, rows] - self.v[:, self.hang] - self.awaited
        much = NOTICED**2 * (self.given**2).sum(axis=0)
        loose = (self._weights(rows) > 0) & ~self.pressed  # what a body has hit, too, has got that at once
        return np.asarray(((blow**2).sum(axis=0) > much) & loose)

    def now(self) -> tuple[Any, ...]:
        """Rows of all after the step, and the columns of `Crowd`."""
        rows = rows_of(self.state, self.ids)
        ends = (each[:, rows].astype(float) for each in (self.state.x, self.state.v))
        places = (self.x.astype(float), self.v.astype(float), *ends)
        radius = self.state.radius[rows].astype(float)
        here = (rows >= 0).astype(np.int64)
        return rows, (np.full(len(rows), self.kind), radius, self._weights(rows), here, *places)

    def _weights(self, rows: Ints) -> Floats:
        here = rows >= 0
        if self.state.clocked:
            here = here & np.isfinite(self.state.start[rows])
        return np.where(here, 1 / self.state.mass[rows].astype(float), 0.0)


def flights_of(
    chosen: Sequence[tuple[GroupState, Ints]],
    hang: Mapping[str, Ints],
    held: int,
    touch: Floats,
    given: Floats,
    awaited: Floats,
    pressed: NDArray[np.bool_],
) -> list[Flight]:
    """Particles before their own step: those that `hang` on springs, rows by groups, and all that may touch them, by kinds
    [kinds, kinds]. `chosen` are the guests among bodies, rows of groups in the order of kinds, the first ones those that
    rods hold; bodies have given them velocities, changes by all else are awaited [3, guests], and contacts among
    bodies have `pressed` some."""
    kinds = [k for k, (state, _) in enumerate(chosen) if k >= held and state.name in hang]
    flights, first = [], 0
    for kind, (state, rows) in enumerate(chosen):
        met = bool((touch[kind, kinds] > 0).any())
        if kind >= held and (met or kind in kinds):
            tied = hang.get(state.name, np.empty(0, np.int64))
            at = first + np.searchsorted(rows, tied)
            some = slice(state.count) if met else tied
            places = (state.x[:, some].copy(), state.v[:, some].copy())
            which = tied if met else np.arange(len(tied))
            ids, by = state.id[some].copy(), (given[:, at], awaited[:, at])
            flights.append(Flight(state, ids, kind, *places, which, *by, pressed[at]))
        first += len(rows)
    return flights


class Company:
    """The particles of flights after their step of length h."""

    def __init__(self, flights: Sequence[Flight], struck: Sequence[NDArray[np.bool_]], h: float) -> None:
        found = [flight.now() for flight in flights]
        self._groups = [(flight.state, rows) for flight, (rows, _) in zip(flights, found, strict=True)]
        columns = zip(*(each for _, each in found), strict=True)
        self.crowd = Crowd(*(np.concatenate(each, axis=-1) for each in columns))
        number = self.crowd.w.size
        self.hangs, self.struck, self.pressed = np.zeros((3, number), np.bool_)
        self.steady, self.awaited = np.zeros((2, 3, number))
        """Accelerations by springs that the step has had [m/s²], and changes of velocities by all else that were awaited
        [m/s], shape [3, n]."""
        for flight, hit, (_, _, part) in zip(flights, struck, self._parts(), strict=True):
            mine = part.start + flight.hang
            self.hangs[mine], self.struck[mine], self.pressed[mine] = True, hit, flight.pressed
            self.steady[:, mine], self.awaited[:, mine] = flight.given / h, flight.awaited

    def place(self, x: Floats, v: Floats, some: NDArray[np.bool_]) -> None:
        """Some of them [n] are at x with v [3, n]."""
        for state, rows, part in self._parts():
            mine = some[part]
            state.x[:, rows[mine]], state.v[:, rows[mine]] = x[:, part][:, mine], v[:, part][:, mine]

    def let_know(self, change: Floats, some: NDArray[np.bool_]) -> dict[str, float]:
        """The velocities of some have changed by this [m/s], shape [3, n]. Returns the energy of that, by groups [J]."""
        gained: dict[str, float] = {}
        for state, rows, part in self._parts():
            mine = rows[some[part]]
            by, v = change[:, part][:, some[part]], self.crowd.after[:, part][:, some[part]]
            state.let_know(mine, by)
            joule = float((state.mass[mine] * (by * (v + 0.5 * by)).sum(axis=0)).sum())
            gained[state.name] = gained.get(state.name, 0.0) + joule
        return gained

    def pulled(self, pulls: Pulls) -> Floats:
        """By how much springs accelerate them [m/s²], shape [3, n]."""
        found = np.zeros_like(self.steady)
        for state, rows, part in self._parts():
            if state.name in pulls:
                all_rows, force = pulls[state.name]
                at = np.searchsorted(all_rows, rows)
                mine = self.hangs[part]
                found[:, part][:, mine] = force[at[mine]].T * self.crowd.w[part][mine]
        return found

    def _parts(self) -> Iterator[tuple[GroupState, Ints, slice]]:
        first = 0
        for state, rows in self._groups:
            yield state, rows, slice(first, first + len(rows))
            first += len(rows)


def put_right(
    flights: Sequence[Flight], support: Support, pulls: Callable[[], Pulls], end: float, h: float
) -> dict[str, float]:
    """After a step of length h, which ends at this time [s]: those that have hit something get the velocities that they
    should have. `pulls` tells the forces of springs on particles as they are. Returns the work of contact, by groups [J]."""
    hits = [flight.struck() for flight in flights]
    if not any(hit.any() for hit in hits):
        return {}
    company = Company(flights, hits, h)
    crowd, struck = company.crowd, company.struck
    impacts = _impacts(crowd, struck, support, end, h)
    clear = (impacts.who[1] < 0) | ~company.pressed[impacts.who[1]]
    (i, j), n, (came, parted, apart) = (each[:, clear] for each in impacts)
    if not i.size:
        return {}
    some = np.zeros_like(struck)
    some[i] = some[j[j >= 0]] = True
    ends, fast = crowd.x + h * (crowd.v + 0.5 * company.awaited), crowd.v + company.awaited
    pulled = []
    for x, v in ((ends, fast), (crowd.there, fast), (crowd.there, crowd.after)):
        company.place(x, v, some)
        pulled.append(company.pulled(pulls()))
    steady = company.steady

    def along(a: Floats) -> Floats:
        return np.asarray(((a[:, i] - np.where(j >= 0, a[:, j], 0.0)) * n).sum(axis=0))

    lively, mass = np.minimum(parted / came, 1.0), 1 / (crowd.w[i] + np.where(j >= 0, crowd.w[j], 0.0))
    pull = along(0.5 * (pulled[0] + pulled[2]))
    heavy = 1 - 0.25 * h**2 * along(pulled[0] - pulled[1]) / apart
    heavy = np.clip(heavy, LIGHTEST, HEAVIEST)
    early = np.maximum(came + 0.5 * h * along(steady - pulled[0]), 0.0)
    both = early + np.sqrt(np.maximum(early**2 + 4 * heavy / (1 + lively) * pull * apart, 0.0))
    faster = np.maximum(0.5 * (1 + lively) * (both / heavy - 2 * came), -parted)
    change = np.zeros_like(steady)
    np.add.at(change.T, i, (mass * faster * n * crowd.w[i]).T)
    np.add.at(change.T, j[j >= 0], -(mass * faster * n * crowd.w[j]).T[j >= 0])
    company.place(crowd.there, crowd.after + change, some)
    work = company.let_know(change, (change != 0).any(axis=0))
    taken = mass * (pull - along(steady)) * apart
    kinds = crowd.kind[i]
    for flight in flights:
        work[flight.state.name] -= float(taken[kinds == flight.kind].sum())
    return work


def _impacts(crowd: Crowd, struck: NDArray[np.bool_], support: Support, end: float, h: float) -> Impacts:
    """The impacts of particles that something has struck [n]."""
    room = EACH * int(struck.sum())
    impacts = Impacts(np.zeros((2, room), np.int64), np.zeros((3, room)), np.zeros((3, room)))
    swiftest = float(np.sqrt((crowd.after**2).sum(axis=0).max()))
    cells, meet = new_cells(crowd.radius), bool((support.pairs.touch > 0).any())
    width = cells.width + 2 * (1 + MISSES) * h * swiftest
    cells = cells._replace(width=width if meet else 0.0)
    number = find_impacts(
        support.walls, support.pairs.touch, cells, crowd, struck.astype(np.int64), impacts, end, h
    )
    return Impacts(*(each[:, :number] for each in impacts))


@kernel
def find_impacts(
    walls: Any, touch: Any, cells: Any, crowd: Any, struck: Any, impacts: Any, end: Any, h: Any
) -> int:
    """Note the impacts of particles that are struck [n] in a step of h, which ends at this time, on walls and on others that
    they `touch` [kinds, kinds], unless cells have no width, as far as there is room. Returns how many there are."""
    number = 0
    for wall in walls:
        for m in range(struck.size):
            if (struck[m] > 0) & (wall.on[crowd.kind[m]] > 0):
                number = hit_wall(wall, crowd, impacts, number, m, end, h)
    if cells.width > 0:
        sort_in(cells, crowd.there, crowd.here)
        for m in range(struck.size):
            for k in range(AROUND if struck[m] > 0 else 0):
                o = cells.first[bucket(cells, m, k)]
                while o >= 0:
                    new = (o != m) & ((struck[o] == 0) | (m < o))
                    if new and touch[crowd.kind[m], crowd.kind[o]] > 0 and is_in(cells, o, m, k):
                        number = hit_each_other(crowd, impacts, number, m, o, h)
                    o = cells.next[o]
    return number


@outlined
def hit_wall(wall: Any, crowd: Any, impacts: Any, number: Any, m: Any, end: Any, h: Any) -> int:
    """Note it if particle m has hit a wall."""
    p, speed = probe(row(crowd.there, m), crowd.radius[m], end), row(crowd.after, m)
    distance = gap(wall.shape, p)
    if distance < (1 + MISSES) * h * np.sqrt(dot(speed, speed)):
        n, began = away(wall.shape, p), probe(row(crowd.x, m), crowd.radius[m], end - h)
        along = dot(surface_speed(wall.shape, p, end), n)
        came, parts = along - dot(row(crowd.v, m), n), dot(speed, n) - along
        before = gap(wall.shape, began)
        if dot(away(wall.shape, began), n) < SAME_FACE:  # another face of it was nearer
            before = distance + dot(minus(row(crowd.x, m), row(crowd.there, m)), n) + h * along
        if (came > 0) & (parts > 0) and abs(before / came + distance / parts - h) < MISSES * h:
            number = note(impacts, number, m, -1, n, (came, parts, distance - before + h * came), h)
    return number


@outlined
def hit_each_other(crowd: Any, impacts: Any, number: Any, m: Any, o: Any, h: Any) -> int:
    """Note it if two particles have hit each other: each gets what the other one loses."""
    d, reach = minus(row(crowd.there, m), row(crowd.there, o)), crowd.radius[m] + crowd.radius[o]
    length = np.sqrt(dot(d, d))
    if length > 0:
        n, e = (d[0] / length, d[1] / length, d[2] / length), minus(row(crowd.x, m), row(crowd.x, o))
        came = -dot(minus(row(crowd.v, m), row(crowd.v, o)), n)
        parts = dot(minus(row(crowd.after, m), row(crowd.after, o)), n)
        one = dot(minus(row(crowd.after, m), row(crowd.v, m)), n) * crowd.w[o]
        other = dot(minus(row(crowd.v, o), row(crowd.after, o)), n) * crowd.w[m]
        before, after = np.sqrt(dot(e, e)) - reach, length - reach
        alike = abs(one - other) <= MISSES * max(abs(one), abs(other))
        if crowd.w[o] == 0:  # one that is led gives energy, and one that is held does not move
            alike = (crowd.v[0, o] == 0) & (crowd.v[1, o] == 0) & (crowd.v[2, o] == 0)
        meet = (before < (1 + MISSES) * h * came) & (after < (1 + MISSES) * h * parts)
        if (came > 0) & (parts > 0) & alike & meet:
            number = note(impacts, number, m, o, n, (came, parts, after - before + h * came), h)
    return number


def note(impacts: Any, number: Any, m: Any, o: Any, n: Any, how: Any, h: Any) -> int:
    """Note an impact that has moved two apart, if there is room."""
    if (how[2] > NEXT * h * how[0]) & (number < impacts.how.shape[1]):
        impacts.who[0, number], impacts.who[1, number] = m, o
        for axis in range(3):
            impacts.normal[axis, number], impacts.how[axis, number] = n[axis], how[axis]
        number += 1
    return number


def surface_speed(shape: Any, p: Any, t: Any) -> Any:
    """The velocity of a collider's body at a place [m/s]."""
    if isinstance(shape, MovingRecord):
        return surface_velocity(shape, frame_at(shape, t, p.x), p.x, p.y, p.z)
    return 0.0, 0.0, 0.0
