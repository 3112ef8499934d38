"""The shadow energy, which a leapfrog conserves: the energy without its oscillation within steps.

Under linear forces the energy error of symplectic methods oscillates and does not grow. Exactly conserved are

    E + ½ h Σ v·f          with symplectic Euler,
    E − ⅛ h² Σ f²/m        with velocity Verlet and Störmer–Verlet,

where E is the energy. They bound the motion as long as the step is stable; beyond that they are conserved, too, but bound
nothing. Störmer–Verlet conserves the second with the velocities of velocity Verlet: those between two positions, and half a
kick. Forces of rods do no work, so that the first holds with rods as well.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, chapter IX.
"""

from __future__ import annotations

import numpy as np

from particlesim.engine.islands.base import BaseIsland
from particlesim.engine.state.group_state import GroupState
from particlesim.graph.graph import Island
from particlesim.integrators import METHODS
from particlesim.model.arrays import Floats

LEAPFROGS = ("velocity_verlet", "stormer_verlet")


def swings(structure: Island) -> bool:
    """Whether it is known what the method of an island keeps."""
    name = structure.method.name
    return name == METHODS["symplectic_euler"].name or (name in LEAPFROGS and not structure.constraints)


def swing(island: BaseIsland, structure: Island, time: float, h: float) -> float:
    """The energy of an island less the one that its method conserves [J]; `h` is the step [s]."""
    with np.errstate(over="ignore", invalid="ignore"):
        f = island.forces(time).astype(float)
        total, first = 0.0, 0
        for state in island.states:
            n = state.count
            here = f[:, first : first + n]
            first += n
            free = np.isfinite(state.start[:n]) if state.clocked else np.ones(n, np.bool_)
            if structure.method.name in LEAPFROGS:
                total += h * h / 8 * float(((here**2).sum(axis=0) / state.mass[:n])[free].sum())
                total += _of_places(state, here, h) if len(state.memory) else 0.0
            else:
                total -= h / 2 * float((here * state.v[:, :n]).sum(axis=0)[free].sum())
        return total


def _of_places(state: GroupState, f: Floats, h: float) -> float:
    """The kinetic energy with the velocities of the state less that with those of velocity Verlet [J]."""
    n = state.count
    *between, known = (column[:n].astype(float) for column in state.memory)
    m, v = state.mass[:n].astype(float), state.v[:, :n].astype(float)
    leapfrog = np.stack(between) + h / 2 * f / m
    return float((0.5 * m * (v**2 - leapfrog**2).sum(axis=0))[known != 0].sum())
