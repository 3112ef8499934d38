"""The kinds of interaction: by what a scenario calls for, how each is laid out. A new kind is a line here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from particlesim.bonds import BondSet, HingeSet
from particlesim.engine.interactions.bonds import springs_of
from particlesim.engine.interactions.hinges import hinges_of
from particlesim.engine.interactions.interaction import Interaction, Site
from particlesim.engine.interactions.methods import summed
from particlesim.engine.interactions.triangles import triangles_of
from particlesim.forces.sheet_drag import SurfaceSet
from particlesim.interactions import PairSet

KINDS: dict[type, Callable[[Site, Any], Interaction]] = {
    BondSet: springs_of,
    HingeSet: hinges_of,
    SurfaceSet: triangles_of,
    PairSet: summed,
}
"""What stands in a graph's island, and what lays it out among the particles of the engine's."""


def laid_out(site: Site, sets: Sequence[Any]) -> tuple[tuple[str, ...], tuple[Any, ...]]:
    """Names and records of all interactions of an island, those that are added chunk by chunk first.

    Raises UsageError for one that does not fit its particles.
    """
    made = [(each.name, KINDS[type(each)](site, each)) for each in sets]
    made.sort(key=lambda pair: not pair[1].by_chunks)
    return tuple(name for name, _ in made), tuple(record for _, record in made)
