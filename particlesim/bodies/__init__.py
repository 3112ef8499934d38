"""Rigid bodies: what a scenario says of them. To add a shape, write its class and add it to `AnyBodyShape`."""

from particlesim.bodies.body import Bodies
from particlesim.bodies.shape import AnyBodyShape, BodyShape

__all__ = ["AnyBodyShape", "Bodies", "BodyShape"]
