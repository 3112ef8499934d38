"""What a scenario may say of how a surface rebounds and rubs: restitution by speed, static and kinetic friction."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from annotated_types import Ge, Gt, Le

from particlesim.colliders.response import FallingRecord
from particlesim.model.base import Model
from particlesim.model.units import MetresPerSecond, Number


class Friction(Model):
    """Coulomb friction: what lies still holds up to μ_s N, what slides feels μ_k N."""

    static: Annotated[Number, Ge(0)]
    """Coefficient of static friction μ_s."""
    kinetic: Annotated[Number, Ge(0)]
    """Coefficient of kinetic friction μ_k, also that of impacts."""


class FallingRestitution(Model):
    """Restitution that falls with the speed of the impact: e = value up to `speed`, value (v/speed)^(−exponent) above.

    Source: impacts that deform plastically have e ∝ v^(−1/4) (Johnson, Contact Mechanics, 1985, section 11.5).
    """

    value: Annotated[Number, Ge(0), Le(1)]
    """Restitution of slow impacts."""
    speed: Annotated[MetresPerSecond, Gt(0)]
    """Normal speed above which it falls."""
    exponent: Annotated[Number, Gt(0), Le(1)] = 0.25
    """How fast it falls: 1/4 where impacts deform plastically. Up to 1, where what is left no longer grows."""

    def record(self) -> FallingRecord:
        """How it falls, as kernels take it."""
        return FallingRecord(self.speed, self.exponent)


class Rubbing:
    """What surfaces share that have a `friction`, one coefficient or a `Friction`, and a `restitution`, one number or a
    `FallingRestitution`."""

    @property
    def liveliness(self) -> float:
        """Restitution of slow impacts, the greatest."""
        e: float | FallingRestitution = self.restitution  # type: ignore[attr-defined]  # a field of each model
        return e.value if isinstance(e, FallingRestitution) else e

    @property
    def falling(self) -> FallingRecord | None:
        """How restitution falls with the speed of an impact; None where it is one number."""
        e: float | FallingRestitution = self.restitution  # type: ignore[attr-defined]
        return e.record() if isinstance(e, FallingRestitution) else None

    @property
    def coefficients(self) -> tuple[float, float]:
        """Coefficients of static and of kinetic friction."""
        friction: float | Friction = self.friction  # type: ignore[attr-defined]  # a field of each model
        return (friction.static, friction.kinetic) if isinstance(friction, Friction) else (friction, friction)

    @property
    def rubs(self) -> bool:
        """Whether there is friction."""
        return self.coefficients != (0, 0)

    def friction_doubts(self, name: str) -> Iterator[str]:
        """A sentence where friction grows as sliding begins."""
        static, kinetic = self.coefficients
        if kinetic > static:
            yield (
                f"{name}: kinetic friction {kinetic:g} is above static friction {static:g}, so what slides is held "
                "back more than what is at rest"
            )
