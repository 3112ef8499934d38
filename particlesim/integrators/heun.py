"""Heun's method (explicit trapezoid): the average of the slopes at both ends, the far one from an Euler step."""

from particlesim.integrators.base import RungeKutta

HEUN = RungeKutta(
    name="heun",
    order=2,
    summary="explicit trapezoid; second order",
    a=((), (1.0,)),
    b=(1 / 2, 1 / 2),
    c=(0.0, 1.0),
)
