"""Forces between two particles."""

from particlesim.bonds.base import BondSet, SpringLaw
from particlesim.bonds.mesh import MeshSprings
from particlesim.bonds.spring import SpringRecord, Springs, StringRecord

__all__ = ["BondSet", "MeshSprings", "SpringLaw", "SpringRecord", "Springs", "StringRecord"]
