"""`[[bodies]]`: rigid bodies of one shape, one by one or in a layout.

A group of bodies is a group of particles at their centres of mass, which have an orientation and an angular momentum as
well.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Gt, Le
from pydantic import model_validator

from particlesim.bodies.shapes import AnyBodyShape
from particlesim.colliders.friction import FallingRestitution, Friction, Rubbing
from particlesim.colliders.pose import UNTURNED, Orientation
from particlesim.groups.group import Particles, SecondOrder
from particlesim.layouts import AnyLayout
from particlesim.layouts.points import Points
from particlesim.model.arrays import Floats
from particlesim.model.base import Name
from particlesim.model.mistakes import invalid
from particlesim.model.quaternions import quaternion
from particlesim.model.units import (
    Kilograms,
    KilogramsPerCubicMetre,
    Metres,
    MetresPerSecond,
    Number,
    RadiansPerSecond,
    Vector,
)
from particlesim.sampling.random_streams import Streams

REST = (0.0, 0.0, 0.0)


class Bodies(Rubbing, Particles):
    """Rigid bodies of one shape: they move, turn, and touch colliders and each other."""

    rigid: ClassVar[bool] = True
    kind: ClassVar[str] = "bodies"
    unused: ClassVar[tuple[str, ...]] = ("radius", "springs", "integrator", "cooling", "pinned", "dynamics")

    name: Name = "bodies"
    """Name of the group, by which forces, colliders and messages speak of it."""
    shape: AnyBodyShape
    """Their shape: its centre of mass is their place, and they are turned from the axes of its frame."""
    mass: Annotated[Kilograms, Gt(0)] | None = None
    """Mass of a body; it follows from the density if that is given."""
    density: Annotated[KilogramsPerCubicMetre, Gt(0)] | None = None
    """Density; 1000 kg/m³ unless it or the mass is given."""
    position: Vector[Metres] | None = None
    """Where the body is, unless `layout` places several; the origin unless given."""
    velocity: Vector[MetresPerSecond] | None = None
    """Velocity of the body at `position`."""
    layout: AnyLayout | None = None  # type: ignore[assignment]
    """Where several bodies are and how fast, instead of `position`."""
    orientation: Orientation | Literal["random"] | None = None
    """How they are turned about their centres: a turn for all, or "random", evenly over all orientations."""
    angular_velocity: Vector[RadiansPerSecond] = REST
    """How fast they turn at the start, along the axes of the world."""
    restitution: Annotated[Number, Ge(0), Le(1)] | FallingRestitution = 0.0
    """Speed after over speed before an impact of two bodies, along the normal, or a table, where it falls with that speed;
    of two different ones the smaller counts, at the speed of the impact. Impacts on colliders have that of the collider."""
    friction: Annotated[Number, Ge(0)] | Friction = 0.5
    """Coefficient of Coulomb friction between bodies, or a table with one at rest and one in motion; of two different ones
    the geometric mean counts. On colliders that of the collider counts."""
    rolling_friction: Annotated[Number, Ge(0)] = 0.0
    """Coefficient of rolling friction μ_r on colliders and bodies: rolling is held back by a moment of up to μ_r R N, with R
    the radius of a ball (the height of the centre of other shapes above the contact), or the reduced radius
    r₁ r₂/(r₁ + r₂) of two round ones. Of two different coefficients the larger counts. What is not flat or round to
    perfection has some 0.001 to 0.1."""

    @model_validator(mode="after")
    def _size(self) -> Bodies:
        for name, why in (
            ("radius", "the size of a body is that of its shape"),
            ("springs", "springs join particles"),
            ("integrator", "bodies have a method of their own, which keeps their angular momentum"),
            ("cooling", "the temperature of bodies does not change"),
        ):
            if getattr(self, name) is not None:
                raise invalid(f"bodies have no {name}: {why}", at=(name,))
        if self.pinned is not False:
            raise invalid(
                "bodies cannot be pinned", at=("pinned",), hint="a collider of this shape stays where it is"
            )
        if not isinstance(self.dynamics, SecondOrder):
            raise invalid(
                "bodies have inertia", at=("dynamics",), allowed='type = "second_order", or nothing'
            )
        if self.mass is not None and self.density is not None:
            raise invalid(
                "mass and density contradict each other",
                at=("density",),
                also=[(("mass",), "mass is given here")],
                allowed="one of the two",
            )
        if self.layout is not None:
            mine = Points(position=(self.position or REST,), velocity=(self.velocity or REST,))
            for name in ("position", "velocity"):
                if getattr(self, name) is not None and self.layout != mine:
                    raise invalid(
                        f"{name} and layout contradict each other",
                        at=(name,),
                        also=[(("layout",), "given here")],
                        allowed=f"one of the two; a layout of points may have a {name} for each body",
                    )
            if self.layout.is_body:
                raise invalid(
                    f"a {self.layout.type} is a body of its own, of springs",
                    at=("layout", "type"),
                    allowed="points, random, lattice or file",
                )
        return self

    @model_validator(mode="after")
    def _as_many(self) -> Bodies:
        return self

    @model_validator(mode="after")
    def _given_once(self) -> Bodies:
        if self.layout is not None and (given := self.layout.attributes()):
            raise invalid(
                f"a {self.layout.type} layout gives {' and '.join(sorted(given))}, which bodies have from their shape",
                at=("layout", "type"),
                allowed="points, random, lattice or file",
            )
        return self

    @model_validator(mode="after")
    def _turning(self) -> Bodies:
        return self  # one angular velocity for all

    @model_validator(mode="after")
    def _body(self) -> Bodies:
        if self.layout is None:
            # One body is a layout of one point, for all that asks where particles are.
            single = Points(position=(self.position or REST,), velocity=(self.velocity or REST,))
            self.__dict__["layout"] = single
        return self

    def describe(self) -> str:
        number, what = self.layout.number() if self.layout is not None else 1, self.shape.words()
        return what if number == 1 else f"{number or 'several'} bodies, each {what}"

    def doubts(self, duration: float) -> Iterator[str]:
        yield from self.friction_doubts(repr(self.name))

    @property
    def weight(self) -> float:
        """Mass of a body [kg]."""
        if self.mass is not None:
            return self.mass
        return (1000.0 if self.density is None else self.density) * self.shape.volume()

    @property
    def ball(self) -> float:
        """Radius of the ball of the same volume [m], which laws take for the size of a body."""
        return (3 * self.shape.volume() / (4 * math.pi)) ** (1 / 3)

    def size(self, streams: Streams, first: int, count: int) -> tuple[Any, Any]:
        return self.weight, self.ball

    def has(self, attribute: str) -> bool:
        return attribute in ("mass", "radius") or super().has(attribute)

    def inertia(self) -> Floats:
        """Principal moments of inertia [kg m²], shape [3]."""
        x, y, z = self.shape.spread()
        return np.array([y + z, z + x, x + y]) * (self.weight / self.shape.volume())

    def axes(self) -> Floats:
        """From the principal axes to those of the shape: a unit quaternion w, x, y, z."""
        return quaternion(self.shape.frame().axes)

    def turns(self, streams: Streams, count: int) -> Floats:
        """Orientations of the shape's axes as unit quaternions w, x, y, z, shape [4, count].

        Random ones are even over all rotations: K. Shoemake, Graphics Gems III (1992), p. 124.
        """
        if self.orientation == "random":
            u, v, w = (streams[f"orientation.{k}"].uniform(0, count) for k in range(3))
            a, b = np.sqrt(1 - u), np.sqrt(u)
            p, q = 2 * np.pi * v, 2 * np.pi * w
            return np.stack([b * np.cos(q), a * np.sin(p), a * np.cos(p), b * np.sin(q)])
        rows = UNTURNED if self.orientation is None else self.orientation.rotation()
        return np.repeat(quaternion(np.array(rows))[:, None], count, axis=1)
