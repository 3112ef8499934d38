"""What a collider is: a shape that particles bounce off, stick to or die at.

A shape gives `gap` and `normal` of its record: a signed distance and its gradient. The response to contact is the same for
all of them (`response`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field, PrivateAttr, model_validator

from particlesim.colliders.friction import FallingRestitution, Friction, Rubbing
from particlesim.colliders.moving import MovingRecord, SpinRecord
from particlesim.colliders.response import (
    ColliderRecord,
    FrictionRecord,
    PenaltyRecord,
    RecoveryRecord,
    ResponseRecord,
)
from particlesim.laws.registry import ABSORB, PASS, STICK
from particlesim.model.base import Model, Name
from particlesim.model.mistakes import invalid
from particlesim.model.units import (
    KilogramsPerSecond,
    MetresPerSecond,
    NewtonsPerMetre,
    Number,
    Seconds,
    Vector,
)
from particlesim.model.vectors import Vector3

RESOLVES = 20
"""Steps that a touch should take: the kicks of a penalty are of first order in the step."""
LIVELY = 0.9
"""Restitution above which projection out of a collider may add more energy than the bounce takes."""


ACTS_WITH = {
    "restitution": ("bounce",),
    "friction": ("bounce", "slide"),
    "surface_velocity": ("bounce", "slide"),
    "tangential_loss": ("bounce", "slide"),
    "recovery": ("bounce", "slide"),
    "stiffness": ("penalty",),
    "damping": ("penalty",),
}
"""For each number of a response the kinds of contact that have it."""


class Collider(Rubbing, Model):
    """What holds particles back. Laws: `gap` and `normal` of its shape's record."""

    kind: ClassVar[str]
    """What the shape is called."""
    killed: ClassVar[int] = ABSORB
    """The outcome of contact = "kill"."""
    costly: ClassVar[bool] = False
    """Whether its gap takes a search, so that vectors of particles do not help."""

    name: Name | None = None
    """Name for messages and overrides."""
    on: tuple[Name, ...] | None = Field(default=None, min_length=1)
    """Groups it holds back; all unless given."""
    restitution: Annotated[Number, Ge(0), Le(1)] | FallingRestitution = 1.0
    """Speed after over speed before the impact, along the normal: 1 elastic, 0 no rebound; or a table, where it falls with
    the speed of the impact."""
    friction: Annotated[Number, Ge(0)] | Friction = 0.0
    """Coefficient of Coulomb friction μ, or a table with one at rest and one in motion. An impact takes at most μ times its
    normal impulse along the surface; what lies holds on slopes up to atan μ, and slides on steeper ones under μ N."""
    surface_velocity: Vector[MetresPerSecond] | None = None
    """Velocity at which the surface runs along itself, as that of a conveyor belt; what points out of the surface counts for
    nothing. It acts by friction or tangential_loss. A belt turns with its collider, from the direction at the start
    on."""
    tangential_loss: Annotated[Number, Ge(0), Le(1)] = 0.0
    """Part of the velocity along the surface that an impact takes away. No friction: what lies on the surface loses it in
    every step, and slides by a distance that depends on dt."""
    detection: Literal["continuous", "discrete"] = "continuous"
    """Continuous finds the time of impact inside the step; discrete looks at the end of the step only and puts the particle
    back on the surface; it is the default with contact = "penalty"."""
    contact: Literal["bounce", "slide", "stick", "kill", "penalty"] = "bounce"
    """What contact does: bounce, go on along the surface without rebound, stay there for good, end the particle, or push it
    out with a spring and a damper (penalty)."""
    recovery: Annotated[Seconds, Gt(0)] | None = None
    """Time constant in which particles are brought back to the surface, with detection = "discrete": in a time t the part
    1 − exp(−t/recovery) of their depth. At once unless given."""
    stiffness: Annotated[NewtonsPerMetre, Gt(0)] | None = None
    """Spring of contact = "penalty": it pushes with stiffness times the depth."""
    damping: Annotated[KilogramsPerSecond, Ge(0)] = 0.0
    """Damper of contact = "penalty": it adds damping times the speed to the push while a particle goes in, and takes as much
    from it while the particle comes out; a surface never pulls."""

    _motion: tuple[Any, SpinRecord | None] | None = PrivateAttr(default=None)

    @model_validator(mode="before")
    @classmethod
    def _looks_at_ends(cls, table: Any) -> Any:
        if isinstance(table, dict) and table.get("contact") == "penalty":
            return {"detection": "discrete", **table}
        return table

    @model_validator(mode="after")
    def _bounces(self) -> Collider:
        for name, kinds in ACTS_WITH.items():
            if self.contact not in kinds and getattr(self, name) != type(self).model_fields[name].default:
                raise invalid(
                    f"{name} acts only with contact = {' or '.join(map(_quoted, kinds))}",
                    at=(name,),
                    also=[(("contact",), f"{self.contact} here")],
                )
        if self.contact == "penalty":
            if self.stiffness is None:
                raise invalid("a penalty needs a stiffness", at=("contact",), hint='stiffness = "1000 N/m"')
            if self.detection == "continuous":
                raise invalid(
                    "a penalty lets particles in and pushes them out, so that there is no moment of impact to find",
                    at=("detection",),
                    also=[(("contact",), "penalty here")],
                    allowed='"discrete", or nothing',
                )
        if self.recovery is not None and self.detection != "discrete":
            raise invalid(
                "what is found at the moment of impact has no depth to recover from",
                at=("recovery",),
                hint='add detection = "discrete"',
            )
        if self.rubs and self.detection == "discrete":
            raise invalid(
                'friction needs detection = "continuous": only there is it known how long a particle touches',
                at=("friction",),
                also=[(("detection",), "discrete here")],
            )
        if self.surface_velocity is not None and not self.rubs and self.tangential_loss == 0:
            raise invalid(
                "surface_velocity acts by friction or tangential_loss, and there is neither",
                at=("surface_velocity",),
                hint="friction = 0.5",
            )
        return self

    @property
    def liveliness(self) -> float:
        return 0.0 if self.contact == "slide" else super().liveliness

    @property
    def soft(self) -> bool:
        """Whether particles may be inside of it for some steps."""
        return self.contact == "penalty" or self.recovery is not None

    def lifts(self) -> bool:
        """Whether particles may gain energy as they are lifted out of it."""
        return self.contact == "bounce" and self.detection == "discrete" and self.liveliness > LIVELY

    def shape(self) -> tuple[Any, ...]:
        """The shape as kernels take it."""
        raise NotImplementedError

    def pivot(self) -> tuple[float, float, float]:
        """The place that a motion leads and turns it about [m], at the start."""
        raise NotImplementedError

    def lead(self, path: Any, spin: SpinRecord | None) -> None:
        """Let it move from now on: along a path, with a turn, or both."""
        self._motion = (path, spin)

    @property
    def motion(self) -> tuple[Any, SpinRecord | None] | None:
        """The path and the turn that lead it, None where it is at rest."""
        return self._motion

    def round_about(self, axis: Vector3) -> bool:
        """Whether the shape is the same at any angle about an axis through its pivot."""
        return False

    def turns_in_place(self) -> bool:
        """Whether it moves by a turn about its own axis alone, which what slides along it without friction cannot tell from
        rest."""
        if self._motion is None:
            return False
        path, spin = self._motion
        return path is None and spin is not None and self.round_about(spin[:3])

    def body(self) -> Any:
        """The shape as kernels take it, with what leads it."""
        if self._motion is None:
            return self.shape()
        path, spin = self._motion
        return MovingRecord(self.moved_shape(), *self.pivot(), path, spin)

    def moved_shape(self) -> Any:
        """The shape in its own frame, where it moves."""
        return self.shape()

    def reach(self) -> float:
        """Size of the numbers beside the particle's place [m] that its gap is the difference of."""
        raise NotImplementedError

    def describe(self) -> str:
        """The shape in a few words."""
        raise NotImplementedError

    def called(self, k: int) -> str:
        """What messages call it, the k-th of all: 'plane floor', 'sphere 2'."""
        return f"{self.kind} {self.name or k}"

    def describe_contact(self) -> str:
        """Shape and response in a few words."""
        if self.contact == "penalty":
            return f"{self.describe()}, penalty, k = {self.stiffness:g} N/m, c = {self.damping:g} kg/s"
        what: str = self.contact
        if what == "bounce":
            what = f"e = {self.liveliness:g}"
            if self.rubs:
                static, kinetic = self.coefficients
                what += f", μ = {static:g}" if static == kinetic else f", μ = {static:g} and {kinetic:g}"
        return f"{self.describe()}, {what}, {self.detection}"

    def early(self, radius: float) -> float:
        """How much too early balls of a radius may touch it [m]."""
        return 0.0

    def early_where(self, radius: float) -> str:
        """Where that is, and what avoids it."""
        raise NotImplementedError

    def doubts(self, name: str, lightest: float | None, dt: float) -> Iterator[str]:
        """A sentence for each choice that is legal and seldom meant, before steps of dt [s]; `lightest` is the mass [kg]
        of the lightest particle that it holds back, where that is known.

        With ω = √(k/m), kicks by the spring of a penalty and drifts are stable for h ω < 2: the determinant (1 − a)/(1 + a)
        and the trace 1 + (1 − a − h² ω²)/(1 + a) of a step with a damper, a = h c/2m, meet the conditions of Jury.
        """
        if self.lifts() and not self.soft:
            yield (
                f"{name} with discrete detection and restitution {self.liveliness:g} can add energy: "
                'particles are lifted out of it; detection = "continuous" does not'
            )
        yield from self.friction_doubts(name)
        if self.stiffness is None or lightest is None:
            return
        omega = math.sqrt(self.stiffness / lightest)
        stable, lasts = 2 / omega, math.pi / omega
        if dt >= stable:
            yield (
                f"{name}: its spring throws particles of {lightest:.3g} kg out with more energy than they come in "
                f"with: dt must be below {stable:.3g} s for them, and is {dt:.3g} s"
            )
        elif dt > lasts / RESOLVES:
            yield (
                f"{name}: a touch of the lightest particles lasts {lasts:.3g} s, {lasts / dt:.3g} steps; its spring needs "
                f"about {RESOLVES}, dt = {lasts / RESOLVES:.2g} s"
            )

    def record(self) -> ColliderRecord:
        """The collider as kernels take it."""
        return ColliderRecord(self.body(), self._response())

    def _response(self) -> ResponseRecord:
        if self.contact == "stick":
            return ResponseRecord(1.0, 1.0, 0.0, STICK)  # nothing of the velocity is left
        if self.contact == "kill":
            return ResponseRecord(0.0, 0.0, 1.0, self.killed)  # the record keeps the velocity of the impact
        if self.contact == "penalty":
            return ResponseRecord(
                1.0, 0.0, 1.0, PASS, yielding=PenaltyRecord(self.stiffness or 0.0, self.damping)
            )
        loss = self.tangential_loss
        return ResponseRecord(
            1 + self.liveliness,
            loss,
            1 - loss,
            PASS,
            FrictionRecord(*self.coefficients) if self.rubs else None,
            self.falling,
            self.surface_velocity,
            None if self.recovery is None else RecoveryRecord(self.recovery),
        )


def _quoted(word: str) -> str:
    return f'"{word}"'
