"""From a file, a text or a table to a validated scenario."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from particlesim.errors import UsageError
from particlesim.model.mistakes import Invalid
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text.migration import format_of, migrated
from particlesim.scenario.text.overrides import (
    Override,
    apply_overrides,
    overrides_from_mapping,
    parse_override,
)
from particlesim.scenario.text.source import Source, parse_source, read_source, source_from_dict

Overrides = Mapping[str, object] | Iterable[str]


def load(path: str | Path, overrides: Overrides | None = None) -> Scenario:
    """The scenario of a TOML file.

    `overrides` sets values by address: {"simulation.dt": 1e-3}, or ["simulation.dt=1e-3"] with values in TOML.
    Raises ScenarioError with every mistake and its place, UsageError when the file cannot be read.
    TypeError for something else than a path.
    """
    if not isinstance(path, str | PathLike):
        raise TypeError(
            f"load takes the path of a scenario, not {type(path).__name__}; loads takes text, from_table a dict"
        )
    return _validated(read_source(path), overrides, Path(path).resolve().parent)


def loads(text: str, overrides: Overrides | None = None) -> Scenario:
    """The scenario of a TOML text. Raises ScenarioError with every mistake and its place."""
    if not isinstance(text, str):
        raise TypeError(
            f"loads takes TOML text, not {type(text).__name__}; load takes a path, from_table a dict"
        )
    return _validated(parse_source(text), overrides, None)


def from_table(table: Mapping[str, Any], overrides: Overrides | None = None) -> Scenario:
    """The scenario of a table such as TOML gives. Raises ScenarioError with every mistake."""
    if not isinstance(table, Mapping):
        raise TypeError(
            f"from_table takes a dict, not {type(table).__name__}; load takes a path, loads TOML text"
        )
    return _validated(source_from_dict(table), overrides, None)


def _validated(source: Source, overrides: Overrides | None, folder: Path | None) -> Scenario:
    return scenario_of(source, parse_overrides(overrides), folder)


def parse_overrides(overrides: Overrides | None) -> tuple[Override, ...]:
    """Overrides of either form; None are none. Raises UsageError or ScenarioError for text that is none."""
    if overrides is None:
        return ()
    if isinstance(overrides, str):
        overrides = (overrides,)
    entries = tuple(overrides) if isinstance(overrides, Iterable) else (overrides,)
    if not all(isinstance(entry, str) for entry in entries):
        raise TypeError(
            'overrides are a dict such as {"simulation.dt": 1e-3}, or texts such as "simulation.dt=1e-3"'
        )
    if isinstance(overrides, Mapping):
        return overrides_from_mapping(overrides)
    return tuple(parse_override(text) for text in entries)


def scenario_of(source: Source, settings: tuple[Override, ...], folder: Path | None) -> Scenario:
    """The scenario of a parsed source with further overrides. Raises ScenarioError with every mistake and its place,
    UsageError for the file of a sweep."""
    if isinstance(source.raw.get("scenario"), str):  # the first key of a sweep, and of no scenario
        raise UsageError(f"{source.file or 'this'} is a sweep, not a scenario", "psim sweep runs it.")
    version = format_of(source)
    source = apply_overrides(migrated(source), settings)
    mistakes: list[Invalid] = []
    try:
        scenario = Scenario.model_validate(source.raw, context={"mistakes": mistakes})
    except ValidationError as error:
        from particlesim.scenario.text.diagnose import diagnose

        raise diagnose(error, source, Scenario) from None
    if mistakes:
        from particlesim.scenario.text.diagnose import scenario_error

        raise scenario_error(source, mistakes)
    told = tuple(s.text.removeprefix("--set ").removeprefix("override ") for s in settings)
    return scenario.loaded_from(folder, told, source, version)
