"""The arguments of an island's kernels for its present particles: records, scratch arrays, and every thread's share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from particlesim.engine.constraints.constraint import Constraint
from particlesim.engine.coupled.again import COLUMNS, worthwhile
from particlesim.engine.coupled.gauss_radau import new_room
from particlesim.engine.coupled.wisdom_holman import new_orbits
from particlesim.engine.coupled.workspace import Part, Share, Work, new_rebounds, scratch, share_out
from particlesim.engine.implicit.linear_system import new_system
from particlesim.engine.interactions.bond_layout import FINEST, LEAST, chunk_size, order_of, owned
from particlesim.engine.interactions.hard.impulses import Impulses
from particlesim.engine.interactions.interaction import new_forms
from particlesim.engine.islands.joined import Joined
from particlesim.engine.state.columns import Columns
from particlesim.engine.state.table import SPIN
from particlesim.engine.step.contacts import Simple
from particlesim.engine.step.records import SOME, as_precision, contacts_record, dynamics_record
from particlesim.graph.graph import Island
from particlesim.groups.group import Group
from particlesim.integrators import Composition, GaussRadauMethod, ImplicitMethod, WisdomHolmanMethod
from particlesim.interactions import PairSet
from particlesim.model.arrays import Floats

Interactions = tuple[Any, ...]
"""Records of interactions (`interactions.interaction`), those that are added chunk by chunk first."""


class Layout:
    """The particles of an island and what acts on them, as kernels take them; made anew when there are other particles.

    `effort`: about as many springs as all that acts between particles takes the time of.
    """

    def __init__(
        self,
        structure: Island,
        joined: Joined,
        interactions: Interactions,
        constraint: Constraint | None,
    ) -> None:
        whole = joined.whole
        self.count, self.dtype = whole.count, whole.dtype
        self.interactions, self.constraint = interactions, constraint
        self.bounds, self.driven = joined.bounds, joined.driven
        self.parts = _parts(structure, self.bounds, self.dtype)
        self.effort = sum(each.effort for each in interactions)
        self.effort += 0 if constraint is None else constraint.effort
        self._cooling = _cooling(structure.groups, self.bounds)
        self._method = structure.method
        looks_back = (
            constraint is not None
            or any(part.contacts != Simple(()) for part in self.parts)
            or any(each.looks_back for each in self.interactions)
        )
        pieces = any(each.by_chunks for each in interactions) or constraint is not None
        pieces = pieces or isinstance(self._method, ImplicitMethod)
        self._chunk = chunk_size(self.count, LEAST if pieces else FINEST)
        self.work = scratch(
            self._method,
            self.count,
            self._chunk,
            self.dtype,
            looks_back=looks_back,
            cores=any(part.cores is not None for part in self.parts),
            spins=SPIN in whole.parts,
        )
        # Rods change what bounces once more.
        if constraint is None and any(map(meets, self.parts)):
            hard = sum(isinstance(each, Impulses) for each in interactions)
            room = new_rebounds(self._method, self.count, self.dtype, heaps=hard > 0)
            # Velocities that are late have to know of all that touches. Of others, what falls freely has nothing to give.
            late = room is not None and room.old > 0
            if late or (any(map(bounces, self.parts)) and (hard == 0 or hard < len(interactions))):
                self.work = self.work._replace(rebounds=room)
            if hard > 0 and any(worthwhile(part.contacts) for part in self.parts):
                self.work = self.work._replace(again=np.zeros((self.count, COLUMNS)))
        if isinstance(self._method, GaussRadauMethod):
            self.work = self.work._replace(radau=new_room(whole.memory[:, : self.count]))
        if isinstance(self._method, WisdomHolmanMethod):
            moved = len(interactions) > 1 or any(structure.forces)
            orbits = new_orbits(self._method, joined.states, interactions, moved=moved)
            self.work = self.work._replace(orbits=orbits)
        self._shares: dict[int, list[tuple[Interactions, Work, Share]]] = {}
        self.place_equations(joined)

    def place_equations(self, joined: Joined) -> None:
        """Make the equations of implicit methods for particles where they are now."""
        if isinstance(self._method, ImplicitMethod):
            bonds, _ = apart(self.interactions)
            system = new_system(bonds, joined.whole.x[:, : self.count], self.dtype)
            self.work = self.work._replace(system=system)
            self._shares.clear()

    @property
    def movable(self) -> bool:
        """Whether its particles can be stepped in another order (`in_space`)."""
        work = self.work
        plain = self.constraint is None and not self.driven and bool(self.interactions)
        plain = plain and all(each.movable for each in self.interactions)
        return plain and work.system is None and work.radau is None and work.orbits is None

    def renew(self, *, fresh: bool = True) -> None:
        """Let interactions forget what they have found out: all that a resumed run would not know where it is `fresh`, else
        what is of no more use."""
        self.take(
            tuple(
                each.renewed() if (fresh and not each.resumes) or not each.lasts else each
                for each in self.interactions
            )
        )

    def recall(self) -> None:
        """Let interactions know that what steps change has been set to what it was at another time."""
        self.take(tuple(each.recalled() for each in self.interactions))

    def take(self, interactions: Interactions) -> None:
        """Have the same interactions with other arrays."""
        if any(new is not old for new, old in zip(interactions, self.interactions, strict=True)):
            self.interactions = interactions
            self._shares.clear()

    def cooled(self, columns: Columns) -> Columns:
        """Columns of these particles with the laws by which they cool."""
        if columns.thermal is None or self._cooling is None:
            return columns
        rate, ambient = self._cooling
        return columns._replace(thermal=columns.thermal._replace(rate=rate, ambient=ambient))

    def shares(self, threads: int) -> list[tuple[Interactions, Work, Share]]:
        """What each of some threads works on: its pieces of bonds, scratch, and particles with the other interactions."""
        if threads not in self._shares:
            self._shares[threads] = self._shared(threads)
        return self._shares[threads]

    def alone(self, interactions: Interactions) -> tuple[Interactions, Work, Share]:
        """What one thread works on, with interactions in another state."""
        ((mine, work, share),) = self.shares(1)
        bonds, elements = apart(interactions)
        bonds = tuple(each.with_changed(now.changing()) for each, now in zip(mine, bonds, strict=True))
        elements = tuple(
            each.with_changed(now.changing()) for each, now in zip(share.elements, elements, strict=True)
        )
        return bonds, work, share._replace(elements=elements)

    def _shared(self, threads: int) -> list[tuple[Interactions, Work, Share]]:
        chunk = self._chunk
        chunks = -(-self.count // chunk)
        bonds, elements = apart(tuple(each.in_team(threads) for each in self.interactions))
        found, forms = [], () if self.work.system is None else new_forms(elements, self.dtype)
        for share in share_out(self.count, threads, chunk, self.driven, elements, self.constraint):
            mine = tuple(
                bond._replace(table=table, begin=begin)
                for bond in bonds
                for table, begin in [owned(bond.table, share.first, share.last, chunk, chunks)]
            )
            tables = [bond.table for bond in mine]
            order = order_of(tables, share.first, share.last, chunk, chunks, wait=bool(share.elements))
            found.append((mine, _own(self.work, share, forms, self.dtype), share._replace(order=order)))
        return found


def meets(part: Part) -> bool:
    """Whether particles of a group meet colliders at the time of impact."""
    contacts: Any = part.contacts
    return not isinstance(contacts, Simple) and len(contacts.continuous) > 0


def bounces(part: Part) -> bool:
    """Whether particles of a group bounce off colliders at the time of impact."""
    contacts: Any = part.contacts
    return not isinstance(contacts, Simple) and any(c.response.bounce > 1 for c in contacts.continuous)


def apart(interactions: Interactions) -> tuple[Interactions, Interactions]:
    """Those that are added chunk by chunk, and the others."""
    by_chunks = tuple(each for each in interactions if each.by_chunks)
    return by_chunks, interactions[len(by_chunks) :]


def _own(work: Work, share: Share, forms: tuple[Any, ...], dtype: Any) -> Work:
    """Scratch arrays of a thread: those of the island, but for what each thread has to itself; `forms` are those that
    threads have together."""
    work = work._replace(pull=np.zeros_like(work.pull), spread=np.zeros_like(work.spread))
    if work.orbits is not None:
        return work._replace(orbits=work.orbits.kicking(share.elements))
    if work.system is None:
        return work
    system = work.system
    own = system._replace(
        pull=np.zeros_like(system.pull),
        lanes=np.zeros_like(system.lanes),
        forms=new_forms(share.elements, dtype, forms),
    )
    return work._replace(system=own)


def _pulls(island: Island) -> bool:
    """Whether its particles act on each other otherwise than by impulses."""
    struck = [isinstance(each, PairSet) and each.law.by_impulses for each in island.interactions]
    return bool(island.constraints) or not all(struck)


def _parts(island: Island, bounds: Sequence[int], dtype: Any) -> tuple[Part, ...]:
    """The groups of an island as kernels take them; `bounds` are the borders of their rows."""
    parts = []
    for k, group in enumerate(island.groups):
        colliders, cores = island.colliders[k], None
        heard = dict(zip(map(id, colliders), island.heard[k], strict=True)) if island.heard else {}
        pulled = any(force.by_place for force in island.forces[k]) or _pulls(island)
        if island.touched_softly(group.name):
            bouncing = [each for each in colliders if each.contact == "bounce"]
            colliders = tuple(each for each in colliders if each.contact != "bounce")
            if bouncing:
                cores = contacts_record(
                    bouncing, group, dtype, few=SOME, turning=pulled, until=island.duration
                )
        forces = tuple(force.record() for force in island.forces[k])
        turns = island.spins(group.name) and any(each.rubs for each in colliders)
        rubbing = tuple(each.record() for each in colliders) if turns else ()
        numbers = [heard.get(id(each)) for each in colliders]
        contacts = contacts_record(
            colliders,
            group,
            dtype,
            numbers,
            smooth=turns,
            turning=pulled,
            even=not pulled,
            late=island.method.lag != 0 and not isinstance(island.method, Composition),
            until=island.duration,
        )
        rolling = island.rolling_friction(group.name) if turns else None
        part = Part(
            dynamics_record(group), forces, contacts, bounds[k], bounds[k + 1], cores, rubbing, rolling
        )
        parts.append(as_precision(part, dtype))
    return tuple(parts)


def _cooling(groups: Sequence[Group], bounds: Sequence[int]) -> tuple[Floats, Floats] | None:
    """Rate of cooling [1/s] and temperature around [K] of every particle, shape [n]; None where no group cools."""
    if all(group.cooling is None for group in groups):
        return None
    number = np.diff(bounds)
    laws = [
        (0.0, 0.0) if each.cooling is None else (each.cooling.rate, each.cooling.ambient) for each in groups
    ]
    rate, ambient = (np.repeat(column, number) for column in zip(*laws, strict=True))
    return rate, ambient
