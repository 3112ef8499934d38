"""Older versions of the scenario format: read as the current one, and rewritten on request.

A migration is a function that says how the text of version n becomes that of version n + 1, as edits of places in the
text. So comments and the order of things stay, and the same edits serve to read an old file and to rewrite it. To make
version 2:

1. set `CURRENT` to 2 and let `Scenario.format` be `Literal[2]`,
2. write the function, and register it: `MIGRATIONS[1] = one_to_two`,
3. copy the shipped scenarios of version 1 to tests/data/format1 and never change them again.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import tomli_w

from particlesim.errors import Diagnostic, ScenarioError
from particlesim.model.units import shown
from particlesim.scenario.text.positions import TextRange
from particlesim.scenario.text.source import Source, parse_source

CURRENT = 1
"""The version that this psim reads and writes."""


@dataclass(frozen=True)
class Edit:
    """New text for a range of characters."""

    place: TextRange
    text: str


Migration = Callable[[Source], Iterable[Edit]]

MIGRATIONS: dict[int, Migration] = {}
"""From each older version to the one after it."""


def format_of(source: Source) -> int:
    """The version that a scenario says it has; 1 unless it says so.

    Raises ScenarioError for what is no version, or newer than this psim.
    """
    version = source.raw.get("format", 1)
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise _refused(source, f"{shown(version)} is not a version of the scenario format", None)
    if version > CURRENT:
        message = f"format {version} is newer than this psim, which reads up to {CURRENT}"
        raise _refused(source, message, "install a newer particlesim")
    return version


def _refused(source: Source, message: str, hint: str | None) -> ScenarioError:
    text, place = source.text_of(("format",)), source.place(("format",))
    span = None if place is None else text.span(place.value)
    allowed = ", ".join(str(version) for version in range(1, CURRENT + 1))
    return ScenarioError([Diagnostic(message, "format", text.file, text.text, span, (), allowed, hint)])


def migrated(source: Source) -> Source:
    """A scenario in the current format; the same object if it is in that format already.

    Raises ScenarioError for a version that is newer than this psim.
    """
    version = format_of(source)
    if version == CURRENT:
        return source
    if not source.main.text:  # a table from Python
        source = parse_source(tomli_w.dumps(source.raw))
    while version < CURRENT:
        text = _edited(source.main.text, [*MIGRATIONS[version](source), _version(source, version + 1)])
        source = parse_source(text, source.file)
        version += 1
    return source


def _version(source: Source, version: int) -> Edit:
    """The edit that states the version."""
    place = source.place(("format",))
    if place is not None:
        return Edit(place.value, str(version))
    # Behind the comments that the file begins with, among which an editor looks for the schema.
    head = re.match(r"(?:[ \t]*#[^\n]*\n|[ \t]*\n)*", source.main.text)
    start = head.end() if head is not None else 0
    return Edit(TextRange(start, start), f"format = {version}\n")


def _edited(text: str, edits: Iterable[Edit]) -> str:
    """The text with all edits done; they must not overlap."""
    for edit in sorted(edits, key=lambda edit: edit.place.start, reverse=True):
        text = text[: edit.place.start] + edit.text + text[edit.place.end :]
    return text
