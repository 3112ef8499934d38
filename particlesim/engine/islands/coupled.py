"""Islands of groups joined by springs and rods, as the engine runs them: by stages, on one thread or several."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.bonds import BondSet, HingeSet, record_of
from particlesim.bonds.hinge import angles_at
from particlesim.engine.constraints.rod_system import rod_system
from particlesim.engine.coupled.adaptive import BEGAN, ENDED, Pace, new_pace, step_island_adaptive
from particlesim.engine.coupled.forces import island_forces
from particlesim.engine.coupled.kernel import step_island
from particlesim.engine.coupled.workspace import Part, Share, Work, scratch, share_out, staged
from particlesim.engine.faults import Fault, Stop, Unsolved
from particlesim.engine.implicit.element_matrix import new_forms
from particlesim.engine.implicit.kernel import StagedImplicit, staged_implicit, step_island_implicit
from particlesim.engine.implicit.krylov import INDEFINITE, UNSOLVED, General, Symmetric
from particlesim.engine.implicit.linear_system import new_system
from particlesim.engine.interactions.bond_layout import chunk_size, in_slots, order_of, owned
from particlesim.engine.interactions.bonds import Bonds, Breaking
from particlesim.engine.interactions.elements import (
    AngleColumns,
    DihedralColumns,
    TriangleColumns,
    sum_hinges,
)
from particlesim.engine.islands.independent import (
    OWN_STEPS,
    attributes_read,
    shortest_step,
)
from particlesim.engine.ledger.particle_work import Opened, SpringBooks, spans, stages
from particlesim.engine.ledger.work import Books, moved
from particlesim.engine.state.columns import Columns, block_of, changing, copied, replaced
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.step.impacts import Simple
from particlesim.engine.step.records import as_precision, contacts_record, dynamics_record
from particlesim.errors import UsageError
from particlesim.graph.graph import Island
from particlesim.groups.group import Particles
from particlesim.integrators import EmbeddedRungeKutta, ImplicitMethod
from particlesim.laws.registry import evaluate, force_dv, force_dx
from particlesim.layouts.mesh import is_closed, require_manifold
from particlesim.process.threads import Team
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

WORTH_SPRINGS = 5_000
"""Springs below which threads would spend their time waiting for each other."""
WORTH_THREADS = 500_000
"""Spring-steps below which one thread is faster than waking others."""


SOLVED_STEP = 50
"""How many times longer a step takes whose equations are solved."""

ROD_IN_SPRINGS = 20
"""About how many springs take the time of a rod."""


class CoupledIsland:
    """Groups joined by springs and rods; their states are stretches of the island's arrays."""

    def __init__(self, scenario: Scenario, island: Island, states: Sequence[GroupState]) -> None:
        self.dt = scenario.grid.dt
        self._method = island.method
        self._join(list(states))
        dtype = self._all.dtype
        self._staged: tuple[Any, ...]
        if isinstance(self._method, ImplicitMethod):
            solver = General() if _lopsided(island, self.states) else Symmetric()
            self._staged, self._step = staged_implicit(self._method, dtype, solver), step_island_implicit
        else:
            self._staged, self._step = staged(self._method, apart=bool(island.rods)), step_island
        bounds = np.cumsum([0, *(state.count for state in states)]).tolist()
        self._bounds = bounds
        read = (
            attributes_read(*each)
            for each in zip(island.forces, island.colliders, island.groups, strict=True)
        )
        self._read = frozenset[str]().union(*read)
        self.parts = tuple(
            as_precision(
                Part(
                    dynamics_record(group),
                    tuple(force.record() for force in island.forces[k]),
                    contacts_record(island.colliders[k], group, dtype),
                    bounds[k],
                    bounds[k + 1],
                ),
                dtype,
            )
            for k, group in enumerate(island.groups)
        )
        self._driven = tuple(
            each._replace(rows=each.rows + first)
            for first, state in zip(bounds, self.states, strict=False)
            for each in state.driven
        )
        offset = {group.name: bounds[k] for k, group in enumerate(island.groups)}
        self.rods = rod_system(scenario, island, self._all, self.states, offset)
        self.bonds = tuple(self._bonds_of(scenario, bonds, offset) for bonds in island.bonds)
        self.hinges = tuple(self._hinges_of(hinges, offset) for hinges in island.hinges)
        self.corners = (*self.hinges, *self._surfaces(scenario, island, bounds))
        self.springs = sum(bonds.i.size - bonds.holes.size for bonds in self.bonds)
        self.springs += sum(each.rows.size for each in self.corners)
        if self.rods is not None and self.rods.components > 1:
            self.springs += ROD_IN_SPRINGS * self.rods.number
        self._disturbed = any(island.colliders) or any(bonds.breaking is not None for bonds in self.bonds)
        looks_back = self.rods is not None or any(part.contacts != Simple(()) for part in self.parts)
        self._work = scratch(self._method, self._all.count, dtype, looks_back=looks_back)
        if isinstance(self._method, ImplicitMethod):
            self._work = self._work._replace(
                system=new_system(self.bonds, self._all.x[:, : self._all.count], dtype)
            )
        self._shares: dict[int, list[tuple[tuple[Bonds, ...], Work, Share]]] = {}
        self.books = Books(scenario, island, dtype) if scenario.output.work else None
        self._booking = (
            None
            if self.books is None
            else SpringBooks(self.books, island, bounds, self._driven, self._forces_in, self._hinged)
        )
        self._kept: list[NDArray[Any]] = []
        self.kept_from = 0

    def _join(self, states: list[GroupState]) -> None:
        """One set of arrays for the island; the groups become views of it."""
        first = states[0]
        total = sum(state.count for state in states)
        whole = GroupState(
            first.name,
            total,
            dtype=first.dtype,
            memory=len(first.memory),
            parts=frozenset[str]().union(*(state.parts for state in states)),
        )
        whole.count = total
        if whole.clocked:
            whole.stop[:] = np.inf
        self.states: list[GroupState] = []
        begin = 0
        for state in states:
            part = slice(begin, begin + state.count)
            begin = part.stop
            for mine, theirs in zip(whole.arrays(), state.arrays(), strict=True):
                if mine.size and theirs.size:
                    mine[part] = theirs[: state.count]
            self.states.append(whole.stretch(state, part))
        self._all = whole

    def _bonds_of(self, scenario: Scenario, bonds: BondSet, offset: dict[str, int]) -> Bonds:
        """Bonds as the kernel takes them. Raises UsageError for those that cannot be, with their place in the scenario."""
        with scenario.at_springs(bonds.name):
            return self._made(bonds, offset)

    def _made(self, bonds: BondSet, offset: dict[str, int]) -> Bonds:
        """Bonds with their ends in rows of the island, and constants in the precision of the run."""
        law = bonds.law
        states = [next(state for state in self.states if state.name == name) for name in bonds.groups]
        pairs = bonds.find(*(state.position.T.astype(float) for state in states))
        for end, state in enumerate(states):
            if pairs[:, end].max(initial=-1) >= state.count:
                raise UsageError(
                    f"{bonds.name}: {state.name!r} has {state.count} particles, "
                    f"there is no particle {int(pairs[:, end].max())}"
                )
        i, j = (pairs[:, end] + offset[state.name] for end, state in enumerate(states))
        x = self._all.x.astype(float)
        rest = np.sqrt(((x[:, i] - x[:, j]) ** 2).sum(axis=0))
        if law.rest_length is not None:
            rest = np.full(len(pairs), law.rest_length)
        elif law.break_strain is not None and not rest.all():
            a, b = pairs[int(np.argmin(rest))]
            raise UsageError(
                f"{bonds.name}: particles {a} and {b} are at the same place; a strain needs a length to compare with",
                "give a rest_length, or break_force instead of break_strain",
            )
        k, c = law.constants(self._reduced_mass(i, j))
        dtype = self._all.dtype
        slots = in_slots(i, j, chunk_size(self._all.count))
        if law.by_mass or law.breaks:
            k, c = slots.spread(k.astype(dtype)), slots.spread(c.astype(dtype))
        else:
            k, c = dtype.type(law.stiffness), dtype.type(law.damping)
        breaking = None
        if law.breaks:
            strain, pull = (
                dtype.type(np.inf if x is None else x) for x in (law.break_strain, law.break_force)
            )
            breaking = Breaking(strain, pull, np.full(len(slots.i), np.inf))
        return Bonds(
            record_of(law),
            slots.i,
            slots.j,
            k,
            c,
            slots.spread(rest.astype(dtype)),
            slots.holes,
            slots.table,
            np.empty(0, np.int64),
            breaking,
        )

    def _hinges_of(self, hinges: HingeSet, offset: dict[str, int]) -> AngleColumns | DihedralColumns:
        """Angles or dihedrals as the kernel takes them, in the order of their first particles."""
        state = next(state for state in self.states if state.name == hinges.group)
        rows = hinges.find()
        if rows.size and rows.max() >= state.count:
            raise UsageError(
                f"{hinges.name}: {state.name!r} has {state.count} particles, there is no particle {int(rows.max())}"
            )
        rows = rows[np.argsort(rows.min(axis=1), kind="stable")] + offset[hinges.group]
        dtype = self._all.dtype
        x = self._all.x.astype(float)
        for end in (0, 2) if hinges.size == 3 else ():
            same = (x[:, rows[:, end]] == x[:, rows[:, 1]]).all(axis=0)
            if same.any():
                a, b, c = (int(row) - offset[hinges.group] for row in rows[same.argmax()])
                raise UsageError(
                    f"{hinges.name}: the angle of particles {a}, {b} and {c} has no size, as {(a, c)[end // 2]} and {b} are "
                    "at the same place"
                )
        rest = angles_at(x, rows)
        if hinges.rest is not None:
            rest = np.full(len(rows), hinges.rest)
        kind = AngleColumns if hinges.size == 3 else DihedralColumns
        return kind(as_precision(hinges.law, dtype), np.ascontiguousarray(rows.T), rest.astype(dtype))

    def _surfaces(
        self, scenario: Scenario, island: Island, bounds: Sequence[int]
    ) -> Iterator[TriangleColumns]:
        """The triangles that forces on surfaces act on."""
        for group, forces, first in zip(island.groups, island.surfaces, bounds, strict=False):
            if not forces or not isinstance(group, Particles):
                continue
            triangles = group.layout.open(scenario.folder).triangles()
            require_manifold(triangles, group.name)
            rows = np.ascontiguousarray(triangles[np.argsort(triangles.min(axis=1), kind="stable")].T + first)
            for force in forces:
                record = as_precision(force.surface_record(is_closed(triangles)), self._all.dtype)
                yield TriangleColumns(record, rows, np.empty(0, self._all.dtype))

    def _for(self, threads: int) -> list[tuple[tuple[Bonds, ...], Work, Share]]:
        """What each of some threads works on: pieces of bonds, scratch, particles."""
        if threads not in self._shares:
            chunk, count = chunk_size(self._all.count), self._all.count
            found = []
            rods = None if self.rods is None else self.rods.rods
            for share in share_out(count, threads, self._driven, self.corners, rods):
                mine = tuple(
                    bonds._replace(table=table, begin=begin)
                    for bonds in self.bonds
                    for table, begin in [
                        owned(bonds.table, share.first, share.last, chunk, -(-count // chunk))
                    ]
                )
                tables, waits = [bonds.table for bonds in mine], bool(share.corners)
                order = order_of(tables, share.first, share.last, chunk, -(-count // chunk), wait=waits)
                share = share._replace(order=order)
                found.append((mine, self._own_scratch(share), share))
            self._shares[threads] = found
        return self._shares[threads]

    def _own_scratch(self, share: Share) -> Work:
        """Scratch arrays of a thread: those of the island, but for what each thread has to itself."""
        work = self._work
        work = work._replace(pull=np.zeros_like(work.pull), spread=np.zeros_like(work.spread))
        if work.system is None:
            return work
        system = work.system
        own = system._replace(
            pull=np.zeros_like(system.pull),
            lanes=np.zeros_like(system.lanes),
            corners=new_forms(share.corners, self._all.dtype),
        )
        return work._replace(system=own)

    def topology(self, names: Sequence[str]) -> list[Topology]:
        """The springs of every set, in the order of the kernel, as a trajectory keeps them; a name for each set. Then the
        rods."""
        ids = self._all.id
        found = []
        for name, bonds in zip(names, self.bonds, strict=True):
            there = bonds.i >= 0
            pairs = np.stack([ids[bonds.i[there]], ids[bonds.j[there]]], axis=1)
            broke = np.full(len(pairs), np.inf) if bonds.breaking is None else bonds.breaking.when[there]
            rest = bonds.rest[there].astype(float)
            found.append(Topology(name, pairs, rest, broke, breakable=bonds.breaking is not None))
        return found if self.rods is None else [*found, *self.rods.topology(ids)]

    def _reduced_mass(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.float64]:
        """m₁ m₂/(m₁ + m₂) of both ends [kg]; a pinned end is infinitely heavy, and of two pinned ends nothing moves."""
        inverse = 1 / self._all.mass[: self._all.count].astype(float)
        inverse[self._pinned()] = 0
        total = inverse[i] + inverse[j]
        return np.divide(1, total, out=np.zeros_like(total), where=total > 0)

    def _pinned(self) -> NDArray[np.bool_]:
        """Which particles no force moves."""
        if not self._all.clocked:
            return np.zeros(self._all.count, np.bool_)
        return np.asarray(np.isinf(self._all.start[: self._all.count]))

    def columns(self) -> list[Columns]:
        """Columns of every group of the island."""
        return self._cut(self.island_columns())

    def island_columns(self) -> Columns:
        """Columns of the whole island."""
        return self._all.columns(self._read)

    def forces(self, time: float) -> NDArray[np.floating[Any]]:
        """Total force on every particle at a time [N], shape [3, n]."""
        ((bonds, work, share),) = self._for(1)
        island_forces(self.parts, bonds, self.island_columns(), work, share, time)
        return np.array(work.force)

    def phase(self, first: int, last: int) -> int:
        """How far steps may go from `first` towards `last` in one piece."""
        return last if self._booking is None else min(first + 1, last)

    def advance(self, first: int, last: int, team: Team) -> tuple[None, None, Fault | None]:
        """Steps first … last − 1."""
        steps = last - first
        in_a_step = (
            OWN_STEPS if self._method.adaptive else SOLVED_STEP if self._work.system is not None else 1
        )
        worth = self.springs >= WORTH_SPRINGS and self.springs * steps * in_a_step >= WORTH_THREADS
        shares = self._for(team.threads if worth else 1)
        columns = self.island_columns()
        done = [0] * len(shares)
        booked, pace = self._booking is not None, None
        if self._method.adaptive:
            pace = new_pace(len(shares), self._disturbed, booked)
        opened = self._open(first) if booked and pace is None else None
        if self.rods is not None:
            self.rods.begin()

        def work(k: int) -> None:
            bonds, scratch, share = shares[k]
            given = (self._staged, self.parts, bonds, columns, scratch, share)
            if pace is not None:
                done[k] = step_island_adaptive(*given, pace, first, steps, self.dt)
            else:
                done[k] += self._step(*given, first + done[k], steps - done[k], self.dt)

        team.each(work, len(shares))
        while booked and pace is not None and done[0] < steps and not pace.stuck:
            leg = self._leg(pace)
            team.each(work, len(shares))
            self._close_leg(leg, pace, arrived=done[0] == steps)
        if pace is None and done[0] < steps and self._solves_more():
            team.each(work, len(shares))
        if done[0] == steps:
            self._close(opened, last)
            return None, None, None
        step = first + done[0]
        if pace is not None:
            return None, None, self._stop(step, pace)
        if self._work.before is None:
            self._return_to(step)
        if self._work.system is not None and self._work.system.report[0] == UNSOLVED:
            return None, None, self._unsolved(step)
        return None, None, self._find(step)

    def fit(self) -> None:
        """Bring particles on rods to velocities that keep lengths, after something has changed them from outside."""
        if self.rods is not None:
            self.rods.fit(self.island_columns())

    def _solves_more(self) -> bool:
        """Whether the last step met equations that are not symmetric and positive definite: from now on the kernel solves
        these, too."""
        if not isinstance(self._staged, StagedImplicit) or isinstance(self._staged.solver, General):
            return False
        if self._work.system.report[0] != INDEFINITE:
            return False
        self._staged = self._staged._replace(solver=General())
        return True

    def _step_copy(
        self, parts: tuple[Part, ...], bonds: tuple[Bonds, ...], columns: Columns, first: int, steps: int
    ) -> None:
        """Steps of a copy of the particles and bonds, on one thread."""
        ((_, work, share),) = self._for(1)
        if self.rods is not None:
            self.rods.begin()
        given = (parts, bonds, columns, work, share)
        done = self._step(self._staged, *given, first, steps, self.dt)
        if done < steps and self._solves_more():
            self._step(self._staged, *given, first + done, steps - done, self.dt)

    def _stop(self, step: int, pace: Pace) -> Fault:
        """Which particle could not go on; the island is where and when it was."""
        why, time, row = int(pace.report[0]), float(pace.report[1]), int(pace.report[2])
        member = int(np.searchsorted(self._bounds, row, side="right")) - 1
        p = self.states[member].particle(row - self._bounds[member], time)
        least = shortest_step(self._method, (step + 1) * self.dt)
        return Fault(member, row - self._bounds[member], step, Stop(why, time, p, least))

    def _open(self, step: int) -> Opened | None:
        """The state at the beginning of a step whose work is booked; None where none is."""
        if self.books is None:
            return None
        columns, bonds = self._copied(self.bonds)
        begin, h = spans(columns.clock, self._all.count, step * self.dt, (step + 1) * self.dt)
        free, effort = None, 0.0
        if "contact" in self.books.names:
            ((mine, _, _),) = self._for(1)
            free, mine = self._copied(mine)
            parts = tuple(part._replace(contacts=Simple(())) for part in self.parts)
            self._step_copy(parts, mine, free, step, 1)
            effort = 0.0 if self.rods is None else self.rods.effort
        return Opened(columns, begin, h, free, bonds=bonds, effort=effort)

    def _copied(self, bonds: tuple[Bonds, ...]) -> tuple[Columns, tuple[Bonds, ...]]:
        """Columns and bonds as they are, to be changed or kept."""
        columns = self.island_columns()
        return _with(columns, bonds, [column.copy() for column in _changing(columns, self.bonds)])

    def _close(self, opened: Opened | None, last: int) -> None:
        """Book the step that has been taken."""
        if self._booking is None or opened is None:
            return
        columns = self.island_columns()
        effort = opened.effort if opened.free is not None or self.rods is None else self.rods.effort
        self._booking.close(opened, columns, opened.bonds, self._cut, last * self.dt, effort)
        self._booking.book_breaking(opened.bonds, self.bonds, columns)

    def _leg(self, pace: Pace) -> tuple[Opened, tuple[Bonds, ...], float]:
        """The own step at the end of which an island pauses, the bonds before it, and when it ends [s]."""
        assert isinstance(self._method, EmbeddedRungeKutta)
        began, ended = float(pace.present[BEGAN]), float(pace.present[ENDED])
        now = self.island_columns()
        free, bonds = _with(now, self.bonds, [column.copy() for column in _changing(now, self.bonds)])
        begin, h = spans(free.clock, self._all.count, began, ended)
        start = self._work.before.astype(float)
        before = moved(free, start, np.zeros((6, 1)))
        path = stages(before, (start, self._work.slopes), (began, ended), h, self._method)
        return Opened(before, begin, h, free, path), bonds, ended

    def _close_leg(self, leg: tuple[Opened, tuple[Bonds, ...], float], pace: Pace, *, arrived: bool) -> None:
        """Book an own step, of which it is known by now what contact and breaking springs made of its end."""
        opened, bonds, ended = leg
        if self._booking is None or pace.stuck:
            return
        columns = self.island_columns()
        if not arrived:  # the next step has been tried already, from there
            columns = moved(columns, self._work.before.astype(float), np.zeros((6, 1)))
        self._booking.close(opened, columns, bonds, self._cut, ended)
        self._booking.book_breaking(bonds, self.bonds, columns)

    def _cut(self, whole: Columns) -> list[Columns]:
        """Columns of the island cut into those of its groups."""
        return [block_of(whole, a, b) for a, b in pairwise(self._bounds)]

    def _forces_in(
        self, columns: Columns, bonds: tuple[Bonds, ...], time: float, *, corners: bool = True
    ) -> NDArray[np.float64]:
        """Total force on every particle in a state and at a time [N], shape [3, n]; led particles go to their places.

        Without `corners`, hinges and forces on surfaces are left out.
        """
        ((mine, work, share),) = self._for(1)
        share = share if corners else share._replace(corners=())
        here = tuple(
            mine[k]._replace(k=bond.k, c=bond.c, breaking=bond.breaking) for k, bond in enumerate(bonds)
        )
        island_forces(self.parts, here, columns, work, share, time)
        return np.array(work.force, float)

    def _hinged(self, columns: Columns) -> float:
        """Potential energy of all hinges in a state [J]."""
        return sum(float(sum_hinges(hinges, columns)) for hinges in self.hinges)

    def keep(self, first: int) -> None:
        """Remember the state at the beginning of an interval, to look for the first sign of what goes wrong in it."""
        self.kept_from = first
        now = _changing(self.island_columns(), self.bonds)
        if not self._kept:
            self._kept = [np.empty_like(column) for column in now]
        for mine, column in zip(self._kept, now, strict=True):
            np.copyto(mine, column)

    def go_back(self) -> None:
        """Return to the beginning of the last interval, step `kept_from`."""
        for mine, column in zip(self._kept, _changing(self.island_columns(), self.bonds), strict=True):
            np.copyto(column, mine)

    def _return_to(self, step: int) -> None:
        """Bring the island to the beginning of a step of the present interval."""
        columns, bonds, _ = self.replay(0, self.kept_from, step - self.kept_from)
        mine = _changing(self.island_columns(), self.bonds)
        for column, found in zip(mine, _changing(columns, bonds), strict=True):
            np.copyto(column, found)

    def replay(self, row: int, first: int, steps: int) -> tuple[Columns, tuple[Bonds, ...], slice]:
        """The particles some steps after `first`, the beginning of the last interval; their bonds, and which rows these are.

        Nothing of the island changes.
        """
        ((mine, _, _),) = self._for(1)
        columns, bonds = _with(self.island_columns(), mine, [column.copy() for column in self._kept])
        self._step_copy(self.parts, bonds, columns, first, steps)
        return columns, bonds, slice(0, self._all.count)

    def _unsolved(self, step: int) -> Fault:
        """Where the equations of a step miss most."""
        system = self._work.system
        row = int(np.abs(system.residual).sum(axis=0).argmax())
        member = int(np.searchsorted(self._bounds, row, side="right")) - 1
        unsolved = Unsolved(self._method.label, float(system.report[1]), *map(int, system.report[2:]))
        return Fault(member, row - self._bounds[member], step, unsolved=unsolved)

    def _find(self, step: int) -> Fault:
        """Which particle, or rod: step once more on a copy, and look."""
        columns = self.island_columns()
        ((bonds, work, _),) = self._for(1)
        self._step_copy(self.parts, bonds, copied(columns), step, 1)
        wild = ~np.isfinite(work.force).all(axis=0)
        unheld = None if self.rods is None else self.rods.unheld()
        if self.rods is not None and unheld is not None and np.isfinite(unheld.misfit):
            row = self.rods.row_of(unheld, ~self._pinned())
            member = int(np.searchsorted(self._bounds, row, side="right")) - 1
            return Fault(member, row - self._bounds[member], step, unheld=unheld)
        row = int(wild.argmax() if wild.any() else np.abs(work.force).sum(axis=0).argmax())
        member = int(np.searchsorted(self._bounds, row, side="right")) - 1
        return Fault(member, row - self._bounds[member], step)


def _lopsided(island: Island, states: Sequence[GroupState]) -> bool:
    """Whether some force on the first particles has a Jacobian that is not symmetric: the equations will not be."""
    for forces, state in zip(island.forces, states, strict=True):
        for force, derivative in product(forces, (force_dx, force_dv)):
            try:
                with np.errstate(all="ignore"):
                    matrix = np.reshape(evaluate(derivative, force.record(), state.particle(0, 0.0)), (3, 3))
            except (ArithmeticError, ValueError):  # a singular place
                continue
            if np.abs(matrix - matrix.T).max() > 1e-6 * np.abs(matrix).max():
                return True
    return False


def _changing(c: Columns, bonds: Sequence[Bonds]) -> list[NDArray[Any]]:
    """All that steps change: motion, what methods remember, clocks, and bonds that can break."""
    arrays = list(changing(c))
    for bond in bonds:
        if bond.breaking is not None:
            arrays += [bond.k, bond.c, bond.breaking.when]
    return arrays


def _with(
    c: Columns, bonds: Sequence[Bonds], arrays: Sequence[NDArray[Any]]
) -> tuple[Columns, tuple[Bonds, ...]]:
    """Columns and bonds made of other arrays, in the order of `_changing`."""
    rest = iter(arrays)
    columns = replaced(c, rest)
    made = []
    for bond in bonds:
        if bond.breaking is not None:
            k, damping, when = (next(rest) for _ in range(3))
            bond = bond._replace(k=k, c=damping, breaking=bond.breaking._replace(when=when))
        made.append(bond)
    return columns, tuple(made)
