"""What a layout is: where particles are at the start, and how fast."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import StringConstraints

from particlesim.errors import UsageError
from particlesim.model.arrays import Floats
from particlesim.model.base import Model
from particlesim.sampling.random_streams import Streams

Line = Annotated[str, StringConstraints(pattern=r"^(row|column) -?[0-9]{1,9}$")]
"""A row or a column of a layout that is a grid; negative numbers count from the end."""

CHUNK = 1 << 16
"""Particles sampled at once, so that millions need little memory other than their own."""


class Placed(NamedTuple):
    """What a layout gives for some particles: position [m] and velocity [m/s], shape [3, n].

    `attributes` are those that the layout knows (a file may), by name, in SI units, shape [n].
    """

    position: Floats
    velocity: Floats
    attributes: Mapping[str, Floats] = MappingProxyType({})


class LayoutError(UsageError):
    """A mistake in one key of a layout that only reading its file shows."""

    def __init__(self, message: str, hint: str | None = None, *, key: str = "path") -> None:
        super().__init__(message, hint)
        self.key = key


class Layout(Model):
    """Initial particles of a group."""

    is_body: ClassVar[bool] = False
    """Whether its particles are one body, whose mass the group states."""
    kinds: ClassVar[tuple[str, ...]] = ()
    """Kinds of springs that it can bring, angles and dihedrals among them."""

    can_be_rigid: ClassVar[bool] = False
    """Whether its neighbours may be joined by rods and it can still bend."""

    folds: ClassVar[float] = 1.0
    """How much higher the frequencies of its springs may be, crumpled, than at the start, at most, as a factor."""

    type: str

    def open(self, folder: Path | None) -> Layout:
        """The layout ready to be sampled; one that names a file (relative to `folder`) reads it here."""
        return self

    def number(self) -> int | None:
        """How many particles, None if only the file knows."""
        raise NotImplementedError

    def attributes(self) -> frozenset[str]:
        """Attributes of particles that it gives (a file may, once it is open), such as "mass"."""
        return frozenset()

    def edges(self, kind: str) -> NDArray[np.int64]:
        """Pairs of particles joined by the springs of a kind, shape [springs, 2]."""
        raise NotImplementedError(f"{self!r} has no springs")

    def triangles(self) -> NDArray[np.int64]:
        """Corners of the triangles of its surface, counter-clockwise seen from the side of the normal, shape [n, 3]."""
        return np.empty((0, 3), np.int64)

    def hinges(self, kind: str) -> NDArray[np.int64]:
        """Particles of its angles, shape [n, 3], or dihedrals, shape [n, 4]."""
        raise NotImplementedError(f"{self!r} has no hinges")

    @classmethod
    def has_surface(cls) -> bool:
        """Whether layouts of this type can have triangles."""
        return cls.triangles is not Layout.triangles

    def places(self) -> dict[str, NDArray[np.int64]]:
        """Parts that have a name, such as "left": indices of their particles."""
        return {}

    def part(self, name: str) -> NDArray[np.int64] | None:
        """Indices of the particles of a part that has a name; None where it has no such part."""
        return self.places().get(name)

    def part_names(self) -> tuple[str, ...]:
        """Its parts, for messages."""
        return tuple(self.places())

    def balanced_constant(self) -> float | None:
        """The constant of gravitation that its speeds are in balance with; None where they balance nothing."""
        return None

    def pins(self) -> NDArray[np.int64]:
        """Indices of the particles that the layout pins, sorted."""
        return np.empty(0, np.int64)

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        """Particles first … first + count − 1."""
        raise NotImplementedError
