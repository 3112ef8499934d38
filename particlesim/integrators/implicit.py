"""Implicit methods: a step solves for a state that its own forces lead to, and stays stable where springs are stiff.

All of them solve one equation per step, for the velocity V and the position X at a time t + c h,

    V = V₀ + γ h a(X, V),   X = X₀ + γ h V,

and differ in γ, c, and in what V₀ and X₀ are. The record carries these numbers, and the engine solves: 3 × 3 systems for
particles that step alone, conjugate gradients for islands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Lt
from pydantic import Field, StrictBool, model_validator

from particlesim.integrators.base import Method, none_if_zero
from particlesim.integrators.options import Options
from particlesim.model.mistakes import invalid
from particlesim.model.units import Number

TOLERANCE = 1e-8
LINEAR_TOLERANCE = 1e-3
MAX_ITERATIONS = 50
MAX_LINEAR_ITERATIONS = 10_000

Tolerance = Annotated[Number, Gt(0), Lt(1)]
Count = Annotated[int, Field(strict=True), Ge(1)]

ImplicitName = Literal["trapezoidal", "implicit_midpoint", "bdf2"]


class Implicit(Options):
    """Implicit methods whose equations are solved by Newton's method."""

    method: ImplicitName
    """Name of the method."""
    tolerance: Tolerance = TOLERANCE
    """Size to which the residual of a step's equations is reduced, relative to that of its first guess."""
    max_iterations: Count = MAX_ITERATIONS
    """Newton iterations in a step at most; more end the run."""
    max_linear_iterations: Count = MAX_LINEAR_ITERATIONS
    """Iterations of a linear solve in an island of springs at most; more end the run."""


class BackwardEuler(Options):
    """Backward Euler, which takes one Newton step unless it is to converge."""

    method: Literal["backward_euler"]
    """Name of the method."""
    converged: StrictBool = False
    """Newton iterations until the residual is small (true), or one linear solve per step (false)."""
    tolerance: Tolerance | None = None
    """Size to which the residual is reduced, relative to that of the first guess: of the linear solve (1e-3 unless given; in
    an island of springs), or with `converged` of the step's equations (1e-8 unless given)."""
    max_iterations: Count | None = None
    """With `converged`: Newton iterations in a step at most (50 unless given); more end the run."""
    max_linear_iterations: Count = MAX_LINEAR_ITERATIONS
    """Iterations of a linear solve in an island of springs at most; more end the run."""

    @model_validator(mode="after")
    def _iterates(self) -> BackwardEuler:
        if self.max_iterations is not None and not self.converged:
            raise invalid(
                "without converged = true there is one Newton iteration, and nothing to count",
                at=("max_iterations",),
                hint="add converged = true; max_linear_iterations bounds the linear solve",
            )
        return self


class NewtonRecord(NamedTuple):
    """Relative residual to reach, and how many iterations may be made."""

    tolerance: float
    limit: int


class ImplicitRecord(NamedTuple):
    """What kernels see of an implicit method; zeros are None, and so is `newton` for a single linear solve."""

    gamma: float
    node: float
    past: float | None
    slope: float | None
    ahead: float | None
    newton: NewtonRecord | None


@dataclass(frozen=True)
class ImplicitMethod(Method):
    """V = V₀ + γ h a(X, V), X = X₀ + γ h V at t + c h, with c = `node`.

    V₀ = v + past (v − v₋) + slope h a, and likewise X₀, where v₋ belongs to the step before. (X, V) is the new state, or
    with `ahead` the middle, and the new state 2 X − x, 2 V − v. A method with a past begins with one step
    of the trapezoidal rule, or in an island with one that damps (`engine.implicit.staged.first_step`). Raises ValueError at
    import when order conditions up to order 2 are missed.
    """

    options: ClassVar[type[Options]] = Implicit

    gamma: float = 1.0
    node: float = 1.0
    past: float = 0.0
    slope: float = 0.0
    ahead: bool = False
    tolerance: float | None = TOLERANCE
    max_iterations: int | None = MAX_ITERATIONS
    max_linear_iterations: int = MAX_LINEAR_ITERATIONS

    def __post_init__(self) -> None:
        # From y(t + h) = y + h y' + ½ h² y'' and y₋ = y − h y' + ½ h² y''.
        scale = 2 if self.ahead else 1
        first = scale * (self.past + self.slope + self.gamma)
        second = scale * (self.gamma * self.node - self.past / 2)
        for order, value, target in ((1, first, 1.0), (2, second, 0.5)):
            if order <= self.order and abs(value - target) > 1e-14:
                raise ValueError(f"{self.name}: a condition of order {order} gives {value}, not {target}")
        if self.ahead and self.gamma != self.node:
            raise ValueError(
                f"{self.name}: the middle is at {self.node} of the step, its slope acts over {self.gamma}"
            )

    @property
    def iterates(self) -> bool:
        """Whether Newton iterations go on until they converge."""
        return True

    @property
    def residual(self) -> float:
        """Relative residual that counts as solved: of a step's equations, or of its linear ones where there is one solve."""
        return self.tolerance or (TOLERANCE if self.iterates else LINEAR_TOLERANCE)

    @property
    def evaluations(self) -> int:
        """Force evaluations per step, of which one in every Newton iteration: at least."""
        return 1 + (self.slope != 0)

    @property
    def memory(self) -> int:
        return 7 if self.past else 0

    def record(self) -> ImplicitRecord:
        return ImplicitRecord(
            self.gamma,
            self.node,
            none_if_zero(self.past),
            none_if_zero(self.slope),
            2.0 if self.ahead else None,
            NewtonRecord(self.residual, self.max_iterations or MAX_ITERATIONS) if self.iterates else None,
        )

    def amplification(self, z: Any) -> Any:
        """What a step multiplies the solution of y' = λ y by, for z = h λ or an array of them; of two roots the larger."""
        if not self.past:
            y = (1 + self.slope * z) / (1 - self.gamma * z)
            return 2 * y - 1 if self.ahead else y
        # (1 − γ z) ζ² − (1 + past) ζ + past = 0
        a, half = 1 - self.gamma * z, (1 + self.past) / 2
        root = np.sqrt(half * half - a * self.past + 0j)
        larger = np.where(abs(half + root) >= abs(half - root), half + root, half - root)
        return larger / a


@dataclass(frozen=True)
class BackwardEulerMethod(ImplicitMethod):
    """Backward Euler: one Newton step, or, if `converged`, as many as it takes."""

    options: ClassVar[type[Options]] = BackwardEuler

    converged: bool = False
    tolerance: float | None = None
    max_iterations: int | None = None

    @property
    def iterates(self) -> bool:
        return self.converged

    @property
    def lag(self) -> float:
        return 0.5
