"""What a force reaches: which groups can feel it, and where groups are stated."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from particlesim.bodies import Bodies, Joint
from particlesim.bonds import BondSet, Rods, Springs
from particlesim.bonds.base import Ties
from particlesim.colliders import Collider
from particlesim.colliders.response import FallingRecord
from particlesim.forces import Force
from particlesim.groups.group import Group, Particles
from particlesim.interactions import PairInteraction, PairSet
from particlesim.interactions.contact import Contact
from particlesim.layouts.mesh import STRUCTURAL
from particlesim.model.arrays import Ints
from particlesim.model.mistakes import Path
from particlesim.scenario.tables import Tables


def acts_on(force: Force, group: Group) -> bool:
    """Whether a force acts on a group.

    A force without `on` acts on every group that can feel it: tracers feel none, and particles without inertia none that
    depend on the velocity.
    """
    if force.on is not None:
        return group.name in force.on
    return not unfelt(force, group)


def unfelt(force: Force, group: Group) -> str | None:
    """Why a group cannot feel a force; None if it can."""
    if force.on_surfaces and not (isinstance(group, Particles) and group.layout.has_surface()):
        return "this force acts on surfaces; cloth, jelly and mesh have one"
    if group.dynamics.type == "tracer":
        return "tracers move with their flow; no force acts on them"
    if group.dynamics.type == "first_order" and force.needs_velocity():
        return "this force depends on the velocity, which particles without inertia do not have"
    return None


class Meeting(NamedTuple):
    """Contact of the particles of a group with the bodies of another: their names, the name of the interaction, restitution
    of slow impacts, static and kinetic friction, how restitution falls with the speed of impacts, or None, and rolling
    friction."""

    particles: str
    bodies: str
    label: str
    restitution: float
    friction: tuple[float, float]
    falling: FallingRecord | None
    rolling: float


def interacting(interaction: PairInteraction, groups: Iterable[Group]) -> tuple[Group, ...]:
    """The groups whose particles an interaction acts on: those that it names, else all that can feel it."""
    return tuple(group for group in _reached(interaction, groups) if not isinstance(group, Bodies))


def _reached(interaction: PairInteraction, groups: Iterable[Group]) -> tuple[Group, ...]:
    named = interaction.between or interaction.on
    if named is not None:
        return tuple(group for name in named for group in groups if group.name == name)
    return tuple(group for group in groups if not unmoved(interaction, group))


def touched_bodies(scenario: Tables, interaction: PairInteraction) -> tuple[Bodies, ...]:
    """The bodies that an interaction acts on."""
    return tuple(group for group in _reached(interaction, scenario.bodies) if isinstance(group, Bodies))


def meetings_of(scenario: Tables) -> tuple[Meeting, ...]:
    """Which particles touch which bodies."""
    return tuple(
        Meeting(group.name, body.name, label, each.liveliness, each.coefficients, each.falling, each.rolls)
        for label, each in zip(scenario.labels.interactions, scenario.interactions, strict=True)
        if isinstance(each, Contact) and each.by_impulses
        for group in interacting(each, scenario.groups)
        for body in _reached(each, scenario.bodies)
    )


def unmoved(interaction: PairInteraction, group: Group) -> str | None:
    """Why a group cannot feel an interaction; None if it can."""
    if isinstance(group, Bodies):
        if interaction.by_impulses:
            return None
        if interaction.soft:
            return 'rigid bodies touch particles by impulses: model = "impulse"'
        return "interactions act between particles, and rigid bodies feel none but contact"
    if group.dynamics.type == "tracer":
        return "tracers move with their flow; nothing acts on them"
    if group.dynamics.type == "first_order" and interaction.needs_velocity():
        return "this interaction depends on the velocity, which particles without inertia do not have"
    return None


def has_extent(group: Group) -> bool:
    """Whether a group is more than its particles: its layout has triangles, or edges that join neighbours."""
    if not isinstance(group, Particles) or isinstance(group, Bodies):
        return False
    return group.layout.has_surface() or STRUCTURAL in group.layout.kinds


def touches_by_surfaces(interaction: PairInteraction, groups: Iterable[Group]) -> bool:
    """Whether an interaction is a contact of triangles and edges, not of particles alone."""
    return interaction.by_surfaces and any(has_extent(group) for group in groups)


def pair_sets(scenario: Tables) -> tuple[PairSet, ...]:
    """All interactions between particles, each with its name in the ledger and its groups."""
    return tuple(
        PairSet(label, tuple(group.name for group in interacting(each, scenario.groups)), each)
        for label, each in zip(scenario.labels.interactions, scenario.interactions, strict=True)
        if each.between is None or len(interacting(each, scenario.groups)) == 2
    )


def ties(scenario: Tables) -> tuple[Ties, ...]:
    """All that joins particles of one group or of several, but for what acts on surfaces."""
    return (*scenario.bonds, *scenario.rod_sets, *scenario.hinges, *pair_sets(scenario))


def joint_tables(scenario: Tables) -> Iterator[tuple[Path, Joint | Springs | Rods]]:
    """What joins rigid bodies, and where it is stated."""
    for k, joint in enumerate(scenario.joints):
        yield ("joints", k), joint
    for k, springs in enumerate(scenario.springs):
        if scenario.at_bodies(springs):
            yield ("springs", k), springs
    for k, rods in enumerate(scenario.rods):
        if scenario.at_bodies(rods):
            yield ("rods", k), rods


def spins(scenario: Tables, group: Group) -> bool:
    """Whether the particles of a group rotate: spheres do whose contacts with each other have friction; surfaces, strands
    and what touches these do not."""
    for each in scenario.interactions:
        if each.rubs:
            groups = interacting(each, scenario.groups)
            if each.between is not None and len(groups) < 2:
                continue  # with bodies alone
            if any(group.name == other.name for other in groups) and not touches_by_surfaces(each, groups):
                return True
    return False


def collider_tables(scenario: Tables) -> Iterator[tuple[Path, Collider]]:
    """Planes and other colliders, and where they are stated."""
    for k, plane in enumerate(scenario.planes):
        yield ("planes", k), plane
    for k, collider in enumerate(scenario.colliders):
        yield ("colliders", k), collider


def held_back(collider: Collider, groups: Collection[str]) -> bool:
    """Whether a collider holds back one of some groups."""
    return collider.on is None or any(name in groups for name in collider.on)


def heard(scenario: Tables, name: str, collider: Collider) -> bool:
    """Whether an emitter hears of impacts of a group on a collider."""
    return (
        any(
            event is not None and name in event.of and event.hears(collider.name)
            for event in (emitter.on_impact for emitter in scenario.emitters)
        )
        and not collider.soft
    )


def codes_of_groups(scenario: Tables, names: Sequence[str], others: Sequence[str]) -> Ints:
    """Under which number emitters hear of impacts of groups on others [names, others]: −2 − k for the k-th of all groups,
    less than those of colliders, and −1 where none hears of them."""
    events = [emitter.on_impact for emitter in scenario.emitters if emitter.on_impact is not None]
    number = {group.name: k for k, group in enumerate(scenario.groups)}
    found = np.full((len(names), len(others)), -1)
    for i, name in enumerate(names):
        for j, other in enumerate(others):
            if any(name in event.of and other in (event.against or ()) for event in events):
                found[i, j] = -2 - number[other]
    return found


def mortal(scenario: Tables, name: str) -> bool:
    """Whether particles of a group may die: those of emitters, and what meets a collider that kills."""
    return any(emitter.name == name for emitter in scenario.emitters) or any(
        each.contact == "kill" and held_back(each, (name,)) for each in scenario.all_colliders
    )


def may_break(scenario: Tables, bonds: BondSet) -> bool:
    """Whether springs of a set may break, on their own or because an end dies."""
    return bonds.law.breaks or any(mortal(scenario, name) for name in bonds.groups)


def group_tables(scenario: Tables) -> Iterator[tuple[Path, Group]]:
    """All groups, and where they are stated."""
    for k, particles in enumerate(scenario.particles):
        yield ("particles", k), particles
    for k, bodies in enumerate(scenario.bodies):
        yield ("bodies", k), bodies
    for k, emitter in enumerate(scenario.emitters):
        yield ("emitters", k), emitter
