"""Interactions between any two particles. To add one, write its file and add its class to `INTERACTIONS` and
`AnyInteraction`."""

from typing import Annotated

from particlesim.interactions.base import PairInteraction, PairSet
from particlesim.interactions.coulomb import Coulomb
from particlesim.interactions.gravity import MutualGravity
from particlesim.model.variants import Tagged

INTERACTIONS: tuple[type[PairInteraction], ...] = (MutualGravity, Coulomb)

AnyInteraction = Annotated[MutualGravity | Coulomb, Tagged("type")]

__all__ = ["INTERACTIONS", "AnyInteraction", "PairInteraction", "PairSet"]
