"""Unions of models that a tag tells apart, imported and built one by one: a scenario names few of all forces, layouts and
shapes."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Annotated, Any, Generic, TypeVar, Union, get_args, overload

from pydantic import BaseModel, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, SchemaValidator, core_schema

M = TypeVar("M", bound=BaseModel)


class Family(Sequence[type[M]], Generic[M]):
    """The models of a package by their tags, each imported when it is first asked for.

    `Family("particlesim.flows", uniform="uniform.Uniform")`: the class `Uniform` in the file `uniform.py`, of the type
    "uniform". As a sequence it is that of all classes, and imports them all.
    """

    def __init__(self, package: str, **homes: str) -> None:
        self._package, self._homes = package, homes
        self._models: dict[str, type[M]] = {}

    @property
    def tags(self) -> tuple[str, ...]:
        """The values of `type`, in the order of the sequence; nothing is imported."""
        return tuple(self._homes)

    def named(self, tag: str) -> type[M]:
        """The model of a tag."""
        if tag not in self._models:
            module, name = self._homes[tag].rsplit(".", 1)
            self._models[tag] = getattr(importlib.import_module(f"{self._package}.{module}"), name)
        return self._models[tag]

    @overload
    def __getitem__(self, index: int) -> type[M]: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[type[M], ...]: ...

    def __getitem__(self, index: int | slice) -> type[M] | tuple[type[M], ...]:
        return tuple(self)[index]

    def __iter__(self) -> Iterator[type[M]]:
        return map(self.named, self._homes)

    def __len__(self) -> int:
        return len(self._homes)

    def by_name(self, name: str) -> type[M]:
        """The model whose class has this name: `__getattr__` of the package. Raises AttributeError."""
        for tag, home in self._homes.items():
            if home.endswith(f".{name}"):
                return self.named(tag)
        raise AttributeError(f"module {self._package!r} has no attribute {name!r}")

    def __add__(self, other: Family[M]) -> Family[M]:
        """The models of both, which are of one package."""
        return Family(self._package, **self._homes, **other._homes)

    def union(self) -> Any:
        """The union of all models."""
        return Union[tuple(self)]  # noqa: UP007 -- of what only a list tells


class Tagged:
    """Marks a union of models told apart by the key `by`: `Annotated[Box | Ball, Tagged("type")]`.

    It accepts what pydantic's `Field(discriminator=...)` accepts, with the same errors and JSON Schema. That builds the
    validators of all branches, which takes longer than a small run; here one is built when a table first names it.

    Models do not contain themselves. `union` makes the union when it is needed, where it is not that of the annotation. A
    family stands for the union of its models, each imported when a table first names it:
    `Annotated[Flow, Tagged("type", FLOWS)]`.
    """

    def __init__(self, by: str, union: Callable[[], Any] | Family[Any] | None = None) -> None:
        self._key = by
        self._family = union if isinstance(union, Family) else None
        self._make = union.union if isinstance(union, Family) else union
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

    def _branch(self, tag: str) -> type[BaseModel] | None:
        """The model that a value of the tag names."""
        if self._family is None:
            return self._branches.get(tag)
        return self._family.named(tag) if tag in self._family.tags else None

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
        if not isinstance(tag, str) or (model := self._branch(tag)) is None:
            return self._whole.validator.validate_python(value, context=info.context)
        if tag not in self._built:
            model.model_rebuild()
            branch = {tag: model.__pydantic_core_schema__}
            self._built[tag] = SchemaValidator(core_schema.tagged_union_schema(branch, self._key))
        return self._built[tag].validate_python(value, context=info.context)


class _Late:
    """The mark of `Late`."""

    def __get_pydantic_core_schema__(
        self, source: type[BaseModel], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        def validate(value: Any, info: ValidationInfo) -> Any:
            return source.__pydantic_validator__.validate_python(value, context=info.context)

        return core_schema.with_info_plain_validator_function(validate, metadata={"model": source})

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        model = schema["metadata"]["model"]
        model.model_rebuild()
        made = model.__pydantic_core_schema__
        definitions = made["definitions"] if made["type"] == "definitions" else []
        inner = made["schema"] if made["type"] == "definitions" else made
        named = {"ref": f"{model.__module__}.{model.__qualname__}:{id(model)}", **inner}
        return handler(core_schema.definitions_schema(named, definitions))


Late = Annotated[M, _Late()]
"""A model whose validator is built when a table first needs it: `springs: tuple[Late[Springs], ...] = ()`."""
