"""What an interaction between particles is: a table of a scenario, and the record that its laws take.

A file of a law holds, side by side: the formula and its source, the model (what the scenario file says), the record (what
kernels see), and its laws: a central law (`laws.pair.central_law`), or `pair_force`, its Jacobians and, if there is one, the
potential. `tests/contract` holds every registered interaction to this.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from annotated_types import Gt
from pydantic import Field, model_validator

from particlesim.bonds.base import Ties
from particlesim.laws.pair import EnergyShifted, ForceShifted, pair_potential
from particlesim.laws.registry import has_law
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Metres
from particlesim.model.vectors import square

PairMethod = Literal["auto", "direct", "neighbours", "tree", "mesh"]
"""How forces of pairs may be summed."""
Shift = Literal["none", "energy", "force"]


class Jump(NamedTuple):
    """A jump of the energy [J] or of the force [N] of a pair: of what, at which distance [m], and by how much."""

    of: str
    at: float
    size: float  # "energy" comes before "force", and near before far, in the order of tuples


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
    shift: Shift = "none"
    """What is taken from the law for a better end at the cutoff: its `energy` there, which leaves forces as they are, or its
    `force`, so that both energy and force end at 0."""
    method: PairMethod = "auto"
    """How forces are summed: `direct` takes every pair, `neighbours` only those within the cutoff, by lists, `tree` lets far
    particles act by multipoles, `mesh` takes all images of a periodic box, and `auto` takes what is fastest, with `ias15`
    none whose forces jump, as those of a tree do."""

    formula: ClassVar[str]
    """The law in one line, with the symbols of the parameters."""
    energy: ClassVar[str]
    """Potential energy U of a pair in one line, or 'none: ' and the reason."""
    by_group: ClassVar[tuple[str, ...]] = ()
    """Keys that may be tables by group."""

    type: str

    @model_validator(mode="after")
    def _whose(self) -> PairInteraction:
        if self.on is not None and self.between is not None:
            raise invalid(
                "on and between contradict each other",
                at=("between",),
                also=[(("on",), "given here")],
                allowed='on = ["one", "other"] for all pairs in these groups, or between = ["one", "other"]',
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

    @model_validator(mode="after")
    def _shifts(self) -> PairInteraction:
        if self.shift != "none" and self.cutoff is None:
            raise invalid("a shift needs a cutoff", at=("shift",), allowed=self._some_cutoff())
        return self

    @model_validator(mode="after")
    def _has_multipoles(self) -> PairInteraction:
        if self.method == "tree" and (why := self.lacks_multipoles()):
            raise invalid(
                f"{self.type} cannot be summed with a tree: {why}",
                at=("method",),
                allowed=self._pair_by_pair(),
            )
        return self

    @model_validator(mode="after")
    def _has_waves(self) -> PairInteraction:
        if self.method == "mesh" and (why := self.lacks_a_mesh()):
            raise invalid(
                f"{self.type} cannot be summed with a mesh: {why}",
                at=("method",),
                allowed=self._pair_by_pair(),
            )
        return self

    @model_validator(mode="after")
    def _ends(self) -> PairInteraction:
        if self.method == "neighbours" and self.reach() is None and not self.touching():
            raise invalid(
                'method = "neighbours" needs a distance beyond which there is no interaction',
                at=("method",),
                allowed=self._some_cutoff(),
            )
        return self

    def length(self) -> float | None:
        """The length of the law [m], in which distances are counted; None if it has none."""
        return None

    def product(self) -> tuple[str, float] | None:
        """The attribute of both particles whose product is in the law, "mass" or "charge", and the factor before it; None
        without such a product."""
        return None

    def _some_cutoff(self) -> str:
        """An example of a cutoff of the size of what interacts."""
        length = self.length()
        return f"cutoff = {2.5 * (length or 1):.3g} (m), say"

    def _pair_by_pair(self) -> str:
        """The methods that look at one pair after the other."""
        ends = self.reach() is not None or self.touching()
        return (
            '"auto", "direct", "neighbours"' if ends else '"auto", "direct"; with a cutoff also "neighbours"'
        )

    @property
    def label(self) -> str:
        """Name for people and for the ledger."""
        return self.name or self.type

    def record(self) -> tuple[Any, ...]:
        """The parameters as kernels take them, of a law without an end."""
        raise NotImplementedError

    def cut_record(self) -> tuple[Any, ...]:
        """The parameters of the law with its shift."""
        if self.shift == "none" or self.cutoff is None:
            return self.record()
        shifted = EnergyShifted if self.shift == "energy" else ForceShifted
        return shifted(self.record(), square(self.cutoff))

    def in_steps(self, dt: float, seed: int) -> tuple[Any, ...]:
        """The parameters for a run with steps of dt [s] and a seed, which laws with random forces need."""
        return self.cut_record()

    def lacks_multipoles(self) -> str | None:
        """Why far particles cannot act by multipoles; None if they can."""
        return "its law is not that of 1/r, so it has no multipoles"

    def lacks_a_mesh(self) -> str | None:
        """Why its sum over all images of a periodic box cannot be found with a mesh; None if it can."""
        return "its law is not that of 1/r, whose images have a sum by Ewald"

    def random(self) -> bool:
        """Whether its forces are random, and read the ids of particles."""
        return False

    def jump(self) -> Jump | None:
        """Where its energy, or else its force, jumps; None if it does not."""
        return None

    @property
    def rubs(self) -> bool:
        """Whether there is friction where two particles touch."""
        return False

    @property
    def rolls(self) -> float:
        """Coefficient of rolling friction where two particles touch."""
        return 0.0

    @property
    def soft(self) -> bool:
        """Whether contacts last, so that colliders act by the same law."""
        return False

    @property
    def must_part(self) -> bool:
        """Whether the scenario asks that particles which overlap at the start are moved apart."""
        return False

    @property
    def by_impulses(self) -> bool:
        """Whether it changes velocities at once where particles touch, by impulses and not by forces."""
        return False

    @property
    def is_contact(self) -> bool:
        """Whether particles touch by it, softly or by impulses."""
        return self.soft or self.by_impulses

    @property
    def by_surfaces(self) -> bool:
        """Whether layouts that have triangles or edges touch with them."""
        return False

    def remembers(self) -> bool:
        """Whether it looks at the ends of steps alone, or keeps what it has to know from one step to the next."""
        return False

    def balanced_constant(self) -> float | None:
        """The constant of gravitation that layouts in balance must have been made for; None where it is no gravity."""
        return None

    def doubts(self, lightest: tuple[float, float] | None, dt: float) -> Iterable[str]:
        """A sentence for each choice that is legal and seldom meant, before a run with steps of dt [s]; `lightest` are the
        mass [kg] and the radius [m] of the lightest particle that has a radius, None if none has."""
        return ()

    def changes(self) -> bool:
        """Whether forces between particles at rest change with time."""
        return False

    def reach(self) -> float | None:
        """Distance beyond which it does nothing [m]; None if it has no end."""
        return self.cutoff

    def ends_smoothly(self) -> bool:
        """Whether its force goes to 0 at its reach, as smoothly as methods of high order need it."""
        return self.shift == "force"

    def touching(self) -> bool:
        """Whether it acts only where two particles touch, within the sum of their radii."""
        return False

    def beyond(self, radius: float) -> float:
        """How far the surfaces of particles of at most a radius may be apart and still act on each other, once they have
        touched [m]."""
        return 0.0

    def numbers_of(self, group: str) -> tuple[float, float]:
        """The two numbers `a` and `b` that the law keeps of every particle of a group."""
        return 0.0, 0.0

    def lacks(self, group: str) -> tuple[str, str] | None:
        """The key that says nothing of a group, though it must, and what it is; None if nothing is missing."""
        return None

    def conserves(self) -> bool:
        """Whether its forces derive from a potential."""
        return has_law(pair_potential, self.record())

    def stores(self) -> bool:
        """Whether pairs have an energy, which the ledger has, with or without losses."""
        return self.conserves()

    def feeds(self) -> bool:
        """Whether it may bring energy from outside."""
        return not self.conserves()

    def needs_velocity(self) -> bool:
        """Whether the law reads velocities, which particles without inertia do not have."""
        return False

    def needs(self) -> frozenset[str]:
        """Attributes of particles that the law reads in addition to the mass, by name."""
        return frozenset()

    def singular(self) -> bool:
        """Whether the force grows beyond all bounds as two particles come together."""
        return True

    def everywhere(self) -> bool:
        """Whether the law has a value where two particles are at the same place; elsewhere psim takes 0 there, as the force
        has no direction."""
        return False

    def describe(self) -> str:
        """The interaction in a few words."""
        reach = self.reach()
        return self.formula if reach is None else f"{self.formula}, |l| < {reach:g} m"


@dataclass(frozen=True)
class PairSet(Ties):
    """An interaction among the groups of an island: its name in the ledger, the groups, and the law."""

    name: str
    groups: tuple[str, ...]
    law: PairInteraction

    kind: ClassVar[str] = "interaction"
    verb: ClassVar[str] = "acts between"

    @property
    def feeds(self) -> bool:
        return self.law.feeds()

    def describe(self) -> str:
        return self.law.describe()

    def needs_velocity(self) -> bool:
        return self.law.needs_velocity() and not self.law.by_impulses  # these come between steps
