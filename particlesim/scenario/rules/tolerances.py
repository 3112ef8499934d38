"""How integrators must agree with the rest of a scenario."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from particlesim.integrators import (
    AnyIntegrator,
    EmbeddedRungeKutta,
    GaussRadauMethod,
    Options,
    method_for,
    without_inertia,
)
from particlesim.model.mistakes import Invalid, Path
from particlesim.scenario.reach import group_tables, interacting
from particlesim.scenario.tables import Tables

EPSILON = {"double": sys.float_info.epsilon, "single": 2.0**-23}
FINEST = 64
"""Smallest tolerance in units of the rounding error: below, the error of a step is that of its sums."""


def too_fine(scenario: Tables) -> Iterator[Invalid]:
    """Tolerances that the numbers of the state cannot hold."""
    precision = scenario.simulation.precision
    least = FINEST * EPSILON[precision]
    places = {(path, method_for(integrator)): integrator for path, integrator in _places(scenario)}
    for path, group in group_tables(scenario):
        if group.dynamics.type != "second_order":
            here, integrator = (*path, "integrator"), group.integrator
            if integrator is None:
                here, integrator = ("simulation", "integrator"), scenario.simulation.integrator
            places[here, without_inertia(integrator)] = integrator
    for (path, method), integrator in places.items():
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


def without_jumps(scenario: Tables) -> Iterator[Invalid]:
    """Forces of a tree or a mesh jump by a part of their accuracy, and IAS15 finds no step across a jump."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    for k, each in enumerate(scenario.interactions):
        boxed = scenario.simulation.box is not None and each.lacks_a_mesh() is None
        way = "mesh" if each.method == "auto" and boxed else each.method
        if way not in ("tree", "mesh"):
            continue
        for group in interacting(each, scenario.groups):
            method = method_for(group.integrator or scenario.simulation.integrator)
            if method.smooth:
                here: Path = ("interactions", k)
                yield Invalid(
                    f"forces by a {way} jump by a part of their accuracy, and {method.name} computes to rounding: it finds "
                    "no step across them",
                    (*here, "method") if each.method == way else here,
                    ((tables[group.name][0], f"stepped by {method.name}"),),
                    allowed='"auto", "direct"' if way == "tree" else "velocity_verlet, dop853 and others",
                    hint=None if way == "tree" else "all images of a periodic box have no other sum",
                )
                break


def _places(scenario: Tables) -> Iterator[tuple[Path, AnyIntegrator]]:
    """Where integrators are named, and what stands there."""
    yield ("simulation", "integrator"), scenario.simulation.integrator
    for name, groups in (("particles", scenario.particles), ("emitters", scenario.emitters)):
        for k, group in enumerate(groups):
            if group.integrator is not None:
                yield (name, k, "integrator"), group.integrator
