"""The base of everything a scenario file may say: immutable, complete, no unknown keys."""

from __future__ import annotations

import ast
import functools
import inspect
import textwrap
from itertools import pairwise
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler, StringConstraints
from pydantic_core import CoreSchema

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_-]*$", max_length=64)]
"""A name in a scenario: letters, digits, _ and -, not beginning with a digit."""

_CONTROL = r"\u0000-\u0008\u000b-\u001f\u007f-\u009f\u2028-\u202e\u2066-\u2069"
# What moves the cursor, changes colours or turns the direction of writing; ECMAScript and Rust read it alike.
Line = Annotated[str, StringConstraints(pattern=rf"^[^\t\n{_CONTROL}]*$", max_length=200)]
"""A line of text, without control characters."""
Prose = Annotated[str, StringConstraints(pattern=rf"^[^{_CONTROL}]*$", max_length=10_000)]
"""Lines of text, without control characters except tabs and line ends."""


class Model(BaseModel):
    """A table of a scenario file.

    The text under a field is its documentation. It is read from the source when someone asks for it (`field_docs`, the
    JSON Schema): pydantic would read it whenever the module is imported, which takes longer than all the rest.
    """

    tag: ClassVar[str] = "type"
    """The key that tells the models of a union apart, where they have it."""
    unused: ClassVar[tuple[str, ...]] = ()
    """Keys of its base that it has no use for, and refuses: they are told nowhere among those that are allowed."""

    model_config = ConfigDict(
        frozen=True,
        defer_build=True,
        extra="forbid",
        allow_inf_nan=False,
        validate_default=True,
        ser_json_inf_nan="strings",
    )

    def says(self, other: object) -> bool:
        """Whether another table says the same, whatever each of them has found out since it was read."""
        return type(self) is type(other) and all(
            getattr(self, name) == getattr(other, name) for name in type(self).model_fields
        )

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        made = handler(schema)
        properties = handler.resolve_ref_schema(made).get("properties", {})
        for name, text in field_docs(cls).items():
            entry = properties.get(cls.model_fields[name].alias or name)
            if entry is not None:
                entry["description"] = text
        for name in cls.unused:
            properties.pop(name, None)
        return made


@functools.cache
def field_docs(model: type[BaseModel]) -> dict[str, str]:
    """What the fields of a model mean, by their names: their `description`, or the text under them in the source."""
    docs: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if issubclass(base, Model) and not base.__pydantic_generic_metadata__["args"]:
            docs |= _texts_under_fields(base)
    docs |= {
        name: info.description for name, info in model.model_fields.items() if info.description is not None
    }
    return {name: text for name, text in docs.items() if name in model.model_fields}


def _texts_under_fields(model: type[BaseModel]) -> dict[str, str]:
    """Strings that stand under annotated names in the body of a class; none where there is no source."""
    try:
        (definition,) = ast.parse(textwrap.dedent(inspect.getsource(model))).body
    except (OSError, TypeError, SyntaxError, ValueError):
        return {}
    assert isinstance(definition, ast.ClassDef)
    return {
        field.target.id: inspect.cleandoc(text.value.value)
        for field, text in pairwise(definition.body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }
