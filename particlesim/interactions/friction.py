"""Friction between near particles, and a thermostat: dissipative particle dynamics.

    f = −γ w² (e·v) e + √(2 γ k_B T/h) w ξ e,   w = 1 − r/R for r < R,   l = x₁ − x₂, e = l/r, v = v₁ − v₂

The friction takes the relative speed of a pair along e. With a temperature T, random kicks ξ (mean 0, variance 1, the same
for both of a pair and another in every step, of length h) give back what it takes at that temperature, and keep momentum.
Source: R. D. Groot, P. B. Warren, J. Chem. Phys. 107, 4423 (1997); P. Español, P. Warren, Europhys. Lett. 30, 191 (1995).
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt
from pydantic import model_validator

from particlesim.compiler.intrinsics import bits_of, nearest, number_of
from particlesim.interactions.base import PairInteraction
from particlesim.laws.matrices import outer, with_diagonal
from particlesim.laws.pair import Pair, pair_force, pair_force_dv, pair_force_dx, square
from particlesim.laws.registry import Matrix, Vector, law
from particlesim.laws.scatter import kick
from particlesim.model.constants import BOLTZMANN_CONSTANT
from particlesim.model.mistakes import invalid
from particlesim.model.units import JoulesPerKelvin, Kelvin, KilogramsPerSecond, Metres


class PairFriction(PairInteraction):
    """Friction that slows near particles down towards each other, and with a temperature a thermostat."""

    type: Literal["friction"] = "friction"
    coefficient: Annotated[KilogramsPerSecond, Ge(0)]
    """Coefficient γ of the friction."""
    range: Annotated[Metres, Gt(0)]
    """Distance R at which it ends."""
    temperature: Annotated[Kelvin, Ge(0)] | None = None
    """Temperature T of the thermostat; without it there are no random kicks."""
    boltzmann: Annotated[JoulesPerKelvin, Gt(0)] = BOLTZMANN_CONSTANT
    """Boltzmann's constant k_B; 1 where temperatures are given as energies."""

    unused: ClassVar[tuple[str, ...]] = ("shift",)
    formula: ClassVar[str] = (
        "f = −γ w² (e·v) e + √(2 γ k_B T/h) w ξ e, w = 1 − r/R, e = l/r, l = x₁ − x₂, v = v₁ − v₂"
    )
    energy: ClassVar[str] = "none: friction takes energy, and random kicks give it"

    @model_validator(mode="after")
    def _plain(self) -> PairFriction:
        if self.shift != "none":
            raise invalid("a shift is for laws with an energy", at=("shift",))
        return self

    def record(self) -> FrictionRecord:
        return FrictionRecord(self.coefficient, 1 / self.range)

    def in_steps(self, dt: float, seed: int) -> FrictionRecord | ThermostatRecord:
        if not self.temperature:
            return self.record()
        size = math.sqrt(2 * self.coefficient * self.boltzmann * self.temperature / dt)
        return ThermostatRecord(*self.record(), size, bits_of(1 / dt), seed)

    def random(self) -> bool:
        return bool(self.temperature)

    def feeds(self) -> bool:
        return self.random()

    def needs_velocity(self) -> bool:
        return True

    def reach(self) -> float | None:
        return self.range if self.cutoff is None else min(self.range, self.cutoff)

    def singular(self) -> bool:
        return False


class FrictionRecord(NamedTuple):
    """γ [kg/s], 1/R [1/m]."""

    gamma: float
    near: float


class ThermostatRecord(NamedTuple):
    """γ [kg/s], 1/R [1/m], √(2 γ k_B T/h) [N], the bits of 1/h, which must not be rounded to the precision of a run, and the
    seed."""

    gamma: float
    near: float
    size: float
    rate: int
    seed: int


def parts(f: FrictionRecord | ThermostatRecord, p: Pair) -> tuple[float, float, float, float]:
    """The distance, w, and f = φ l with φ and its derivative by r at a fixed l·v."""
    r = np.sqrt(square(p))
    w = max(1 - r * f.near, r - r)
    rise = -f.near if w > 0 else r - r
    drag = -f.gamma * w * w / (r * r)
    drag_rise = -2 * f.gamma * (w * rise / (r * r) - w * w / (r * r * r))
    along = p.x * p.vx + p.y * p.vy + p.z * p.vz
    if isinstance(f, FrictionRecord):
        return r, w, drag * along, drag_rise * along
    push = f.size * type(r)(kick(f.seed, int(nearest(p.t * number_of(f.rate))), p.id1, p.id2))
    return r, w, drag * along + push * w / r, drag_rise * along + push * (rise / r - w / (r * r))


def friction_force(f: FrictionRecord | ThermostatRecord, p: Pair) -> Vector:
    """Force on the first of two particles [N]."""
    _, _, k, _ = parts(f, p)
    return k * p.x, k * p.y, k * p.z


def friction_dx(f: FrictionRecord | ThermostatRecord, p: Pair) -> Matrix:
    """∂f/∂l [N/m]."""
    r, w, k, rise = parts(f, p)
    drag = -f.gamma * w * w / (r * r)
    # k 1 + l (k' l/r + drag v)ᵀ
    x, y, z = (rise * s / r + drag * v for s, v in ((p.x, p.vx), (p.y, p.vy), (p.z, p.vz)))
    return with_diagonal(k, outer((p.x, p.y, p.z), (x, y, z)))


def friction_dv(f: FrictionRecord | ThermostatRecord, p: Pair) -> Matrix:
    """∂f/∂v [N s/m]."""
    r, w, _, _ = parts(f, p)
    k = -f.gamma * w * w / (r * r)
    return outer((k * p.x, k * p.y, k * p.z), (p.x, p.y, p.z))


for _record in (FrictionRecord, ThermostatRecord):
    law(pair_force, _record)(friction_force)
    law(pair_force_dx, _record)(friction_dx)
    law(pair_force_dv, _record)(friction_dv)
