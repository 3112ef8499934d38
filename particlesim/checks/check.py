"""`[[checks]]`: what must hold in a run, so that a scenario is a test."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Le
from pydantic import Field, StringConstraints, model_validator

from particlesim.checks.quantities import (
    FIELD_QUANTITIES,
    VECTOR_FIELDS,
    QuantityDistance,
    QuantityValue,
    is_never_negative,
)
from particlesim.expressions.operations import VARIABLES, Node, Time
from particlesim.expressions.parser import ExpressionError, parse
from particlesim.forces.field import check_constant
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Number, Seconds
from particlesim.sampling.regions import AnyRegion

ORACLES = ("equals", "expression", "reference")
"""What says a value that is expected, each instead of the others and of min and max."""


class Initial(NamedTuple):
    """A component of position or velocity at the start of the run."""

    name: str


INITIAL: dict[str, Node] = {f"{name}0": Initial(name) for name in ("x", "y", "z", "vx", "vy", "vz")}
"""Variables of closed forms in checks, in addition to those of every expression."""


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
    region: AnyRegion | None = None
    """Where particles are looked at; everywhere unless given."""
    at: Annotated[Seconds, Ge(0)] | Literal["end", "always"] = "end"
    """Time of a frame, the end, or every frame, of which the worst counts."""
    min: QuantityValue | None = None
    """Least value allowed."""
    max: QuantityValue | None = None
    """Largest value allowed."""
    equals: QuantityValue | None = None
    """Value expected."""
    expression: Annotated[str, StringConstraints(max_length=2000)] | None = None
    """Value expected, in SI units, as an expression of the time t; of a field without statistic, for every particle, and of
    what it has now (x, vx, m, r, T, ...) and had at the start (x0, y0, z0, vx0, vy0, vz0)."""
    constants: dict[Name, Number] = Field(default_factory=dict)
    """Numbers by name, for use in the expression."""
    reference: Annotated[str, StringConstraints(min_length=1, max_length=1000)] | None = None
    """Trajectory that holds the values expected, relative to the scenario's folder; `psim run --bless` writes it there, or
    below."""
    tolerance: Annotated[QuantityDistance, Ge(0)] | None = None
    """Largest distance from what is expected; none unless given."""
    relative_tolerance: Annotated[float, Ge(0)] | None = None
    """The same as a fraction of the value expected (of a reference, of the largest one in the frame); the larger one of both
    tolerances counts."""

    @model_validator(mode="after")
    def _bounds(self) -> Check:
        oracles = [name for name in ORACLES if getattr(self, name) is not None]
        limits = [name for name in ("min", "max") if getattr(self, name) is not None]
        if not oracles and not limits:
            raise invalid(
                "a check needs a bound",
                allowed="min, max, both of them, or one of equals, expression and reference",
            )
        if oracles:
            for other in (*limits, *oracles[1:]):
                raise invalid(
                    f"{other} and {oracles[0]} contradict each other",
                    at=(other,),
                    also=[((oracles[0],), f"{oracles[0]} is given here")],
                )
        elif self.tolerance is not None or self.relative_tolerance is not None:
            key = "tolerance" if self.tolerance is not None else "relative_tolerance"
            raise invalid(
                f"{key} belongs to equals, expression or reference, none of which is given", at=(key,)
            )
        if self.min is not None and self.max is not None and self.min > self.max:
            raise invalid("min is above max", at=("min",), also=[(("max",), "max")])
        most = "max" if self.max is not None else "equals"
        value = getattr(self, most)
        slack = max(self.tolerance or 0.0, (self.relative_tolerance or 0.0) * abs(value or 0.0))
        if value is not None and value + slack < 0 and is_never_negative(self.quantity):
            raise invalid(f"{self.quantity} is never below 0: this check cannot hold", at=(most,))
        return self

    @model_validator(mode="after")
    def _one_number(self) -> Check:
        if self.statistic == "percentile" and self.percentile is None:
            raise invalid(
                "a percentile needs a number from 0 to 100", at=("statistic",), hint="percentile = 95"
            )
        if self.statistic != "percentile" and self.percentile is not None:
            raise invalid(
                'a percentile needs statistic = "percentile"', at=("percentile",), hint="or leave it out"
            )
        return self

    @model_validator(mode="after")
    def _parses(self) -> Check:
        for name in self.constants:
            check_constant(name)
            if self.expression is None:
                raise invalid("constants belong to an expression, which is not given", at=("constants",))
            if name in INITIAL:
                raise invalid(f"{name!r} is a value at the start", at=("constants", name))
        if self.expression is not None:
            try:
                self.expected()
            except ExpressionError as error:
                raise invalid(
                    error.message,
                    at=("expression",),
                    hint=error.hint,
                    within=(error.offset, error.length),
                ) from None
        return self

    @model_validator(mode="after")
    def _trajectory(self) -> Check:
        if self.reference is not None and not self.reference.endswith(".vtkhdf"):
            raise invalid(
                "a reference is a trajectory", at=("reference",), hint='such as "references/fountain.vtkhdf"'
            )
        return self

    @property
    def of_each(self) -> bool:
        """Whether every particle has a value expected of its own."""
        known = self.quantity in FIELD_QUANTITIES or self.quantity in VECTOR_FIELDS
        return known and self.statistic is None and (self.expression or self.reference) is not None

    def expected(self) -> Node:
        """The expression as a tree of records. Raises ExpressionError."""
        variables = {**VARIABLES, **INITIAL} if self.of_each else {"t": Time()}
        return parse(self.expression or "0", self.constants, variables)

    def allowance(self, expected: float) -> float:
        """Largest distance from an expected value."""
        return max(self.tolerance or 0.0, (self.relative_tolerance or 0.0) * abs(expected))

    def label(self) -> str:
        """Its name, or what it checks: 'max position.y of balls'."""
        if self.name is not None:
            return self.name
        statistic = f"p{self.percentile:g}" if self.statistic == "percentile" else self.statistic
        words = [statistic or "", self.quantity, f"of {self.group}" if self.group is not None else ""]
        if self.region is not None:
            words.append(f"in a {self.region.type.replace('_', '-')}")
        if self.at == "always":
            words.append("always")
        elif self.at != "end":
            words.append(f"at {self.at:g} s")
        return " ".join(word for word in words if word)

    def bound(self) -> str:
        """What is allowed, in words: '≥ 0 and ≤ 1', '= 5 ± 0.1', '= y0 - 4.9*t**2 ± 0.1 %'."""
        if self.equals is not None:
            allowed = self.allowance(self.equals)
            return f"= {self.equals:.9g}" + (f" ± {allowed:.6g}" if allowed else "")
        if self.expression is not None or self.reference is not None:
            relative = 100 * (self.relative_tolerance or 0.0)
            margins = [f"{self.tolerance:.6g}"] if self.tolerance else []
            margins += [f"{relative:.6g} %"] if relative else []
            return f"= {self.expression or self.reference}" + (
                f" ± {' or '.join(margins)}" if margins else ""
            )
        low = [f"≥ {self.min:.9g}"] if self.min is not None else []
        high = [f"≤ {self.max:.9g}"] if self.max is not None else []
        return " and ".join([*low, *high])

    def excess(self, value: float, expected: float | None = None) -> float:
        """How far a value is out of bounds; 0 or less when it is allowed, infinite for a NaN.

        `expected` is what the expression gives.
        """
        if value != value:
            return float("inf")
        wanted = self.equals if expected is None else expected
        if wanted is not None:
            if wanted != wanted:
                return float("inf")
            if value == wanted:
                return -self.allowance(wanted)
            return abs(value - wanted) - self.allowance(wanted)
        return max(
            self.min - value if self.min is not None else -float("inf"),
            value - self.max if self.max is not None else -float("inf"),
        )
