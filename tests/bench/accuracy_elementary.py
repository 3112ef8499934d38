"""Errors of the elementary functions against 40 digits, where they are used and where they are hard.

Prints the largest error of each function in each range, in units of the last place (ulp), and the argument it occurs at.
The tests measure the same ranges with fewer points.

    python tests/bench/accuracy_elementary.py [--points 10000] [--seed 1] [FUNCTION ...]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import mpmath
import numpy as np
from numpy.typing import NDArray

from particlesim.compiler import elementary

Numbers = NDArray[np.float64]


class Sample(NamedTuple):
    """Arguments of a function, one array for each."""

    range: str
    arguments: tuple[Numbers, ...]


class Worst(NamedTuple):
    """The largest error [ulp], and where."""

    error: float
    arguments: tuple[float, ...]


class Source:
    """Random arguments, so many at a time."""

    def __init__(self, points: int, seed: int) -> None:
        self.points, self.rng = points, np.random.default_rng(seed)

    def uniform(self, low: float, high: float) -> Numbers:
        return self.rng.uniform(low, high, self.points)

    def positive(self, low: int, high: int) -> Numbers:
        """Of magnitudes from 2**low to 2**high."""
        return np.ldexp(self.uniform(1, 2), self.rng.integers(low, high, self.points))

    def wide(self, low: int, high: int) -> Numbers:
        """The same with both signs."""
        return self.positive(low, high) * self.rng.choice([-1.0, 1.0], self.points)

    def quarter_turns(self, limit: int) -> Numbers:
        """The numbers nearest to multiples of π/2: there a careless reduction loses all digits."""
        k = self.rng.integers(1, limit, self.points).astype(float)
        x = k * (math.pi / 2)
        return x + np.spacing(x) * self.rng.integers(-2, 3, self.points)


def circle(s: Source) -> Iterator[Sample]:
    yield Sample("an eighth of a turn", (s.uniform(-0.8, 0.8),))
    yield Sample("a few turns", (s.uniform(-100, 100),))
    yield Sample("up to 2^30, all magnitudes", (s.wide(-1074, 30),))
    yield Sample("up to 2^30", (s.uniform(-(2.0**30), 2.0**30),))
    yield Sample("beside multiples of pi/2", (s.quarter_turns(2**29),))
    yield Sample("nearest to multiples of pi/2 of all", (hardest_quarter_turns(30),))


def hardest_quarter_turns(limit: int) -> Numbers:
    """The numbers below 2**limit that are nearest to multiples of π/2 of all.

    x = m 2^(e − 52) is near k π/2 where k/m is near 2^(e − 52)/(π/2): the convergents of its continued fraction, with
    multiples that fill the 53 bits of m.
    """
    found = []
    with mpmath.workdps(80):
        for e in range(limit):
            ratio = mpmath.mpf(2) ** (e - 52) / (mpmath.pi / 2)
            m_before, m, rest = 1, 0, ratio
            while m < 2**53:
                if m > 0:
                    found.append(math.ldexp(m * ((2**53 - 1) // m), e - 52))
                whole = int(mpmath.floor(rest))
                m_before, m = m, whole * m + m_before
                rest = 1 / (rest - whole)
    return np.array(found)


def arc(s: Source) -> Iterator[Sample]:
    yield Sample("all", (s.uniform(-1, 1),))
    yield Sample("all magnitudes", (s.wide(-1074, -1),))
    yield Sample("beside 1", (1 - s.positive(-53, -2),))
    yield Sample("beside 1/2", (0.5 + s.wide(-50, -5),))


def hyperbola(s: Source) -> Iterator[Sample]:
    yield Sample("small", (s.uniform(-1, 1),))
    yield Sample("moderate", (s.uniform(-25, 25),))
    yield Sample("all magnitudes", (s.wide(-1074, 9),))
    yield Sample("up to overflow", (s.uniform(700, 710.47),))


def exponential(s: Source) -> Iterator[Sample]:
    yield Sample("small", (s.uniform(-1, 1),))
    yield Sample("moderate", (s.uniform(-40, 80),))
    yield Sample("all magnitudes", (s.wide(-1074, 9),))
    yield Sample("up to overflow", (s.uniform(700, 709.78),))


def logarithm(s: Source) -> Iterator[Sample]:
    yield Sample("from 1/2 to 2", (s.uniform(0.5, 2),))
    yield Sample("beside 1", (1 + s.wide(-52, -2),))
    yield Sample("all magnitudes", (s.positive(-1074, 1023),))


def arc_tangent(s: Source) -> Iterator[Sample]:
    yield Sample("small", (s.uniform(-1, 1),))
    yield Sample("moderate", (s.uniform(-5, 5),))
    yield Sample("all magnitudes", (s.wide(-1074, 1023),))


def angle(s: Source) -> Iterator[Sample]:
    yield Sample("square", (s.uniform(-1, 1), s.uniform(-1, 1)))
    yield Sample("subnormal", (s.wide(-1074, -1020), s.wide(-1074, -1020)))
    yield Sample("up to overflow", (s.wide(1000, 1023), s.wide(1000, 1023)))
    for name, slope in (("1", 1.0), ("tan pi/8", math.sqrt(2) - 1), ("tan 3 pi/8", math.sqrt(2) + 1)):
        x = s.uniform(0.1, 1)
        yield Sample(f"beside slope {name}", (x * slope * (1 + s.wide(-50, -5)), x))


def wide_angle(s: Source) -> Iterator[Sample]:
    yield Sample("all magnitudes", (s.wide(-1074, 1023), s.wide(-1074, 1023)))


def powers(s: Source) -> Iterator[Sample]:
    yield Sample("moderate", (s.uniform(0, 10), s.uniform(-5, 5)))
    yield Sample("whole", (s.uniform(-10, 10), s.rng.integers(-20, 20, s.points).astype(float)))
    for name, x in (
        ("all magnitudes", s.positive(-1074, 1023)),
        ("beside 1", 1 + s.wide(-52, -2)),
        ("beside sqrt 2", s.uniform(1.40, 1.42)),
        ("beside sqrt 1/2", s.uniform(0.70, 0.71)),
    ):
        yield Sample(f"{name}, up to overflow", (x, s.uniform(-708, 709.7) / np.log(x)))


def subnormal_exponential(s: Source) -> Iterator[Sample]:
    yield Sample("subnormal result", (s.uniform(-745.1, -707),))


def subnormal_power(s: Source) -> Iterator[Sample]:
    x = s.positive(-1074, 1023)
    yield Sample("subnormal result", (x, s.uniform(-744, -707) / np.log(x)))


class Case(NamedTuple):
    """A function, the error that it must not exceed [ulp], where to look, and the truth."""

    name: str
    bound: float
    samples: Callable[[Source], Iterator[Sample]]
    truth: Callable[..., Any]


CASES = [
    Case("exp", 0.53, exponential, mpmath.exp),
    Case("exp", 0.76, subnormal_exponential, mpmath.exp),
    Case("expm1", 0.62, exponential, mpmath.expm1),
    Case("log", 0.65, logarithm, mpmath.log),
    Case("power", 0.55, powers, mpmath.power),
    Case("power", 0.76, subnormal_power, mpmath.power),
    Case("sin", 0.72, circle, mpmath.sin),
    Case("cos", 0.72, circle, mpmath.cos),
    Case("tan", 0.90, circle, mpmath.tan),
    Case("asin", 0.67, arc, mpmath.asin),
    Case("acos", 0.67, arc, mpmath.acos),
    Case("atan", 0.67, arc_tangent, mpmath.atan),
    Case("atan2", 0.67, angle, mpmath.atan2),
    Case("atan2", 0.76, wide_angle, mpmath.atan2),
    Case("sinh", 0.65, hyperbola, mpmath.sinh),
    Case("cosh", 0.55, hyperbola, mpmath.cosh),
    Case("tanh", 0.62, hyperbola, mpmath.tanh),
]


def values(name: str, *columns: Sequence[float]) -> list[float]:
    """The function at every row of arguments, in plain Python."""
    function = getattr(elementary, name)
    return [function(*row) for row in zip(*columns, strict=True)]


def worst(sample: Sample, found: list[float], truth: Callable[..., Any]) -> Worst:
    """Where `found` is farthest from the truth, in units of the last place of the truth."""
    largest = Worst(-1.0, ())
    with mpmath.workdps(40):
        for value, *row in zip(found, *(a.tolist() for a in sample.arguments), strict=True):
            true = truth(*map(mpmath.mpf, row))
            ulp = mpmath.mpf(2) ** max(mpmath.frexp(true)[1] - 53, -1074)
            error = float(abs(value - true) / ulp) if math.isfinite(value) else math.inf
            if error > largest.error:
                largest = Worst(error, tuple(row))
    return largest


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("functions", nargs="*", metavar="FUNCTION", help="all, when none is named")
    parser.add_argument("--points", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    for case in CASES:
        if options.functions and case.name not in options.functions:
            continue
        for sample in case.samples(Source(options.points, options.seed)):
            found = worst(sample, values(case.name, *(a.tolist() for a in sample.arguments)), case.truth)
            verdict = "" if found.error <= case.bound else f"  ABOVE {case.bound}"
            where = ", ".join(map(repr, found.arguments))
            print(f"{case.name:6} {sample.range:34} {found.error:.3f} ulp at {where}{verdict}", flush=True)


if __name__ == "__main__":
    main()
