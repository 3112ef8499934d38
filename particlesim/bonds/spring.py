"""Spring-dampers between pairs of particles.

    f on 1 = −k (|l| − L₀) e − c ((v₁ − v₂)·e) e,   l = x₁ − x₂,  e = l/|l|,   f on 2 = −f on 1

with U = ½ k (|l| − L₀)². A string (`tension_only`) is the same while it is taut, |l| > L₀, and nothing else. Coincident
ends have no direction and feel nothing. The sign of the damper matters: with (v₂ − v₁)·e it would feed energy in.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt
from pydantic import Field, StrictBool, model_validator

from particlesim.bonds.base import BondSet, SpringLaw
from particlesim.bonds.near import near_pairs
from particlesim.bonds.pairs import SINGLE, Pairs, check_pairs, check_points, joined_groups
from particlesim.laws.matrices import outer, with_diagonal
from particlesim.laws.registry import Matrix, bond_force, bond_force_dv, bond_force_dx, bond_potential, law
from particlesim.model.arrays import Floats, Ints
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import (
    Hertz,
    KilogramsPerSecond,
    Metres,
    Newtons,
    NewtonsPerMetre,
    Number,
    Vector,
)


class Springs(Model):
    """Springs between pairs of particles, within one group or from one group to another."""

    name: Name = "springs"
    """Name for the ledger and for messages."""
    on: Name | None = None
    """The group whose particles are joined."""
    between: tuple[Name, Name] | None = None
    """Two groups instead of one: the first index of a pair is in the first, the second in the second."""
    pairs: Pairs | None = Field(default=None, min_length=1)
    """Indices of the joined particles, a pair for every spring; needless between two groups of one particle."""
    within: Annotated[Metres, Gt(0)] | None = None
    """Instead of `pairs`: join all that are at most this far apart at the start."""
    points: tuple[Vector[Metres], Vector[Metres]] | None = None
    """Springs at rigid bodies: where both ends are, from the centres of their bodies along the axes that these have before
    they are turned, and for "world", which may be the second of `between`, the place. The centres unless given. With points,
    `pairs` are the first bodies of both groups unless given."""
    stiffness: Annotated[NewtonsPerMetre, Ge(0)] | None = None
    """Stiffness k."""
    frequency: Annotated[Hertz, Gt(0)] | None = None
    """Instead of the stiffness: frequency f at which the two ends swing freely, k = μ (2πf)² with the reduced mass μ."""
    damping: Annotated[KilogramsPerSecond, Ge(0)] = 0.0
    """Damping c along the spring."""
    damping_ratio: Annotated[Number, Ge(0)] | None = None
    """Instead of the damping: ζ in c = 2 ζ √(k μ); 1 is critical. A pinned end counts as infinitely heavy."""
    rest_length: Annotated[Metres, Ge(0)] | None = None
    """Rest length L₀; the distance at the start unless given."""
    tension_only: StrictBool = False
    """A string: it pulls when it is longer than its rest length, and does nothing when it is slack."""
    compression_only: StrictBool = False
    """A strut: it pushes when it is shorter than its rest length, and does nothing otherwise, as balls that touch."""
    break_strain: Annotated[Number, Gt(0)] | None = None
    """Strain (l − L₀)/L₀ beyond which a spring breaks, for good. Looked at after every step."""
    break_force: Annotated[Newtons, Gt(0)] | None = None
    """Pull beyond which a spring breaks, for good. Looked at after every step."""

    @model_validator(mode="after")
    def _joins(self) -> Springs:
        first, second = self.groups()
        if self.lists_none and first == second:
            raise invalid("which particles are joined?", allowed="pairs = [[0, 1]], or within = 0.1 (m)")
        if self.pairs is not None and self.within is not None:
            raise invalid("pairs are listed already", at=("within",), also=[(("pairs",), "here")])
        check_pairs(self.pairs or (), inside=first == second)
        check_points(self.points, self.groups(), self.pairs)
        return self

    @model_validator(mode="after")
    def _constants(self) -> Springs:
        if (self.stiffness is None) == (self.frequency is None):
            raise invalid(
                "give the stiffness or the frequency, one of the two",
                at=None if self.stiffness is None else ("frequency",),
                allowed="stiffness = 800.0 (N/m), or frequency = 5.0 (Hz)",
            )
        if self.damping > 0 and self.damping_ratio is not None:
            raise invalid(
                "the damping is given already", at=("damping_ratio",), also=[(("damping",), "here")]
            )
        if self.break_strain is not None and self.rest_length == 0:
            raise invalid(
                "a strain needs a rest length greater than 0",
                at=("break_strain",),
                also=[(("rest_length",), "0 here")],
                hint="break_force breaks springs without a rest length",
            )
        return self

    @model_validator(mode="after")
    def _strut(self) -> Springs:
        for key in ("tension_only", "break_strain", "break_force"):
            if self.compression_only and getattr(self, key):
                says = "never pulls" if key == "tension_only" else "is never stretched, and does not break"
                raise invalid(f"a strut {says}", at=(key,), also=[(("compression_only",), "a strut")])
        return self

    @property
    def lists_none(self) -> bool:
        """Whether nothing says which particles are joined: of groups of one particle they are those."""
        return self.pairs is None and self.within is None and self.points is None

    def groups(self) -> tuple[Name, Name]:
        """Groups of the first and second ends."""
        return joined_groups(self.on, self.between)

    def describe(self) -> str:
        """Springs at rigid bodies in a few words."""
        return f"{len(self.pairs or SINGLE)} at bodies"

    def spring_law(self) -> SpringLaw:
        """The constants that all springs share."""
        return SpringLaw(
            self.stiffness,
            self.frequency,
            self.damping,
            self.damping_ratio,
            self.rest_length,
            self.tension_only,
            self.break_strain,
            self.break_force,
            self.compression_only,
        )

    def bonds(self, label: str) -> BondSet:
        """The springs as the engine takes them. `find` raises UsageError when nothing is near enough to be joined."""
        if self.within is None:
            listed = np.array(self.pairs or SINGLE, dtype=np.int64)
            return BondSet(label, self.groups(), self.spring_law(), len(listed), partial(_listed, listed))
        inside = self.groups()[0] == self.groups()[1]
        find = partial(near_pairs, self.within, inside, label)
        return BondSet(label, self.groups(), self.spring_law(), None, find)


def _listed(pairs: Ints, first: Floats, second: Floats) -> Ints:
    return pairs


class SpringRecord(NamedTuple):
    """A spring that pushes and pulls."""


class StringRecord(NamedTuple):
    """A spring that only pulls."""


class Pair(NamedTuple):
    """A bond: l = x₁ − x₂ [m], v₁ − v₂ [m/s], stiffness [N/m], damping [kg/s], rest length [m]."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    k: float
    c: float
    rest: float


@law(bond_force, SpringRecord)
def spring_force(f: SpringRecord, b: Pair) -> tuple[float, float, float]:
    square = b.x * b.x + b.y * b.y + b.z * b.z
    length = np.sqrt(square)
    inverse = length / square if square > 0 else square
    along = (b.vx * b.x + b.vy * b.y + b.vz * b.z) * inverse
    s = -(b.k * (length - b.rest) + b.c * along) * inverse
    return s * b.x, s * b.y, s * b.z


def spring_dx(b: Pair, k: float, inverse: float) -> Matrix:
    """∂f/∂l = −k e eᵀ − (k (1 − L₀/l) + c (v·e)/l)(1 − e eᵀ) − (c/l) e (v − (v·e) e)ᵀ, with 1/l as `inverse`."""
    ex, ey, ez = b.x * inverse, b.y * inverse, b.z * inverse
    along = b.vx * ex + b.vy * ey + b.vz * ez
    turn = b.c * inverse
    across = k * (1 - b.rest * inverse) + turn * along
    px = (across - k + turn * along) * ex - turn * b.vx
    py = (across - k + turn * along) * ey - turn * b.vy
    pz = (across - k + turn * along) * ez - turn * b.vz
    return with_diagonal(-across, outer((ex, ey, ez), (px, py, pz)))


def spring_dv(b: Pair, inverse: float) -> Matrix:
    """∂f/∂v = −c e eᵀ, with 1/l as `inverse`."""
    ex, ey, ez = b.x * inverse, b.y * inverse, b.z * inverse
    return outer((ex, ey, ez), (-b.c * ex, -b.c * ey, -b.c * ez))


@law(bond_force_dx, SpringRecord)
def spring_force_dx(f: SpringRecord, b: Pair) -> Matrix:
    square = b.x * b.x + b.y * b.y + b.z * b.z
    return spring_dx(b, b.k, np.sqrt(square) / square if square > 0 else square)


@law(bond_force_dv, SpringRecord)
def spring_force_dv(f: SpringRecord, b: Pair) -> Matrix:
    square = b.x * b.x + b.y * b.y + b.z * b.z
    return spring_dv(b, np.sqrt(square) / square if square > 0 else square)


@law(bond_potential, SpringRecord)
def spring_potential(f: SpringRecord, b: Pair) -> float:
    stretch = np.sqrt(b.x * b.x + b.y * b.y + b.z * b.z) - b.rest
    return 0.5 * b.k * stretch * stretch


@law(bond_force, StringRecord)
def string_force(f: StringRecord, b: Pair) -> tuple[float, float, float]:
    square = b.x * b.x + b.y * b.y + b.z * b.z
    length = np.sqrt(square)
    inverse = length / square if length > b.rest else square - square
    along = (b.vx * b.x + b.vy * b.y + b.vz * b.z) * inverse
    s = -(b.k * (length - b.rest) + b.c * along) * inverse
    return s * b.x, s * b.y, s * b.z


@law(bond_force_dx, StringRecord)
def string_force_dx(f: StringRecord, b: Pair) -> Matrix:
    square = b.x * b.x + b.y * b.y + b.z * b.z
    length = np.sqrt(square)
    inverse = length / square if length > b.rest else square - square
    return spring_dx(b, b.k if length > b.rest else b.k - b.k, inverse)


@law(bond_force_dv, StringRecord)
def string_force_dv(f: StringRecord, b: Pair) -> Matrix:
    square = b.x * b.x + b.y * b.y + b.z * b.z
    length = np.sqrt(square)
    return spring_dv(b, length / square if length > b.rest else square - square)


@law(bond_potential, StringRecord)
def string_potential(f: StringRecord, b: Pair) -> float:
    stretch = max(np.sqrt(b.x * b.x + b.y * b.y + b.z * b.z) - b.rest, 0.0)
    return 0.5 * b.k * stretch * stretch
