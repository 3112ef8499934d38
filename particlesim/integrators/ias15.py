"""IAS15: Gauss–Radau integration of order 15, for few bodies to the last digit.

Over a step of length h the acceleration is a polynomial in s = (t − t₀)/h,

    a(s) = a₀ + b₀ s + b₁ s² + … + b₆ s⁷,

which agrees with the forces at the eight Gauss–Radau nodes of [0, 1]. Position and velocity are its integrals,

    v(s) = v₀ + h (a₀ s + Σ b_k s^(k+2)/(k+2)),   x(s) = x₀ + h v₀ s + h² (a₀ s²/2 + Σ b_k s^(k+3)/((k+2)(k+3))),

so every node needs the b, and the b need the nodes: they are iterated from a prediction, the polynomial of the last step
continued, until they change by no more than rounding. With Newton's form a(s) = a₀ + s (g₀ + (s − s₁)(g₁ + (s − s₂)(…)))
the g follow from the forces one by one. What rounding takes from positions and velocities is carried along (Kahan's sums).

The step follows from the derivatives of the acceleration at its end: with j, s the first and second of them,

    h = τ (5040 ε)^(1/7),   τ² = min 2 |a|² / (|j|² + |a| |s|)  over the bodies,

where ε is the `tolerance`. Where the acceleration of a body passes through zero τ would vanish: the same with derivatives
one higher counts for each body where it is longer. A step that is more than four times too long is done again.

Sources: H. Rein, D. S. Spiegel, MNRAS 446, 1424 (2015); E. Everhart, in: Dynamics of Comets, 185 (1985); D. Pham, H. Rein,
D. S. Spiegel, Open Journal of Astrophysics 7, 1 (2024) for the step.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, ClassVar, Literal

from annotated_types import Gt, Lt

from particlesim.integrators.base import Method
from particlesim.integrators.options import Options
from particlesim.model.units import Number, Seconds

NODES = (
    0.0,
    0.05626256053692215,
    0.18024069173689236,
    0.35262471711316964,
    0.5471536263305554,
    0.7342101772154105,
    0.8853209468390958,
    0.9775206135612875,
)
"""Gauss–Radau nodes of [0, 1]: 0 and the zeros of (P₇(u) + P₈(u))/(1 + u) at u = 2 s − 1, with Legendre's polynomials P."""
COEFFICIENTS = len(NODES) - 1
TOLERANCE = 1e-9

Table = tuple[tuple[float, ...], ...]


class GaussRadau(Options):
    """IAS15: all particles that it steps take one step together, whose length follows from how their accelerations change.

    `dt` is the longest step. For few bodies: Solar Systems, close encounters.
    """

    method: Literal["ias15"]
    """Name of the method."""
    tolerance: Annotated[Number, Gt(0), Lt(1)] = TOLERANCE
    """ε: size of the last term of the acceleration's polynomial, relative to the acceleration, that a step may have. Errors
    of a step are far below it; the default is at rounding."""
    minimum_step: Annotated[Seconds, Gt(0)] | None = None
    """A run that needs shorter steps ends with an error; what the clock can resolve unless given."""


@dataclass(frozen=True)
class GaussRadauMethod(Method):
    """Integration over Gauss–Radau nodes with steps from the change of the acceleration."""

    options: ClassVar[type[Options]] = GaussRadau
    adaptive: ClassVar[bool] = True
    revisits: ClassVar[bool] = False
    by_modes: ClassVar[bool] = False
    together: ClassVar[bool] = True
    smooth: ClassVar[bool] = True

    tolerance: float = TOLERANCE
    minimum_step: float | None = None

    @property
    def evaluations(self) -> int:
        """Two iterations over the nodes, as most steps take."""
        return 2 * COEFFICIENTS + 1

    @property
    def memory(self) -> int:
        """The next step and the last; its b, and as they were predicted, for each component; the carry of position and
        velocity; whether all this holds."""
        return 2 + 6 * COEFFICIENTS + 6 + 1


def newton_to_monomial() -> Table:
    """c with b_k = Σ_j c[j][k] g_j: the coefficients of s (s − s₁) … (s − s_j), without the first s."""
    rows = [[Fraction(1)]]
    for node in NODES[1:-1]:
        last, s = rows[-1], Fraction(node)
        rows.append([a - s * b for a, b in zip([Fraction(0), *last], [*last, Fraction(0)], strict=True)])
    return _square(rows)


def monomial_to_newton() -> Table:
    """d with g_k = Σ_j d[j][k] b_j, the inverse of `newton_to_monomial`: s^j in Newton's form."""
    rows = [[Fraction(1)]]
    for j in range(1, COEFFICIENTS):
        last = [*rows[-1], Fraction(0)]
        shifted = [
            Fraction(0),
            *rows[-1],
        ]  # s (s − s₁) … (s − s_k) times s is the next one plus s_(k+1) times itself
        nodes = [Fraction(NODES[k + 1]) for k in range(j)] + [Fraction(0)]
        rows.append([a + s * b for a, s, b in zip(shifted, nodes, last, strict=True)])
    return _square(rows)


def _square(rows: list[list[Fraction]]) -> Table:
    return tuple(tuple(float(x) for x in row) + (0.0,) * (COEFFICIENTS - len(row)) for row in rows)


IAS15 = GaussRadauMethod(
    name="ias15",
    order=15,
    summary="Gauss–Radau, its steps chosen by how accelerations change; order 15, errors at rounding, for few bodies",
    first_order="dop853",
)
