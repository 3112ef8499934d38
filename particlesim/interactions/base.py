"""What an interaction between particles is: a table of a scenario, and the record that its laws take.

A file of a law holds, side by side: the formula and its source, the model (what the scenario file says), the record (what
kernels see), and its laws: a central law (`laws.pair.central_law`), or `pair_force`, its Jacobians and, if there is one, the
potential. `tests/contract` holds every registered interaction to this.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Gt
from pydantic import Field, model_validator

from particlesim.laws.pair import pair_potential
from particlesim.laws.registry import has_law
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres

PairMethod = Literal["auto", "direct"]
"""How forces of pairs may be summed."""


class PairInteraction(Model):
    """An interaction between any two particles, near or far."""

    name: Name | None = None
    """Name by which overrides, the ledger and messages speak of this interaction; its type unless given."""
    on: tuple[Name, ...] | None = Field(default=None, min_length=1)
    """Groups whose particles interact, every pair among all of them; all groups unless given."""
    between: tuple[Name, Name] | None = None
    """Instead: two groups, of which every particle of the first interacts with every one of the second."""
    cutoff: Annotated[Metres, Gt(0)] | None = None
    """Distance beyond which there is no interaction; unless given, it has no end."""
    method: PairMethod = "auto"
    """How forces are summed: `direct` takes every pair, and `auto` what is fastest."""

    formula: ClassVar[str]
    """The law in one line, with the symbols of the parameters."""
    energy: ClassVar[str]
    """Potential energy U of a pair in one line, or 'none: ' and the reason."""

    type: str

    @model_validator(mode="after")
    def _whose(self) -> PairInteraction:
        if self.on is not None and self.between is not None:
            raise invalid(
                "on and between contradict each other", at=("between",), also=[(("on",), "given here")]
            )
        if self.between is not None and self.between[0] == self.between[1]:
            raise invalid(
                "between names one group twice",
                at=("between", 1),
                hint=f'on = ["{self.between[0]}"] takes every pair inside of a group',
            )
        for k, name in enumerate(self.on or ()):
            if name in (self.on or ())[:k]:
                raise invalid(f"group {name!r} is named twice", at=("on", k))
        return self

    @property
    def label(self) -> str:
        """Name for people and for the ledger."""
        return self.name or self.type

    def record(self) -> tuple[Any, ...]:
        """The parameters as kernels take them."""
        raise NotImplementedError

    def conserves(self) -> bool:
        """Whether its forces derive from a potential."""
        return has_law(pair_potential, self.record())

    def needs_velocity(self) -> bool:
        """Whether the law reads velocities, which particles without inertia do not have."""
        return False

    def needs(self) -> frozenset[str]:
        """Attributes of particles that the law reads beside the mass, by name."""
        return frozenset()

    def singular(self) -> bool:
        """Whether the force has no value where two particles are at the same place."""
        return True

    def describe(self) -> str:
        """The interaction in a few words."""
        return self.formula if self.cutoff is None else f"{self.formula}, |l| < {self.cutoff:g} m"


@dataclass(frozen=True)
class PairSet:
    """An interaction among the groups of an island: its name in the ledger, the groups, and the law."""

    name: str
    groups: tuple[str, ...]
    law: PairInteraction

    kind: ClassVar[str] = "interaction"
    verb: ClassVar[str] = "acts between"
    """What the graph calls it, and what it does to groups."""

    @property
    def feeds(self) -> bool:
        """Whether it may bring energy from outside."""
        return not self.law.conserves()

    def describe(self) -> str:
        """The set in a few words."""
        return self.law.describe()

    def needs_velocity(self) -> bool:
        """Whether its forces depend on velocities."""
        return self.law.needs_velocity()
