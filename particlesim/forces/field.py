"""Force fields written in the scenario: f = f(x, y, z, vx, vy, vz, t, m, r, T, q), or f = −∇U of a written potential.

Gradients come from forward differentiation of the expression, exact to rounding. The Jacobian of a potential's force is
the central difference of its exact gradient, with a relative error of about 10⁻¹⁰.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import Field as _Default
from pydantic import StringConstraints, model_validator

from particlesim.expressions import constants as names
from particlesim.expressions.discontinuities import creased, jumping
from particlesim.expressions.operations import (
    VARIABLES,
    VX,
    VY,
    VZ,
    Abs,
    IfLess,
    Maximum,
    Minimum,
    Node,
    Ray,
    Sign,
    Temperature,
    Time,
    slope,
    value,
)
from particlesim.expressions.parser import ExpressionError, attributes_read, parse, reads
from particlesim.forces.base import Force
from particlesim.laws.registry import (
    Matrix,
    Particle,
    Vector,
    force,
    force_dv,
    force_dx,
    law,
    moved_to,
    potential,
)
from particlesim.model.attributes import FURTHER
from particlesim.model.base import Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import Number

Expression = Annotated[str, StringConstraints(max_length=2000)]

FIXED = frozenset(VARIABLES) - {each.symbol for each in FURTHER}
"""Variables that no constant may hide. One named as a further attribute takes its place, so that formulas from before the
attribute mean what they did."""


class Field(Force):
    """A force by formulas: three components, or a potential energy to go down in."""

    type: Literal["field"] = "field"
    force: tuple[Expression, Expression, Expression] | None = None
    """Components of the force in newtons, as expressions of x, y, z, vx, vy, vz, t, m, r, T, q and the constants."""
    potential: Expression | None = None
    """Potential energy in joules as an expression, instead of the force; F = −∇U."""
    constants: dict[Name, Number] = _Default(default_factory=dict)
    """Numbers by name, for use in the expressions."""

    formula: ClassVar[str] = "f = f(x, v, t, m, r, T, q), or f = −∇U"
    by_place: ClassVar[bool] = True
    energy: ClassVar[str] = (
        "U as written, if a potential is given; else none: a field need not derive from one"
    )

    @model_validator(mode="after")
    def _parses(self) -> Field:
        if (self.force is None) == (self.potential is None):
            raise invalid(
                "needs either force or potential",
                allowed='force = ["-k*x", "0", "0"], or potential = "k*x**2/2"',
            )
        for name in self.constants:
            check_constant(name)
        for path, text in self._texts():
            try:
                node = parse(text, self.constants)
            except ExpressionError as error:
                hint = error.hint if text.strip() else 'write "0" for no force'
                raise invalid(
                    error.message, at=path, hint=hint, within=(error.offset, error.length)
                ) from None
            if path == ("potential",) and self._velocity(node):
                raise invalid("a potential depends on the place, not on the velocity", at=path)
        return self

    def _texts(self) -> list[tuple[tuple[str | int, ...], str]]:
        if self.force is not None:
            return [(("force", k), text) for k, text in enumerate(self.force)]
        return [(("potential",), self.potential or "0")]

    def nodes(self) -> list[Node]:
        """The expressions as trees of records."""
        return [parse(text, self.constants) for _, text in self._texts()]

    @staticmethod
    def _velocity(node: Node) -> bool:
        return any(reads(node, v) for v in (VX, VY, VZ))

    def record(self) -> FieldRecord | PotentialRecord:
        nodes = self.nodes()
        return FieldRecord(*nodes) if self.force is not None else PotentialRecord(nodes[0])

    def needs(self) -> frozenset[str]:
        return attributes_read(self.nodes())

    def changes(self) -> bool:
        """Whether it changes while a particle stands still: with time, or with the temperature."""
        return any(reads(node, kind) for node in self.nodes() for kind in (Time, Temperature))

    def kink(self) -> str | None:
        return (
            "its formula has a condition, abs, sign, min or max" if any(map(_kinked, self.nodes())) else None
        )

    def jump(self) -> tuple[tuple[str | int, ...], str] | None:
        """The key of an expression by which the force jumps somewhere, and what in it does; None if none is seen to."""
        if self.force is None:
            found = creased(self.nodes()[0])
            return None if found is None else (("potential",), found)
        jumps = jumping(self.nodes())
        return None if jumps is None else (("force", jumps[0]), jumps[1])

    def needs_velocity(self) -> bool:
        return any(self._velocity(node) for node in self.nodes())


def _kinked(node: Node) -> bool:
    """Whether an expression is not smooth."""
    if isinstance(node, IfLess | Abs | Sign | Minimum | Maximum):
        return True
    return any(isinstance(part, tuple) and _kinked(part) for part in node)


def check_constant(name: str) -> None:
    """Refuse a constant that no expression could name, or that would hide something else."""
    names.check_constant(name, FIXED)


class FieldRecord(NamedTuple):
    """Expressions of the components [N]."""

    x: Any
    y: Any
    z: Any


class PotentialRecord(NamedTuple):
    """Expression of the potential energy [J]."""

    u: Any


def along(p: Particle, x: float, y: float, z: float, vx: float, vy: float, vz: float) -> Ray:
    """A particle, and a direction in its position and velocity."""
    return Ray(p, Particle(x, y, z, vx, vy, vz, 0.0, 0.0, 0.0, 0.0, 0.0))


@law(force, FieldRecord)
def field_force(f: FieldRecord, p: Particle) -> Vector:
    return value(f.x, p), value(f.y, p), value(f.z, p)


def jacobian(f: FieldRecord, x: Ray, y: Ray, z: Ray) -> Matrix:
    """Slopes of the three components along three directions."""
    return (
        slope(f.x, x),
        slope(f.x, y),
        slope(f.x, z),
        slope(f.y, x),
        slope(f.y, y),
        slope(f.y, z),
        slope(f.z, x),
        slope(f.z, y),
        slope(f.z, z),
    )


@law(force_dx, FieldRecord)
def field_dx(f: FieldRecord, p: Particle) -> Matrix:
    x = along(p, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    y = along(p, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    z = along(p, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    return jacobian(f, x, y, z)


@law(force_dv, FieldRecord)
def field_dv(f: FieldRecord, p: Particle) -> Matrix:
    x = along(p, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    y = along(p, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    z = along(p, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    return jacobian(f, x, y, z)


def minus_gradient(u: Any, p: Particle) -> Vector:
    """−∇U."""
    return (
        -slope(u, along(p, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
        -slope(u, along(p, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)),
        -slope(u, along(p, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)),
    )


def shifted(p: Particle, x: float, y: float, z: float) -> Particle:
    """The particle moved by (x, y, z)."""
    return moved_to(p, p.x + x, p.y + y, p.z + z, p.vx, p.vy, p.vz, p.t)


@law(force, PotentialRecord)
def potential_force(f: PotentialRecord, p: Particle) -> Vector:
    return minus_gradient(f.u, p)


@law(potential, PotentialRecord)
def potential_energy(f: PotentialRecord, p: Particle) -> float:
    return value(f.u, p)


@law(force_dx, PotentialRecord)
def potential_dx(f: PotentialRecord, p: Particle) -> Matrix:
    h = 6e-6 * (1 + abs(p.x) + abs(p.y) + abs(p.z))  # ∛(machine epsilon) of the scale of the position
    ax, ay, az = minus_gradient(f.u, shifted(p, h, 0.0, 0.0))
    bx, by, bz = minus_gradient(f.u, shifted(p, -h, 0.0, 0.0))
    cx, cy, cz = minus_gradient(f.u, shifted(p, 0.0, h, 0.0))
    dx, dy, dz = minus_gradient(f.u, shifted(p, 0.0, -h, 0.0))
    ex, ey, ez = minus_gradient(f.u, shifted(p, 0.0, 0.0, h))
    gx, gy, gz = minus_gradient(f.u, shifted(p, 0.0, 0.0, -h))
    k = 0.5 / h
    return (
        k * (ax - bx),
        k * (cx - dx),
        k * (ex - gx),
        k * (ay - by),
        k * (cy - dy),
        k * (ey - gy),
        k * (az - bz),
        k * (cz - dz),
        k * (ez - gz),
    )


@law(force_dv, PotentialRecord)
def potential_dv(f: PotentialRecord, p: Particle) -> Matrix:
    return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
