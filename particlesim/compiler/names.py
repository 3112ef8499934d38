"""The variables of a function that is compiled, and their values."""

from __future__ import annotations

import builtins
from collections.abc import Callable
from typing import Any

import numpy as np

from particlesim.compiler.source import Source, source_of
from particlesim.compiler.unit import Unit
from particlesim.compiler.values import (
    ArrayForm,
    Number,
    TupleForm,
    Unsupported,
    form_of,
    joined,
    kinds_in,
    value_of,
)
from particlesim.compiler.writer import Block, Writer


class Cells:
    """A variable, or a result, that several assignments can reach: its form, and a place for every register."""

    def __init__(self, form: Any, places: list[tuple[str, str]]) -> None:
        self.form, self.places = form, places


class Lost:
    """What a name holds after a branch that may or may not have set it."""


class Names:
    """One call: its names, its result, and where the walk is."""

    def __init__(
        self,
        unit: Unit,
        writer: Writer,
        function: Callable[..., Any],
        arguments: list[Any],
        keywords: dict[str, Any],
        caller: Names | None = None,
    ) -> None:
        self.unit, self.w, self.function, self.caller = unit, writer, function, caller
        self.depth: int = caller.depth + 1 if caller else 0
        self.node: Any = None
        self.source: Source = source_of(function)
        unit.modules.add(function.__module__)
        self.names: dict[str, Any] = {}
        self.runtime = 0  # conditions and loops around, that only the machine decides
        self.loops: list[tuple[Block, Block]] = []
        self.exit: Block | None = None
        self.result: Any = None
        self._bind(arguments, keywords)

    @property
    def name(self) -> str:
        """The function's name, for messages."""
        return str(self.function.__name__)

    def _bind(self, arguments: list[Any], keywords: dict[str, Any]) -> None:
        code, defaults = self.function.__code__, self.function.__defaults__ or ()
        names = code.co_varnames[: code.co_argcount]
        given = dict(zip(names[len(names) - len(defaults) :], defaults, strict=True))
        given.update(zip(names, arguments, strict=False))
        given.update(keywords)
        if (
            len(arguments) > len(names)
            or set(given) != set(names)
            or code.co_flags & 12
            or code.co_kwonlyargcount
        ):
            raise Unsupported(f"{self.name} takes {', '.join(names) or 'nothing'}")
        for name in names:
            self.set(name, given[name])

    # Names

    def set(self, name: str, value: Any) -> None:
        """Assign to a name."""
        if name not in self.source.cells:
            self.names[name] = value
            return
        registers: list[Any] = []
        form = form_of(value, registers)
        if not registers:
            self.names[name] = value
            return
        cells = self.names.get(name)
        if not isinstance(cells, Cells) or (not self.runtime and cells.form != form):
            cells = self._cells((self.function.__code__, name, shape_of(form)), form)
        self._fill(cells, value, (self.function.__code__, name, shape_of(cells.form)))
        self.names[name] = cells

    def _cells(self, key: Any, form: Any) -> Cells:
        form = joined(self.unit.learned.get(key, form), form)
        return Cells(form, [(self.w.place(kind), kind) for kind in kinds_in(form)])

    def _fill(self, cells: Cells, value: Any, key: Any) -> None:
        """Write a value to the places of a variable; the variable gets wider places when it does not fit."""
        registers: list[Any] = []
        form = form_of(value, registers)
        both = joined(cells.form, form)
        if both != cells.form:
            self.unit.learn(key, both)
        for (place, kind), number in zip(cells.places, fitted(value, cells.form), strict=True):
            self.w.do(
                f"store {kind} {self.w.ref(number, kind) if kind != 'ptr' else number.ref}, ptr {place}"
            )

    def _read(self, cells: Cells) -> Any:
        registers = [Number(self.w.emit(f"load {kind}, ptr {place}"), kind) for place, kind in cells.places]
        return value_of(cells.form, iter(registers))

    def get(self, name: str) -> Any:
        """The value of a name: of the function, of what is around it, of its module, of Python."""
        if name in self.names:
            value = self.names[name]
            cls = value.__class__
            if cls is Lost:
                raise Unsupported(f"{name} is set in a branch that may not have run")
            return self._read(value) if cls is Cells else value
        code, closure = self.function.__code__, self.function.__closure__
        if closure and name in code.co_freevars:
            self.unit.nameless |= self.caller is not None
            return closure[code.co_freevars.index(name)].cell_contents
        if name in self.function.__globals__:
            value = self.function.__globals__[name]
            if isinstance(value, _NUMBERS):
                self.unit.numbers.add((self.function.__module__, name))
            return value
        if hasattr(builtins, name):
            return getattr(builtins, name)
        raise Unsupported(f"{name} is not set")


_NUMBERS = (float, int, np.number, np.bool_, str, np.ndarray, tuple)
"""What of a module's values is written into a kernel as it is."""


def same(a: Any, b: Any) -> bool:
    """Whether two values are known and equal."""
    registers: list[Any] = []
    return form_of(a, registers) == form_of(b, registers) and not registers


def merged(ways: list[dict[str, Any]]) -> dict[str, Any]:
    """Names after branches that come together: what differs is lost."""
    first, *others = ways
    merged = dict(first)
    for other in others:
        for name, value in other.items():
            if name not in merged:
                merged[name] = value if isinstance(value, Cells) else Lost()
            elif merged[name] is not value:
                known = not isinstance(merged[name], Lost | Cells) and not isinstance(value, Lost | Cells)
                merged[name] = value if known and same(merged[name], value) else Lost()
        for name in merged:
            if name not in other and not isinstance(merged[name], Cells):
                merged[name] = Lost()
    return merged


def shape_of(form: Any) -> Any:
    """A form without what may become wider."""
    if isinstance(form, str):
        return ""
    if isinstance(form, TupleForm):
        return (form[0], tuple(shape_of(each) for each in form[1]))
    return len(form)


def fitted(value: Any, form: Any) -> list[Any]:
    """The registers of a value for the places of a wider form: known lengths of arrays become registers."""
    if isinstance(form, ArrayForm):
        registers = [value.data]
        for numbers, known in ((value.lengths, form[1]), (value.strides, form[2])):
            registers += [n for n, k in zip(numbers, known, strict=True) if k is None]
        return registers
    if isinstance(form, TupleForm):
        return [n for part, each in zip(value, form[1], strict=True) for n in fitted(part, each)]
    return [value] if isinstance(form, str) else []
