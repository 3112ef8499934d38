"""Velocity fields of fluids. To add one, write its file and add a line to `FLOWS`."""

from typing import Annotated

from particlesim.extensions.open_union import OpenUnion
from particlesim.flows.base import Flow
from particlesim.laws.registry import velocity, velocity_dx
from particlesim.model.variants import Family, Tagged

FLOWS = Family[Flow]("particlesim.flows", uniform="uniform.Uniform", vortex="vortex.Vortex")

OPEN_FLOWS = OpenUnion("particlesim.flows", Flow, FLOWS, laws=(velocity, velocity_dx))
"""What installed packages add to `AnyFlow`."""

AnyFlow = Annotated[Flow, Tagged("type", FLOWS), OPEN_FLOWS]

__getattr__ = FLOWS.by_name

__all__ = ["FLOWS", "OPEN_FLOWS", "AnyFlow", "Flow"]
