"""How particles move about: mean square displacement, temperature, pressure."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from particlesim.analysis.shapes import masses
from particlesim.errors import UsageError
from particlesim.trajectory.reader import Trajectory

Floats = npt.NDArray[np.float64]

BOLTZMANN = 1.380649e-23
"""k_B [J/K], exact in SI."""


def mean_square_displacement(trajectory: Trajectory, *, group: str | None = None) -> Floats:
    """⟨|x(t) − x(t₀)|²⟩ [m²] at every frame, over the particles of the first frame that still live; [frames].

    group: only its particles. In a fluid at rest it grows as 6 D t with D the coefficient of diffusion (A. Einstein, 1905).
    Positions in periodic boxes are those along the path, not the wrapped ones. Raises UsageError for an unknown group or
    a file without frames.
    """
    if not len(trajectory):
        raise UsageError(f"{trajectory.path} has no frames yet")
    first = trajectory[0]
    chosen = np.ones(len(first), bool) if group is None else first.of(group)
    ids, start = first.id[chosen], first.unwrapped[chosen].astype(float)
    order = np.argsort(ids, kind="stable")
    ids, start = ids[order], start[order]
    found = np.full(len(trajectory), np.nan)
    for number, frame in enumerate(trajectory):
        place = np.minimum(np.searchsorted(ids, frame.id), max(len(ids) - 1, 0))
        known = ids[place] == frame.id if len(ids) else np.zeros(len(frame), bool)
        if known.any():
            moved = frame.unwrapped[known].astype(float) - start[place[known]]
            found[number] = (moved**2).sum(axis=1).mean()
    return found


def temperatures(trajectory: Trajectory, *, group: str | None = None) -> Floats:
    """`temperature` at every frame [K], NaN where fewer than two particles live; [frames]. group: only its particles.

    Raises UsageError for an unknown group, and where velocities or masses are not recorded.
    """
    for field in ("velocity", "mass"):
        if field not in trajectory.fields:
            raise UsageError(
                f"{trajectory.path} has no {field}, which a kinetic temperature needs",
                f'record it: [output] fields = ["velocity", "mass"]; it has {", ".join(trajectory.fields)}',
            )
    found = np.full(len(trajectory), np.nan)
    for number, frame in enumerate(trajectory):
        rows = slice(None) if group is None else frame.of(group)
        v = frame.velocity[rows]
        if len(v) > 1:
            found[number] = temperature(v, frame["mass"][rows])
    return found


def temperature(velocity: npt.ArrayLike, mass: npt.ArrayLike | float) -> float:
    """Temperature of a set of particles [K] from the energy of their motion about their centre of mass.

    velocity: [n, 3] in m/s; mass: [n] or one number, in kg. (3 n − 3) k_B T/2 = Σ ½ m (v − v̄)². Raises UsageError for fewer
    than two particles, and for shapes or masses that do not fit.
    """
    v = np.asarray(velocity, float)
    if v.ndim != 2 or v.shape[1] != 3 or len(v) < 2:
        raise UsageError(
            f"velocities have the shape {v.shape}", "[n, 3] with two particles or more is needed"
        )
    m = masses(mass, len(v))
    drift = np.average(v, axis=0, weights=m)
    return float((m[:, None] * (v - drift) ** 2).sum() / ((3 * len(v) - 3) * BOLTZMANN))
