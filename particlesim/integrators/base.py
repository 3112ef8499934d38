"""The families of methods: explicit Runge–Kutta, kick-drift compositions, and Störmer's two-step rule.

A method here is data. The engine compiles it twice from the same numbers: fused, for particles that step alone, and by
stages, for particles that pull on each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.polynomial import Polynomial

from particlesim.integrators.options import FixedStep, Options
from particlesim.integrators.trees import Condition, order_conditions


class RungeKuttaRecord(NamedTuple):
    """What kernels see of a tableau. Zeros are None, so that the compiler drops their terms."""

    a: tuple[tuple[float | None, ...], ...]
    b: tuple[float | None, ...]
    c: tuple[float, ...]


class CompositionRecord(NamedTuple):
    """What kernels see of a composition: kick and drift fractions of the step; None where there is none."""

    kicks: tuple[float | None, ...]
    drifts: tuple[float | None, ...]
    keeps: tuple[float, float, float] | None = None
    """What a method of fourth order keeps of a mass on a spring beside its energy: c₄, c₆ and c₈ of the factor
    1 + c₄ (ω h)⁴ + c₆ (ω h)⁶ + c₈ (ω h)⁸ of the energy of the spring; None with methods of another order."""


class VerletRecord(NamedTuple):
    """What kernels see of Störmer's rule: one half, in the precision of the run."""

    half: float


@dataclass(frozen=True)
class Method:
    """What every method tells: its name in scenarios, order, and what is true of it.

    `first_order` names the method that takes its place for particles without inertia, whose state is the position alone
    (kicks and drifts need both position and velocity).
    """

    name: str
    order: int
    summary: str
    symplectic: bool = False
    reversible: bool = False
    first_order: str | None = None

    adaptive: ClassVar[bool] = False
    """Whether it chooses its steps by their error."""
    together: ClassVar[bool] = False
    """Whether all particles of a group take its steps together, even where nothing joins them."""
    revisits: ClassVar[bool] = True
    """Whether forces may be asked for again where particles have not moved since."""
    by_modes: ClassVar[bool] = True
    """Whether a step is too long where it lets modes of the linearised forces grow; not with methods that choose their steps
    (`adaptive`), nor with those that follow orbits exactly."""
    smooth: ClassVar[bool] = False
    """Whether it computes to rounding, and finds no step across a force that jumps."""
    options: ClassVar[type[Options]] = FixedStep
    """The model of what a scenario may say of it; its fields beside `method` are fields here."""

    def configured(self, options: Options) -> Self:
        """The method with the options of a scenario."""
        return replace(self, **options.settings())

    @property
    def label(self) -> str:
        """Its name, with its options where it has some: 'rk45 (tolerance = 1e-06)'."""
        names = [name for name in self.options.model_fields if name != "method"]
        words = (
            f"{name} = {_shown(getattr(self, name))}" for name in names if getattr(self, name) is not None
        )
        text = ", ".join(words)
        return f"{self.name} ({text})" if text else self.name

    @property
    def evaluations(self) -> int:
        """Force evaluations per step."""
        raise NotImplementedError

    @property
    def memory(self) -> int:
        """Numbers per particle that it remembers from step to step."""
        return 0

    @property
    def lag(self) -> float:
        """The part of a step by which velocities are late; less than 0 where they are early. Under a constant force a step
        of h that changes the velocity v by Δv moves a particle by h (v + (½ + lag) Δv)."""
        return 0.0

    def record(self) -> tuple[object, ...]:
        """The coefficients as kernels take them."""
        raise NotImplementedError

    def _check_order(self, conditions: Sequence[Condition]) -> None:
        """Raise ValueError when a condition of the method's order or below is missed."""
        for c in conditions:
            if c.order <= self.order and not _equal(c.value, c.target):
                raise ValueError(
                    f"{self.name}: a condition of order {c.order} gives {c.value}, not {c.target}"
                )


@dataclass(frozen=True)
class RungeKutta(Method):
    """Explicit Runge–Kutta method with Butcher tableau a (strictly lower triangular, row by row), b, c.

    Raises ValueError at import when a row of `a` does not sum to its `c`, or when `b` misses the conditions of its order.
    """

    a: tuple[tuple[float, ...], ...] = ()
    b: tuple[float, ...] = ()
    c: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        s = len(self.b)
        if len(self.a) != s or len(self.c) != s or any(len(row) != i for i, row in enumerate(self.a)):
            raise ValueError(f"{self.name}: a tableau of {s} stages needs {s} rows, row i of length i")
        for i, row in enumerate(self.a):
            if not _equal(sum(row), self.c[i]):
                raise ValueError(f"{self.name}: row {i} of a sums to {sum(row)}, c is {self.c[i]}")
        (conditions,) = order_conditions(self.a, (self.b,), self.order)
        self._check_order(conditions)

    @property
    def evaluations(self) -> int:
        return len(self.b)

    @property
    def lag(self) -> float:
        return sum(b * c for b, c in zip(self.b, self.c, strict=True)) - 0.5 if self.order < 2 else 0.0

    def record(self) -> RungeKuttaRecord:
        return RungeKuttaRecord(
            tuple(tuple(none_if_zero(x) for x in row) for row in self.a),
            tuple(none_if_zero(x) for x in self.b),
            self.c,
        )

    def amplification(self, z: complex) -> complex:
        """Stability function R(z) of y' = λ y with z = h λ; stable where |R(z)| ≤ 1."""
        slopes: list[complex] = []
        for row in self.a:
            slopes.append(z * (1 + sum(w * k for w, k in zip(row, slopes, strict=True))))
        return 1 + sum(w * k for w, k in zip(self.b, slopes, strict=True))


@dataclass(frozen=True)
class Composition(Method):
    """Alternating kicks v += d h f(x, v)/m and drifts x += c h v, in the order kick, drift, kick, drift ...

    Every composition of kicks and drifts is symplectic for forces that derive from a potential; it is time-reversible
    when it reads the same backwards. Raises ValueError at import when kicks or drifts do not sum to one, when `reversible`
    is declared wrongly, or when the order conditions up to order 4 are missed, read as those of a Nyström method with
    nodes c_i (the drifts before kick i), weights b_i (the kicks) and a_ij = b_j (c_i − c_j) (Hairer, Nørsett, Wanner I,
    section II.14). The order holds for forces that do not depend on the velocity; with one that does, a kick uses the
    velocity in the middle of its own change, and every composition is of first order.
    """

    kicks: tuple[float, ...] = ()
    drifts: tuple[float, ...] = ()
    leapfrogs: tuple[float, ...] = ()
    """Fractions of the step, where the method is made of leapfrogs drift, kick, drift whose drifts are joined."""

    def __post_init__(self) -> None:
        if self.leapfrogs and not self._joins():
            raise ValueError(f"{self.name}: the leapfrogs give other kicks and drifts")
        if len(self.kicks) != len(self.drifts):
            raise ValueError(f"{self.name}: needs as many drifts as kicks (0 for none)")
        for what, parts in (("kicks", self.kicks), ("drifts", self.drifts)):
            if not _equal(sum(parts), 1.0):
                raise ValueError(f"{self.name}: the {what} sum to {sum(parts)}, not 1")
        sequence = [x for pair in zip(self.kicks, self.drifts, strict=True) for x in pair]
        while sequence[-1] == 0:
            sequence.pop()
        while sequence[0] == 0:
            sequence.pop(0)
        mirrored = all(_equal(x, y) for x, y in zip(sequence, reversed(sequence), strict=True))
        if self.reversible != (mirrored and len(sequence) % 2 == 1):
            raise ValueError(
                f"{self.name}: reversible is declared {self.reversible}, the coefficients say otherwise"
            )
        self._check_order(self._order_conditions())

    def apart(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Kicks and drifts with those of every leapfrog by themselves.

        Drifts that are right to second order only, as those of particles on rods, may not be joined: the errors of the
        leapfrogs, one by one, are what a composition of higher order cancels.
        """
        if not self.leapfrogs:
            return self.kicks, self.drifts
        kicks = tuple(x for w in self.leapfrogs for x in (0.0, w))
        drifts = tuple(x for w in self.leapfrogs for x in (w / 2, w / 2))
        return kicks, drifts

    def _joins(self) -> bool:
        """Whether the leapfrogs, their drifts joined, are the kicks and drifts."""
        halves = [w / 2 for w in self.leapfrogs]
        drifts = [a + b for a, b in zip([0.0, *halves], [*halves, 0.0], strict=True)]
        wanted = ((0.0, *self.leapfrogs), drifts)
        return all(
            len(given) == len(made) and all(map(_equal, given, made))
            for given, made in zip((self.kicks, self.drifts), wanted, strict=True)
        )

    def _order_conditions(self) -> list[Condition]:
        s = range(len(self.kicks))
        b, c = self.kicks, [sum(self.drifts[:i]) for i in s]
        a = [[b[j] * (c[i] - c[j]) if j < i else 0.0 for j in s] for i in s]
        bx = [b[i] * (1 - c[i]) for i in s]  # weights of the position
        row = [sum(a[i]) for i in s]
        conditions = [
            (2, sum(b[i] * c[i] for i in s), 1 / 2),
            (2, sum(bx), 1 / 2),
            (3, sum(b[i] * c[i] ** 2 for i in s), 1 / 3),
            (3, sum(b[i] * row[i] for i in s), 1 / 6),
            (3, sum(bx[i] * c[i] for i in s), 1 / 6),
            (4, sum(b[i] * c[i] ** 3 for i in s), 1 / 4),
            (4, sum(b[i] * c[i] * row[i] for i in s), 1 / 8),
            (4, sum(b[i] * a[i][j] * c[j] for i in s for j in s), 1 / 24),
            (4, sum(bx[i] * c[i] ** 2 for i in s), 1 / 12),
            (4, sum(bx[i] * row[i] for i in s), 1 / 24),
        ]
        return [Condition(order, value, target) for order, value, target in conditions]

    @property
    def evaluations(self) -> int:
        return sum(k != 0 for k in self.kicks)

    @property
    def lag(self) -> float:
        return (
            sum(k * sum(self.drifts[i:]) for i, k in enumerate(self.kicks)) - 0.5 if self.order < 2 else 0.0
        )

    def record(self) -> CompositionRecord:
        return CompositionRecord(
            tuple(none_if_zero(x) for x in self.kicks),
            tuple(none_if_zero(x) for x in self.drifts),
            self._keeps() if self.order == 4 and self.reversible else None,
        )

    def _keeps(self) -> tuple[float, float, float]:
        """A step of a mass on a spring is a matrix of polynomials of (ω h)², with the same numbers on its diagonal: with
        b and −c ω² beside them it keeps v²/2 + (c/b) ω² x²/2."""
        square = Polynomial([0.0, 1.0])
        x, v = (Polynomial([1.0]), Polynomial([0.0])), (Polynomial([0.0]), Polynomial([1.0]))
        for kick, drift in zip(self.kicks, self.drifts, strict=True):
            v = v[0] - kick * square * x[0], v[1] - kick * square * x[1]
            x = x[0] + drift * v[0], x[1] + drift * v[1]
        below, above = (np.pad(np.real(each.coef), (0, 5))[:5] for each in (x[1], -(v[0] // square)))
        factor = np.zeros(5)
        for k in range(5):  # the quotient of both series
            factor[k] = (above[k] - below[1 : k + 1] @ factor[:k][::-1]) / below[0]
        return float(factor[2]), float(factor[3]), float(factor[4])


@dataclass(frozen=True)
class Verlet(Method):
    """Störmer's two-step rule on positions; keeps the previous position of every particle."""

    @property
    def evaluations(self) -> int:
        return 1

    @property
    def memory(self) -> int:
        return 4

    def record(self) -> VerletRecord:
        return VerletRecord(0.5)


def _equal(x: float, y: float) -> bool:
    """Equal but for rounding: a coefficient with ten right digits is a wrong one."""
    return abs(x - y) <= 1e-14


def _shown(value: object) -> str:
    """An option as a scenario would write it."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def none_if_zero(x: float) -> float | None:
    """A coefficient, None where it is zero: kernels then leave out what it multiplies."""
    return None if x == 0 else x
