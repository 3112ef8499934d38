"""Energy and forces of particles with all of their images in a periodic box, by Ewald's sum: exact, for few particles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from particlesim.engine.interactions.mesh.ewald import ewald_field
from particlesim.engine.interactions.mesh.ewald import ewald_sum as prepared
from particlesim.engine.interactions.mesh.split import ByCharge
from particlesim.errors import UsageError
from particlesim.interactions.coulomb import CoulombRecord
from particlesim.process.threads import Team
from particlesim.trajectory.box import in_period

Floats = npt.NDArray[np.float64]

LEAST_ERROR, MOST_ERROR = 1e-14, 1e-2


@dataclass(frozen=True)
class Ewald:
    """The energy U = ½ Σ wᵢ φᵢ [J]; the potential φ at every particle, of all others and of all images [n]; and the force on
    every particle [N], shape [n, 3]."""

    energy: float
    potential: Floats
    force: Floats


def ewald_sum(
    position: npt.ArrayLike,
    weight: npt.ArrayLike,
    *,
    box: Sequence[float],
    constant: float,
    softening: float = 0.0,
    error: float = 1e-12,
    threads: int | None = None,
) -> Ewald:
    """The sum over all pairs and images of U = constant · w₁ w₂/√(r² + ε²), in a box that repeats along all axes.

    position: [n, 3] in m; weight: [n], charges in C with Coulomb's constant k [N m²/C²], or masses in kg with −G
    [m³/(kg s²)]; `box`: three lengths in m; `softening`: ε in m; `error`: about that of forces, over those of near ones.
    Where the weights do not sum up to zero, a uniform background takes their mean away, so that the mean of the potential
    is zero. The time grows as n², about a second for 10⁴ particles.

    Raises UsageError for shapes that do not fit, a box that is not periodic along all axes, two particles in one place
    without softening, and an error outside of 1e-14 to 1e-2.
    Source: P. P. Ewald, Ann. Phys. 369, 253 (1921).
    """
    x, w, size = np.asarray(position, float), np.asarray(weight, float), np.asarray(box, float)
    if x.ndim != 2 or x.shape[1] != 3 or w.shape != (len(x),):
        raise UsageError(
            f"positions have the shape {x.shape} and weights {w.shape}", "[n, 3] and [n] are needed"
        )
    if size.shape != (3,) or not (np.isfinite(size).all() and (size > 0).all()):
        raise UsageError("Ewald's sum needs a box that is periodic along all axes", "box = three sizes in m")
    if not LEAST_ERROR <= error <= MOST_ERROR:
        raise UsageError(f"an error of {error:g} is not possible", f"{LEAST_ERROR:g} to {MOST_ERROR:g}")
    if softening < 0 or not (np.isfinite(x).all() and np.isfinite(w).all() and math.isfinite(softening)):
        raise UsageError("positions, weights and a softening are finite, and the last is not negative")
    if softening == 0 and len(np.unique(in_period(x, size), axis=0)) < len(x):
        raise UsageError("two particles are at the same place, where the force between them has no value")
    law = CoulombRecord(1.0, softening * softening)
    given = prepared(law, ByCharge(), -1.0, size.tolist(), softening, error, everywhere=softening > 0)
    with Team(threads) as team:
        field = ewald_field(np.ascontiguousarray(x.T), w, np.arange(len(x)), given, team)
    potential = constant * field.height
    return Ewald(0.5 * float(w @ potential), potential, -constant * (w * field.gradient).T)
