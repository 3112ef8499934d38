"""Velocity fields of fluids. To add one, write its file and add it to `AnyFlow`."""

from typing import Annotated

from particlesim.extensions.open_union import OpenUnion
from particlesim.flows.base import Flow
from particlesim.flows.uniform import Uniform
from particlesim.flows.vortex import Vortex
from particlesim.laws.registry import velocity, velocity_dx
from particlesim.model.variants import Tagged

FLOWS: tuple[type[Flow], ...] = (Uniform, Vortex)

OPEN_FLOWS = OpenUnion("particlesim.flows", Flow, FLOWS, laws=(velocity, velocity_dx))
"""What installed packages add to `AnyFlow`."""

AnyFlow = Annotated[Uniform | Vortex, Tagged("type"), OPEN_FLOWS]

__all__ = ["FLOWS", "OPEN_FLOWS", "AnyFlow", "Flow"]
