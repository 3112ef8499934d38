"""Velocity Verlet, the leapfrog written kick–drift–kick: half a kick, a whole drift, half a kick.

Second order, symplectic, time-reversible. Source: Swope, Andersen, Berens, Wilson, J. Chem. Phys. 76, 637 (1982).
"""

from particlesim.integrators.base import Composition

VELOCITY_VERLET = Composition(
    name="velocity_verlet",
    order=2,
    summary="leapfrog, kick-drift-kick; second order, symplectic, time-reversible",
    symplectic=True,
    reversible=True,
    first_order="midpoint",
    kicks=(1 / 2, 1 / 2),
    drifts=(1.0, 0.0),
)
