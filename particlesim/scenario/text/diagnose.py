"""From pydantic's list of errors to diagnostics that name the place in the file and what to do.

pydantic addresses an error by keys and indices mixed with the names of union branches, and reports a union
once for every branch. Here the address is reduced to a path in the file by following the types, and of a
union only the branch that the author meant is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from particlesim.errors import Diagnostic, Label, ScenarioError, Span
from particlesim.model.mistakes import CROSS_FIELD_ERROR, Invalid
from particlesim.scenario.text import typewalk
from particlesim.scenario.text import wording as messages
from particlesim.scenario.text.overrides import dotted_path
from particlesim.scenario.text.positions import Place
from particlesim.scenario.text.source import KeyPath, OverrideText, Source, Text
from particlesim.scenario.text.suggestions import suggestion
from particlesim.scenario.text.typewalk import Node
from particlesim.scenario.text.wording import Suggest, Words

MOST_SHOWN = 20


@dataclass(frozen=True)
class _Address:
    """Where an error is: the path in the file, the type and the value there, the table or list around it."""

    path: KeyPath
    kind: Node | None
    raw: Any
    parent: Node | None
    parent_raw: Any
    meant: bool
    """False for an error about a branch of a union that the author did not mean."""
    union: tuple[KeyPath, Node, Any] | None
    """The outermost union on the way whose meant branch is open or is not the one of this error."""


def diagnose(error: ValidationError, source: Source, model: type[BaseModel]) -> ScenarioError:
    """`error`, which validating `source.raw` as `model` raised, with places and in plain words."""
    found: list[Diagnostic] = []
    located = [(_locate(entry, source.raw, model), entry) for entry in error.errors(include_url=False)]
    details = [(address, entry) for address, entry in located if not messages.is_spurious(entry, address.raw)]
    explained = {address.path for address, _ in details if address.meant}
    for address, entry in details:
        if address.meant:
            found.append(_diagnostic(address, entry, source, model))
        elif address.union is not None:
            path, union, raw = address.union
            if not any(other[: len(path)] == path for other in explained):
                suggest = _suggest(path, model)
                words = messages.for_union(union, raw, suggest) or messages.none_fits(union, raw)
                found.append(_placed(source, path, words))
    return ScenarioError(_in_order(found))


def scenario_error(source: Source, mistakes: Sequence[Invalid]) -> ScenarioError:
    """Mistakes found after validation, with paths from the root of the scenario, as one error."""
    return ScenarioError(_in_order([_invalid(source, (), mistake) for mistake in mistakes]))


def _locate(entry: ErrorDetails, root: Any, model: type[BaseModel]) -> _Address:
    """Follow pydantic's location through the types and the values, dropping the names of union branches."""
    kind: Node | None = typewalk.node(model)
    raw = root
    path: KeyPath = ()
    parent, parent_raw = kind, raw
    union: tuple[KeyPath, Node, Any] | None = None
    steps = list(entry["loc"])
    while steps:
        if kind is not None and kind.is_union:
            label = steps.pop(0)
            meant = typewalk.choose(kind, raw)
            branch = _labelled(kind, label)
            if union is None and (meant is None or branch is None or branch.annotation != meant.annotation):
                union = (path, kind, raw)
            kind = branch
            continue
        step = steps.pop(0)
        parent, parent_raw = kind, raw
        if isinstance(raw, dict) and step not in raw and steps:
            continue  # a name that pydantic added for a validator, not a key of the file
        kind = None if kind is None else typewalk.child(kind, step, raw)
        raw = _child(raw, step)
        path = (*path, step)
    if kind is not None and kind.is_union and entry["type"] not in messages.TAG_ERRORS:
        kind = typewalk.choose(kind, raw) or kind
    return _Address(path, kind, raw, parent, parent_raw, union is None, union)


def _labelled(union: Node, label: str | int) -> Node | None:
    """The model branch of `union` that pydantic calls `label`: by its tag or by its class name."""
    for branch in typewalk.branches(union):
        if branch.model is not None and (label in typewalk.tags(branch) or label == branch.model.__name__):
            return branch
    plain = [branch for branch in typewalk.branches(union) if branch.model is None and not branch.is_union]
    for branch in plain:
        if messages.is_label_of(branch, str(label)):
            return branch
    nested = [branch for branch in typewalk.branches(union) if branch.is_union]
    return nested[0] if nested and str(label).startswith(("tagged-union", "union", "function-")) else None


def _suggest(path: KeyPath, model: type[BaseModel], *, key: bool = False) -> Suggest:
    """Hints for a word that is the value at `path`, or a key of the table there."""
    return lambda word, known: suggestion(word, known, path, model, key=key)


def _diagnostic(address: _Address, entry: ErrorDetails, source: Source, model: type[BaseModel]) -> Diagnostic:
    mistake = entry.get("ctx", {}).get("invalid")
    if entry["type"] == CROSS_FIELD_ERROR and isinstance(mistake, Invalid):
        return _invalid(source, address.path, mistake)
    key = address.path[-1] if address.path else ""
    if entry["type"] == "missing" and isinstance(address.parent_raw, list | tuple):
        words = messages.wrong_length(address.parent, address.parent_raw)
        return _placed(source, address.path[:-1], words)
    if entry["type"] == "missing":
        return _placed(
            source, address.path[:-1], messages.missing(str(key), address.kind), address=address.path
        )
    if entry["type"] == "tuple_type" and (point := messages.one_point(address.parent, address.parent_raw)):
        return _placed(source, address.path[:-1], point)
    if entry["type"] == "extra_forbidden":
        suggest = _suggest(address.path[:-1], model, key=True)
        words = messages.unknown_key(str(key), address.parent, address.parent_raw, suggest)
        return _placed(source, address.path, words, at_key=True)
    if entry["type"] == "union_tag_invalid" and address.kind is not None:
        path = (*address.path, typewalk.tag_key(address.kind))
        return _placed(source, path, messages.unknown_tag(address.kind, address.raw, _suggest(path, model)))
    if entry["type"] == "union_tag_not_found" and address.kind is not None:
        return _placed(source, address.path, messages.missing_tag(address.kind, address.raw))
    if entry["type"] == "tuple_type" and (
        point := messages.group_for_point(address.kind, address.raw, source.raw)
    ):
        return _placed(source, address.path, point)
    suggest = _suggest(address.path, model)
    stated = None if address.parent is None else typewalk.child(address.parent, key, address.parent_raw)
    words = messages.plain(entry, address.kind, address.raw, suggest, stated)
    return _placed(source, address.path, words)


def _invalid(source: Source, base: KeyPath, mistake: Invalid) -> Diagnostic:
    path = base + mistake.at
    words = Words(mistake.message, mistake.allowed, mistake.hint)
    placed = _placed(source, path, words)
    span = placed.span
    if mistake.within is not None:
        span = source.span_in_string(path, *mistake.within) or span
    text = source.text_of(path)
    labels = []
    notes = [words.hint] if words.hint else []
    for also, note in mistake.also:
        other, other_span = _span(source, base + also)
        if other is text and other_span is not None:
            labels.append(Label(other_span, note))
        else:  # the other value comes from another text, or from nowhere: say it in words
            notes.append(f"{dotted_path(source.raw, base + also)}: {note}")
    return Diagnostic(
        placed.message,
        placed.path,
        placed.file,
        placed.source,
        span,
        tuple(labels),
        words.allowed,
        "; ".join(notes) or None,
    )


def _placed(
    source: Source, path: KeyPath, words: Words, *, at_key: bool = False, address: KeyPath | None = None
) -> Diagnostic:
    """The diagnostic of `words` at `path`, or at what holds it when it is not written anywhere."""
    text, span = _span(source, path, at_key)
    name = dotted_path(source.raw, path if address is None else address)
    return Diagnostic(words.message, name, text.file, text.text, span, (), words.allowed, words.hint)


def _span(source: Source, path: KeyPath, at_key: bool = False) -> tuple[Text, Span | None]:
    text = source.text_of(path)
    for length in range(len(path), 0, -1):
        place = source.place(path[:length])
        if place is not None and source.text_of(path[:length]) is text:
            return text, text.span(_range(place, at_key and length == len(path)).value)
        if isinstance(text, OverrideText) and length <= len(text.path):
            break
    if isinstance(text, OverrideText):
        return text, text.span(text.key)
    return text, None


def _range(place: Place, at_key: bool) -> Place:
    return Place(place.key, place.key) if at_key and place.key is not None else place


def _child(raw: Any, step: str | int) -> Any:
    if isinstance(raw, dict):
        return raw.get(step)
    if isinstance(raw, list | tuple) and isinstance(step, int) and step < len(raw):
        return raw[step]
    return None


def _in_order(found: list[Diagnostic]) -> list[Diagnostic]:
    """Without repetitions, by place, and at most `MOST_SHOWN` of them."""
    unique = list({(d.message, d.path, d.span): d for d in found}.values())
    unique.sort(key=lambda d: (d.file is None, (d.span.line, d.span.column) if d.span else (0, 0)))
    if len(unique) <= MOST_SHOWN:
        return unique
    more = Diagnostic(f"and {len(unique) - MOST_SHOWN} more mistakes", file=unique[0].file)
    return [*unique[:MOST_SHOWN], more]
