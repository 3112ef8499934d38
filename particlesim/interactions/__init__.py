"""Interactions between any two particles. To add one, write its file and add its class to `_Own`."""

from typing import Annotated, get_args

from particlesim.extensions.open_union import OpenUnion
from particlesim.interactions.base import PairInteraction, PairSet
from particlesim.interactions.contact import Contact
from particlesim.interactions.coulomb import Coulomb
from particlesim.interactions.flocking import Flocking
from particlesim.interactions.formula import PairFormula
from particlesim.interactions.friction import PairFriction
from particlesim.interactions.gravity import MutualGravity
from particlesim.interactions.lennard_jones import LennardJones
from particlesim.interactions.morse import Morse
from particlesim.interactions.power_law import PairPowerLaw
from particlesim.interactions.soft_sphere import SoftSphere
from particlesim.interactions.yukawa import Yukawa
from particlesim.laws.pair import Pair, pair_force, pair_force_dv, pair_force_dx, pair_potential
from particlesim.model.variants import Tagged

_Own = (
    MutualGravity
    | Coulomb
    | PairPowerLaw
    | LennardJones
    | Morse
    | Yukawa
    | SoftSphere
    | PairFormula
    | PairFriction
    | Flocking
    | Contact
)
INTERACTIONS: tuple[type[PairInteraction], ...] = get_args(_Own)

OPEN_INTERACTIONS = OpenUnion(
    "particlesim.interactions",
    PairInteraction,
    INTERACTIONS,
    texts=("formula", "energy"),
    laws=(pair_force, pair_force_dx, pair_force_dv, pair_potential),
    sample=Pair(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0),
)
"""What installed packages add to `AnyInteraction`."""

AnyInteraction = Annotated[_Own, Tagged("type"), OPEN_INTERACTIONS]

__all__ = ["INTERACTIONS", "OPEN_INTERACTIONS", "AnyInteraction", "PairInteraction", "PairSet"]
