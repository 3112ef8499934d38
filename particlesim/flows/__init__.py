"""Velocity fields of fluids. To add one, write its file and add its class to `_Own`."""

from typing import Annotated, get_args

from particlesim.extensions.open_union import OpenUnion
from particlesim.flows.base import Flow
from particlesim.flows.uniform import Uniform
from particlesim.flows.vortex import Vortex
from particlesim.laws.registry import velocity, velocity_dx
from particlesim.model.variants import Tagged

_Own = Uniform | Vortex
FLOWS: tuple[type[Flow], ...] = get_args(_Own)

OPEN_FLOWS = OpenUnion("particlesim.flows", Flow, FLOWS, laws=(velocity, velocity_dx))
"""What installed packages add to `AnyFlow`."""

AnyFlow = Annotated[_Own, Tagged("type"), OPEN_FLOWS]

__all__ = ["FLOWS", "OPEN_FLOWS", "AnyFlow", "Flow"]
