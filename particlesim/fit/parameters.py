"""What is varied: numbers of a scenario, by their addresses, between bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from annotated_types import Ge, Gt, Le, Lt

from particlesim.errors import ScenarioError, UsageError
from particlesim.model.spelling import did_you_mean
from particlesim.scenario.dump import to_table
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text import typewalk
from particlesim.scenario.text.overrides import resolve_path
from particlesim.scenario.text.typewalk import Node


@dataclass(frozen=True)
class Range:
    """A number of the scenario and its bounds."""

    key: str
    low: float = -math.inf
    high: float = math.inf

    @property
    def bounded(self) -> bool:
        """Whether both bounds are finite."""
        return math.isfinite(self.low) and math.isfinite(self.high)


def parse_range(argument: str) -> Range:
    """`KEY` or `KEY=LOW,HIGH` of the command line; an empty side has no bound. Raises UsageError."""
    key, equals, text = (part.strip() for part in argument.partition("="))
    example = "For example: --vary forces.air.coefficient=0,2"
    if not key:
        raise UsageError(f"--vary {argument!r} names nothing to vary", example)
    if not equals:
        return Range(key)
    parts = [part.strip() for part in text.split(",")]
    try:
        low, high = (
            float(part) if part else sign for part, sign in zip(parts, (-math.inf, math.inf), strict=True)
        )
    except ValueError:
        raise UsageError(f"--vary {argument!r} does not give two bounds", example) from None
    if not low < high:
        raise UsageError(f"--vary {argument!r}: the lower bound is not below the upper one", example)
    return Range(key, low, high)


def value_of(scenario: Scenario, key: str) -> float:
    """The number at an address of a scenario, defaults included.

    Raises UsageError when there is none, or something else than a number.
    """
    return _found(scenario, key)[0]


def within_limits(each: Range, scenario: Scenario) -> Range:
    """The range without what the scenario's model does not allow; of a bound that is excluded, a hair stays clear.

    Raises UsageError as `value_of`, and when nothing is left of it.
    """
    value, kind = _found(scenario, each.key)
    low, high = each.low, each.high
    hair = 1e-12 * (abs(value) or 1.0)
    for mark in () if kind is None else kind.metadata:
        limits: Any = mark
        if isinstance(mark, Ge):
            low = max(low, limits.ge)
        elif isinstance(mark, Gt):
            low = max(low, limits.gt + hair)
        elif isinstance(mark, Le):
            high = min(high, limits.le)
        elif isinstance(mark, Lt):
            high = min(high, limits.lt - hair)
    if not low < high:
        raise UsageError(
            f"{each.key} cannot lie between {each.low:g} and {each.high:g}", "Give other bounds."
        )
    return replace(each, low=low, high=high)


def _found(scenario: Scenario, key: str) -> tuple[float, Node | None]:
    """The number at an address, and its type, None where the models do not say."""
    table = to_table(scenario, defaults=True)
    try:
        path = resolve_path(table, key)
    except ScenarioError as error:
        raise UsageError(error.message, error.hint) from None
    here: Any = table
    kind: Node | None = typewalk.node(Scenario)
    for step in path:
        if isinstance(here, dict) and step not in here:
            near = did_you_mean(str(step), here)
            raise UsageError(f"the scenario has no number {key!r}", near or f"There are: {', '.join(here)}")
        kind = None if kind is None else typewalk.child(kind, step, here)
        try:
            here = here[step]
        except (IndexError, TypeError):
            raise UsageError(f"the scenario has no number {key!r}") from None
    if isinstance(here, bool) or not isinstance(here, int | float):
        what = {dict: "a table", list: "a list", str: "text", bool: "yes or no"}.get(type(here), "no number")
        hint = f"One number of it: {key}.0" if isinstance(here, list) else None
        raise UsageError(f"{key} is {what}; only numbers can be fitted", hint)
    if kind is not None and kind.is_union:
        kind = typewalk.choose(kind, here)
    return float(here), kind
