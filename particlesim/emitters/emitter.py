"""What a scenario says of an emitter, and the particles it gives birth to."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le
from pydantic import Field, field_validator, model_validator

from particlesim.groups.group import Group
from particlesim.model.arrays import Floats
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import (
    Degrees,
    Kelvin,
    Metres,
    MetresPerSecond,
    Number,
    PerSecond,
    Seconds,
    Vector,
)
from particlesim.model.vectors import perpendicular, unit
from particlesim.sampling.distributions import Distribution, Sampled, draw, smallest
from particlesim.sampling.random_streams import Streams
from particlesim.sampling.shapes import AnyShape

BORN = "count of on_impact is how many are born of an impact, at its place"
"""What there is instead of a rate and a shape where impacts give birth."""


class Burst(Model):
    """Many particles at once."""

    count: Annotated[int, Field(ge=1, le=10**10, strict=True)]
    """Number of particles."""
    at: Seconds
    """Time of the burst."""


class OnImpact(Model):
    """Births where particles or bodies of other groups hit colliders, or each other, at the moment of each impact."""

    of: tuple[Name, ...] = Field(min_length=1)
    """Groups of particles or bodies whose impacts give birth."""
    at: tuple[Name, ...] | None = Field(default=None, min_length=1)
    """Colliders and planes at which they do, by name; all that these groups meet unless given, and none with `against`."""
    against: tuple[Name, ...] | None = Field(default=None, min_length=1)
    """Groups of particles or bodies on which they do, where these touch by impulses. An impact of two that are both in `of`
    and in `against` is one impact."""
    count: Annotated[int, Field(ge=1, le=10**6, strict=True)] = 1
    """Particles born of each impact."""
    above: Annotated[MetresPerSecond, Ge(0)] = 0.0
    """Least speed along the normal, relative to the surface, of an impact that gives birth."""
    inherit: Annotated[Number, Ge(0), Le(1)] = 0.0
    """Part of the velocity along the surface of the particle that hits which is added to that of the new ones."""

    def hears(self, collider: str | None) -> bool:
        """Whether impacts on a collider of this name give birth."""
        return self.against is None if self.at is None else collider in self.at


class Die(Model):
    """Conditions at which a particle dies, in addition to its lifetime and planes that kill."""

    temperature_below: Annotated[Kelvin, Gt(0)] | None = None
    """Temperature below which a cooling particle dies."""
    outside: tuple[Vector[Metres], Vector[Metres]] | None = None
    """Corners of a box outside of which particles die."""

    @model_validator(mode="after")
    def _ordered(self) -> Die:
        if self.outside is not None and any(b <= a for a, b in zip(*self.outside, strict=True)):
            raise invalid("the second corner must be greater than the first in x, y and z", at=("outside", 1))
        return self


class Emitter(Group):
    """A source of particles, at a rate, in bursts, or both."""

    kind: ClassVar[str] = "emitter"

    name: Name = "emitter"
    """Name of the group of its particles, by which forces, planes and messages speak of it."""
    rate: Annotated[PerSecond, Gt(0)] | None = None
    """Particles per second."""
    burst: Burst | tuple[Burst, ...] = ()
    """One burst or a list of them."""
    start: Annotated[Seconds, Ge(0)] = 0.0
    """When the rate begins; the first particle is born then."""
    stop: Annotated[Seconds, Ge(0)] | None = None
    """When the rate ends; never unless given."""
    timing: Literal["regular", "jittered"] = "regular"
    """Births at equal distances in time, or at a random moment of each."""
    on_impact: OnImpact | None = None
    """Instead of a rate and bursts: births where others hit something, such as splashes and sparks."""
    shape: AnyShape | None = None
    """Where particles are born; left out with on_impact, where it is the place of the impact."""
    direction: Vector[float] | Literal["outward", "mirrored"] = (0.0, 1.0, 0.0)
    """Axis of the cone of initial velocities; "outward" points away from the shape's center, or from the surface that was
    hit; "mirrored", with on_impact, is the direction in which the particle that hit would rebound from a mirror."""
    spread: Annotated[Degrees, Ge(0), Le(180)] = 0.0
    """Half angle of the cone in degrees; 180 is all directions alike."""
    speed: Sampled[MetresPerSecond] = 0.0
    """Initial speed along the direction."""
    velocity: Vector[MetresPerSecond] = (0.0, 0.0, 0.0)
    """Velocity of the emitter, added to that of each particle."""
    lifetime: Sampled[Annotated[Seconds, Gt(0)]] | None = None
    """How long a particle lives; for ever unless given."""
    die: Die | None = None
    """What else ends a particle."""
    limit: Annotated[int, Field(ge=1, le=10**9, strict=True)] | None = None
    """Largest number of particles that are alive at once. No limit unless given."""
    when_full: Literal["recycle", "wait"] = "recycle"
    """Recycle: a birth takes the oldest slot and ends the particle that is still in it. Wait: births wait until fewer
    particles than the limit are alive."""

    @field_validator("direction")
    @classmethod
    def _has_direction(cls, direction: tuple[float, float, float] | str) -> tuple[float, float, float] | str:
        if not isinstance(direction, str):
            unit(direction)
        return direction

    @model_validator(mode="after")
    def _emits(self) -> Emitter:
        if self.on_impact is not None:
            self._hears()
            return self
        if self.rate is None and not self.bursts():
            raise invalid(
                "emits nothing",
                allowed="rate = 150, or burst = { count = 500, at = 1.0 }, or both; or on_impact",
            )
        if self.shape is None:
            raise invalid("a shape says where particles are born", at=("shape",), hint="Field required")
        if self.direction == "mirrored":
            raise invalid("mirrored directions need on_impact", at=("direction",))
        if self.rate is None and self.stop is not None:
            raise invalid("stop ends the rate, but no rate is given", at=("stop",))
        if self.stop is not None and self.stop <= self.start:
            raise invalid("stops before it starts", at=("stop",), also=[(("start",), "starts here")])
        for k, burst in enumerate(self.bursts()):
            if burst.at < 0:
                at = ("burst", k, "at") if isinstance(self.burst, tuple) else ("burst", "at")
                raise invalid("a burst before time 0", at=at)
        if isinstance(self.lifetime, Distribution) and not smallest(self.lifetime) > 0:
            raise invalid(
                "this distribution can give a lifetime that is not greater than 0",
                at=("lifetime",),
                hint="add min",
            )
        return self

    def _hears(self) -> None:
        """Refuse keys that have no meaning for births at impacts."""
        here = ((("on_impact",), "impacts give birth"),)
        for name in ("rate", "shape", "stop"):
            if getattr(self, name) is not None:
                raise invalid(f"{name} has no meaning with on_impact", at=(name,), also=here, allowed=BORN)
        if self.bursts():
            raise invalid("burst has no meaning with on_impact", at=("burst",), also=here, allowed=BORN)
        for name in ("start", "timing"):
            if getattr(self, name) != type(self).model_fields[name].default:
                raise invalid(f"{name} has no meaning with on_impact", at=(name,), also=here, allowed=BORN)
        if self.when_full == "wait":
            raise invalid(
                "waiting births are not possible with on_impact",
                at=("when_full",),
                also=here,
                allowed='"recycle", or nothing',
            )

    @model_validator(mode="before")
    @classmethod
    def _not_pinned(cls, table: Any) -> Any:
        if isinstance(table, dict) and "pinned" in table:
            hint = '[[particles]] pins those that are there from the start; a plane with contact = "stick" holds what lands'
            raise invalid("emitted particles cannot be pinned", at=("pinned",), hint=hint)
        return table

    @model_validator(mode="after")
    def _dies(self) -> Emitter:
        if self.when_full != "recycle" and self.limit is None:
            raise invalid("when_full acts only with a limit", at=("when_full",))
        below = self.die.temperature_below if self.die is not None else None
        if below is not None:
            if self.cooling is None or self.cooling.rate == 0:
                raise invalid(
                    "the particles do not cool, so none of them gets that cold",
                    at=("die", "temperature_below"),
                )
            if below <= self.cooling.ambient:
                raise invalid(
                    "never reached: particles cool towards the ambient temperature",
                    at=("die", "temperature_below"),
                    also=[(("cooling",), f"ambient = {self.cooling.ambient:g} K")],
                )
        return self

    def bursts(self) -> tuple[Burst, ...]:
        """All bursts, as a tuple."""
        return self.burst if isinstance(self.burst, tuple) else (self.burst,)

    def expected(self, duration: float) -> float:
        """Births until a time [s], not rounded; infinite where that is beyond all numbers. Those of impacts are not
        known, and none of them are counted."""
        end = duration if self.stop is None else min(duration, self.stop)
        steady = max(end - self.start, 0.0) * (self.rate or 0.0)
        return steady + sum(burst.count for burst in self.bursts() if burst.at < duration)

    def describe(self) -> str:
        if self.on_impact is not None:
            event = self.on_impact
            on = f" on {', '.join((*event.against, *(event.at or ())))}" if event.against else ""
            return f"{event.count} for each impact of {', '.join(event.of)}{on}"
        assert self.shape is not None
        parts = [f"{self.rate:g}/s"] if self.rate is not None else []
        parts += [f"{burst.count} at {burst.at:g} s" for burst in self.bursts()[:3]]
        return f"{', '.join(parts)} from a {self.shape.type}"

    def doubts(self, duration: float) -> Iterator[str]:
        for burst in self.bursts():
            if burst.at >= duration:
                yield f"the burst of {self.name!r} at {burst.at:.6g} s is never born: the run ends at {duration:.6g} s"

    def births(self, streams: Streams, first: int, birth: Floats) -> Born:
        """Particles first … first + n − 1 of this emitter, born at the given times, shape [n]."""
        if self.shape is None:  # samples of them, at no impact in particular
            return self._born(
                streams, first, np.zeros((3, len(birth))), _unit(np.zeros((3, len(birth)))), 0.0
            )
        position = self.shape.sample(streams, first, len(birth))
        if isinstance(self.direction, str):
            middle = np.asarray(self.shape.middle())[:, None]
            return self._born(streams, first, position, _unit(position - middle), 0.0)
        return self._born(streams, first, position, None, 0.0)

    def births_of(self, streams: Streams, first: int, impacts: Impacts) -> Born:
        """Particles first … first + n − 1 of this emitter, one of each of n impacts, on the surface that was hit.

        Their radii are drawn for them as for all, and keep them off the surface.
        """
        assert self.on_impact is not None
        n, v = impacts.normal, impacts.velocity
        across = (v * n).sum(axis=0) * n
        axis = None
        if isinstance(self.direction, str):
            axis = n if self.direction == "outward" else _unit(v - 2 * across)
        born = self._born(streams, first, impacts.place, axis, self.on_impact.inherit * (v - across))
        return born._replace(position=born.position + born.attributes.get("radius", 0.0) * n)

    def _born(
        self, streams: Streams, first: int, position: Floats, axis: Floats | None, carried: Floats | float
    ) -> Born:
        """Particles first … first + n − 1 at places [3, n]; their cones about axes [3, n], or about the direction."""
        count = position.shape[1]
        velocity = (
            np.asarray(self.velocity)[:, None]
            + carried
            + draw(self.speed, streams["speed"], first, count) * self._directions(streams, first, count, axis)
        )
        given = self.attributes(streams, first, count)
        attributes = {name: np.broadcast_to(np.asarray(each, float), count) for name, each in given.items()}
        lifetime = np.full(count, np.inf)
        if self.lifetime is not None:
            lifetime = draw(self.lifetime, streams["lifetime"], first, count)
        return Born(
            position,
            velocity,
            attributes,
            lifetime,
        )

    def _directions(self, streams: Streams, first: int, count: int, given: Floats | None) -> Floats:
        """Unit vectors evenly spread over cones about given axes [3, n], or about the direction, shape [3, n]."""
        axis = np.empty((3, count))
        if given is not None:
            axis[:] = given
        else:
            assert not isinstance(self.direction, str)
            axis[:] = np.asarray(unit(self.direction))[:, None]
        if self.spread == 0:
            return axis
        # Height over the base of the cone is uniform on a sphere (Archimedes).
        height = 1 - (1 - math.cos(math.radians(self.spread))) * streams["direction.0"].uniform(first, count)
        turn = 2 * np.pi * streams["direction.1"].uniform(first, count)
        ring = np.sqrt(np.maximum(0, 1 - height * height))
        if isinstance(self.direction, str):
            u, v = _frames(axis)
        else:
            fixed = perpendicular(unit(self.direction))
            u, v = np.asarray(fixed[0])[:, None], np.asarray(fixed[1])[:, None]
        return np.asarray(height * axis + ring * np.cos(turn) * u + ring * np.sin(turn) * v)


class Impacts(NamedTuple):
    """Impacts, one for each birth: times [s], shape [n]; places on the surface [m], its normals, and the velocities of what
    hit [m/s], shape [3, n]."""

    times: Floats
    place: Floats
    normal: Floats
    velocity: Floats


def _unit(v: Floats) -> Floats:
    """Unit vectors along vectors [3, n], upwards where these are zero."""
    length = np.sqrt((v * v).sum(axis=0))
    axis = np.divide(v, length, where=length > 0, out=np.zeros_like(v))
    axis[1, length == 0] = 1.0
    return axis


class Born(NamedTuple):
    """New particles: position [m] and velocity [m/s] of shape [3, n]; attributes by name and lifetime [s] of shape [n]."""

    position: Floats
    velocity: Floats
    attributes: dict[str, Floats]
    lifetime: Floats


def _frames(axis: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors perpendicular to each axis, shape [3, n].

    Without branches or square roots near zero: Duff et al., Journal of Computer Graphics Techniques 6(1), 2017.
    """
    x, y, z = axis
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    u = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x])
    v = np.stack([b, sign + y * y * a, -y])
    return u, v
