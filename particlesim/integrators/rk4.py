"""The classical Runge–Kutta method of fourth order, on position and velocity together.

Stable on the imaginary axis up to |h λ| = 2√2, on the negative real axis up to 2.785.
Source: Hairer, Nørsett, Wanner I, table II.1.2.
"""

from particlesim.integrators.base import RungeKutta

RK4 = RungeKutta(
    name="rk4",
    order=4,
    summary="classical Runge–Kutta; fourth order, four evaluations",
    a=((), (1 / 2,), (0.0, 1 / 2), (0.0, 0.0, 1.0)),
    b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
    c=(0.0, 1 / 2, 1 / 2, 1.0),
)
