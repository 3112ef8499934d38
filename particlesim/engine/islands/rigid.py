"""Islands of rigid bodies: all bodies of a scenario, which touch each other and colliders."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.bodies import Bodies as BodyGroup
from particlesim.engine.faults import Fault, Unclosed
from particlesim.engine.islands.base import BaseIsland, Intrusion, Look
from particlesim.engine.islands.births import Births
from particlesim.engine.islands.joined import Joined
from particlesim.engine.islands.laps import Laps
from particlesim.engine.islands.rigid_scene import are_heard, colliders_of, scene_of, some_fall, still_of
from particlesim.engine.ledger.sums import measure
from particlesim.engine.rigid.bodies import (
    FEATURES,
    WORLD,
    Bodies,
    Motion,
    new_contacts,
    new_memory,
    new_motion,
)
from particlesim.engine.rigid.fluids import through_surface
from particlesim.engine.rigid.grains import put_out
from particlesim.engine.rigid.hearing import share_out, with_particles
from particlesim.engine.rigid.joint_system import (
    made_joints,
    require_speeds,
)
from particlesim.engine.rigid.joints import ROD
from particlesim.engine.rigid.kept_back import SetOut, keep_before_walls, set_out
from particlesim.engine.rigid.kernel import (
    ASKS,
    FULL,
    GOOD,
    UNHELD,
    Scene,
    close_joints,
    hold_ends,
    hold_guests,
    look_for_contacts,
    step_bodies,
    sum_energies,
    sum_forces_on,
    velocities_of,
)
from particlesim.engine.rigid.loads import Loads
from particlesim.engine.rigid.memory import copy_of, larger
from particlesim.engine.rigid.obstacles import Obstacles, begin_step, end_step, give, obstacles_of
from particlesim.engine.rigid.rods import held_rows, rod_lines, seats_of
from particlesim.engine.rigid.room import no_room
from particlesim.engine.rigid.spring_layout import body_springs, lines
from particlesim.engine.rigid.springs import stored
from particlesim.engine.rigid.stiffness import longest_step
from particlesim.engine.rigid.support import Support
from particlesim.engine.rigid.ties import Ties
from particlesim.engine.rigid.touching import Touching, contacts_of, no_contact
from particlesim.engine.rigid.visit import (
    Left,
    Visitors,
    fill,
    guests_of,
    inform,
    joined,
    learn_bend,
    left,
    lies,
    renew,
)
from particlesim.engine.state.columns import Columns, copied
from particlesim.engine.state.group_state import Deaths, GroupState
from particlesim.graph.graph import Island
from particlesim.model.arrays import Floats, Ints
from particlesim.process.threads import Team
from particlesim.scenario.reach import codes_of_groups
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

DEEP = 10.0
"""Overlap at the start of which psim warns, in units of the overlap that contacts tolerate."""
TRIED = 8
"""Overlaps at the start of which it is looked whether the body can get out."""
ROUNDING = 1e-12
"""Part of a kinetic energy that rounding makes."""
ROOM = 16
"""Contacts for each body that there is room for at first."""


class RigidIsland(BaseIsland):
    """All rigid bodies; their states are stretches of the island's arrays. `particles` are those of other islands, which
    springs and rods may tie to bodies. Raises UsageError for joints and ties that cannot be."""

    def __init__(
        self,
        scenario: Scenario,
        structure: Island,
        states: Sequence[GroupState],
        ids: Mapping[str, tuple[int, int]],
        particles: Mapping[str, GroupState],
    ) -> None:
        super().__init__(scenario, structure, states, ids)
        self._scenario, self._particles = scenario, particles
        self._joined, self._structure = Joined(self.states), structure
        groups = [group for group in structure.groups if isinstance(group, BodyGroup)]
        count = self._joined.whole.count
        owner = np.repeat(np.arange(len(groups)), [state.count for state in self.states])
        self._still = still_of(groups, owner)
        self._shapes = tuple(group.shape for group in groups)
        self._seen: tuple[tuple[Any, ...], Bodies] | None = None
        self._obstacles: Obstacles | None = None
        self._blows: list[Floats] = []
        self._motion = new_motion(count)
        offset = dict(zip((group.name for group in groups), self._joined.bounds, strict=False))
        held = held_rows(scenario, particles)
        seats = seats_of(offset, {state.name: state.count for state in self.states}, held, count)
        laid = body_springs(scenario, seats, self.bodies(), particles)
        # Those to particles come last, as they do in steps with guests.
        self._springs = tuple(sorted(laid, key=lambda each: each.tied is not None))
        self.ties = Ties(laid, held, particles)
        """The springs and rods to particles."""
        self.loads = Loads()
        """What else acts on particles that touch bodies."""
        if self.books is not None:
            self.ties.refuse_led()
        self._crew: tuple[Bodies, Motion] | None = None
        self._made = made_joints(scenario, seats, self._on_rods()[0])
        self.broken = {each.name: each.springs.broke for each in laid if each.breaks}
        """When each of the springs that may break did [s], infinity while it holds, by the names of their sets."""
        given = (structure, groups, self._joined.bounds, owner, self._joined.whole)
        self._scene, self._order = scene_of(*given, scenario, self._made, self._springs, self.books)
        self.memory = new_memory(ROOM * count + 64, count)
        # Kernels keep the order by insertion, which is quick where little has changed only.
        self.memory.order[:] = np.argsort(self._joined.whole.x[0, :count], kind="stable")
        self._falls = some_fall(structure, groups, scenario)
        self._contacts = new_contacts(ROOM * count + 64, self._falls)
        self._kept: list[NDArray[Any]] = []
        self._kept_memory = self.memory
        self.kept_from = 0
        self._party: tuple[Bodies, Scene, Motion] | None = None
        self._asked = False
        swift = self._scene.swift
        self.watch, self.tired, self.alone = swift.watch, swift.tired, swift.alone
        """Which bodies have been swift, how often they met more in half a step than is followed (`swift`), and which of them
        have been left to their drifts in this step (`oncoming`)."""
        self.visitors: Visitors | None = None
        """Particles that make the next step among the bodies."""
        self.pull_on: Callable[[float, Floats | None], tuple[Floats, Floats]] | None = None
        """By how much what else acts on them accelerates them at a time [m/s²], if they are shifted by so much, and by how
        much they were in the precision of their places, shape [3, n]."""
        self.guests: tuple[str, ...] = ()
        """The names of their groups, by kind."""
        self.support: Support
        """What they lie on besides."""
        self.told: Floats | None = None
        """Their impacts that emitters hear, as `hearing` has them."""
        self.left: Left
        """The visitors after the step."""
        self._set_out: SetOut
        self.stayed = np.zeros(1, np.int64)
        """How often particles on rods have stayed where they were, with all that hangs on them (`kept_back`)."""
        if self._made:
            self._close()

    def bodies(self) -> Bodies:
        """The bodies as kernels take them: the same tuple as long as they have the same arrays, which kernels know again."""
        whole = self._joined.whole
        arrays, n = (whole.x, whole.v, whole.turn, whole.spin), whole.count
        seen = self._seen
        if seen is None or n != seen[1].w.size or any(map(operator.is_not, arrays, seen[0])):
            seen = self._seen = arrays, Bodies(*(each[:, :n] for each in arrays), *self._still)
        return seen[1]

    @property
    def slop(self) -> float:
        """The overlap that contacts tolerate [m]."""
        return self._scene.slop

    def in_the_way_of(self, groups: Sequence[str]) -> Obstacles | None:
        """The bodies, for particles of these groups in an island; None if they touch none."""
        names = [state.name for state in self.states]
        found = contacts_of(self._scenario, names)
        if not any(name in found for name in groups):
            return None
        if self._obstacles is None:
            self._obstacles = obstacles_of(self.bodies(), waits=are_heard(self._scenario, self.states))
        laws = (found.get(name) or no_contact(len(names)) for name in groups)
        touching = Touching(*(np.array(column) for column in zip(*laws, strict=True)))
        mine = np.zeros_like(self._obstacles.given)
        self._blows.append(mine)
        return self._obstacles._replace(touching=touching, mine=mine)

    def take_blows(self) -> None:
        """After all islands have made a step: bodies get what particles have given them that others sent to them."""
        if self._obstacles is not None and self._obstacles.given.any():
            give(self._obstacles, self.bodies())

    def _close(self) -> None:
        """Close all joints at the start, where ends miss each other by rounding and lengths by a little."""
        b, motion = self._on_rods()
        given = b.v.copy(), b.spin.copy()
        close_joints(self._scene, b, motion)
        self._take(b)
        require_speeds(self._scenario, self._made, b, given)

    def fit(self) -> None:
        if self._made:
            b, motion = self._on_rods()
            close_joints(self._scene, b, motion)
            self._take(b)

    def _on_rods(self) -> tuple[Bodies, Motion]:
        """The bodies with the particles that rods hold at them, and room for what they do."""
        b = self.bodies()
        if not self.ties.held:
            return b, self._motion
        visitors = self.ties.visitors(held=True)
        if self._crew is None:
            whole = joined(b, visitors)
            self._crew = whole, new_motion(whole.w.size)
        fill(self._crew[0], b, visitors)
        return self._crew

    def _take(self, whole: Bodies) -> None:
        """Bodies and particles on rods have become those of `_on_rods`."""
        if self.ties.held:
            self._have(whole)
            self.ties.take(whole.x[:, self._joined.whole.count :], whole.v[:, self._joined.whole.count :])

    def _have(self, whole: Bodies) -> None:
        """Bodies have become the first ones of others."""
        b = self.bodies()
        for mine, after in zip((b.x, b.v, b.turn, b.spin), whole[:4], strict=True):
            mine[:] = after[:, : b.w.size]

    def hold_ends(self, step: int, pulls: Callable[[], Floats], *, touched: bool) -> Fault | None:
        """After all islands have made a step: rods to particles fit again. What that takes from particles that have touched
        a collider is the work of contact. `pulls` tells how much forces accelerate those on rods [3, held]."""
        gained = self.ties.arrive(self.dt, pulls)
        if self.books is not None and gained:
            self.books.add("contact", gained)
        if not self.ties.held:
            return None
        whole, motion = self._on_rods()
        book = self.books is not None and touched
        before = _kinetic(whole, motion) if book else 0.0
        held = hold_ends(self._scene, whole, motion, self._joined.whole.count, 0.5 * self.dt)
        if held:
            given = (self._scene, self.support, self._set_out, whole, motion)
            held, stayed = keep_before_walls(*given, step * self.dt, self.dt)
            self.stayed[0] += stayed
        if book and self.books is not None:
            self.books.add("contact", _kinetic(whole, motion) - before + self.ties.unforeseen())
        self._take(whole)
        return None if held else self._fault(step, opened=True)

    def advance(
        self, first: int, last: int, team: Team, laps: Laps | None = None, look: Look | None = None
    ) -> tuple[Births | None, Deaths | None, Fault | None]:
        if self.visitors is not None:
            fault = self._receive(first, self.visitors)
            self._gather()
            return None, None, fault
        done, report = first, np.zeros(2)
        while done < last:
            now = (self.bodies(), self._contacts, self._motion, self.memory)
            done += step_bodies(self._scene, *now, done, last - done, self.dt, report)
            if done < last and report[0] != FULL:
                fault = self._fault(done, opened=report[0] == UNHELD)
                self.go_back()
                return None, None, fault
            if done < last:
                self._make_room(2 * int(report[1]))
        self._gather()
        return None, None, None

    def _receive(self, step: int, visitors: Visitors) -> Fault | None:
        """A step with particles among the bodies."""
        b, report = self.bodies(), np.zeros(2)
        if self._obstacles is not None:
            begin_step(self._obstacles, b)
            for given in (self._obstacles.given, *self._blows):
                given[:] = 0.0
        whole, scene, motion = self._received(b, visitors)
        self._set_out = set_out(visitors, whole, b.w.size)
        guests, hurried = scene.guests, (self.watch.copy(), self.tired.copy(), self.alone.copy())
        if self._asked and self.pull_on is not None:  # as it would be asked for again
            visitors = inform(guests, visitors, self.pull_on(step * self.dt, None)[0], self.dt)
        while not step_bodies(scene, whole, self._contacts, motion, self.memory, step, 1, self.dt, report):
            if report[0] == ASKS and self.pull_on is not None:
                if guests.asked[0] == 0:
                    visitors = inform(guests, visitors, self.pull_on(step * self.dt, None)[0], self.dt)
                if guests.probe.any():
                    pull, shift = self.pull_on(step * self.dt, guests.probe)
                    learn_bend(guests, shift, pull)
                guests.asked[0] = 2
            elif report[0] == FULL:
                self._make_room(2 * int(report[1]))
            else:
                return self._fault(step, opened=report[0] == UNHELD)
            fill(whole, b, visitors)  # from its beginning
            self.watch[:], self.tired[:], self.alone[:] = hurried
            report[0] = GOOD
        self._have(whole)
        if self._obstacles is not None:
            n = b.w.size
            end_step(self._obstacles, b, guests.free, motion.pull[:n])
        self.told = share_out(scene.hearing, self._scene.hearing)
        self._asked, self.visitors = lies(guests), visitors
        self.left = left(whole, self._contacts, guests, visitors, step * self.dt, self.dt)
        return None

    def put_out(self, x: Floats, there: Ints) -> bool:
        """After all islands have made a step: put guests at x [3, n] that are `there` [n] and have come deep into
        bodies less deep into them; whether there are any."""
        if self._party is None:
            return False
        return bool(put_out(self.bodies(), self._party[1].guests, x, there))

    def hold_guests(self, x: Floats, v: Floats, turning: Floats, there: Ints) -> tuple[Floats, Floats] | None:
        """After all islands have made a step: the velocities and angular velocities of the guests of this step where they
        lie on bodies, from those that they have now [3, n]; None where none does. Who is not `there` any more takes no
        part."""
        if self._party is None or self.ties.held:
            return None
        whole, scene, motion = self._party
        b, n, guests = self.bodies(), self._joined.whole.count, scene.guests
        for mine, now in zip(whole[:4], (b.x, b.v, b.turn, b.spin), strict=True):
            mine[:, :n] = now
        inertia = whole.inertia[0, n:]
        turns = np.isfinite(inertia)
        whole.x[:, n:], whole.v[:, n:] = x, v
        whole.spin[:, n:] = np.where(turns, turning * np.where(turns, inertia, 0.0), 0.0)
        guests.awaits[there == 0] = 0
        before = _kinetic(whole, motion)
        if not hold_guests(scene, whole, self._contacts, motion):
            return None
        if _kinetic(whole, motion) > before * (1 + ROUNDING):
            return None  # what is lacking gives no energy
        self._have(whole)
        return whole.v[:, n:], whole.spin[:, n:] / inertia

    def _received(self, b: Bodies, visitors: Visitors) -> tuple[Bodies, Scene, Motion]:
        """Bodies with visitors, what acts on them, and room for what they do: what there was in the last step, if the same
        are there again, filled anew."""
        party = self._party
        if party is not None and np.array_equal(party[1].guests.id, visitors.id):
            whole, scene, motion = party
            fill(whole, b, visitors)
            renew(scene.guests, visitors, self.dt)
            return whole, scene, motion
        whole, alone = joined(b, visitors), self._scene
        springs = (*alone.springs, *self.ties.springs(visitors, b.w.size))
        scene = alone._replace(guests=guests_of(visitors, self.support, b.w.size, self.dt), springs=springs)
        if scene.hearing is not None:
            names = (*(state.name for state in self.states), *self.guests)
            code = codes_of_groups(self._scenario, names, names)
            scene = scene._replace(hearing=with_particles(scene.hearing, code, self.support.heard, visitors))
        if scene.joints is not None:
            strangers = np.zeros(len(visitors.w) - visitors.held, scene.joined.dtype)
            scene = scene._replace(joined=np.append(scene.joined, strangers))
        self._party = whole, scene, new_motion(whole.w.size)
        return self._party

    def _make_room(self, contacts: int) -> None:
        """Room for more contacts; what is known of the last ones stays."""
        self._contacts = new_contacts(contacts, self._falls)
        self.memory = larger(self.memory, contacts)

    def _fault(self, step: int, *, opened: bool) -> Fault:
        """The joint that could not be held, or the first body with a number that is not finite."""
        b = self.bodies()
        if opened:
            j = self._scene.joints
            g = int(j.failed[0])
            ends = (int(i) for i in (j.first[g], j.second[g]) if WORLD < i < b.w.size)
            member, row = self._joined.member_of(next(ends, 0))
            return Fault(member, row, step, unclosed=Unclosed(self._made[int(self._order[g])].name))
        good = np.isfinite(b.x).all(axis=0) & np.isfinite(b.v).all(axis=0)
        good &= np.isfinite(b.turn).all(axis=0) & np.isfinite(b.spin).all(axis=0)
        member, row = self._joined.member_of(int(np.argmin(good)))
        return Fault(member, row, step)

    def intrusions(self) -> list[Intrusion]:
        k, bounds = self._contacts, self._joined.bounds
        time = 0.0 if self.kept_from is None else self.kept_from * self.dt
        look_for_contacts(self._scene, self.bodies(), k, self._motion, self.memory, time)
        while k.number[1]:
            self._make_room(2 * int(k.number[:2].sum()))
            k = self._contacts
            look_for_contacts(self._scene, self.bodies(), k, self._motion, self.memory, time)
        colliders = colliders_of(self._structure)
        names = np.repeat([state.name for state in self.states], np.diff(bounds))
        numbers = np.arange(bounds[-1]) - np.repeat(bounds[:-1], np.diff(bounds))
        found: dict[tuple[int, int], Intrusion] = {}
        for c in np.argsort(k.gap[: k.number[0]], kind="stable").tolist():
            i, j, depth = int(k.first[c]), int(k.second[c]), -float(k.gap[c])
            if depth <= DEEP * self._scene.slop:
                break
            mine = (str(names[i]), int(numbers[i]))
            if j == WORLD:
                number = int(k.feature[c]) // FEATURES - 1
                found.setdefault((i, -1 - number), Intrusion(mine, colliders[number], depth))
            else:
                found.setdefault((i, j), Intrusion(mine, (str(names[j]), int(numbers[j])), depth))
        return list(found.values())

    def crammed(self) -> Intrusion | None:
        """The first of the bodies that are deepest inside of colliders which no shift frees."""
        b, allowed = self.bodies(), DEEP * self._scene.slop
        names = [state.name for state in self.states]
        for each in self.intrusions()[:TRIED]:
            if not isinstance(each.other, tuple):
                name, number = each.body
                i, kept = int(self._joined.bounds[names.index(name)]) + number, b.x.copy()

                def look(shift: Floats, i: int = i, kept: Floats = kept) -> tuple[Floats, Floats]:
                    b.x[:, i] = kept[:, i] + shift
                    self.intrusions()
                    k = self._contacts
                    mine = (k.first[: k.number[0]] == i) & (k.second[: k.number[0]] == WORLD)
                    mine &= k.turns[: k.number[0]] == 0
                    b.x[:] = kept
                    return k.normal[:, : k.number[0]].T[mine], k.gap[: k.number[0]][mine]

                if no_room(look, allowed):
                    return each
        return None

    def are_partners(self, i: int, j: int) -> bool:
        """Whether a joint holds two bodies together that do not touch each other."""
        where = self._scene.partner_from
        return j in self._scene.partners[where[i] : where[i + 1]]

    def keep(self, first: int, *, fresh: bool = True) -> None:
        self.kept_from = first
        self._kept = [array.copy() for array in self._changing()]
        self._kept_memory = copy_of(self.memory)

    def go_back(self) -> None:
        """Return to the beginning of the last interval."""
        for mine, kept in zip(self._changing(), self._kept, strict=True):
            np.copyto(mine, kept)
        self.memory = copy_of(self._kept_memory)

    def _changing(self) -> list[NDArray[Any]]:
        """All that steps change, but for what is remembered of contacts."""
        b = self.bodies()
        own = (b.x, b.v, b.turn, b.spin, self.watch, self.tired, self.alone, self.stayed)
        return [*own, *self.broken.values(), *self.ties.gained.values()]

    def replay(self, row: int, first: int, steps: int) -> tuple[Columns, tuple[Any, ...], slice]:
        now, memory = [array.copy() for array in self._changing()], self.memory
        self.go_back()
        # What hangs on rods is not there: they do without it.
        joints = None if self.ties.held else self._scene.joints
        scene = self._scene._replace(work=None, joints=joints)
        done, report = 0, np.zeros(2)
        while done < steps and report[0] in (0, FULL):
            given = (self.bodies(), self._contacts, self._motion, self.memory)
            done += step_bodies(scene, *given, first + done, steps - done, self.dt, report)
            if done < steps and report[0] == FULL:
                self._make_room(2 * int(report[1]))
        there = copied(self.island_columns())
        self.memory = memory
        for mine, was in zip(self._changing(), now, strict=True):
            np.copyto(mine, was)
        return there, (), slice(0, self._joined.whole.count)

    def columns(self) -> list[Columns]:
        return self._joined.cut(self.island_columns())

    def island_columns(self) -> Columns:
        return self._joined.whole.columns(self._read)

    def forces(self, time: float) -> NDArray[np.floating[Any]]:
        return np.ascontiguousarray(self._pulls(time)[: self._joined.whole.count, :3].T)

    def forces_on_tied(self, time: float) -> dict[str, tuple[Ints, Floats]]:
        return self.ties.forces(self._pulls(time)[self._joined.whole.count :]) if self.ties else {}

    def _pulls(self, time: float) -> Floats:
        """Forces and torques on all bodies, and on the particles that are tied to them, shape [n, 6]."""
        b, scene, motion = self._with_tied()
        sum_forces_on(scene, b, motion, time)
        return np.asarray(motion.pull)

    def _with_tied(self) -> tuple[Bodies, Scene, Motion]:
        """The bodies and the particles that are tied to them, what acts on them, and room for what they do."""
        if not self.ties:
            return self.bodies(), self._scene, self._motion
        visitors, n = self.ties.visitors(), self._joined.whole.count
        b = joined(self.bodies(), visitors)
        springs = (*self._scene.springs, *self.ties.springs(visitors, n))
        return b, self._scene._replace(springs=springs), new_motion(b.w.size)

    def longest_step(self) -> float:
        b, scene, _ = self._with_tied()
        return longest_step(scene.springs, b)

    def stored(self) -> dict[str, float]:
        if not self._springs:
            return {}
        b, scene, motion = self._with_tied()
        velocities_of(b, motion)
        names = (each.name for each in self._springs)
        return {
            name: stored(springs, b, motion.now) for name, springs in zip(names, scene.springs, strict=True)
        }

    def broke(self) -> dict[str, Floats]:
        return self.broken

    def stopped_bodies(self) -> int:
        return int(self.tired[0])

    def kept_back(self) -> int:
        return int(self.stayed[0])

    def turning(self) -> NDArray[np.float64]:
        velocities_of(self.bodies(), self._motion)
        return np.ascontiguousarray(self._motion.now[:, 3:].T)

    def sums(self, member: int, records: tuple[Any, ...], time: float, team: Team) -> NDArray[np.float64]:
        motion = measure((), self.columns()[member], time, team)
        bounds, out = self._joined.bounds, np.zeros(4 + len(records))
        here = (bounds[member], bounds[member + 1])
        shape = self._shapes[member]
        records = tuple(through_surface(record, shape) or record for record in records)
        sum_energies(self._scene, records, self.bodies(), self._motion, *here, time, out)
        motion[0] += out[0]
        motion[7] += out[0]
        motion[4:7] += out[1:4]
        return np.concatenate([motion, out[4:]])

    def topology(self) -> list[Topology]:
        ids = {state.name: state.id[: state.count] for state in (*self.states, *self._particles.values())}
        rest = {each.name: each.springs.rest for each in self._springs}
        lengths = np.array([each.length for each in self._made if each.kind == ROD])
        return [
            *lines(self._scenario, ids, rest, self.broken),
            *rod_lines(self._scenario, ids, lengths),
        ]


def _kinetic(b: Bodies, motion: Motion) -> float:
    """Kinetic energy of bodies, and of particles among them that nothing holds [J]."""
    velocities_of(b, motion)
    mass = np.divide(1.0, b.w, out=np.zeros_like(b.w), where=b.w > 0)
    return float(0.5 * ((mass * b.v**2).sum() + (motion.now[:, 3:].T * b.spin).sum()))
