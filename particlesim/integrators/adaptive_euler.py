"""Adaptive Euler by step doubling: one step of h against two of h/2, all by the explicit Euler method.

The two steps are kept; their difference from the one, ½ h (k₂ − k₁), is the error, of order h². As a tableau with
k₁ = f(t, y) and k₂ = f(t + h/2, y + h/2 k₁).
"""

from particlesim.integrators.adaptive import EmbeddedRungeKutta

ADAPTIVE_EULER = EmbeddedRungeKutta(
    name="adaptive_euler",
    order=1,
    summary="explicit Euler by step doubling, its steps chosen by their error; first order, for teaching",
    a=((), (1 / 2,)),
    b=(1 / 2, 1 / 2),
    c=(0.0, 1 / 2),
    errors=((-1 / 2, 1 / 2, 0.0),),
    error_orders=(1,),
    grow=5.0,
)
