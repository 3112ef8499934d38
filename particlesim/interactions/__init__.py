"""Interactions between any two particles. To add one, write its file and add a line to `INTERACTIONS`."""

from typing import Annotated

from particlesim.extensions.open_union import OpenUnion
from particlesim.interactions.base import PairInteraction, PairSet
from particlesim.laws.pair import Pair, pair_force, pair_force_dv, pair_force_dx, pair_potential
from particlesim.model.variants import Family, Tagged

INTERACTIONS = Family[PairInteraction](
    "particlesim.interactions",
    gravity="gravity.MutualGravity",
    coulomb="coulomb.Coulomb",
    power_law="power_law.PairPowerLaw",
    lennard_jones="lennard_jones.LennardJones",
    morse="morse.Morse",
    yukawa="yukawa.Yukawa",
    soft_sphere="soft_sphere.SoftSphere",
    formula="formula.PairFormula",
    friction="friction.PairFriction",
    flocking="flocking.Flocking",
    contact="contact.Contact",
)

OPEN_INTERACTIONS = OpenUnion(
    "particlesim.interactions",
    PairInteraction,
    INTERACTIONS,
    texts=("formula", "energy"),
    laws=(pair_force, pair_force_dx, pair_force_dv, pair_potential),
    sample=Pair(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0),
)
"""What installed packages add to `AnyInteraction`."""

AnyInteraction = Annotated[PairInteraction, Tagged("type", INTERACTIONS), OPEN_INTERACTIONS]

__getattr__ = INTERACTIONS.by_name

__all__ = ["INTERACTIONS", "OPEN_INTERACTIONS", "AnyInteraction", "PairInteraction", "PairSet"]
