"""A union of tables told apart by their `type`, to which installed packages add further types.

    AnyFlow = Annotated[Flow, Tagged("type", FLOWS), OpenUnion("particlesim.flows", Flow, FLOWS, ...)]

The types of psim are validated as in any union. Only a `type` that is not among them makes psim look at the
installed packages, and only the one that adds it is imported: a scenario names a type, never a module.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Union

from pydantic import BaseModel, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter, ValidationInfo
from pydantic_core import CoreSchema, core_schema

from particlesim.extensions.packages import Extension, ExtensionError, installed
from particlesim.extensions.requirements import SAMPLE, type_name, undocumented, unlawful
from particlesim.model.mistakes import invalid
from particlesim.model.variants import Family


class OpenUnion:
    """The mark of a union that is open to packages, and the types that they have added to it so far.

    `group` is the group of entry points; `base` the class that every type derives from; `own` are the types of psim; `texts`
    the class variables that document a type; `laws` the generics that its records may have a law for, of which the first
    must be there; `sample` is what laws are given, a particle or a pair.
    """

    def __init__(
        self,
        group: str,
        base: type[BaseModel],
        own: Family[Any],
        *,
        texts: Sequence[str] = (),
        laws: Sequence[Callable[..., Any]],
        sample: Any = SAMPLE,
    ) -> None:
        self.group, self.base, self.own, self.texts, self.laws = group, base, own, texts, laws
        self._sample = sample
        self._added: dict[str, tuple[Extension, type[BaseModel]]] = {}

    def __copy__(self) -> OpenUnion:  # pydantic copies the marks of fields; there is one union of each kind
        return self

    def __deepcopy__(self, memo: Any) -> OpenUnion:
        return self

    # What there is

    @property
    def added(self) -> tuple[type[BaseModel], ...]:
        """The types of packages that have been imported."""
        return tuple(model for _, model in self._added.values())

    def names(self) -> tuple[str, ...]:
        """The types that installed packages offer, whether they work or not; nothing is imported."""
        offered = (found.type for found in installed(self.group))
        return tuple(dict.fromkeys(name for name in offered if name not in self.own.tags))

    def find(self, name: str) -> type[BaseModel] | None:
        """The class of a type that a package adds; None if none does. Raises ExtensionError for one that cannot be used."""
        if name in self._added:
            return self._added[name][1]
        if name in self.own.tags:
            return None
        offered = [found for found in installed(self.group) if found.type == name]
        if not offered:
            return None
        if len(offered) > 1:
            several = " and ".join(found.origin for found in offered)
            raise ExtensionError(f"{name!r} is offered by several packages, {several}: uninstall all but one")
        model = self._checked(offered[0])
        self._added[name] = offered[0], model
        return model

    def find_all(self) -> list[str]:
        """Import the types of all packages; returns what is wrong with those that cannot be used."""
        problems = [
            f"{found.type!r} of the package {found.origin} is not used: psim has a type of this name"
            for found in installed(self.group)
            if found.type in self.own.tags
        ]
        for name in self.names():
            try:
                self.find(name)
            except ExtensionError as error:
                problems.append(str(error))
        return problems

    def extension_of(self, model: type[BaseModel]) -> Extension | None:
        """The package that a class comes from; None for a class of psim, and for one that no package offers."""
        name = type_name(model)
        if model in self.own or name is None:
            return None
        try:
            self.find(name)
        except ExtensionError:
            return None
        extension, known = self._added.get(name, (None, None))
        return extension if known is model else None

    def _checked(self, extension: Extension) -> type[BaseModel]:
        """Import the class of a type. Raises ExtensionError unless it is as it must be."""
        loaded, what = extension.load(), f"{extension.type!r} of the package {extension.origin}"
        if not isinstance(loaded, type) or not issubclass(loaded, self.base):
            raise ExtensionError(
                f"{what} is no {self.base.__name__}: {extension.target} must be a subclass of "
                f"{self.base.__module__}.{self.base.__name__}"
            )
        if (name := type_name(loaded)) != extension.type:
            raise ExtensionError(
                f"{what} is a class whose type is {name!r}: the entry point and its type must have one name"
            )
        if getattr(loaded, "on_surfaces", False):
            raise ExtensionError(f"{what} acts on surfaces, which only forces of psim can")
        try:
            missing = undocumented(loaded, self.texts)
        except Exception as error:  # of the package's own code
            missing = [f"its schema cannot be made: {type(error).__name__}: {error}"]
        if missing:
            raise ExtensionError(f"{what} is not complete: {'; '.join(missing)}")
        return loaded

    # What pydantic makes of it

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_wrap_validator_function(self._validate, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> Any:
        return handler(schema if not self._added else self._adapter(self.added).core_schema)

    def _validate(self, raw: Any, handler: Callable[[Any], Any], info: ValidationInfo) -> Any:
        """A table or an instance, of one of psim's types or of one that a package adds."""
        name = raw.get("type") if isinstance(raw, dict) else getattr(raw, "type", None)
        if not isinstance(name, str) or name in self.own.tags:
            return handler(raw)
        try:
            if self.find(name) is None:
                return handler(raw)
            model = self._adapter(self.added).validate_python(raw, context=info.context)
            self._try_out(model)
        except ExtensionError as error:
            raise invalid(str(error), at=("type",)) from None
        return model

    @functools.lru_cache(maxsize=2)  # noqa: B019 -- unions live as long as the program
    def _adapter(self, added: tuple[type[BaseModel], ...]) -> TypeAdapter[Any]:
        """Validates the union of psim's types and those that packages have added."""
        union: Any = Annotated[Union[(*self.own, *added)], Field(discriminator="type")]
        return TypeAdapter(union)

    def _try_out(self, model: Any) -> None:
        """Raise ExtensionError unless kernels can take what a package made of a table."""
        extension, _ = self._added[model.type]
        try:
            record = model.record()
            fault = unlawful(record, self.laws, self._sample)
        except Exception as error:  # of the package's own code
            fault = f"{type(error).__name__}: {error}"
        if fault is not None:
            raise ExtensionError(f"{model.type!r} of the package {extension.origin} cannot be used: {fault}")
