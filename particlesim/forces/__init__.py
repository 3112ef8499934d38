"""Forces on single particles. To add one, write its file and add a line to `FORCES`."""

from typing import Annotated

from particlesim.extensions.open_union import OpenUnion
from particlesim.forces.base import Force
from particlesim.laws.registry import force, force_dv, force_dx, potential
from particlesim.model.variants import Family, Tagged

FORCES = Family[Force](
    "particlesim.forces",
    gravity="gravity.Gravity",
    linear_drag="linear_drag.LinearDrag",
    stokes_drag="stokes_drag.StokesDrag",
    drag="drag.Drag",
    buoyancy="buoyancy.Buoyancy",
    point_spring="point_spring.PointSpring",
    attractor="attractor.Attractor",
    rotating_frame="rotating_frame.RotatingFrame",
    field="field.Field",
)

SURFACE_FORCES = Family[Force]("particlesim.forces", sheet_drag="sheet_drag.SheetDrag")
"""Forces on the triangles of surfaces, which have a law of their own."""

OPEN_FORCES = OpenUnion(
    "particlesim.forces",
    Force,
    FORCES + SURFACE_FORCES,
    texts=("formula", "energy"),
    laws=(force, force_dx, force_dv, potential),
)
"""What installed packages add to `AnyForce`."""

AnyForce = Annotated[Force, Tagged("type", OPEN_FORCES.own), OPEN_FORCES]

__getattr__ = OPEN_FORCES.own.by_name

__all__ = ["FORCES", "OPEN_FORCES", "SURFACE_FORCES", "AnyForce", "Force"]
