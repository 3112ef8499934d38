"""What particles collide with. To add a shape, write its file and add it to `AnyCollider` and `COLLIDERS`."""

from typing import Annotated

from pydantic import Field

from particlesim.colliders.base import Collider
from particlesim.colliders.bounds import BoundsRecord
from particlesim.colliders.plane import Plane, PlaneCollider
from particlesim.colliders.sphere import SphereCollider

AnyCollider = Annotated[PlaneCollider | SphereCollider, Field(discriminator="type")]
COLLIDERS: tuple[type[Collider], ...] = (PlaneCollider, SphereCollider)

__all__ = ["COLLIDERS", "AnyCollider", "BoundsRecord", "Collider", "Plane", "PlaneCollider", "SphereCollider"]
