"""Distributions: what may stand for a number wherever particles are sampled.

Each turns uniform random numbers into values by its quantile function (the inverse of the cumulative distribution), one
for one, so that value k depends on number k alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Generic, Literal, TypeVar, Union

import numpy as np
from annotated_types import Ge, Gt
from pydantic import Field, model_validator

from particlesim.model.arrays import Floats
from particlesim.model.base import Model
from particlesim.model.mistakes import invalid
from particlesim.model.units import Number, Unit
from particlesim.model.variants import Tagged
from particlesim.sampling.random_streams import Stream

Q = TypeVar("Q")
D = TypeVar("D")


class Distribution(Model):
    """Base of all distributions."""

    @classmethod
    def model_parametrized_name(cls, params: tuple[Any, ...]) -> str:
        """'Uniform length' instead of Python's spelling, for messages and the schema."""
        marks = getattr(params[0], "__metadata__", ())
        words = [m.noun if isinstance(m, Unit) else repr(m).replace("(", " ").replace(")", "") for m in marks]
        return " ".join([cls.__name__, *words])

    def quantile(self, u: Floats) -> Floats:
        """Values at cumulative probabilities u in (0, 1), shape [n]."""
        raise NotImplementedError

    def support(self) -> tuple[float, float]:
        """Smallest and largest possible value."""
        raise NotImplementedError


class Uniform(Distribution, Generic[Q]):
    """Uniform between low and high."""

    type: Literal["uniform"] = "uniform"
    low: Q
    """Smallest value."""
    high: Q
    """Largest value."""

    @model_validator(mode="after")
    def _ordered(self) -> Uniform[Q]:
        if not self.low <= self.high:  # type: ignore[operator]
            raise invalid("high is less than low", at=("high",), also=[(("low",), "low is given here")])
        return self

    def quantile(self, u: Floats) -> Floats:
        low, high = self.support()
        return low + (high - low) * u

    def support(self) -> tuple[float, float]:
        return float(self.low), float(self.high)  # type: ignore[arg-type]


class Normal(Distribution, Generic[Q, D]):
    """Normal distribution, cut off at min and max where given."""

    type: Literal["normal"] = "normal"
    mean: Q
    """Mean of the uncut distribution."""
    std: D
    """Standard deviation of the uncut distribution."""
    min: Q | None = None
    """Smallest value."""
    max: Q | None = None
    """Largest value."""

    @model_validator(mode="after")
    def _ordered(self) -> Normal[Q, D]:
        low, high = self.support()
        if not low < high:
            raise invalid("max must be greater than min", at=("max",), also=[(("min",), "min is given here")])
        return self

    def quantile(self, u: Floats) -> Floats:
        from scipy.special import ndtr, ndtri

        mean, std = float(self.mean), float(self.std)  # type: ignore[arg-type]
        low, high = self.support()
        if std == 0:
            return np.clip(np.full_like(u, mean), low, high)
        below, above = ndtr((low - mean) / std), ndtr((high - mean) / std)
        return np.clip(mean + std * ndtri(below + u * (above - below)), low, high)

    def support(self) -> tuple[float, float]:
        low = -np.inf if self.min is None else float(self.min)  # type: ignore[arg-type]
        high = np.inf if self.max is None else float(self.max)  # type: ignore[arg-type]
        return low, high


class LogNormal(Distribution, Generic[Q]):
    """Log-normal: the logarithm of the value is normal around ln(median)."""

    type: Literal["lognormal"] = "lognormal"
    median: Q
    """Median of the values."""
    sigma: Annotated[Number, Ge(0)]
    """Standard deviation of the logarithm."""

    @model_validator(mode="after")
    def _positive(self) -> LogNormal[Q]:
        if not float(self.median) > 0:  # type: ignore[arg-type]
            raise invalid("the median of a log-normal distribution is positive", at=("median",))
        return self

    def quantile(self, u: Floats) -> Floats:
        from scipy.special import ndtri

        return np.asarray(float(self.median) * np.exp(self.sigma * ndtri(u)))  # type: ignore[arg-type]

    def support(self) -> tuple[float, float]:
        return np.nextafter(0.0, 1.0), np.inf


class Exponential(Distribution, Generic[Q]):
    """Exponential distribution with the given mean."""

    type: Literal["exponential"] = "exponential"
    mean: Q
    """Mean of the values."""

    @model_validator(mode="after")
    def _positive(self) -> Exponential[Q]:
        if not float(self.mean) > 0:  # type: ignore[arg-type]
            raise invalid("the mean of an exponential distribution is positive", at=("mean",))
        return self

    def quantile(self, u: Floats) -> Floats:
        return np.asarray(-float(self.mean) * np.log1p(-u))  # type: ignore[arg-type]

    def support(self) -> tuple[float, float]:
        return np.nextafter(0.0, 1.0), np.inf


class Choice(Distribution, Generic[Q]):
    """One of several values, with equal or given weights."""

    type: Literal["choice"] = "choice"
    values: tuple[Q, ...] = Field(min_length=1)
    """The values."""
    weights: tuple[Annotated[Number, Gt(0)], ...] | None = None
    """How often each is drawn, in proportion; equally often unless given."""

    @model_validator(mode="after")
    def _as_many(self) -> Choice[Q]:
        if self.weights is not None and len(self.weights) != len(self.values):
            raise invalid(
                f"{len(self.weights)} weights for {len(self.values)} values",
                at=("weights",),
                also=[(("values",), "the values are here")],
            )
        return self

    def quantile(self, u: Floats) -> Floats:
        values = np.asarray(self.values, dtype=float)
        weights = np.ones(len(values)) if self.weights is None else np.asarray(self.weights)
        edges = np.cumsum(weights) / np.sum(weights)
        return np.asarray(values[np.minimum(np.searchsorted(edges, u, side="right"), len(values) - 1)])

    def support(self) -> tuple[float, float]:
        values = [float(v) for v in self.values]  # type: ignore[arg-type]
        return min(values), max(values)


def _difference(quantity: Any) -> Any:
    """The type of differences of a quantity: no negative ones, and no offsets of temperature scales."""
    units = [mark for mark in quantity.__metadata__ if isinstance(mark, Unit)]
    return Annotated[float, units[0].difference(), Ge(0)]


if TYPE_CHECKING:
    Sampled = Union[Q, Distribution]  # noqa: UP007
else:

    class Sampled:
        """A number, or a distribution to sample it from: `Sampled[Metres]`."""

        def __class_getitem__(cls, quantity: Any) -> Any:
            # typing cannot substitute a type variable inside generic models, hence by hand.
            def choices() -> Any:
                spread = _difference(quantity)
                return (
                    Uniform[quantity]
                    | Normal[quantity, spread]
                    | LogNormal[quantity]
                    | Exponential[quantity]
                    | Choice[quantity]
                )

            return quantity | Annotated[Distribution, Tagged("type", choices)]


def draw(value: float | Distribution, stream: Stream, first: int, count: int) -> Floats:
    """Values first … first + count − 1 of an attribute, shape [count]."""
    if isinstance(value, Distribution):
        return value.quantile(stream.uniform(first, count))
    return np.full(count, float(value))


def smallest(value: float | tuple[float, ...] | Distribution) -> float:
    """The smallest value that an attribute can have."""
    if isinstance(value, tuple):
        return min(value)
    return value.support()[0] if isinstance(value, Distribution) else float(value)


def largest(value: float | Distribution) -> float:
    """The largest value that an attribute can have."""
    return value.support()[1] if isinstance(value, Distribution) else float(value)
