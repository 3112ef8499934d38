"""Forces between two listed particles."""

from particlesim.bonds.spring import SpringRecord, Springs

__all__ = ["SpringRecord", "Springs"]
