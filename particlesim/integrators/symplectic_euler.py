"""Symplectic (semi-implicit) Euler: v += h a(x), then x += h v_new.

First order, one force evaluation, stable for h ω < 2, energy error bounded. Often mislabelled "Euler" in games.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, I.1.9.
"""

from particlesim.integrators.base import Composition

SYMPLECTIC_EULER = Composition(
    name="symplectic_euler",
    order=1,
    summary="semi-implicit Euler; first order, bounded energy, the fastest; the default",
    symplectic=True,
    first_order="explicit_euler",
    kicks=(1.0,),
    drifts=(1.0,),
)
