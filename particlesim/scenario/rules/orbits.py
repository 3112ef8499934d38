"""What WHFast can split: gravity between bodies about a heavy one, and forces that depend on position and time alone."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.bodies import Bodies
from particlesim.emitters import Emitter
from particlesim.groups.group import Group, Particles
from particlesim.integrators import WisdomHolmanMethod, method_for
from particlesim.interactions.gravity import MutualGravity
from particlesim.model.mistakes import Invalid, Path
from particlesim.scenario.reach import acts_on, collider_tables, group_tables, held_back, interacting
from particlesim.scenario.rules.joints import joint_tables
from particlesim.scenario.tables import Tables

OTHERS = '"ias15" takes all of these, and "velocity_verlet" most'


def orbits(scenario: Tables) -> Iterator[Invalid]:
    """What WHFast is not made for."""
    groups = [
        (path, group)
        for path, group in group_tables(scenario)
        if not isinstance(group, Bodies) and _method(scenario, group) is not None
    ]
    if not groups:
        return
    here = _chosen(scenario, *groups[0])
    yield from _numbers(scenario, here)
    for path, group in groups:
        yield from _bodies(scenario, path, group, here)
    yield from _acting(scenario, groups, here)
    yield from _gravity(scenario, groups, here)


def _method(scenario: Tables, group: Group) -> WisdomHolmanMethod | None:
    method = method_for(group.integrator or scenario.simulation.integrator)
    return method if isinstance(method, WisdomHolmanMethod) else None


def _chosen(scenario: Tables, path: Path, group: Group) -> Path:
    """Where the method of a group is chosen."""
    return ("simulation", "integrator") if group.integrator is None else (*path, "integrator")


def _numbers(scenario: Tables, here: Path) -> Iterator[Invalid]:
    """The whole run."""
    marks = ((here, "chosen here"),)
    if scenario.simulation.precision == "single":
        yield Invalid(
            "whfast needs double precision",
            ("simulation", "precision"),
            marks,
            allowed="double",
        )
    if scenario.simulation.box is not None:
        yield Invalid(
            "whfast follows orbits in open space, not among images", ("simulation", "box"), marks, hint=OTHERS
        )
    if scenario.output.work:
        yield Invalid("the work along orbits of whfast cannot be recorded", ("output", "work"), marks)


def _bodies(scenario: Tables, path: Path, group: Group, here: Path) -> Iterator[Invalid]:
    """Bodies that live through the run and move by their forces alone."""
    marks = ((here, "chosen here"),)
    if isinstance(group, Emitter):
        yield Invalid(
            "whfast steps bodies that are there from the start to the end", path, marks, hint=OTHERS
        )
    if group.dynamics.type != "second_order":
        yield Invalid("whfast steps bodies with inertia", (*path, "dynamics"), marks)
    if isinstance(group, Particles) and group.pinned is not False:
        yield Invalid(
            "whfast cannot pin bodies",
            (*path, "pinned"),
            marks,
            hint='a fixed centre is a force: type = "attractor", with another integrator',
        )
    for k, motion in enumerate(scenario.motions):
        if motion.on == group.name:
            yield Invalid("whfast cannot lead bodies", ("motions", k), marks, hint=OTHERS)
    for where, collider in collider_tables(scenario):
        if held_back(collider, (group.name,)):
            yield Invalid(
                f"whfast knows no contacts: {group.name!r} can meet this {collider.kind}",
                where,
                marks,
                hint=f"name the groups that it acts on with on = [...], or choose another integrator: {OTHERS}",
            )


def _acting(scenario: Tables, groups: list[tuple[Path, Group]], here: Path) -> Iterator[Invalid]:
    """Forces that a kick can give."""
    marks = ((here, "chosen here"),)
    names = {group.name for _, group in groups}
    allowed = "forces that depend on position and time alone"
    for where, joined in joint_tables(scenario):
        if names & set(joined):
            yield Invalid("whfast steps bodies without springs and rods", where, marks, hint=OTHERS)
    for k, force in enumerate(scenario.forces):
        if force.needs_velocity() and any(acts_on(force, group) for _, group in groups):
            yield Invalid(
                "this force depends on the velocity, and whfast cannot split it off",
                ("forces", k),
                marks,
                allowed,
                hint=OTHERS,
            )
    for k, each in enumerate(scenario.interactions):
        if not names & {group.name for group in interacting(each, scenario.groups)}:
            continue
        if each.is_contact or each.random() or each.needs_velocity():
            yield Invalid(
                f"{each.label} depends on more than positions, and whfast cannot split it off",
                ("interactions", k),
                marks,
                allowed,
                hint=OTHERS,
            )


def _gravity(scenario: Tables, groups: list[tuple[Path, Group]], here: Path) -> Iterator[Invalid]:
    """One law of gravity between points joins all of them."""
    marks = ((here, "chosen here"),)
    names = {group.name for _, group in groups}
    found = [
        (k, each)
        for k, each in enumerate(scenario.interactions)
        if isinstance(each, MutualGravity)
        and names & {group.name for group in interacting(each, scenario.groups)}
    ]
    if not found:
        yield Invalid(
            "whfast needs gravity between the bodies",
            here,
            allowed='[[interactions]] type = "gravity"',
            hint="the other integrators step particles under any forces",
        )
        return
    for k, _ in found[1:]:
        yield Invalid("whfast takes one law of gravity", ("interactions", k), marks)
    k, law = found[0]
    at: Path = ("interactions", k)
    for key, wrong in (
        ("softening", law.softening > 0),
        ("cutoff", law.cutoff is not None),
        ("between", law.between is not None),
        ("method", law.method not in ("auto", "direct")),
    ):
        if wrong:
            yield Invalid(
                f"whfast follows Kepler's orbits, of gravity without {key}"
                if key != "method"
                else "whfast sums gravity directly",
                (*at, key),
                marks,
                allowed='"direct"' if key == "method" else None,
            )
    inside = {group.name for group in interacting(law, scenario.groups)}
    for path, group in groups:
        if group.name not in inside:
            yield Invalid(
                f"whfast needs gravity between all bodies that it steps, and {group.name!r} feels none",
                path,
                (*marks, (at, "gravity acts here")),
                hint="give the group an integrator of its own",
            )
        method = _method(scenario, group)
        central = None if method is None else method.central
        if central is not None and central not in inside:
            chosen = _chosen(scenario, path, group)
            yield Invalid(f"there is no group {central!r} that gravity acts on", (*chosen, "central"))
            return
