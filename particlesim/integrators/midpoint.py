"""Explicit midpoint (RK2): the slope at t + h/2 carries the whole step; the midpoint itself is reached with v_old."""

from particlesim.integrators.base import RungeKutta

MIDPOINT = RungeKutta(
    name="midpoint",
    order=2,
    summary="explicit midpoint, RK2; second order",
    a=((), (1 / 2,)),
    b=(0.0, 1.0),
    c=(0.0, 1 / 2),
)
