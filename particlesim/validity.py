"""Where laws stop being valid: watched while a run goes on, and told at its end."""

from __future__ import annotations

import math

import numpy as np

from particlesim.engine.simulation import Simulation
from particlesim.forces.stokes_drag import StokesDrag
from particlesim.laws import velocity
from particlesim.scenario.scenario import Scenario, acts_on

FASTEST = 4
"""Particles looked at per frame and group: the fastest ones."""


class Watch:
    """Collects warnings about laws used outside of their range."""

    def __init__(self, scenario: Scenario) -> None:
        self._largest: dict[str, tuple[float, float]] = {}
        self._laws = [
            (label, force)
            for label, force in zip(scenario.force_labels(), scenario.forces, strict=False)
            if isinstance(force, StokesDrag) and force.rho is not None
        ]

    def look(self, simulation: Simulation) -> None:
        """Look at the present state: Reynolds numbers Re = 2 r ρ |v − w| / η of Stokes drag."""
        for label, force in self._laws:
            for group, state in zip(simulation.scenario.groups, simulation.states, strict=True):
                if not acts_on(force, group) or not state.count:
                    continue
                speed2 = (state.v[:, : state.count].astype(float) ** 2).sum(axis=0)
                flows = tuple(flow.record() for flow in force.flow)
                for i in np.argsort(speed2)[-FASTEST:]:
                    p = state.particle(int(i), simulation.time)
                    wx, wy, wz = velocity(flows, p)
                    relative = math.hypot(p.vx - wx, p.vy - wy, p.vz - wz)
                    reynolds = 2 * p.r * (force.rho or 0) * relative / force.eta
                    if reynolds > max(1.0, self._largest.get(label, (0.0, 0.0))[0]):
                        self._largest[label] = (reynolds, simulation.time)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to tell the user."""
        return tuple(
            f"{label}: Stokes drag holds for Reynolds numbers below 1, and {reynolds:.3g} was reached at t = {time:.6g} s; "
            'type = "drag" with coefficient = "schiller_naumann" holds further'
            for label, (reynolds, time) in self._largest.items()
        )
