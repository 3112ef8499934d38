"""Forces between two, three and four particles, and rods."""

from particlesim.bonds.base import BondSet, SpringLaw
from particlesim.bonds.hinge import Angles, Dihedrals, HingeSet
from particlesim.bonds.mesh import MeshSprings
from particlesim.bonds.rod import Rods, RodSet
from particlesim.bonds.spring import SpringRecord, Springs, StringRecord
from particlesim.bonds.strut import StrutRecord


def record_of(law: SpringLaw) -> SpringRecord | StringRecord | StrutRecord:
    """The record of the springs of a law, by which kernels know what they do."""
    if law.compression_only:
        return StrutRecord()
    return StringRecord() if law.tension_only else SpringRecord()


__all__ = [
    "Angles",
    "BondSet",
    "Dihedrals",
    "HingeSet",
    "MeshSprings",
    "RodSet",
    "Rods",
    "SpringLaw",
    "SpringRecord",
    "Springs",
    "StringRecord",
    "StrutRecord",
    "record_of",
]
