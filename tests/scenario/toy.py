"""Small models with every feature of the real ones: unions by type, quantities, cross-field checks."""

from typing import Annotated, Literal, Self

from annotated_types import Ge, Gt
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from particlesim.model.base import Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import (
    Kilograms,
    KilogramsPerSecond,
    Metres,
    MetresPerSecond,
    MetresPerSecondSquared,
    Number,
    Seconds,
    Vector,
)
from particlesim.scenario.text.diagnose import diagnose
from particlesim.scenario.text.source import Source, parse_source


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Normal(Strict):
    """A normal distribution."""

    type: Literal["normal"] = "normal"
    mean: MetresPerSecond
    std: Annotated[MetresPerSecond, Ge(0)]


class Uniform(Strict):
    """Equally likely values between two ends."""

    type: Literal["uniform"] = "uniform"
    low: MetresPerSecond
    high: MetresPerSecond

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.low > self.high:
            raise invalid(
                "low is above high", at=("low",), also=[(("high",), "the upper end")], hint="swap the two"
            )
        return self


Distribution = Annotated[Normal | Uniform, Field(discriminator="type")]


class Gravity(Strict):
    type: Literal["gravity"] = "gravity"
    name: str = ""
    acceleration: Vector[MetresPerSecondSquared] = (0.0, -9.80665, 0.0)


class Drag(Strict):
    type: Literal["drag"] = "drag"
    name: str = ""
    coefficient: Annotated[KilogramsPerSecond, Gt(0)] = Field(description="Drag coefficient k in f = −k v.")
    on: list[str] | None = None


class FieldForce(Strict):
    type: Literal["field"] = "field"
    name: str = ""
    force: Vector[str]
    constants: dict[str, Number] = {}

    @model_validator(mode="after")
    def _no_underscore(self) -> Self:
        for axis, text in enumerate(self.force):
            if (at := text.find("__")) >= 0:
                raise invalid("names have no underscores", at=("force", axis), within=(at, 2))
        return self


Force = Annotated[Gravity | Drag | FieldForce, Field(discriminator="type")]


class Points(Strict):
    type: Literal["points"] = "points"
    position: Annotated[tuple[Vector[Metres], ...], Field(min_length=1)]


class Lattice(Strict):
    type: Literal["lattice"] = "lattice"
    count: Annotated[int, Gt(0)]


class Particles(Strict):
    name: Name
    layout: Points | Lattice = Field(discriminator="type")
    mass: Annotated[Kilograms, Gt(0)] = 1.0
    speed: MetresPerSecond | Distribution = 0.0
    pinned: bool | list[int] = False


class Adaptive(Strict):
    method: Literal["rk45"]
    tolerance: Annotated[Number, Gt(0)] = 1e-6


class Simulation(Strict):
    duration: Annotated[Seconds, Gt(0)]
    dt: Seconds = Field(1e-3, gt=0, description="Longest step.")
    integrator: Literal["symplectic_euler", "rk4"] | Adaptive = "symplectic_euler"
    precision: Literal["double", "single"] = "double"
    seed: int = 0


class Scenario(Strict):
    """What a toy scenario file may say."""

    format: Literal[1] = 1
    title: str = ""
    simulation: Simulation
    particles: list[Particles] = []
    forces: list[Force] = []

    @model_validator(mode="after")
    def _known_groups(self) -> Self:
        names = [group.name for group in self.particles]
        for i, force in enumerate(self.forces):
            for j, name in enumerate(force.on or [] if isinstance(force, Drag) else []):
                if name not in names:
                    raise invalid(f"no group is called {name!r}", at=("forces", i, "on", j))
        return self


GOOD = """\
title = "toy"

[simulation]
duration = "2 s"
dt = 0.002

[[particles]]
name = "ball"
layout = { type = "points", position = [[0, "12 cm", 0]] }
mass = "145 g"
speed = { type = "normal", mean = "90 km/h", std = 0.4 }

[[forces]]
type = "gravity"

[[forces]]
name = "air"
type = "drag"
coefficient = 0.47
on = ["ball"]
"""


def load(source: Source | str) -> Scenario:
    """Validate as the real loader does: pydantic's error becomes a ScenarioError."""
    if isinstance(source, str):
        source = parse_source(source)
    try:
        return Scenario.model_validate(source.raw)
    except ValidationError as error:
        raise diagnose(error, source, Scenario) from None
