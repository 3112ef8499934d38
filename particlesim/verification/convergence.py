"""Whether a run converges as its method promises: the same scenario at dt, dt/2 and dt/4.

With an error C dtᵖ, the differences of consecutive runs are e₁ = C dtᵖ (1 − 2⁻ᵖ) and e₂ = 2⁻ᵖ e₁. So p = log₂(e₁/e₂) is the
observed order, and e₁ / (1 − 2⁻ᵖ) the error of the first run (Richardson's extrapolation).

Source: P. J. Roache, Verification and Validation in Computational Science and Engineering, chapter 5 (1998).
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from functools import reduce
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from particlesim.errors import UsageError
from particlesim.graph.graph import build_graph, methods_of
from particlesim.groups.group import Group
from particlesim.interactions import PairSet
from particlesim.preflight.advice import loss_of_order, sliding
from particlesim.runs.runner import Progress, run
from particlesim.scenario.dump import to_table
from particlesim.scenario.load import from_table
from particlesim.scenario.reach import acts_on, held_back
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory import reader
from particlesim.trajectory.frame import Frame
from particlesim.trajectory.reader import Trajectory

LEVELS = 3
MARGIN = 0.5
"""An order that is lower than the method's by more than this is clearly below it."""
MOST_FRAMES = 64
ROUNDING = 16
"""Rounding of N steps: so many times √N times the distance of floating-point numbers at the largest value."""
CLEAR = 8
"""An order is read off differences that are so many times larger than rounding."""

Verdict = Literal["ok", "exact", "rounding", "below", "random"]


@dataclass(frozen=True)
class Convergence:
    """How a field of a group converges: differences of consecutive runs, observed and expected order, errors by Richardson.

    Differences and errors are root mean squares over particles and frames, in SI units; `relative` is the error of the run
    at dt as a fraction of the largest value. The verdict is "exact" where all runs agree to rounding, "rounding" where the
    finer ones do, so that there is no order to be seen, "below" when it is clearly lower than the method's, and "random"
    where forces are: other steps have other kicks, so that paths do not converge, and have no order.
    """

    group: str
    field: str
    method: str
    expected: int
    differences: tuple[float, float]
    order: float | None
    error: float | None
    finest_error: float | None
    relative: float | None
    verdict: Verdict


@dataclass(frozen=True)
class Verification:
    """Convergence of every group, with the known reasons for losing order where it is lost, and what the runs converge to
    that no nature does (`notes`)."""

    steps: tuple[float, ...]
    """The steps dt, dt/2 and dt/4 [s]."""
    rows: tuple[Convergence, ...]
    reasons: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether no order is clearly below that of its method."""
        return all(row.verdict != "below" for row in self.rows)

    def as_data(self) -> dict[str, Any]:
        """As plain data."""
        return {**asdict(self), "passed": self.passed}


def verify(
    scenario: Scenario,
    *,
    threads: int | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Verification:
    """Run a scenario at dt, dt/2 and dt/4, in double precision, and compare positions and velocities at common frames.

    Needs seven times the work of a run, and the disk for at most 64 frames of each, in the folder for temporary files.
    Raises UsageError for methods that choose their own steps, and as `runner.run` does.
    """
    for method in methods_of(scenario).values():
        if method.adaptive:
            raise UsageError(
                f"{method.name} chooses its own steps, so its order cannot be seen by halving dt",
                "Compare runs with different tolerances: psim diff --tolerance.",
            )
    kicked = randomly_kicked(scenario)
    if all(group.name in kicked for group in scenario.groups):
        raise UsageError(
            f"{kicked[scenario.groups[0].name]} gives random kicks, others for every dt: paths do not converge one by one, "
            "and no order can be seen",
            "Compare averages of long runs at dt and dt/2, such as the kinetic energy; or verify without the temperature.",
        )
    with tempfile.TemporaryDirectory(prefix="psim-") as folder, ExitStack() as stack:
        paths = [Path(folder) / f"{level}.vtkhdf" for level in range(LEVELS)]
        finer = [_refined(scenario, 2**level) for level in range(LEVELS)]
        for level, path in zip(finer, paths, strict=True):
            run(level, path, threads=threads, progress=progress)
        trajectories = [stack.enter_context(reader.open(path)) for path in paths]
        rows = tuple(_converge(scenario, trajectories, kicked))
    below = [row.group for row in rows if row.verdict == "below"]
    reasons = tuple(dict.fromkeys(reason for name in below for reason in _reasons(scenario, name)))
    return Verification(
        tuple(level.grid.dt for level in finer), rows, reasons, (*sliding(scenario), *_of_chance(kicked))
    )


def randomly_kicked(scenario: Scenario) -> dict[str, str]:
    """Groups that random forces move, themselves or through what they act on, and the interaction that gives them."""
    found: dict[str, str] = {}
    for island in build_graph(scenario).islands:
        random = [each for each in island.interactions if isinstance(each, PairSet) and each.law.random()]
        found |= {group.name: random[0].name for group in island.groups if random}
    return found


def _of_chance(kicked: dict[str, str]) -> Iterator[str]:
    """What there is to say of groups that random forces move."""
    for law in dict.fromkeys(kicked.values()):
        names = " and ".join(repr(name) for name, each in kicked.items() if each == law)
        yield (
            f"{law} gives {names} random kicks, others for every dt: their paths do not converge one by one, and have no "
            "order"
        )


def _refined(scenario: Scenario, factor: int) -> Scenario:
    """The scenario with its step divided by `factor`, without checks, recorded in double precision at few common times."""
    table, grid = to_table(scenario), scenario.grid
    thinning = -(-grid.frames // MOST_FRAMES)
    table.pop("checks", None)
    table["simulation"] |= {"dt": grid.dt / factor, "precision": "double", "duration": grid.duration}
    table["simulation"].pop("substeps", None)
    table["render"] = {}
    table["output"] = {
        "every": grid.every * thinning * factor,
        "fields": ["velocity"],
        "precision": "double",
        "compression": "none",
        "ledger": False,
    }
    return from_table(table).loaded_from(scenario.folder, scenario.overrides, scenario.source)


@dataclass
class _Sums:
    """Of a field of a group: squares of the two differences, how many, and the largest value."""

    squares: NDArray[np.float64]
    count: int = 0
    largest: float = 0.0


def _converge(
    scenario: Scenario, runs: Sequence[Trajectory], kicked: Mapping[str, str]
) -> Iterator[Convergence]:
    """The rows of the table, group by group."""
    steps = int(runs[-1].steps[-1])
    for group in scenario.groups:
        fields = ["position"] if group.dynamics.type != "second_order" else ["position", "velocity"]
        sums = {field: _Sums(np.zeros(LEVELS - 1)) for field in fields}
        for frames in zip(*runs, strict=True):
            _add(frames, group.name, sums)
        for field, found in sums.items():
            row = _row(scenario, group, field, found, steps)
            chance = group.name in kicked and row.verdict in ("ok", "below")
            yield (
                replace(row, order=None, error=None, finest_error=None, relative=None, verdict="random")
                if chance
                else row
            )


def _add(frames: Sequence[Frame], group: str, sums: dict[str, _Sums]) -> None:
    """Take in the particles of a group that all runs have at a frame."""
    masks = [frame.of(group) for frame in frames]
    ids = [frame.id[mask] for frame, mask in zip(frames, masks, strict=True)]
    common = reduce(np.intersect1d, ids)
    if not len(common):
        return
    order = [np.argsort(own) for own in ids]
    rows = [o[np.searchsorted(own, common, sorter=o)] for own, o in zip(ids, order, strict=True)]
    for field, found in sums.items():
        columns = [f[field][m][r] for f, m, r in zip(frames, masks, rows, strict=True)]
        found.squares += [np.square(a - b).sum() for a, b in pairwise(columns)]
        found.count += len(common)
        found.largest = max(found.largest, float(np.abs(columns[0]).max()))


def _row(scenario: Scenario, group: Group, field: str, found: _Sums, steps: int) -> Convergence:
    """Order and errors from the differences."""
    method = methods_of(scenario)[group.name]
    coarse, fine = np.sqrt(found.squares / max(found.count, 1)).tolist()
    noise = ROUNDING * np.finfo(float).eps * math.sqrt(steps) * found.largest
    order = error = finest = None
    verdict: Verdict = "ok"
    if max(coarse, fine) <= noise:
        verdict = "exact"
    elif fine <= CLEAR * noise:
        verdict = "rounding"
    else:
        order = math.log2(coarse / fine) if coarse else -math.inf
        if order < method.order - MARGIN:
            verdict = "below"
        if order > 0:
            error, finest = coarse / (1 - 2**-order), fine / (2**order - 1)
    relative = None if error is None else error / found.largest
    return Convergence(
        group.name,
        field,
        method.name,
        method.order,
        (coarse, fine),
        order,
        error,
        finest,
        relative,
        verdict,
    )


def _reasons(scenario: Scenario, name: str) -> Iterator[str]:
    """What is known to cost a group its order."""
    group = next(group for group in scenario.groups if group.name == name)
    yield from loss_of_order(scenario, group, methods_of(scenario)[group.name])
    met = [f"{c.kind} {c.name or k}" for k, c in enumerate(scenario.all_colliders) if held_back(c, (name,))]
    if met:
        yield (
            f"particles of {name!r} can meet {' and '.join(met)}: a path with a kink has no order "
            "above the first, and bounces amplify differences"
        )
    for label, force in zip(scenario.labels.forces, scenario.forces, strict=True):
        if acts_on(force, group) and (kink := force.kink()) is not None:
            yield f"{label} is not smooth: {kink}"
    if any(kick.on is None or name in kick.on for kick in scenario.impulses):
        yield f"an impulse kicks {name!r} at the nearest step, which moves with dt"
    for bonds in scenario.bonds:
        if name in bonds.groups and (bonds.law.tension_only or bonds.law.breaks):
            yield f"springs {bonds.name} go slack or break, at a moment that no step hits"
