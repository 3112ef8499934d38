"""Forces between two particles."""

from particlesim.bonds.base import BondSet, SpringLaw
from particlesim.bonds.spring import SpringRecord, Springs, StringRecord

__all__ = ["BondSet", "SpringLaw", "SpringRecord", "Springs", "StringRecord"]
