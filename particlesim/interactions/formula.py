"""An interaction by a formula: U(r) as written, f = −U'(r) l/r, with l = x₁ − x₂ and r = |l|.

U' comes from forward differentiation of the expression, exact to rounding; U'', which only implicit methods and the
largest stable step ask for, is the central difference of U', with a relative error of about 10⁻¹⁰.
Source: A. Griewank, A. Walther, Evaluating Derivatives, 2nd ed., chapter 3, for the differentiation.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, StringConstraints, model_validator

from particlesim.expressions.constants import check_constant
from particlesim.expressions.discontinuities import CALLED, edges
from particlesim.expressions.operations import Node, Ray, slope, value
from particlesim.expressions.parser import ExpressionError, on_arrays, parse, reads
from particlesim.interactions.base import Jump, PairInteraction
from particlesim.laws.pair import Pair, Terms, by_distance, central_law
from particlesim.laws.registry import law
from particlesim.model.base import Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Number

LOOKS = 4001
"""Distances between which jumps are looked for."""
CLEAR = 1e-6
"""Part of its value by which a function changes over a rounding of the distance only where it jumps."""
ROUNDED = 1e-12
"""Part of a distance that is well beyond its rounding."""
STEP = 6e-6
"""∛(machine epsilon): part of the distance that differences of U' go."""


class Known(NamedTuple):
    """What a formula may name: distance [m], masses [kg], charges [C], radii [m] and time [s]."""

    r: float
    m1: float
    m2: float
    q1: float
    q2: float
    r1: float
    r2: float
    t: float


class Distance(NamedTuple):
    """The distance r."""


class FirstMass(NamedTuple):
    """Mass m₁."""


class SecondMass(NamedTuple):
    """Mass m₂."""


class FirstCharge(NamedTuple):
    """Charge q₁."""


class SecondCharge(NamedTuple):
    """Charge q₂."""


class FirstRadius(NamedTuple):
    """Radius r₁."""


class SecondRadius(NamedTuple):
    """Radius r₂."""


class Moment(NamedTuple):
    """The time t."""


NAMES: dict[str, Node] = {
    "r": Distance(),
    "m1": FirstMass(),
    "m2": SecondMass(),
    "q1": FirstCharge(),
    "q2": SecondCharge(),
    "r1": FirstRadius(),
    "r2": SecondRadius(),
    "t": Moment(),
}
"""Variables of a formula by their names."""

law(value, Distance)(lambda f, p: p.r)
law(slope, Distance)(lambda f, p: p.d.r)
law(value, FirstMass)(lambda f, p: p.m1)
law(slope, FirstMass)(lambda f, p: p.d.m1)
law(value, SecondMass)(lambda f, p: p.m2)
law(slope, SecondMass)(lambda f, p: p.d.m2)
law(value, FirstCharge)(lambda f, p: p.q1)
law(slope, FirstCharge)(lambda f, p: p.d.q1)
law(value, SecondCharge)(lambda f, p: p.q2)
law(slope, SecondCharge)(lambda f, p: p.d.q2)
law(value, FirstRadius)(lambda f, p: p.r1)
law(slope, FirstRadius)(lambda f, p: p.d.r1)
law(value, SecondRadius)(lambda f, p: p.r2)
law(slope, SecondRadius)(lambda f, p: p.d.r2)
law(value, Moment)(lambda f, p: p.t)
law(slope, Moment)(lambda f, p: p.d.t)

Expression = Annotated[str, StringConstraints(max_length=2000)]

_PROBES = ((0.7, 1.3, 0.6, 0.4, -0.9, 0.2, 0.5, 0.0), (1.9, 0.8, 2.1, -1.1, 0.3, 0.6, 0.1, 2.0))


class PairFormula(PairInteraction):
    """An interaction by a formula: a potential energy of the distance, to go down in."""

    type: Literal["formula"] = "formula"
    potential: Expression
    """Energy U of a pair in joules, as an expression of the distance r, of m1, m2, q1, q2, r1, r2 (masses, charges and radii
    of both), of the time t, and of the constants; both particles must be alike in it."""
    constants: dict[Name, Number] = Field(default_factory=dict)
    """Numbers by name, for use in the expression."""

    formula: ClassVar[str] = "f = −U'(r) l/r, l = x₁ − x₂, r = |l|"
    energy: ClassVar[str] = "U(r) as written"

    @model_validator(mode="after")
    def _parses(self) -> PairFormula:
        for name in self.constants:
            check_constant(name, NAMES)
        try:
            node = self.node()
        except ExpressionError as error:
            raise invalid(
                error.message, at=("potential",), hint=error.hint, within=(error.offset, error.length)
            ) from None
        for probe in _PROBES:
            r, m1, m2, q1, q2, r1, r2, t = map(np.float64, probe)
            with np.errstate(all="ignore"):
                one = value(node, Known(r, m1, m2, q1, q2, r1, r2, t))  # type: ignore[arg-type]
                other = value(node, Known(r, m2, m1, q2, q1, r2, r1, t))  # type: ignore[arg-type]
                differs = abs(one - other) > 1e-9 * (abs(one) + abs(other))
            if differs:
                raise invalid(
                    "the energy of a pair must not depend on which of the two is the first",
                    at=("potential",),
                    hint="write m1*m2, q1*q2, r1 + r2 and the like",
                )
        return self

    def node(self) -> Node:
        """The expression as a tree of records."""
        return parse(self.potential, self.constants, NAMES)

    def record(self) -> FormulaRecord:
        return FormulaRecord(self.node())

    def needs(self) -> frozenset[str]:
        read = {"charge": (FirstCharge, SecondCharge), "radius": (FirstRadius, SecondRadius)}
        node = self.node()
        return frozenset(name for name, kinds in read.items() if any(reads(node, kind) for kind in kinds))

    def jump(self) -> Jump | None:
        """The first place that is seen at which the energy, or else the force, jumps; None if there is none.

        Conditions, `sign`, and the slopes of `abs`, `min` and `max` change at once where an expression passes zero. That is
        found between distances through many orders of magnitude, up to the cutoff, and both sides of it are compared.
        """
        node, found = self.node(), []
        for _, edge in edges(node, tuple(CALLED)):
            for low, high in _zeros(edge, self.cutoff):
                sides = (0.9 * low, low * (1 - ROUNDED), high * (1 + ROUNDED), 1.1 * high)
                places = map(np.float64, sides)
                known = [Known(r, *map(np.float64, _PROBES[0][1:])) for r in places]
                with np.errstate(all="ignore"):
                    energies = [float(value(node, each)) for each in known]  # type: ignore[arg-type]
                    forces = [float(slope(node, Ray(each, ALONG))) for each in known]  # type: ignore[arg-type]
                for of, (one, before, after, other) in (("energy", energies), ("force", forces)):
                    if abs(after - before) > CLEAR * max(abs(one), abs(other)):  # not of what is no number
                        found.append(Jump(of, high, abs(after - before)))
                        break
        return min(found, default=None)

    def doubts(self, lightest: tuple[float, float] | None, dt: float) -> Iterator[str]:
        if (jump := self.jump()) is None:
            return
        unit, effect = "N", "methods lose their order"
        if jump.of == "energy":
            unit, effect = "J", "no force does that work: energy is not kept"
        yield (
            f"the {jump.of} of {self.label} jumps at r = {jump.at:.4g} m, by {jump.size:.3g} {unit} for some pair; {effect} "
            "where pairs pass there"
        )

    def changes(self) -> bool:
        """Whether the energy of particles at rest changes with time."""
        return reads(self.node(), Moment)

    def feeds(self) -> bool:
        return self.changes()

    def singular(self) -> bool:
        """Whether U has no value at r = 0."""
        with np.errstate(all="ignore"):
            at = value(self.node(), Known(*map(np.float64, (0.0, *_PROBES[0][1:]))))  # type: ignore[arg-type]
        return not bool(np.isfinite(at))


ALONG = Known(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The way of a derivative by the distance."""


def _zeros(edge: Node, cutoff: float | None) -> list[tuple[float, float]]:
    """Distances just before and just after an expression passes zero."""
    last = 1e6 if cutoff is None else cutoff
    places = last * np.logspace(-12 if cutoff is None else -6, 0, LOOKS)
    rest = dict(zip(NAMES.values(), (0.0, *_PROBES[0][1:]), strict=True))

    def below(r: NDArray[np.float64]) -> NDArray[np.bool_]:
        def variable(leaf: Node) -> NDArray[np.float64]:
            return r if isinstance(leaf, Distance) else np.full(r.shape, rest[leaf])

        return np.asarray(np.broadcast_to(on_arrays(edge, variable), r.shape) < 0)

    sign = below(places)
    k = np.flatnonzero(sign[1:] != sign[:-1])
    low, high, first = places[k], places[k + 1], sign[k]
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = below(middle) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return list(zip(low.tolist(), high.tolist(), strict=True))


class FormulaRecord(NamedTuple):
    """Expression of U [J]."""

    u: Any


def known_of(p: Pair, r: float) -> Known:
    """A pair as formulas see it, at a distance."""
    return Known(r, p.m1, p.m2, p.q1, p.q2, p.r1, p.r2, p.t)


def derivative(u: Any, p: Pair, r: float) -> float:
    """U'(r)."""
    return slope(u, Ray(known_of(p, r), Known(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))  # type: ignore[arg-type]


@central_law(FormulaRecord)
def formula(f: FormulaRecord, p: Pair, s: float) -> Terms:
    r = np.sqrt(s)
    h = STEP * r
    curvature = (derivative(f.u, p, r + h) - derivative(f.u, p, r - h)) / (2 * h)
    return by_distance(value(f.u, known_of(p, r)), derivative(f.u, p, r), curvature, r)  # type: ignore[arg-type]
