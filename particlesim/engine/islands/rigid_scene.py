"""What acts on rigid bodies, as kernels take it: forces, colliders, joints, contact between groups, totals of work."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.bodies import Bodies as BodyGroup
from particlesim.colliders import Collider
from particlesim.colliders.response import STEADY
from particlesim.engine.ledger.work import Books
from particlesim.engine.rigid.bodies import Surfaces
from particlesim.engine.rigid.fluids import through_surface
from particlesim.engine.rigid.hearing import Hearing
from particlesim.engine.rigid.joint_system import Made, new_joints, new_stops, partners_of
from particlesim.engine.rigid.kernel import Scene, Stretch
from particlesim.engine.rigid.pieces import pieces_of
from particlesim.engine.rigid.rolling import Rolling
from particlesim.engine.rigid.spring_layout import Laid
from particlesim.engine.rigid.support import Support
from particlesim.engine.rigid.swift import new_swift
from particlesim.engine.rigid.touching import no_contact
from particlesim.engine.rigid.walls import Wall
from particlesim.engine.rigid.work import Work
from particlesim.engine.state.group_state import GroupState
from particlesim.engine.state.table import HEARD, HIT
from particlesim.graph.graph import Island
from particlesim.interactions.contact import Contact
from particlesim.model.arrays import Ints
from particlesim.model.attributes import FURTHER
from particlesim.scenario.reach import (
    codes_of_groups,
    heard,
    held_back,
    meetings_of,
    pair_sets,
    touches_by_surfaces,
)
from particlesim.scenario.scenario import Scenario

SLOP = 1e-4
"""Overlap that contacts leave alone, in units of the smallest size: impulses take up what rounding and steps leave of it."""


def still_of(groups: Sequence[BodyGroup], owner: NDArray[np.int64]) -> tuple[Any, ...]:
    """What never changes of bodies, as `Bodies` has it from `w` on."""
    mass = np.array([group.weight for group in groups])[owner]
    inertia = np.array([group.inertia() for group in groups]).T[:, owner]
    reach = np.array([group.shape.reach() for group in groups])[owner]
    pieces = pieces_of([group.shape.own_pieces() for group in groups])
    return 1 / mass, np.ascontiguousarray(inertia), reach, owner, pieces


def colliders_of(structure: Island) -> list[Collider]:
    """All colliders of an island, each once."""
    return list({id(each): each for colliders in structure.colliders for each in colliders}.values())


def _wall(collider: Collider, on: NDArray[np.int64], number: int) -> Wall:
    """A collider for kernels, with the groups that it holds back."""
    belt = collider.surface_velocity or (0.0, 0.0, 0.0)
    law = (collider.liveliness, *collider.coefficients)
    return Wall(collider.body(), on, *law, belt, number, collider.falling)


def scene_of(
    structure: Island,
    groups: Sequence[BodyGroup],
    bounds: Sequence[int],
    owner: NDArray[np.int64],
    whole: GroupState,
    scenario: Scenario,
    made: Sequence[Made],
    springs: Sequence[Laid],
    books: Books | None,
) -> tuple[Scene, NDArray[np.int64]]:
    """What acts on the bodies, and which of the joints that were made each one of it is."""
    stretches = tuple(
        _stretch(a, b, [force.record() for force in forces], group)
        for (a, b), forces, group in zip(pairwise(bounds), structure.forces, groups, strict=True)
    )
    walls: list[Wall] = []
    for collider in colliders_of(structure):
        on = np.array([any(each is collider for each in met) for met in structure.colliders], np.int64)
        walls.append(_wall(collider, on, len(walls)))
    spread = np.array([[j / group.shape.volume() for j in group.shape.spread()] for group in groups])
    n = whole.count
    ends = max((max(each.first, each.second) + 1 for each in made), default=0)
    joints, order = new_joints(made, max(n, ends)) if made else (None, np.empty(0, np.int64))
    joined, partners, partner_from = partners_of(scenario, made, max(n, ends))
    feel = any(force.needs_velocity() for forces in structure.forces for force in forces)
    scene = Scene(
        stretches,
        tuple(each.springs for each in springs if each.tied is None),
        tuple(walls),
        surfaces_of(groups),
        np.ascontiguousarray(np.sqrt(3 * spread).T[:, owner]),
        whole.mass[:n].astype(float),
        whole.radius[:n].astype(float),
        tuple(whole.attribute(each.name) if each.name in whole.parts else None for each in FURTHER),
        SLOP * min(group.shape.fineness() for group in groups),
        2 if feel or any(np.any(each.springs.c > 0) for each in springs) else 1,
        joints,
        new_stops(made, order),
        joined,
        partners,
        partner_from,
        None if books is None else _work(books, springs, groups),
        swift=new_swift([group.shape for group in groups], owner, some_fall(structure, groups, scenario)),
        hearing=_hearing(structure, whole, owner, scenario),
    )
    return scene, order


def support_of(scenario: Scenario, kinds: Sequence[str]) -> Support:
    """What particles of these groups lie on besides bodies. What yields acts on them as a force."""
    touching = [(each.groups, each.law) for each in pair_sets(scenario) if isinstance(each.law, Contact)]
    soft = {name for groups, law in touching if law.soft for name in groups}
    pairs, rolling = no_contact(len(kinds), len(kinds)), np.zeros(len(kinds))
    for groups, law in touching:
        mine = [group for group in scenario.groups if group.name in groups]
        if law.by_impulses and not touches_by_surfaces(law, mine):
            falls = law.falling or STEADY
            values = (1.0, law.liveliness, *law.coefficients, *falls, law.rolls, 0.0)
            for a, b in product(range(len(kinds)), repeat=2):
                across = law.between is None or kinds[a] != kinds[b]
                if kinds[a] in groups and kinds[b] in groups and across:
                    rolling[a] = max(rolling[a], law.rolls)
                    for column, value in zip(pairs, values, strict=True):
                        column[a, b] = value
    walls = []
    for number, collider in enumerate(scenario.all_colliders):
        if collider.contact in ("bounce", "slide") and not collider.soft:
            on = np.array([held_back(collider, (name,)) and name not in soft for name in kinds], np.int64)
            walls.append(_wall(collider, on, number))
    return Support(tuple(walls), pairs, rolling, _heard_on_colliders(scenario, kinds))


def _hearing(
    structure: Island, whole: GroupState, owner: NDArray[np.int64], scenario: Scenario
) -> Hearing | None:
    """Which impacts of bodies, and of particles on them, emitters hear; None where they hear none."""
    names = [group.name for group in structure.groups]
    all_names = [group.name for group in scenario.groups]
    on_colliders, codes = (
        _heard_on_colliders(scenario, all_names),
        codes_of_groups(scenario, all_names, all_names),
    )
    if HEARD not in whole.parts and (on_colliders == -1).all() and (codes == -1).all():
        return None
    numbers = np.full((len(colliders_of(structure)), len(structure.groups)), -1)
    for k, collider in enumerate(colliders_of(structure)):
        for g, (met, told) in enumerate(zip(structure.colliders, structure.heard, strict=True)):
            for each, number in zip(met, told, strict=True):
                if each is collider and number is not None:
                    numbers[k, g] = number
    n = whole.count
    rows = whole.hit[:, :n] if HEARD in whole.parts else np.zeros((len(HIT), n))
    code = codes_of_groups(scenario, names, names)
    return Hearing(
        numbers,
        np.empty((0, 0), np.int64),
        rows,
        whole.radius[:n].astype(float),
        owner,
        whole.id[:n].copy(),
        code,
    )


def are_heard(scenario: Scenario, bodies: Sequence[GroupState]) -> bool:
    """Whether emitters hear of impacts of bodies, or of particles on them."""
    names = [state.name for state in bodies]
    others = [group.name for group in scenario.groups if group.name not in names]
    return any(HEARD in state.parts for state in bodies) or bool(
        (codes_of_groups(scenario, others, names) < -1).any()
    )


def _heard_on_colliders(scenario: Scenario, names: Sequence[str]) -> Ints:
    """Under which number emitters hear of impacts of groups on colliders, −1 where none does [colliders, groups]."""
    found = [
        [k if held_back(each, (name,)) and heard(scenario, name, each) else -1 for name in names]
        for k, each in enumerate(scenario.all_colliders)
    ]
    return np.array(found, np.int64).reshape(-1, len(names))


def _work(books: Books, springs: Sequence[Laid], groups: Sequence[BodyGroup]) -> Work:
    """How the work on bodies is booked."""

    def acting(records: Sequence[Any], group: BodyGroup) -> tuple[Any, ...]:
        return tuple(through_surface(record, group.shape) or record for record in records)

    spent = tuple(acting(records, group) for (_, records), group in zip(books.spent, groups, strict=True))
    cause = tuple(np.array([books.names.index(n) for n in labels], np.int64) for labels, _ in books.spent)
    stored = tuple(acting(records, group) for (_, records), group in zip(books.stored, groups, strict=True))
    at = {name: k for k, name in enumerate(books.names)}
    damper = np.array([at.get(each.name, -1) for each in springs], np.int64)
    breaking = np.array([at.get(f"{each.name}.breaking", -1) for each in springs], np.int64)
    return Work(spent, cause, stored, damper, breaking, at["contact"], at.get("motors", -1), books.totals)


def _stretch(first: int, last: int, records: Sequence[Any], group: BodyGroup) -> Stretch:
    """The forces on the bodies of a group, on points that have their mass and through their surface."""
    others = [through_surface(record, group.shape) for record in records]
    return Stretch(
        first,
        last,
        tuple(record for record, other in zip(records, others, strict=True) if other is None),
        tuple(other for other in others if other is not None),
    )


def surfaces_of(groups: Sequence[BodyGroup]) -> Surfaces:
    """The contact between bodies of two groups: the smaller restitution, the geometric mean of frictions, the larger rolling
    friction."""
    lively = np.array([group.liveliness for group in groups])
    static, kinetic = np.array([group.coefficients for group in groups]).T
    return Surfaces(
        np.ones((len(groups), len(groups))),
        np.minimum.outer(lively, lively),
        np.sqrt(np.multiply.outer(static, static)),
        np.sqrt(np.multiply.outer(kinetic, kinetic)),
        _rolling(groups),
        _falls(groups),
    )


def some_fall(structure: Island, groups: Sequence[BodyGroup], scenario: Scenario) -> bool:
    """Whether the restitution of some contact of bodies falls with the speed of impacts."""
    laws = [each.falling for each in groups]
    laws += [each.falling for each in colliders_of(structure)]
    laws += [each.falling for each in meetings_of(scenario)]
    return any(law is not None for law in laws)


def _falls(groups: Sequence[BodyGroup]) -> NDArray[np.float64] | None:
    """How the restitution of groups falls; None where none does."""
    laws = [(each.liveliness, *(each.falling or STEADY)) for each in groups]
    return np.array(laws).T.copy() if any(each.falling for each in groups) else None


def _rolling(groups: Sequence[BodyGroup]) -> Rolling | None:
    """Rolling friction of groups; None where all roll freely."""
    friction = np.array([group.rolling_friction for group in groups], float)
    flat = [group.shape.all_flat() for group in groups]
    return Rolling(friction, np.array(flat, float)) if friction.any() else None
