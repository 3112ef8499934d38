"""What a set of springs is, wherever it comes from: which particles it joins, and by what law."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from particlesim.model.arrays import Floats, Ints

SPRING_BYTES = 32
"""Memory of a spring: both ends, rest length, and a share of what it takes to find runs of them."""
ROSTER_BYTES = 40
"""What is kept of a spring in addition where its ends may die: its number, ids of its ends, rest length, time of its end."""
STORED_BYTES = 10
"""A spring or a rod in a trajectory: both ends and rest length, compressed, and its share of a surface."""


class Ties:
    """What joins or couples particles of some groups, as a scenario calls for it: a set of springs, of rods, of angles, of
    triangles that feel a force, or of pairs. Groups that it names step together."""

    name: str
    """Its name in the ledger and in messages."""
    groups: tuple[str, ...]
    """The groups whose particles it joins."""

    kind: ClassVar[str] = ""
    """What the graph calls it."""
    verb: ClassVar[str] = ""
    """What it does to groups."""
    holds: ClassVar[bool] = False
    """Whether it keeps particles together that would else fly apart."""

    @property
    def feeds(self) -> bool:
        """Whether it may bring energy from outside."""
        return False

    def describe(self) -> str:
        """The set in a few words."""
        return ""

    def needs_velocity(self) -> bool:
        """Whether its forces depend on velocities."""
        return False

    def memory(self, number: int, *, mortal: bool) -> int:
        """Bytes of what is known before particles have places, with so many bytes in a number; `mortal` where ends may
        die."""
        return 0

    def stored(self, *, mortal: bool) -> int:
        """Bytes in a trajectory."""
        return 0


@dataclass(frozen=True)
class SpringLaw:
    """Constants that the springs of a set share.

    Stiffness k [N/m] or frequency f [Hz], damping c [kg/s] or damping ratio ζ, rest length [m] (None: the distance at the
    start), and when a spring breaks: beyond a strain (l − L₀)/L₀, or a pull [N].
    """

    stiffness: float | None = None
    frequency: float | None = None
    damping: float = 0.0
    damping_ratio: float | None = None
    rest_length: float | None = None
    tension_only: bool = False
    break_strain: float | None = None
    break_force: float | None = None
    compression_only: bool = False

    @property
    def breaks(self) -> bool:
        """Whether its springs can break."""
        return self.break_strain is not None or self.break_force is not None

    @property
    def damped(self) -> bool:
        """Whether its springs feel velocities."""
        return self.damping > 0 or bool(self.damping_ratio)

    @property
    def by_mass(self) -> bool:
        """Whether the constants of a spring follow from the masses that it joins."""
        return self.frequency is not None or self.damping_ratio is not None

    def constants(self, reduced_mass: Floats) -> tuple[Floats, Floats]:
        """Stiffness k = μ (2πf)² and damping c = 2ζ √(kμ) of springs with reduced masses μ [kg], shape [n].

        A spring between two pinned particles moves nothing; μ is 0 for it.
        """
        k = np.full(len(reduced_mass), self.stiffness or 0.0)
        if self.frequency is not None:
            k = reduced_mass * (2 * math.pi * self.frequency) ** 2
        if self.damping_ratio is not None:
            return k, 2 * self.damping_ratio * np.sqrt(k * reduced_mass)
        return k, np.full(len(reduced_mass), self.damping)

    def describe(self) -> str:
        """Its constants in a few words."""
        if self.frequency is not None:
            return f"f = {self.frequency:g} Hz"
        return f"k = {self.stiffness:g} N/m"


@dataclass(frozen=True)
class BondSet(Ties):
    """Springs of one law: a name for the ledger, the groups of their first and second ends, how many (None: only the
    positions tell), and how to find them: positions [3, n] of both groups → pairs of indices, shape [springs, 2]."""

    name: str
    groups: tuple[str, str]
    law: SpringLaw
    count: int | None
    find: Callable[[Floats, Floats], Ints]

    kind: ClassVar[str] = "springs"
    verb: ClassVar[str] = "joins"
    holds: ClassVar[bool] = True

    def describe(self) -> str:
        number = "springs" if self.count is None else f"{self.count} springs"
        return f"{number}, {self.law.describe()}"

    def needs_velocity(self) -> bool:
        return self.law.damped

    def memory(self, number: int, *, mortal: bool) -> int:
        of_each = 2 * number * (self.law.by_mass or self.law.breaks or mortal) + self.law.breaks
        return (self.count or 0) * (SPRING_BYTES + of_each + ROSTER_BYTES * mortal)

    def stored(self, *, mortal: bool) -> int:
        return (self.count or 0) * (STORED_BYTES + 8 * (self.law.breaks or mortal))
