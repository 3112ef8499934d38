"""The scenario: its tables, once they agree with each other, and where they are from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from pydantic import PrivateAttr, ValidationInfo, model_validator

from particlesim.errors import InputOutputError, ResourceError, UsageError
from particlesim.groups.group import Particles
from particlesim.groups.motion import Motion
from particlesim.layouts import Layout
from particlesim.layouts.base import LayoutError
from particlesim.layouts.mesh import BEND, DIHEDRAL, require_manifold
from particlesim.layouts.surface import SurfaceFile
from particlesim.model.mistakes import Invalid, invalid
from particlesim.model.mistakes import Path as Place
from particlesim.scenario.reach import acts_on, group_tables
from particlesim.scenario.rules.checks import untimely
from particlesim.scenario.rules.consistency import contradictions
from particlesim.scenario.tables import Tables
from particlesim.scenario.text.source import Source
from particlesim.scenario.timegrid import TimeGrid, time_grid


class Scenario(Tables):
    """A particle simulation: particles and bodies, forces, method, and output."""

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
    def grid(self) -> TimeGrid:
        """The grid of time."""
        return self._grid

    @property
    def overrides(self) -> tuple[str, ...]:
        """Overrides of the file, as 'key=value'."""
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
            group.check_sizes(layout)
            if isinstance(layout, SurfaceFile) and self._needs_sides(group):
                require_manifold(layout.triangles(), group.name)
            return layout
        except ResourceError:
            raise
        except (UsageError, InputOutputError) as error:
            if self._source is None:
                raise
            key = error.key if isinstance(error, LayoutError) else "path"
            where = next(where for where, other in group_tables(self) if other is group)
            mistake = Invalid(error.message, (*where, "layout", key), hint=error.hint)
            from particlesim.scenario.text.diagnose import scenario_error

            located = scenario_error(self._source, [mistake])
            if isinstance(error, InputOutputError):
                raise InputOutputError(located.message) from None
            raise located from None

    def at_springs(self, label: str) -> AbstractContextManager[None]:
        """An error about a set of springs, by its name in the ledger, once particles have their positions: reported with its
        place in the text where that is known."""
        return self._at(_entry("springs", self.labels.springs, label))

    def at_interaction(self, label: str) -> AbstractContextManager[None]:
        """The same for an interaction between particles."""
        return self._at(_entry("interactions", self.labels.interactions, label))

    def at_motion(self, motion: Motion) -> AbstractContextManager[None]:
        """The same for a motion that leads particles."""
        return self._at(next((("motions", k) for k, each in enumerate(self.motions) if each is motion), None))

    @contextmanager
    def _at(self, place: Place | None) -> Iterator[None]:
        """Give mistakes a place in the text, where both are known."""
        try:
            yield
        except UsageError as error:
            if self._source is None or place is None:
                raise
            mistake = Invalid(error.message, place, hint=error.hint)
            from particlesim.scenario.text.diagnose import scenario_error

            raise scenario_error(self._source, [mistake]) from None

    def _needs_sides(self, group: Particles) -> bool:
        """Whether the triangles of a group must have a front: they are folded, or feel the wind."""
        kinds = {**group.springs.stiffness(), **group.springs.hinges()} if group.springs is not None else {}
        windy = any(force.on_surfaces and acts_on(force, group) for force in self.forces)
        return windy or bool({BEND, DIHEDRAL} & set(kinds))

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


def _entry(section: str, labels: tuple[str, ...], label: str) -> Place | None:
    """The place of the entry of a section that has a label, where there is one."""
    return (section, labels.index(label)) if label in labels else None
