"""Embedded Runge–Kutta methods: a second result from the same slopes tells the error of every step, and so the next step.

With y₁ the result of a step h, δ the difference of the two results and |·| the length of a vector, the error is

    E² = (|δx| / s_x)² + (|δv| / s_v)²,   s_x = p + r max(|x₀|, |x₁|),   s_v = q + r max(|v₀|, |v₁|)

with r the `tolerance`, p and q the `position_tolerance` and `velocity_tolerance`. A step with E ≤ 1 is accepted; accepted or
not, the next one is h · 0.9 E^(−α) E₋₁^β within bounds, where E₋₁ is the error of the last accepted step (Gustafsson's PI
controller; β = 0 is the simple one). The step after a rejected one does not grow.

Source: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, section II.4; K. Gustafsson, ACM TOMS 17, 533
(1991).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, NamedTuple

from annotated_types import Gt

from particlesim.integrators.base import RungeKutta, none_if_zero
from particlesim.integrators.options import Options
from particlesim.integrators.trees import order_conditions
from particlesim.model.units import Metres, MetresPerSecond, Seconds

AdaptiveName = Literal["adaptive_euler", "rk45", "dop853"]

TOLERANCE = 1e-6


class Adaptive(Options):
    """The error that a step may have decides its length: |δx| ≤ position_tolerance + tolerance |x|, |δv| likewise.

    Particles without springs have steps of their own; particles joined by springs have one step, that of the worst of them.
    `dt` is the longest step.
    """

    method: AdaptiveName
    """Name of the method."""
    tolerance: Annotated[float, Gt(0)] = TOLERANCE
    """Error of a step relative to the distance from the origin, and to the speed."""
    position_tolerance: Annotated[Metres, Gt(0)] | None = None
    """Error of a step in the position that is always allowed; tolerance × 1 m unless given."""
    velocity_tolerance: Annotated[MetresPerSecond, Gt(0)] | None = None
    """Error of a step in the velocity that is always allowed; tolerance × 1 m/s unless given."""
    minimum_step: Annotated[Seconds, Gt(0)] | None = None
    """A run that needs shorter steps ends with an error; what the clock can resolve unless given."""


class EmbeddedRecord(NamedTuple):
    """What kernels see: the tableau without zeros, rows of the error estimates, tolerances [1, m, m/s], the controller.

    `alpha`, `beta`: exponents; `shrink`, `grow`: bounds of h_new/h; `least`: shortest step [s].
    """

    a: tuple[tuple[float | None, ...], ...]
    b: tuple[float | None, ...]
    c: tuple[float, ...]
    errors: tuple[tuple[float | None, ...], ...]
    tolerance: float
    position: float
    velocity: float
    alpha: float
    beta: float
    shrink: float
    grow: float
    least: float


@dataclass(frozen=True)
class EmbeddedRungeKutta(RungeKutta):
    """Explicit Runge–Kutta method that estimates its error.

    Each row of `errors` weighs the slopes of all stages and of the end of the step; h times the sum is the difference of
    the result from one of order `error_orders`. Of two rows the first is the estimate, and the second, of lower order,
    only takes away from it: E₁²/√(E₁² + 0.01 E₂²).
    Raises ValueError at import when a result misses its order conditions.
    """

    options: ClassVar[type[Options]] = Adaptive
    adaptive: ClassVar[bool] = True
    by_modes: ClassVar[bool] = False

    errors: tuple[tuple[float, ...], ...] = ()
    error_orders: tuple[int, ...] = ()
    beta: float = 0.0
    shrink: float = 0.2
    grow: float = 10.0
    tolerance: float = TOLERANCE
    position_tolerance: float | None = None
    velocity_tolerance: float | None = None
    minimum_step: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        a = (*self.a, self.b)  # the slope at the end is one more stage, whose row is b
        b = (*self.b, 0.0)
        rows = tuple(tuple(x - e for x, e in zip(b, row, strict=True)) for row in self.errors)
        found = order_conditions(a, rows, max(self.error_orders))
        for order, conditions in zip(self.error_orders, found, strict=True):
            self._check_order([c for c in conditions if c.order <= order])

    @property
    def memory(self) -> int:
        """The next step, and the error of the last."""
        return 2

    def record(self) -> EmbeddedRecord:  # type: ignore[override]
        order = self.error_orders[0] + 1
        if len(self.errors) > 1:  # E₁²/E₂ falls with h to the power 2 (p₁ + 1) − (p₂ + 1)
            order = 2 * order - self.error_orders[1] - 1
        return EmbeddedRecord(
            **super().record()._asdict(),
            errors=tuple(tuple(none_if_zero(x) for x in row) for row in self.errors),
            tolerance=self.tolerance,
            position=self.position_tolerance or self.tolerance,
            velocity=self.velocity_tolerance or self.tolerance,
            alpha=1 / order - 0.75 * self.beta,
            beta=self.beta,
            shrink=self.shrink,
            grow=self.grow,
            least=self.minimum_step or 0.0,
        )
