"""How rods must agree with the rest of a scenario."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.integrators import METHODS, Composition, method_for
from particlesim.model.mistakes import Invalid, Path
from particlesim.scenario.reach import collider_tables, held_back
from particlesim.scenario.tables import Tables

CANNOT = {
    "stick": "cannot hold on to particles of rods: two that stick might not be a rod's length apart",
    "kill": "cannot kill particles that are joined by rods: a rod needs both ends",
}
"""What colliders do that rods do not stand."""


def rod_tables(scenario: Tables) -> Iterator[tuple[Path, tuple[str, str]]]:
    """Where rods are stated, and the groups that they join."""
    for k, rods in enumerate(scenario.rods):
        if not scenario.at_bodies(rods):
            yield ("rods", k), rods.groups()
    for k, group in enumerate(scenario.particles):
        if group.springs is not None and group.springs.rigid:
            yield ("particles", k, "springs", "rigid"), (group.name, group.name)


def are_rods(place: Path) -> bool:
    """Whether rods, not springs, are stated at a place of a scenario."""
    return place[0] == "rods" or place[-1] == "rigid"


def unfit(scenario: Tables, couplings: list[tuple[str, str]]) -> Iterator[Invalid]:
    """Rods that nothing can hold: methods that are no kicks and drifts, particles without inertia, colliders that catch.

    `couplings` are all pairs of groups that step together.
    """
    for here, names in rod_tables(scenario):
        yield from _methods(scenario, here, names)
        together = _connected(set(names), couplings)
        for section, groups in (("particles", scenario.particles), ("emitters", scenario.emitters)):
            for k, group in enumerate(groups):
                if group.name in together and group.dynamics.type == "first_order":
                    yield Invalid(
                        "rods need particles with inertia, also among those that are joined to theirs by springs",
                        here,
                        (((section, k, "dynamics"), f"{group.name!r} has none"),),
                        hint="springs join particles without inertia",
                    )
        for where, collider in collider_tables(scenario):
            why = CANNOT.get(collider.contact)
            if why is not None and held_back(collider, names):
                yield Invalid(
                    f"a {collider.kind} {why}",
                    (*where, "contact"),
                    ((here, "joined here"),),
                    hint=f"name the groups that the {collider.kind} acts on with on = [...], or let them bounce",
                )


def _methods(scenario: Tables, here: Path, names: tuple[str, str]) -> Iterator[Invalid]:
    """Rods are held after every drift, so the method has to be made of kicks and drifts."""
    allowed = ", ".join(name for name, method in METHODS.items() if isinstance(method, Composition))
    for k, group in enumerate(scenario.particles):
        method = method_for(group.integrator or scenario.simulation.integrator)
        if group.name in names and not isinstance(method, Composition):
            own: Path = ("particles", k, "integrator")
            yield Invalid(
                f"{method.name} cannot hold rods",
                own if group.integrator is not None else ("simulation", "integrator"),
                ((here, "rods here"),),
                allowed=allowed,
                hint="springs with a high frequency go with every method",
            )
            return


def _connected(names: set[str], couplings: list[tuple[str, str]]) -> set[str]:
    """The groups that step together with some."""
    found, size = set(names), 0
    while len(found) > size:
        size = len(found)
        for pair in couplings:
            if found & set(pair):
                found |= set(pair)
    return found
