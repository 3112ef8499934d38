"""Rods: two particles whose distance does not change.

    |x₁ − x₂| = L,   hence (x₁ − x₂)·(v₁ − v₂) = 0

The rod pulls or pushes along itself with the force that this needs, f on 1 = λ (x₁ − x₂), f on 2 = −f on 1, and does no work
but on ends that are led. The engine solves for all λ of connected rods at once, after every drift (`shake_rattle`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Gt
from pydantic import Field, model_validator

from particlesim.bonds.base import STORED_BYTES, Ties
from particlesim.bonds.pairs import SINGLE, Pairs, check_pairs, check_points, joined_groups
from particlesim.model.arrays import Ints
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import Path, invalid
from particlesim.model.units import Metres, Vector

LENGTH_TOLERANCE = 1e-4
"""Part of a given length by which particles may be too near or too far at the start."""
SPEED_TOLERANCE = 1e-4
"""Part of the speed of its ends with which a rod may be stretched at the start."""

ROD_BYTES = 500
"""Memory of a rod in a chain: its place in the order of elimination, rows of the matrix, scratch."""


class Rods(Model):
    """Rods between pairs of particles, within one group or from one group to another."""

    name: Name = "rods"
    """Name for messages, styles and the trajectory."""
    on: Name | None = None
    """The group whose particles are joined."""
    between: tuple[Name, Name] | None = None
    """Two groups instead of one: the first index of a pair is in the first, the second in the second."""
    pairs: Pairs | None = Field(default=None, min_length=1)
    """Indices of the joined particles, a pair for every rod; needless between two groups of one particle."""
    points: tuple[Vector[Metres], Vector[Metres]] | None = None
    """Rods at rigid bodies: where both ends are, from the centres of their bodies along the axes that these have before they
    are turned, and for "world", which may be the second of `between`, the place; of a particle [0, 0, 0]. The centres unless
    given. With points, `pairs` are the first of both groups unless given."""
    length: Annotated[Metres, Gt(0)] | None = None
    """Length of every rod; the distance at the start unless given. Particles must be this far apart at the start, to one
    part in ten thousand; what is missing is corrected before the first step."""

    @model_validator(mode="after")
    def _joins(self) -> Rods:
        first, second = self.groups()
        if self.lists_none and first == second:
            raise invalid("which particles are joined?", allowed="pairs = [[0, 1]]")
        check_pairs(self.pairs or (), inside=first == second)
        check_points(self.points, self.groups(), self.pairs)
        return self

    @property
    def lists_none(self) -> bool:
        """Whether nothing says which particles are joined: of groups of one particle they are those."""
        return self.pairs is None and self.points is None

    def groups(self) -> tuple[Name, Name]:
        """Groups of the first and second ends."""
        return joined_groups(self.on, self.between)

    def describe(self) -> str:
        """Rods at rigid bodies in a few words."""
        return f"{len(self.pairs or SINGLE)} at bodies"

    def rods(self, label: str, at: Path) -> RodSet:
        """The rods as the engine takes them; `at` is their place in the scenario."""
        listed = np.array(self.pairs or SINGLE, dtype=np.int64)
        return RodSet(label, self.groups(), self.length, len(listed), partial(_listed, listed), at)


def _listed(pairs: Ints) -> Ints:
    return pairs


@dataclass(frozen=True)
class RodSet(Ties):
    """Rods of one name: the groups of their first and second ends, their length [m] (None: the distance at the start), how
    many (None: only a file knows), how to find the pairs of indices, shape [rods, 2], and where the scenario states them.

    Those of a body (`listed` False) may join two pinned particles, where they do nothing.
    """

    name: str
    groups: tuple[str, str]
    length: float | None
    count: int | None
    find: Callable[[], Ints]
    at: Path
    listed: bool = True

    kind: ClassVar[str] = "rods"
    verb: ClassVar[str] = "joins"
    holds: ClassVar[bool] = True

    def describe(self) -> str:
        number = "rods" if self.count is None else f"{self.count} rods"
        return number if self.length is None else f"{number}, {self.length:g} m"

    def memory(self, number: int, *, mortal: bool) -> int:
        return (self.count or 0) * ROD_BYTES

    def stored(self, *, mortal: bool) -> int:
        return (self.count or 0) * STORED_BYTES
