"""Explicit (forward) Euler: x += h v_old, v += h a.

First order. Gains energy on every undamped oscillator, whatever the step: a reference for teaching, not for results.
"""

from particlesim.integrators.base import RungeKutta

EXPLICIT_EULER = RungeKutta(
    name="explicit_euler",
    order=1,
    summary="forward Euler; first order, gains energy, for teaching",
    a=((),),
    b=(1.0,),
    c=(0.0,),
)
