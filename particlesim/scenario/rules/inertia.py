"""Particles without inertia that step together with others."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.integrators import method_for
from particlesim.model.mistakes import Invalid
from particlesim.scenario.reach import group_tables
from particlesim.scenario.rules.joints import coupling_tables
from particlesim.scenario.tables import Tables


def stepped_together(scenario: Tables) -> Iterator[Invalid]:
    """A method that needs velocities is replaced for all that step together with particles that have none; of IAS15 that
    would take what it is for."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    for names in _together(scenario):
        inert = [name for name in names if tables[name][1].dynamics.type != "second_order"]
        heavy = [name for name in names if name not in inert]
        if not inert or not heavy:
            continue
        method = method_for(tables[heavy[0]][1].integrator or scenario.simulation.integrator)
        if method.smooth and method.first_order is not None:
            yield Invalid(
                f"{heavy[0]!r} would be stepped by {method.first_order} and not by {method.name}, as {inert[0]!r}, which "
                "steps together with it, has no inertia",
                (*tables[inert[0]][0], "dynamics"),
                ((tables[heavy[0]][0], f"stepped by {method.name}"),),
                allowed=f'inertia, interactions among other groups (on = [...]), or integrator = "{method.first_order}"',
            )


def _together(scenario: Tables) -> list[list[str]]:
    """The groups that step together, in the order of the scenario (union-find)."""
    parent = {group.name: group.name for group in scenario.groups}

    def root(name: str) -> str:
        while parent[name] != name:
            name = parent[name]
        return name

    for _, (first, other), _ in coupling_tables(scenario):
        parent[root(other)] = root(first)
    found: dict[str, list[str]] = {}
    for name in parent:
        found.setdefault(root(name), []).append(name)
    return list(found.values())
