"""Forces between two, three and four particles."""

from particlesim.bonds.base import BondSet, SpringLaw
from particlesim.bonds.hinge import Angles, Dihedrals, HingeSet
from particlesim.bonds.mesh import MeshSprings
from particlesim.bonds.spring import SpringRecord, Springs, StringRecord

__all__ = [
    "Angles",
    "BondSet",
    "Dihedrals",
    "HingeSet",
    "MeshSprings",
    "SpringLaw",
    "SpringRecord",
    "Springs",
    "StringRecord",
]
