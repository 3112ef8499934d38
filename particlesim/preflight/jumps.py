"""Forces that jump, or are less exact than a method which chooses its steps by errors takes them for: told before a run.

A force that jumps by δ a adds h δ a to the velocity in a step h whatever the order of the method, so that an error which is
allowed below it makes steps shrink in proportion: h ≲ tolerance |v|/(δ a).
"""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.engine.interactions.methods import chosen_in
from particlesim.graph.graph import methods_of
from particlesim.integrators import EmbeddedRungeKutta, Method
from particlesim.interactions import PairInteraction, PairSet
from particlesim.interactions.far import LEAST_ACCURACY, FarInteraction
from particlesim.preflight.advice import number_of
from particlesim.scenario.reach import pair_sets
from particlesim.scenario.scenario import Scenario

CARRIED = 1e-3
"""Least tolerance over the accuracy of forces by a tree or a mesh. Steps of dop853 are some ten times as short there as with
direct sums, those of rk45 three times."""


def jumps(scenario: Scenario) -> tuple[str, ...]:
    """A sentence for each interaction whose forces jump by more than its method can take."""
    methods, tables = methods_of(scenario), {group.name: group for group in scenario.groups}
    found: list[str] = []
    for each in pair_sets(scenario):
        method = methods[each.groups[0]]
        if method.smooth:
            found += _at_distances(each, method)
        elif isinstance(method, EmbeddedRungeKutta):
            count = round(sum(number_of(tables[name], scenario) for name in each.groups))
            found += _by_accuracy(each, method, chosen_in(scenario, each, count))
    return tuple(found)


def _at_distances(each: PairSet, method: Method) -> Iterator[str]:
    """Where the law makes forces jump, or begin at once."""
    if (where := _edge(each.law)) is not None:
        yield (
            f"{each.name}: {where}, and {method.name} computes to rounding: it takes a step to every such place, and ends "
            "where it finds none that is short enough; dop853 or a method with steps of one length takes such forces"
        )


def _edge(law: PairInteraction) -> str | None:
    """Where a force jumps or begins, in words; None where it is smooth."""
    if (jump := law.jump()) is not None:
        return f"its {jump.of} jumps at r = {jump.at:.4g} m"
    if law.touching() or law.soft:
        return "its force begins where two particles touch"
    reach = law.reach()
    if reach is None or law.ends_smoothly():
        return None
    if law.cutoff == reach:
        return f'its force jumps at the cutoff of {reach:g} m, where shift = "force" would let it end at 0'
    return f"its force begins at r = {reach:g} m"


def _by_accuracy(each: PairSet, method: EmbeddedRungeKutta, way: str) -> Iterator[str]:
    """An accuracy of forces that the tolerance of a method is far below."""
    law = each.law
    if way not in ("tree", "mesh") or not isinstance(law, FarInteraction):
        return
    if method.tolerance < 0.99 * CARRIED * law.accuracy:
        finer = max(method.tolerance / CARRIED, LEAST_ACCURACY)
        yield (
            f"{each.name} is summed by a {way} with an accuracy of {law.accuracy:g}, and its forces jump by a part of that; "
            f"{method.name} with a tolerance of {method.tolerance:g} takes this for an error of its steps, and makes them "
            f"many times shorter: a tolerance of {CARRIED * law.accuracy:.1g} or more, or accuracy = {finer:.1g}"
            + (', or method = "direct"' if way == "tree" else "")
            + " fits"
        )
