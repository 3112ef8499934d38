"""Steps of an island whose particles act on each other: the choice of the kernel and of the number of threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np

from particlesim.engine.coupled.adaptive import Pace, new_pace, step_island_adaptive
from particlesim.engine.coupled.gauss_radau import staged_gauss_radau, step_island_gauss_radau
from particlesim.engine.coupled.kernel import step_island
from particlesim.engine.coupled.wisdom_holman import staged_wisdom_holman, step_island_wisdom_holman
from particlesim.engine.coupled.workspace import Part, staged
from particlesim.engine.implicit.kernel import step_island_implicit
from particlesim.engine.implicit.krylov import INDEFINITE, General, Symmetric
from particlesim.engine.implicit.staged import StagedImplicit, staged_implicit
from particlesim.engine.interactions.interaction import tired_elements
from particlesim.engine.islands.base import OWN_STEPS, WORTH_THREADS
from particlesim.engine.islands.in_space import InSpace
from particlesim.engine.islands.layout import Interactions, Layout
from particlesim.engine.state.columns import Columns
from particlesim.engine.state.group_state import GroupState
from particlesim.graph.graph import Island
from particlesim.integrators import GaussRadauMethod, ImplicitMethod, WisdomHolmanMethod
from particlesim.laws.registry import evaluate, force_dv, force_dx
from particlesim.model.arrays import Floats
from particlesim.process.threads import Team

WORTH_SPRINGS = 5_000
"""Springs below which threads would spend their time waiting for each other."""

SOLVED_STEP = 50
"""How many times longer a step takes whose equations are solved."""


class Stepper:
    """The method of an island: its numbers, and the kernel that steps by it."""

    def __init__(self, structure: Island, states: Sequence[GroupState], dt: float) -> None:
        self.method, self.dt = structure.method, dt
        self._staged, self._kernel = _stepper(structure, states)

    def pace(self, threads: int, events: Floats, *, disturbed: bool, pauses: bool) -> Pace | None:
        """What threads tell each other of own steps; None for methods without."""
        return new_pace(threads, events, disturbed=disturbed, pauses=pauses) if self.method.adaptive else None

    def threads(self, layout: Layout, steps: int, team: Team) -> int:
        """On how many threads steps are made."""
        own = OWN_STEPS if self.method.adaptive else 1 if layout.work.system is None else SOLVED_STEP
        worth = layout.effort >= WORTH_SPRINGS and layout.effort * steps * own >= WORTH_THREADS
        return team.threads if worth else 1

    def work(
        self,
        layout: Layout,
        columns: Columns,
        first: int,
        steps: int,
        done: list[int],
        pace: Pace | None,
        there: InSpace | None = None,
    ) -> Callable[[int], None]:
        """What each of as many threads as `done` has places is to do: steps from `first` on, of which some are done, of
        particles in another order where there is one."""
        shares = layout.shares(len(done))
        if there is not None:
            columns = there.columns
            shares = [(bonds, work, there.share(share)) for bonds, work, share in shares]

        def work(k: int) -> None:
            bonds, scratch, share = shares[k]
            given = (self._staged, layout.parts, bonds, columns, scratch, share)
            if pace is not None:
                done[k] = self._kernel(*given, pace, first, steps, self.dt)
            else:
                done[k] += self._kernel(*given, first + done[k], steps - done[k], self.dt)

        return work

    def copy(
        self,
        layout: Layout,
        parts: tuple[Part, ...],
        interactions: Interactions,
        columns: Columns,
        first: int,
        steps: int,
    ) -> None:
        """Steps of a copy of the particles and interactions, on one thread; not for methods with own steps."""
        bonds, work, share = layout.alone(interactions)
        if layout.constraint is not None:
            layout.constraint.begin()
        given = (parts, bonds, columns, work, share)
        done, going = 0, True
        while going:
            made = self._kernel(self._staged, *given, first + done, steps - done, self.dt)
            done += made
            paused = made > 0 and tired_elements(share.elements)
            going = done < steps and (paused or self.solves_more(layout))

    def solves_more(self, layout: Layout) -> bool:
        """Whether the last step met equations that are not symmetric and positive definite: from now on the kernel solves
        these, too."""
        if not isinstance(self._staged, StagedImplicit) or isinstance(self._staged.solver, General):
            return False
        if layout.work.system.report[0] != INDEFINITE:
            return False
        self._staged = self._staged._replace(solver=General())
        return True


def _stepper(island: Island, states: Sequence[GroupState]) -> tuple[tuple[Any, ...], Callable[..., Any]]:
    """The numbers of an island's method, and the kernel that steps by it."""
    method = island.method
    if isinstance(method, ImplicitMethod):
        solver = General() if _lopsided(island, states) else Symmetric()
        return staged_implicit(method, states[0].dtype, solver), step_island_implicit
    if isinstance(method, GaussRadauMethod):
        return staged_gauss_radau(method), step_island_gauss_radau
    if isinstance(method, WisdomHolmanMethod):
        return staged_wisdom_holman(method), step_island_wisdom_holman
    step = step_island_adaptive if method.adaptive else step_island
    return staged(method, apart=bool(island.constraints)), step


def _lopsided(island: Island, states: Sequence[GroupState]) -> bool:
    """Whether some force on the first particles has a Jacobian that is not symmetric: the equations will not be."""
    for forces, state in zip(island.forces, states, strict=True):
        for force, derivative in product(forces if state.count else (), (force_dx, force_dv)):
            try:
                with np.errstate(all="ignore"):
                    matrix = np.reshape(evaluate(derivative, force.record(), state.particle(0, 0.0)), (3, 3))
            except (ArithmeticError, ValueError):  # a singular place
                continue
            if np.abs(matrix - matrix.T).max() > 1e-6 * np.abs(matrix).max():
                return True
    return False
