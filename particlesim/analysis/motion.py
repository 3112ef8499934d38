"""How particles move about: mean square displacement, temperature, pressure."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from particlesim.analysis.shapes import masses
from particlesim.errors import PsimError, UsageError
from particlesim.scenario.load import loads
from particlesim.trajectory.frame import Frame
from particlesim.trajectory.reader import Trajectory

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

BOLTZMANN = 1.380649e-23
"""k_B [J/K], exact in SI."""
FEWEST = 0.5
"""Degrees of freedom below which there are none, but for rounding."""


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


class Held(NamedTuple):
    """What does not move freely: ids of pinned particles [n], and of both ends of rods [k, 2]."""

    pinned: Ints
    rods: Ints


def held(trajectory: Trajectory) -> Held:
    """What the scenario of a trajectory pins, and its rods; nothing where the file has none that can be read."""
    pinned, rods = [np.empty(0, np.int64)], [np.empty((0, 2), np.int64)]
    try:
        scenario = loads(trajectory.scenario)
        if len(trajectory):
            first = trajectory[0]
            for group in scenario.particles:
                if group.has_pins():
                    rows = np.flatnonzero(first.of(group.name))
                    rows = rows[np.argsort(first.id[rows])]
                    chosen = group.pins(first.unwrapped[rows].T.astype(float))
                    pinned.append(first.id[rows][chosen].astype(np.int64))
        for each in scenario.rod_sets:
            found = trajectory.topology.get(each.name)
            if found is not None and found.points is None:  # others are at rigid bodies
                rods.append(found.pairs)
    except PsimError:
        pass
    return Held(np.concatenate(pinned), np.concatenate(rods))


def temperatures(trajectory: Trajectory, *, group: str | None = None) -> Floats:
    """Kinetic temperature T at every frame [K], NaN where there is too little that moves; [frames]. group: only its
    particles.

    f k_B T/2 = Σ ½ m (v − u)² over the particles that are not pinned. Where none is, u is the velocity of their centre of
    mass and f = 3 n − 3; where some are, u = 0 and f = 3 n with n the number of the others. Every rod takes one from f: of a
    particle of mass m with the other end M it takes M/(m + M), so that both together lose one, and all of it beside a pinned
    end. That is the equipartition of what can move (D. Frenkel, B. Smit, Understanding Molecular Simulation, 2nd ed.,
    section 4.1). Pins and rods are those of the scenario in the file; what sticks to a collider counts as free.

    Raises UsageError for an unknown group, and where velocities or masses are not recorded.
    """
    for field in ("velocity", "mass"):
        if field not in trajectory.fields:
            raise UsageError(
                f"{trajectory.path} has no {field}, which a kinetic temperature needs",
                f'record it: [output] fields = ["velocity", "mass"]; it has {", ".join(trajectory.fields)}',
            )
    found, known = np.full(len(trajectory), np.nan), held(trajectory)
    for number, frame in enumerate(trajectory):
        chosen = np.ones(len(frame), bool) if group is None else frame.of(group)
        free = chosen & ~np.isin(frame.id, known.pinned)
        v, m = frame.velocity[free].astype(float), frame["mass"][free].astype(float)
        about_centre = bool((free == chosen).all())
        if len(v) < 1 + about_centre:
            continue
        freedoms = 3 * len(v) - 3 * about_centre - _lost(known, frame, free)
        if freedoms > FEWEST:
            drift = np.average(v, axis=0, weights=m) if about_centre else 0.0
            found[number] = (m[:, None] * (v - drift) ** 2).sum() / (freedoms * BOLTZMANN)
    return found


def _lost(known: Held, frame: Frame, free: npt.NDArray[np.bool_]) -> float:
    """How many degrees of freedom rods take from the particles that are `free` [rows]."""
    if not len(known.rods) or not len(frame):
        return 0.0
    order = np.argsort(frame.id, kind="stable")
    ids = frame.id[order]
    place = np.minimum(np.searchsorted(ids, known.rods), len(ids) - 1)
    there = (ids[place] == known.rods).all(axis=1)
    ends = order[place[there]]
    inverse = 1 / frame["mass"].astype(float)
    inverse[np.isin(frame.id, known.pinned)] = 0
    w = inverse[ends]
    moves = w.sum(axis=1) > 0
    w, ends = w[moves], ends[moves]
    return float((w * free[ends] / w.sum(axis=1, keepdims=True)).sum())


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
