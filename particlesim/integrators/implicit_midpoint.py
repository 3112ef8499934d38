"""Implicit midpoint rule: the slope in the middle of the step, (x + x')/2 and (v + v')/2; second order, symplectic.

Keeps quadratic invariants, such as linear and angular momentum, to the tolerance of its solution.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section II.1.
"""

from particlesim.integrators.implicit import ImplicitMethod

IMPLICIT_MIDPOINT = ImplicitMethod(
    name="implicit_midpoint",
    order=2,
    summary="implicit slope in the middle; second order, symplectic, stable at any step for linear forces",
    symplectic=True,
    reversible=True,
    gamma=1 / 2,
    node=1 / 2,
    ahead=True,
)
