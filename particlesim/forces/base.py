"""What a force is: a table of a scenario, and the record that its laws take.

A force file holds, side by side: the formula and its source, the model (what the scenario file says), the record (what
kernels see), and the laws `force`, `force_dx` = ∂f/∂x, `force_dv` = ∂f/∂v and, if the force derives from one,
`potential` U with F = −∇U. `tests/contract` holds every registered force to this.
"""

from __future__ import annotations

from typing import Any, ClassVar

from pydantic import Field

from particlesim.laws.registry import Particle
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import Path


class Force(Model):
    """A force on single particles."""

    name: Name | None = None
    """Name by which overrides, the ledger and messages speak of this force; its type unless given."""
    on: tuple[Name, ...] | None = Field(default=None, min_length=1)
    """Groups it acts on; all unless given."""

    formula: ClassVar[str]
    """The law in one line, with the symbols of the parameters."""
    energy: ClassVar[str]
    """Potential energy U in one line, or 'none: ' and the reason."""
    on_surfaces: ClassVar[bool] = False
    """Whether it acts on the triangles of a surface instead of single particles."""

    by_place: ClassVar[bool] = False
    """Whether it depends on the place, and so is not the same at the images of a periodic box."""
    uniform: ClassVar[bool] = False
    """Whether it is one acceleration for all, of which a scenario needs one alone."""

    type: str

    @property
    def label(self) -> str:
        """Name for people and for the ledger."""
        return self.name or self.type

    def record(self) -> tuple[Any, ...]:
        """The parameters as kernels take them."""
        raise NotImplementedError

    def over(self, label: str, group: str) -> Any:
        """What it is to the triangles of a group, under its name in the ledger; of forces on surfaces."""
        raise NotImplementedError

    def needs_velocity(self) -> bool:
        """Whether the law reads the velocity, which a particle without inertia does not have."""
        return False

    def needs(self) -> frozenset[str]:
        """Attributes of particles that the law reads in addition to the mass, by name."""
        return frozenset()

    def changes(self) -> bool:
        """Whether it changes while a particle stands still: with time, or with the temperature."""
        return False

    def jump(self) -> tuple[Path, str] | None:
        """The key of an expression by which the force jumps somewhere, and what in it does; None if none is seen to."""
        return None

    def kink(self) -> str | None:
        """Where the force or a low derivative of it jumps, which costs a method its order; None if it is smooth."""
        return None

    def excess(self, p: Particle) -> float:
        """How far a particle is beyond where the law holds, in its measure; up to 1 inside. Looked at in every frame if
        `limited`."""
        return 0.0

    def limited(self) -> bool:
        """Whether it is known where the law stops holding."""
        return False

    def beyond(self, excess: float, time: float) -> str:
        """What to tell of the largest `excess`, reached at a time [s]."""
        raise NotImplementedError

    def has_zero(self) -> bool:
        """Whether its potential, if it has one, has a zero of its own, so that its value means something and not only its
        differences."""
        return False
