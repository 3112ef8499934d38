"""Particles that touch each other: hard contacts by impulses, or soft ones by springs and dampers.

`linear`: N = k δ and γ_n = 2 β √(m k), with m = m₁ m₂/(m₁ + m₂) and β = −ln e/√(π² + ln² e): a damped oscillator, that is
apart again after π/(√(k/m) √(1 − β²)) with e times its speed. Along the surfaces k_t = 2 k/7 unless given.

`hertz`: N = 4/3 E √(R δ) δ with 1/E = 2 (1 − ν²)/Y, 1/R = 1/r₁ + 1/r₂, and γ_n = √5 β √(m k₁) δ^¼, k₁ = 4/3 E √R, with which
e does not depend on speed. Along the surfaces, after Mindlin, k_t = 8 G √(R δ), 1/G = 4 (2 − ν) (1 + ν)/Y. In both models
γ_t = 2 β √(m k_t), times √(5/6) in the second.

Source: P. A. Cundall, O. D. L. Strack, Géotechnique 29, 47 (1979); Y. Tsuji, T. Tanaka, T. Ishida, Powder Technol. 71, 239
(1992); S. J. Antypov, J. A. Elliott, EPL 94, 50004 (2011); R. D. Mindlin, J. Appl. Mech. 16, 259 (1949).

Spheres that rub each other turn: I = 2/5 m r², and v_t is the velocity of their surfaces where they touch. Rolling friction
is a spring, a damper and a slider along the way ρ that one has rolled on the other, ρ' = R (ω₁ − ω₂) × n, with k_t and γ_t:
a moment R n × f_r with |f_r| ≤ μ_r N; of hard spheres it stops rolling at once, within the same bound
(`engine.interactions.hard.friction`). Cohesion with a work w is an attraction 2 π w R while they touch (`dmt`), or grows
with the surface that touches (`jkr`): with its radius a,

    f_n = 4 E a³/(3 R) − √(8 π w E a³),   δ = a²/R − √(2 π w a/E),

from δ = 0 on, where they come to touch, until δ = −3 a_c²/R, a_c³ = π w R²/(8 E), where they snap apart. With α = a/a_c and
d = δ R/a_c² that is d = α² − 4 √α, a quartic for √α whose resolvent cubic m³ + d m = 2 has one real root, and
f_n = π w R/6 (α³ − 6 √α³). Dampers and the spring along the surfaces have a in place of √(R δ), and friction goes by
f_n + 3 π w R (C. Thornton, J. Phys. D 24, 1942 (1991)).

Source: J. Ai, J.-F. Chen, J. M. Rotter, J. Y. Ooi, Powder Technol. 206, 269 (2011), their type C (elastic-plastic spring and
dashpot); S. Luding, Granul. Matter 10, 235 (2008) for ρ; B. V. Derjaguin, V. M. Muller, Yu. P. Toporov, J. Colloid
Interface Sci. 53, 314 (1975); K. L. Johnson, K. Kendall, A. D. Roberts, Proc. R. Soc. A 324, 301 (1971).

`impulse`: hard spheres, whose contacts take no time: see `engine.interactions.hard`; and surfaces and strands, which
never pass through each other: see `engine.interactions.surfaces`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le
from pydantic import StrictBool, model_validator

from particlesim.colliders.friction import FallingRestitution, Friction, Rubbing
from particlesim.colliders.response import FallingRecord, FrictionRecord
from particlesim.compiler.roots import root
from particlesim.interactions.base import PairInteraction
from particlesim.interactions.contact_steps import RAYLEIGH, RESOLVES, contact_time, rayleigh_time
from particlesim.laws.contact import Touch, contact_law, reduced_mass, reduced_radius
from particlesim.laws.pair import Pair, pair_force, pair_force_dv, pair_force_dx, pair_potential
from particlesim.laws.registry import ZERO_MATRIX, Matrix, Vector, law
from particlesim.model.mistakes import invalid
from particlesim.model.units import NewtonsPerMetre, Number, Pascals

KEYS = {
    "impulse": (),
    "linear": ("stiffness", "tangential_stiffness"),
    "hertz": ("young_modulus", "poisson_ratio", "adhesion"),
}
"""Keys that belong to one model."""
SOFT = {"cohesion": 0, "overlap": "auto"}
"""Keys of all models but hard impulses, and what they are unless given."""
NEEDED = {"linear": ("stiffness", '"1000 N/m"'), "hertz": ("young_modulus", '"10 MPa"')}

STRETCHED = 0.2
"""Part of its radius by which a grain may stretch before it separates from another, for warnings about JKR."""
AT_REST = 0.01
"""Gap between two hard grains that may lie on each other, at most, as a part of the sum of their radii."""


class Contact(Rubbing, PairInteraction):
    """Particles, surfaces and strands that touch each other, with restitution and friction."""

    type: Literal["contact"] = "contact"
    model: Literal["impulse", "linear", "hertz"] = "impulse"
    """`impulse`: hard spheres, whose impacts take no time, and which never pass through each other; `linear`: a spring and a
    damper between those that overlap; `hertz`: the same with the elasticity of spheres."""
    surfaces: StrictBool | None = None
    """Whether cloth, jelly and meshes touch with their triangles, and ropes, nets, hair and bridges with their edges, as
    thick as twice the radius of their particles: with `impulse` they do unless this is false, with the other models
    particles touch as spheres."""
    restitution: Annotated[Number, Ge(0), Le(1)] | FallingRestitution = 1.0
    """Speed after over speed before an impact, along the line of centres: 1 elastic, 0 no rebound; or, of `impulse`, a
    table, where it falls with the speed of the impact."""
    friction: Annotated[Number, Ge(0)] | Friction = 0.0
    """Coefficient of Coulomb friction μ, or a table with one at rest and one in motion."""
    rolling_friction: Annotated[Number, Ge(0)] = 0.0
    """Coefficient of rolling friction μ_r of grains that turn: rolling is held back by a moment of up to μ_r R N, with R the
    reduced radius r₁ r₂/(r₁ + r₂), or r at a collider with friction and at flat rigid bodies that the contact names. Grains
    that are not round have some 0.1 to 0.5."""
    cohesion: Annotated[NewtonsPerMetre, Ge(0)] = 0.0
    """Work of adhesion w of soft contacts, per area [J/m²]."""
    adhesion: Literal["dmt", "jkr"] = "dmt"
    """How w acts: `dmt` as an attraction 2 π w R while two touch, for small stiff grains; `jkr`, of `hertz`, with the
    surface that touches: they stretch before they part, at 3/2 π w R, and lose energy; for soft or large ones."""
    overlap: Literal["auto", "relax", "keep"] = "auto"
    """What becomes of soft particles that overlap at the start: `relax` moves them apart before the first step until
    overlaps are a hundredth of the smaller radius, `auto` does so if one is deeper than a twentieth, `keep` lets them
    push."""
    stiffness: Annotated[NewtonsPerMetre, Gt(0)] | None = None
    """Stiffness k of the spring of `linear`."""
    tangential_stiffness: Annotated[NewtonsPerMetre, Gt(0)] | None = None
    """Stiffness k_t of the spring along the surfaces of `linear`; 2/7 of the other unless given."""
    young_modulus: Annotated[Pascals, Gt(0)] | None = None
    """Young's modulus Y of the grains of `hertz`."""
    poisson_ratio: Annotated[Number, Gt(-1), Le(0.5)] = 0.3
    """Poisson's ratio ν of the grains of `hertz`."""

    unused: ClassVar[tuple[str, ...]] = ("cutoff", "shift")
    formula: ClassVar[str] = (
        "δ = r₁ + r₂ − |l| > 0: linear f_n = k δ − γ v_n; hertz f_n = 4/3 E √(R δ) δ − γ δ^¼ v_n; impulse v_n' = −e v_n; "
        "friction |f_t| ≤ μ f_n at surfaces that turn with ω; rolling friction |M| ≤ μ_r R f_n; cohesion 2 π w R"
    )
    energy: ClassVar[str] = (
        "U = k δ²/2 (linear), 8/15 E √R δ^(5/2) (hertz), less 2 π w R δ of cohesion, none (impulse); friction and dampers "
        "take energy"
    )

    @model_validator(mode="after")
    def _fits_model(self) -> Contact:
        for model, keys in KEYS.items():
            for key in keys:
                if model != self.model and getattr(self, key) != type(self).model_fields[key].default:
                    raise invalid(
                        f'{key} belongs to model = "{model}"',
                        at=(key,),
                        also=[(("model",), f"{self.model} here")],
                    )
        if self.soft and isinstance(self.restitution, FallingRestitution):
            raise invalid(
                "restitution that falls with speed belongs to impulses; that of springs and dampers is one number",
                at=("restitution",),
                also=[(("model",), f"{self.model} here")],
                allowed="a number from 0 to 1",
            )
        if self.model in NEEDED:
            key, example = NEEDED[self.model]
            if getattr(self, key) is None:
                raise invalid(
                    f'model = "{self.model}" needs a {key}', at=("model",), allowed=f"{key} = {example}, say"
                )
        return self

    @model_validator(mode="after")
    def _is_soft(self) -> Contact:
        for key, default in SOFT.items():
            if self.model == "impulse" and getattr(self, key) != default:
                raise invalid(
                    f"{key} needs contacts that last",
                    at=(key,),
                    also=[(("model",), "impulses take no time")],
                    allowed='model = "linear" or "hertz"',
                )
        if self.adhesion == "jkr" and self.cohesion == 0:
            raise invalid(
                "there is no work of adhesion", at=("adhesion",), allowed="cohesion = 0.05 (J/m²), say"
            )
        if self.rolling_friction > 0 and not self.rubs:
            raise invalid(
                "rolling_friction needs friction: without it nothing begins to roll",
                at=("rolling_friction",),
                allowed="friction = 0.5, say",
            )
        return self

    @model_validator(mode="after")
    def _touches(self) -> Contact:
        if self.surfaces and self.model != "impulse":
            raise invalid(
                'surfaces touch by impulses: this belongs to model = "impulse"',
                at=("surfaces",),
                also=[(("model",), f"{self.model} here")],
            )
        return self

    @property
    def rolls(self) -> float:
        return self.rolling_friction

    @property
    def by_impulses(self) -> bool:
        return self.model == "impulse"

    @property
    def by_surfaces(self) -> bool:
        return self.model == "impulse" and self.surfaces is not False

    @model_validator(mode="after")
    def _ends_by_itself(self) -> Contact:
        for key, default in (("cutoff", None), ("shift", "none")):
            if getattr(self, key) != default:
                raise invalid("contact ends where two particles no longer touch", at=(key,))
        if self.method not in ("auto", "neighbours"):
            raise invalid(
                "contacts are found by neighbour lists", at=("method",), allowed='"auto", "neighbours"'
            )
        return self

    @property
    def beta(self) -> float:
        """The damping ratio β of a linear contact, 1 for no rebound."""
        return damping_ratio(self.liveliness)

    @property
    def soft(self) -> bool:
        return self.model != "impulse"

    @property
    def must_part(self) -> bool:
        return self.overlap == "relax"

    @property
    def parts(self) -> bool:
        """Whether particles that overlap at the start are moved apart."""
        return self.soft and self.overlap != "keep"

    @property
    def moduli(self) -> tuple[float, float]:
        """E and G of a pair of grains of `hertz` [Pa]."""
        assert self.young_modulus is not None
        y, nu = self.young_modulus, self.poisson_ratio
        return y / (2 * (1 - nu * nu)), y / (4 * (2 - nu) * (1 + nu))

    def record(self) -> tuple[Any, ...]:
        made = self.against(float(self.liveliness), self.coefficients)
        return made._replace(falling=self.falling) if isinstance(made, ImpulseRecord) else made

    def against(self, restitution: float, friction: tuple[float, float]) -> tuple[Any, ...]:
        """The record of contacts with another restitution and other coefficients of friction, such as those of a wall."""
        rubs = FrictionRecord(*map(float, friction)) if friction != (0, 0) else None
        rolls = float(self.rolling_friction) if self.rolling_friction > 0 and rubs is not None else None
        if self.model == "impulse":
            return ImpulseRecord(restitution, rubs, rolling=rolls)
        beta = damping_ratio(restitution)
        if self.adhesion == "jkr":
            w, e = math.pi * self.cohesion, self.moduli[0]
            return JkrRecord(*self.moduli, beta, rubs, rolls, w, (w / (8 * e)) ** (1 / 3))
        sticks = 2 * math.pi * self.cohesion if self.cohesion > 0 else None
        if self.model == "hertz":
            return HertzRecord(*self.moduli, beta, rubs, rolls, sticks)
        assert self.stiffness is not None
        along = 2 / 7 * self.stiffness if self.tangential_stiffness is None else self.tangential_stiffness
        return LinearRecord(self.stiffness, along, beta, rubs, rolls, sticks)

    def needs(self) -> frozenset[str]:
        return frozenset({"radius"})

    def touching(self) -> bool:
        return True

    def singular(self) -> bool:
        return False

    def needs_velocity(self) -> bool:
        return self.model == "impulse" or self.liveliness < 1 or self.rubs

    def remembers(self) -> bool:
        return self.model == "impulse" or self.rubs or self.adhesion == "jkr"

    def beyond(self, radius: float) -> float:
        """How far the surfaces of two particles of at most a radius may be apart and still hold on to each other, or lie on
        each other if they are hard [m]; a collider counts as a sphere without end."""
        if not self.soft:
            return AT_REST * 2 * radius
        if self.adhesion != "jkr":
            return 0.0
        return float(stretch(JkrRecord(*self.record()), radius))

    def conserves(self) -> bool:
        return self.soft and self.liveliness == 1 and not self.rubs and self.adhesion != "jkr"

    def stores(self) -> bool:
        return self.model != "impulse"

    def feeds(self) -> bool:
        return False

    def doubts(self, lightest: tuple[float, float] | None, dt: float) -> Iterator[str]:
        yield from self.friction_doubts(self.label)
        if lightest is None or not self.soft:
            return
        mass, radius = lightest
        if (reach := self.beyond(radius)) > STRETCHED * radius:
            yield (
                f"{self.label}: the smallest grains stretch by {reach:.3g} m before they part, and have a radius of "
                f"{radius:.3g} m; JKR is a law of small deformations: a smaller cohesion, or a larger young_modulus"
            )
        if self.stiffness is not None:
            # Along the surface the mass of two equal balls that turn is 2/7 of that along the normal.
            along = 3.5 * (self.tangential_stiffness or 0.0) if self.rubs else 0.0
            lasts = contact_time(max(self.stiffness, along), self.beta, mass / 2)
            if dt > lasts / RESOLVES:
                yield (
                    f"{self.label}: a contact of the lightest particles lasts {lasts:.3g} s, {lasts / dt:.3g} steps; "
                    f"restitution needs about {RESOLVES}, dt = {lasts / RESOLVES:.2g} s"
                )
            return
        assert self.young_modulus is not None
        wave = rayleigh_time(self.young_modulus, self.poisson_ratio, mass, radius)
        if dt > RAYLEIGH * wave:
            yield (
                f"{self.label}: Rayleigh's time of the smallest grains is {wave:.3g} s, {wave / dt:.3g} steps; contacts "
                f"need steps of a fifth of it, dt = {RAYLEIGH * wave:.2g} s"
            )

    def describe(self) -> str:
        static, kinetic = self.coefficients
        rub = (
            ""
            if not self.rubs
            else f", μ = {static:g}"
            if static == kinetic
            else f", μ = {static:g}/{kinetic:g}"
        )
        rub += f", μ_r = {self.rolling_friction:g}" if self.rolling_friction > 0 else ""
        rub += f", w = {self.cohesion:g} J/m² ({self.adhesion.upper()})" if self.cohesion > 0 else ""
        falls = ", falling with speed" if isinstance(self.restitution, FallingRestitution) else ""
        return f"{self.model}, e = {self.liveliness:g}{falls}{rub}, where particles touch"


def damping_ratio(restitution: float) -> float:
    """β = −ln e/√(π² + ln² e): that of a damped oscillator which rebounds with e; 1 for no rebound."""
    if restitution == 0:
        return 1.0
    fall = -math.log(restitution)
    return fall / math.hypot(math.pi, fall)


class LinearRecord(NamedTuple):
    """k, k_t [N/m], β, friction, μ_r, and 2 π w [N/m]; the last three None where there is none."""

    stiffness: float
    tangential: float
    beta: float
    friction: FrictionRecord | None
    rolling: float | None = None
    cohesion: float | None = None


class HertzRecord(NamedTuple):
    """E, G [Pa], β, friction, μ_r, and 2 π w [N/m]; the last three None where there is none."""

    normal: float
    tangential: float
    beta: float
    friction: FrictionRecord | None
    rolling: float | None = None
    cohesion: float | None = None


class JkrRecord(NamedTuple):
    """E, G [Pa], β, friction, μ_r, the last two None where there is none; π w [N/m], a_c/∛R² = ∛(π w/(8 E)) [m^(1/3)]."""

    normal: float
    tangential: float
    beta: float
    friction: FrictionRecord | None
    rolling: float | None
    cohesion: float
    size: float


class ImpulseRecord(NamedTuple):
    """e of slow impacts, friction, how e falls with speed, and μ_r; the last three None where there is none."""

    restitution: float
    friction: FrictionRecord | None
    falling: FallingRecord | None = None
    rolling: float | None = None


@contact_law(LinearRecord)
def linear_touch(f: LinearRecord, p: Pair, overlap: float) -> Touch:
    k, m, none = f.stiffness, reduced_mass(p), overlap - overlap
    double = f.beta + f.beta
    push, pull, root = k * overlap, attraction(f, p, none), double * np.sqrt(m)
    return Touch(
        push,
        k + none,
        (0.5 * push - pull) * overlap,
        root * np.sqrt(k),
        none,
        f.tangential + none,
        root * np.sqrt(f.tangential),
        pull,
    )


def attraction(f: Any, p: Pair, none: float) -> float:
    """2 π w R [N]."""
    return none if f.cohesion is None else f.cohesion * reduced_radius(p)


ROOT_5 = math.sqrt(5.0)
ROOT_32 = math.sqrt(32.0)
TWO = 2 * math.sqrt(5 / 6) * math.sqrt(6.0) / ROOT_5
"""What is left of 2 √(5/6) √(m 8 G √(R δ)) over √5 √(m 4/3 E √(R δ)), beside √(G/E): √(8/(4/3)) = √6."""


@contact_law(HertzRecord)
def hertz_touch(f: HertzRecord, p: Pair, overlap: float) -> Touch:
    m, kind = reduced_mass(p), type(overlap)
    wide, pull = root(reduced_radius(p) * overlap), attraction(f, p, overlap - overlap)
    k = kind(4 / 3) * f.normal * wide
    along = kind(8) * f.tangential * wide
    damping = kind(ROOT_5) * f.beta * root(m * k)
    return Touch(
        k * overlap,
        kind(1.5) * k,
        (kind(0.4) * k * overlap - pull) * overlap,
        damping,
        kind(0.25) * damping / overlap,
        along,
        # 2 √(5/6) β √(m k_t): k_t over k is the same at all overlaps
        kind(TWO) * np.sqrt(f.tangential / f.normal) * damping,
        pull,
    )


def stretch(f: JkrRecord, radius: float) -> float:
    """How far a contact with a reduced radius stretches until it snaps, 3 a_c²/R [m]."""
    kind = type(radius)
    return kind(3) * f.size * f.size * radius ** kind(1 / 3)


def jumps(f: JkrRecord, radius: Any) -> tuple[Any, Any]:
    """What contacts with reduced radii give as they come to touch, and as they snap apart [J]: nothing gives it back."""
    unit = f.cohesion * (f.size * radius ** (2 / 3)) ** 2 / 6
    return -3.6 * 4 ** (4 / 3) * unit, -2.4 * unit


@contact_law(JkrRecord)
def jkr_touch(f: JkrRecord, p: Pair, overlap: float) -> Touch:
    m, kind, radius = reduced_mass(p), type(overlap), reduced_radius(p)
    none, one = overlap - overlap, kind(1)
    least = f.size * radius ** kind(2 / 3)
    unit = least * least / radius
    d = max(overlap / unit, kind(-3))
    third = d / kind(3)
    u = (one + np.sqrt(max(one + third * third * third, none))) ** kind(
        2 / 3
    )  # the square of Cardano's larger root
    cubic = kind(2) / (u + third + third * third / u)
    root = kind(0.5) * (
        np.sqrt(cubic + cubic) + np.sqrt(max(kind(ROOT_32) / np.sqrt(cubic) - cubic - cubic, none))
    )
    wide, cube = root * root, root * root * root
    # what grows without bounds as the contact snaps
    opens = max(cube - one, kind(1e-6))
    pull = f.cohesion * radius
    force = kind(1 / 6) * pull * (cube * cube - kind(6) * cube)
    damping = kind(ROOT_5) * f.beta * np.sqrt(m * kind(4 / 3) * f.normal * least * wide)
    return Touch(
        force + kind(3) * pull,
        kind(0.25) * pull / unit * root * root * (cube - kind(3)) / opens,
        kind(1 / 6)
        * f.cohesion
        * least
        * least
        * wide
        * wide
        * (kind(0.4) * cube * cube - kind(4) * cube + kind(6)),
        damping,
        kind(0.25) * damping / unit * root / (wide * opens),
        kind(8) * f.tangential * least * wide,
        kind(TWO) * np.sqrt(f.tangential / f.normal) * damping,
        kind(3) * pull,
    )


@law(pair_force, ImpulseRecord)
def no_force(f: ImpulseRecord, p: Pair) -> Vector:
    return p.x - p.x, p.x - p.x, p.x - p.x


@law(pair_potential, ImpulseRecord)
def no_potential(f: ImpulseRecord, p: Pair) -> float:
    return p.x - p.x


@law(pair_force_dx, ImpulseRecord)
@law(pair_force_dv, ImpulseRecord)
def no_slope(f: ImpulseRecord, p: Pair) -> Matrix:
    return ZERO_MATRIX
