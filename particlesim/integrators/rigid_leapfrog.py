"""The method of rigid bodies: the leapfrog of position, with rotations split about the principal axes.

Source: A. Dullweber, B. Leimkuhler, R. McLachlan, J. Chem. Phys. 107, 5840 (1997).
"""

from __future__ import annotations

from particlesim.integrators.base import Method


class RigidMethod(Method):
    """What steps rigid bodies; no scenario names it."""

    @property
    def evaluations(self) -> int:
        return 1


RIGID_LEAPFROG = RigidMethod(
    name="rigid_leapfrog",
    order=2,
    summary="leapfrog of position and orientation with impulses at contacts, for rigid bodies; second order",
    symplectic=True,
    reversible=True,
)
