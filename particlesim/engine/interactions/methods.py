"""How forces of pairs are summed: the methods, and which one is taken where the scenario leaves it open."""

from __future__ import annotations

from collections.abc import Callable

from particlesim.engine.interactions.contacts import contacts_of
from particlesim.engine.interactions.impulses import impulses_of
from particlesim.engine.interactions.interaction import Interaction, Site
from particlesim.engine.interactions.mesh.mesh_pairs import mesh_of
from particlesim.engine.interactions.near_pairs import near_pairs_of
from particlesim.engine.interactions.pairs import pairs_of
from particlesim.engine.interactions.surfaces.surface_contacts import surfaces_of
from particlesim.engine.interactions.tree.tree_pairs import tree_of
from particlesim.interactions import PairInteraction, PairSet
from particlesim.interactions.contact import Contact
from particlesim.interactions.far import FarInteraction
from particlesim.scenario.reach import touches_by_surfaces

METHODS: dict[str, Callable[[Site, PairSet], Interaction]] = {
    "direct": pairs_of,
    "neighbours": near_pairs_of,
    "tree": tree_of,
    "mesh": mesh_of,
}

IN_MATRICES = ("direct", "neighbours")
"""Methods whose pairs are in the matrix of implicit integrators; far ones are too many, and soft."""
WORTH_LISTS = 300
"""Particles above which neighbour lists are faster than all pairs: those of a liquid have some two hundred candidates."""
WORTH_A_TREE, WORTH_AN_EXACT_TREE = 4_000, 10_000
"""Particles from which a tree is faster than all pairs: at an accuracy of 1e-3, and at one below EXACT."""
EXACT = 1e-4


def chosen(law: PairInteraction, count: int, *, boxed: bool = False) -> str:
    """The method by which an interaction of so many particles is summed, `boxed` in a periodic box."""
    if law.method != "auto":
        return law.method
    if law.reach() is not None or law.touching():
        return "neighbours" if count > WORTH_LISTS else "direct"
    if boxed:
        return "mesh"
    rough = isinstance(law, FarInteraction) and law.accuracy >= EXACT
    enough = WORTH_A_TREE if rough else WORTH_AN_EXACT_TREE
    return "tree" if count >= enough and law.lacks_multipoles() is None else "direct"


def summed(site: Site, pairs: PairSet) -> Interaction:
    """An interaction of pairs among the particles of an island, laid out for its method.

    Raises UsageError for two at one place, if they have no force there.
    """
    if isinstance(pairs.law, Contact):
        if touches_by_surfaces(
            pairs.law, [group for group in site.scenario.groups if group.name in pairs.groups]
        ):
            return surfaces_of(site, pairs)
        return (impulses_of if pairs.law.model == "impulse" else contacts_of)(site, pairs)
    count = sum(site.state[name].count for name in pairs.groups)
    boxed = site.scenario.simulation.box is not None
    return METHODS[chosen(pairs.law, count, boxed=boxed)](site, pairs)
