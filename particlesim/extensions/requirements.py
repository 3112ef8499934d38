"""What a force or a flow must have, wherever it comes from: words, units and laws that compile."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, get_args, get_origin

import numpy as np
from pydantic import BaseModel

from particlesim.laws.registry import GENERICS, Particle, has_law
from particlesim.model.base import field_docs

SAMPLE = Particle(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 1 / 7)


def type_name(model: type[BaseModel]) -> str | None:
    """The `type` by which scenarios name a model: `type: Literal["name"] = "name"`; None where it is not of that form."""
    field = model.model_fields.get("type")
    if field is None or get_origin(field.annotation) is not Literal:
        return None
    names = get_args(field.annotation)
    return str(field.default) if names == (field.default,) else None


def undocumented(model: type[BaseModel], texts: Sequence[str] = ()) -> list[str]:
    """What the documentation of a model lacks: its docstring, class variables such as `formula`, the text under a field, the
    unit of a number. Empty if all is there."""
    missing = [] if inspect.getdoc(model) and model.__doc__ else ["it has no docstring"]
    missing += [f"it has no {name}" for name in texts if not getattr(model, name, "")]
    docs = field_docs(model)
    missing += [
        f"{name} has no text under it" for name in model.model_fields if name != "type" and not docs.get(name)
    ]
    fields = dict.fromkeys(path.split("/")[0] for path in _bare_numbers(model.model_json_schema()))
    missing += [f"{name} has no unit (annotate it with a type of particlesim.model.units)" for name in fields]
    return missing


def _bare_numbers(schema: dict[str, Any]) -> Iterator[str]:
    """Where a JSON Schema has numbers that do not say their unit: the field, then the way down to the number."""
    for title, part in (("", schema), *schema.get("$defs", {}).items()):
        for name, field in part.get("properties", {}).items():
            if name == "axis":  # a direction is three plain numbers: only their ratio counts
                continue
            yield from (f"{title}.{name}".lstrip(".") + path for path in numbers_without_unit(field))


def numbers_without_unit(schema: Any, path: str = "") -> Iterator[str]:
    """Where a JSON Schema has a number that does not say its unit."""
    if isinstance(schema, dict):
        if "x-unit" in schema:
            return
        if schema.get("type") == "number":
            yield path
        for key, value in schema.items():
            yield from numbers_without_unit(value, f"{path}/{key}")
    elif isinstance(schema, list):
        for value in schema:
            yield from numbers_without_unit(value, path)


def unlawful(record: Any, laws: Sequence[Callable[..., Any]], sample: Any = SAMPLE) -> str | None:
    """Why kernels cannot take a record: it is none, has no law for the first of the generics, or one that does not compile
    for what laws are given, such as `sample`; None if all is well. Laws for the other generics are looked at if there are
    any."""
    from particlesim.compiler.kernel import write  # here: psim's own types are read without the compiler
    from particlesim.compiler.unit import CompileError
    from particlesim.compiler.values import kinds_in

    if not isinstance(record, tuple) or not hasattr(record, "_fields"):
        return f"record() gives {type(record).__name__}, not a NamedTuple of numbers"
    if not has_law(laws[0], record):
        return f"{type(record).__name__} has no law for {laws[0].__name__}"
    for generic in laws:
        if not has_law(generic, record):
            continue
        law, size = GENERICS[generic].laws[type(record)], GENERICS[generic].size
        try:
            forms = [
                write(law, (_cast(record, kind), _cast(sample, kind)))[1] for kind in (float, np.float32)
            ]
        except (CompileError, TypeError) as error:  # TypeError: a record that holds what kernels do not take
            return f"its law for {generic.__name__} does not compile: {error}"
        if (given := len(kinds_in(forms[0]))) != size:
            return f"its law for {generic.__name__} gives {given} numbers instead of {size}"
    return None


def _cast(record: Any, kind: Any) -> Any:
    """A record with its floats in another precision."""
    if isinstance(record, tuple):
        parts = (_cast(part, kind) for part in record)
        return type(record)(*parts) if hasattr(record, "_fields") else tuple(parts)
    return kind(record) if isinstance(record, float) else record
