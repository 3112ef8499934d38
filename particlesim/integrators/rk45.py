"""Dormand and Prince's pair of orders 5 and 4, the higher of which is kept. Seven slopes, the last of which is the first of
the next step.

Source: J. R. Dormand, P. J. Prince, J. Comp. Appl. Math. 6, 19 (1980); Hairer, Nørsett, Wanner I, table II.5.2.
"""

from particlesim.integrators.adaptive import EmbeddedRungeKutta

RK45 = EmbeddedRungeKutta(
    name="rk45",
    order=5,
    summary="Dormand–Prince 5(4), its steps chosen by their error; fifth order, six evaluations",
    a=(
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    b=(35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    c=(0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0),
    errors=((71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),),
    error_orders=(4,),
    beta=0.04,
)
