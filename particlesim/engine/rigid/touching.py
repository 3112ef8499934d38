"""What contact of particles with rigid bodies does."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from particlesim.model.arrays import Floats


class Touching(NamedTuple):
    """The contact of a group of particles, by group of bodies [groups]: whether they touch, restitution, static and kinetic
    friction; the speed of impacts above which restitution falls [m/s], and how fast; rolling friction, and 1 where all
    sides are flat."""

    touch: Floats
    restitution: Floats
    static: Floats
    kinetic: Floats
    speed: Floats
    exponent: Floats
    rolling: Floats
    flat: Floats


def no_contact(bodies: int) -> Touching:
    """That of particles which touch none of so many groups of bodies."""
    return Touching(*np.zeros((len(Touching._fields), bodies)))
