"""The types of installed packages in scenarios: all that there are, those that a scenario uses, and what a trajectory keeps
of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from particlesim.extensions.open_union import OpenUnion
from particlesim.extensions.packages import Extension, installed
from particlesim.flows import OPEN_FLOWS
from particlesim.forces import OPEN_FORCES
from particlesim.interactions import OPEN_INTERACTIONS

UNIONS: tuple[OpenUnion, ...] = (OPEN_FORCES, OPEN_FLOWS, OPEN_INTERACTIONS)
"""What packages can add to."""


def find_all() -> list[str]:
    """Import the types that packages add; returns what is wrong with those that cannot be used."""
    return [problem for union in UNIONS for problem in union.find_all()]


def count_added() -> int:
    """How many types of packages have been imported so far."""
    return sum(len(union.added) for union in UNIONS)


def extension_of(model: type[BaseModel]) -> Extension | None:
    """The package that a type comes from; None for what is psim's own."""
    found = (union.extension_of(model) for union in UNIONS if issubclass(model, union.base))
    return next((extension for extension in found if extension is not None), None)


def extensions_in(value: Any) -> tuple[Extension, ...]:
    """The types of packages that a scenario, or a part of one, uses."""
    found = (extension_of(model) for model in dict.fromkeys(type(model) for model in _models(value)))
    return tuple(sorted({extension for extension in found if extension is not None}))


def _models(value: Any) -> Iterator[BaseModel]:
    """A table and all tables in it; lists that begin with something else hold none."""
    if isinstance(value, BaseModel):
        yield value
        for name in type(value).model_fields:
            yield from _models(getattr(value, name))
    elif isinstance(value, tuple | list) and value and isinstance(value[0], BaseModel):
        for each in value:
            yield from _models(each)


def recorded(scenario: BaseModel) -> str:
    """The packages of the types that a scenario uses, as trajectories keep it: a line 'axis_pull: axis-forces 1.2' each."""
    return "\n".join(dict.fromkeys(f"{each.type}: {each.origin}" for each in extensions_in(scenario)))


def parsed(text: str) -> dict[str, str]:
    """What `recorded` wrote: the package with its version by type."""
    return {
        name: origin for name, colon, origin in (line.partition(": ") for line in text.splitlines()) if colon
    }


def unavailable(text: str) -> list[str]:
    """Types of a record that no package offers here: "'axis_pull' of the package axis-forces 1.2"."""
    offered = {found.type for union in UNIONS for found in installed(union.group)}
    return [
        f"{name!r} of the package {origin}" for name, origin in parsed(text).items() if name not in offered
    ]
