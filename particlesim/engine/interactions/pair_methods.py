"""How the forces of an interaction of pairs are summed: as the scenario says, or what is fastest."""

from __future__ import annotations

from particlesim.engine.interactions.interaction import Interaction, Site
from particlesim.engine.interactions.pairs import pairs_of
from particlesim.engine.interactions.tree.tree_pairs import tree_of
from particlesim.interactions import PairInteraction, PairSet

WORTH_A_TREE = 4_000
"""Particles from which a tree is faster than all pairs, at an accuracy of 1e-3."""


def by_method(site: Site, pairs: PairSet) -> Interaction:
    """An interaction laid out for the method that its forces are summed by. Raises UsageError where it does not fit its
    particles."""
    return tree_of(site, pairs) if by_tree(site, pairs) else pairs_of(site, pairs)


def by_tree(site: Site, pairs: PairSet) -> bool:
    """Whether far particles are to act by multipoles."""
    return takes_tree(pairs.law, sum(site.state[name].count for name in pairs.groups))


def takes_tree(law: PairInteraction, count: int) -> bool:
    """Whether far particles act by multipoles where there are so many."""
    if law.method == "auto" and law.lacks_multipoles() is None:
        return count >= WORTH_A_TREE
    return law.method == "tree"
