"""Springs, pins and motions: they join, hold and lead particles that exist and can be."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.bonds import Rods, SpringLaw, Springs
from particlesim.bonds.hinge import Hinges
from particlesim.groups.group import Particles
from particlesim.groups.selection import mistakes as selection_mistakes
from particlesim.integrators import method_for
from particlesim.model.mistakes import Invalid, Path
from particlesim.scenario.reach import acts_on, group_tables
from particlesim.scenario.rules.interactions import coupled
from particlesim.scenario.rules.rods import are_rods, rod_tables, unfit
from particlesim.scenario.tables import Tables


def pins(scenario: Tables) -> Iterator[Invalid]:
    """Pins hold particles that exist."""
    for k, group in enumerate(scenario.particles):
        if not isinstance(group.pinned, bool):
            here: Path = ("particles", k)
            yield from selection_mistakes(group.pinned, group.layout, (*here, "pinned"), (*here, "layout"))


def motions(scenario: Tables) -> Iterator[Invalid]:
    """Motions lead particles that are there from the start, and it is said which."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    whole: dict[str, int] = {}
    for k, motion in enumerate(scenario.motions):
        if motion.on is None:
            continue
        path, group = tables[motion.on]
        here: Path = ("motions", k)
        if not isinstance(group, Particles):
            yield Invalid(
                f"a motion leads particles that are there from the start, and {motion.on!r} is emitted",
                (*here, "on"),
                ((path, "emitted here"),),
            )
        elif group.dynamics.type == "tracer":
            yield Invalid(
                "tracers move with their flow; no motion leads them", (*here, "on"), ((path, "here"),)
            )
        elif motion.particles is not None:
            at = (*here, "particles")
            yield from selection_mistakes(motion.particles, group.layout, at, (*path, "layout"))
        elif not group.has_pins():
            yield Invalid(
                f"which particles of {motion.on!r} are led? It pins none",
                here,
                ((path, "nothing is pinned here"),),
                hint="pin some in the group, or name them here: particles = [0]",
            )
        elif motion.on in whole:
            yield Invalid(
                f"all pinned particles of {motion.on!r} are led already",
                here,
                ((("motions", whole[motion.on]), "here"),),
                hint="name different particles for each, with particles = ...",
            )
        else:
            whole[motion.on] = k


def listed(scenario: Tables) -> Iterator[tuple[Path, Springs | Rods]]:
    """Where pairs of particles are joined, and how; not those of rigid bodies."""
    for section in ("springs", "rods"):
        for k, joint in enumerate(getattr(scenario, section)):
            if not scenario.at_bodies(joint):
                yield (section, k), joint


def pairs(scenario: Tables) -> Iterator[Invalid]:
    """Springs and rods join particles that exist."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    for here, joint in listed(scenario):
        for end, name in enumerate(joint.groups()):
            path, group = tables[name]
            number = group.layout.number() if isinstance(group, Particles) else None
            if joint.lists_none and number != 1:
                yield which(here, name, number, (*path, "layout"))
                break
            for j, pair in enumerate(joint.pairs or ()):
                if number is not None and pair[end] >= number:
                    yield Invalid(
                        f"{name!r} has no particle {pair[end]}",
                        (*here, "pairs", j, end),
                        (((*path, "layout"), f"{number} particles"),),
                        allowed=f"0 to {number - 1}" if number > 1 else "0",
                    )

    for place, hinges in _hinge_tables(scenario):
        path, group = tables[hinges.on]
        number = group.layout.number() if isinstance(group, Particles) else None
        for j, particles in enumerate(hinges.lists()):
            for end, index in enumerate(particles):
                if number is not None and index >= number:
                    yield Invalid(
                        f"{hinges.on!r} has no particle {index}",
                        (*place, hinges.key, j, end),
                        (((*path, "layout"), f"{number} particles"),),
                        allowed=f"0 to {number - 1}" if number > 1 else "0",
                    )


def which(here: Path, name: str, number: int | None, there: Path) -> Invalid:
    """No pairs are listed, and a group is not of one particle."""
    return Invalid(
        "which particles are joined?",
        here,
        ((there, "several" if number is None else f"{number:,} particles"),),
        allowed="pairs = [[0, 0]], say; nothing only between groups of one particle",
    )


def pulled(scenario: Tables) -> Iterator[Invalid]:
    """Springs and rods join particles that are there from the start and that forces move."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    for here, names, law in coupling_tables(scenario):
        what, join = _words(here)
        for name in dict.fromkeys(names):
            path, group = tables[name]
            if not isinstance(group, Particles) and here[0] != "interactions":
                yield Invalid(
                    f"{what} {join} particles that are there from the start, and {name!r} is emitted",
                    here,
                    ((path, "emitted here"),),
                )
            elif group.dynamics.type == "tracer":
                yield Invalid(f"tracers move with their flow; no {what} pull them", here, ((path, "here"),))
            elif group.dynamics.type == "first_order" and (law.damped or law.by_mass):
                key = "frequency" if law.frequency is not None else "damping"
                key = "damping_ratio" if law.damping_ratio is not None else key
                yield Invalid(
                    f"{name!r} has no inertia: only springs without damping, given by their stiffness, pull it",
                    (*here, key),
                    (((*path, "dynamics"), "no inertia here"),),
                )


def joined(scenario: Tables) -> Iterator[Invalid]:
    """What groups joined by springs or rods have in common."""
    tables = {group.name: (path, group) for path, group in group_tables(scenario)}
    for here, names, _ in coupling_tables(scenario):
        what, join = _words(here)
        (path, first), (other, second) = (tables[name] for name in names)
        methods = [
            method_for(group.integrator or scenario.simulation.integrator) for group in (first, second)
        ]
        if methods[0] != methods[1]:
            yield Invalid(
                f"{what} {join} groups that step together, and these have different integrators "
                f"({methods[0].label}, {methods[1].label})",
                here,
                ((path, methods[0].label), (other, methods[1].label)),
            )


def _words(here: Path) -> tuple[str, str]:
    """What couples groups where this is stated, and what it does to them."""
    if here[0] == "interactions":
        return "interactions", "act on"
    return "rods" if are_rods(here) else "springs", "join"


def held(scenario: Tables) -> Iterator[Invalid]:
    """What rods cannot do."""
    yield from unfit(scenario, [names for _, names, _ in coupling_tables(scenario)])


def coupling_tables(scenario: Tables) -> Iterator[tuple[Path, tuple[str, str], SpringLaw]]:
    """Where particles are coupled at all: by springs, rods, angles and dihedrals, interactions, drag on a surface; all but
    the first as springs that are neither damped nor given by mass."""
    yield from bond_tables(scenario)
    for place, names in rod_tables(scenario):
        yield place, names, SpringLaw(0.0)
    for place, hinges in _hinge_tables(scenario):
        yield place, (hinges.on, hinges.on), SpringLaw(hinges.stiffness)
    for place, names in coupled(scenario):
        yield place, names, SpringLaw(0.0)
    for j, force in enumerate(scenario.forces):
        for group in scenario.groups:
            if force.on_surfaces and acts_on(force, group):
                yield ("forces", j), (group.name, group.name), SpringLaw(0.0)


def joint_tables(scenario: Tables) -> Iterator[tuple[Path, tuple[str, str]]]:
    """Where particles are joined, by springs, rods, angles, dihedrals or drag on a surface, and the groups."""
    for place, names, _ in coupling_tables(scenario):
        if place[0] != "interactions":
            yield place, names


def bond_tables(scenario: Tables) -> Iterator[tuple[Path, tuple[str, str], SpringLaw]]:
    """Where springs are stated, the groups that they join, and their law."""
    for k, springs in enumerate(scenario.springs):
        if not scenario.at_bodies(springs):
            yield ("springs", k), springs.groups(), springs.spring_law()
    for k, group in enumerate(scenario.particles):
        if group.springs is not None and (laws := group.springs.laws()):
            yield ("particles", k, "springs"), (group.name, group.name), next(iter(laws.values()))


def _hinge_tables(scenario: Tables) -> Iterator[tuple[Path, Hinges]]:
    """Where angles and dihedrals are listed."""
    for k, angles in enumerate(scenario.angles):
        yield ("angles", k), angles
    for k, dihedrals in enumerate(scenario.dihedrals):
        yield ("dihedrals", k), dihedrals
