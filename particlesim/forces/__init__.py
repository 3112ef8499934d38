"""Forces on single particles. To add one, write its file and add its class to `_Own`."""

from typing import Annotated, get_args

from particlesim.extensions.open_union import OpenUnion
from particlesim.forces.attractor import Attractor
from particlesim.forces.base import Force
from particlesim.forces.buoyancy import Buoyancy
from particlesim.forces.drag import Drag
from particlesim.forces.field import Field
from particlesim.forces.gravity import Gravity
from particlesim.forces.linear_drag import LinearDrag
from particlesim.forces.point_spring import PointSpring
from particlesim.forces.rotating_frame import RotatingFrame
from particlesim.forces.sheet_drag import SheetDrag
from particlesim.forces.stokes_drag import StokesDrag
from particlesim.laws.registry import force, force_dv, force_dx, potential
from particlesim.model.variants import Tagged

_Own = (
    Gravity
    | LinearDrag
    | StokesDrag
    | Drag
    | Buoyancy
    | PointSpring
    | Attractor
    | RotatingFrame
    | Field
    | SheetDrag
)
_ALL: tuple[type[Force], ...] = get_args(_Own)
FORCES = tuple(each for each in _ALL if not each.on_surfaces)
SURFACE_FORCES = tuple(each for each in _ALL if each.on_surfaces)
"""Forces on the triangles of surfaces, which have a law of their own."""

OPEN_FORCES = OpenUnion(
    "particlesim.forces",
    Force,
    _ALL,
    texts=("formula", "energy"),
    laws=(force, force_dx, force_dv, potential),
)
"""What installed packages add to `AnyForce`."""

AnyForce = Annotated[_Own, Tagged("type"), OPEN_FORCES]

__all__ = ["FORCES", "OPEN_FORCES", "SURFACE_FORCES", "AnyForce", "Force", "SheetDrag"]
