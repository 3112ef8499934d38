"""What particles collide with. To add a shape, write its file and add it to `AnyCollider` and `COLLIDERS`."""

from typing import Annotated

from particlesim.colliders.base import Collider
from particlesim.colliders.bounds import BoundsRecord
from particlesim.colliders.box import BoxCollider
from particlesim.colliders.capsule import CapsuleCollider
from particlesim.colliders.cone import ConeCollider
from particlesim.colliders.cylinder import CylinderCollider
from particlesim.colliders.disc import DiscCollider
from particlesim.colliders.plane import Plane, PlaneCollider
from particlesim.colliders.rectangle import RectangleCollider
from particlesim.colliders.sphere import SphereCollider
from particlesim.colliders.torus import TorusCollider
from particlesim.model.variants import Tagged

AnyCollider = Annotated[
    PlaneCollider
    | SphereCollider
    | BoxCollider
    | CapsuleCollider
    | CylinderCollider
    | ConeCollider
    | TorusCollider
    | RectangleCollider
    | DiscCollider,
    Tagged("type"),
]
COLLIDERS: tuple[type[Collider], ...] = (
    PlaneCollider,
    SphereCollider,
    BoxCollider,
    CapsuleCollider,
    CylinderCollider,
    ConeCollider,
    TorusCollider,
    RectangleCollider,
    DiscCollider,
)

__all__ = [
    "COLLIDERS",
    "AnyCollider",
    "BoundsRecord",
    "BoxCollider",
    "CapsuleCollider",
    "Collider",
    "ConeCollider",
    "CylinderCollider",
    "DiscCollider",
    "Plane",
    "PlaneCollider",
    "RectangleCollider",
    "SphereCollider",
    "TorusCollider",
]
