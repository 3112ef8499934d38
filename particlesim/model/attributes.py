"""Attributes, of which every particle has one number: mass, radius, temperature, charge.

This table is all that most of psim knows of them: the columns of the engine, blocks, checkpoints, births and deaths, files
of particles, fields of the trajectory, checks and the ledger follow from it. docs/architecture.md says how to add one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, get_args

from particlesim.model.units import Coulombs, Kelvin, Kilograms, Metres, Unit


@dataclass(frozen=True)
class Attribute:
    """A quantity of single particles that a scenario or a file gives.

    `name` in scenarios, files and trajectories, `symbol` in laws and expressions, `measure` the annotated type of its unit.
    A value is at least `least`, and more than that if `above`.
    """

    name: str
    symbol: str
    measure: Any
    doc: str
    least: float = -math.inf
    above: bool = False
    recorded: bool = True
    """Whether it is in the trajectory, where particles have it and `output.fields` does not say otherwise."""
    total: bool = False
    """Whether its sum over all particles is a column of the ledger."""

    @property
    def unit(self) -> str:
        """Symbol of its SI unit."""
        return next(mark.symbol for mark in get_args(self.measure) if isinstance(mark, Unit))

    @property
    def rule(self) -> str:
        """What its values must be, for messages; empty where all numbers will do."""
        if math.isinf(self.least):
            return ""
        return f"greater than {self.least:g}" if self.above else f"{self.least:g} or more"

    def allows(self, value: Any) -> Any:
        """Whether a number, or each of an array, is one that it can have."""
        return (value > self.least) if self.above else (value >= self.least)


ATTRIBUTES: dict[str, Attribute] = {
    each.name: each
    for each in (
        Attribute("mass", "m", Kilograms, "Its mass.", 0.0, above=True, recorded=False),
        Attribute("radius", "r", Metres, "Its radius.", 0.0),
        Attribute("temperature", "T", Kelvin, "Its temperature.", 0.0),
        Attribute("charge", "q", Coulombs, "Its electric charge.", total=True),
    )
}

FURTHER: tuple[Attribute, ...] = tuple(
    each for each in ATTRIBUTES.values() if each.name not in ("mass", "radius", "temperature")
)
"""Attributes that are constant numbers and nothing else: of mass, radius and temperature the engine knows more."""

OPTIONAL = frozenset(name for name in ATTRIBUTES if name not in ("mass", "radius"))
"""Attributes that a group does not have unless they are given: every particle has a mass, and a radius, be it 0."""
