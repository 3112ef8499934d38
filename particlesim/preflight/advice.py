"""Choices in a scenario that are legal and seldom meant: told by `psim check` and at the end of a run."""

from __future__ import annotations

from particlesim.forces.gravity import Gravity
from particlesim.graph.graph import method_of
from particlesim.groups.group import Group
from particlesim.integrators import Composition
from particlesim.preflight.contact_steps import contact_doubts
from particlesim.scenario.reach import acts_on, held_back
from particlesim.scenario.scenario import Scenario

METHODS_THAT_KEEP = "rk4, heun and stormer_verlet keep their order"


def advice(scenario: Scenario) -> tuple[str, ...]:
    """One sentence for each doubtful choice."""
    return (
        *_format(scenario),
        *_order(scenario),
        *_projection(scenario),
        *_twice(scenario),
        *_never(scenario),
        *_loose(scenario),
        *_joined_twice(scenario),
        *contact_doubts(scenario),
    )


def _format(scenario: Scenario) -> list[str]:
    if scenario.written_format == scenario.format:
        return []
    return [
        f"the scenario is in format {scenario.written_format} and was read as {scenario.format}; psim migrate rewrites it"
    ]


def _order(scenario: Scenario) -> list[str]:
    return [sentence for group in scenario.groups for sentence in loss_of_order(scenario, group)]


def loss_of_order(scenario: Scenario, group: Group) -> tuple[str, ...]:
    """Kicks and drifts are first order when the force depends on the velocity that a kick changes."""
    method = method_of(group, scenario.simulation.integrator)
    if not isinstance(method, Composition) or method.order < 2:
        return ()
    depends = [
        label
        for label, force in zip(scenario.force_labels(), scenario.forces, strict=False)
        if acts_on(force, group) and force.needs_velocity()
    ]
    depends += [bonds.name for bonds in scenario.bonds if group.name in bonds.groups and bonds.law.damped]
    if not depends:
        return ()
    rods = any(group.name in each.groups for each in scenario.rod_sets)
    better = "take a smaller dt, as no other method holds rods" if rods else METHODS_THAT_KEEP
    return (
        f"{method.name} is only first order for {group.name!r}, because {' and '.join(depends)} "
        f"{'depends' if len(depends) == 1 else 'depend'} on the velocity; {better}",
    )


def _projection(scenario: Scenario) -> list[str]:
    """Discrete detection lifts a particle out of the collider, which adds m g times the depth."""
    return [
        f"{each.kind} {each.name or k} with discrete detection and restitution {each.liveliness:g} can add energy: "
        'particles are lifted out of it; detection = "continuous" does not'
        for k, each in enumerate(scenario.all_colliders)
        if each.lifts()
    ]


def sliding(scenario: Scenario, group: str | None = None) -> tuple[str, ...]:
    """Colliders on which particles (of one group) slide by a distance that depends on the step: a particle at rest touches
    in every step, and loses its part of the sliding velocity every time. Told before a run, and by `psim verify`."""
    return tuple(
        f"{each.kind} {each.name or k}: tangential_loss is taken at every contact, and a particle that lies on the "
        f"{each.kind} touches it in every step; how far it slides depends on dt, and goes to nothing with it. It is a model "
        "of impacts, not of friction, which psim does not have"
        for k, each in enumerate(scenario.all_colliders)
        if each.contact == "bounce"
        and each.tangential_loss > 0
        and each.liveliness < 1
        and (group is None or held_back(each, (group,)))
    )


def _twice(scenario: Scenario) -> list[str]:
    """Uniform gravity that acts on a group more than once, as after copying a block."""
    found = []
    labels = [
        (label, force)
        for label, force in zip(scenario.force_labels(), scenario.forces, strict=False)
        if isinstance(force, Gravity)
    ]
    for group in scenario.groups:
        here = [label for label, force in labels if acts_on(force, group)]
        if len(here) > 1:
            found.append(f"{' and '.join(here)} act together on {group.name!r}: gravity adds up")
    return found


def _never(scenario: Scenario) -> list[str]:
    """Bursts that the run does not come to."""
    return [
        f"the burst of {emitter.name!r} at {burst.at:.6g} s is never born: the run ends at {scenario.grid.duration:.6g} s"
        for emitter in scenario.emitters
        for burst in emitter.bursts()
        if burst.at >= scenario.grid.duration
    ]


def _loose(scenario: Scenario) -> list[str]:
    """Bodies that nothing holds together."""
    joined = {name for bonds in scenario.bonds for name in bonds.groups}
    joined |= {hinges.group for hinges in scenario.hinges}
    joined |= {name for rods in scenario.rod_sets for name in rods.groups}
    return [
        f"nothing joins the particles of {group.name!r}: a {group.layout.type} has the springs that its table springs states"
        for group in scenario.particles
        if group.layout.is_body and group.name not in joined and group.pinned is not True
    ]


def _joined_twice(scenario: Scenario) -> list[str]:
    """Pairs in two lists of springs of the same kind, as after copying a block."""
    seen: dict[tuple[bool, bool, frozenset[tuple[str, int]]], str] = {}
    found: dict[tuple[str, str], list[str]] = {}
    for springs, label in zip(
        scenario.springs, scenario.force_labels()[len(scenario.forces) :], strict=False
    ):
        if not springs.stiffness and springs.frequency is None:
            continue  # dampers beside springs
        first, second = springs.groups()
        for i, j in springs.pairs or ():
            key = (
                springs.tension_only,
                springs.compression_only,
                frozenset(((first, i), (second, j))),
            )
            if (other := seen.setdefault(key, label)) != label:
                pair = f"{i} and {j}" if first == second else f"{i} of {first!r} and {j} of {second!r}"
                found.setdefault((other, label), []).append(pair)
    return [
        f"{one} and {other} both join particles {pairs[0]}"
        + (f", and {len(pairs) - 1:,} more pairs" if len(pairs) > 1 else "")
        + ": their stiffness adds up"
        for (one, other), pairs in found.items()
    ]
