"""Calls: by a rule of the compiler, to a separate function, or inlined."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any, cast

from particlesim.compiler.names import Names
from particlesim.compiler.unit import Again, Outline, Part, Unit
from particlesim.compiler.values import Array, Number, Unsupported, form_of, kinds_in, value_of
from particlesim.compiler.writer import Writer

DEEPEST = 200
"""Calls within calls; more are a recursion without end."""


_PARTS: dict[Any, Part] = {}
"""Shared functions that this process has written, by function, form of the arguments, and whether indices are looked at."""


@dataclass(frozen=True)
class Method:
    """A method of an array, on its way to being called."""

    array: Array
    name: str


class Calls(Names):
    """A frame that can call."""

    def call(self, function: Any, arguments: list[Any], keywords: dict[str, Any]) -> Any:
        """The result of a call: by the compiler's own rule, by itself, or walked here."""
        from particlesim.compiler.builtin import RULES, array_method  # rules are written for frames

        if isinstance(function, Method):
            return array_method(cast(Any, self), function, *arguments)
        rule = RULES.get(function) if getattr(function, "__hash__", None) else None
        if rule is not None:
            return rule(self, *arguments, **keywords)
        if isinstance(function, type):
            return function(*arguments, **keywords)
        function = getattr(function, "python", function)
        if getattr(function, "outlined", False) and self.function is not function:
            return self._call_outlined(function, arguments)
        if hasattr(function, "__code__"):
            return self.inline(function, arguments, keywords)
        if any(isinstance(each, Number | Array) for each in (*arguments, *keywords.values())):
            raise Unsupported(
                f"{getattr(function, '__name__', function)!r} is not in the language of kernels"
            )
        return function(*arguments, **keywords)

    def inline(self, function: Any, arguments: list[Any], keywords: dict[str, Any]) -> Any:
        """The result of a function whose instructions are written here."""
        if self.depth >= DEEPEST:
            raise Unsupported(f"calls of {function.__name__} without end")
        fast = self.w.fast
        if getattr(function, "exact", False):
            self.w.fast = ""
        result = self.frame(self.w, function, arguments, keywords).walk()
        self.w.fast = fast
        return result

    def _call_outlined(self, function: Any, arguments: list[Any]) -> Any:
        registers: list[Any] = []
        form = form_of(tuple(arguments), registers)
        kinds = kinds_in(form)
        key = (function, form)
        made = self.unit.outlines.get(key)
        if made is None:
            made = self._shared(key) if getattr(function, "shared", False) else self._outlined(key)
            self.unit.outlines[key] = made
        w = self.w
        given = ", ".join(
            f"{kind} {w.ref(n, kind) if kind != 'ptr' else n.ref}"
            for n, kind in zip(registers, kinds, strict=True)
        )
        results = kinds_in(made.result)
        if not results:
            w.do(f"call void {made.name}({given})")
            return value_of(made.result, iter(()))
        got = w.emit(f"call {made.type} {made.name}({given})")
        if len(results) == 1:
            return value_of(made.result, iter([Number(got, results[0])]))
        parts = [
            Number(w.emit(f"extractvalue {made.type} {got}, {k}"), kind) for k, kind in enumerate(results)
        ]
        return value_of(made.result, iter(parts))

    def frame(
        self,
        writer: Writer,
        function: Any,
        arguments: list[Any],
        keywords: dict[str, Any],
        unit: Unit | None = None,
    ) -> Any:
        """The frame of a function that is called here, in this unit or another."""
        return type(self)(unit or self.unit, writer, function, arguments, keywords, self)

    def _outlined(self, key: Any) -> Outline:
        """A function of its own in this unit."""
        unit = self.unit
        unit.count += 1
        made, body = self._written(key, unit)
        made.name = f'@"{key[0].__name__}.{unit.count}"'
        unit.bodies.append(_definition(made, body, "internal ", "noinline "))
        return made

    def _shared(self, key: Any) -> Outline:
        """A function in a module of its own, which is the same for all units that call it.

        It is named by what is in it, so that kernels find this one and no other. It is written once in a process: walks that
        begin anew, and other kernels, take it as it is.
        """
        known = (key, self.unit.checked)
        part = _PARTS.get(known)
        if part is None:
            unit = Unit(checked=self.unit.checked)
            while True:
                try:
                    made, body = self._written(key, unit)
                    break
                except Again:
                    unit = unit.fresh()
            text = unit.module(_definition(made, body))
            made.name = f'@"{key[0].__name__}.{hashlib.sha256(text.encode()).hexdigest()[:16]}"'
            part = _PARTS[known] = Part(unit.module(_definition(made, body)), made, unit)
        self.unit.take_in(part)
        return part.outline

    def _written(self, key: Any, unit: Unit) -> tuple[Outline, str]:
        """A function for arguments of one form, still without a name, and the text of its body."""
        function, form = key
        writer = Writer(unit.declared, unit.constants)
        if getattr(function, "exact", False):
            writer.fast = ""
        kinds = kinds_in(form)
        arguments = value_of(form, iter([Number(f"%a{k}", kind) for k, kind in enumerate(kinds)]))
        result = self.frame(writer, function, list(arguments), {}, unit).walk()
        registers: list[Any] = []
        result_form = form_of(result, registers)
        results = kinds_in(result_form)
        values = [
            f"{kind} {number.ref if kind == 'ptr' else writer.ref(number, kind)}"
            for number, kind in zip(registers, results, strict=True)
        ]
        shape = "void"
        if not values:
            writer.finish("ret void")
        elif len(values) == 1:
            shape = results[0]
            writer.finish(f"ret {values[0]}")
        else:
            shape = "{ " + ", ".join(results) + " }"
            whole = "undef"
            for k, value in enumerate(values):
                whole = writer.emit(f"insertvalue {shape} {whole}, {value}, {k}")
            writer.finish(f"ret {shape} {whole}")
        return Outline("", shape, kinds, result_form), writer.text()


def _definition(made: Outline, body: str, linkage: str = "", more: str = "") -> str:
    parameters = ", ".join(f"{kind} %a{k}" for k, kind in enumerate(made.parameters))
    return f"define {linkage}{made.type} {made.name or '@shared'}({parameters}) {more}nounwind {{\n{body}\n}}"
