"""Rigid bodies: what a scenario says of them. To add a shape, write its class and add a line to `BODY_SHAPES`."""

from particlesim.bodies.base import BodyShape
from particlesim.bodies.body import Bodies
from particlesim.bodies.joint import JOINTS, AnyJoint, BallJoint, HingeJoint, Joint, Motor
from particlesim.bodies.shapes import BODY_SHAPES, AnyBodyShape

__all__ = [
    "BODY_SHAPES",
    "JOINTS",
    "AnyBodyShape",
    "AnyJoint",
    "BallJoint",
    "Bodies",
    "BodyShape",
    "HingeJoint",
    "Joint",
    "Motor",
]
