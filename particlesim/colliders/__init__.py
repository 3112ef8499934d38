"""What particles collide with.

To add a shape, write its file and add a line to `COLLIDERS`, and one to `_SOLIDS` if it has an inside.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from particlesim.colliders.base import Collider
from particlesim.colliders.plane import Plane
from particlesim.model.variants import Family, Tagged

if TYPE_CHECKING:
    from particlesim.colliders.solid import Solid

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

_SOLIDS = {
    "plane": "half_space.HalfSpace",
    "sphere": "sphere.Sphere",
    "box": "box.Box",
    "capsule": "capsule.Capsule",
    "cylinder": "cylinder.Cylinder",
    "cone": "cone.Cone",
    "torus": "torus.Torus",
    "mesh": "mesh.Mesh",
    "height_field": "height_field.HeightField",
    "distance_grid": "distance_grid.DistanceGrid",
    "formula": "formula.Formula",
}

SOLIDS: Family[Solid] = Family("particlesim.colliders", **_SOLIDS)
"""What unions, intersections and differences are made of that are parts of others."""

COMPONENTS: Family[Solid] = Family(
    "particlesim.colliders",
    **_SOLIDS,
    union="combination.Union",
    intersection="combination.Intersection",
    difference="combination.Difference",
)
"""What colliders are made of that are put together: solids, and what is put together of solids."""

AnyCollider = Annotated[Collider, Tagged("type", COLLIDERS)]

__getattr__ = COLLIDERS.by_name

__all__ = ["COLLIDERS", "COMPONENTS", "SOLIDS", "AnyCollider", "Collider", "Plane"]
