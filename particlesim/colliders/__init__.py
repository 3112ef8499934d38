"""What particles collide with."""

from particlesim.colliders.bounds import BoundsRecord
from particlesim.colliders.plane import AnyPlaneRecord, Plane

__all__ = ["AnyPlaneRecord", "BoundsRecord", "Plane"]
