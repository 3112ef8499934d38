"""Rigid bodies: what can act on them, and what is kept of them."""

from __future__ import annotations

from collections.abc import Iterator

from particlesim.colliders.friction import FallingRestitution
from particlesim.interactions.contact import Contact
from particlesim.model.mistakes import Invalid, Path
from particlesim.scenario.reach import collider_tables, held_back
from particlesim.scenario.tables import Tables

TURNING = ("orientation", "angular_velocity")
"""Fields that only bodies have."""


def joined(scenario: Tables) -> Iterator[Invalid]:
    """Springs, rods, hinges, motions and interactions join, lead and act on particles."""
    tables: dict[str, Path] = {body.name: ("bodies", k) for k, body in enumerate(scenario.bodies)}
    for path, name, what in _named(scenario):
        if name in tables:
            yield Invalid(
                f"{what}, and {name!r} are rigid bodies", path, (((*tables[name], "shape"), "here"),)
            )


def _named(scenario: Tables) -> Iterator[tuple[Path, str, str]]:
    """Where groups are named, and why none of them can be one of bodies."""
    for section in ("springs", "rods"):
        for k, joint in enumerate(getattr(scenario, section)):
            what = f"{section} join particles"
            if joint.on is not None:
                yield (section, k, "on"), joint.on, what
            for j, name in enumerate(joint.between or ()):
                yield (section, k, "between", j), name, what
    for section in ("angles", "dihedrals"):
        for k, hinges in enumerate(getattr(scenario, section)):
            yield (section, k, "on"), hinges.on, f"{section} join particles"
    for k, motion in enumerate(scenario.motions):
        if motion.on is not None:
            yield ("motions", k, "on"), motion.on, "motions lead pinned particles and colliders"
    for k, each in enumerate(scenario.interactions):
        if isinstance(each, Contact):
            continue  # bodies touch particles
        for key in ("on", "between"):
            for j, name in enumerate(getattr(each, key) or ()):
                yield ("interactions", k, key, j), name, f"{each.label} acts between particles"


def kept(scenario: Tables) -> Iterator[Invalid]:
    """Bodies need double precision, their work is not booked, and only they turn."""
    output = scenario.output
    if not scenario.bodies:
        for j, name in enumerate(output.fields or ()):
            if name in TURNING and not (name == "angular_velocity" and scenario.has_spin):
                yield Invalid(
                    f"nothing has an {name}: there are no [[bodies]]",
                    ("output", "fields", j),
                    hint="grains turn whose contacts have friction" if name == "angular_velocity" else None,
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
    if output.work:
        yield Invalid("the work on rigid bodies cannot be booked", ("output", "work"), here)


def held(scenario: Tables) -> Iterator[Invalid]:
    """Bodies bounce off colliders, with one restitution and Coulomb friction."""
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
                "contacts of rigid bodies are foreseen, not looked for at the ends of steps",
                (*where, "detection"),
                also,
                allowed='"continuous"',
                hint=hint,
            )
        elif each.tangential_loss > 0:
            yield Invalid(
                "tangential_loss is for particles; what holds rigid bodies along a surface is friction",
                (*where, "tangential_loss"),
                also,
                hint=hint,
            )
        elif isinstance(each.restitution, FallingRestitution):
            yield Invalid(
                "impacts of rigid bodies have one restitution, at any speed",
                (*where, "restitution"),
                also,
                allowed="a number from 0 to 1",
                hint=hint,
            )
