"""Interactions between particles: they act on groups that exist, that can feel them, and that have what they need."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.colliders.friction import FallingRestitution
from particlesim.groups.group import Group
from particlesim.integrators import method_for
from particlesim.interactions import PairInteraction
from particlesim.model.mistakes import Invalid, Path
from particlesim.scenario.reach import (
    collider_tables,
    group_tables,
    held_back,
    interacting,
    spins,
    touches_by_surfaces,
    unmoved,
)
from particlesim.scenario.tables import Tables

STOCHASTIC = ("velocity_verlet", "symplectic_euler")
"""Methods that evaluate forces at the ends of steps alone, so that a kick belongs to one step."""


def named_groups(scenario: Tables) -> Iterator[tuple[Path, str]]:
    """Where interactions name groups."""
    for k, each in enumerate(scenario.interactions):
        for key in ("on", "between"):
            for j, name in enumerate(getattr(each, key) or ()):
                yield ("interactions", k, key, j), name


def felt(scenario: Tables) -> Iterator[Invalid]:
    """Interactions act on particles that can feel them, and that have what the law reads."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    for at, name in named_groups(scenario):
        path, group = tables[name]
        each = scenario.interactions[int(at[1])]
        if why := unmoved(each, group):
            yield Invalid(why, at, (((*path, "dynamics"), "here"),))
    for k, each in enumerate(scenario.interactions):
        groups = interacting(each, scenario.groups)
        for key, name in strangers(each, [group.name for group in groups]):
            yield Invalid(f"{name!r} is not a group of this interaction", ("interactions", k, key, name))
        if not groups:
            hint = "rigid bodies touch each other without it" if scenario.bodies else None
            yield Invalid(f"no group of particles can feel {each.label}", ("interactions", k), hint=hint)
        for group in groups:
            path, _ = tables[group.name]
            if missing := each.lacks(group.name):
                key, what = missing
                yield Invalid(
                    f"the {what} is missing",
                    ("interactions", k, key),
                    ((path, "this group interacts"),),
                    hint="give it, or name the groups that interact with on = [...]",
                )
            if each.type == "contact" and group.radius is not None and not _largest_radius(group):
                yield Invalid(
                    f"{each.label} needs a radius greater than 0: points never touch each other",
                    (*path, "radius"),
                    ((("interactions", k), "this interaction"),),
                )
            for attribute in sorted(each.needs()):
                if not group.may_have(attribute):
                    yield Invalid(
                        f"{each.label} needs a {attribute}, and the particles of {group.name!r} have none",
                        ("interactions", k),
                        ((path, f"no {attribute} here"),),
                        hint=f"give the group a {attribute}, or name the groups that interact with on = [...]",
                    )


SINGLE = 1e-7
"""The least error of forces in single precision, twice the rounding of a number."""


def exact_enough(scenario: Tables) -> Iterator[Invalid]:
    """An accuracy is one that numbers of the run can have."""
    for k, each in enumerate(scenario.interactions):
        accuracy = getattr(each, "accuracy", None)
        if scenario.simulation.precision == "single" and accuracy is not None and accuracy < SINGLE:
            yield Invalid(
                f"forces in single precision are rounded to some 6e-08 of their size, which is more than {accuracy:g}",
                ("interactions", k, "accuracy"),
                ((("simulation", "precision"), "single here"),),
                allowed=f'{SINGLE:g} or more, or precision = "double"',
            )


def turned(scenario: Tables) -> Iterator[Invalid]:
    """Only what rubs turns."""
    for k, group in enumerate(scenario.particles):
        if group.angular_velocity is not None and not spins(scenario, group):
            yield Invalid(
                f"the particles of {group.name!r} do not turn",
                ("particles", k, "angular_velocity"),
                hint='[[interactions]] of type "contact" with friction let them',
            )


def rolled(scenario: Tables) -> Iterator[Invalid]:
    """Rolling friction holds back what turns: spheres whose contacts have friction."""
    for k, each in enumerate(scenario.interactions):
        if each.rolls > 0:
            groups = interacting(each, scenario.groups)
            at: Path = ("interactions", k, "rolling_friction")
            if touches_by_surfaces(each, groups):
                yield Invalid(
                    "surfaces, strands and what touches them do not roll",
                    at,
                    hint="surfaces = false has particles touch as spheres",
                )
            elif groups and not any(spins(scenario, group) for group in groups):
                yield Invalid(
                    f"the particles of {groups[0].name!r} do not turn, and have no rolling friction",
                    at,
                    hint="friction of a contact among the grains themselves lets them turn",
                )


def against_walls(scenario: Tables) -> Iterator[Invalid]:
    """What colliders say of impacts that soft contacts, which are not impacts, cannot do."""
    for k, each in enumerate(scenario.interactions):
        if not each.soft:
            continue
        names = [group.name for group in interacting(each, scenario.groups)]
        for path, collider in collider_tables(scenario):
            if collider.contact != "bounce" or not held_back(collider, names):
                continue
            here = ((("interactions", k), "soft contacts here"),)
            if isinstance(collider.restitution, FallingRestitution):
                yield Invalid(
                    "restitution that falls with speed belongs to impacts, and soft contacts have none",
                    (*path, "restitution"),
                    here,
                    allowed="one number, or groups that it holds back, on = [...]",
                )
            if collider.recovery is not None:
                yield Invalid(
                    "recovery puts particles back on a surface after impacts, and soft contacts have none",
                    (*path, "recovery"),
                    here,
                    allowed="no recovery, or groups that it holds back, on = [...]",
                )
            if collider.tangential_loss > 0:
                yield Invalid(
                    "tangential_loss belongs to impacts, and soft contacts have none",
                    (*path, "tangential_loss"),
                    here,
                    allowed="friction = 0.3, say",
                )


def put_apart(scenario: Tables) -> Iterator[Invalid]:
    """What hangs on rods stays where they hold it."""
    for k, each in enumerate(scenario.interactions):
        if each.must_part:
            names = {group.name for group in interacting(each, scenario.groups)}
            for rods in scenario.rod_sets:
                if names & set(rods.groups):
                    yield Invalid(
                        f"particles on the rods {rods.name!r} cannot be moved apart: rods fix their distances",
                        ("interactions", k, "overlap"),
                        allowed='"auto", "keep"',
                    )


def kicked(scenario: Tables) -> Iterator[Invalid]:
    """Random kicks are those of a step: methods take forces at its beginning and its end, and their work is not recorded."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    for k, each in enumerate(scenario.interactions):
        if not each.random():
            continue
        here: Path = ("interactions", k)
        for group in interacting(each, scenario.groups):
            method = method_for(group.integrator or scenario.simulation.integrator)
            if method.name not in STOCHASTIC:
                yield Invalid(
                    f"{each.label} has random kicks, one for each step, which {method.name} cannot take",
                    here,
                    ((tables[group.name][0], f"stepped by {method.name}"),),
                    allowed=", ".join(STOCHASTIC),
                )
        if scenario.output.work:
            yield Invalid(
                f"the work of the random kicks of {each.label} cannot be recorded",
                ("output", "work"),
                ((here, "a thermostat"),),
            )


def fixed_steps(scenario: Tables) -> Iterator[Invalid]:
    """Contacts that look at the ends of steps need steps of one length: they cannot be undone."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    for k, each in enumerate(scenario.interactions):
        names = [group.name for group in interacting(each, scenario.groups)]
        walls = each.soft and any(
            collider.rubs and collider.contact == "bounce" and held_back(collider, names)
            for collider in scenario.all_colliders
        )
        if not (each.remembers() or walls):
            continue
        why = "impulses are given" if each.by_impulses else "friction remembers where contacts began"
        for group in interacting(each, scenario.groups):
            method = method_for(group.integrator or scenario.simulation.integrator)
            if method.adaptive:
                yield Invalid(
                    f"{why} at the ends of steps, and {method.name} tries steps before it accepts them",
                    ("interactions", k),
                    ((tables[group.name][0], f"stepped by {method.name}"),),
                    allowed="velocity_verlet, symplectic_euler, rk4 and others with steps of one length",
                )
            rods = [rods.name for rods in scenario.rod_sets if group.name in rods.groups]
            if each.by_impulses and rods:
                yield Invalid(
                    f"particles on rods, such as those of {rods[0]!r}, cannot touch by impulses: rods take no part in these",
                    ("interactions", k),
                    ((tables[group.name][0], "on rods"),),
                    hint='model = "linear" has forces, which rods balance',
                )
        if each.by_impulses and scenario.output.work:
            yield Invalid(
                f"the work of the impulses of {each.label} cannot be recorded",
                ("output", "work"),
                ((("interactions", k), "impulses"),),
                hint='model = "linear" has forces, whose work can',
            )


def _largest_radius(group: Group) -> float:
    """The largest radius that a scenario gives, 1 where it is drawn."""
    radius = group.radius
    if isinstance(radius, int | float):
        return float(radius)
    return max(map(float, radius), default=0.0) if isinstance(radius, tuple | list) else 1.0


def strangers(each: PairInteraction, groups: list[str]) -> Iterator[tuple[str, str]]:
    """Groups in tables of an interaction that are not among its own: the key of the table, and the name."""
    for key in type(each).model_fields:
        value = getattr(each, key)
        if isinstance(value, dict) and key in each.by_group:
            yield from ((key, name) for name in value if name not in groups)


def coupled(scenario: Tables) -> Iterator[tuple[Path, tuple[str, str]]]:
    """Where interactions couple groups, and which: the first one with each."""
    for k, each in enumerate(scenario.interactions):
        names = [group.name for group in interacting(each, scenario.groups)]
        for name in names[1:] or names:
            yield ("interactions", k), (names[0], name)
