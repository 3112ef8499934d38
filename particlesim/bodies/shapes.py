"""All shapes of rigid bodies."""

from typing import Annotated

from particlesim.bodies.clump import ClumpBody
from particlesim.bodies.mesh import MeshBody
from particlesim.bodies.shape import (
    BallBody,
    BodyShape,
    BoxBody,
    CapsuleBody,
    ConeBody,
    CylinderBody,
    TorusBody,
)
from particlesim.model.variants import Tagged, models_of

AnyBodyShape = Annotated[
    BallBody | BoxBody | CapsuleBody | CylinderBody | ConeBody | TorusBody | MeshBody | ClumpBody,
    Tagged("type"),
]
BODY_SHAPES: tuple[type[BodyShape], ...] = models_of(AnyBodyShape)
