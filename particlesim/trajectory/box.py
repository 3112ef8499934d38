"""A periodic box: positions wrapped into it, and how often particles have crossed its faces."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]
Vector = tuple[float, float, float]


def in_period(x: ArrayLike, period: ArrayLike) -> NDArray[np.float64]:
    """Coordinates x [m] in [0, period), of any shapes that broadcast; unchanged where the period is 0 or infinite.

    `np.mod` alone rounds what is just below 0 up to the period itself, which is one place too many: it is 0 here.
    What is not finite becomes NaN in a period.
    """
    x, length = np.asarray(x, float), np.asarray(period, float)
    repeats = np.isfinite(length) & (length > 0)
    divisor = np.where(repeats, length, 1.0)
    with np.errstate(invalid="ignore"):
        rest = np.mod(x, divisor)
    return np.where(repeats, np.where(rest >= divisor, 0.0, rest), x)


class Box(NamedTuple):
    """A box from `origin` to origin + `size` [m], which repeats along those axes that are `periodic`."""

    origin: Vector
    size: Vector
    periodic: tuple[bool, bool, bool]

    @property
    def periods(self) -> tuple[float | None, float | None, float | None]:
        """The size along every axis [m], None along those that are not periodic."""
        x, y, z = (size if there else None for size, there in zip(self.size, self.periodic, strict=True))
        return x, y, z

    @property
    def steps(self) -> NDArray[np.float64]:
        """How far an image is away along every axis [m], 0 along those that are not periodic, [3]."""
        return np.array([each or 0.0 for each in self.periods])

    @property
    def volume(self) -> float | None:
        """Volume [m³]; None unless all axes are periodic."""
        return float(np.prod(self.size)) if all(self.periodic) else None

    def images(self, path: Array) -> NDArray[np.int32]:
        """In which image of the box places along a path are, [n, 3]: 0 in the box itself; what is not finite is in none."""
        with np.errstate(invalid="ignore", over="ignore"):
            found = np.floor((path.astype(float) - self.origin) / self.size)
        most = np.iinfo(np.int32).max
        found = np.clip(np.where(np.isfinite(found) & self.periodic, found, 0), -most, most)
        return found.astype(np.int32)

    def wrapped(self, path: Array) -> NDArray[np.float64]:
        """The places in the box at which those of a path are, [n, 3] in m; unchanged along axes that are not periodic."""
        with np.errstate(invalid="ignore", over="ignore"):
            return np.asarray(path.astype(float) - self.images(path) * self.steps)

    def unwrapped(self, position: Array, image: Array) -> NDArray[np.float64]:
        """The places along the path [m], [n, 3], from those in the box and their images."""
        return np.asarray(position.astype(float) + image * self.steps)
