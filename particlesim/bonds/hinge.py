"""Springs that resist bending: between three particles (an angle) and four (a dihedral, the fold between two triangles).

With d the deviation of the angle from its rest angle, wrapped to (−π, π]:

    harmonic   U = ½ k d²
    cosine     U = k (1 − cos d), the same for small d, with a bounded moment k sin d

Forces are f = −U'(d) ∇θ. Both gradients are those of a function of the shape alone, so that momentum and angular momentum
are kept to rounding.

Angle at particle 2 of 1–2–3, a = x₁ − x₂, b = x₃ − x₂, n = a × b:  θ = atan2(|n|, a·b),
    ∇₁θ = −(n × a)/(|n| a²),   ∇₃θ = (n × b)/(|n| b²),   ∇₂θ = −∇₁θ − ∇₃θ.
On a straight or folded angle n has no direction: the force is 0, which is its limit when the rest angle is 180° or 0°.

Dihedral of the triangles 1–2–3 and 4–3–2 with the common edge 2–3, F = x₁ − x₂, G = x₂ − x₃, H = x₄ − x₃, A = F × G,
B = H × G:
    φ = atan2((B × A)·G/|G|, A·B), from which the fold is φ − π: 0 when the triangles are flat.
A degenerate triangle has no normal, and feels nothing.

Implicit methods take from the second derivatives of U what is positive (semi-)definite whatever the shape: U'' ∇θ ∇θᵀ with
U'' > 0 and, of angles, how a bent one resists being turned out of its plane. By α = n·δa/(|n||a|), β = n·δb/(|n||b|) that is

    U'(d) ((α² + β²) cot θ − 2 α β/sin θ) = ½ U'(d) (cot(θ/2) (α − β)² − tan(θ/2) (α + β)²),

of which one term is positive. Without it, and with the rest angle at 180°, a rope would be stiff in one plane alone.
Source: A. Blondel, M. Karplus, New formulation for derivatives of torsion angles, J. Comput. Chem. 17, 1132 (1996).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Le
from pydantic import Field, model_validator

from particlesim.bonds.base import Ties
from particlesim.bonds.pairs import Index
from particlesim.laws.registry import hinge_energy, hinge_moment, hinge_stiffness, law
from particlesim.model.arrays import Floats, Ints
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Degrees, Joules

Form = Literal["harmonic", "cosine"]
AngleGradient = tuple[float, float, float, float, float, float, float]
AngleForms = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
DihedralGradient = tuple[float, float, float, float, float, float, float, float, float, float]


class Harmonic(NamedTuple):
    """U = ½ k d² with k [J]."""

    k: float


class Cosine(NamedTuple):
    """U = k (1 − cos d) with k [J]."""

    k: float


HingeRecord = Harmonic | Cosine


@law(hinge_energy, Harmonic)
def harmonic_energy(f: Harmonic, d: float) -> float:
    return 0.5 * f.k * d * d


@law(hinge_moment, Harmonic)
def harmonic_moment(f: Harmonic, d: float) -> float:
    return f.k * d


@law(hinge_energy, Cosine)
def cosine_energy(f: Cosine, d: float) -> float:
    s = np.sin(0.5 * d)
    return 2 * f.k * s * s


@law(hinge_moment, Cosine)
def cosine_moment(f: Cosine, d: float) -> float:
    return f.k * np.sin(d)


@law(hinge_stiffness, Harmonic)
def harmonic_stiffness(f: Harmonic, d: float) -> float:
    return f.k


@law(hinge_stiffness, Cosine)
def cosine_stiffness(f: Cosine, d: float) -> float:
    return f.k * np.cos(d)


def wrapped(d: float) -> float:
    """An angle in (−π, π]."""
    return d - 2 * np.pi * np.floor(d / (2 * np.pi) + 0.5)


def angle_gradient(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> AngleGradient:
    """Angle between a and b [rad], and its gradients by a and by b [1/m]."""
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    n = np.sqrt(nx * nx + ny * ny + nz * nz)
    theta = np.arctan2(n, ax * bx + ay * by + az * bz)
    p = n * (ax * ax + ay * ay + az * az)
    q = n * (bx * bx + by * by + bz * bz)
    u = -1 / p if p > 0 else p - p
    w = 1 / q if q > 0 else q - q
    return (
        theta,
        u * (ny * az - nz * ay),
        u * (nz * ax - nx * az),
        u * (nx * ay - ny * ax),
        w * (ny * bz - nz * by),
        w * (nz * bx - nx * bz),
        w * (nx * by - ny * bx),
    )


def angle_forms(
    stiffness: float, moment: float, ax: float, ay: float, az: float, bx: float, by: float, bz: float
) -> AngleForms:
    """Two vectors w and p, each by a and by b [√(N/m)]: w wᵀ + p pᵀ is the positive part of the second derivatives of U,
    from U''(d) ≥ 0 and U'(d).

    w points along the gradient, p out of the plane of the angle. On a straight or folded angle all planes are alike.
    """
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    square = nx * nx + ny * ny + nz * nz
    n = np.sqrt(square)
    a2, b2 = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
    dot, ab = ax * bx + ay * by + az * bz, np.sqrt(a2 * b2)
    bent = n > 0
    # Across a straight angle: a with the axis nearest to its normal plane.
    ox, oy, oz = other_axis(ax, ay, az)
    mx, my, mz = (nx, ny, nz) if bent else (ay * oz - az * oy, az * ox - ax * oz, ax * oy - ay * ox)
    m = np.sqrt(mx * mx + my * my + mz * mz)
    inverse = 1 / m if m > 0 else m
    mx, my, mz = mx * inverse, my * inverse, mz * inverse
    s = np.sqrt(stiffness)
    # ½ |U'| (ab ∓ dot)/n; where that is a difference, it is n/(ab ± dot), which rounding cannot make negative.
    wide = ab + abs(dot)
    lever = (wide / n if (moment < 0) == (dot < 0) else n / wide) if bent else n
    t = np.sqrt(0.5 * abs(moment) * lever) if bent else s
    sign = 1.0 if (moment < 0 if bent else dot < 0) else -1.0
    sound = (a2 > 0) & (b2 > 0)
    # By a the gradient is −(m × a)/a², by b it is (m × b)/b²; on a straight angle both point to the same side.
    u = -s / a2 if sound else a2 - a2
    w = s / b2 if sound else a2 - a2
    p = t / np.sqrt(a2) if sound else a2 - a2
    q = sign * t / np.sqrt(b2) if sound else a2 - a2
    return (
        u * (my * az - mz * ay),
        u * (mz * ax - mx * az),
        u * (mx * ay - my * ax),
        w * (my * bz - mz * by),
        w * (mz * bx - mx * bz),
        w * (mx * by - my * bx),
        p * mx,
        p * my,
        p * mz,
        q * mx,
        q * my,
        q * mz,
    )


def other_axis(x: float, y: float, z: float) -> tuple[float, float, float]:
    """The axis that a vector points along least."""
    x, y, z = abs(x), abs(y), abs(z)
    zero, one = x - x, x - x + 1
    if x <= y and x <= z:
        return one, zero, zero
    if y <= z:
        return zero, one, zero
    return zero, zero, one


def dihedral_gradient(
    fx: float,
    fy: float,
    fz: float,
    gx: float,
    gy: float,
    gz: float,
    hx: float,
    hy: float,
    hz: float,
) -> DihedralGradient:
    """Fold between two triangles [rad], and its gradients by x₁, x₂ and x₄ [1/m]; all 0 where one is degenerate."""
    ax, ay, az = fy * gz - fz * gy, fz * gx - fx * gz, fx * gy - fy * gx
    bx, by, bz = hy * gz - hz * gy, hz * gx - hx * gz, hx * gy - hy * gx
    g = np.sqrt(gx * gx + gy * gy + gz * gz)
    a, b = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
    sound = (a > 0) & (b > 0)
    triple = (by * az - bz * ay) * gx + (bz * ax - bx * az) * gy + (bx * ay - by * ax) * gz
    # φ − π: both arguments change their signs.
    fold = np.arctan2(-triple / g, -(ax * bx + ay * by + az * bz)) if sound else g - g
    u = -g / a if sound else g - g
    w = g / b if sound else g - g
    fg, hg = fx * gx + fy * gy + fz * gz, hx * gx + hy * gy + hz * gz
    s = fg / (a * g) if sound else g - g
    r = -hg / (b * g) if sound else g - g
    return (
        fold,
        u * ax,
        u * ay,
        u * az,
        (s - u) * ax + r * bx,
        (s - u) * ay + r * by,
        (s - u) * az + r * bz,
        w * bx,
        w * by,
        w * bz,
    )


@dataclass(frozen=True)
class HingeSet(Ties):
    """Angles or dihedrals of one law: a name for the ledger, the group, how many particles each joins (3 or 4), the law,
    the rest angle [rad] (None: the angle at the start), how many (None: only a file knows), and their particles' indices,
    shape [n, 3] or [n, 4]."""

    name: str
    groups: tuple[str]
    size: int
    law: HingeRecord
    rest: float | None
    count: int | None
    find: Callable[[], Ints]

    kind: ClassVar[str] = "hinges"
    verb: ClassVar[str] = "bends"
    holds: ClassVar[bool] = True

    @property
    def group(self) -> str:
        """The group whose particles it joins."""
        return self.groups[0]

    def describe(self) -> str:
        what = "angles" if self.size == 3 else "dihedrals"
        return f"{what if self.count is None else f'{self.count} {what}'}, k = {self.law.k:g} J"


class Hinges(Model):
    """What angles and dihedrals have in common."""

    key: ClassVar[str]
    """The key that lists the particles."""
    size: ClassVar[int]
    """Particles that each joins."""

    name: Name
    on: Name
    """The group whose particles are joined."""
    stiffness: Annotated[Joules, Ge(0)]
    """Stiffness k, in joules (per radian squared)."""
    form: Form = "harmonic"
    """U = ½ k d², or k (1 − cos d), of the deviation d from the rest angle."""

    def lists(self) -> tuple[tuple[int, ...], ...]:
        """Indices of the joined particles."""
        raise NotImplementedError

    def rest(self) -> float | None:
        """The rest angle as given [deg]."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _differ(self) -> Hinges:
        seen: dict[tuple[int, ...], int] = {}
        for k, particles in enumerate(self.lists()):
            if len(set(particles)) < len(particles):
                raise invalid(
                    f"names particle {max(particles, key=particles.count)} twice",
                    at=(self.key, k),
                    allowed=f"{self.size} different particles",
                )
            same = min(particles, particles[::-1])
            if same in seen:
                raise invalid(
                    "this is there already", at=(self.key, k), also=[((self.key, seen[same]), "here")]
                )
            seen[same] = k
        return self

    def hinges(self, label: str) -> HingeSet:
        """The angles or dihedrals as the engine takes them."""
        listed = np.array(self.lists(), dtype=np.int64)
        rest = self.rest()
        return HingeSet(
            label,
            (self.on,),
            self.size,
            hinge_record(self.form, self.stiffness),
            None if rest is None else math.radians(rest),
            len(listed),
            partial(_listed, listed),
        )


def hinge_record(form: Form, stiffness: float) -> HingeRecord:
    """The law of a form with a stiffness [J]."""
    return Harmonic(stiffness) if form == "harmonic" else Cosine(stiffness)


def _listed(indices: Ints) -> Ints:
    return indices


class Angles(Hinges):
    """Springs that resist a change of the angle at the middle one of three particles."""

    key: ClassVar[str] = "triples"
    size: ClassVar[int] = 3

    name: Name = "angles"
    """Name for the ledger and for messages."""
    triples: tuple[tuple[Index, Index, Index], ...] = Field(min_length=1)
    """Indices of the particles; the angle is at the middle one."""
    rest_angle: Annotated[Degrees, Ge(0), Le(180)] | None = None
    """Rest angle in degrees, 180 for a straight line; the angle at the start unless given."""

    def lists(self) -> tuple[tuple[int, ...], ...]:
        return self.triples

    def rest(self) -> float | None:
        return self.rest_angle


class Dihedrals(Hinges):
    """Springs that resist a change of the fold between two triangles with a common edge."""

    key: ClassVar[str] = "quadruples"
    size: ClassVar[int] = 4

    name: Name = "dihedrals"
    """Name for the ledger and for messages."""
    quadruples: tuple[tuple[Index, Index, Index, Index], ...] = Field(min_length=1)
    """Indices 1, 2, 3, 4 of the particles of the triangles 1–2–3 and 4–3–2; the edge is 2–3."""
    rest_angle: Annotated[Degrees, Ge(-180), Le(180)] | None = None
    """Rest fold in degrees, 0 for flat; the fold at the start unless given."""

    def lists(self) -> tuple[tuple[int, ...], ...]:
        return self.quadruples

    def rest(self) -> float | None:
        return self.rest_angle


def angles_at(x: Floats, rows: Ints) -> Floats:
    """Angles [rad] or folds of particles at x [3, n], by rows [hinges, 3] or [hinges, 4]; shape [hinges].

    As in `dihedral_gradient`, the fold of a degenerate triangle is 0.
    """
    points = [x[:, row].T for row in rows.T]
    if rows.shape[1] == 3:
        a, b = points[0] - points[1], points[2] - points[1]
        return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))
    f, g, h = points[0] - points[1], points[1] - points[2], points[3] - points[2]
    a, b = np.cross(f, g), np.cross(h, g)
    length = np.linalg.norm(g, axis=1)
    sine = (np.cross(b, a) * g).sum(axis=1) / np.where(length > 0, length, 1)
    sound = a.any(axis=1) & b.any(axis=1)
    return np.where(sound, np.arctan2(-sine, -(a * b).sum(axis=1)), 0.0)
