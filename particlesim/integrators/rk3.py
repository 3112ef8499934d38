"""Kutta's third-order method. Stable on the imaginary axis up to |h λ| = √3.

Source: W. Kutta, Zeitschrift für Mathematik und Physik 46 (1901); Hairer, Nørsett, Wanner I, section II.1.
"""

from particlesim.integrators.base import RungeKutta

RK3 = RungeKutta(
    name="rk3",
    order=3,
    summary="Kutta's third-order method",
    a=((), (1 / 2,), (-1.0, 2.0)),
    b=(1 / 6, 2 / 3, 1 / 6),
    c=(0.0, 1 / 2, 1.0),
)
