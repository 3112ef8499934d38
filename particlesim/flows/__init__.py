"""Velocity fields of fluids. To add one, write its file and add it to `AnyFlow`."""

from typing import Annotated

from particlesim.flows.base import Flow
from particlesim.flows.uniform import Uniform
from particlesim.flows.vortex import Vortex
from particlesim.model.variants import Tagged

FLOWS: tuple[type[Flow], ...] = (Uniform, Vortex)
AnyFlow = Annotated[Uniform | Vortex, Tagged("type")]

__all__ = ["FLOWS", "AnyFlow", "Flow"]
