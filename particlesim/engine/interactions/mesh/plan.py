"""How forces in a periodic box are cut in two, so that they are as accurate as asked for and cost least.

Let the field of unit weights have the mean square error σ² W², W² = Σ w². The error of cutting off the near part at the
distance c, R_c² = c² + ε², is for particles at random positions

    σ² = 4/(c V) e^(−2 α² R_c²)

(Kolafa and Perram), and the error of the far part on the mesh follows from α h (`influence.mesh_errors`). Each may be a half
of the allowed error. For meshes of all sizes that gives α, then c, and the cost of a sum; the cheapest mesh is taken.
Sources: J. Kolafa, J. W. Perram, Mol. Simul. 9, 351 (1992); M. Deserno, C. Holm, J. Chem. Phys. 109, 7678 (1998).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from particlesim.engine.interactions.mesh.influence import mesh_errors

SIZES = sorted(n for n in (*(2**k for k in range(4, 11)), *(3 * 2**k for k in range(4, 9))))
"""Nodes of a mesh along an axis: even multiples of a brick, with factors 2 and 3 alone."""
FLOOR = 0.1
"""Errors are relative to the force, or to this part of the force between two neighbours where that is more."""
TYPICAL = 2.0
"""The force on a particle among others without order, over that between two at the mean distance."""
FEW_NODES, NODES_EACH = 128**3, 128
"""A mesh has at most so many nodes, or so many for each particle: the near part does the rest."""
SPARE = 4.0
"""How much more exact than asked for the near part may become: e^(−x²) by that power of e."""
WAVE, FAR_WAVE, CACHED, PAIR, LIST = 0.4, 0.8, 4_000_000, 3.3, 50.0
PARTICLE = (60.0, 85.0, 110.0, 140.0, 170.0, 225.0)
"""Times [ns]: of a node for each halving of the mesh, and of one of more than CACHED nodes; of a near pair; of a particle in
lists, and on the mesh by the order from 3 on."""


class Plan(NamedTuple):
    """α [1/m], the end of the near part [m], nodes along the axes."""

    alpha: float
    cutoff: float
    shape: tuple[int, int, int]


class Task(NamedTuple):
    """A box [m], the softening in both parts [m], order of the splines, how many particles; the distance that the near part
    must reach in any case [m]; and how many neighbours are nearer than a distance, in the mean."""

    size: tuple[float, float, float]
    softening: float
    order: int
    number: int
    least: float
    nearer: Callable[[float], float]

    @property
    def volume(self) -> float:
        """V [m³]."""
        return math.prod(self.size)


CLASSES = ((4, 3e-3), (6, 1e-4), (8, 1e-6), (8, 1e-9))
"""Orders of splines, and down to which accuracy each is taken, where it costs about least; few, as kernels are compiled for
each."""


def class_of(accuracy: float) -> tuple[int, float]:
    """The order of splines for an accuracy, and the accuracy that polynomials are made for."""
    return next((each for each in CLASSES if accuracy >= each[1] * (1 - 1e-9)), CLASSES[-1])


def far_reach(accuracy: float) -> float:
    """Most that α R may be at the end of the near part."""
    return math.sqrt(math.log(1 / accuracy) + SPARE)


def uniform(size: Sequence[float], count: int) -> Callable[[float], float]:
    """Neighbours of particles without order."""
    density = count / math.prod(size)
    return lambda r: 4 / 3 * math.pi * r**3 * density


def planned(task: Task, error: float) -> Plan:
    """The plan that costs least, for an allowed σ [1/m²]: the root of the mean square of the errors of the field, of
    particles with W = 1."""
    share, finest = error * error / 2, (SIZES[0], SIZES[0], SIZES[0])
    found: list[tuple[float, Plan]] = []
    longest = max(task.size)
    most = max(FEW_NODES, NODES_EACH * task.number)
    for n in SIZES:
        shape = tuple(_at_least(n * length / longest) for length in task.size)
        if math.prod(shape) > most:
            break
        finest = (shape[0], shape[1], shape[2])
        h = max(length / nodes for length, nodes in zip(task.size, shape, strict=True))
        alpha = _alpha(task, h, share)
        cutoff = _cutoff(task, alpha, share)
        if cutoff is None:
            continue
        if cutoff < task.least:
            cutoff = task.least
            alpha = min(alpha, _least_alpha(task, cutoff, share))
        plan = Plan(alpha, cutoff, finest)
        found.append((cost(task, plan), plan))
    if not found:  # as exact as it gets: the finest mesh, and the near part as far as it goes
        cutoff = min(task.size) / 2
        return Plan(_least_alpha(task, cutoff, share), cutoff, finest)
    return min(found)[1]


def cost(task: Task, plan: Plan) -> float:
    """About the time of a sum of forces [ns]."""
    nodes = math.prod(plan.shape)
    near = PAIR * task.nearer(plan.cutoff) + LIST
    wave = WAVE if nodes < CACHED else FAR_WAVE
    return wave * nodes * math.log2(nodes) + task.number * (PARTICLE[task.order - 3] + near)


def _at_least(count: float) -> int:
    return next((n for n in SIZES if n >= count * (1 - 1e-9)), SIZES[-1])


def _alpha(task: Task, h: float, share: float) -> float:
    """The largest α with which a mesh of cells h is as exact."""
    alphas, errors = mesh_errors(task.order)
    wanted = math.log(share * task.volume * h)
    return math.exp(float(np.interp(wanted, np.maximum.accumulate(errors), alphas))) / h


def _near_error(task: Task, alpha: float, cutoff: float) -> float:
    """ln σ² of what is missing beyond the end of the near part."""
    square = cutoff * cutoff + task.softening * task.softening  # infinite where no number holds it
    return math.log(4 / (cutoff * task.volume)) - 2 * alpha**2 * square


def _cutoff(task: Task, alpha: float, share: float) -> float | None:
    """The least distance at which the near part may end; None if that is more than half of a side."""
    low, high, wanted = 1e-6 * min(task.size), min(task.size) / 2, math.log(share)
    if _near_error(task, alpha, high) > wanted:
        return None
    if _near_error(task, alpha, low) <= wanted:
        return low
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if _near_error(task, alpha, middle) <= wanted else (middle, high)
    return high


def _least_alpha(task: Task, cutoff: float, share: float) -> float:
    """The least α for an end of the near part."""
    square = cutoff * cutoff + task.softening * task.softening
    return math.sqrt(max(math.log(4 / (cutoff * task.volume * share)), 1.0) / (2 * square))
