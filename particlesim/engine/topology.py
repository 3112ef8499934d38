"""The springs, rods and surfaces of a simulation as a trajectory keeps them: particles by their ids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from particlesim.engine.state.group_state import GroupState
from particlesim.scenario.scenario import Scenario
from particlesim.trajectory.topology import Topology

HIDDEN = (".shear", ".bend")
"""Springs of soft bodies other than their edges; as lines they would hide the rest."""


def topology(scenario: Scenario, islands: Sequence[Any], states: Sequence[GroupState]) -> list[Topology]:
    """All sets of springs and rods, by their names in the ledger, and surfaces, by the names of their groups."""
    found: dict[str, Topology] = {}
    for island in islands:
        found |= {each.name: each for each in island.topology()}
    torn = {name for name, each in found.items() if each.breakable}
    surfaces = set()
    for group, state in zip(scenario.particles, states, strict=False):
        triangles = group.layout.open(scenario.folder).triangles()
        if len(triangles):
            entry = found.get(group.name, Topology(group.name))
            whole = not any(name.startswith(f"{group.name}.") for name in torn) and not entry.breakable
            found[group.name] = replace(entry, triangles=state.id[triangles], drawn=whole)
            surfaces.add(group.name)
    if not _rows_are_ids(scenario):
        return [replace(each, drawn=False) for each in found.values()]
    return [
        replace(each, drawn=True) if _is_edge(each, surfaces) and not each.breakable else each
        for each in found.values()
    ]


def _is_edge(each: Topology, surfaces: set[str]) -> bool:
    """Whether a set is shown as lines: not the springs of a body that is shown as a surface, nor those inside one,
    nor what ends at points of rigid bodies, which are no particles."""
    body = each.name.rpartition(".")[0]
    return (
        len(each.pairs) > 0
        and each.points is None
        and body not in surfaces
        and not each.name.endswith(HIDDEN)
    )


def _rows_are_ids(scenario: Scenario) -> bool:
    """Whether particles laid out at the start keep their rows: none of them can die."""
    groups = {group.name for group in scenario.particles}
    return not any(
        each.contact == "kill" and (each.on is None or groups & set(each.on))
        for each in scenario.all_colliders
    )
