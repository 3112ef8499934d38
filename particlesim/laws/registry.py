"""Laws: pure scalar functions of a parameter record and a particle.

A *record* is a NamedTuple of numbers (or of further records). A *generic* is a quantity that many laws can give, such
as the force on a particle; `law` says which function gives it for which record. Kernels see only records: the types in a
tuple of records select the laws at compile time and inline them, so the tuple of record types is the program.

A generic applied to a plain tuple of records is the sum over them. Everything here is plain Python: kernels compile it, and
tests and the stability analysis call it as it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from particlesim.compiler.intrinsics import often
from particlesim.model.attributes import FURTHER

Record = tuple[Any, ...]
Vector = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]  # row by row

ZERO_MATRIX: Matrix = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


# What a contact does to a particle: nothing beyond the bounce; it stays there; it dies at a plane; it has left the world; it
# dies at another collider.
PASS = 0
STICK = 1
KILL = 2
LEAVE = 3
ABSORB = 4


class Particle(NamedTuple):
    """One particle: position [m], velocity [m/s], mass [kg], radius [m], temperature [K], and the time [s].

    `w` is the inverse mass [1/kg], for integrators: a division less in every step. Laws use the mass. Then
    come the further attributes of `particlesim.model.attributes`, by their symbols: the charge q [C].
    """

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    m: float
    r: float
    T: float
    t: float
    w: float = math.nan
    q: float = 0.0


FIRST_FURTHER = Particle._fields.index("w") + 1
assert Particle._fields[FIRST_FURTHER:] == tuple(each.symbol for each in FURTHER), (
    "Particle lacks an attribute"
)


def further(p: Any) -> Any:
    """The further attributes of a particle, in the order of their table."""
    return p[FIRST_FURTHER:]


class Generic(NamedTuple):
    """A quantity given by laws: its function, laws by record type, how many numbers it returns (0: laws do not add up)."""

    function: Callable[..., Any]
    laws: dict[type, Callable[..., Any]]
    size: int


GENERICS: dict[Callable[..., Any], Generic] = {}


F = TypeVar("F", bound=Callable[..., Any])


def moved_to(
    p: Particle, x: float, y: float, z: float, vx: float, vy: float, vz: float, t: float
) -> Particle:
    """The particle at another place, velocity and time."""
    return Particle(x, y, z, vx, vy, vz, p.m, p.r, p.T, t, p.w, *further(p))


def with_radius(p: Particle, r: float) -> Particle:
    """The particle with another radius."""
    return Particle(p.x, p.y, p.z, p.vx, p.vy, p.vz, p.m, r, p.T, p.t, p.w, *further(p))


def law(generic: Callable[..., Any], record: type) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Register the decorated function as the law that gives `generic` for `record`."""

    def register(function: Callable[..., Any]) -> Callable[..., Any]:
        laws = GENERICS[generic].laws
        if record in laws:
            raise ValueError(f"{record.__name__} already has a law for {generic.__name__}")
        laws[record] = function
        return function

    return register


def has_law(generic: Callable[..., Any], record: Record) -> bool:
    """Whether a record's type gives this quantity."""
    return type(record) in GENERICS[generic].laws


def generic(size: int) -> Callable[[F], F]:
    """Declare the decorated function as a generic that returns `size` numbers (0: laws do not add up).

    The function's body is `return evaluate(<itself>, record, particle)`.
    """

    def declare(function: F) -> F:
        GENERICS[function] = Generic(function, {}, size)
        return function

    return declare


@often
def evaluate(generic: Callable[..., Any], record: Record, p: Any) -> Any:
    """A generic of a record, or the sum over a plain tuple of records; zeros in the precision of the particle.

    Raises TypeError when the record has no law for it.
    """
    quantity = GENERICS[generic]
    if type(record) is not tuple:
        if type(record) not in quantity.laws:
            raise TypeError(f"{type(record).__name__} has no law for {generic.__name__}")
        return quantity.laws[type(record)](record, p)
    if quantity.size == 0:
        raise TypeError(f"laws for {generic.__name__} do not add up")
    if len(record) == 0:
        zero = type(p[0])(0)
        return zero if quantity.size == 1 else (zero,) * quantity.size
    if len(record) == 1:
        return evaluate(generic, record[0], p)
    half = len(record) // 2  # by halves, so that a long chain does not nest as deep
    first, second = evaluate(generic, record[:half], p), evaluate(generic, record[half:], p)
    return first + second if quantity.size == 1 else add(first, second)


def add(a: Any, b: Any) -> Any:
    """Sum of two vectors or two matrices."""
    return tuple(u + v for u, v in zip(a, b, strict=True))


def times(a: Any, x: Any, y: Any, z: Any) -> Any:
    """Matrix times vector."""
    return (
        a[0] * x + a[1] * y + a[2] * z,
        a[3] * x + a[4] * y + a[5] * z,
        a[6] * x + a[7] * y + a[8] * z,
    )


@generic(3)
def force(f: Any, p: Particle) -> Vector:
    """Force on a particle [N]."""
    return evaluate(force, f, p)


@generic(1)
def potential(f: Any, p: Particle) -> float:
    """Potential energy of a particle in a conservative force [J]: F = −∇U."""
    return evaluate(potential, f, p)


@generic(9)
def force_dx(f: Any, p: Particle) -> Matrix:
    """Jacobian of a force by position, ∂f_i/∂x_j [N/m], row by row."""
    return evaluate(force_dx, f, p)


@generic(9)
def force_dv(f: Any, p: Particle) -> Matrix:
    """Jacobian of a force by velocity, ∂f_i/∂v_j [N s/m], row by row."""
    return evaluate(force_dv, f, p)


@generic(3)
def bond_force(f: Any, b: Any) -> Vector:
    """Force on the first end of a bond [N]; the second end feels its opposite."""
    return evaluate(bond_force, f, b)


@generic(1)
def bond_potential(f: Any, b: Any) -> float:
    """Potential energy of a bond [J]."""
    return evaluate(bond_potential, f, b)


@generic(1)
def hinge_energy(f: Any, d: Any) -> float:
    """Potential energy of an angle or a dihedral that is d [rad] away from its rest angle [J]."""
    return evaluate(hinge_energy, f, d)


@generic(1)
def hinge_moment(f: Any, d: Any) -> float:
    """Derivative of `hinge_energy` by the angle [J/rad]."""
    return evaluate(hinge_moment, f, d)


@generic(1)
def hinge_stiffness(f: Any, d: Any) -> float:
    """Second derivative of `hinge_energy` by the angle [J/rad²]."""
    return evaluate(hinge_stiffness, f, d)


@generic(3)
def triangle_force(f: Any, s: Any) -> Vector:
    """Force on a triangle of a surface [N]; each corner feels a third of it."""
    return evaluate(triangle_force, f, s)


@generic(9)
def triangle_force_dv(f: Any, s: Any) -> Matrix:
    """Jacobian of the force on a triangle by the mean velocity of its corners [N s/m], row by row; symmetric."""
    return evaluate(triangle_force_dv, f, s)


@generic(9)
def bond_force_dx(f: Any, b: Any) -> Matrix:
    """Jacobian of a bond's force by l = x₁ − x₂ [N/m], row by row."""
    return evaluate(bond_force_dx, f, b)


@generic(9)
def bond_force_dv(f: Any, b: Any) -> Matrix:
    """Jacobian of a bond's force by v₁ − v₂ [N s/m], row by row."""
    return evaluate(bond_force_dv, f, b)


@generic(3)
def velocity(f: Any, p: Particle) -> Vector:
    """Velocity of a fluid at the particle's place and time [m/s]."""
    return evaluate(velocity, f, p)


@generic(9)
def velocity_dx(f: Any, p: Particle) -> Matrix:
    """Gradient of a fluid's velocity, ∂w_i/∂x_j [1/s], row by row."""
    return evaluate(velocity_dx, f, p)


@generic(0)
def path(m: Any, p: Particle) -> tuple[float, float, float, float, float, float]:
    """Position [m] and velocity [m/s] at time p.t of a particle that is led along a path from its place at the start."""
    return evaluate(path, m, p)


@generic(0)
def gap(c: Any, p: Particle) -> float:
    """Distance from a particle's surface to a collider [m]; negative where it overlaps."""
    return evaluate(gap, c, p)


@generic(0)
def normal(c: Any, p: Particle) -> Vector:
    """Gradient of a gap, the unit vector away from a collider; a component that is always zero may be None."""
    return evaluate(normal, c, p)


@generic(0)
def gap_and_normal(c: Any, p: Particle) -> tuple[float, Vector]:
    """Both at once, for shapes that find them by one search."""
    laws = GENERICS[gap_and_normal].laws
    return laws[type(c)](c, p) if type(c) in laws else (gap(c, p), normal(c, p))


@generic(0)
def side_from(c: Any, p: Particle, q: Particle) -> tuple[float, Vector]:
    """Gap and normal at q of the side of a collider that p touches, also beyond its other side, which may be near: for
    shapes that are put together."""
    laws = GENERICS[side_from].laws
    return laws[type(c)](c, p, q) if type(c) in laws else gap_and_normal(c, q)


@generic(0)
def surface(c: Any, p: Particle) -> Vector:
    """Centre of a particle [m] that is put back on the surface of a collider: for shapes that know it to the last bit."""
    return evaluate(surface, c, p)


@generic(0)
def least_gap(c: Any, p: Particle, need: float) -> float:
    """A lower bound of the gap [m]: any that is above `need`, else a good one. For shapes whose gap takes a search."""
    laws = GENERICS[least_gap].laws
    return laws[type(c)](c, p, need) if type(c) in laws else gap(c, p)


@generic(0)
def sure_gap(c: Any, p: Particle) -> float:
    """The gap [m], or what has its sign and is no farther from 0: for shapes whose gap is not always a distance."""
    laws = GENERICS[sure_gap].laws
    return laws[type(c)](c, p) if type(c) in laws else gap(c, p)


@generic(0)
def thinnest(c: Any) -> float:
    """A length that a particle must move to get through any part of a shape [m]: for shapes with dents, where what lies on
    one part may meet another."""
    return GENERICS[thinnest].laws[type(c)](c)


@generic(0)
def bend(c: Any) -> int:
    """How the gap bends along straight lines: 1 where it is a convex function of the place, as that of a ball, −1 where it
    is a concave one, as that of a bowl or a plane; 0 where it is neither."""
    laws = GENERICS[bend].laws
    return laws[type(c)](c) if type(c) in laws else 0


@generic(0)
def apart(c: Any, p: Particle, q: Particle, h: float, slack: float) -> bool:
    """Whether a step of h from p to q is sure not to touch a collider before its end: a quick look, without loops, that may
    say no for nothing. Gaps above −`slack` [m] are rounding."""
    return GENERICS[apart].laws[type(c)](c, p, q, h, slack)


@generic(0)
def first_contact(c: Any, p: Particle, q: Particle, h: float, slack: float) -> float:
    """The part of a step of h from p to q after which it first overlaps a collider, 1 where it does not before its end.

    For shapes that a way between two legal places may cross; they have a law for `apart` as well. The way of the step is
    the parabola through both places with the velocity of p (`particlesim.colliders.way`)."""
    return GENERICS[first_contact].laws[type(c)](c, p, q, h, slack)


@generic(0)
def contact(c: Any, p: Particle) -> tuple[Particle, int]:
    """The particle after meeting a collider that it overlaps, and what becomes of it: PASS, STICK, KILL, LEAVE or ABSORB."""
    return evaluate(contact, c, p)
