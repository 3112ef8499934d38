"""`[[checks]]`: what must hold in a run, so that a scenario is a test."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field, StringConstraints, model_validator

from particlesim.crossfield import invalid
from particlesim.model import Model, Name
from particlesim.trajectory.fields import FIELDS
from particlesim.units import Seconds

AXES = ("x", "y", "z")
COUNTS = ("count", "born", "died")
MOTION = ("kinetic", "potential", "energy", "energy.drift")
VECTORS = ("momentum", "angular_momentum")

TOTALS = (
    *COUNTS,
    *MOTION,
    *(name for vector in VECTORS for name in (vector, *(f"{vector}.{axis}" for axis in AXES))),
)
"""Quantities of the whole simulation; 'potential.FORCE' is one more for every force that has a potential."""

FIELD_QUANTITIES = tuple(
    name
    for spec in FIELDS.values()
    if spec.kind == "float"
    for name in ([spec.name] if spec.components == 1 else [f"{spec.name}.{axis}" for axis in AXES])
)
"""Quantities of every particle, which a statistic makes one number."""


class Check(Model):
    """A bound on a quantity of the run. When one is broken, the run has failed: exit code 1."""

    name: Name | None = None
    """Name for reports."""
    quantity: Annotated[str, StringConstraints(min_length=1, max_length=200)]
    """What is checked: a total such as `energy.drift`, or a field of the particles such as `position.y`."""
    statistic: Literal["min", "max", "mean", "percentile"] | None = None
    """What makes one number of a field."""
    percentile: Annotated[float, Ge(0), Le(100)] | None = None
    """Which percentile, between the nearest particles linearly."""
    group: Name | None = None
    """Group whose particles are looked at; all unless given."""
    at: Annotated[Seconds, Ge(0)] | Literal["end", "always"] = "end"
    """Time of a frame, the end, or every frame, of which the worst counts."""
    min: float | None = None
    """Least value allowed, in SI units."""
    max: float | None = None
    """Largest value allowed, in SI units."""
    equals: float | None = None
    """Value expected, in SI units."""
    tolerance: Annotated[float, Ge(0)] | None = None
    """Largest distance from `equals`; none unless given."""
    relative_tolerance: Annotated[float, Ge(0)] | None = Field(default=None)
    """Largest distance from `equals` as a fraction of it; the larger one of both tolerances counts."""

    @model_validator(mode="after")
    def _bounds(self) -> Check:
        if self.equals is None and self.min is None and self.max is None:
            raise invalid("a check needs a bound", allowed="min, max, both of them, or equals")
        if self.equals is not None:
            for other in ("min", "max"):
                if getattr(self, other) is not None:
                    raise invalid(
                        f"{other} and equals contradict each other",
                        at=(other,),
                        also=[(("equals",), "equals is given here")],
                    )
        elif self.tolerance is not None or self.relative_tolerance is not None:
            key = "tolerance" if self.tolerance is not None else "relative_tolerance"
            raise invalid(f"{key} belongs to equals, which is not given", at=(key,))
        if self.min is not None and self.max is not None and self.min > self.max:
            raise invalid("min is above max", at=("min",), also=[(("max",), "max")])
        return self

    @model_validator(mode="after")
    def _one_number(self) -> Check:
        if self.statistic == "percentile" and self.percentile is None:
            raise invalid("which percentile?", at=("statistic",), hint="percentile = 95")
        if self.statistic != "percentile" and self.percentile is not None:
            raise invalid(
                'a percentile needs statistic = "percentile"', at=("percentile",), hint="or leave it out"
            )
        return self

    @property
    def allowance(self) -> float:
        """Largest distance from `equals`."""
        return max(self.tolerance or 0.0, (self.relative_tolerance or 0.0) * abs(self.equals or 0.0))

    def label(self) -> str:
        """Its name, or what it checks: 'max position.y of balls'."""
        if self.name is not None:
            return self.name
        statistic = f"p{self.percentile:g}" if self.statistic == "percentile" else self.statistic
        words = [statistic or "", self.quantity, f"of {self.group}" if self.group is not None else ""]
        if self.at == "always":
            words.append("always")
        elif self.at != "end":
            words.append(f"at {self.at:g} s")
        return " ".join(word for word in words if word)

    def bound(self) -> str:
        """What is allowed, in words: '≥ 0 and ≤ 1', '= 5 ± 0.1'."""
        if self.equals is not None:
            return f"= {self.equals:.9g}" + (f" ± {self.allowance:.6g}" if self.allowance else "")
        low = [f"≥ {self.min:.9g}"] if self.min is not None else []
        high = [f"≤ {self.max:.9g}"] if self.max is not None else []
        return " and ".join([*low, *high])

    def excess(self, value: float) -> float:
        """How far a value is out of bounds; 0 or less when it is allowed, infinite for a NaN."""
        if value != value:
            return float("inf")
        if self.equals is not None:
            if value == self.equals:
                return -self.allowance
            return abs(value - self.equals) - self.allowance
        return max(
            self.min - value if self.min is not None else -float("inf"),
            value - self.max if self.max is not None else -float("inf"),
        )
