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
from particlesim.model.variants import Tagged

AnyBodyShape = Annotated[
    BallBody | BoxBody | CapsuleBody | CylinderBody | ConeBody | TorusBody | MeshBody | ClumpBody,
    Tagged("type"),
]
BODY_SHAPES: tuple[type[BodyShape], ...] = (
    BallBody,
    BoxBody,
    CapsuleBody,
    CylinderBody,
    ConeBody,
    TorusBody,
    MeshBody,
    ClumpBody,
)
