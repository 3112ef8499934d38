"""Interactions between any two particles. To add one, write its file and add its class to `INTERACTIONS` and
`AnyInteraction`."""

from typing import Annotated

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
from particlesim.model.variants import Tagged

INTERACTIONS: tuple[type[PairInteraction], ...] = (
    MutualGravity,
    Coulomb,
    PairPowerLaw,
    LennardJones,
    Morse,
    Yukawa,
    SoftSphere,
    PairFormula,
    PairFriction,
    Flocking,
    Contact,
)

AnyInteraction = Annotated[
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
    | Contact,
    Tagged("type"),
]

__all__ = ["INTERACTIONS", "AnyInteraction", "PairInteraction", "PairSet"]
