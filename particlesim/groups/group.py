"""What all groups of particles share, whether laid out at the start or emitted: size, dynamics, integrator."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray
from pydantic import Field, StrictBool, model_validator

from particlesim.bonds import BondSet, HingeSet, MeshSprings, RodSet
from particlesim.bonds.hinge import hinge_record
from particlesim.errors import UsageError
from particlesim.flows import AnyFlow
from particlesim.groups.selection import Selection, selected
from particlesim.integrators import AnyIntegrator
from particlesim.layouts import AnyLayout
from particlesim.layouts.base import Layout, LayoutError
from particlesim.layouts.mesh import STRUCTURAL
from particlesim.model.attributes import ATTRIBUTES
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import Path as Place
from particlesim.model.mistakes import invalid
from particlesim.model.units import (
    Coulombs,
    Kelvin,
    Kilograms,
    KilogramsPerCubicMetre,
    KilogramsPerSecond,
    Metres,
    PerSecond,
    RadiansPerSecond,
    Vector,
)
from particlesim.model.variants import Tagged
from particlesim.sampling.distributions import Distribution, Sampled, draw, smallest
from particlesim.sampling.random_streams import Streams

T = TypeVar("T")
Each = Annotated[tuple[T, ...], Field(min_length=1)]
"""Values one by one, as many as there are particles."""


class FirstOrder(Model):
    """Motion without inertia: x' = w(x, t) + f/γ. The limit of strong drag, for instance of small grains in oil.

    Its state is the position alone: a method that needs velocities, too, is replaced by another one for these particles, and
    for all that step together with them (see [integrators](#integrators)).
    """

    type: Literal["first_order"] = "first_order"
    drag: Annotated[KilogramsPerSecond, Gt(0)]
    """Drag coefficient γ; its inverse is the mobility."""
    flow: tuple[AnyFlow, ...] = ()
    """Flows that carry the particles, added up."""


class TracerMotion(Model):
    """Motion with the fluid: x' = w(x, t). Forces do not act on tracers."""

    type: Literal["tracer"] = "tracer"
    flow: tuple[AnyFlow, ...] = Field(min_length=1)
    """Flows that carry the particles, added up."""


class SecondOrder(Model):
    """Newton's second law: m x'' = f."""

    type: Literal["second_order"] = "second_order"


AnyDynamics = Annotated[SecondOrder | FirstOrder | TracerMotion, Tagged("type")]


class Cooling(Model):
    """Newton's law of cooling: T' = −rate (T − ambient)."""

    rate: Annotated[PerSecond, Ge(0)]
    """Cooling rate."""
    ambient: Annotated[Kelvin, Ge(0)] = 293.15
    """Temperature of the surroundings."""


class Group(Model):
    """A group of particles."""

    name: Name
    """Name of the group, by which forces, planes and messages speak of it."""
    mass: Sampled[Annotated[Kilograms, Gt(0)]] | None = None
    """Mass of a particle; 1 kg unless given or following from radius and density."""
    radius: Sampled[Annotated[Metres, Ge(0)]] | None = None
    """Radius of a particle; 0 (a point) unless given or following from mass and density."""
    density: Annotated[KilogramsPerCubicMetre, Gt(0)] | None = None
    """Density of a particle, which joins mass and radius: give two of the three at most."""
    temperature: Sampled[Annotated[Kelvin, Ge(0)]] | None = None
    """Temperature at the start."""
    charge: Sampled[Coulombs] | None = None
    """Electric charge of a particle, for forces that read it (q in a field); 0 unless given."""
    cooling: Cooling | None = None
    """How the temperature changes; constant unless given."""
    dynamics: AnyDynamics = SecondOrder()
    """Whether particles have inertia."""
    integrator: AnyIntegrator | None = None
    """Method for this group; the simulation's unless given."""

    @model_validator(mode="after")
    def _size(self) -> Group:
        if self.density is not None:
            if self.mass is not None and self.radius is not None:
                raise invalid(
                    "mass, radius and density are given: the third follows from two",
                    at=("density",),
                    also=[(("mass",), "mass"), (("radius",), "radius")],
                )
            if self.mass is None and self.radius is None and not self.has_file():
                raise invalid("a density needs a mass or a radius to act on", at=("density",))
            if self.radius is not None and not smallest(self.radius) > 0:
                raise invalid(
                    "with a density the radius must be greater than 0",
                    at=("radius",),
                    hint="give the distribution a min" if isinstance(self.radius, Distribution) else None,
                )
        for name, attribute in ATTRIBUTES.items():
            value = getattr(self, name)
            if isinstance(value, Distribution) and not attribute.allows(smallest(value)):
                wrong = f"this distribution can give a {name} that is not {attribute.rule}"
                raise invalid(wrong, at=(name,), hint="add min")
        if self.cooling is not None and self.temperature is None:
            raise invalid("cooling needs a temperature to begin with", at=("cooling",))
        return self

    def size(self, streams: Streams, first: int, count: int) -> tuple[Any, Any]:
        """Mass [kg] and radius [m] of particles first … first + count − 1; a number where all are equal."""
        mass = self.sample("mass", streams, first, count)
        radius = self.sample("radius", streams, first, count)
        if self.density is not None and radius is not None:
            mass = 4 / 3 * math.pi * self.density * radius**3
        elif self.density is not None and mass is not None:
            radius = (mass / (4 / 3 * math.pi * self.density)) ** (1 / 3)
        return 1.0 if mass is None else mass, 0.0 if radius is None else radius

    def sample(self, name: str, streams: Streams, first: int, count: int) -> Any:
        """An attribute of particles first … first + count − 1; a number where all are equal, None if not given."""
        value = getattr(self, name)
        if isinstance(value, Distribution):
            return draw(value, streams[name], first, count)
        return value

    def attributes(self, streams: Streams, first: int, count: int) -> dict[str, Any]:
        """All attributes that particles first … first + count − 1 have, by name; a number where all are equal."""
        mass, radius = self.size(streams, first, count)
        found = {"mass": mass, "radius": radius} if self.has("radius") else {"mass": mass}
        rest = [name for name in ATTRIBUTES if name not in ("mass", "radius")]
        sampled = {name: self.sample(name, streams, first, count) for name in rest}
        return found | {name: values for name, values in sampled.items() if values is not None}

    kind: ClassVar[str] = "particles"
    """What the graph calls it."""

    def describe(self) -> str:
        """What the group is, in a few words."""
        return ""

    def doubts(self, duration: float) -> Iterable[str]:
        """A sentence for each choice that is legal and seldom meant, before a run of so many seconds."""
        return ()

    def least_mass(self) -> float | None:
        """Mass of the lightest particle that a scenario gives it [kg]; None where it does not tell."""
        if self.density is not None:
            size = self.least_size()
            return None if size is None else size[0]
        return 1.0 if self.mass is None else least(self.mass)

    def least_size(self) -> tuple[float, float] | None:
        """Mass [kg] and radius [m] of the smallest particle that a scenario gives it; None where it does not tell."""
        mass, radius, volume = least(self.mass), least(self.radius), 4 / 3 * math.pi
        if self.density is not None and radius is not None:
            return volume * self.density * radius**3, radius
        if self.density is not None and mass is not None:
            return mass, (mass / (volume * self.density)) ** (1 / 3)
        return None if radius is None else (1.0 if mass is None else mass, radius)

    def has(self, attribute: str) -> bool:
        """Whether its particles have an attribute, as far as is known before files are read."""
        follows = self.density is not None and attribute in ("mass", "radius")
        return follows or getattr(self, attribute) is not None

    def may_have(self, attribute: str) -> bool:
        """Whether its particles have an attribute, or a file may give it to them."""
        return self.has(attribute) or self.has_file()

    def has_file(self) -> bool:
        """Whether a file says more about its particles than the scenario."""
        return False


def least(value: float | tuple[float, ...] | Distribution | None) -> float | None:
    """The smallest of what a scenario gives, None where it is not above 0 or not given."""
    found = None if value is None else smallest(value)
    return found if found is not None and found > 0 else None


class Particles(Group):
    """Particles that are there from the start."""

    name: Name = "particles"
    """Name of the group, by which forces, planes and messages speak of it."""
    # Wider than those of other groups: only here is it known how many particles there are.
    mass: Sampled[Annotated[Kilograms, Gt(0)]] | Each[Annotated[Kilograms, Gt(0)]] | None = None  # type: ignore[assignment]
    """Mass of a particle, or a list of them, one for each; 1 kg unless given or following from radius and density."""
    radius: Sampled[Annotated[Metres, Ge(0)]] | Each[Annotated[Metres, Ge(0)]] | None = None  # type: ignore[assignment]
    """Radius of a particle, or a list of them; 0 (a point) unless given or following from mass and density."""
    temperature: Sampled[Annotated[Kelvin, Ge(0)]] | Each[Annotated[Kelvin, Ge(0)]] | None = None  # type: ignore[assignment]
    """Temperature at the start, or a list of them, one for each."""
    charge: Sampled[Coulombs] | Each[Coulombs] | None = None  # type: ignore[assignment]
    """Electric charge of a particle, or a list of them, for forces that read it (q in a field); 0 unless given."""
    layout: AnyLayout
    """Where they are and how fast."""
    angular_velocity: Vector[RadiansPerSecond] | Each[Vector[RadiansPerSecond]] | None = None
    """How fast grains turn at the start, one vector or a list of them, one for each: particles turn that have contacts with
    friction."""
    pinned: StrictBool | Selection = False
    """Particles that no force moves: true for all; a list of indices in the group or of names of parts of the layout
    ("left", "row 3", "column -1"); or a box, ball or shell: those inside it at the start."""
    springs: MeshSprings | None = None
    """Springs of a layout that is a body (cloth, rope, jelly, net, hair, bridge, mesh)."""

    @model_validator(mode="after")
    def _as_many(self) -> Particles:
        for name in ATTRIBUTES:
            values = getattr(self, name)
            if not isinstance(values, tuple):
                continue
            number = self.layout.number()
            here = [(("layout",), f"a {self.layout.type}")]
            if number is None:
                columns = f"its file may have a column {name}" if self.layout.type == "file" else None
                raise invalid(
                    "how many particles there are is known only once a file is read",
                    at=(name,),
                    also=here,
                    hint=columns,
                )
            if len(values) != number:
                raise invalid(
                    f"{len(values)} value{'s' if len(values) > 1 else ''} for {number} particles",
                    at=(name,),
                    also=here,
                    allowed="one number for all, or one for each particle",
                )
        return self

    @model_validator(mode="after")
    def _given_once(self) -> Particles:
        for name in sorted(self.layout.attributes()):
            for own in (name, "density") if name == "mass" else (name,):
                if getattr(self, own) is not None:
                    raise invalid(
                        f"a {self.layout.type} layout gives its particles their {name}",
                        at=(own,),
                        also=[(("layout", name), "here")],
                        hint=f"leave {own} out, or place the particles by another layout",
                    )
        return self

    @model_validator(mode="after")
    def _turning(self) -> Particles:
        values, number = self.angular_velocity, self.layout.number()
        if (
            values is not None
            and isinstance(values[0], tuple)
            and number is not None
            and len(values) != number
        ):
            raise invalid(
                f"{len(values)} vectors for {number} particles",
                at=("angular_velocity",),
                also=[(("layout",), f"a {self.layout.type}")],
                allowed="one vector for all, or one for each particle",
            )
        return self

    @model_validator(mode="after")
    def _body(self) -> Particles:
        kinds = self.layout.kinds
        here = [(("layout", "type"), f"a {self.layout.type}")]
        if self.springs is not None and not kinds:
            raise invalid(
                f"a layout of type {self.layout.type!r} brings no springs",
                at=("springs",),
                also=here,
                hint="cloth, rope, jelly, net, hair, bridge and mesh do; [[springs]] joins particles of any layout",
            )
        springs = self.springs
        bending = springs.hinges() if springs is not None else {}
        for kind in {**springs.stiffness(), **bending} if springs is not None else ():
            if kind not in kinds:
                raise invalid(
                    f"a {self.layout.type} has no {kind}s"
                    if kind in bending
                    else f"a {self.layout.type} has no {kind} springs",
                    at=("springs", kind),
                    also=here,
                    allowed=", ".join(kinds),
                )
        if springs is not None and springs.rigid and not self.layout.can_be_rigid:
            raise invalid(
                f"a {self.layout.type} of rods could hardly move",
                at=("springs", "rigid"),
                also=here,
                allowed="rigid = true in a rope, a net or hair",
                hint="structural = 1e4 (N/m) makes it stiff",
            )
        if self.layout.is_body and isinstance(self.mass, Distribution | tuple):
            raise invalid(
                f"the mass of a {self.layout.type} is that of the whole body: one number",
                at=("mass",),
                also=here,
            )
        return self

    def describe(self) -> str:
        number = self.layout.number()
        return f"{'particles' if number is None else f'{number} particles'}, {self.layout.type}"

    def has(self, attribute: str) -> bool:
        return super().has(attribute) or attribute in self.layout.attributes()

    def has_file(self) -> bool:
        return self.layout.type == "file"

    def check_sizes(self, layout: Layout) -> None:
        """Raises LayoutError where the open layout leaves a density nothing to act on, or no third to follow."""
        if self.density is None or not self.has_file():
            return
        own = {name for name in ("mass", "radius") if getattr(self, name) is not None}
        read = layout.attributes() & {"mass", "radius"}
        if not own | read:
            raise LayoutError(
                "the group has a density, and its file neither masses nor radii for it to act on",
                "add a column radius or mass to the file, or a radius or mass to the group",
            )
        if len(read) == 1 and own - read:
            (here,), (there,) = own - read, read
            raise LayoutError(
                f"the group has a {here} and a density, and its file a column {there}: the third follows from two",
                f"leave out {here} or density",
            )

    def sized(self, read: Mapping[str, Any]) -> dict[str, Any]:
        """Attributes of particles that a file gives, and what follows from them by the density.

        Raises UsageError where a radius gives no mass.
        """
        known = dict(read)
        if self.density is None or ("mass" in read) == ("radius" in read):
            return known
        volume = 4 / 3 * math.pi
        if "radius" in read:
            if not (read["radius"] > 0).all():
                raise UsageError(
                    f"a particle of {self.name!r} has no radius, of which its density could make a mass",
                    "give it a radius in the file, or leave out density and give the file a column mass",
                )
            known["mass"] = volume * self.density * read["radius"] ** 3
        else:
            known["radius"] = (read["mass"] / (volume * self.density)) ** (1 / 3)
        return known

    def sample(self, name: str, streams: Streams, first: int, count: int) -> Any:
        value = super().sample(name, streams, first, count)
        if isinstance(value, tuple):
            return np.asarray(value[first : first + count], float)
        if name != "mass" or not self.layout.is_body:
            return value
        number = self.layout.number() or 1
        if value is not None:
            return value / number
        return None if self.density is not None else 1.0 / number

    def pins(self, position: NDArray[np.floating]) -> NDArray[np.int64]:
        """Indices of the particles that no force moves, sorted; positions [m] at the start have shape [3, n]."""
        if self.pinned is True:
            return np.arange(position.shape[1])
        listed = np.empty(0, np.int64)
        if self.pinned is not False:
            listed = selected(self.pinned, self.layout, position)
        return np.union1d(listed, self.layout.pins())

    def has_pins(self) -> bool:
        """Whether there may be particles that no force moves."""
        return self.pinned is not False or bool(self.layout.pins().size)

    def opened(self, folder: Path | None) -> Particles:
        """The group with the file of its layout read, if it names one, relative to a folder."""
        return self.model_copy(update={"layout": self.layout.open(folder)})

    def bonds(self, folder: Path | None = None) -> tuple[BondSet, ...]:
        """The springs that its layout brings; their names are those of the group and the kind. Files are read from `folder`,
        when the springs are looked for."""
        laws = self.springs.laws() if self.springs is not None else {}
        both = (self.name, self.name)
        return tuple(
            BondSet(f"{self.name}.{kind}", both, law, None, partial(self._edges, kind, folder))
            for kind, law in laws.items()
        )

    def rods(self, at: Place, folder: Path | None = None) -> tuple[RodSet, ...]:
        """The rods between neighbours in its layout, if they are rigid; `at` is the place of its springs in the scenario."""
        if self.springs is None or not self.springs.rigid:
            return ()
        find = partial(self._edges, STRUCTURAL, folder, None, None)
        name = f"{self.name}.{STRUCTURAL}"
        return (RodSet(name, (self.name, self.name), None, None, find, at, listed=False),)

    def hinges(self, folder: Path | None = None) -> tuple[HingeSet, ...]:
        """The angles and dihedrals that its layout brings, likewise."""
        kinds = self.springs.hinges() if self.springs is not None else {}
        return tuple(
            HingeSet(
                f"{self.name}.{kind}",
                (self.name,),
                3 if kind == "angle" else 4,
                hinge_record("harmonic", stiffness),
                None,
                None,
                partial(self._hinges, kind, folder),
            )
            for kind, stiffness in kinds.items()
        )

    def _edges(self, kind: str, folder: Path | None, first: Any, second: Any) -> NDArray[np.int64]:
        return self.layout.open(folder).edges(kind)

    def _hinges(self, kind: str, folder: Path | None) -> NDArray[np.int64]:
        return self.layout.open(folder).hinges(kind)
