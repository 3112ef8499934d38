"""Shapes in which particles begin: points chosen uniformly by volume, or by area for flat ones."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray
from pydantic import field_validator, model_validator

from particlesim.model.arrays import Floats
from particlesim.model.base import Model
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, Vector
from particlesim.model.variants import Tagged
from particlesim.model.vectors import perpendicular, unit
from particlesim.sampling.random_streams import Streams

Vector3 = tuple[float, float, float]


class Shape(Model):
    """Base of all shapes."""

    def sample(self, streams: Streams, first: int, count: int) -> Floats:
        """Points first … first + count − 1 [m], shape [3, count]."""
        raise NotImplementedError

    def contains(self, position: Floats) -> NDArray[np.bool_]:
        """Which points [m], shape [3, n], are inside or on it, but for rounding: a millionth of its size counts as in."""
        raise NotImplementedError

    def middle(self) -> Vector3:
        """The center, from which "outward" points [m]."""
        raise NotImplementedError

    def half_sizes(self) -> Vector3:
        """How far it reaches from its center along each axis [m]."""
        return 0.0, 0.0, 0.0


def _uniforms(streams: Streams, first: int, count: int, number: int) -> list[Floats]:
    return [streams[f"shape.{k}"].uniform(first, count) for k in range(number)]


def directions(u: Floats, v: Floats) -> Floats:
    """Unit vectors spread evenly over the sphere from two uniform numbers each, shape [3, n] (Archimedes)."""
    height = 1 - 2 * u
    ring = np.sqrt(np.maximum(0, 1 - height * height))
    turn = 2 * np.pi * v
    return np.stack([ring * np.cos(turn), height, ring * np.sin(turn)])


class Point(Shape):
    """A single place."""

    type: Literal["point"] = "point"
    position: Vector[Metres]
    """The place."""

    def sample(self, streams: Streams, first: int, count: int) -> Floats:
        return np.repeat(np.asarray(self.position)[:, None], count, axis=1)

    def middle(self) -> Vector3:
        return self.position


class Box(Shape):
    """An axis-aligned box; flat where min and max agree."""

    type: Literal["box"] = "box"
    min: Vector[Metres]
    """Corner with the smallest coordinates."""
    max: Vector[Metres]
    """Corner with the largest coordinates."""

    @model_validator(mode="after")
    def _ordered(self) -> Box:
        for k, axis in enumerate("xyz"):
            if self.max[k] < self.min[k]:
                raise invalid(
                    f"max is less than min in {axis}", at=("max", k), also=[(("min", k), "min is given here")]
                )
        return self

    def sample(self, streams: Streams, first: int, count: int) -> Floats:
        low, high = np.asarray(self.min)[:, None], np.asarray(self.max)[:, None]
        return np.asarray(low + (high - low) * np.stack(_uniforms(streams, first, count, 3)))

    def contains(self, position: Floats) -> NDArray[np.bool_]:
        low, high = np.asarray(self.min)[:, None], np.asarray(self.max)[:, None]
        margin = 1e-6 * (high - low).max()
        return np.asarray(((position >= low - margin) & (position <= high + margin)).all(axis=0))

    def middle(self) -> Vector3:
        a, b = self.min, self.max
        return (a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2

    def half_sizes(self) -> Vector3:
        a, b = self.min, self.max
        return (b[0] - a[0]) / 2, (b[1] - a[1]) / 2, (b[2] - a[2]) / 2


class Ball(Shape):
    """A solid sphere."""

    type: Literal["ball"] = "ball"
    center: Vector[Metres] = (0.0, 0.0, 0.0)
    """Center."""
    radius: Annotated[Metres, Gt(0)]
    """Radius."""

    def sample(self, streams: Streams, first: int, count: int) -> Floats:
        u, v, w = _uniforms(streams, first, count, 3)
        return np.asarray(np.asarray(self.center)[:, None] + self.radius * np.cbrt(w) * directions(u, v))

    def contains(self, position: Floats) -> NDArray[np.bool_]:
        distance = np.sqrt(((position - np.asarray(self.center)[:, None]) ** 2).sum(axis=0))
        return np.asarray(distance <= self.radius * (1 + 1e-6))

    def middle(self) -> Vector3:
        return self.center

    def half_sizes(self) -> Vector3:
        return (self.radius,) * 3


class Sphere(Shape):
    """The surface of a sphere."""

    type: Literal["sphere"] = "sphere"
    center: Vector[Metres] = (0.0, 0.0, 0.0)
    """Center."""
    radius: Annotated[Metres, Gt(0)]
    """Radius."""

    def sample(self, streams: Streams, first: int, count: int) -> Floats:
        u, v = _uniforms(streams, first, count, 2)
        return np.asarray(np.asarray(self.center)[:, None] + self.radius * directions(u, v))

    def middle(self) -> Vector3:
        return self.center

    def half_sizes(self) -> Vector3:
        return (self.radius,) * 3


class Shell(Shape):
    """The space between two concentric spheres."""

    type: Literal["shell"] = "shell"
    center: Vector[Metres] = (0.0, 0.0, 0.0)
    """Center."""
    inner: Annotated[Metres, Ge(0)]
    """Inner radius."""
    outer: Annotated[Metres, Gt(0)]
    """Outer radius."""

    @model_validator(mode="after")
    def _ordered(self) -> Shell:
        if self.outer < self.inner:
            raise invalid(
                "outer is less than inner", at=("outer",), also=[(("inner",), "inner is given here")]
            )
        return self

    def sample(self, streams: Streams, first: int, count: int) -> Floats:
        u, v, w = _uniforms(streams, first, count, 3)
        radius = np.cbrt(self.inner**3 + (self.outer**3 - self.inner**3) * w)
        return np.asarray(np.asarray(self.center)[:, None] + radius * directions(u, v))

    def contains(self, position: Floats) -> NDArray[np.bool_]:
        distance = np.sqrt(((position - np.asarray(self.center)[:, None]) ** 2).sum(axis=0))
        margin = 1e-6 * self.outer
        return np.asarray((distance >= self.inner - margin) & (distance <= self.outer + margin))

    def middle(self) -> Vector3:
        return self.center

    def half_sizes(self) -> Vector3:
        return (self.outer,) * 3


class Disc(Shape):
    """A flat disc."""

    type: Literal["disc"] = "disc"
    center: Vector[Metres] = (0.0, 0.0, 0.0)
    """Center."""
    radius: Annotated[Metres, Gt(0)]
    """Radius."""
    normal: Vector[float] = (0.0, 1.0, 0.0)
    """Direction perpendicular to the disc; its length does not matter."""

    @field_validator("normal")
    @classmethod
    def _has_direction(cls, normal: Vector3) -> Vector3:
        unit(normal)
        return normal

    def sample(self, streams: Streams, first: int, count: int) -> Floats:
        u, v = _uniforms(streams, first, count, 2)
        a, b = perpendicular(unit(self.normal))
        radius, turn = self.radius * np.sqrt(u), 2 * np.pi * v
        flat = np.outer(a, radius * np.cos(turn)) + np.outer(b, radius * np.sin(turn))
        return np.asarray(np.asarray(self.center)[:, None] + flat)

    def middle(self) -> Vector3:
        return self.center

    def half_sizes(self) -> Vector3:
        x, y, z = (self.radius * math.sqrt(max(0.0, 1 - part * part)) for part in unit(self.normal))
        return x, y, z


AnyShape = Annotated[Point | Box | Ball | Sphere | Shell | Disc, Tagged("type")]
