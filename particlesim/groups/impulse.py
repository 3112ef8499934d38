"""Impulses: kicks that change velocities at once, Δv = j/m."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge
from pydantic import Field

from particlesim.model.base import Model, Name
from particlesim.model.units import NewtonSeconds, Seconds, Vector

Time = Annotated[Seconds, Ge(0)]


class Impulse(Model):
    """A kick to every particle of some groups, at the step nearest to the given time."""

    name: Name | None = None
    """Name for messages."""
    on: tuple[Name, ...] | None = Field(default=None, min_length=1)
    """Groups it kicks; all that have inertia unless given."""
    at: Time | Annotated[tuple[Time, ...], Field(min_length=1)]
    """When: one time or several."""
    impulse: Vector[NewtonSeconds]
    """Impulse j on each particle: its velocity changes by j divided by its mass."""

    def times(self) -> tuple[float, ...]:
        """All times of the kick [s]."""
        return self.at if isinstance(self.at, tuple) else (self.at,)
