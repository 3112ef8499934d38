"""`sweep.toml`: what `psim sweep` takes as options, in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from annotated_types import MinLen
from pydantic import Field, StrictBool, StringConstraints, ValidationError

from particlesim.model.base import Model
from particlesim.scenario.text.diagnose import diagnose
from particlesim.scenario.text.overrides import override_from_python
from particlesim.scenario.text.source import Source, read_source
from particlesim.sweep.axes import Listed, Sampled, parse_axis
from particlesim.sweep.design import Method

Key = Annotated[str, StringConstraints(min_length=1)]


class SweepFile(Model):
    """A sweep: its scenario, what is varied, and how. Where results go is said on the command line."""

    scenario: Annotated[str, StringConstraints(min_length=1)]
    """The scenario, relative to this file."""
    vary: dict[Key, Annotated[list[Any], MinLen(1)] | str] = Field(min_length=1)
    """Values by key: a list, or what --vary takes, such as "linspace(0, 1, 11)"."""
    set: dict[Key, Any] = Field(default_factory=dict)
    """Values of all runs by key, as --set."""
    zip: StrictBool = False
    """Take the k-th values of all lists together, instead of every combination."""
    samples: Annotated[int, Field(ge=1, strict=True)] | None = None
    """Number of values that uniform and loguniform draw."""
    method: Method = "sobol"
    """How they are drawn."""
    seed: Annotated[int, Field(ge=0, strict=True)] = 0
    """Seed of what is drawn."""
    quantities: tuple[str, ...] = ()
    """Columns of the table; all unless given."""
    record: StrictBool = False
    """Keep the trajectory of every run."""
    workers: Annotated[int, Field(ge=1, strict=True)] | None = None
    """Worker processes; one per core unless given."""
    fail_fast: StrictBool = False
    """Start no further run after one that failed."""

    def axes(self) -> tuple[Listed | Sampled, ...]:
        """What is varied. Raises UsageError or ScenarioError for values that make no sense."""
        return tuple(
            parse_axis(f"{key}={values}") if isinstance(values, str) else Listed(key, tuple(values))
            for key, values in self.vary.items()
        )

    def settings(self) -> tuple[str, ...]:
        """The values of all runs, as --set takes them."""
        made = (override_from_python(key, value).text for key, value in self.set.items())
        return tuple(text.removeprefix("override ") for text in made)


def is_sweep(source: Source) -> bool:
    """Whether a TOML file is a sweep, not a scenario: it names one."""
    return "scenario" in source.raw or ("vary" in source.raw and "simulation" not in source.raw)


def load_sweep(path: Path) -> SweepFile:
    """The sweep of a file. Raises ScenarioError with every mistake and its place, UsageError when it cannot be read."""
    source = read_source(path)
    try:
        return SweepFile.model_validate(source.raw)
    except ValidationError as error:
        raise diagnose(error, source, SweepFile) from None
