"""What no single table of a scenario shows: how its parts must agree."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.colliders import Collider
from particlesim.emitters import Schedule
from particlesim.integrators import method_for
from particlesim.model.attributes import OPTIONAL
from particlesim.model.mistakes import Invalid, Path
from particlesim.model.spelling import did_you_mean
from particlesim.scenario.reach import acts_on, collider_tables, group_tables, held_back, unfelt
from particlesim.scenario.rules import bodies, impacts, interactions, joints, periodic, walls
from particlesim.scenario.rules import rendering as pictures
from particlesim.scenario.rules.checks import disagreements
from particlesim.scenario.rules.derivatives import undifferentiable
from particlesim.scenario.rules.inertia import stepped_together
from particlesim.scenario.rules.orbits import orbits
from particlesim.scenario.rules.tolerances import few_bodies, too_fine, without_jumps
from particlesim.scenario.tables import Tables

MOST_BIRTHS = 10**12
"""Births of an emitter beyond which a rate is taken for a slip of the hand: a day of computing for nothing else."""


def names(scenario: Tables) -> Iterator[Invalid]:
    """Groups, and what has a name among colliders, forces and interactions, have names of their own; there is something to
    simulate."""
    if not scenario.groups:
        yield Invalid("there is nothing to simulate", allowed="[[particles]], [[bodies]] or [[emitters]]")
    seen: dict[str, Path] = {}
    for path, group in group_tables(scenario):
        if group.name in seen:
            yield Invalid(
                f"two groups are called {group.name!r}",
                at=(*path, "name") if "name" in group.model_fields_set else path,
                also=((seen[group.name], "the other one"),),
                hint="give each group a name of its own",
            )
        seen[group.name] = path
    for section in ("forces", "interactions"):
        named: dict[str, int] = {}
        for k, each in enumerate(getattr(scenario, section)):
            if each.name is not None and each.name in named:
                other = (section, named[each.name], "name")
                yield Invalid(
                    f"two {section} are called {each.name!r}",
                    (section, k, "name"),
                    ((other, "the other one"),),
                )
            if each.name is not None:
                named[each.name] = k
    known: dict[str, Path] = {}
    for path, collider in collider_tables(scenario):
        if collider.name is not None and collider.name in known:
            yield Invalid(
                f"two colliders are called {collider.name!r}",
                (*path, "name"),
                (((*known[collider.name], "name"), "the other one"),),
                hint="motions and emitters speak of colliders by their names",
            )
        if collider.name is not None:
            known[collider.name] = path


def references(scenario: Tables) -> Iterator[Invalid]:
    """Every group that is spoken of exists."""
    known = [group.name for group in scenario.groups]
    places: list[tuple[Path, str]] = []
    for section in ("forces", "planes", "colliders", "impulses"):
        for k, entry in enumerate(getattr(scenario, section)):
            places += [((section, k, "on", j), name) for j, name in enumerate(entry.on or ())]
    for section, entries in (("angles", scenario.angles), ("dihedrals", scenario.dihedrals)):
        places += [((section, k, "on"), hinges.on) for k, hinges in enumerate(entries)]
    for here, joint in joints.listed(scenario):
        if joint.on is not None:
            places.append(((*here, "on"), joint.on))
        places += [((*here, "between", j), name) for j, name in enumerate(joint.between or ())]
    places += [
        (("emitters", k, "on_impact", key, j), name)
        for k, emitter in enumerate(scenario.emitters)
        if emitter.on_impact is not None
        for key in ("of", "against")
        for j, name in enumerate(getattr(emitter.on_impact, key) or ())
    ]
    places += interactions.named_groups(scenario)
    places += [(("motions", k, "on"), m.on) for k, m in enumerate(scenario.motions) if m.on is not None]
    for path, name in places:
        if name not in known:
            hears = path[2:3] == ("on_impact",)  # which is no impact of what it gives birth to
            born = next(
                (each.name for k, each in enumerate(scenario.emitters) if hears and k == path[1]), None
            )
            yield _unknown_group(path, name, [each for each in known if each != born])


def led_colliders(scenario: Tables) -> Iterator[Invalid]:
    """Motions lead colliders that there are, one each, that can move."""
    named = {c.name: (path, c) for path, c in collider_tables(scenario) if c.name is not None}
    led: dict[str, int] = {}
    for k, motion in enumerate(scenario.motions):
        if motion.collider is None:
            continue
        here: Path = ("motions", k, "collider")
        if motion.collider not in named:
            yield Invalid(
                f"unknown collider {motion.collider!r}",
                here,
                allowed=", ".join(named) or "a name that a collider has",
                hint=did_you_mean(motion.collider, tuple(named)),
            )
            continue
        path, collider = named[motion.collider]
        if collider.contact == "stick":
            yield from _carries(scenario, here, path, collider)
        if motion.collider in led:
            yield Invalid(
                f"{motion.collider!r} is led already",
                here,
                ((("motions", led[motion.collider], "collider"), "here"),),
                hint="one motion may have a path and a spin",
            )
        led[motion.collider] = k


def _carries(scenario: Tables, motion: Path, path: Path, collider: Collider) -> Iterator[Invalid]:
    """A collider that moves takes along what sticks to it where particles step alone: others would have to feel it on its
    way within a step."""
    sticks = ((*path, "contact"), "stick here")
    hint = f"name the groups that the {collider.kind} acts on with on = [...], or let them bounce"
    for place, names, _ in joints.coupling_tables(scenario):
        for name in names:
            if held_back(collider, [name]):
                yield Invalid(
                    f"a collider that moves cannot hold on to {name!r}, whose particles act on others",
                    motion,
                    (sticks, (place, "here")),
                    hint=hint,
                )
                return
    for where, group in group_tables(scenario):
        if group.name in scenario.tied and held_back(collider, [group.name]):
            yield Invalid(
                f"a collider that moves cannot hold on to {group.name!r}, which is tied to bodies",
                motion,
                (sticks, (where, "this group")),
                hint=hint,
            )
            return
        method = method_for(group.integrator or scenario.simulation.integrator)
        if method.together and held_back(collider, [group.name]):
            yield Invalid(
                f"a collider that moves cannot hold on to {group.name!r}, which {method.name} steps as a whole",
                motion,
                (sticks, (where, "this group")),
                hint=hint,
            )
            return


def _unknown_group(path: Path, name: str, known: list[str]) -> Invalid:
    return Invalid(f"unknown group {name!r}", path, allowed=", ".join(known), hint=did_you_mean(name, known))


def needs(scenario: Tables) -> Iterator[Invalid]:
    """Every force finds on its groups what its law reads."""
    for k, force in enumerate(scenario.forces):
        if force.on_surfaces and not any(acts_on(force, group) for group in scenario.groups):
            yield Invalid(
                f"{force.label} acts on surfaces, and no group has one",
                ("forces", k),
                hint="cloth, jelly and mesh have a surface; drag and linear_drag act on single particles",
            )
        for path, group in group_tables(scenario):
            if force.on is not None and group.name in force.on and (why := unfelt(force, group)):
                about = "layout" if force.on_surfaces and "surface" in why else "dynamics"
                yield Invalid(
                    why, ("forces", k, "on", force.on.index(group.name)), (((*path, about), "here"),)
                )
            if not acts_on(force, group):
                continue
            for name in sorted(force.needs()):
                if not group.may_have(name):
                    yield Invalid(
                        f"{force.label} needs a {name}, and the particles of {group.name!r} have none",
                        ("forces", k),
                        ((path, f"no {name} here"),),
                        hint=f"give the group a {name}, or name the groups of this force with on = [...]",
                    )
    if scenario.output.fields is not None:
        for j, name in enumerate(scenario.output.fields):
            if name in OPTIONAL and not any(group.may_have(name) for group in scenario.groups):
                yield Invalid(f"no particle has a {name}", ("output", "fields", j))
            if name == "image" and scenario.simulation.box is None:
                yield Invalid(
                    "there are no images without a periodic box",
                    ("output", "fields", j),
                    hint="box = { size = [1, 1, 1] } under [simulation] makes one",
                )


def times(scenario: Tables) -> Iterator[Invalid]:
    """Nothing is asked for after the end."""
    end = scenario.simulation.duration
    duration = ((("simulation", "duration"), f"the run ends at {end:g} s"),)
    for k, impulse in enumerate(scenario.impulses):
        for j, at in enumerate(impulse.times()):
            if at >= end:
                path: Path = (
                    ("impulses", k, "at", j) if isinstance(impulse.at, tuple) else ("impulses", k, "at")
                )
                yield Invalid("a kick after the end of the run", path, duration)
    for k, emitter in enumerate(scenario.emitters):
        births = emitter.expected(end)
        if births > MOST_BIRTHS:
            key = "rate" if emitter.rate is not None else "burst"
            yield Invalid(
                f"{births:.3g} births in {end:g} s are more than a run can make",
                ("emitters", k, key),
                duration,
                allowed=f"at most {MOST_BIRTHS:.0e} births",
            )
        elif emitter.on_impact is None and Schedule(emitter, scenario.streams(emitter)).before(end) == 0:
            yield Invalid("nothing is emitted before the end of the run", ("emitters", k), duration)


def kicks(scenario: Tables) -> Iterator[Invalid]:
    """Impulses kick particles that have inertia."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    for k, impulse in enumerate(scenario.impulses):
        inert = [name for name, (_, group) in tables.items() if group.dynamics.type != "second_order"]
        for j, name in enumerate(impulse.on or ()):
            if name in inert:
                yield Invalid(
                    "an impulse does not move particles without inertia",
                    ("impulses", k, "on", j),
                    (((*tables[name][0], "dynamics"), "here"),),
                )
        if impulse.on is None and len(inert) == len(tables):
            yield Invalid("there is no group with inertia to kick", ("impulses", k))


def booked(scenario: Tables) -> Iterator[Invalid]:
    """Work is recorded for particles with inertia."""
    if not scenario.output.work:
        return
    for path, group in group_tables(scenario):
        if group.dynamics.type != "second_order":
            yield Invalid(
                f"the ledger has the work on particles with inertia only, and {group.name!r} has none",
                ("output", "work"),
                (((*path, "dynamics"), "here"),),
            )


CHECKS = (
    names,
    references,
    bodies.joined,
    bodies.jointed,
    bodies.kept,
    bodies.held,
    needs,
    interactions.felt,
    interactions.exact_enough,
    interactions.turned,
    interactions.rolled,
    interactions.against_walls,
    interactions.put_apart,
    interactions.kicked,
    periodic.repeated,
    interactions.fixed_steps,
    undifferentiable,
    times,
    kicks,
    booked,
    joints.pins,
    joints.motions,
    led_colliders,
    impacts.heard,
    walls.room,
    walls.common_place,
    joints.pairs,
    joints.pulled,
    joints.joined,
    joints.held,
    pictures.colors,
    too_fine,
    few_bodies,
    without_jumps,
    stepped_together,
    orbits,
    pictures.styles,
    disagreements,
)
"""In this order: later ones rely on earlier ones."""


def contradictions(scenario: Tables) -> list[Invalid]:
    """All mistakes that the first check finds that finds any."""
    for check in CHECKS:
        if mistakes := list(check(scenario)):
            return mistakes
    return []
