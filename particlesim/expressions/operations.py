"""The operations of expressions as records, one type each, with the laws that compute them.

Each gives its `value` and, for gradients and Jacobians, its `slope` along a direction (forward differentiation).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from particlesim.laws.registry import Particle, evaluate, generic, law

Node = tuple[Any, ...]


class Ray(NamedTuple):
    """A particle, and a direction in which to differentiate."""

    p: Particle
    d: Particle


@generic(1)
def value(f: Any, p: Particle) -> float:
    """Value of an expression at a particle."""
    return evaluate(value, f, p)


@generic(1)
def slope(f: Any, p: Ray) -> float:
    """Derivative of an expression along a direction."""
    return evaluate(slope, f, p)


class Constant(NamedTuple):
    """A number."""

    number: float


law(value, Constant)(lambda f, p: f.number)
law(slope, Constant)(lambda f, p: f.number - f.number)


class X(NamedTuple):
    """Position x."""


class Y(NamedTuple):
    """Position y."""


class Z(NamedTuple):
    """Position z."""


class VX(NamedTuple):
    """Velocity along x."""


class VY(NamedTuple):
    """Velocity along y."""


class VZ(NamedTuple):
    """Velocity along z."""


class Mass(NamedTuple):
    """Mass."""


class Radius(NamedTuple):
    """Radius."""


class Temperature(NamedTuple):
    """Temperature."""


class Charge(NamedTuple):
    """Electric charge."""


class Time(NamedTuple):
    """Time."""


law(value, X)(lambda f, p: p.x)
law(slope, X)(lambda f, p: p.d.x)
law(value, Y)(lambda f, p: p.y)
law(slope, Y)(lambda f, p: p.d.y)
law(value, Z)(lambda f, p: p.z)
law(slope, Z)(lambda f, p: p.d.z)
law(value, VX)(lambda f, p: p.vx)
law(slope, VX)(lambda f, p: p.d.vx)
law(value, VY)(lambda f, p: p.vy)
law(slope, VY)(lambda f, p: p.d.vy)
law(value, VZ)(lambda f, p: p.vz)
law(slope, VZ)(lambda f, p: p.d.vz)
law(value, Mass)(lambda f, p: p.m)
law(slope, Mass)(lambda f, p: p.d.m)
law(value, Radius)(lambda f, p: p.r)
law(slope, Radius)(lambda f, p: p.d.r)
law(value, Temperature)(lambda f, p: p.T)
law(slope, Temperature)(lambda f, p: p.d.T)
law(value, Charge)(lambda f, p: p.q)
law(slope, Charge)(lambda f, p: p.d.q)
law(value, Time)(lambda f, p: p.t)
law(slope, Time)(lambda f, p: p.d.t)

VARIABLES: dict[str, Node] = {
    "x": X(),
    "y": Y(),
    "z": Z(),
    "vx": VX(),
    "vy": VY(),
    "vz": VZ(),
    "t": Time(),
    "m": Mass(),
    "r": Radius(),
    "T": Temperature(),
    "q": Charge(),
}
"""The variables that an expression may name."""


class Unary(NamedTuple):
    """An operation on a."""

    a: Any


class Binary(NamedTuple):
    """An operation on a and b."""

    a: Any
    b: Any


class Negate(Unary):
    """−a."""


class Add(Binary):
    """a + b."""


class Subtract(Binary):
    """a − b."""


class Multiply(Binary):
    """a b."""


class Divide(Binary):
    """a / b."""


class Square(Unary):
    """a²."""


class Power(NamedTuple):
    """aᵇ with a constant exponent b."""

    a: Any
    b: float


class GeneralPower(Binary):
    """aᵇ for a > 0, where b varies."""


law(value, Negate)(lambda f, p: -value(f.a, p))
law(slope, Negate)(lambda f, p: -slope(f.a, p))
law(value, Add)(lambda f, p: value(f.a, p) + value(f.b, p))
law(slope, Add)(lambda f, p: slope(f.a, p) + slope(f.b, p))
law(value, Subtract)(lambda f, p: value(f.a, p) - value(f.b, p))
law(slope, Subtract)(lambda f, p: slope(f.a, p) - slope(f.b, p))
law(value, Multiply)(lambda f, p: value(f.a, p) * value(f.b, p))
law(slope, Multiply)(lambda f, p: slope(f.a, p) * value(f.b, p.p) + value(f.a, p.p) * slope(f.b, p))
law(value, Divide)(lambda f, p: value(f.a, p) / value(f.b, p))
law(slope, Square)(lambda f, p: 2 * value(f.a, p.p) * slope(f.a, p))
law(value, Power)(lambda f, p: value(f.a, p) ** f.b)
law(value, GeneralPower)(lambda f, p: value(f.a, p) ** value(f.b, p))


@law(slope, Divide)
def _divide_slope(f: Divide, p: Ray) -> float:
    b = value(f.b, p.p)
    return (slope(f.a, p) - value(f.a, p.p) / b * slope(f.b, p)) / b


@law(value, Square)
def _square_value(f: Square, p: Particle) -> float:
    a = value(f.a, p)
    return a * a


@law(slope, Power)
def _power_slope(f: Power, p: Ray) -> float:
    d = slope(f.a, p)
    return f.b * value(f.a, p.p) ** (f.b - 1) * d if d != 0 else 0.0


@law(slope, GeneralPower)
def _general_power_slope(f: GeneralPower, p: Ray) -> float:
    a, b = value(f.a, p.p), value(f.b, p.p)
    da, db = slope(f.a, p), slope(f.b, p)
    # As for the square root below: a part that does not change adds nothing, where its factor is infinite too.
    return (b * a ** (b - 1) * da if da != 0 else 0.0) + (a**b * np.log(a) * db if db != 0 else 0.0)


class Sin(Unary):
    """sin a."""


class Cos(Unary):
    """cos a."""


class Tan(Unary):
    """tan a."""


class Asin(Unary):
    """asin a."""


class Acos(Unary):
    """acos a."""


class Atan(Unary):
    """atan a."""


class Sinh(Unary):
    """sinh a."""


class Cosh(Unary):
    """cosh a."""


class Tanh(Unary):
    """tanh a."""


class Exp(Unary):
    """exp a."""


class Log(Unary):
    """Natural logarithm of a."""


class Sqrt(Unary):
    """Square root of a."""


class Abs(Unary):
    """|a|."""


class Sign(Unary):
    """−1, 0 or 1 by the sign of a."""


class Atan2(Binary):
    """Angle of the point (b, a)."""


class Hypot(Binary):
    """√(a² + b²)."""


class Minimum(Binary):
    """The smaller of a and b."""


class Maximum(Binary):
    """The larger of a and b."""


class IfLess(NamedTuple):
    """yes where a < b, else no."""

    a: Any
    b: Any
    yes: Any
    no: Any


law(value, Sin)(lambda f, p: np.sin(value(f.a, p)))
law(slope, Sin)(lambda f, p: np.cos(value(f.a, p.p)) * slope(f.a, p))
law(value, Cos)(lambda f, p: np.cos(value(f.a, p)))
law(slope, Cos)(lambda f, p: -np.sin(value(f.a, p.p)) * slope(f.a, p))
law(value, Tan)(lambda f, p: np.tan(value(f.a, p)))
law(slope, Tan)(lambda f, p: slope(f.a, p) / np.cos(value(f.a, p.p)) ** 2)
law(value, Asin)(lambda f, p: np.arcsin(value(f.a, p)))
law(slope, Asin)(lambda f, p: slope(f.a, p) / np.sqrt(1 - value(f.a, p.p) ** 2))
law(value, Acos)(lambda f, p: np.arccos(value(f.a, p)))
law(slope, Acos)(lambda f, p: -slope(f.a, p) / np.sqrt(1 - value(f.a, p.p) ** 2))
law(value, Atan)(lambda f, p: np.arctan(value(f.a, p)))
law(slope, Atan)(lambda f, p: slope(f.a, p) / (1 + value(f.a, p.p) ** 2))
law(value, Sinh)(lambda f, p: np.sinh(value(f.a, p)))
law(slope, Sinh)(lambda f, p: np.cosh(value(f.a, p.p)) * slope(f.a, p))
law(value, Cosh)(lambda f, p: np.cosh(value(f.a, p)))
law(slope, Cosh)(lambda f, p: np.sinh(value(f.a, p.p)) * slope(f.a, p))
law(value, Tanh)(lambda f, p: np.tanh(value(f.a, p)))
law(slope, Tanh)(lambda f, p: slope(f.a, p) / np.cosh(value(f.a, p.p)) ** 2)
law(value, Exp)(lambda f, p: np.exp(value(f.a, p)))
law(slope, Exp)(lambda f, p: np.exp(value(f.a, p.p)) * slope(f.a, p))
law(value, Log)(lambda f, p: np.log(value(f.a, p)))
law(slope, Log)(lambda f, p: slope(f.a, p) / value(f.a, p.p))
law(value, Sqrt)(lambda f, p: np.sqrt(value(f.a, p)))
law(value, Abs)(lambda f, p: abs(value(f.a, p)))
law(slope, Abs)(lambda f, p: np.sign(value(f.a, p.p)) * slope(f.a, p))
law(value, Sign)(lambda f, p: np.sign(value(f.a, p)))
law(slope, Sign)(lambda f, p: 0.0)
law(value, Atan2)(lambda f, p: np.arctan2(value(f.a, p), value(f.b, p)))
law(value, Hypot)(lambda f, p: np.sqrt(value(f.a, p) ** 2 + value(f.b, p) ** 2))
law(value, Minimum)(lambda f, p: min(value(f.a, p), value(f.b, p)))
law(slope, Minimum)(lambda f, p: slope(f.a, p) if value(f.a, p.p) < value(f.b, p.p) else slope(f.b, p))
law(value, Maximum)(lambda f, p: max(value(f.a, p), value(f.b, p)))
law(slope, Maximum)(lambda f, p: slope(f.b, p) if value(f.a, p.p) < value(f.b, p.p) else slope(f.a, p))
law(value, IfLess)(lambda f, p: value(f.yes, p) if value(f.a, p) < value(f.b, p) else value(f.no, p))
law(slope, IfLess)(lambda f, p: slope(f.yes, p) if value(f.a, p.p) < value(f.b, p.p) else slope(f.no, p))


@law(slope, Sqrt)
def _sqrt_slope(f: Sqrt, p: Ray) -> float:
    # At the origin of sqrt(x**2 + y**2) this is 0, as the slope of |x| is: a particle that starts there stays finite.
    d = slope(f.a, p)
    return d / (2 * np.sqrt(value(f.a, p.p))) if d != 0 else 0.0


@law(slope, Atan2)
def _atan2_slope(f: Atan2, p: Ray) -> float:
    a, b = value(f.a, p.p), value(f.b, p.p)
    return (slope(f.a, p) * b - slope(f.b, p) * a) / (a * a + b * b)


@law(slope, Hypot)
def _hypot_slope(f: Hypot, p: Ray) -> float:
    a, b = value(f.a, p.p), value(f.b, p.p)
    d = slope(f.a, p) * a + slope(f.b, p) * b
    return d / np.sqrt(a * a + b * b) if d != 0 else 0.0


FUNCTIONS: dict[str, Callable[..., Node]] = {
    "sin": Sin,
    "cos": Cos,
    "tan": Tan,
    "asin": Asin,
    "acos": Acos,
    "atan": Atan,
    "sinh": Sinh,
    "cosh": Cosh,
    "tanh": Tanh,
    "exp": Exp,
    "log": Log,
    "sqrt": Sqrt,
    "abs": Abs,
    "sign": Sign,
    "atan2": Atan2,
    "hypot": Hypot,
    "min": Minimum,
    "max": Maximum,
}
"""Functions that an expression may call."""
