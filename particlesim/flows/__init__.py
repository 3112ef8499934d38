"""Velocity fields of fluids. To add one, write its file and add it to `AnyFlow`."""

from typing import Annotated

from pydantic import Field

from particlesim.flows.base import Flow
from particlesim.flows.uniform import Uniform
from particlesim.flows.vortex import Vortex

FLOWS: tuple[type[Flow], ...] = (Uniform, Vortex)
AnyFlow = Annotated[Uniform | Vortex, Field(discriminator="type")]

__all__ = ["FLOWS", "AnyFlow", "Flow"]
