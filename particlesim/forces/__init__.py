"""Forces on single particles. To add one, write its file and add its class to `FORCES` and `AnyForce`."""

from typing import Annotated

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
from particlesim.model.variants import Tagged

AnyForce = Annotated[
    Gravity
    | LinearDrag
    | StokesDrag
    | Drag
    | Buoyancy
    | PointSpring
    | Attractor
    | RotatingFrame
    | Field
    | SheetDrag,
    Tagged("type"),
]

FORCES: tuple[type[Force], ...] = (
    Gravity,
    LinearDrag,
    StokesDrag,
    Drag,
    Buoyancy,
    PointSpring,
    Attractor,
    RotatingFrame,
    Field,
)

SURFACE_FORCES: tuple[type[Force], ...] = (SheetDrag,)
"""Forces on the triangles of surfaces, which have a law of their own."""

__all__ = ["FORCES", "SURFACE_FORCES", "AnyForce", "Force", "SheetDrag"]
