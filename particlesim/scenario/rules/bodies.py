"""Rigid bodies: what can act on them, and what is kept of them."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.bodies import Bodies, Joint
from particlesim.bonds import Rods, Springs
from particlesim.bonds.pairs import SINGLE, WORLD
from particlesim.emitters import Emitter
from particlesim.groups.group import Group, Particles
from particlesim.model.mistakes import Invalid, Path
from particlesim.model.spelling import did_you_mean
from particlesim.scenario.reach import (
    collider_tables,
    group_tables,
    held_back,
    joint_tables,
    mortal,
)
from particlesim.scenario.rules.joints import listed as particle_joints
from particlesim.scenario.rules.joints import which
from particlesim.scenario.tables import Tables

TURNING = ("orientation", "angular_velocity")
"""Fields that only bodies have."""


def joined(scenario: Tables) -> Iterator[Invalid]:
    """Angles, dihedrals, motions and interactions join, lead and act on particles."""
    tables: dict[str, Path] = {body.name: ("bodies", k) for k, body in enumerate(scenario.bodies)}
    for path, name, what in _named(scenario):
        if name in tables:
            yield Invalid(
                f"{what}, and {name!r} are rigid bodies", path, (((*tables[name], "shape"), "here"),)
            )


def _named(scenario: Tables) -> Iterator[tuple[Path, str, str]]:
    """Where groups are named, and why none of them can be one of bodies."""
    for section in ("angles", "dihedrals"):
        for k, hinges in enumerate(getattr(scenario, section)):
            yield (section, k, "on"), hinges.on, f"{section} join particles"
    for k, motion in enumerate(scenario.motions):
        if motion.on is not None:
            yield ("motions", k, "on"), motion.on, "motions lead pinned particles and colliders"
    for k, each in enumerate(scenario.interactions):
        if each.is_contact:
            continue  # bodies touch particles
        for key in ("on", "between"):
            for j, name in enumerate(getattr(each, key) or ()):
                yield ("interactions", k, key, j), name, f"{each.label} acts between particles"


def jointed(scenario: Tables) -> Iterator[Invalid]:
    """Joints, and springs and rods at bodies, join bodies that there are, with each other or with the world; springs and
    rods also join bodies and particles."""
    tables: dict[str, tuple[Path, Bodies]] = {
        b.name: (("bodies", k), b) for k, b in enumerate(scenario.bodies)
    }
    particles = {
        group.name: (path, group) for path, group in group_tables(scenario) if group.name not in tables
    }
    for here, joint in joint_tables(scenario):
        first, second = joint.groups()
        for end, name in enumerate((first, second)):
            at: Path = (*here, "on") if joint.on is not None else (*here, "between", end)
            if name in particles:
                yield from _tied(scenario, joint, (here, at, end), *particles[name])
            if name not in (*tables, *particles) and not (name == WORLD and end == 1):
                known = [*tables, WORLD]
                yield Invalid(
                    f"unknown body {name!r}", at, allowed=", ".join(known), hint=did_you_mean(name, known)
                )
            elif name != WORLD:
                yield from _numbered(joint, (here, at, end), *(tables.get(name) or particles[name]))
        if isinstance(joint, Springs) and joint.within is not None:
            yield Invalid("springs at bodies are listed", (*here, "within"), allowed="pairs, or points")
    if WORLD in (*tables, *particles) and any(WORLD in joint.groups() for _, joint in joint_tables(scenario)):
        path = (tables.get(WORLD) or particles[WORLD])[0]
        yield Invalid(
            f"{WORLD!r} stands for what does not move", (*path, "name"), hint="call this group otherwise"
        )
    for here, other in particle_joints(scenario):
        if other.points is not None:
            yield Invalid(
                "points are those of rigid bodies, and these are particles",
                (*here, "points"),
                hint="pairs = [[0, 1]] lists particles",
            )


def _tied(
    scenario: Tables, joint: Joint | Springs | Rods, place: tuple[Path, Path, int], path: Path, group: Group
) -> Iterator[Invalid]:
    """Springs and rods may go from a body to particles that have inertia and are always there; `place`: of the table, of the
    name of the group, and which end it is."""
    here, at, end = place
    if isinstance(joint, Joint):
        hint = "[[springs]] and [[rods]] join bodies and particles"
        yield Invalid(
            f"joints join rigid bodies, and {group.name!r} are particles", at, ((path, "here"),), hint=hint
        )
        return
    if WORLD in joint.groups():
        hint = "a pinned particle stays where it is"
        yield Invalid(
            f"{group.name!r} are particles: no {here[0]} join them to the world",
            at,
            ((path, "here"),),
            hint=hint,
        )
    if group.dynamics.type != "second_order":
        yield Invalid(
            f"{here[0]} at bodies pull particles with inertia, and {group.name!r} have none",
            at,
            (((*path, "dynamics"), "here"),),
        )
    elif mortal(scenario, group.name):
        what = "are emitted" if isinstance(group, Emitter) else "may die at colliders"
        yield Invalid(
            f"{here[0]} join bodies to particles that exist during the whole run, and {group.name!r} {what}",
            at,
            ((path, "here"),),
        )
    if joint.points is not None and any(joint.points[end]):
        yield Invalid("a particle is a point", (*here, "points", end), allowed="[0, 0, 0]")


def _numbered(
    joint: Joint | Springs | Rods, place: tuple[Path, Path, int], path: Path, group: Group
) -> Iterator[Invalid]:
    """Pairs are of bodies and particles that there are; `place` as above."""
    here, at, end = place
    number = group.layout.number() if isinstance(group, Particles) and group.layout is not None else None
    one, several = ("body", "bodies") if isinstance(group, Bodies) else ("particle", "particles")
    if not isinstance(joint, Joint) and joint.lists_none and number != 1:
        yield which(here, group.name, number, path)
        return
    for j, pair in enumerate(joint.pairs or SINGLE):
        if number is not None and pair[end] >= number:
            yield Invalid(
                f"{group.name!r} has no {one} {pair[end]}",
                (*here, "pairs", j, end) if joint.pairs is not None else at,
                ((path, f"{number} {one if number == 1 else several}"),),
                allowed=f"0 to {number - 1}" if number > 1 else "0",
            )


def kept(scenario: Tables) -> Iterator[Invalid]:
    """Bodies need double precision, and only they turn."""
    output = scenario.output
    if not scenario.bodies:
        for j, name in enumerate(output.fields or ()):
            if name in TURNING and not (name == "angular_velocity" and scenario.has_spin):
                yield Invalid(
                    f"nothing has an {name}: there are no [[bodies]]",
                    ("output", "fields", j),
                    hint="only grains whose contacts have friction rotate"
                    if name == "angular_velocity"
                    else None,
                )
        return
    here = ((("bodies", 0), "rigid bodies"),)
    if scenario.simulation.precision == "single":
        yield Invalid(
            "rigid bodies are computed in double precision only: contacts in stacks do not settle in single",
            ("simulation", "precision"),
            here,
            allowed='"double"',
        )


def held(scenario: Tables) -> Iterator[Invalid]:
    """Bodies bounce off colliders, with restitution and Coulomb friction."""
    tables: dict[str, Path] = {body.name: ("bodies", k) for k, body in enumerate(scenario.bodies)}
    for where, each in collider_tables(scenario):
        if not tables or not held_back(each, tables):
            continue
        body = next(name for name in tables if held_back(each, (name,)))
        also = ((tables[body], "these bodies meet it"),)
        hint = f"name the groups that the {each.kind} holds back with on = [...]"
        if each.contact == "stick":
            yield Invalid("rigid bodies do not stick to colliders", (*where, "contact"), also, hint=hint)
        elif each.contact == "kill":
            yield Invalid("rigid bodies do not die at colliders", (*where, "contact"), also, hint=hint)
        elif each.contact == "penalty":
            yield Invalid(
                "rigid bodies bounce off colliders, and are not pushed out by a spring",
                (*where, "contact"),
                also,
                hint=hint,
            )
        elif each.detection == "discrete":
            yield Invalid(
                "contacts of rigid bodies are found ahead of time, not at the ends of steps",
                (*where, "detection"),
                also,
                allowed='"continuous"',
                hint=hint,
            )
        elif each.tangential_loss > 0:
            yield Invalid(
                "tangential_loss is for particles; rigid bodies have friction",
                (*where, "tangential_loss"),
                also,
                hint=hint,
            )
