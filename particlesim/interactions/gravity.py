"""Gravity between particles: f = −G m₁ m₂ l/(l² + ε²)^(3/2), U = −G m₁ m₂/(l² + ε²)^(1/2), with l = x₁ − x₂.

ε is Plummer's softening length: bodies attract each other as Plummer spheres of that size attract points. Without softening
they are points. With the cubic spline the force is that of points from h = 2.8 ε on, and within that the force of a body
with the density of the spline of Monaghan and Lattanzio; in its middle the potential is −G m₁ m₂/ε as well.
Source: H. C. Plummer, MNRAS 71, 460 (1911); S. J. Aarseth, MNRAS 126, 223 (1963) for its use between bodies; V. Springel,
N. Yoshida, S. D. M. White, New Astronomy 6, 79 (2001), appendix A, for the spline.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt
from pydantic import model_validator

from particlesim.interactions.far import FarInteraction
from particlesim.laws.pair import Pair, Terms, central_law, over_cube
from particlesim.model.constants import GRAVITATIONAL_CONSTANT
from particlesim.model.mistakes import invalid
from particlesim.model.units import GravitationalConstant, Metres
from particlesim.model.vectors import square


class MutualGravity(FarInteraction):
    """Newton's law of gravitation: every two particles attract each other by their masses."""

    type: Literal["gravity"] = "gravity"
    constant: Annotated[GravitationalConstant, Gt(0)] = GRAVITATIONAL_CONSTANT
    """The constant of gravitation G; another for units of your own, such as 1."""
    softening: Annotated[Metres, Ge(0)] = 0.0
    """Plummer's softening length ε, which bounds the force of near bodies."""
    softened: Literal["plummer", "spline"] = "plummer"
    """How: as `plummer` spheres, whose force is less at all distances, or by a cubic `spline`, exact from 2.8 ε on."""

    by: ClassVar[str] = "mass"
    formula: ClassVar[str] = "f = −G m₁ m₂ l/(l² + ε²)^(3/2), l = x₁ − x₂"
    energy: ClassVar[str] = "U = −G m₁ m₂/(l² + ε²)^(1/2)"

    def coupling(self) -> float:
        return self.constant

    @model_validator(mode="after")
    def _has_a_length(self) -> MutualGravity:
        if self.softened == "spline" and self.softening == 0:
            raise invalid("a spline needs a length", at=("softened",), allowed="softening = 0.1 (m), say")
        return self

    def record(self) -> MutualGravityRecord | SplineGravityRecord:
        if self.softened == "spline":
            return SplineGravityRecord(self.constant, SPLINE_REACH * self.softening)
        return MutualGravityRecord(self.constant, square(self.softening))

    def balanced_constant(self) -> float:
        return self.constant

    def singular(self) -> bool:
        return self.softening == 0

    def everywhere(self) -> bool:
        return self.softening > 0

    def far_softening(self) -> float:
        return 0.0 if self.softened == "spline" else self.softening

    def near_reach(self) -> float:
        return SPLINE_REACH * self.softening if self.softened == "spline" else 0.0

    def lacks_multipoles(self) -> str | None:
        if self.softened == "spline":
            return "far particles act as Plummer spheres there, not as splines"
        return super().lacks_multipoles()


SPLINE_REACH = 2.8
"""Reach h of the spline over the Plummer length ε for which both have the same potential in the middle."""


class MutualGravityRecord(NamedTuple):
    """G [m³/(kg s²)], ε² [m²]."""

    g: float
    eps2: float


@central_law(MutualGravityRecord)
def mutual_gravity(f: MutualGravityRecord, p: Pair, s: float) -> Terms:
    square = s + f.eps2
    k = over_cube(-f.g * (p.m1 * p.m2), square, p)
    return k * square, k, -3 * k / square


class SplineGravityRecord(NamedTuple):
    """G [m³/(kg s²)], h [m]."""

    g: float
    h: float


@central_law(SplineGravityRecord)
def spline_gravity(f: SplineGravityRecord, p: Pair, s: float) -> Terms:
    # with u = r/h: f = −G m₁ m₂ w(u) l/h³, in three pieces, each evaluated where it has a value
    r, one = np.sqrt(s), type(s)(1)
    far = max(r, f.h)
    u = min(r / f.h, one)
    half = one / 2
    v = max(u, half)
    inner = 32 / 3 + u * u * (32 * u - 38.4)
    outer = 64 / 3 - 48 * v + 38.4 * v * v - 32 / 3 * v * v * v - 1 / (15 * v * v * v)
    deep = -2.8 + u * u * (16 / 3 + u * u * (6.4 * u - 9.6))
    shallow = -3.2 + 1 / (15 * v) + v * v * (32 / 3 + v * (-16 + v * (9.6 - 32 / 15 * v)))
    rise = 96 * u - 76.8
    fall = (-48 + 76.8 * v - 32 * v * v + 1 / (5 * v * v * v * v)) / v
    core, within = u < half, r < f.h
    h2 = f.h * f.h
    weight, slope = (inner if core else outer), (rise if core else fall)
    strength = f.g * (p.m1 * p.m2)
    return (
        strength * ((deep if core else shallow) / f.h if within else -1 / far),
        -strength * (weight / (h2 * f.h) if within else 1 / (far * far * far)),
        -strength * (slope / (h2 * h2 * f.h) if within else -3 / (far * far * far * far * far)),
    )
