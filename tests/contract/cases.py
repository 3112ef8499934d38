"""Every force and flow with enough parameter variants to reach every record type, and particles to try them on."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from particlesim import testing
from particlesim.colliders import (
    BoxCollider,
    CapsuleCollider,
    Collider,
    ConeCollider,
    CylinderCollider,
    DifferenceCollider,
    DiscCollider,
    DistanceGridCollider,
    FormulaCollider,
    HeightFieldCollider,
    IntersectionCollider,
    MeshCollider,
    PlaneCollider,
    RectangleCollider,
    SphereCollider,
    TorusCollider,
    UnionCollider,
)
from particlesim.colliders.bounds import edge
from particlesim.colliders.box import Box
from particlesim.colliders.combination import Union
from particlesim.colliders.cylinder import Cylinder
from particlesim.colliders.half_space import HalfSpace
from particlesim.colliders.pose import Orientation
from particlesim.colliders.sphere import Sphere
from particlesim.expressions.operations import FUNCTIONS
from particlesim.expressions.parser import parse
from particlesim.flows import Flow
from particlesim.flows.uniform import Uniform
from particlesim.flows.vortex import Vortex
from particlesim.forces import (
    Attractor,
    Buoyancy,
    Drag,
    Field,
    Force,
    Gravity,
    LinearDrag,
    PointSpring,
    RotatingFrame,
    StokesDrag,
)
from particlesim.forces.drag import Atmosphere
from particlesim.laws.registry import Particle

UNIFORM = Uniform(velocity=(1.0, -2.0, 0.5))
AXIS = (1.0, 2.0, -0.5)
RANKINE = Vortex(center=(0.1, 0.2, -0.3), axis=AXIS, circulation=3.0, core_radius=0.9, profile="rankine")
LAMB_OSEEN = Vortex(center=(0.1, 0.2, -0.3), axis=AXIS, circulation=3.0, core_radius=0.9)

FLOW_CASES: dict[str, Flow] = {
    "uniform": UNIFORM,
    "rankine": RANKINE,
    "lamb_oseen": LAMB_OSEEN,
    "reversed_vortex": Vortex(axis=(0, 0, 3), circulation=-1.0, core_radius=0.4),
}

_CENTER = (0.2, -0.1, 0.3)
_WIND = (UNIFORM, LAMB_OSEEN)
TURN = Orientation(axis=(1.0, 2.0, -1.0), angle=40.0)

FORCE_CASES: dict[str, Force] = {
    "gravity": Gravity(),
    "gravity_oblique": Gravity(acceleration=(1.0, -2.0, 3.0)),
    "linear_drag": LinearDrag(coefficient=0.7),
    "linear_drag_wind": LinearDrag(coefficient=0.7, flow=_WIND),
    "stokes": StokesDrag(fluid="glycerol"),
    "stokes_wind": StokesDrag(viscosity=0.8, flow=(RANKINE,)),
    "drag": Drag(fluid="air"),
    "drag_area": Drag(density=1.3, coefficient=1.05, area=0.2),
    "drag_wind": Drag(fluid="air", flow=_WIND),
    "drag_atmosphere": Drag(density=Atmosphere(sea_level=-500.0, humidity=0.6), flow=_WIND),
    "drag_stratosphere": Drag(density=Atmosphere(sea_level=-12e3, temperature_offset=5.0)),
    "schiller_naumann": Drag(density=1.2, viscosity=0.02, coefficient="schiller_naumann"),
    "schiller_naumann_fast": Drag(fluid="air", coefficient="schiller_naumann", area=0.1, flow=(UNIFORM,)),
    "buoyancy": Buoyancy(fluid="water"),
    "buoyancy_volume": Buoyancy(density=800.0, volume=0.01, acceleration=(0.3, -9.0, 1.0)),
    "floating": Buoyancy(fluid="water", surface=0.1),
    "floating_oblique": Buoyancy(density=900.0, surface=-0.2, acceleration=(1.0, -3.0, 2.0)),
    "point_spring": PointSpring(stiffness=3.0, anchor=_CENTER),
    "attractor": Attractor(strength=2.0, center=_CENTER),
    "attractor_soft": Attractor(strength=2.0, center=_CENTER, softening=0.5),
    "attractor_mass": Attractor(mass=5e10, softening=0.1),
    "repeller": Attractor(strength=-2.0, exponent=3.0, softening=0.2),
    "logarithmic": Attractor(strength=2.0, exponent=1.0, softening=0.3),
    "linear_attractor": Attractor(strength=2.0, exponent=-1.0, center=_CENTER),
    "cubic_attractor": Attractor(strength=2.0, exponent=-3.0, center=_CENTER),
    "odd_attractor": Attractor(strength=2.0, exponent=2.5, softening=0.4),
    "rotating": RotatingFrame(angular_velocity=(0.3, -1.0, 0.5), center=_CENTER),
    "spinning_up": RotatingFrame(angular_velocity=(0.3, -1.0, 0.5), angular_acceleration=(0.1, 0.2, -0.7)),
    "field": Field(force=("-k*x + vy", "sin(t)*m - y*vz**2", "r*T/300 - z*abs(vx)"), constants={"k": 0.4}),
    "potential": Field(
        potential="k*m*exp(-hypot(x, y)**2) * cos(z + t) + 3/2*z**2 * r", constants={"k": 0.4}
    ),
}

_CUBE = (
    np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]),
    np.array(
        [
            *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
            *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
        ]
    ),
)


def opened(mesh: MeshCollider) -> MeshCollider:
    """A mesh with the surface of a cube of edge 1, as if from a file."""
    mesh.take(_CUBE)
    return mesh


def opened_field(field: HeightFieldCollider) -> HeightFieldCollider:
    """A height field of 5 by 6 numbers, as if from a file."""
    row, column = np.indices((5, 6))
    field.take(0.4 + 0.5 * np.sin(1.3 * row) * np.cos(0.9 * column))
    return field


def opened_grid(grid: DistanceGridCollider) -> DistanceGridCollider:
    """An egg of 25 × 21 × 23 samples, as if from a file: a distance but for its shape."""
    axes = (step * np.arange(n) for step, n in zip(grid.steps, (25, 21, 23), strict=True))
    x, y, z = np.meshgrid(*axes, indexing="ij")
    grid.take(np.sqrt((x - 1.2) ** 2 + (y - 1.0) ** 2 + 1.2 * (z - 1.1) ** 2 + 0.1 * x * y) - 0.85)
    return grid


# Every registered shape, with every record that it can give.
COLLIDER_CASES: dict[str, Collider] = {
    "plane": PlaneCollider(
        normal=(0.48, 0.6, 0.64), point=(0.1, 0.1, 0.1), restitution=0.5, tangential_loss=0.1
    ),
    "plane_x": PlaneCollider(normal=(1, 0, 0), point=(0.1, 0, 0), restitution=0.5, tangential_loss=0.1),
    "plane_y": PlaneCollider(normal=(0, -1, 0), point=(0, 0.1, 0), contact="stick"),
    "plane_z": PlaneCollider(normal=(0, 0, 1), point=(0, 0, 0.1), contact="kill"),
    "sphere": SphereCollider(center=(0.1, -0.2, 0.3), radius=0.9, restitution=0.7, tangential_loss=0.3),
    "sphere_inside": SphereCollider(center=(0.1, -0.2, 0.3), radius=1.2, inside=True, contact="kill"),
    "box": BoxCollider(size=(1.2, 0.8, 1.0), orientation=TURN, center=_CENTER, restitution=0.4),
    "box_upright": BoxCollider(size=(1.4, 0.9, 1.0), center=_CENTER, detection="discrete"),
    "box_inside": BoxCollider(size=(2.2, 1.8, 2.0), orientation=TURN, inside=True, restitution=0.9),
    "capsule": CapsuleCollider(start=(-0.5, 0.1, 0.2), end=(0.6, -0.3, 0.4), radius=0.4),
    "capsule_inside": CapsuleCollider(start=(0, -0.5, 0), end=(0, 0.6, 0), radius=1.1, inside=True),
    "cylinder": CylinderCollider(start=(-0.5, 0.1, 0.2), end=(0.6, -0.3, 0.4), radius=0.5, contact="stick"),
    "cylinder_inside": CylinderCollider(start=(0, -1, 0), end=(0.2, 1.1, 0.1), radius=1.2, inside=True),
    "cone": ConeCollider(start=(-0.5, -0.6, 0.2), end=(0.4, 0.9, 0.1), radius=0.8),
    "cone_cut": ConeCollider(start=(0, -0.6, 0), end=(0, 0.7, 0), radius=0.3, end_radius=0.8),
    "cone_inside": ConeCollider(start=(0, -1, 0), end=(0, 1.5, 0), radius=1.5, end_radius=0.5, inside=True),
    "torus": TorusCollider(center=_CENTER, axis=(0.3, 1, 0.2), radius=0.8, tube=0.3, contact="kill"),
    "torus_inside": TorusCollider(radius=0.8, tube=0.5, inside=True, restitution=0.8),
    "rectangle": RectangleCollider(size=(1.6, 1.1), orientation=TURN, center=_CENTER),
    "rectangle_thick": RectangleCollider(size=(0.9, 1.1), thickness=0.2, restitution=0.3),
    "mesh": opened(MeshCollider(path="cube.obj", scale=0.8, orientation=TURN, origin=_CENTER)),
    "mesh_inside": opened(MeshCollider(path="cube.obj", scale=2.2, inside=True)),
    "mesh_sheet": opened(MeshCollider(path="cube.obj", scale=1.2, thickness=0.02)),
    "height_field": opened_field(HeightFieldCollider(path="hills.npy", size=(2.4, 2.6), height=0.8)),
    "union": UnionCollider(
        of=(Sphere(center=(0.4, 0, 0), radius=0.6), Box(size=(0.9, 0.7, 0.8), orientation=TURN))
    ),
    "intersection": IntersectionCollider(of=(Sphere(radius=0.9), Box(size=(1.4, 1.1, 1.3)))),
    "difference": DifferenceCollider(
        of=(Box(size=(1.5, 1.2, 1.4)), Sphere(center=(0.75, 0.6, 0.7), radius=0.6))
    ),
    "difference_inside": DifferenceCollider(
        of=(Box(size=(2.5, 2.2, 2.4)), Cylinder(start=(0, -2, 0), end=(0, 2, 0), radius=0.3)), inside=True
    ),
    "intersection_with_plane": IntersectionCollider(
        of=(Sphere(radius=0.9), HalfSpace(point=(0.1, 0.2, 0), normal=(0.3, 1, -0.2)))
    ),
    "difference_of_union": DifferenceCollider(
        of=(
            Union(of=(Sphere(center=(0.4, 0, 0), radius=0.6), Box(size=(0.9, 0.7, 0.8), orientation=TURN))),
            Cylinder(start=(0, -2, 0.1), end=(0.1, 2, 0), radius=0.25),
            HalfSpace(point=(-0.3, 0, 0), normal=(1, 0.2, 0)),
        )
    ),
    "formula": FormulaCollider(
        distance="y - a*sin(3*x)*cos(2*z)",
        constants={"a": 0.2},
        size=(2.4, 2.0, 2.6),
        orientation=TURN,
        center=_CENTER,
    ),
    "formula_with_kinks": FormulaCollider(
        distance="max(y - 0.5*abs(x) - 0.3*abs(z), hypot(x, z) - 0.8)",
        size=(2.0, 2.0, 2.2),
        orientation=TURN,
        center=_CENTER,
    ),
    "distance_grid": opened_grid(
        DistanceGridCollider(
            path="egg.npy", origin=(-1.2, -1.0, -1.1), spacing=(0.1, 0.1, 0.1), orientation=TURN, inside=True
        )
    ),
    "disc": DiscCollider(center=_CENTER, normal=(0.3, 1, -0.4), radius=0.9),
}

COLLIDER_RECORDS: dict[str, Any] = {
    **{name: collider.record() for name, collider in COLLIDER_CASES.items()},
    "bounds": edge((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)),
}

_ARGUMENTS = {
    "asin": ("x/3",),
    "acos": ("y/3",),
    "log": ("z + 3",),
    "tan": ("x*y/4",),
    "sqrt": ("z + 3",),
}
_TWO = ("atan2", "hypot", "min", "max")

EXPRESSIONS: tuple[str, ...] = (
    "3.5",
    "x + y - z",
    "-x * y / (z + 4)",
    "vx*vy + vz - m*r",
    "T/300 + t",
    "q*vy - sin(q)*x",
    "x**2",
    "(x + 3)**1.7",
    "(x + 3)**y",
    "x if x < y else y*z",
    "x*y if x > y else z**3",
    "x*y if x <= y else z**3",
    "x*y if x >= y else z**3",
    *(f"{name}({', '.join(_ARGUMENTS.get(name, ('x*y',)))})" for name in FUNCTIONS if name not in _TWO),
    *(f"{name}(x + 1, y*z)" for name in _TWO),
)
"""Every variable, operation and function at least once, smooth at `particles()`."""


def records_in(record: Any) -> Iterator[Any]:
    """A record and all records inside it."""
    if isinstance(record, tuple):
        if hasattr(record, "_fields"):
            yield record
        for part in record:
            yield from records_in(part)


def exercised() -> set[type]:
    """All record types that the cases reach."""
    tops = itertools.chain(
        (f.record() for f in FORCE_CASES.values()),
        (f.record() for f in FLOW_CASES.values()),
        COLLIDER_RECORDS.values(),
        (parse(text, {}) for text in EXPRESSIONS),
    )
    return {type(r) for top in tops for r in records_in(top)}


def particles(n: int = 40, seed: int = 1) -> list[Particle]:
    """Random particles of human size, away from the places where some law has a kink (checked by `away_from_kinks`)."""
    return testing.particles(n, seed, away_from_kinks)


def away_from_kinks(p: Particle, margin: float = 0.02) -> bool:
    """Whether finite differences around p stay on one side of every kink of the cases."""
    x = np.array(p[:3])
    v = np.array(p[3:6])
    axis = np.array(AXIS) / math.hypot(*AXIS)
    d = x - np.array(RANKINE.center)
    off_axis = float(np.linalg.norm(d - d @ axis * axis))
    if abs(off_axis - RANKINE.core_radius) < margin:
        return False
    for surface, up in ((0.1, np.array([0, 1, 0])), (-0.2, -np.array([1, -3, 2]) / math.sqrt(14))):
        depth = surface - float(x @ up) + p.r
        if min(abs(depth), abs(depth - 2 * p.r)) < margin:
            return False
    if np.linalg.norm(v) < 0.3 or min(abs(v)) < margin or np.linalg.norm(v - UNIFORM.velocity) < 0.3:
        return False
    # min, max, abs, sign and conditions of EXPRESSIONS
    return min(abs(p.x - p.y), abs(p.x * p.y), abs(p.x + 1 - p.y * p.z)) > margin
