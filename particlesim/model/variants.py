"""Unions of models that a tag tells apart, built one by one: a scenario names few of all forces, layouts and shapes."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Annotated, Any, get_args

from pydantic import BaseModel, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, SchemaValidator, core_schema


def models_of(annotation: Any) -> tuple[type[Any], ...]:
    """The models of `Annotated[Box | Ball, ...]`, in this order."""
    return get_args(get_args(annotation)[0])


class Tagged:
    """Marks a union of models told apart by the key `by`: `Annotated[Box | Ball, Tagged("type")]`.

    It accepts what pydantic's `Field(discriminator=...)` accepts, with the same errors and JSON Schema. That builds the
    validators of all branches, which takes longer than a small run; here one is built when a table first names it.

    Models do not contain themselves. `union` makes the union when it is needed, where it is not that of the annotation.
    """

    def __init__(self, by: str, union: Callable[[], Any] | None = None) -> None:
        self._key = by
        self._make = union
        self._union: Any = None
        self._built: dict[str, SchemaValidator] = {}

    def union_of(self, annotation: Any) -> Any:
        """The union that is meant, where this mark stands at `annotation`."""
        if self._union is None:
            self._union = annotation if self._make is None else self._make()
        return self._union

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        if self._make is None:
            self._union = source
        return core_schema.with_info_plain_validator_function(self._validate)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        own = schema["type"] in (
            "function-plain",
            "function-wrap",
        )  # else of an outer mark, which has a larger union
        return handler(self._whole.core_schema if own else schema)

    @cached_property
    def _whole(self) -> TypeAdapter[Any]:
        """The union as pydantic has it: for its JSON Schema, and for what names no branch."""
        union: Any = Annotated[self.union_of(None), Field(discriminator=self._key)]
        return TypeAdapter(union)

    @cached_property
    def _branches(self) -> dict[str, type[BaseModel]]:
        """The models by the values of their tag."""
        return {
            value: model
            for model in get_args(self.union_of(None))
            for value in get_args(model.model_fields[self._key].annotation)
        }

    def _validate(self, value: Any, info: ValidationInfo) -> Any:
        tag = value.get(self._key) if isinstance(value, dict) else getattr(value, self._key, None)
        if not isinstance(tag, str) or tag not in self._branches:
            return self._whole.validator.validate_python(value, context=info.context)
        if tag not in self._built:
            model = self._branches[tag]
            model.model_rebuild()
            branch = {tag: model.__pydantic_core_schema__}
            self._built[tag] = SchemaValidator(core_schema.tagged_union_schema(branch, self._key))
        return self._built[tag].validate_python(value, context=info.context)
