"""The scenario: everything that a scenario file may say, and how its parts must agree."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, get_args

from pydantic import PrivateAttr, ValidationInfo, model_validator

from particlesim.bonds import Angles, BondSet, Dihedrals, HingeSet, Rods, RodSet, SpringLaw, Springs
from particlesim.bonds.hinge import Hinges
from particlesim.checks import Check
from particlesim.colliders import Plane
from particlesim.crossfield import Invalid, invalid
from particlesim.emitters import Emitter, Schedule
from particlesim.errors import UsageError
from particlesim.forces import AnyForce, Force
from particlesim.forces.field import Field
from particlesim.groups import Group, Particles
from particlesim.impulses import Impulse
from particlesim.integrators import method_for
from particlesim.layouts import Layout
from particlesim.layouts.base import LayoutError
from particlesim.layouts.file import File
from particlesim.model import Line, Model, Prose
from particlesim.motions import Motion
from particlesim.names import did_you_mean
from particlesim.scenario.agreement import disagreements, untimely
from particlesim.scenario.diagnose import scenario_error
from particlesim.scenario.jacobians import undifferentiable
from particlesim.scenario.methods import too_fine
from particlesim.scenario.rendering import RenderSettings, colorable
from particlesim.scenario.rods import are_rods, rod_sets, rod_tables, unfit
from particlesim.scenario.simulation import FieldName, Output, Simulation
from particlesim.scenario.source import Source
from particlesim.scenario.timegrid import TimeGrid, time_grid
from particlesim.selection import mistakes as selection_mistakes
from particlesim.streams import Streams

Keys = tuple[str | int, ...]

MOST_BIRTHS = 10**12
"""Births of an emitter beyond which a rate is taken for a slip of the hand: a day of computing for nothing else."""


class Scenario(Model):
    """A particle simulation: what there is, what acts on it, how it is stepped and what is kept."""

    format: Literal[1] = 1
    """Version of the scenario format."""
    title: Line = ""
    """A line that names the scene, for summaries and videos."""
    description: Prose = ""
    """What the scene shows."""
    simulation: Simulation
    """Time, method, seed and precision."""
    output: Output = Output()
    """Which moments and which quantities go to the trajectory."""
    particles: tuple[Particles, ...] = ()
    """Particles that are there from the start."""
    emitters: tuple[Emitter, ...] = ()
    """Sources of particles."""
    forces: tuple[AnyForce, ...] = ()
    """What acts on particles."""
    springs: tuple[Springs, ...] = ()
    """Springs between listed particles."""
    rods: tuple[Rods, ...] = ()
    """Pairs of particles whose distance does not change."""
    angles: tuple[Angles, ...] = ()
    """Springs that keep the angle at the middle one of three particles."""
    dihedrals: tuple[Dihedrals, ...] = ()
    """Springs that keep the fold between two triangles."""
    motions: tuple[Motion, ...] = ()
    """Paths of pinned particles."""
    planes: tuple[Plane, ...] = ()
    """Half-spaces that hold particles back."""
    impulses: tuple[Impulse, ...] = ()
    """Kicks at given times."""
    checks: tuple[Check, ...] = ()
    """What must hold; a run that breaks one has failed."""
    render: RenderSettings = RenderSettings()
    """How videos look."""

    _folder: Path | None = PrivateAttr(default=None)
    _overrides: tuple[str, ...] = PrivateAttr(default=())
    _source: Source | None = PrivateAttr(default=None)
    _written_format: int = PrivateAttr(default=1)
    _grid: TimeGrid = PrivateAttr()

    def __eq__(self, other: object) -> bool:
        """Whether both say the same, wherever each of them is from."""
        if not isinstance(other, Scenario):
            return NotImplemented
        return all(getattr(self, name) == getattr(other, name) for name in Scenario.model_fields)

    __hash__ = None  # type: ignore[assignment]  # as that of the dicts and arrays in it

    @property
    def folder(self) -> Path | None:
        """Folder that relative paths in the scenario start from; None for a scenario made in Python."""
        return self._folder

    @property
    def grid(self) -> TimeGrid:
        """The grid of time."""
        return self._grid

    @property
    def groups(self) -> tuple[Group, ...]:
        """All groups: laid out ones, then those of emitters."""
        return (*self.particles, *self.emitters)

    @property
    def overrides(self) -> tuple[str, ...]:
        """What was set beside the file, as 'key=value'."""
        return self._overrides

    @property
    def source(self) -> Source | None:
        """The text that it is from, with the place of every value; None for a scenario made in Python."""
        return self._source

    @property
    def written_format(self) -> int:
        """The version of the format that the file is written in, which may be older than `format`."""
        return self._written_format

    def loaded_from(
        self,
        folder: Path | None,
        overrides: tuple[str, ...],
        source: Source | None = None,
        written_format: int | None = None,
    ) -> Scenario:
        """The scenario with relative paths starting from a folder and the overrides already in it; the text that it is from,
        and the format of that."""
        copy = self.model_copy()
        copy._folder, copy._overrides, copy._source = folder, overrides, source
        copy._written_format = self.format if written_format is None else written_format
        return copy

    def opened(self, group: Particles) -> Layout:
        """The layout of a group; one that names a file has read it.

        Raises UsageError when that cannot be done: ScenarioError with its place where the text of the scenario is known.
        """
        try:
            return group.layout.open(self._folder)
        except UsageError as error:
            if self._source is None:
                raise
            key = error.key if isinstance(error, LayoutError) else "path"
            k = next(k for k, other in enumerate(self.particles) if other is group)
            mistake = Invalid(error.message, ("particles", k, "layout", key), hint=error.hint)
            raise scenario_error(self._source, [mistake]) from None

    def streams(self, group: Group) -> Streams:
        """The random streams of a group."""
        return Streams(self.simulation.seed, group.name)

    def force_labels(self) -> tuple[str, ...]:
        """A name of its own for every force and set of springs, as in the ledger: 'gravity', 'drag', 'drag_2' ..."""
        labels: list[str] = []
        names = [*(force.label for force in self.forces), *(springs.name for springs in self.springs)]
        names += [bonds.name for group in self.particles for bonds in group.bonds()]
        names += [hinges.name for hinges in (*self.angles, *self.dihedrals)]
        names += [hinges.name for group in self.particles for hinges in group.hinges()]
        for base in names:
            label, k = base, 1
            while label in labels:
                k += 1
                label = f"{base}_{k}"
            labels.append(label)
        return tuple(labels)

    @property
    def bonds(self) -> tuple[BondSet, ...]:
        """All sets of springs, each with its name in the ledger."""
        labels = self.force_labels()[len(self.forces) :]
        listed = tuple(springs.bonds(label) for springs, label in zip(self.springs, labels, strict=False))
        return (*listed, *(bonds for group in self.particles for bonds in group.bonds(self.folder)))

    @property
    def rod_sets(self) -> tuple[RodSet, ...]:
        """All sets of rods, each with a name of its own."""
        return rod_sets(self, self.force_labels())

    @property
    def hinges(self) -> tuple[HingeSet, ...]:
        """All angles and dihedrals, each set with its name in the ledger."""
        listed = (*self.angles, *self.dihedrals)
        labels = self.force_labels()[len(self.forces) + len(self.bonds) :]
        made = tuple(each.hinges(label) for each, label in zip(listed, labels, strict=False))
        return (*made, *(hinges for group in self.particles for hinges in group.hinges(self.folder)))

    def recorded_fields(self) -> tuple[str, ...]:
        """Fields of the trajectory beside position and id."""
        groups = ("group",) if len(self.groups) > 1 else ()
        if self.output.fields is not None:
            return (*self.output.fields, *groups)
        fields = ["velocity"]
        if any(group.has_radius() for group in self.groups):
            fields.append("radius")
        if any(group.temperature is not None for group in self.groups):
            fields.append("temperature")
        return (*fields, *groups)

    @model_validator(mode="after")
    def _agrees(self, info: ValidationInfo) -> Scenario:
        """Check what no single table shows. A list given as context["mistakes"] collects them all; else the first is
        raised."""
        mistakes: list[Invalid] = []
        for check in (
            _names,
            _references,
            _needs,
            undifferentiable,
            _times,
            _kicks,
            _booked,
            _pins,
            _motions,
            _pairs,
            _pulled,
            _joined,
            _rods,
            _colors,
            too_fine,
            _styles,
            disagreements,
        ):
            mistakes += check(self)
            if mistakes:
                break  # later checks rely on earlier ones
        grid = time_grid(self.simulation, self.output)
        if isinstance(grid, Invalid):
            mistakes.append(grid)
        else:
            self._grid = grid
            mistakes += untimely(self, grid)
        if mistakes and info.context is not None and "mistakes" in info.context:
            info.context["mistakes"].extend(mistakes)
        elif mistakes:
            first = mistakes[0]
            raise invalid(first.message, at=first.at, also=first.also, allowed=first.allowed, hint=first.hint)
        return self


def acts_on(force: Force, group: Group) -> bool:
    """Whether a force acts on a group.

    A force without `on` acts on every group that can feel it: tracers feel none, and particles without inertia none that
    depend on the velocity.
    """
    if force.on is not None:
        return group.name in force.on
    return not _cannot_feel(force, group)


def _cannot_feel(force: Force, group: Group) -> str | None:
    velocity = force.needs_velocity or (isinstance(force, Field) and force.reads_velocity())
    if force.on_surfaces and not (isinstance(group, Particles) and group.layout.has_surface()):
        return "this force acts on surfaces; cloth, jelly and mesh have one"
    if group.dynamics.type == "tracer":
        return "tracers move with their flow; no force acts on them"
    if group.dynamics.type == "first_order" and velocity:
        return "this force depends on the velocity, which particles without inertia do not have"
    return None


def _group_tables(scenario: Scenario) -> Iterator[tuple[Keys, Group]]:
    for k, particles in enumerate(scenario.particles):
        yield ("particles", k), particles
    for k, emitter in enumerate(scenario.emitters):
        yield ("emitters", k), emitter


def _names(scenario: Scenario) -> Iterator[Invalid]:
    """Groups and named forces have names of their own; there is something to simulate."""
    if not scenario.groups:
        yield Invalid("there is nothing to simulate", allowed="[[particles]] or [[emitters]]")
    seen: dict[str, Keys] = {}
    for path, group in _group_tables(scenario):
        if group.name in seen:
            yield Invalid(
                f"two groups are called {group.name!r}",
                at=(*path, "name") if "name" in group.model_fields_set else path,
                also=((seen[group.name], "the other one"),),
                hint="give each group a name of its own",
            )
        seen[group.name] = path
    named: dict[str, int] = {}
    for k, force in enumerate(scenario.forces):
        if force.name is not None and force.name in named:
            other = ("forces", named[force.name], "name")
            yield Invalid(
                f"two forces are called {force.name!r}", ("forces", k, "name"), ((other, "the other one"),)
            )
        if force.name is not None:
            named[force.name] = k


def _references(scenario: Scenario) -> Iterator[Invalid]:
    """Every group that is spoken of exists."""
    known = [group.name for group in scenario.groups]
    places: list[tuple[Keys, str]] = []
    for section in ("forces", "planes", "impulses"):
        for k, entry in enumerate(getattr(scenario, section)):
            places += [((section, k, "on", j), name) for j, name in enumerate(entry.on or ())]
    for section, entries in (("angles", scenario.angles), ("dihedrals", scenario.dihedrals)):
        places += [((section, k, "on"), hinges.on) for k, hinges in enumerate(entries)]
    for here, joint in _joints(scenario):
        if joint.on is not None:
            places.append(((*here, "on"), joint.on))
        places += [((*here, "between", j), name) for j, name in enumerate(joint.between or ())]
    places += [(("motions", k, "on"), motion.on) for k, motion in enumerate(scenario.motions)]
    for path, name in places:
        if name not in known:
            yield _unknown_group(path, name, known)


def _unknown_group(path: Keys, name: str, known: list[str]) -> Invalid:
    return Invalid(f"unknown group {name!r}", path, allowed=", ".join(known), hint=did_you_mean(name, known))


def _needs(scenario: Scenario) -> Iterator[Invalid]:
    """Every force finds on its groups what its law reads."""
    for k, force in enumerate(scenario.forces):
        for path, group in _group_tables(scenario):
            if force.on is not None and group.name in force.on and (why := _cannot_feel(force, group)):
                about = "layout" if force.on_surfaces and "surface" in why else "dynamics"
                yield Invalid(
                    why, ("forces", k, "on", force.on.index(group.name)), (((*path, about), "here"),)
                )
            if not acts_on(force, group):
                continue
            from_file = isinstance(group, Particles) and isinstance(group.layout, File)
            if force.needs_radius() and not group.has_radius() and not from_file:
                yield Invalid(
                    f"{force.label} needs a radius, and the particles of {group.name!r} have none",
                    ("forces", k),
                    ((path, "no radius here"),),
                    hint="give the group a radius, or name the groups of this force with on = [...]",
                )
            if force.needs_temperature() and group.temperature is None and not from_file:
                yield Invalid(
                    f"{force.label} needs a temperature, and the particles of {group.name!r} have none",
                    ("forces", k),
                    ((path, "no temperature here"),),
                )
    if scenario.output.fields is not None:
        for j, name in enumerate(scenario.output.fields):
            if name == "temperature" and all(group.temperature is None for group in scenario.groups):
                yield Invalid("no particle has a temperature", ("output", "fields", j))


def _times(scenario: Scenario) -> Iterator[Invalid]:
    """Nothing is asked for after the end."""
    end = scenario.simulation.duration
    duration = ((("simulation", "duration"), f"the run ends at {end:g} s"),)
    for k, impulse in enumerate(scenario.impulses):
        for j, at in enumerate(impulse.times()):
            if at >= end:
                path: Keys = (
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
        elif Schedule(emitter, scenario.streams(emitter)).before(end) == 0:
            yield Invalid("nothing is emitted before the end of the run", ("emitters", k), duration)


def _kicks(scenario: Scenario) -> Iterator[Invalid]:
    """Impulses kick particles that have inertia."""
    tables = {group.name: (path, group) for path, group in _group_tables(scenario)}
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


def _booked(scenario: Scenario) -> Iterator[Invalid]:
    """Work is booked for particles with inertia and steps that are known."""
    if not scenario.output.work:
        return
    for path, group in _group_tables(scenario):
        method = method_for(group.integrator or scenario.simulation.integrator)
        if group.dynamics.type != "second_order":
            yield Invalid(
                f"work is booked for particles with inertia, and {group.name!r} has none",
                ("output", "work"),
                (((*path, "dynamics"), "here"),),
            )
        elif method.adaptive:
            own = group.integrator is not None
            yield Invalid(
                f"work is booked step by step, and {method.name} chooses steps of its own",
                ("output", "work"),
                (((*path, "integrator") if own else ("simulation", "integrator"), "here"),),
                hint="rk4 and yoshida4 keep the balance to the fourth order of the step",
            )


def _pins(scenario: Scenario) -> Iterator[Invalid]:
    """Pins hold particles that exist."""
    for k, group in enumerate(scenario.particles):
        if not isinstance(group.pinned, bool):
            here: Keys = ("particles", k)
            yield from selection_mistakes(group.pinned, group.layout, (*here, "pinned"), (*here, "layout"))


def _motions(scenario: Scenario) -> Iterator[Invalid]:
    """Motions lead particles that are there from the start, and it is said which."""
    tables = {group.name: (path, group) for path, group in _group_tables(scenario)}
    whole: dict[str, int] = {}
    for k, motion in enumerate(scenario.motions):
        path, group = tables[motion.on]
        here: Keys = ("motions", k)
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


def _rods(scenario: Scenario) -> Iterator[Invalid]:
    yield from unfit(scenario, [names for _, names, _ in _coupling_tables(scenario)])


def _joined(scenario: Scenario) -> Iterator[Invalid]:
    """What groups joined by springs or rods have in common, and what they cannot do."""
    tables = {group.name: (path, group) for path, group in _group_tables(scenario)}
    for here, names, _ in _coupling_tables(scenario):
        what = "rods" if are_rods(here) else "springs"
        (path, first), (other, second) = (tables[name] for name in names)
        methods = [
            method_for(group.integrator or scenario.simulation.integrator) for group in (first, second)
        ]
        if methods[0] != methods[1]:
            yield Invalid(
                f"{what} join groups that step together, and these have different integrators "
                f"({methods[0].label}, {methods[1].label})",
                here,
                ((path, methods[0].label), (other, methods[1].label)),
            )
        for j, plane in enumerate(scenario.planes):
            if plane.contact == "kill" and (plane.on is None or {first.name, second.name} & set(plane.on)):
                yield Invalid(
                    f"a plane cannot kill particles that are joined by {what}",
                    ("planes", j, "contact"),
                    ((here, "joined here"),),
                    hint="name the groups that the plane acts on with on = [...]",
                )
        for place, group in ((path, first), (other, second)):
            reads = [
                force for force in scenario.forces if acts_on(force, group) and force.needs_temperature()
            ]
            if group.cooling is not None and reads:
                yield Invalid(
                    f"{reads[0].label} reads the temperature, which must not change for particles joined by {what}",
                    (*place, "cooling"),
                    ((here, "joined here"),),
                )


def _colors(scenario: Scenario) -> Iterator[Invalid]:
    """Videos show what the trajectory holds."""
    name, fields = scenario.render.color_by, scenario.recorded_fields()
    springs = any(True for _ in _bond_tables(scenario))
    if name not in (*fields, "position", "id") and name not in (known := colorable(fields, springs=springs)):
        hint = did_you_mean(name, known)
        if hint is None and name in get_args(FieldName):
            hint = f"to record it: fields = [..., {name!r}] under [output]"
        yield Invalid(
            f"the trajectory does not hold {name!r}",
            ("render", "color_by"),
            allowed=", ".join(known),
            hint=hint,
        )


def _hinge_tables(scenario: Scenario) -> Iterator[tuple[Keys, Hinges]]:
    """Where angles and dihedrals are listed."""
    for k, angles in enumerate(scenario.angles):
        yield ("angles", k), angles
    for k, dihedrals in enumerate(scenario.dihedrals):
        yield ("dihedrals", k), dihedrals


def _coupling_tables(scenario: Scenario) -> Iterator[tuple[Keys, tuple[str, str], SpringLaw]]:
    """Where particles are coupled at all: by springs, by rods, by angles and dihedrals, by drag on a surface; all but the
    first as springs that are neither damped nor given by mass."""
    yield from _bond_tables(scenario)
    for place, names in rod_tables(scenario):
        yield place, names, SpringLaw(0.0)
    for place, hinges in _hinge_tables(scenario):
        yield place, (hinges.on, hinges.on), SpringLaw(hinges.stiffness)
    for j, force in enumerate(scenario.forces):
        for group in scenario.groups:
            if force.on_surfaces and acts_on(force, group):
                yield ("forces", j), (group.name, group.name), SpringLaw(0.0)


def _styles(scenario: Scenario) -> Iterator[Invalid]:
    """Videos draw what there is: groups and sets of springs or rods that exist, surfaces and lines where there are some."""
    tables = {group.name: (path, group) for path, group in _group_tables(scenario)}
    sets = {rods.name: ("rods", k) for k, rods in enumerate(scenario.rods)}
    sets |= {springs.name: ("springs", k) for k, springs in enumerate(scenario.springs)}
    joined = {name for _, names, _ in _bond_tables(scenario) for name in names}
    joined |= {name for _, names in rod_tables(scenario) for name in names}
    for name, style in scenario.render.styles.items():
        at = ("render", "styles", name)
        if name not in tables and name not in sets:
            known = [*tables, *sets]
            hint = did_you_mean(name, known)
            yield Invalid(
                f"no group, springs or rods are called {name!r}", at, allowed=", ".join(known), hint=hint
            )
        elif name in tables:
            path, group = tables[name]
            skin = isinstance(group, Particles) and group.layout.has_surface()
            if style == "surface" and not skin:
                yield Invalid(f"{name!r} has no surface", at, (((*path,), "this group"),))
            if style == "lines" and name not in joined:
                yield Invalid(
                    f"no springs or rods join the particles of {name!r}", at, (((*path,), "this group"),)
                )
        elif style in ("surface", "points"):
            yield Invalid(
                "springs and rods are lines or hidden",
                at,
                ((sets[name], f"these {sets[name][0]}"),),
                allowed='"lines", "hidden"',
            )


def _bond_tables(scenario: Scenario) -> Iterator[tuple[Keys, tuple[str, str], SpringLaw]]:
    """Where springs are stated, the groups that they join, and their law."""
    for k, springs in enumerate(scenario.springs):
        yield ("springs", k), springs.groups(), springs.spring_law()
    for k, group in enumerate(scenario.particles):
        if group.springs is not None and (laws := group.springs.laws()):
            yield ("particles", k, "springs"), (group.name, group.name), next(iter(laws.values()))


def _joints(scenario: Scenario) -> Iterator[tuple[Keys, Springs | Rods]]:
    """Where pairs of particles are joined, and how."""
    for k, springs in enumerate(scenario.springs):
        yield ("springs", k), springs
    for k, rods in enumerate(scenario.rods):
        yield ("rods", k), rods


def _pairs(scenario: Scenario) -> Iterator[Invalid]:
    """Springs and rods join particles that exist."""
    tables = {group.name: (path, group) for path, group in _group_tables(scenario)}
    for here, joint in _joints(scenario):
        for end, name in enumerate(joint.groups()):
            path, group = tables[name]
            number = group.layout.number() if isinstance(group, Particles) else None
            for j, pair in enumerate(joint.pairs or ()):
                if number is not None and pair[end] >= number:
                    yield Invalid(
                        f"{name!r} has no particle {pair[end]}",
                        (*here, "pairs", j, end),
                        (((*path, "layout"), f"{number} particles"),),
                        allowed=f"0 to {number - 1}",
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
                        allowed=f"0 to {number - 1}",
                    )


def _pulled(scenario: Scenario) -> Iterator[Invalid]:
    """Springs and rods join particles that are there from the start and that forces move."""
    tables = {group.name: (path, group) for path, group in _group_tables(scenario)}
    for here, names, law in _coupling_tables(scenario):
        what = "rods" if are_rods(here) else "springs"
        for name in dict.fromkeys(names):
            path, group = tables[name]
            if not isinstance(group, Particles):
                yield Invalid(
                    f"{what} join particles that are there from the start, and {name!r} is emitted",
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
