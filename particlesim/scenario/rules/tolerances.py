"""How integrators must agree with the rest of a scenario."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from particlesim.integrators import AnyIntegrator, EmbeddedRungeKutta, GaussRadauMethod, Options, method_for
from particlesim.model.mistakes import Invalid, Path
from particlesim.scenario.tables import Tables

EPSILON = {"double": sys.float_info.epsilon, "single": 2.0**-23}
FINEST = 64
"""Smallest tolerance in units of the rounding error: below, the error of a step is that of its sums."""


def too_fine(scenario: Tables) -> Iterator[Invalid]:
    """Tolerances that the numbers of the state cannot hold."""
    precision = scenario.simulation.precision
    least = FINEST * EPSILON[precision]
    for path, integrator in _places(scenario):
        method = method_for(integrator)
        if isinstance(method, EmbeddedRungeKutta) and method.tolerance < least:
            written = isinstance(integrator, Options) and "tolerance" in integrator.model_fields_set
            yield Invalid(
                f"{precision} precision cannot hold a tolerance of {method.tolerance:g}",
                (*path, "tolerance") if written else path,
                allowed=f"a tolerance of {least:.2g} or more",
                hint='precision = "double" holds 1.4e-14' if precision == "single" else None,
            )


def few_bodies(scenario: Tables) -> Iterator[Invalid]:
    """What IAS15 is not made for: numbers that round more than it errs, and the ledger's work."""
    for path, integrator in _places(scenario):
        if not isinstance(method_for(integrator), GaussRadauMethod):
            continue
        if scenario.simulation.precision == "single":
            yield Invalid(
                "ias15 computes to the rounding of double precision",
                ("simulation", "precision"),
                ((path, "chosen here"),),
                allowed="double",
                hint='"rk45" and "dop853" work in single precision',
            )
        if scenario.output.work:
            yield Invalid(
                "the work along steps of ias15 cannot be recorded",
                ("output", "work"),
                ((path, "chosen here"),),
                hint='"dop853" has small errors, too, and its work can be recorded',
            )


def _places(scenario: Tables) -> Iterator[tuple[Path, AnyIntegrator]]:
    """Where integrators are named, and what stands there."""
    yield ("simulation", "integrator"), scenario.simulation.integrator
    for name, groups in (("particles", scenario.particles), ("emitters", scenario.emitters)):
        for k, group in enumerate(groups):
            if group.integrator is not None:
                yield (name, k, "integrator"), group.integrator
