"""All shapes of rigid bodies."""

from typing import Annotated

from particlesim.bodies.base import BodyShape
from particlesim.model.variants import Family, Tagged

BODY_SHAPES = Family[BodyShape](
    "particlesim.bodies",
    sphere="shape.BallBody",
    box="shape.BoxBody",
    capsule="shape.CapsuleBody",
    cylinder="shape.CylinderBody",
    cone="shape.ConeBody",
    torus="shape.TorusBody",
    mesh="mesh.MeshBody",
    clump="clump.ClumpBody",
)

AnyBodyShape = Annotated[BodyShape, Tagged("type", BODY_SHAPES)]
