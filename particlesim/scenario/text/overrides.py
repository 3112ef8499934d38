"""Values that replace those of the file: `--set forces.air.coefficient=0.3`, or a dict from Python.

A key is a dotted path. Entries of an array of tables answer to their `name`, to their `type` when no other
entry has that name or type, and to their index: `forces.air`, `forces.gravity`, `forces.0`.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

from particlesim.errors import Diagnostic, ScenarioError, UsageError
from particlesim.model.spelling import did_you_mean
from particlesim.scenario.text import syntax
from particlesim.scenario.text.positions import TextRange
from particlesim.scenario.text.source import KeyPath, OverrideText, RawTable, Source, Text

_PART = re.compile(r"\"([^\"]*)\"|'([^']*)'|([^.\"']+)")


@dataclass(frozen=True)
class Override:
    """`value` for the value at `key`. `text` is how messages show it, the starts are offsets in it."""

    key: str
    value: object
    text: str
    key_start: int
    value_start: int


def parse_override(argument: str) -> Override:
    """`key=value` of the command line, the value in TOML.

    Raises UsageError without a key, ScenarioError when the value is not TOML.
    """
    key, equals, value = argument.partition("=")
    if not equals or not key.strip():
        raise UsageError(
            f"--set {argument!r} is not of the form key=value", "for example: --set simulation.dt=1e-3"
        )
    text = f"--set {argument}"
    override = Override(key.strip(), None, text, text.index(key.strip(), 6), len(text) - len(value.lstrip()))
    return replace(override, value=toml_value(override, value.strip()))


def override_from_python(key: str, value: object) -> Override:
    """The override `{key: value}` of the Python interface."""
    start = len("override ")
    return Override(key, value, f"override {key} = {_inline(value)}", start, start + len(key) + 3)


def overrides_from_mapping(values: Mapping[str, object]) -> tuple[Override, ...]:
    """The overrides {key: value, ...} of the Python interface."""
    return tuple(override_from_python(key, value) for key, value in values.items())


def apply_overrides(source: Source, overrides: Iterable[Override]) -> Source:
    """`source` with the overrides applied in order; the given one stays as it is.

    A key or table that is missing is created, validation decides whether it may exist.
    Raises ScenarioError for a name or an index that no entry of an array has.
    """
    raw = deepcopy(source.raw)
    texts = list(source.overrides)
    for override in overrides:
        path = _resolve(raw, override.key, Text(override.text), override.key_start)
        _assign(raw, path, deepcopy(override.value))
        key = TextRange(override.key_start, override.key_start + len(override.key))
        texts.append(OverrideText(override.text, None, path, key, override.value_start))
    return replace(source, raw=raw, overrides=tuple(texts))


def resolve_path(raw: RawTable, dotted: str) -> KeyPath:
    """The path in `raw` that `dotted` addresses: "forces.air.coefficient" → ("forces", 1, "coefficient").

    The last keys need not exist. Raises ScenarioError for a name or an index that no entry of an array has.
    """
    return _resolve(raw, dotted, Text(dotted), 0)


def dotted_path(raw: Any, path: Sequence[str | int]) -> str:
    """The inverse of `resolve_path`, with names where entries have them: "forces.air.coefficient"."""
    words = []
    for step in path:
        words.append(_entry_name(raw, step) if isinstance(raw, list) and isinstance(step, int) else str(step))
        raw = _child(raw, step)
    return ".".join(f'"{word}"' if "." in word else word for word in words)


def toml_value(override: Override, value: str) -> object:
    """`value`, the last part of the override's text, read as TOML. Raises ScenarioError with the place in that text."""
    prefix = "v = "
    try:
        parsed = tomllib.loads(prefix + value)
        if list(parsed) == ["v"] and value:
            return parsed["v"]
        mistake = syntax.Mistake("not a single TOML value", TextRange(len(prefix), len(prefix) + 1))
    except tomllib.TOMLDecodeError as error:
        mistake = syntax.explain(prefix + value, error)
    except (ValueError, RecursionError):
        mistake = syntax.Mistake("not a TOML value", TextRange(len(prefix), len(prefix) + 1))
    shift = override.value_start - len(prefix)
    first = max(mistake.place.start + shift, override.value_start)
    place = TextRange(first, max(mistake.place.end + shift, first + 1))
    hint = mistake.hint
    if not value:
        hint = "give a value after '='"
    elif hint is not None and hint.startswith("text stands"):
        hint += f"; in a shell: --set '{override.key}=\"{value}\"'"
    message = f"the value is {mistake.message.replace('not valid TOML: ', 'not valid TOML, ')}"
    if not mistake.message.startswith("not "):
        message = mistake.message
    span = Text(override.text).span(place)
    raise ScenarioError([Diagnostic(message, override.key, None, override.text, span, (), None, hint)])


def _resolve(raw: RawTable, dotted: str, text: Text, start: int) -> KeyPath:
    """`resolve_path`; `dotted` stands at `start` of `text`, where errors point."""
    path: list[str | int] = []
    here: Any = raw
    for name, place in _parts(dotted, text, start):
        step: str | int = name
        if isinstance(here, list):
            step = _entry(here, name, tuple(path), raw, text, place)
        elif not isinstance(here, dict):
            address = dotted_path(raw, path)
            message = f"{address} is {_inline(here)}, it has no {name!r}"
            raise ScenarioError([Diagnostic(message, dotted, None, text.text, text.span(place))])
        path.append(step)
        here = _child(here, step, {})
    return tuple(path)


def _parts(dotted: str, text: Text, start: int) -> list[tuple[str, TextRange]]:
    parts: list[tuple[str, TextRange]] = []
    at = 0
    while True:
        found = _PART.match(dotted, at)
        name = "" if found is None else found[found.lastindex or 0].strip()
        end = at if found is None else found.end()
        if not name or dotted[end : end + 1] not in ("", "."):
            span = text.span(TextRange(start + at, start + max(end, at + 1)))
            hint = "for example: simulation.dt, or forces.air.coefficient"
            raise ScenarioError(
                [Diagnostic(f"{dotted!r} is not a key", dotted, None, text.text, span, hint=hint)]
            )
        parts.append((name, TextRange(start + at, start + end)))
        if end == len(dotted):
            return parts
        at = end + 1


def _entry(entries: list[Any], name: str, path: KeyPath, raw: RawTable, text: Text, place: TextRange) -> int:
    """The index of the entry of an array that `name` addresses."""
    for attribute in ("name", "type"):
        matches = [i for i, entry in enumerate(entries) if _child(entry, attribute) == name]
        if len(matches) == 1 or (matches and attribute == "name"):
            return matches[0]
        if matches:
            break
    else:
        matches = []
        if name.isascii() and name.isdigit() and len(name) < 10 and int(name) < len(entries):
            return int(name)
    address = dotted_path(raw, path)
    names = [_entry_name(entries, index) for index in range(len(entries))]
    hint: str | None
    if matches:
        message = f"{len(matches)} entries of {address} have the type {name!r}"
        hint = f"give them names, or use an index: {address}.{matches[0]}"
    else:
        message = f"{address} has no entry {name!r}"
        hint = did_you_mean(name, names)
    allowed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "") if names else None
    key = f"{address}.{name}"
    raise ScenarioError([Diagnostic(message, key, None, text.text, text.span(place), (), allowed, hint)])


def _entry_name(entries: list[Any], index: int) -> str:
    """How entry `index` is addressed: by name, else by a type that no other entry has, else by index."""
    entry = entries[index] if 0 <= index < len(entries) else None
    name, kind = _child(entry, "name"), _child(entry, "type")
    if isinstance(name, str) and name:
        return name
    taken = [other for i, other in enumerate(entries) if i != index and kind in _addresses(other)]
    return kind if isinstance(kind, str) and kind and not taken else str(index)


def _addresses(entry: Any) -> tuple[Any, Any]:
    return _child(entry, "name"), _child(entry, "type")


def _child(parent: Any, step: str | int, default: Any = None) -> Any:
    if isinstance(parent, dict):
        return parent.get(step, default)
    if isinstance(parent, list | tuple) and isinstance(step, int) and 0 <= step < len(parent):
        return parent[step]
    return default


def _assign(raw: RawTable, path: KeyPath, value: object) -> None:
    here: Any = raw
    for step in path[:-1]:
        if isinstance(here, dict):
            here.setdefault(step, {})
        here = here[step]
    here[path[-1]] = value


def _inline(value: object) -> str:
    """`value` on one line, as TOML where TOML has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_inline(child)}" for key, child in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_inline(child) for child in value) + "]"
    return str(value)
