"""Trapezoidal rule: v' = v + ½ h (a + a'), x' = x + ½ h (v + v'); second order, no damping on the imaginary axis.

Source: Hairer, Wanner, Solving Ordinary Differential Equations II, section IV.3.
"""

from particlesim.integrators.implicit import ImplicitMethod

TRAPEZOIDAL = ImplicitMethod(
    name="trapezoidal",
    order=2,
    summary="implicit average of both ends; second order, stable at any step, does not damp oscillations",
    reversible=True,
    gamma=1 / 2,
    slope=1 / 2,
)
