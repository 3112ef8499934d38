"""What particles collide with. To add a shape, write its file and add a line to `COLLIDERS`."""

from typing import Annotated

from particlesim.colliders.base import Collider
from particlesim.colliders.plane import Plane
from particlesim.model.variants import Family, Tagged

COLLIDERS = Family[Collider](
    "particlesim.colliders",
    plane="plane.PlaneCollider",
    sphere="sphere.SphereCollider",
    box="box.BoxCollider",
    capsule="capsule.CapsuleCollider",
    cylinder="cylinder.CylinderCollider",
    cone="cone.ConeCollider",
    torus="torus.TorusCollider",
    rectangle="rectangle.RectangleCollider",
    disc="disc.DiscCollider",
    mesh="mesh.MeshCollider",
    height_field="height_field.HeightFieldCollider",
    distance_grid="distance_grid.DistanceGridCollider",
    formula="formula.FormulaCollider",
    union="combination.UnionCollider",
    intersection="combination.IntersectionCollider",
    difference="combination.DifferenceCollider",
)

AnyCollider = Annotated[Collider, Tagged("type", COLLIDERS)]

__getattr__ = COLLIDERS.by_name

__all__ = ["COLLIDERS", "AnyCollider", "Collider", "Plane"]
