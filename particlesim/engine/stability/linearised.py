"""Islands linearised at a state: m δa ≈ (∂f/∂x) δx + (∂f/∂v) δv, for each force alone and for all together.

Single particles give blocks of 3 × 3 from the Jacobians of their forces. Springs, hinges and surfaces couple particles: a
small island gives dense matrices, a large one its extreme modes alone (`extreme_modes`). Every mode y of
x'' = Kx x + Kv v has Rayleigh quotients of stiffness, k = −ȳ·Kx y, and damping, d = −ȳ·Kv y, and its eigenvalues obey
λ² + d λ + k = 0: a mode is a pair (k, d).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.emitters import Emitter, Schedule
from particlesim.engine.interactions.coupling import Coupling
from particlesim.engine.islands.base import BaseIsland
from particlesim.engine.stability.extreme_modes import bound, extreme_modes
from particlesim.engine.state.group_state import GroupState
from particlesim.graph.graph import Island
from particlesim.groups.group import FirstOrder, Group
from particlesim.integrators.regions import Linear, has_function
from particlesim.laws.registry import Particle, evaluate, force, force_dv, force_dx, velocity_dx
from particlesim.model.attributes import ATTRIBUTES
from particlesim.scenario.scenario import Scenario

Floats = NDArray[np.float64]

SAMPLE = 24
"""Particles of a group that are looked at: the extreme ones, and others evenly spread."""
DENSE = 40
"""Particles up to which the matrices of an island are written out."""
MOST_SPRINGS = 100_000
"""Springs up to which extreme modes are computed; bounds serve for more."""
FEW_SPRINGS = 20_000
"""Springs up to which that is done for every set alone, too."""

MOST_RODS = 20_000
"""Rods up to which what pulls on them is computed; more are left out."""


class Blocks(NamedTuple):
    """Jacobians of single particles over their inertia: rows in the island [n], by position [n, 3, 3], by velocity."""

    rows: NDArray[np.int64]
    kx: Floats
    kv: Floats


@dataclass(frozen=True)
class Linearised:
    """An island near a state: its systems for every force alone, by label, and for all together.

    `how` tells what they stand for: "all particles", "sampled particles", "extreme modes", or "bounds".
    """

    forces: dict[str, Linear]
    together: Linear
    how: str


class IslandModel:
    """An island to be linearised at its present state; an emitter without particles, at those that will be born first."""

    def __init__(self, scenario: Scenario, structure: Island, island: BaseIsland, time: float) -> None:
        self.scenario, self.structure, self.island, self.time = scenario, structure, island, time
        labels = scenario.labels.forces
        self.records: list[dict[str, Any]] = [
            {
                label: law.record()
                for label, law in zip(labels, scenario.forces, strict=True)
                if any(law is mine for mine in forces)
            }
            for forces in structure.forces
        ]
        self.count = sum(state.count for state in island.states)
        self.massless = [group.dynamics.type != "second_order" for group in structure.groups]

    def linearise(self) -> Linearised:
        """Systems of each force alone and of all together."""
        if self.structure.coupled and self.count:
            return self._dense(self.island) if self.count <= DENSE else self._large(self.island)
        blocks = self._blocks(SAMPLE)
        alone = {label: self._stacked([part]) for label, part in blocks.items()}
        how = "all particles" if 0 < self.count <= SAMPLE else "sampled particles"
        return Linearised(alone, self._stacked(list(blocks.values())), how)

    def single(self, member: int, p: Particle) -> Linear:
        """One particle of a group, under all forces on single particles."""
        group = self.structure.groups[member]
        terms = [_jacobians(group, [p], record) for record in self.records[member].values()]
        if flow := getattr(group.dynamics, "flow", ()):
            terms.append(_gradients([p], tuple(f.record() for f in flow)))
        return self._stacked([Blocks(np.zeros(1, np.int64), kx, kv) for kx, kv in terms])

    def box(self) -> tuple[float, float] | None:
        """Bounds on the stiffness [1/s²] and the damping [1/s] of all modes of an island of springs: cheap, never too small.

        None for islands with particles that have no inertia.
        """
        if not (self.structure.coupled and self.count) or any(self.massless):
            return None
        w, sets = self._mobility(), [part for _, part in self._couplings(self.island)]
        k, d = self._background()
        return k + bound(sets, w, damping=False), d + bound(sets, w, damping=True)

    def _couplings(self, island: BaseIsland) -> list[tuple[str, Coupling]]:
        """All interactions linearised, by label, and then rods; a force on several surfaces comes several times."""
        columns = island.island_columns()
        found: list[tuple[str, Coupling]] = [
            (name, each.linearise(columns, self.time))
            for name, each in zip(island.names, island.interactions, strict=True)
        ]
        return [*found, *self._held(island, [each for _, each in found])]

    def _held(self, island: BaseIsland, couplings: Sequence[Coupling]) -> Iterator[tuple[str, Coupling]]:
        """Sets of rods with what springs and forces on their ends pull at present; none where there are too many."""
        constraint = island.constraint
        if constraint is None or constraint.number > MOST_RODS:
            return
        total = np.zeros((3, self.count))
        ends, begin = constraint.ends, 0
        for state, records in zip(island.states, self.records, strict=True):
            for row in ends[(ends >= begin) & (ends < begin + state.count)].tolist():
                total[:, row] = _force(tuple(records.values()), state.particle(row - begin, self.time))
            begin += state.count
        for each in couplings:
            each.add_tension(total)
        yield from constraint.couplings(island.island_columns(), total, self._mobility())

    def _left_out(self) -> str:
        """What the linearised island lacks, in words."""
        constraint = self.island.constraint
        return " (without rods)" if constraint is not None and constraint.number > MOST_RODS else ""

    def _mobility(self) -> Floats:
        """1/m of every particle, or 1/γ without inertia; 0 for pinned ones."""
        parts = []
        for group, state in zip(self.structure.groups, self.island.states, strict=True):
            w = 1 / state.mass[: state.count].astype(float)
            if isinstance(group.dynamics, FirstOrder):
                w = np.full(state.count, 1 / group.dynamics.drag)
            if state.clocked:
                w[~np.isfinite(state.start[: state.count])] = 0
            parts.append(w)
        return np.concatenate(parts)

    def _blocks(self, most: int) -> dict[str, Blocks]:
        """Jacobians on at most `most` particles of every group, by force; flows that carry particles count as one."""
        found: dict[str, list[Blocks]] = {}
        begin = 0
        for group, state, records in zip(
            self.structure.groups, self.island.states, self.records, strict=True
        ):
            if self.count and self.structure.coupled and not state.count:
                continue  # nobody knows yet whom its particles will meet
            rows, sample = particles_of(self.scenario, group, state, self.time, most)
            terms = {label: _jacobians(group, sample, record) for label, record in records.items()}
            if flow := getattr(group.dynamics, "flow", ()):
                terms["flow"] = _gradients(sample, tuple(f.record() for f in flow))
            for label, (kx, kv) in terms.items():
                if kx.any() or kv.any():
                    found.setdefault(label, []).append(Blocks(rows + begin, kx, kv))
            begin += state.count
        return {
            label: Blocks(*map(np.concatenate, zip(*parts, strict=True))) for label, parts in found.items()
        }

    def _stacked(self, blocks: Sequence[Blocks]) -> Linear:
        """The sum of forces on the same particles."""
        kx, kv = (
            sum(parts, np.zeros((1, 3, 3))) for parts in ([b.kx for b in blocks], [b.kv for b in blocks])
        )
        return Linear(kx, None if all(self.massless) else kv)

    def _background(self) -> tuple[float, float]:
        """Largest stiffness and damping of forces on single particles: they add to those of springs at most."""
        blocks = self._blocks(SAMPLE).values()
        return sum(_top(b.kx) for b in blocks), sum(_top(b.kv) for b in blocks)

    def _dense(self, island: BaseIsland) -> Linearised:
        """All particles, with matrices."""
        w = self._mobility()
        zero = np.zeros((3 * self.count, 3 * self.count))
        terms: dict[str, list[Floats]] = {}
        for name, part in self._couplings(island):
            found = [np.repeat(w, 3)[:, None] * matrix.toarray() for matrix in part.jacobians(self.count)]
            terms[name] = [a + b for a, b in zip(terms.get(name, [zero, zero]), found, strict=True)]
        for label, blocks in self._blocks(self.count).items():
            terms[label] = [_diagonal(blocks.rows, part, self.count) for part in (blocks.kx, blocks.kv)]
        alone = {label: self._modes(kx, kv, w) for label, (kx, kv) in terms.items()}
        kx, kv = (sum((part[k] for part in terms.values()), zero) for k in (0, 1))
        return Linearised(alone, self._modes(kx, kv, w), "all particles" + self._left_out())

    def _modes(self, kx: Floats, kv: Floats, w: Floats) -> Linear:
        """Modes of an island's matrices, in coordinates of free particles: eigenvalues λ where the method has a function of
        them, and else pairs (k, d)."""
        free = np.flatnonzero(np.repeat(w, 3) > 0)
        root = np.sqrt(np.repeat(w, 3)[free])
        # In y = √m x the matrices of springs are symmetric.
        kx, kv = (m[np.ix_(free, free)] * root / root[:, None] for m in (kx, kv))
        if self.island.constraint is not None:
            x = np.concatenate([state.position.T.astype(float) for state in self.island.states], axis=1)
            space = free_motions(self.island.constraint.directions(x).toarray()[:, free] * root)
            if space.shape[1] == 0:
                return pairs(np.zeros(1), np.zeros(1))
            kx, kv = (space.T @ m @ space for m in (kx, kv))
            free = free[: space.shape[1]]  # as many motions, all of them with inertia
        if not has_function(self.structure.method) and not kv.any():
            return pairs(-np.linalg.eigvals(kx), np.zeros(len(free)))
        massless = np.repeat(self.massless, [3 * state.count for state in self.island.states])[free]
        heavy = np.flatnonzero(~massless)
        n, m = len(free), len(heavy)
        a = np.zeros((n + m, n + m))
        a[heavy, n + np.arange(m)] = 1
        a[np.flatnonzero(massless), :n] = kx[massless]
        a[n:, :n], a[n:, n:] = kx[heavy], kv[np.ix_(heavy, heavy)]
        if has_function(self.structure.method):
            return Linear(np.linalg.eigvals(a)[:, None, None], None)
        y = np.linalg.eig(a)[1][:n]
        y = y / np.linalg.norm(y, axis=0)
        return pairs(*(-(y.conj() * (matrix @ y)).sum(axis=0) for matrix in (kx, kv)))

    def _large(self, island: BaseIsland) -> Linearised:
        """The modes that decide; forces on single particles add their largest stiffness and damping to each."""
        w, couplings = self._mobility(), self._couplings(island)
        number = sum(part.number for _, part in couplings)
        labels = dict.fromkeys(name for name, _ in couplings)
        sets = {label: [part for name, part in couplings if name == label] for label in labels}
        alone = {
            label: self._damped((extreme_modes if number <= FEW_SPRINGS else _bounding_modes)(parts, w))
            for label, parts in sets.items()
        }
        for label, blocks in self._blocks(SAMPLE).items():
            alone[label] = Linear(blocks.kx, None if all(self.massless) else blocks.kv)
        find = extreme_modes if number <= MOST_SPRINGS else _bounding_modes
        modes = find([part for _, part in couplings], w) if couplings else np.zeros((1, 2))
        together = self._damped(modes + self._background())
        how = "extreme modes" if number <= MOST_SPRINGS else "bounds"
        return Linearised(alone, together, how + self._left_out())

    def _damped(self, modes: Floats) -> Linear:
        """Pairs (k, d) as systems; without inertia x' = −k x."""
        if any(self.massless):
            return Linear(-modes[:, 0, None, None], None)
        return pairs(modes[:, 0], modes[:, 1])


def free_motions(rows: Floats) -> Floats:
    """An orthonormal basis of the motions that constraints, with rows [number, n], leave; shape [n, motions]."""
    _, sizes, basis = np.linalg.svd(rows)
    rank = int((sizes > 1e-9 * sizes.max(initial=0.0)).sum())
    return np.asarray(basis[rank:].T)


def pairs(k: NDArray[Any], d: NDArray[Any]) -> Linear:
    """Modes x'' = −k x − d v."""
    return Linear(-k[:, None, None], -d[:, None, None])


def particles_of(
    scenario: Scenario, group: Group, state: GroupState, time: float, most: int
) -> tuple[NDArray[np.int64], list[Particle]]:
    """Rows and particles of a group as laws see them: extreme ones and others evenly spread, about `most` at most."""
    if state.count or not isinstance(group, Emitter):
        rows = _rows(state, most)
        return np.array(rows, np.int64), [state.particle(row, time) for row in rows]
    streams = scenario.streams(group)
    schedule = Schedule(group, streams)
    count = min(schedule.total(scenario.grid.duration), most)
    times = schedule.times(0, count)
    born = group.births(streams, 0, times)
    given = {name: born.attributes.get(name, np.zeros(count)) for name in ATTRIBUTES}
    mass, radius, heat, *more = given.values()
    columns = (*born.position, *born.velocity, mass, radius, heat, times, 1 / mass, *more)
    return np.arange(count), [Particle(*(float(column[i]) for column in columns)) for i in range(count)]


def _rows(state: GroupState, most: int) -> list[int]:
    """Rows of free particles: the lightest, fastest, those farthest out, and others evenly spread."""
    n = state.count
    if n <= most:
        rows = set(range(n))
    else:
        columns = [*state.x[:, :n], *state.v[:, :n], state.mass[:n], state.radius[:n]]
        rows = {int(end(column)) for column in columns for end in (np.argmin, np.argmax)}
        rows |= {int(row) for row in np.linspace(0, n - 1, max(most - len(rows), 0))}
    return [row for row in sorted(rows) if not state.clocked or np.isfinite(state.start[row])]


def _jacobians(group: Group, sample: Sequence[Particle], record: Any) -> tuple[Floats, Floats]:
    """∂f/∂x and ∂f/∂v over the inertia of every particle; 0 in singular places, where there are none."""
    kx, kv = np.zeros((2, len(sample), 3, 3))
    for i, p in enumerate(sample):
        inertia = group.dynamics.drag if isinstance(group.dynamics, FirstOrder) else p.m
        for out, derivative in ((kx, force_dx), (kv, force_dv)):
            try:
                with np.errstate(all="ignore"):
                    matrix = np.array(evaluate(derivative, record, p), float).reshape(3, 3) / inertia
            except (ArithmeticError, ValueError):
                continue
            out[i] = np.where(np.isfinite(matrix), matrix, 0.0)
    return kx, kv


def _force(records: tuple[Any, ...], p: Particle) -> Floats:
    """The sum of forces on a particle [N]; 0 in singular places."""
    try:
        with np.errstate(all="ignore"):
            found = np.array(evaluate(force, records, p), float)
    except (ArithmeticError, ValueError):
        return np.zeros(3)
    return np.where(np.isfinite(found), found, 0.0)


def _gradients(sample: Sequence[Particle], flow: tuple[Any, ...]) -> tuple[Floats, Floats]:
    """∂w/∂x of the flow that carries particles without inertia."""
    kx = np.array([np.reshape(evaluate(velocity_dx, flow, p), (3, 3)) for p in sample], float)
    return kx.reshape(-1, 3, 3), np.zeros((len(sample), 3, 3))


def _top(matrices: Floats) -> float:
    """The largest stiffness or damping in a stack of Jacobians, shape [n, 3, 3]: of −(A + Aᵀ)/2."""
    if not matrices.size:
        return 0.0
    return max(float(np.linalg.eigvalsh(-(matrices + matrices.transpose(0, 2, 1)) / 2).max()), 0.0)


def _diagonal(rows: NDArray[np.int64], blocks: Floats, count: int) -> Floats:
    """Blocks of single particles in the matrix of an island."""
    out = np.zeros((count, 3, count, 3))
    out[rows, :, rows, :] = blocks
    return out.reshape(3 * count, 3 * count)


def _bounding_modes(sets: Sequence[Coupling], w: Floats) -> Floats:
    """Modes as stiff and as damped as any could be, each alone and both at once, shape [3, 2]."""
    k, d = (bound(sets, w, damping=damping) for damping in (False, True))
    return np.array([[k, 0.0], [k, d], [0.0, d]])
