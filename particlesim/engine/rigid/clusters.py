"""Clusters of bodies that depend on each other in a step, as they touch or are joined by joints.

Clusters are solved one by one, so that each takes as many sweeps as it needs itself.
"""

from __future__ import annotations

from typing import Any

from particlesim.compiler import outlined
from particlesim.engine.rigid.bodies import WORLD


def root(parent: Any, i: Any) -> int:
    """The body that stands for all that body i touches."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return int(i)


def unite(parent: Any, i: Any, j: Any) -> None:
    """Take two bodies for one; the one with the lower number stands for both."""
    one, two = root(parent, i), root(parent, j)
    parent[max(one, two)] = min(one, two)


@outlined
def gather(k: Any, motion: Any, joints: Any) -> None:
    """Find the clusters of a step: bodies in their order (`bodies`, from `body_from` on), and contacts (`k.order`, from
    `contact_from` on). The order within a cluster is that of numbers."""
    parent, of = motion.parent, motion.cluster
    n, contacts, count = parent.size, k.number[0], 0
    for i in range(n):
        parent[i] = i
    for c in range(contacts):
        if k.second[c] != WORLD:
            unite(parent, k.first[c], k.second[c])
    if joints is not None:
        for g in range(joints.first.size):
            if joints.second[g] != WORLD:
                unite(parent, joints.first[g], joints.second[g])
    for i in range(n):
        r = root(parent, i)
        if r == i:
            of[i] = count
            motion.body_from[count] = motion.contact_from[count] = 0
            motion.first_component[count] = -1
            count += 1
        else:
            of[i] = of[r]
    motion.clusters[0] = count
    if joints is not None:
        for component in range(joints.next.size):
            r = of[joints.first[joints.group[component]]]
            joints.next[component] = motion.first_component[r]
            motion.first_component[r] = component
    # Sorted by counting: how many each cluster has, where it ends, and from there back.
    for i in range(n):
        motion.body_from[of[i]] += 1
    for c in range(contacts):
        motion.contact_from[of[k.first[c]]] += 1
    for r in range(1, count):
        motion.body_from[r] += motion.body_from[r - 1]
        motion.contact_from[r] += motion.contact_from[r - 1]
    motion.body_from[count], motion.contact_from[count] = n, contacts
    for back in range(n):
        i = n - 1 - back
        motion.body_from[of[i]] -= 1
        motion.bodies[motion.body_from[of[i]]] = i
    for back in range(contacts):
        c = contacts - 1 - back
        r = of[k.first[c]]
        motion.contact_from[r] -= 1
        k.order[motion.contact_from[r]] = c
