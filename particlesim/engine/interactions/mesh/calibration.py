"""A plan with which forces are as accurate as was asked for.

The errors that `plan` estimates are those of particles at random positions. So errors are measured before the first step, on
some of the particles, against Ewald sums, and the plan is changed until they are as asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.interactions.mesh.ewald import Sum, ewald_field
from particlesim.engine.interactions.mesh.influence import COARSEST
from particlesim.engine.interactions.mesh.plan import FLOOR, SIZES, Plan, Task, planned
from particlesim.errors import UsageError
from particlesim.process.threads import Team

Floats = NDArray[np.float64]

SAMPLE, COUNTED, SOURCES = 1008, 48, 40_000
"""Particles whose forces are compared; those whose neighbours are counted, and among how many others."""
AIM, LOW = 0.7, 0.3
"""What the error over the accuracy should be, and what is so little that a coarser plan is tried, once."""
LEAST_NEED = 1e-3
"""Errors are relative to the force, or to this part of the mean force where that is more."""
EXACT = 0.02
"""The error of Ewald's sums over the accuracy."""
ROUNDS = 8
MOST_WAVES = 30_000_000
"""Waves of Ewald's sums: they take seconds, and a GiB of memory."""
TIGHTEST, GAIN = 10.0, 0.7
"""How much more exact a plan is than the one before at most; and what part of the error must then be left at most."""
MOST_IDLE = 3
"""Plans in a row that leave more than that, after which none is looked for: where mesh and near part share the work in
another way than before, one such plan may follow a better one."""


class Sample(NamedTuple):
    """Rows of some particles; the field at them [3, n]; their weights; and the forces to which errors are relative, [n], all
    for unit strength."""

    rows: NDArray[np.int64]
    gradient: Floats
    weight: Floats
    need: Floats


def refuse_long(
    plan: Plan, size: tuple[float, float, float], waves: tuple[int, int, int], accuracy: float
) -> None:
    """Raises UsageError for a box so long for its width that the finest mesh does not see what the near part leaves, or that
    there are too many waves to be summed; minutes would be spent on finding that out."""
    cell = max(length / nodes for length, nodes in zip(size, plan.shape, strict=True))
    x, y, z = waves
    if plan.alpha * cell > COARSEST or (x + 1) * (2 * y + 1) * (2 * z + 1) > MOST_WAVES:
        raise UsageError(
            f"forces cannot be as accurate as {accuracy:g} with a mesh in a box that is {max(size) / min(size):.3g} times "
            "as long as it is wide",
            "a larger accuracy, or a box that is more like a cube",
        )


def sampled(place: Floats, weight: Floats, volume: float, given: Sum, team: Team) -> Sample:
    """Some of the particles, with the field of all by Ewald's sums."""
    feel = np.flatnonzero(weight)
    rows = feel[np.linspace(0, len(feel) - 1, min(SAMPLE, len(feel))).astype(np.int64)]
    field = ewald_field(place, weight, rows, given, team)
    own = np.abs(weight[rows])
    force = own * np.linalg.norm(field.gradient, axis=0)
    near = math.sqrt(float((weight**2).mean())) * (len(weight) / volume) ** (2 / 3)
    need = np.maximum(force, np.maximum(LEAST_NEED * force.mean(), FLOOR * near * own))
    return Sample(rows, field.gradient, own, need)


def counted(place: Floats, size: tuple[float, float, float]) -> Callable[[float], float]:
    """How many neighbours are nearer than a distance, in the mean, by a part of the particles."""
    n = place.shape[1]
    rows = np.linspace(0, n - 1, min(COUNTED, n)).astype(np.int64)
    others = place[:, :: max(1, n // SOURCES)]
    lengths = np.array(size)[:, None]
    found = []
    for row in rows:
        d = others - place[:, row : row + 1]
        d -= lengths * np.rint(d / lengths)
        found.append(np.sqrt((d * d).sum(axis=0)))
    distance = np.sort(np.concatenate(found))
    each = n / others.shape[1] / len(rows)
    return lambda r: float(np.searchsorted(distance, r)) * each


def calibrated(
    task: Task, accuracy: float, sample: Sample, total: float, measure: Callable[[Plan], float]
) -> tuple[Plan, float]:
    """A plan and its error, as `measure` finds it; `total` is Σ w². Raises UsageError where the accuracy cannot be had."""
    unit = math.sqrt(float(((sample.weight / sample.need) ** 2).mean()) * total)
    allowed, idle = AIM * accuracy / unit, 0
    tried: list[tuple[float, Plan]] = []
    for turn in range(ROUNDS):
        plan = planned(task, allowed)
        error = measure(plan)
        tried.append((error, plan))
        if error <= accuracy and (error > LOW * accuracy or turn > 0 or error == 0):
            break
        if not math.isfinite(error):
            raise UsageError(
                "forces by a mesh are not finite",
                "places, masses or charges are out of all proportion; give other units",
            )
        stuck = turn > 0 and error > GAIN * tried[-2][0] and error > accuracy
        idle = idle + 1 if stuck else 0
        if stuck and (idle == MOST_IDLE or plan == tried[-2][1]):
            break  # it is not the cut that makes the error
        change = AIM * accuracy / max(error, 1e-300)
        allowed *= 1 / TIGHTEST if stuck else min(max(change, 1 / TIGHTEST), TIGHTEST)
    good = [each for each in tried if each[0] <= accuracy]
    if not good:
        raise UsageError(
            f"forces cannot be as accurate as {accuracy:g} with a mesh: {min(tried)[0]:.1e} is reached",
            'a larger accuracy, or precision = "double" where it is single'
            if max(plan.shape) < SIZES[-1]
            else f"a larger accuracy, or a box that is not as long: a mesh has {SIZES[-1]} nodes along an axis at most",
        )
    error, plan = good[-1]
    return plan, max(error, float(np.finfo(float).eps))
