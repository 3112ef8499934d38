"""Totals: the quantities of a whole simulation, by the names that checks, tables and the ledger have for them."""

from __future__ import annotations

from collections.abc import Collection

from particlesim.bodies import Bodies
from particlesim.checks.quantities import BALANCE, ROTATION, TOTALS, WORK
from particlesim.emitters import Emitter
from particlesim.forces import Force
from particlesim.laws.registry import KILL, has_law, potential
from particlesim.model.attributes import ATTRIBUTES
from particlesim.scenario.reach import acts_on, held_back, may_break, pair_sets, spins
from particlesim.scenario.tables import Tables


def totals(scenario: Tables) -> tuple[str, ...]:
    """Quantities of the whole simulation that a scenario has."""
    labels = scenario.labels
    stored = [
        label for label, force in zip(labels.forces, scenario.forces, strict=True) if has_potential(force)
    ]
    stored += labels.joints
    stored += [pairs.name for pairs in pair_sets(scenario) if pairs.law.stores()]
    broken = [bonds.name for bonds in scenario.bonds if may_break(scenario, bonds)]
    broken += [label for label, springs in scenario.body_springs if springs.spring_law().breaks]
    return (
        *TOTALS,
        *rotations(scenario),
        *(["missed_crossings"] if scenario.all_colliders or scenario.bodies else []),
        *(f"died.{cause}" for cause in deaths(scenario)),
        *(["broken"] if broken else []),
        *(f"broken.{name}" for name in broken),
        *(f"potential.{label}" for label in stored),
        *attribute_totals(scenario),
        *pressures(scenario),
        *(booked(scenario) if scenario.output.work else ()),
    )


def rotations(scenario: Tables) -> tuple[str, ...]:
    """The kinetic energy of rotation, which is part of `kinetic`, where something rotates."""
    turns = any(isinstance(group, Bodies) or spins(scenario, group) for group in scenario.groups)
    return (ROTATION,) if turns else ()


def pressures(scenario: Tables) -> tuple[str, ...]:
    """The pressure, where particles fill a box that is periodic along all axes and act on each other alone, by forces: what
    springs, rods, pins and impulses carry is not counted."""
    box = scenario.simulation.box
    if box is None or not all(box.periodic):
        return ()
    carried = bool(scenario.bonds or scenario.rod_sets or scenario.hinges)
    carried = carried or any(group.has_pins() for group in scenario.particles)
    carried = carried or any(pairs.law.by_impulses for pairs in pair_sets(scenario))
    moving = all(group.dynamics.type == "second_order" for group in scenario.groups)
    return ("pressure",) if moving and not carried else ()


def attribute_totals(scenario: Tables) -> tuple[str, ...]:
    """Sums of attributes over all particles, such as "charge.total", where some particle may have them."""
    summed = (each.name for each in ATTRIBUTES.values() if each.total)
    return tuple(f"{name}.total" for name in summed if any(group.may_have(name) for group in scenario.groups))


def booked(scenario: Tables) -> tuple[str, ...]:
    """Quantities that there are when work is recorded: the work of every cause, their sum, the residual of the balance."""
    return (WORK, *work_columns(scenario))


def work_columns(scenario: Tables) -> tuple[str, ...]:
    """Columns of the ledger when work is recorded: of every cause, impulses, and the residual of the balance."""
    found = causes(scenario, [group.name for group in scenario.groups])
    kicks = ("impulses",) if scenario.impulses else ()
    return (*(f"{WORK}.{name}" for name in dict.fromkeys((*found, *kicks))), BALANCE)


def causes(scenario: Tables, names: Collection[str]) -> tuple[str, ...]:
    """What may give energy to groups or take it: labels of forces, springs and interactions, and names of other causes."""
    groups = [group for group in scenario.groups if group.name in names]
    bonds = [bonds for bonds in scenario.bonds if bonds.groups[0] in names]
    reaching = [
        (label, force)
        for label, force in zip(scenario.labels.forces, scenario.forces, strict=True)
        if any(acts_on(force, group) for group in groups)
    ]
    found = [label for label, force in reaching if not (force.on_surfaces or has_potential(force))]
    found += [each.name for each in bonds if each.law.damped]
    bodies = [group.name for group in groups if isinstance(group, Bodies)]
    joined = [
        (label, springs.spring_law())
        for label, springs in scenario.body_springs
        if any(name in bodies for name in springs.groups())
    ]
    found += [label for label, law in joined if law.damped]
    laws = [*((each.name, each.law) for each in bonds), *joined]
    found += [f"{name}.breaking" for name, law in laws if law.breaks]
    found += [
        each.name for each in pair_sets(scenario) if each.groups[0] in names and not each.law.conserves()
    ]
    colliders = [each for each in scenario.all_colliders if held_back(each, names)]
    emitted = any(isinstance(group, Emitter) for group in groups)
    others = {
        "surfaces": any(force.on_surfaces for _, force in reaching),
        "contact": bool(colliders) or any(isinstance(group, Bodies) for group in groups),
        "motors": any(joint.driven and set(joint.groups()) & set(bodies) for joint in scenario.joints),
        "motion": any(motion.on in names for motion in scenario.motions),
        "births": emitted,
        "deaths": emitted or any(each.contact == "kill" for each in colliders),
    }
    # An interaction of type "contact" has that name unless it has another.
    return tuple(dict.fromkeys((*found, *(name for name, there in others.items() if there))))


def deaths(scenario: Tables) -> tuple[str, ...]:
    """Causes of death that there may be."""
    emitters = scenario.emitters
    dies = [emitter.die for emitter in emitters if emitter.die is not None]
    found = {
        "age": any(emitter.lifetime is not None for emitter in emitters),
        "cold": any(die.temperature_below is not None for die in dies),
        "recycled": any(e.limit is not None and e.when_full == "recycle" for e in emitters),
        "plane": any(each.contact == "kill" and each.killed == KILL for each in scenario.all_colliders),
        "outside": any(die.outside is not None for die in dies),
        "collider": any(each.contact == "kill" and each.killed != KILL for each in scenario.all_colliders),
    }
    return tuple(cause for cause, there in found.items() if there)


def has_potential(force: Force) -> bool:
    """Whether particles have an energy in a force, so that its work is no loss."""
    return has_law(potential, force.record())
