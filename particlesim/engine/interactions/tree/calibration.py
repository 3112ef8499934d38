"""The tolerance of the walk with which forces are as accurate as was asked for.

The tolerance bounds the estimated error of one pair of cells; how the errors of many pairs add up depends on the
distribution of particles. So the error is measured on some particles against direct sums, and the tolerance changed until it
is right.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import kernel, on_stack, outlined
from particlesim.engine.barrier import new_gate
from particlesim.engine.interactions.tree.direct import TARGETS, pair
from particlesim.engine.interactions.tree.field import LEAST_NEED, Hand, Tree, field_of_all, for_threads
from particlesim.engine.interactions.tree.form import EXACTEST
from particlesim.errors import UsageError
from particlesim.process.threads import Team

Floats = NDArray[np.float64]

SAMPLE = 1008
"""Particles whose forces are compared with direct sums: if errors are much alike, the root of their mean square is within
some percent."""
MANY = 262_144
"""Particles whose forces are compared with those of a smaller tolerance."""
FINER = 0.05
"""The smaller tolerance over the one in question: its errors are about a tenth."""
WIDEST, NARROW = 0.95, 0.6
"""Largest sum of radii, and largest radius of a target, over the distance: series converge below 1."""
FIRST = 5.0
"""First tolerance over accuracy; it comes out between 0.6 and 15."""
AIM, LEAST, MOST = 0.75, 0.5, 0.95
"""What the measured error over the accuracy should be, and between what it may be."""
SLOPE = 0.7
"""About how errors grow with the tolerance: as this power of it."""
ROUNDS = 8
WORTH_THREADS = 5_000
TARGET, TOLERANCE, ERROR = 3, 0, 4


def order_for(accuracy: float) -> int:
    """The order with which an accuracy costs least."""
    orders = ((3, 2e-2), (4, 3e-3), (5, 4e-4), (6, 4e-5), (7, 2e-6))
    return next((order for order, least in orders if accuracy >= least), 8)


def first_limits(accuracy: float) -> tuple[float, float, float]:
    """The limits of a walk before an error has been measured: squares of tolerance, widest opening, widest target."""
    return (FIRST * accuracy) ** 2, WIDEST**2, NARROW**2


def calibrate(tree: Tree, limits: Floats, size: Floats, place: Any, w: Floats, team: Team) -> None:
    """Set the tolerance in `limits` so that errors are as large as asked for there, and note the error that is measured.

    `place`: columns x, y, z. Raises UsageError where the accuracy cannot be had.
    """
    feel = np.flatnonzero(w)
    if len(feel) < 2:
        limits[ERROR] = np.finfo(float).eps
        return
    threads = team.threads if len(w) > WORTH_THREADS else 1
    tree = for_threads(tree, threads)

    def summed() -> Floats:
        evaluate(tree, limits, size, place, w, team, threads)
        return tree.field

    def miss(rows: Any, right: Floats) -> float:
        return rms_error(tree.field[:, rows], right, float(size[feel].mean()))

    few = feel[np.linspace(0, len(feel) - 1, min(SAMPLE, len(feel))).astype(np.int64)]
    exact = _sampled(tree, place, w, few, team if threads > 1 else None)
    if (
        not size.any()
    ):  # cells are cut by what the field is, so errors are those of later sums once it is known
        summed()
    _meet(limits, summed, lambda: miss(few, exact))
    if len(few) == len(feel) or limits[ERROR] <= np.finfo(float).eps:
        return
    # A few particles, as those at the rim of a cluster, may have most of the error, and a sample none of them.
    many = feel[:: -(-len(feel) // MANY)]
    for _ in range(ROUNDS):
        found = limits.copy()
        limits[TOLERANCE] *= FINER**2
        better = summed()[:, many]
        limits[:] = found
        _meet(limits, summed, lambda: max(miss(few, exact), miss(many, better)))  # noqa: B023
        if limits[TOLERANCE] > (3 * FINER) ** 2 * found[TOLERANCE]:
            return


def _meet(limits: Floats, summed: Callable[[], object], measured: Callable[[], float]) -> None:
    """Change the tolerance until the errors of what is summed are as large as asked for, and note them."""
    accuracy = limits[TARGET]
    tried: list[tuple[float, float]] = []
    for _ in range(ROUNDS):
        summed()
        error = measured()
        tried.append((math.sqrt(limits[TOLERANCE]), error))
        limits[ERROR] = max(error, np.finfo(float).eps)
        if (
            error == 0
        ):  # as among particles in one place: nothing was measured, and the first tolerance is a safe one
            return
        if LEAST * accuracy <= error <= MOST * accuracy:
            return
        if error < accuracy and _settled(tried):
            limits[TOLERANCE] = (
                tried[-2][0] ** 2
            )  # the larger one may let in errors once there are more particles
            return
        limits[TOLERANCE] = (tried[-1][0] * _step(accuracy, tried)) ** 2
    best = min(error for _, error in tried)
    if not math.isfinite(best):
        raise UsageError(
            "forces by a tree are not finite, or less than numbers can tell from nothing",
            'places, masses or a softening are out of all proportion; give other units, or method = "direct"',
        )
    if best > accuracy:
        raise UsageError(
            f"forces cannot be as accurate as {accuracy:g} with a tree: {best:.1e} is reached",
            'a larger accuracy, or method = "direct"',
        )
    limits[TOLERANCE] = max(tolerance for tolerance, error in tried if error <= accuracy) ** 2
    limits[ERROR] = max(error for tolerance, error in tried if tolerance**2 == limits[TOLERANCE])


def _settled(tried: list[tuple[float, float]]) -> bool:
    """Whether another tolerance has made no other error, as where all pairs are near."""
    return len(tried) > 1 and (tried[-1][0] > tried[-2][0]) and tried[-1][1] < 1.2 * tried[-2][1]


def _step(accuracy: float, tried: list[tuple[float, float]]) -> float:
    """By what to multiply the tolerance: by the slope between the last two, within bounds."""
    slope = SLOPE
    if len(tried) > 1:
        (t1, e1), (t2, e2) = tried[-2:]
        if t1 != t2 and min(e1, e2) > 0:
            slope = min(max(math.log(e2 / e1) / math.log(t2 / t1), 0.25), 1.5)
    error = max(tried[-1][1], 1e-3 * accuracy)
    return min(max((AIM * accuracy / error) ** (1 / slope), 1 / 50), 20)


def evaluate(
    tree: Tree, limits: Floats, size: Floats, place: Any, w: Floats, team: Team, threads: int
) -> None:
    """The field of all particles, by so many threads."""
    gate = new_gate()
    team.each(lambda k: field_of_all(tree, limits, size, *place, w, Hand(k, threads, gate)), threads)


def rms_error(found: Floats, exact: Floats, mean: float) -> float:
    """Root of the mean square of relative errors [3, n]; relative to no less than a part of the mean; 0 without any."""
    miss = np.linalg.norm(found - exact, axis=0)
    if not miss.any():
        return 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(
            np.sqrt(np.mean((miss / np.maximum(np.linalg.norm(exact, axis=0), LEAST_NEED * mean)) ** 2))
        )


def _sampled(tree: Tree, place: Any, w: Floats, rows: Any, team: Team | None) -> Floats:
    """The field at some particles by direct sums [3, rows]."""
    out = np.zeros((3, len(rows)))
    blocks = range(0, len(rows), TARGETS)

    def work(k: int) -> None:
        direct_field(tree.form, *place, w, rows, blocks[k], out)

    if team is None:
        for k in range(len(blocks)):
            work(k)
    else:
        team.each(work, len(blocks))
    return out


@kernel
def direct_field(form: Any, x: Any, y: Any, z: Any, w: Any, rows: Any, at: Any, out: Any) -> None:
    """The field at particles `rows` from `at` on, as many as there are targets at a time, by direct sums."""
    _direct_field(form, x, y, z, w, rows, at, min(rows.size - at, TARGETS), out)


@outlined
def _direct_field(
    form: Any, x: Any, y: Any, z: Any, w: Any, rows: Any, at: Any, number: Any, out: Any
) -> None:
    t = on_stack(6, TARGETS, np.float64)
    for lane in range(TARGETS):
        i = rows[at + min(lane, number - 1)]
        t[0, lane] = x[i]
        t[1, lane] = y[i]
        t[2, lane] = z[i]
        for k in range(3):
            t[3 + k, lane] = 0.0
    for j in range(x.size):
        xj, yj, zj, wj = float(x[j]), float(y[j]), float(z[j]), w[j]
        for lane in range(TARGETS):
            dx, dy, dz = xj - t[0, lane], yj - t[1, lane], zj - t[2, lane]
            r2 = dx * dx + dy * dy + dz * dz
            _, slope = pair(form.softening, r2, EXACTEST)
            g = wj * slope if r2 > 0 else 0.0
            t[3, lane] += g * dx
            t[4, lane] += g * dy
            t[5, lane] += g * dz
    for lane in range(number):
        for k in range(3):
            out[k, at + lane] = t[3 + k, lane]
