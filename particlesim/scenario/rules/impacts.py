"""Emitters that react to impacts: there must be impacts, and no emitter may react, directly or not, to those of its own
births."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from particlesim.interactions.contact import Contact
from particlesim.model.mistakes import Invalid, Path
from particlesim.model.spelling import did_you_mean
from particlesim.scenario.reach import (
    collider_tables,
    group_tables,
    held_back,
    interacting,
    meetings_of,
    pair_sets,
    touches_by_surfaces,
)
from particlesim.scenario.tables import Tables


def heard(scenario: Tables) -> Iterator[Invalid]:
    """Groups whose impacts are heard meet the colliders that are named, have inertia, and do not depend on who hears."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    together = _together(scenario)
    soft = {
        group.name: each
        for each in scenario.interactions
        if isinstance(each, Contact) and each.soft
        for group in interacting(each, scenario.groups)
    }
    owner = {name: k for k, names in enumerate(together) for name in names}
    hears: dict[int, set[int]] = {}
    for k, emitter in enumerate(scenario.emitters):
        event = emitter.on_impact
        if event is None:
            continue
        here: Path = ("emitters", k, "on_impact")
        for j, name in enumerate(event.of):
            path, group = tables[name]
            also = ((path, "this group"),)
            if group.dynamics.type != "second_order":
                yield Invalid("particles without inertia have no impacts", (*here, "of", j), also)
            elif name in soft and path[0] != "bodies":
                yield Invalid(
                    f"contacts of {soft[name].label} last, so that {name!r} has no moment of impact",
                    (*here, "of", j),
                    also,
                    hint='model = "impulse" has impacts',
                )
            elif owner[name] == owner[emitter.name]:
                yield Invalid(
                    f"{emitter.name!r} and {name!r} act on each other in every step, or are the same, so that births would "
                    "change the impacts that cause them",
                    (*here, "of", j),
                    also,
                    allowed=_others(scenario, owner, emitter.name),
                )
            else:
                hears.setdefault(owner[emitter.name], set()).add(owner[name])
        if event.against is None or event.at is not None:
            yield from _places(scenario, here, event.of, event.at)
        for j, name in enumerate(event.against or ()):
            if not any(_touch(scenario, one, name) for one in event.of):
                yield Invalid(
                    f"{', '.join(map(repr, event.of))} and {name!r} do not touch each other by impulses",
                    (*here, "against", j),
                    ((tables[name][0], "this group"),),
                    hint='a contact with model = "impulse" between them has impacts that are heard, but not that of cloth '
                    "and other layouts with edges",
                )
        if _circle(hears, owner[emitter.name]):
            yield Invalid(
                f"births of {emitter.name!r} would follow from impacts that its own births cause",
                (*here, "of"),
            )


def _touch(scenario: Tables, one: str, other: str) -> bool:
    """Whether particles or bodies of two groups meet each other by impulses of single contacts."""
    bodies = [group.name for group in scenario.bodies]
    if one in bodies and other in bodies:
        return True
    if any({one, other} == {each.particles, each.bodies} for each in meetings_of(scenario)):
        return True
    for pairs in pair_sets(scenario):
        law = pairs.law
        groups = [group for group in scenario.groups if group.name in pairs.groups]
        if isinstance(law, Contact) and law.by_impulses and not touches_by_surfaces(law, groups):
            both = one in pairs.groups and other in pairs.groups
            if both and (law.between is None or one != other):
                return True
    return False


def _places(
    scenario: Tables, here: Path, names: tuple[str, ...], at: tuple[str, ...] | None
) -> Iterator[Invalid]:
    named = {each.name: (path, each) for path, each in collider_tables(scenario) if each.name is not None}
    for j, name in enumerate(at or ()):
        if name not in named:
            known = tuple(named)
            allowed = ", ".join(known) or "a name that a plane or a collider has"
            yield Invalid(
                f"unknown collider {name!r}",
                (*here, "at", j),
                allowed=allowed,
                hint=did_you_mean(name, known),
            )
            continue
        path, each = named[name]
        if each.soft:
            yield Invalid(
                "contact with a surface that yields has no moment of impact",
                (*here, "at", j),
                ((path, "this one"),),
            )
        elif not held_back(each, names):
            yield Invalid(
                f"{name!r} holds back none of {', '.join(map(repr, names))}",
                (*here, "at", j),
                ((path, "this one"),),
            )
    if at is None and not any(
        held_back(each, names) and not each.soft for _, each in collider_tables(scenario)
    ):
        yield Invalid(
            f"{', '.join(map(repr, names))} can hit nothing",
            (*here, "of"),
            allowed='groups that planes or colliders hold back (not with contact = "penalty"), or against = [...]',
        )


def _others(scenario: Tables, owner: Mapping[str, int], name: str) -> str:
    """The groups that do not step together with one."""
    found = [group.name for group in scenario.groups if owner[group.name] != owner[name]]
    return ", ".join(found) or "a group that does not act on it"


def _together(scenario: Tables) -> list[set[str]]:
    """Groups that step together, as they act on each other."""
    found = [{group.name} for group in scenario.groups]
    joined = [*(each.groups for each in scenario.bonds), *(each.groups for each in pair_sets(scenario))]
    joined += [(each.particles, each.bodies) for each in meetings_of(scenario)]
    joined += [(*(each.name for each in scenario.bodies), *scenario.tied)]
    for groups in (*joined, *(each.groups for each in scenario.rod_sets)):
        touched = [names for names in found if names & set(groups)]
        found = [names for names in found if names not in touched] + [set().union(*touched)]
    return found


def _circle(hears: dict[int, set[int]], start: int) -> bool:
    """Whether an emitter reacts to impacts of its own births, directly or through other emitters."""
    seen, ahead = set[int](), list(hears.get(start, ()))
    while ahead:
        one = ahead.pop()
        if one == start:
            return True
        if one not in seen:
            seen.add(one)
            ahead += hears.get(one, ())
    return False
