"""Calls: by a rule of the compiler, as a function of its own, or with the instructions written in place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

from particlesim.compiler.names import Names
from particlesim.compiler.unit import Outline
from particlesim.compiler.values import Array, Number, Unsupported, form_of, kinds_in, value_of
from particlesim.compiler.writer import Writer

DEEPEST = 200
"""Calls within calls; more are a recursion without end."""


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
            made = self._outline(function, form)
            self.unit.outlines[key] = made
        w = self.w
        given = ", ".join(
            f"{kind} {w.ref(n, kind) if kind != 'ptr' else n.ref}"
            for n, kind in zip(registers, kinds, strict=True)
        )
        results = kinds_in(made.result)
        if not results:
            w.do(f"call void @{made.name}({given})")
            return value_of(made.result, iter(()))
        shape = results[0] if len(results) == 1 else "{ " + ", ".join(results) + " }"
        got = w.emit(f"call {shape} @{made.name}({given})")
        if len(results) == 1:
            return value_of(made.result, iter([Number(got, results[0])]))
        parts = [Number(w.emit(f"extractvalue {shape} {got}, {k}"), kind) for k, kind in enumerate(results)]
        return value_of(made.result, iter(parts))

    def frame(self, writer: Writer, function: Any, arguments: list[Any], keywords: dict[str, Any]) -> Any:
        """The frame of a function that is called here."""
        return type(self)(self.unit, writer, function, arguments, keywords, self)

    def _outline(self, function: Any, form: Any) -> Outline:
        """A function of its own for arguments of one form."""
        unit = self.unit
        unit.count += 1
        name = f'"{function.__name__}.{unit.count}"'
        writer = Writer(unit.declared, unit.constants)
        kinds = kinds_in(form)
        arguments = value_of(form, iter([Number(f"%a{k}", kind) for k, kind in enumerate(kinds)]))
        frame = self.frame(writer, function, list(arguments), {})
        if getattr(function, "exact", False):
            writer.fast = ""
        result = frame.walk()
        registers: list[Any] = []
        result_form = form_of(result, registers)
        results = kinds_in(result_form)
        shape = "void"
        if not results:
            writer.finish("ret void")
        elif len(results) == 1:
            shape = results[0]
            writer.finish(f"ret {shape} {_operand(writer, registers[0], shape)}")
        else:
            shape = "{ " + ", ".join(results) + " }"
            made = "undef"
            for k, (number, kind) in enumerate(zip(registers, results, strict=True)):
                made = writer.emit(
                    f"insertvalue {shape} {made}, {kind} {_operand(writer, number, kind)}, {k}"
                )
            writer.finish(f"ret {shape} {made}")
        parameters = ", ".join(f"{kind} %a{k}" for k, kind in enumerate(kinds))
        unit.bodies.append(
            f"define internal {shape} @{name}({parameters}) noinline nounwind {{\n{writer.text()}\n}}"
        )
        return Outline(name, result_form)


def _operand(writer: Writer, number: Any, kind: str) -> str:
    return str(number.ref) if kind == "ptr" else writer.ref(number, kind)
