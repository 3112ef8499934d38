"""Backward (implicit) Euler: v' = v + h a(x', v'), x' = x + h v'; first order, stable at every step, takes energy.

Unless it is to converge, one Newton step from the present state: [1 − h ∂a/∂v − h² ∂a/∂x] Δv = h [a + h (∂a/∂x) v].
Source: D. Baraff, A. Witkin, Large Steps in Cloth Simulation, SIGGRAPH 1998.
"""

from particlesim.integrators.implicit import BackwardEulerMethod

BACKWARD_EULER = BackwardEulerMethod(
    name="backward_euler",
    order=1,
    summary="implicit Euler; first order, stable at any step, damps; one linear solve per step, or converged = true",
)
