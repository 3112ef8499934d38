"""Two-step backward differentiation: y' = 4/3 y − 1/3 y₋ + 2/3 h f(y'); second order, stable at every step, damps little.

It remembers the step before, and starts anew after whatever changes the velocity in another way.
Source: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, section III.1.
"""

from particlesim.integrators.implicit import ImplicitMethod

BDF2 = ImplicitMethod(
    name="bdf2",
    order=2,
    summary="two-step backward differentiation; second order, stable at any step, damps stiff motion most",
    gamma=2 / 3,
    past=1 / 3,
)
