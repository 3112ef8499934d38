"""The kinds of interaction: for each kind of set in a scenario, the function that lays it out. A new kind is a line here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from particlesim.bonds import BondSet, HingeSet
from particlesim.engine.interactions.bonds import springs_of
from particlesim.engine.interactions.hinges import hinges_of
from particlesim.engine.interactions.interaction import Interaction, Ints, Site
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


def laid_out(site: Site, sets: Sequence[Any]) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """All sets of interactions of an island and their records, those that are added chunk by chunk first.

    Raises UsageError for one that does not fit its particles.
    """
    made = [(each, KINDS[type(each)](site, each)) for each in sets]
    made.sort(key=lambda pair: not pair[1].by_chunks)
    return tuple(each for each, _ in made), tuple(record for _, record in made)


def laid_again(
    site: Site, sets: Sequence[Any], records: Sequence[Interaction], place: Ints
) -> tuple[Interaction, ...]:
    """The same sets after births and deaths: `Interaction.laid_again`."""
    return tuple(
        KINDS[type(each)](site, each).after(record, place)
        if (again := record.laid_again(site, place)) is None
        else again
        for each, record in zip(sets, records, strict=True)
    )
