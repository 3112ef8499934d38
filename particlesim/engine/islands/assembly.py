"""An island whose particles act on each other, put together: what its kernels take, for one thread or several."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np

from particlesim.engine.constraints.shake_rattle import Rods
from particlesim.engine.coupled.adaptive import step_island_adaptive
from particlesim.engine.coupled.gauss_radau import staged_gauss_radau, step_island_gauss_radau
from particlesim.engine.coupled.kernel import step_island
from particlesim.engine.coupled.workspace import Part, Share, Work, share_out, staged
from particlesim.engine.implicit.kernel import staged_implicit, step_island_implicit
from particlesim.engine.implicit.krylov import General, Symmetric
from particlesim.engine.interactions.bond_layout import chunk_size, order_of, owned
from particlesim.engine.interactions.interaction import new_forms
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.prescribed import Driven
from particlesim.engine.step.records import as_precision, contacts_record, dynamics_record
from particlesim.graph.graph import Island
from particlesim.groups.group import Group
from particlesim.integrators import GaussRadauMethod, ImplicitMethod
from particlesim.laws.registry import evaluate, force_dv, force_dx
from particlesim.model.arrays import Floats

Interactions = tuple[Any, ...]
"""Records of interactions (`interactions.interaction`), those that are added chunk by chunk first."""


def apart(interactions: Interactions) -> tuple[Interactions, Interactions]:
    """Those that are added chunk by chunk, and the others."""
    by_chunks = tuple(each for each in interactions if each.by_chunks)
    return by_chunks, interactions[len(by_chunks) :]


def stepper(
    island: Island, states: Sequence[GroupState], dtype: Any
) -> tuple[tuple[Any, ...], Callable[..., Any]]:
    """The numbers of an island's method, and the kernel that steps by it."""
    method = island.method
    if isinstance(method, ImplicitMethod):
        solver = General() if _lopsided(island, states) else Symmetric()
        return staged_implicit(method, dtype, solver), step_island_implicit
    if isinstance(method, GaussRadauMethod):
        return staged_gauss_radau(method), step_island_gauss_radau
    step = step_island_adaptive if method.adaptive else step_island
    return staged(method, apart=bool(island.rods)), step


def parts_of(island: Island, bounds: Sequence[int], dtype: Any) -> tuple[Part, ...]:
    """The groups of an island as kernels take them; `bounds` are the borders of their rows."""
    return tuple(
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


def cooling_of(groups: Sequence[Group], bounds: Sequence[int]) -> tuple[Floats, Floats] | None:
    """Rate of cooling [1/s] and temperature around [K] of every particle, shape [n]; None where no group cools."""
    if all(group.cooling is None for group in groups):
        return None
    number = np.diff(bounds)
    laws = [
        (0.0, 0.0) if each.cooling is None else (each.cooling.rate, each.cooling.ambient) for each in groups
    ]
    rate, ambient = (np.repeat(column, number) for column in zip(*laws, strict=True))
    return rate, ambient


def shared(
    count: int, threads: int, driven: tuple[Driven, ...], interactions: Interactions, rods: Rods | None
) -> list[tuple[Interactions, Share]]:
    """What each of some threads works on: its pieces of what is added chunk by chunk, and its particles."""
    chunk = chunk_size(count)
    chunks = -(-count // chunk)
    bonds, elements = apart(interactions)
    found = []
    for share in share_out(count, threads, driven, elements, rods):
        mine = tuple(
            bond._replace(table=table, begin=begin)
            for bond in bonds
            for table, begin in [owned(bond.table, share.first, share.last, chunk, chunks)]
        )
        order = order_of(
            [bond.table for bond in mine], share.first, share.last, chunk, chunks, wait=bool(share.elements)
        )
        found.append((mine, share._replace(order=order)))
    return found


def own_scratch(work: Work, share: Share, dtype: Any) -> Work:
    """Scratch arrays of a thread: those of the island, but for what each thread has to itself."""
    work = work._replace(pull=np.zeros_like(work.pull), spread=np.zeros_like(work.spread))
    if work.system is None:
        return work
    system = work.system
    own = system._replace(
        pull=np.zeros_like(system.pull),
        lanes=np.zeros_like(system.lanes),
        forms=new_forms(share.elements, dtype),
    )
    return work._replace(system=own)


def _lopsided(island: Island, states: Sequence[GroupState]) -> bool:
    """Whether some force on the first particles has a Jacobian that is not symmetric: the equations will not be."""
    for forces, state in zip(island.forces, states, strict=True):
        if not state.count:
            continue
        for force, derivative in product(forces, (force_dx, force_dv)):
            try:
                with np.errstate(all="ignore"):
                    matrix = np.reshape(evaluate(derivative, force.record(), state.particle(0, 0.0)), (3, 3))
            except (ArithmeticError, ValueError):  # a singular place
                continue
            if np.abs(matrix - matrix.T).max() > 1e-6 * np.abs(matrix).max():
                return True
    return False
