"""What contact of particles with rigid bodies does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from particlesim.colliders.response import STEADY
from particlesim.model.arrays import Floats
from particlesim.scenario.reach import meetings_of
from particlesim.scenario.scenario import Scenario


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


def contacts_of(scenario: Scenario, bodies: Sequence[str]) -> dict[str, Touching]:
    """What contact with these groups of bodies does, by the names of the groups of particles that touch some."""
    flat = {body.name: float(body.shape.all_flat()) for body in scenario.bodies}
    found: dict[str, Touching] = {}
    for each in meetings_of(scenario):
        mine = found.setdefault(each.particles, no_contact(len(bodies)))
        falls, rolls = each.falling or STEADY, (each.rolling, flat[each.bodies])
        law = (1.0, each.restitution, *each.friction, *falls, *rolls)
        for column, value in zip(mine, law, strict=True):
            column[bodies.index(each.bodies)] = value
    return found


def no_contact(*others: int) -> Touching:
    """That of particles which touch none of so many groups."""
    return Touching(*np.zeros((len(Touching._fields), *others)))
