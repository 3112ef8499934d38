"""The words of scenario errors: the mistake, the allowed values, and a suggestion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from particlesim.model.base import Line, Name, Prose
from particlesim.model.units import QUANTITY_ERROR, shown
from particlesim.scenario.text import typewalk
from particlesim.scenario.text.typewalk import Node

TAG_ERRORS = frozenset({"union_tag_invalid", "union_tag_not_found"})

_LIMITS = {
    "greater_than": ("gt", "greater than", ">"),
    "greater_than_equal": ("ge", "at least", "≥"),
    "less_than": ("lt", "less than", "<"),
    "less_than_equal": ("le", "at most", "≤"),
}


# Patterns in words.
_PATTERNS = {
    get_args(Name)[1].pattern: "letters, digits, _ and -, not beginning with a digit",
    get_args(Line)[1].pattern: "a line of text without control characters",
    get_args(Prose)[1].pattern: "text without control characters",
}


Suggest = Callable[[str, Iterable[str]], str | None]
"""A hint for a word at the place of the mistake that is none of those that may stand there."""


@dataclass(frozen=True)
class Words:
    """The text of a diagnostic."""

    message: str
    allowed: str | None = None
    hint: str | None = None


def missing(key: str, kind: Node | None) -> Words:
    """A key that the table lacks."""
    return Words(f"missing key {key!r}", _allowed(kind))


def unknown_key(key: str, table: Node | None, raw: Any, suggest: Suggest) -> Words:
    """A key that the table does not have."""
    if table is not None and table.is_union:
        table = typewalk.choose(table, raw)
    known = [] if table is None or table.model is None else typewalk.allowed_keys(table.model)
    return Words(f"unknown key {key!r}", ", ".join(known) or None, suggest(key, known))


def unknown_tag(union: Node, raw: Any, suggest: Suggest) -> Words:
    """A type that there is not."""
    key = typewalk.tag_key(union)
    tag = raw.get(key) if isinstance(raw, dict) else None
    known = typewalk.tags(union)
    hint = suggest(tag, known) if isinstance(tag, str) else None
    return Words(f"unknown {key} {shown(tag)}", _quoted(known), hint)


def missing_tag(union: Node, raw: Any) -> Words:
    """A table that does not say its type."""
    key, known = typewalk.tag_key(union), _quoted(typewalk.tags(union))
    if not isinstance(raw, dict):
        return Words(f"expected a table, got {shown(raw)}", f"a table with {key} = {known}")
    return Words(f"missing key {key!r}", known)


def for_union(union: Node, raw: Any, suggest: Suggest) -> Words | None:
    """What to say when no branch of `union` fits; None where nothing is better than naming the branches."""
    known = typewalk.tags(union)
    if isinstance(raw, dict) and known:
        return unknown_tag(union, raw, suggest) if typewalk.tag_key(union) in raw else missing_tag(union, raw)
    if isinstance(raw, list | tuple) and "choice" in known:
        hint = 'values that differ are a distribution: { type = "choice", values = [1, 2] }'
        return Words(f"expected {typewalk.describe(union)}, got {shown(raw)}", None, hint)
    words = [str(value) for value in _literals(union)]
    if isinstance(raw, str) and words:
        return Words(
            f"expected {typewalk.describe(union)}, got {shown(raw)}", _parts(union), suggest(raw, words)
        )
    return None


def none_fits(union: Node, raw: Any) -> Words:
    """What to say when no branch of `union` fits, and nothing is known of what was meant."""
    return Words(f"expected {typewalk.describe(union)}, got {shown(raw)}", _parts(union))


def wrong_length(kind: Node | None, raw: Any) -> Words:
    """A list of the wrong length."""
    arguments = get_args(kind.annotation) if kind is not None else ()
    return Words(f"expected {len(arguments)} elements, got {len(raw)}", None if kind is None else _form(kind))


def plain(
    entry: ErrorDetails, kind: Node | None, raw: Any, suggest: Suggest, stated: Node | None = None
) -> Words:
    """Any other error, by its type. `kind` is what was meant, `stated` all that may stand there."""
    code, context = entry["type"], entry.get("ctx", {})
    if code in _LIMITS:
        return _beyond_limit(code, context, kind, raw)
    if code == QUANTITY_ERROR:
        said = str(context["message"])  # which has an example, but for numbers that are not finite
        return Words(said, _limits(kind) or (_form(kind) if said.startswith("must be finite") else None))
    if code == "literal_error" and kind is not None:
        known = _literals(kind)
        hint = suggest(raw, map(str, known)) if isinstance(raw, str) else None
        others = (
            stated is not None and stated.is_union and len(_literals(stated)) < len(typewalk.branches(stated))
        )
        return Words(f"unknown value {shown(raw)}", _form(stated) if others else _quoted(known), hint)
    if code in _BY_CODE:
        return Words(_BY_CODE[code](context, raw), _limits(kind) or _form(kind), _advice(code, kind, raw))
    if code == "string_pattern_mismatch":
        pattern = str(context["pattern"])
        return Words(f"{shown(raw)} has characters that may not stand here", _PATTERNS.get(pattern, pattern))
    message = str(context["error"]) if code in ("value_error", "assertion_error") else entry["msg"]
    return Words(message.replace("Input should", "must"), _limits(kind))


def is_spurious(entry: ErrorDetails, raw: Any) -> bool:
    """Whether pydantic complains of a short list only because it did not count elements that are wrong."""
    least = entry.get("ctx", {}).get("min_length", 0)
    return entry["type"] == "too_short" and isinstance(raw, list | tuple) and len(raw) >= least


def is_label_of(branch: Node, label: str) -> bool:
    """Whether pydantic means `branch`, which is no model, by `label` in an error's location."""
    if branch.unit is not None:  # "function-plain" is a union whose models are built as they are named
        return label.startswith(("function-before", "function-after")) and "_validate" in label
    name = getattr(branch.origin, "__name__", "")
    if branch.is_list and label.startswith(f"{name}["):  # a list of numbers, or of such lists
        inner = typewalk.child(branch, 0, ())
        return label.startswith(f"{name}[{name}[") == (inner is not None and inner.is_list)
    return label == name or label.startswith(("literal",) if branch.origin is Literal else (f"{name}[",))


def _beyond_limit(code: str, context: Mapping[str, Any], kind: Node | None, raw: Any) -> Words:
    key, words, _ = _LIMITS[code]
    return Words(f"must be {words} {_figure(context[key])}, got {shown(raw)}", _limits(kind))


def _limits(kind: Node | None) -> str | None:
    """'a number > 0 and ≤ 1, in kg/s', None when there is nothing to say."""
    if kind is None:
        return None
    signs = []
    for key, _, sign in _LIMITS.values():
        signs += [
            f"{sign} {_figure(getattr(m, key))}" for m in kind.metadata if getattr(m, key, None) is not None
        ]
    unit = f", in {kind.unit.symbol}" if kind.unit is not None and kind.unit.symbol else ""
    if not signs:
        return None
    number = "a whole number" if kind.annotation is int else "a number"
    return f"{number} {' and '.join(signs)}{unit}"


def _figure(limit: float) -> str:
    """A limit with all digits of a whole number, and those that matter of others."""
    return str(limit) if isinstance(limit, int) else f"{limit:.15g}"


def _allowed(kind: Node | None) -> str | None:
    if kind is None:
        return None
    if (limits := _limits(kind)) is not None:
        return limits
    if kind.is_list or kind.model is not None:
        return _form(kind)
    words = typewalk.describe(kind)
    if kind.unit is not None and kind.unit.symbol:
        return f"{words}, in {kind.unit.symbol}"
    return None if words == "another value" else words


def _form(kind: Node | None) -> str | None:
    """What tables and lists are made of, and quantities without limits: 'a list of 3, each one a length, in m', 'a table
    with axis, angle'; None where the message has said it all."""
    if kind is None or kind.origin is Literal:
        return None
    if kind.is_union:
        words = [
            _form(each) or typewalk.describe(each)
            for each in typewalk.branches(kind)
            if not typewalk.tags(each)
        ]
        if typewalk.tags(kind):
            words.append(
                f"a table with {typewalk.tag_key(kind)} = {_any_of(_quoted([each]) for each in typewalk.tags(kind))}"
            )
        return "; or ".join(dict.fromkeys(words))
    if kind.model is not None:
        return f"a table with {_keys(kind.model)}"
    if kind.is_list:
        element = typewalk.child(kind, 0, ())
        each = None if element is None else _limits(element) or _form(element) or typewalk.describe(element)
        return typewalk.describe(kind) + (f", each one {each}" if each and each != "another value" else "")
    return _allowed(kind) if kind.unit is not None and kind.unit.symbol else None


def _parts(union: Node) -> str | None:
    """What the tables and lists among some alternatives are made of, where no type tells that."""
    plain = [branch for branch in typewalk.branches(union) if not typewalk.tags(branch)]
    return _form(union) if any(each.model is not None or each.is_list for each in plain) else None


def _keys(model: type[BaseModel]) -> str:
    """The keys of a table: those that it needs, and those that it may have."""
    known, infos = typewalk.allowed_keys(model), typewalk.fields(model)
    needed = [key for key in known if infos[key].is_required()]
    others = [key for key in known if key not in needed]
    return ", ".join(needed) + (", and if need be " if needed and others else "") + ", ".join(others)


def _any_of(words: Iterable[str]) -> str:
    """Alternatives in a sentence."""
    *some, last = words
    return f"{', '.join(some)} or {last}" if some else last


def _literals(kind: Node) -> list[Any]:
    if kind.is_union:
        return [value for branch in typewalk.branches(kind) for value in _literals(branch)]
    return list(get_args(kind.annotation)) if kind.origin is Literal else []


def _quoted(values: Iterable[Any]) -> str:
    """Values as the file would write them."""
    return ", ".join(f'"{value}"' if isinstance(value, str) else shown(value) for value in values)


def _advice(code: str, kind: Node | None, raw: Any) -> str | None:
    """What to do about typical slips: [forces] for [[forces]], a number for a vector, 1e3 for 1000."""
    if code == "tuple_type" and kind is not None and typewalk.is_vector(kind) and _is_number(raw):
        return f"a vector has three components: [0, {shown(raw)}, 0]"
    if code == "int_type" and isinstance(raw, float) and raw.is_integer() and abs(raw) < 1e15:
        return f"write {int(raw)}"
    if code in ("list_type", "tuple_type") and kind is not None and not isinstance(raw, dict):
        element = typewalk.child(kind, 0, raw)
        if element is not None and not typewalk.is_vector(kind) and typewalk.fit(element, raw) > 0:
            return f"a list of one: [{_quoted([raw])}]"
    if code == "tuple_type" and kind is not None and typewalk.is_vector(kind) and isinstance(raw, dict):
        return "a vector has three components: [0, 1, 0]"
    if code in ("list_type", "tuple_type") and isinstance(raw, dict):
        return "an entry of a list of tables has two brackets: [[name]]"
    if code in ("model_type", "model_attributes_type", "dict_type") and isinstance(raw, list):
        return "a single table has one pair of brackets: [name]"
    return None


def one_point(kind: Node | None, raw: Any) -> Words | None:
    """The slip of writing one point where a list of them is due."""
    if kind is None or not isinstance(raw, list | tuple) or len(raw) != 3 or not all(map(_is_number, raw)):
        return None
    element = typewalk.child(kind, 0, raw)
    if element is None or not kind.is_list or not typewalk.is_vector(element):
        return None
    x, y, z = map(shown, raw)
    return Words("expected a list of vectors, got one vector", hint=f"write [[{x}, {y}, {z}]]")


def group_for_point(kind: Node | None, raw: Any, scenario: Mapping[str, Any]) -> Words | None:
    """The slip of naming a group where a fixed point is due."""
    if kind is None or not typewalk.is_vector(kind) or not isinstance(raw, str):
        return None
    tables = scenario.get("particles")
    groups = [group for group in tables if isinstance(group, dict)] if isinstance(tables, list) else []
    named = next((group for group in groups if group.get("name", "particles") == raw), None)
    if named is None:
        return None
    layout = named.get("layout")
    points = layout.get("position") if isinstance(layout, dict) else None
    if isinstance(points, list) and len(points) == 1 and isinstance(points[0], list):
        place = ", ".join(f'"{x}"' if isinstance(x, str) else shown(x) for x in points[0])
        hint = f"{raw!r} begins at [{place}]; "
    else:
        hint = ""
    hint += f'what goes with particles are springs: [[springs]] with between = ["{raw}", ...]'
    return Words(f"expected a fixed point, got the name of a group, {shown(raw)}", "a list of 3", hint)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _expected(what: str) -> Callable[[Mapping[str, Any], Any], str]:
    return lambda context, raw: f"expected {what}, got {shown(raw)}"


def _finite(context: Mapping[str, Any], raw: Any) -> str:
    return f"must be finite, got {shown(raw)}"


def _too_short(context: Mapping[str, Any], raw: Any) -> str:
    return f"must have at least {_elements(context['min_length'], raw)}, got {len(raw)}"


def _too_long(context: Mapping[str, Any], raw: Any) -> str:
    return f"must have at most {_elements(context['max_length'], raw)}, got {len(raw)}"


def _elements(count: int, raw: Any) -> str:
    noun = "character" if isinstance(raw, str) else "element"
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


_BY_CODE: dict[str, Callable[[Mapping[str, Any], Any], str]] = {
    **dict.fromkeys(("string_type",), _expected("text")),
    **dict.fromkeys(("int_type", "int_from_float", "int_parsing"), _expected("a whole number")),
    **dict.fromkeys(("float_type", "float_parsing"), _expected("a number")),
    **dict.fromkeys(("bool_type", "bool_parsing"), _expected("true or false")),
    **dict.fromkeys(("list_type", "tuple_type", "set_type"), _expected("a list")),
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), _expected("a table")),
    **dict.fromkeys(("finite_number",), _finite),
    **dict.fromkeys(("too_short", "string_too_short"), _too_short),
    **dict.fromkeys(("too_long", "string_too_long"), _too_long),
}
