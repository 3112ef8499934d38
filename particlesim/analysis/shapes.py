"""Shapes of what is given to the functions of this package."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from particlesim.errors import UsageError


def per_particle(value: npt.ArrayLike, number: int, name: str) -> npt.NDArray[np.float64]:
    """One value for each of some particles, [number], from one or from as many. Raises UsageError for other shapes."""
    given = np.asarray(value, float)
    if given.shape not in ((), (1,), (number,)):
        raise UsageError(f"{name} has the shape {given.shape}", f"one number, or [{number}], is needed")
    return np.broadcast_to(given, number)
