"""The tables of a scenario: everything that a scenario file may say, before its parts are held against each other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, islice
from pathlib import Path
from typing import Literal, NamedTuple

from pydantic import PrivateAttr

from particlesim.bodies import AnyJoint, Bodies
from particlesim.bonds import Angles, BondSet, Dihedrals, HingeSet, Rods, RodSet, Springs
from particlesim.bonds.pairs import WORLD
from particlesim.checks.check import Check
from particlesim.colliders import AnyCollider, Collider, Plane
from particlesim.emitters import Emitter
from particlesim.forces import AnyForce
from particlesim.groups.group import Group, Particles
from particlesim.groups.impulse import Impulse
from particlesim.groups.motion import Motion
from particlesim.interactions import AnyInteraction
from particlesim.model.attributes import ATTRIBUTES
from particlesim.model.base import Line, Model, Prose
from particlesim.model.variants import Late
from particlesim.sampling.random_streams import Streams
from particlesim.scenario.rendering import RenderSettings
from particlesim.scenario.time_and_output import Output, SimulationSettings


class Labels(NamedTuple):
    """Names in the ledger, no two the same: of forces, listed springs, springs of groups, listed angles and dihedrals, those
    of groups, and interactions between particles; each in the order of the scenario."""

    forces: tuple[str, ...]
    springs: tuple[str, ...]
    springs_of_groups: tuple[str, ...]
    hinges: tuple[str, ...]
    hinges_of_groups: tuple[str, ...]
    interactions: tuple[str, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        """All springs, angles and dihedrals."""
        return (*self.springs, *self.springs_of_groups, *self.hinges, *self.hinges_of_groups)

    @property
    def all(self) -> tuple[str, ...]:
        """Everything, in this order."""
        return tuple(chain(*self))


class Tables(Model):
    """The tables of a scenario file, and what follows from them alone; `Scenario` also checks that they agree."""

    format: Literal[1] = 1
    """Version of the scenario format."""
    title: Line = ""
    """A line that names the scene, for summaries and videos."""
    description: Prose = ""
    """What the scene shows."""
    simulation: SimulationSettings
    """Time, method, seed and precision."""
    output: Output = Output()
    """Which moments and which quantities go to the trajectory."""
    particles: tuple[Particles, ...] = ()
    """Particles that are there from the start."""
    bodies: tuple[Late[Bodies], ...] = ()
    """Rigid bodies."""
    emitters: tuple[Late[Emitter], ...] = ()
    """Sources of particles."""
    forces: tuple[AnyForce, ...] = ()
    """Forces on particles."""
    interactions: tuple[AnyInteraction, ...] = ()
    """What particles do to each other, near or far."""
    springs: tuple[Late[Springs], ...] = ()
    """Springs between listed particles, or points of rigid bodies."""
    rods: tuple[Late[Rods], ...] = ()
    """Pairs of particles, or points of rigid bodies, whose distance does not change."""
    angles: tuple[Late[Angles], ...] = ()
    """Springs that keep the angle at the middle one of three particles."""
    dihedrals: tuple[Late[Dihedrals], ...] = ()
    """Springs that keep the fold between two triangles."""
    joints: tuple[AnyJoint, ...] = ()
    """Ball joints and hinges of rigid bodies."""
    motions: tuple[Late[Motion], ...] = ()
    """Paths of pinned particles."""
    planes: tuple[Late[Plane], ...] = ()
    """Half-spaces that hold particles back: colliders of type "plane"."""
    colliders: tuple[AnyCollider, ...] = ()
    """Shapes that hold particles back."""
    impulses: tuple[Late[Impulse], ...] = ()
    """Kicks at given times."""
    checks: tuple[Late[Check], ...] = ()
    """What must hold; a run that breaks one has failed."""
    render: RenderSettings = RenderSettings()
    """How videos look."""

    _folder: Path | None = PrivateAttr(default=None)

    @property
    def folder(self) -> Path | None:
        """Folder that relative paths in the scenario start from; None for a scenario made in Python."""
        return self._folder

    @property
    def groups(self) -> tuple[Group, ...]:
        """All groups: laid out ones, bodies, then those of emitters."""
        return (*self.particles, *self.bodies, *self.emitters)

    @property
    def all_colliders(self) -> tuple[Collider, ...]:
        """All that holds particles back: planes, then the other colliders."""
        return (*self.planes, *self.colliders)

    def streams(self, group: Group) -> Streams:
        """The random streams of a group."""
        return Streams(self.simulation.seed, group.name)

    @property
    def labels(self) -> Labels:
        """A name of its own for every force, set of springs and interaction, as in the ledger: 'gravity', 'drag' ..."""
        sorts = (
            [force.label for force in self.forces],
            [springs.name for springs in self.springs],
            [bonds.name for group in self.particles for bonds in group.bonds()],
            [hinges.name for hinges in (*self.angles, *self.dihedrals)],
            [hinges.name for group in self.particles for hinges in group.hinges()],
            [each.label for each in self.interactions],
        )
        names = iter(distinct(chain(*sorts)))
        return Labels(*(tuple(islice(names, len(sort))) for sort in sorts))

    @property
    def bonds(self) -> tuple[BondSet, ...]:
        """All sets of springs, each with its name in the ledger."""
        listed = tuple(
            springs.bonds(label) for springs, label in self._labelled_springs if not self.at_bodies(springs)
        )
        return (*listed, *(bonds for group in self.particles for bonds in group.bonds(self.folder)))

    @property
    def _labelled_springs(self) -> Iterator[tuple[Springs, str]]:
        return zip(self.springs, self.labels.springs, strict=True)

    @property
    def body_springs(self) -> tuple[tuple[str, Springs], ...]:
        """Springs at rigid bodies, each with its name in the ledger."""
        return tuple((label, springs) for springs, label in self._labelled_springs if self.at_bodies(springs))

    @property
    def tied(self) -> frozenset[str]:
        """Groups of particles and bodies which springs or rods join with each other."""
        others = {WORLD, *(body.name for body in self.bodies)}
        joints: list[tuple[str, Springs | Rods]] = [*self.body_springs, *self.body_rods]
        found = [each.groups() for _, each in joints if not others.issuperset(each.groups())]
        return frozenset().union(*found, *(each.groups for each in self.hung_rods))

    @property
    def body_rods(self) -> tuple[tuple[str, Rods], ...]:
        """Rods at rigid bodies, each with a name of its own."""
        return tuple(
            (label, rods)
            for rods, label in zip(self.rods, self._rod_labels, strict=True)
            if self.at_bodies(rods)
        )

    @property
    def hung_rods(self) -> tuple[RodSet, ...]:
        """Rods between particles that hang on rigid bodies by rods, which bodies hold together with their own."""
        names = {name for _, rods in self.body_rods for name in rods.groups()}
        found: dict[str, RodSet] = {}
        left = {each.name: each for each in self.rod_sets}
        while near := {name: each for name, each in left.items() if not names.isdisjoint(each.groups)}:
            found |= near
            names.update(*(each.groups for each in near.values()))
            left = {name: each for name, each in left.items() if name not in near}
        return tuple(each for each in self.rod_sets if each.name in found)

    @property
    def _rod_labels(self) -> tuple[str, ...]:
        return distinct([rods.name for rods in self.rods], self.labels.all)

    def at_bodies(self, joint: Springs | Rods) -> bool:
        """Whether springs or rods join rigid bodies."""
        names = joint.groups()
        return WORLD in names or any(body.name in names for body in self.bodies)

    @property
    def rod_sets(self) -> tuple[RodSet, ...]:
        """All sets of rods, each with a name of its own."""
        listed = (
            rods.rods(label, ("rods", k))
            for k, (rods, label) in enumerate(zip(self.rods, self._rod_labels, strict=True))
            if not self.at_bodies(rods)
        )
        bodies = (
            each
            for k, group in enumerate(self.particles)
            for each in group.rods(("particles", k, "springs", "rigid"), self.folder)
        )
        return (*listed, *bodies)

    @property
    def hinges(self) -> tuple[HingeSet, ...]:
        """All angles and dihedrals, each set with its name in the ledger."""
        listed = (*self.angles, *self.dihedrals)
        made = tuple(each.hinges(label) for each, label in zip(listed, self.labels.hinges, strict=True))
        return (*made, *(hinges for group in self.particles for hinges in group.hinges(self.folder)))

    @property
    def has_spin(self) -> bool:
        """Whether some particles turn, as their contacts with each other have friction."""
        return any(each.rubs for each in self.interactions)

    def recorded_fields(self) -> tuple[str, ...]:
        """Fields of the trajectory beside position and id."""
        groups = ("group",) if len(self.groups) > 1 else ()
        if self.simulation.box is not None:
            groups = (*groups, "image")
        if self.output.fields is not None:
            return tuple(dict.fromkeys((*self.output.fields, *groups)))
        fields = ["velocity", *(("orientation", "angular_velocity") if self.bodies else ())]
        if not self.bodies and self.has_spin:
            fields.append("angular_velocity")
        fields += [
            name
            for name, attribute in ATTRIBUTES.items()
            if attribute.recorded and any(group.has(name) for group in self.groups)
        ]
        return (*fields, *groups)


def distinct(names: Iterable[str], taken: Iterable[str] = ()) -> tuple[str, ...]:
    """Names of their own, also beside those that are `taken`: 'drag', 'drag_2', 'drag_3' ..."""
    used, found = set(taken), []
    for base in names:
        label, k = base, 1
        while label in used:
            k += 1
            label = f"{base}_{k}"
        used.add(label)
        found.append(label)
    return tuple(found)
