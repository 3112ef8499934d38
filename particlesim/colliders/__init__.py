"""What particles collide with. To add a shape, write its file and add it to `AnyCollider`."""

from typing import Annotated

from particlesim.colliders.base import Collider
from particlesim.colliders.bounds import BoundsRecord
from particlesim.colliders.box import BoxCollider
from particlesim.colliders.capsule import CapsuleCollider
from particlesim.colliders.combination import DifferenceCollider, IntersectionCollider, UnionCollider
from particlesim.colliders.cone import ConeCollider
from particlesim.colliders.cylinder import CylinderCollider
from particlesim.colliders.disc import DiscCollider
from particlesim.colliders.distance_grid import DistanceGridCollider
from particlesim.colliders.formula import FormulaCollider
from particlesim.colliders.height_field import HeightFieldCollider
from particlesim.colliders.mesh import MeshCollider
from particlesim.colliders.plane import Plane, PlaneCollider
from particlesim.colliders.rectangle import RectangleCollider
from particlesim.colliders.sphere import SphereCollider
from particlesim.colliders.torus import TorusCollider
from particlesim.model.variants import Tagged, models_of

AnyCollider = Annotated[
    PlaneCollider
    | SphereCollider
    | BoxCollider
    | CapsuleCollider
    | CylinderCollider
    | ConeCollider
    | TorusCollider
    | RectangleCollider
    | DiscCollider
    | MeshCollider
    | HeightFieldCollider
    | DistanceGridCollider
    | FormulaCollider
    | UnionCollider
    | IntersectionCollider
    | DifferenceCollider,
    Tagged("type"),
]
COLLIDERS: tuple[type[Collider], ...] = models_of(AnyCollider)

__all__ = [
    "COLLIDERS",
    "AnyCollider",
    "BoundsRecord",
    "BoxCollider",
    "CapsuleCollider",
    "Collider",
    "ConeCollider",
    "CylinderCollider",
    "DifferenceCollider",
    "DiscCollider",
    "DistanceGridCollider",
    "FormulaCollider",
    "HeightFieldCollider",
    "IntersectionCollider",
    "MeshCollider",
    "Plane",
    "PlaneCollider",
    "RectangleCollider",
    "SphereCollider",
    "TorusCollider",
    "UnionCollider",
]
