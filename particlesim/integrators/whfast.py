"""WHFast: Wisdom and Holman's splitting, for planets that follow Kepler's orbits about a heavy body for very long.

The energy is split into that of Kepler's problem for every body but the central one, which is solved exactly, and the rest,
a kick by the forces less those of Kepler's problems:

    Kepler's orbits for h/2, kick for h, Kepler's orbits for h/2.

Two half steps that follow on each other are one. What is left is as small as the masses of the planets are against that of
the central body, ε, so the error of the energy is of the size ε h², and bounded. In *Jacobi coordinates* every body is seen
from the centre of mass of those further inside, r'ₖ = rₖ − Rₖ₋₁, and goes about it as about a body of the mass Mₖ of all up
to itself, μ = G Mₖ: two bodies are exact at any step. In *democratic heliocentric coordinates* all are seen from the
central body, μ = G m₀, with their velocities about the centre of mass; the momentum of the central body, −Σ pₖ, makes
another part, a shift of all by h Σ pₖ/m₀. They do not depend on who is further inside, and bodies may change places.

Kepler's problem is solved in universal variables, for all kinds of orbits alike: with β = 2 μ/r₀ − v₀², η = r₀·v₀, ζ = μ −
β r₀ and Stiefel's functions Gₙ(β, X) = Xⁿ cₙ(β X²) of Stumpff's cₙ, the root X of

    h = r₀ X + η G₂ + ζ G₃,   r = r₀ + η G₁ + ζ G₂,

gives x = x₀ + (f − 1) x₀ + g v₀ and v = v₀ + f' x₀ + (g' − 1) v₀ with

    f − 1 = −μ G₂/r₀,   g = h − μ G₃,   f' = −μ G₁/(r₀ r),   g' − 1 = −μ G₂/r.

Between frames the state is kept in these coordinates, between the half steps, with what rounding takes from its sums
(Kahan): how many frames there are changes nothing.

Sources: J. Wisdom, M. Holman, Astron. J. 102, 1528 (1991); H. Rein, D. Tamayo, MNRAS 452, 376 (2015); S. Mikkola, K.
Innanen, Celest. Mech. Dyn. Astr. 74, 59 (1999); M. Duncan, H. Levison, M. H. Lee, Astron. J. 116, 2067 (1998) for the
heliocentric ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from particlesim.integrators.base import Method
from particlesim.integrators.options import Options
from particlesim.model.base import Name

Coordinates = Literal["jacobi", "democratic_heliocentric"]


class WisdomHolman(Options):
    """WHFast: planets follow Kepler's orbits about a heavy body, and are kicked by what else acts on them.

    For Solar Systems over very long times, without close encounters of the planets. Steps may be a sixteenth of
    the time in which the fastest planet would go round at its pericentre: 3.5 days for Mercury.
    """

    method: Literal["whfast"]
    """Name of the method."""
    central: Name | None = None
    """Group of the one body about which the others go; the heaviest unless given."""
    coordinates: Coordinates = "jacobi"
    """`jacobi`: every body about the centre of mass of those that start further inside, most accurate; or
    `democratic_heliocentric`: all about the central body, for orbits that cross or change places."""


@dataclass(frozen=True)
class WisdomHolmanMethod(Method):
    """Kepler's orbits, solved exactly, between kicks by all other forces."""

    options: ClassVar[type[Options]] = WisdomHolman
    together: ClassVar[bool] = True
    by_modes: ClassVar[bool] = False

    central: str | None = None
    coordinates: Coordinates = "jacobi"

    @property
    def evaluations(self) -> int:
        return 1

    @property
    def memory(self) -> int:
        """Place and velocity in its coordinates and the carry of their sums; place and velocity as they were at the end of
        the last interval, to see whether they have been changed since; whether all this is valid."""
        return 6 + 6 + 6 + 1


WHFAST = WisdomHolmanMethod(
    name="whfast",
    order=2,
    summary="Kepler's orbits about a heavy body, exact, and kicks by the planets; order 2, errors small as their masses",
    symplectic=True,
    reversible=True,
    first_order="midpoint",
)
