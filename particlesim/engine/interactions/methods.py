"""How forces of pairs are summed: the methods, and which one is taken where the scenario leaves it open."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from particlesim.engine.interactions.number_range import refuse_out_of_range
from particlesim.graph.graph import methods_of
from particlesim.interactions import PairInteraction, PairSet
from particlesim.interactions.contact import Contact
from particlesim.interactions.far import FarInteraction
from particlesim.scenario.reach import touches_by_surfaces

if TYPE_CHECKING:
    from particlesim.engine.interactions.interaction import Interaction, Site
    from particlesim.scenario.scenario import Scenario

METHODS = {
    "direct": "pairs.pairs_of",
    "neighbours": "near_pairs.near_pairs_of",
    "tree": "tree.tree_pairs.tree_of",
    "mesh": "mesh.mesh_pairs.mesh_of",
    "contacts": "contacts.contacts_of",
    "impulses": "hard.impulses.impulses_of",
    "surfaces": "surfaces.surface_contacts.surfaces_of",
}
"""What lays out an interaction, by its method: imported where a scenario needs it."""

IN_MATRICES = ("direct", "neighbours")
"""Methods whose pairs are in the matrix of implicit integrators; far ones are too many, and soft."""
WORTH_LISTS = 300
"""Particles above which neighbour lists are faster than all pairs: those of a liquid have some two hundred candidates."""
WORTH_A_TREE, WORTH_AN_EXACT_TREE = 4_000, 10_000
"""Particles from which a tree is faster than all pairs: at an accuracy of 1e-3, and at one below EXACT."""
EXACT = 1e-4


def chosen(law: PairInteraction, count: int, *, boxed: bool = False, smooth: bool = False) -> str:
    """The method by which an interaction of so many particles is summed, `boxed` in a periodic box, and `smooth` where no
    force may jump."""
    if law.method != "auto":
        return law.method
    if law.reach() is not None or law.touching():
        return "neighbours" if count > WORTH_LISTS else "direct"
    if boxed:
        return "mesh"
    if smooth:
        return "direct"
    rough = isinstance(law, FarInteraction) and law.accuracy >= EXACT
    enough = WORTH_A_TREE if rough else WORTH_AN_EXACT_TREE
    return "tree" if count >= enough and law.lacks_multipoles() is None else "direct"


def chosen_in(scenario: Scenario, pairs: PairSet, count: int) -> str:
    """The method by which an interaction of a scenario is summed among so many particles."""
    boxed, smooth = scenario.simulation.box is not None, methods_of(scenario)[pairs.groups[0]].smooth
    return chosen(pairs.law, count, boxed=boxed, smooth=smooth)


def summed(site: Site, pairs: PairSet) -> Interaction:
    """An interaction of pairs among the particles of an island, laid out for its method.

    Raises UsageError for two at one place, if they have no force there, and at the start for sizes that numbers of the run
    do not hold.
    """
    way = _method(site, pairs)
    if site.began:
        with site.scenario.at_interaction(pairs.name):
            refuse_out_of_range(site, pairs, way)
    module, function = METHODS[way].rsplit(".", 1)
    lay_out: Any = getattr(importlib.import_module(f"{__package__}.{module}"), function)
    made: Interaction = lay_out(site, pairs)
    return made


def _method(site: Site, pairs: PairSet) -> str:
    if isinstance(pairs.law, Contact):
        groups = [group for group in site.scenario.groups if group.name in pairs.groups]
        if touches_by_surfaces(pairs.law, groups):
            return "surfaces"
        return "impulses" if pairs.law.model == "impulse" else "contacts"
    count = sum(site.state[name].count for name in pairs.groups)
    return chosen_in(site.scenario, pairs, count)
