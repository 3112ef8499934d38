"""Follows a path through the types of pydantic models.

Error messages need to know what a place in a scenario may hold: which keys a table has, in which unit a
number is, which branch of a union the author meant. The types say so; the value at the place decides between
branches.
"""

from __future__ import annotations

import types
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from particlesim.extensions.open_union import OpenUnion
from particlesim.model.base import field_docs
from particlesim.model.units import Unit
from particlesim.model.variants import Tagged


@dataclass(frozen=True)
class Node:
    """A type without its wrappers, and the metadata that the wrappers carried (units, limits)."""

    annotation: Any
    metadata: tuple[Any, ...] = ()
    description: str | None = None

    @property
    def unit(self) -> Unit | None:
        """The unit of a quantity, None of other things."""
        return next((mark for mark in self.metadata if isinstance(mark, Unit)), None)

    @property
    def model(self) -> type[BaseModel] | None:
        """The model of a table, None of other things."""
        kind = self.annotation
        return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None

    @property
    def origin(self) -> Any:
        """What the annotation is made of: `tuple` of tuple[int, ...]."""
        return get_origin(self.annotation) or self.annotation

    @property
    def is_union(self) -> bool:
        """Whether it has alternatives."""
        return self.origin in (Union, types.UnionType)

    @property
    def is_list(self) -> bool:
        """Whether it is a list."""
        return self.origin in (list, tuple, set, frozenset, Sequence)


def node(annotation: Any, metadata: Sequence[Any] = (), description: str | None = None) -> Node:
    """`annotation` freed of Annotated, Optional and type aliases."""
    marks = list(metadata)
    annotation = _meant(annotation, marks)
    while True:
        if get_origin(annotation) is Annotated:
            annotation, *inner = get_args(annotation)
            annotation = _meant(annotation, inner)
            marks = [
                *chain.from_iterable(m.metadata if isinstance(m, FieldInfo) else [m] for m in inner),
                *marks,
            ]
        elif hasattr(annotation, "__value__"):
            annotation = annotation.__value__
        elif get_origin(annotation) in (Union, types.UnionType):
            branches = [branch for branch in get_args(annotation) if branch is not type(None)]
            if len(branches) != 1:
                return Node(annotation, tuple(marks), description)
            annotation = branches[0]
        else:
            return Node(annotation, tuple(marks), description)


def _meant(annotation: Any, marks: Sequence[Any]) -> Any:
    """The union that a mark says is meant; without one the annotation itself."""
    return next((mark.union_of(annotation) for mark in marks if isinstance(mark, Tagged)), annotation)


def is_vector(kind: Node) -> bool:
    """Whether `kind` is a list of exactly three quantities."""
    arguments = get_args(kind.annotation)
    return kind.origin is tuple and len(arguments) == 3 and arguments[-1] is not Ellipsis


def fields(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """The keys of a table of `model`, with those that it refuses."""
    return {info.alias or name: info for name, info in model.model_fields.items()}


def allowed_keys(model: type[BaseModel]) -> list[str]:
    """The keys that a table of `model` may have."""
    unused = getattr(model, "unused", ())
    return [key for key in fields(model) if key not in unused]


def branches(union: Node) -> list[Node]:
    """The types of a union, with those that packages have added to it."""
    added = [model for mark in _open_unions(union) for model in mark.added]
    return [node(branch) for branch in (*get_args(union.annotation), *added) if branch is not type(None)]


def _open_unions(union: Node) -> list[OpenUnion]:
    """The mark of a union to which packages may add types."""
    return [mark for mark in union.metadata if isinstance(mark, OpenUnion)]


def tag_key(kind: Node) -> str:
    """The key that tells the models under `kind` apart: "type", unless the first of them says otherwise."""
    if kind.is_union:
        return next((tag_key(branch) for branch in branches(kind) if tags(branch)), "type")
    return str(getattr(kind.model, "tag", "type"))


def tags(kind: Node) -> list[str]:
    """The values of their tag that the models under `kind` stand for; those that installed packages offer are among them."""
    if kind.is_union:
        known = [tag for branch in branches(kind) for tag in tags(branch)]
        offered = [name for mark in _open_unions(kind) for name in mark.names()]
        return list(dict.fromkeys((*known, *offered)))
    key = tag_key(kind)
    if kind.model is None or key not in kind.model.model_fields:
        return []
    allowed = node(kind.model.model_fields[key].annotation).annotation
    return [str(value) for value in get_args(allowed)] if get_origin(allowed) is Literal else []


def child(parent: Node, step: str | int, raw: Any) -> Node | None:
    """The type of what stands at `step` inside `parent` of value `raw`; None where the types do not say."""
    if parent.is_union:
        branch = choose(parent, raw)
        return None if branch is None else child(branch, step, raw)
    if parent.model is not None and isinstance(step, str):
        info = fields(parent.model).get(step)
        return (
            None if info is None else node(info.annotation, info.metadata, field_docs(parent.model).get(step))
        )
    arguments = get_args(parent.annotation)
    if parent.is_list and isinstance(step, int) and arguments:
        if parent.origin is tuple and arguments[-1] is not Ellipsis:
            return node(arguments[step]) if step < len(arguments) else None
        return node(arguments[0])
    if parent.origin is dict and len(arguments) == 2:
        return node(arguments[1])
    return None


def choose(union: Node, raw: Any) -> Node | None:
    """The branch that the author of `raw` most probably meant, None when that is open."""
    scored = [(fit(branch, raw), branch) for branch in branches(union)]
    best = max((score for score, _ in scored), default=0.0)
    chosen = [branch for score, branch in scored if score == best]
    return chosen[0] if best > 0 and len(chosen) == 1 else None


def fit(kind: Node, raw: Any) -> float:
    """How well the shape of `raw` agrees with `kind`: 0 not at all, more is better."""
    if kind.is_union:
        return max((fit(branch, raw) for branch in branches(kind)), default=0.0)
    if isinstance(raw, dict):
        return _fit_table(kind, raw)
    if isinstance(raw, list | tuple):
        if not kind.is_list:
            return 0.0
        element = child(kind, 0, raw)
        inner = fit(element, raw[0]) if raw and element is not None else 0.0
        return 2.0 + inner / 10
    if kind.origin is Literal:
        values = get_args(kind.annotation)
        return 4.0 if raw in values else 2.0 * any(type(raw) is type(value) for value in values)
    if isinstance(raw, bool):
        return 3.0 * (kind.annotation is bool)
    if isinstance(raw, int | float):
        return 3.0 * (kind.annotation in (int, float))
    if isinstance(raw, str):
        return 2.0 * (kind.unit is not None) or 1.0 * (kind.annotation is str)
    return 0.0


def _fit_table(kind: Node, raw: dict[Any, Any]) -> float:
    if kind.model is None:
        return 1.0 * (kind.origin is dict)
    known = fields(kind.model)
    shared = sum(key in known for key in raw)
    named = raw.get(tag_key(kind)) in tags(kind)
    return 2.0 + 2.0 * named + (shared / len(raw) if raw else 0.0)


def describe(kind: Node | None) -> str:
    """What may stand at a place, in words: 'a length', 'one of "left", "right"', 'a list of 3'."""
    if kind is None:
        return "another value"
    if kind.is_union:
        plain = [branch for branch in branches(kind) if not tags(branch)]
        words = list(dict.fromkeys(describe(branch) for branch in plain))
        if known := tags(kind):
            named = {value for branch in plain for value in get_args(branch.annotation)} >= set(known)
            values = "" if named else " = " + " or ".join(f'"{tag}"' for tag in known)
            words.append(f"a table with {tag_key(kind)}{values}")
        return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"
    if kind.unit is not None:
        return kind.unit.kind
    if kind.model is not None:
        return "a table"
    if kind.origin is Literal:
        return " or ".join(f'"{value}"' for value in get_args(kind.annotation))
    if kind.is_list:
        arguments = get_args(kind.annotation)
        fixed = kind.origin is tuple and arguments and arguments[-1] is not Ellipsis
        return f"a list of {len(arguments)}" if fixed else "a list"
    return _PLAIN.get(kind.annotation, "another value")


_PLAIN: dict[Any, str] = {
    str: "text",
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    dict: "a table",
}
