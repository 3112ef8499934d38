"""The kinds of constraint on the particles of an island. A new kind is made here, as rods are."""

from __future__ import annotations

from particlesim.engine.constraints.constraint import Constraint
from particlesim.engine.constraints.rod_system import rod_system
from particlesim.engine.interactions.interaction import Site
from particlesim.graph.graph import Island


def held(site: Site, island: Island) -> Constraint | None:
    """The constraint of an island, None without one; initial positions and velocities are corrected such that it holds.

    Raises UsageError for sets that do not fit their particles.
    """
    return rod_system(site, island) if island.constraints else None
