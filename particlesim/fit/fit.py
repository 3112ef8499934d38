"""Least squares: the parameters with which a scenario comes closest to measurements.

Minimises χ² = Σ ((prediction − measurement)/σ)² by a trust-region method with bounds (Branch, Coleman, Li, SIAM J. Sci.
Comput. 21, 1, 1999; scipy.optimize.least_squares). Standard errors are the square roots of the diagonal of s² (JᵀJ)⁻¹, with
s² = 1 when σ is given and χ²/(n − p) when it is not (Press et al., Numerical Recipes, 3rd ed., 15.4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from particlesim.errors import DivergenceError, ScenarioError, UsageError
from particlesim.fit.measurements import Measurements
from particlesim.fit.parameters import Range, value_of, within_limits
from particlesim.fit.predict import predict
from particlesim.model.arrays import Floats
from particlesim.process.signals import held_signals
from particlesim.scenario.load import Overrides, parse_overrides, scenario_of
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text.overrides import overrides_from_mapping
from particlesim.scenario.text.source import read_source

STEP = 1e-5
"""Step of the differences that make the Jacobian, in scaled parameters: rounding of the runs and curvature balance."""
NEAR = 1e-7
"""Distance from a bound at which a parameter is at it, in scaled parameters."""
HOPELESS = 1e9
"""Residual, in units of the spread of the data, of parameters with which the run diverges."""


@dataclass(frozen=True)
class Parameter:
    """A fitted number: where it began, what it is, its standard error, and whether it stopped at a bound."""

    key: str
    start: float
    value: float
    error: float
    at_bound: bool


@dataclass(frozen=True)
class Fit:
    """The best parameters, the correlation of their errors [p, p], residuals [rows, 6], and the scenario with them.

    `chi2` is the sum of squares in units of σ (of the data when σ is not known), `freedom` its degrees of freedom. `starts`
    holds the χ² that every start ended with, best first; `converged` says whether the best one met its tolerances.
    """

    scenario: Scenario
    parameters: tuple[Parameter, ...]
    correlation: Floats
    residuals: Floats
    chi2: float
    freedom: int
    known_sigma: bool
    starts: tuple[float, ...]
    runs: int
    converged: bool

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters that the data say nothing about."""
        return tuple(p.key for p in self.parameters if not math.isfinite(p.error))


def fit(
    scenario: str | Path,
    measurements: Measurements,
    ranges: Sequence[Range],
    *,
    overrides: Overrides | None = None,
    starts: int = 1,
    seed: int = 0,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Fit numbers of a scenario file to measurements.

    Bounds are those of the ranges, and those that the scenario's models know, as of a coefficient that cannot be negative.
    The first start is the scenario's own values; further `starts` are drawn between the bounds (Latin hypercube, by
    `seed`), which then must be finite. `progress(runs, chi2)` is called after each run. Raises UsageError and ScenarioError
    for what cannot be fitted; runs that diverge count as bad fits.
    """
    if not ranges:
        raise UsageError("there is nothing to vary", "For example: --vary forces.air.coefficient=0,2")
    if starts < 1:
        raise UsageError(f"the number of starts must be 1 or more, got {starts}")
    keys = [each.key for each in ranges]
    if len(set(keys)) < len(keys):
        raise UsageError(f"{max(keys, key=keys.count)} is varied twice")
    problem = _Problem(Path(scenario), parse_overrides(overrides), measurements, ranges, progress)
    points = _starts(problem.ranges, problem.begin, starts, seed)
    if measurements.count <= len(ranges):
        raise UsageError(
            f"{measurements.count} measured numbers cannot determine {len(ranges)} parameters",
            "Measure more, or vary less.",
        )
    problem.try_out()
    with held_signals() as signals:
        problem.check = signals.check
        solutions = sorted((_solve(problem, point) for point in points), key=lambda s: float(s.cost))
        return _told(problem, solutions)


class _Problem:
    """Residuals of a scenario as a function of parameters."""

    def __init__(
        self,
        path: Path,
        settings: tuple[Any, ...],
        measurements: Measurements,
        ranges: Sequence[Range],
        progress: Callable[[int, float], None] | None,
    ) -> None:
        self._source, self._folder = read_source(path), path.resolve().parent
        self._settings, self._progress = settings, progress
        self.ranges: tuple[Range, ...] = ()
        self.data = measurements
        typical = self.at(())
        self.ranges = tuple(within_limits(each, typical) for each in ranges)
        self.begin = np.array([value_of(typical, each.key) for each in ranges])
        for each, value in zip(self.ranges, self.begin, strict=True):
            if not each.low <= value <= each.high:
                raise UsageError(
                    f"{each.key} is {value:.6g}, outside of its bounds {each.low:g} to {each.high:g}",
                    f"Begin inside of them: --set {each.key}=...",
                )
        self.scale = np.array(
            [_scale(each, value) for each, value in zip(self.ranges, self.begin, strict=True)]
        )
        self._measured = np.isfinite(measurements.values)
        self._spread = np.broadcast_to(_spread(measurements), measurements.values.shape)
        self.runs = 0
        self.check: Callable[[], None] = lambda: None

    def try_out(self) -> None:
        """Predict the measurements once, so that errors that do not depend on the fit are reported before it."""
        predict(self.at(()), self.data.times, self.data.ids)

    def at(self, values: Sequence[float] | Floats) -> Scenario:
        """The scenario with parameters in place. Raises ScenarioError for values that it does not allow."""
        varied = {each.key: float(value) for each, value in zip(self.ranges, values, strict=False)}
        return scenario_of(self._source, (*self._settings, *overrides_from_mapping(varied)), self._folder)

    def differences(self, values: Floats) -> Floats:
        """Prediction − measurement, shape [rows, 6], NaN where nothing was measured."""
        return predict(self.at(values), self.data.times, self.data.ids) - self.data.values

    def residuals(self, scaled: Floats) -> Floats:
        """Differences in units of σ, or of the spread of the data, in one row."""
        self.check()
        try:
            found = (self.differences(scaled * self.scale) / self._spread)[self._measured]
        except DivergenceError:
            found = np.full(int(self._measured.sum()), HOPELESS)
        except ScenarioError as error:
            raise UsageError(
                f"the fit left what the scenario allows: {error.message}", "Give bounds: --vary KEY=LOW,HIGH"
            ) from None
        self.runs += 1
        if self._progress is not None:
            self._progress(self.runs, float(found @ found))
        return found


def _scale(each: Range, value: float) -> float:
    """A typical size of a parameter."""
    if value != 0:
        return abs(value)
    return max(abs(each.low), abs(each.high)) if each.bounded else 1.0


def _spread(data: Measurements) -> Floats:
    """σ of every number, or one for all positions and one for all velocities: what they scatter by."""
    if data.sigma is not None:
        return data.sigma
    spread = np.ones(6)
    for part in (slice(0, 3), slice(3, 6)):
        values = data.values[:, part]
        if np.isfinite(values).any():
            spread[part] = np.nanmax(values) - np.nanmin(values) or 1.0
    return spread


def _starts(ranges: Sequence[Range], begin: Floats, count: int, seed: int) -> list[Floats]:
    """Where the searches begin."""
    points = [begin]
    if count > 1:
        for each in ranges:
            if not each.bounded:
                raise UsageError(
                    f"several starts need bounds, {each.key} has none", f"For example: --vary {each.key}=0,2"
                )
        from scipy.stats import qmc

        drawn = qmc.LatinHypercube(len(ranges), seed=np.random.default_rng(seed)).random(count - 1)
        low, high = (np.array([getattr(each, side) for each in ranges]) for side in ("low", "high"))
        points += list(low + drawn * (high - low))
    return points


def _solve(problem: _Problem, point: Floats) -> Any:
    from scipy.optimize import least_squares

    low, high = (np.array([getattr(each, side) for each in problem.ranges]) for side in ("low", "high"))
    return least_squares(
        problem.residuals,
        point / problem.scale,
        jac="3-point",
        bounds=(low / problem.scale, high / problem.scale),
        x_scale="jac",
        diff_step=np.full(len(point), STEP),
        xtol=1e-10,
        ftol=1e-12,
        gtol=1e-12,
    )


def _told(problem: _Problem, solutions: Sequence[Any]) -> Fit:
    best = solutions[0]
    values = best.x * problem.scale
    chi2, count = 2 * float(best.cost), problem.data.count
    if chi2 >= HOPELESS**2:
        raise DivergenceError(
            "the run diverges with every value tried", "Begin with a smaller dt, or give bounds."
        )
    freedom = count - len(values)
    known = problem.data.sigma is not None
    covariance = _covariance(best.jac) * (1.0 if known else chi2 / freedom)
    errors = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore"):
        correlation = covariance / np.outer(errors, errors)
    parameters = tuple(
        Parameter(each.key, float(start), float(value), float(error), _at_bound(each, value, scale))
        for each, start, value, error, scale in zip(
            problem.ranges, problem.begin, values, errors * problem.scale, problem.scale, strict=True
        )
    )
    return Fit(
        problem.at(values),
        parameters,
        correlation,
        problem.differences(values),
        chi2,
        freedom,
        known,
        tuple(2 * float(each.cost) for each in solutions),
        problem.runs,
        bool(best.success),
    )


def _at_bound(each: Range, value: float, scale: float) -> bool:
    """Whether a search has ended at a bound, which it comes near and never reaches."""
    return bool(min(value - each.low, each.high - value) <= NEAR * scale)


def _covariance(jacobian: Floats) -> Floats:
    """(JᵀJ)⁻¹ by singular values; infinite for parameters that J says nothing about."""
    size = np.sqrt((jacobian**2).sum(axis=0))
    silent = size == 0
    size[silent] = 1
    _, values, vectors = np.linalg.svd(jacobian / size, full_matrices=False)
    weak = values <= values[0] * np.finfo(float).eps * max(jacobian.shape)
    parts = vectors[~weak] / values[~weak, None]
    covariance = np.asarray(parts.T @ parts / np.outer(size, size))
    lost = silent | (np.abs(vectors[weak]) > 1e-6).any(axis=0)
    covariance[lost, lost] = math.inf
    return covariance
