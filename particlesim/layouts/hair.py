"""Hair: strands that grow from a surface."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Gt, Lt
from pydantic import Field, model_validator

from particlesim.layouts.base import Placed
from particlesim.layouts.mesh import ANGLE, BEND, STRUCTURAL, Mesh, Resolution
from particlesim.model.arrays import Floats, Ints
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres, MetresPerSecond, Number, Vector
from particlesim.model.vectors import unit
from particlesim.sampling.random_streams import Streams
from particlesim.sampling.shapes import AnyShape

Place = Literal["roots", "clamped", "tips"]


class Hair(Mesh):
    """Straight strands with their roots spread over a shape; particles strand after strand, from the root to the tip.

    Structural springs join neighbours of a strand, bend springs every other particle; angles keep it straight.
    """

    kinds: ClassVar[tuple[str, ...]] = (STRUCTURAL, BEND, ANGLE)
    can_be_rigid: ClassVar[bool] = True

    type: Literal["hair"] = "hair"
    strands: Annotated[int, Field(ge=1, le=10**7, strict=True)]
    """Number of strands."""
    count: Resolution
    """Particles of a strand, root and tip included."""
    length: Annotated[Metres, Gt(0)]
    """Length of a strand; of the longest ones where they vary."""
    variation: Annotated[Number, Ge(0), Lt(1)] = 0.0
    """Share of the length by which the shortest strands are shorter than the longest; evenly spread by the seed."""
    roots: AnyShape
    """Where the roots are: spread evenly over a sphere, a disc, a box."""
    direction: Vector[Number] | Literal["outward"] = "outward"
    """Where strands point: away from the middle of the shape, or all one way."""
    velocity: Vector[MetresPerSecond] = (0.0, 0.0, 0.0)
    """Velocity of all its particles."""
    pinned: Place | Annotated[tuple[Place, ...], Field(min_length=1)] | None = "roots"
    """What nothing moves: the roots, or the first two particles of every strand ("clamped"), which keeps its direction."""

    @model_validator(mode="after")
    def _directed(self) -> Hair:
        if self.direction != "outward" and not any(self.direction):
            raise invalid("this vector has no direction", at=("direction",))
        if self.direction == "outward" and self.roots.type in ("point", "disc"):
            raise invalid(
                f"no side of a {self.roots.type} is its outside",
                at=("roots",),
                hint="give the strands a direction, such as [0, 1, 0]",
            )
        return self

    def shape(self) -> tuple[int, ...]:
        return self.strands, self.count

    def edges(self, kind: str) -> Ints:
        index = self._index()
        s = 1 if kind == STRUCTURAL else 2
        return np.stack([index[:, :-s].ravel(), index[:, s:].ravel()], axis=1)

    def hinges(self, kind: str) -> Ints:
        index = self._index()
        return np.stack([index[:, k : self.count - 2 + k].ravel() for k in range(3)], axis=1)

    def _index(self) -> Ints:
        return np.arange(math.prod(self.shape()), dtype=np.int64).reshape(self.shape())

    def place(self, streams: Streams, first: int, count: int) -> Placed:
        index = np.arange(first, first + count)
        strand, along = index // self.count, index % self.count / (self.count - 1)
        begin, end = int(strand[0]), int(strand[-1]) + 1
        length = self.length * (1 - self.variation * streams["length"].uniform(begin, end - begin))
        roots = self.roots.sample(streams, begin, end - begin)
        arm = length * self._directions(roots)
        position = roots[:, strand - begin] + along * arm[:, strand - begin]
        return Placed(position, np.repeat(np.array(self.velocity)[:, None], count, axis=1))

    def _directions(self, roots: Floats) -> Floats:
        """Unit vectors along the strands, shape [3, strands]."""
        if self.direction != "outward":
            return np.repeat(np.array(unit(self.direction))[:, None], roots.shape[1], axis=1)
        away = roots - np.array(self.roots.middle())[:, None]
        length = np.sqrt((away**2).sum(axis=0))
        up = np.array([0.0, 1.0, 0.0])[:, None]  # a root in the very middle has no outside
        return np.where(length > 0, away / np.where(length > 0, length, 1), up)

    def places(self) -> dict[str, Ints]:
        index = self._index()
        return {"roots": index[:, 0], "clamped": index[:, :2].ravel(), "tips": index[:, -1]}
