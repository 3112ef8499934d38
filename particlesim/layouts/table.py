"""Tables of particles, of which a part is read at a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from particlesim.model.arrays import Floats


class Table(Protocol):
    """Particles in a file: names of columns, number of rows, and a part of them."""

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""

    @property
    def number(self) -> int:
        """How many rows there are."""

    def read(self, first: int, count: int) -> dict[str, Floats]:
        """Rows first … first + count − 1 of every column."""
        ...


@dataclass(frozen=True)
class Columns(Table):
    """A table in memory."""

    arrays: dict[str, Floats]

    @property
    def columns(self) -> tuple[str, ...]:
        return tuple(self.arrays)

    @property
    def number(self) -> int:
        return len(next(iter(self.arrays.values())))

    def read(self, first: int, count: int) -> dict[str, Floats]:
        return {name: column[first : first + count] for name, column in self.arrays.items()}
