"""The scenario: everything that a scenario file may say, and how its parts must agree."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from pydantic import PrivateAttr, ValidationInfo, model_validator

from particlesim.bonds import Angles, BondSet, Dihedrals, HingeSet, Rods, RodSet, Springs
from particlesim.checks.check import Check
from particlesim.colliders import Plane
from particlesim.emitters import Emitter
from particlesim.errors import InputOutputError, ResourceError, UsageError
from particlesim.forces import AnyForce
from particlesim.groups.group import Group, Particles
from particlesim.groups.impulse import Impulse
from particlesim.groups.motion import Motion
from particlesim.layouts import Layout
from particlesim.layouts.base import LayoutError
from particlesim.layouts.mesh import BEND, DIHEDRAL, require_manifold
from particlesim.layouts.surface import SurfaceFile
from particlesim.model.attributes import ATTRIBUTES
from particlesim.model.base import Line, Model, Prose
from particlesim.model.mistakes import Invalid, invalid
from particlesim.sampling.random_streams import Streams
from particlesim.scenario.reach import acts_on
from particlesim.scenario.rendering import RenderSettings
from particlesim.scenario.rules.checks import untimely
from particlesim.scenario.rules.consistency import contradictions
from particlesim.scenario.rules.rods import rod_sets
from particlesim.scenario.text.diagnose import scenario_error
from particlesim.scenario.text.source import Source
from particlesim.scenario.time_and_output import Output, Simulation
from particlesim.scenario.timegrid import TimeGrid, time_grid


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

        Raises UsageError when that cannot be done: ScenarioError with its place where the text of the scenario is known,
        ResourceError where this machine has too little memory, which is no mistake of the scenario.
        InputOutputError, with the place as well, for a file that leads to others.
        """
        try:
            layout = group.layout.open(self._folder)
            if isinstance(layout, SurfaceFile) and self._needs_sides(group):
                require_manifold(layout.triangles(), group.name)
            return layout
        except ResourceError:
            raise
        except (UsageError, InputOutputError) as error:
            if self._source is None:
                raise
            key = error.key if isinstance(error, LayoutError) else "path"
            k = next(k for k, other in enumerate(self.particles) if other is group)
            mistake = Invalid(error.message, ("particles", k, "layout", key), hint=error.hint)
            located = scenario_error(self._source, [mistake])
            if isinstance(error, InputOutputError):
                raise InputOutputError(located.message) from None
            raise located from None

    @contextmanager
    def at_springs(self, label: str) -> Iterator[None]:
        """What is wrong with a set of springs, by its name in the ledger, once particles have their places: told with its
        place in the text where that is known."""
        try:
            yield
        except UsageError as error:
            labels = self.force_labels()[len(self.forces) :][: len(self.springs)]
            if self._source is None or label not in labels:
                raise
            mistake = Invalid(error.message, ("springs", labels.index(label)), hint=error.hint)
            raise scenario_error(self._source, [mistake]) from None

    def _needs_sides(self, group: Particles) -> bool:
        """Whether the triangles of a group must have a front: they are folded, or feel the wind."""
        kinds = {**group.springs.stiffness(), **group.springs.hinges()} if group.springs is not None else {}
        windy = any(force.on_surfaces and acts_on(force, group) for force in self.forces)
        return windy or bool({BEND, DIHEDRAL} & set(kinds))

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
        fields += [
            name
            for name, attribute in ATTRIBUTES.items()
            if attribute.recorded and any(group.has(name) for group in self.groups)
        ]
        return (*fields, *groups)

    @model_validator(mode="after")
    def _agrees(self, info: ValidationInfo) -> Scenario:
        """Check what no single table shows. A list given as context["mistakes"] collects them all; else the first is
        raised."""
        mistakes = contradictions(self)
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
