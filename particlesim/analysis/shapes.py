"""What is given to the functions of this package for each particle: shapes, and masses that mean something."""

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


def masses(value: npt.ArrayLike, number: int) -> npt.NDArray[np.float64]:
    """Masses of some particles [kg], [number], of which some are above 0. Raises UsageError for others, and other shapes."""
    given = per_particle(value, number, "mass")
    if not ((given >= 0).all() and given.sum() > 0):
        raise UsageError("masses are not all 0, and none is below", "numbers ≥ 0 in kg")
    return given
