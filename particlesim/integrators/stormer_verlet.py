"""Störmer–Verlet: x_{n+1} = 2 x_n − x_{n−1} + h² a_n, started by x_1 = x_0 + h v_0 + ½ h² a_0.

The rule knows positions only, so whatever changes the velocity (an impulse, a bounce, a birth inside a step) starts it
anew. The recorded velocity is (x_{n+1} − x_n)/h + ½ h a_n, which is second-order accurate.
Source: Hairer, Lubich, Wanner, Acta Numerica 12, 399 (2003).
"""

from particlesim.integrators.base import Verlet

STORMER_VERLET = Verlet(
    name="stormer_verlet",
    order=2,
    summary="two-step rule on positions; second order, symplectic, time-reversible",
    symplectic=True,
    reversible=True,
    first_order="midpoint",
)
