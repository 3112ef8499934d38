"""Where a scenario says what a warning speaks of.

Warnings are sentences, of laws, groups and extensions that know nothing of text. But they name what they speak of as all
messages do: a group in quotation marks, a force or an interaction by its label, a collider by kind and name, a step as dt.
So the first thing that a sentence names is its subject, and that has a place.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from particlesim.errors import Diagnostic
from particlesim.model.mistakes import Invalid
from particlesim.scenario.reach import collider_tables, group_tables
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text.source import KeyPath

_FILES = ("path", "file")
"""Keys whose values name files, of which warnings speak by their paths."""


def subject(scenario: Scenario, text: str) -> Diagnostic | None:
    """The place of what a warning speaks of; None where it names nothing, or nothing that is written in a text."""
    source = scenario.source
    if source is None:
        return None
    found = [
        (match.start(), -len(name), path)
        for name, path in _names(scenario)
        if (match := re.search(rf"(?<![\w.]){re.escape(name)}(?!\w)", text)) is not None
    ]
    path: KeyPath = min(found)[2] if found else ()
    while path and source.place(path) is None:  # as of what is left out
        path = path[:-1]
    if not path:
        return None
    from particlesim.scenario.text.diagnose import scenario_error

    return scenario_error(source, [Invalid(text, path)]).diagnostics[0]


def _names(scenario: Scenario) -> Iterator[tuple[str, KeyPath]]:
    """What messages call everything in a scenario, and where that is stated."""
    for where, group in group_tables(scenario):
        yield from _quoted(group.name, where)
    labels = scenario.labels
    hinges = (
        *(("angles", k) for k in range(len(scenario.angles))),
        *(("dihedrals", k) for k in range(len(scenario.dihedrals))),
    )
    joined = [("particles", k) for k, group in enumerate(scenario.particles) for _ in group.bonds()]
    folded = [("particles", k) for k, group in enumerate(scenario.particles) for _ in group.hinges()]
    for names, places in (
        (labels.forces, [("forces", k) for k in range(len(scenario.forces))]),
        (labels.interactions, [("interactions", k) for k in range(len(scenario.interactions))]),
        (labels.springs, [("springs", k) for k in range(len(scenario.springs))]),
        (labels.hinges, list(hinges)),
        (labels.springs_of_groups, joined),
        (labels.hinges_of_groups, folded),
    ):
        yield from zip(names, places, strict=True)
    for k, (where, collider) in enumerate(collider_tables(scenario)):
        yield collider.called(k), where
        yield f"{collider.kind} {collider.name or '.'.join(map(str, where))}", where
    for key in ("dt", "simulation.dt"):
        yield key, ("simulation", "dt")
    yield "in format", ("format",)
    assert scenario.source is not None
    yield from _files(scenario.source.raw, ())


def _quoted(name: str, where: KeyPath) -> Iterator[tuple[str, KeyPath]]:
    for mark in "'\"":
        yield f"{mark}{name}{mark}", where


def _files(table: Any, where: KeyPath) -> Iterator[tuple[str, KeyPath]]:
    """Files that tables name."""
    items = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in items:
        if isinstance(value, dict | list):
            yield from _files(value, (*where, key))
        elif key in _FILES and isinstance(value, str) and value:
            yield value, (*where, key)
