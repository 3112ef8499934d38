"""Calls: by a rule of the compiler, to a separate function, or inlined."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, cast

from particlesim.compiler.names import Names
from particlesim.compiler.unit import Outline, Part, Unit, again
from particlesim.compiler.values import Array, Number, Unsupported, form_of, kinds_in, value_of
from particlesim.compiler.writer import RUN, Writer

DEEPEST = 200
"""Calls within calls; more are a recursion without end."""


_PARTS: dict[Any, Part] = {}
"""Functions with modules of their own that this process has written, by function, form of the arguments, whether indices
are looked at, and whether they compile quickly."""


@dataclass(frozen=True)
class Method:
    """A method of an array, on its way to being called."""

    array: Array
    name: str


@dataclass(frozen=True)
class Taken:
    """An argument of a function, its form, its registers with their kinds, and which of these lie in memory in a row."""

    value: Any
    form: Any
    registers: list[Any]
    kinds: list[str]
    runs: tuple[tuple[int, int], ...]

    def words(self, w: Writer, runs: tuple[tuple[int, int], ...], position: int) -> Iterator[str]:
        """How it is passed on, at a position: by the places of runs, and by the registers that are in none. It is put
        in memory for a run that is not there yet."""
        if runs and runs != self.runs:
            yield f"ptr {w.put(position, self.value, self.registers, self.runs)}"
            return
        for first, length in passed(len(self.kinds), runs):
            number, kind = self.registers[first], self.kinds[first]
            if length:
                yield f"ptr {w.stretch(number)}"
            else:
                yield f"{kind} {number.ref if kind == 'ptr' else w.ref(number, kind)}"

    def passed_in_memory(self) -> tuple[tuple[int, int], ...]:
        """The runs of what is passed quickly: all of it in a row if it is long. LLVM takes long for a call with hundreds of
        arguments, and no time for one with a few."""
        return ((0, len(self.kinds)),) if len(self.kinds) >= RUN else ()


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
        if self._is_called(function, arguments):
            return self._call_outlined(function, arguments)
        if hasattr(function, "__code__"):
            return self.inline(function, arguments, keywords)
        if any(isinstance(each, Number | Array) for each in (*arguments, *keywords.values())):
            raise Unsupported(
                f"{getattr(function, '__name__', function)!r} is not in the language of kernels"
            )
        return function(*arguments, **keywords)

    def _is_called(self, function: Any, arguments: list[Any]) -> bool:
        """Whether the kernel calls a function instead of holding its instructions."""
        if self.function is function:
            return False
        if getattr(function, "outlined", False):
            return True
        alike = self.w.fast or getattr(function, "exact", False)  # rounded as where it is by itself
        return bool(
            self.unit.quick
            and getattr(function, "often", False)
            and alike
            and not all(isinstance(each, int | float) for each in arguments)
        )

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
        shared = getattr(function, "shared", False)
        taken = [self._taken(each) for each in arguments]
        key = (
            function,
            tuple(each.form for each in taken),
            tuple(
                each.passed_in_memory() if self.unit.quick else () if shared else each.runs for each in taken
            ),
        )
        made = self.unit.outlines.get(key)
        if made is None:
            made = self._part(key) if shared or self.unit.quick else self._outlined(key)
            self.unit.outlines[key] = made
        w = self.w
        given = ", ".join(word for k, each in enumerate(taken) for word in each.words(w, key[2][k], k))
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

    def _taken(self, argument: Any) -> Taken:
        """What there is to know of an argument; tuples, which may be long, are looked at once in a function."""
        known = self.w.known.get(id(argument))
        if known is not None and known.value is argument:
            return known
        registers: list[Any] = []
        form = form_of(argument, registers)
        found = Taken(argument, form, registers, kinds_in(form), self.w.runs(registers))
        if isinstance(argument, tuple):
            self.w.known[id(argument)] = found
        return found

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
        made, body = again(lambda: self._written(key, unit))
        made.name = f'@"{key[0].__name__}.{unit.count}"'
        unit.bodies.append(_definition(made, body, "internal ", "noinline "))
        return made

    def _part(self, key: Any) -> Outline:
        """A function in a module of its own, which is the same for all units that call it.

        It is named by what is in it, so that kernels find this one and no other. It is written once in a process: other
        kernels take it as it is.
        """
        known = (key, self.unit.checked, self.unit.quick)
        part = _PARTS.get(known)
        if part is None:
            unit = Unit(checked=self.unit.checked, quick=self.unit.quick)
            made, body = again(lambda: self._written(key, unit))
            text = unit.module(_definition(made, body))
            made.name = f'@"{key[0].__name__}.{hashlib.sha256(text.encode()).hexdigest()[:16]}"'
            part = _PARTS[known] = unit.part(made, unit.module(_definition(made, body)))
        self.unit.take_in(part)
        return part.outline

    def _written(self, key: Any, unit: Unit) -> tuple[Outline, str]:
        """A function for arguments of one form, still without a name, and the text of its body."""
        function, forms, runs = key
        writer = Writer(unit.declared, unit.constants)
        if getattr(function, "exact", False):
            writer.fast = ""
        parameters: list[str] = []
        arguments = []
        for form, stretches in zip(forms, runs, strict=True):
            kinds, taken = kinds_in(form), []
            for first, length in passed(len(kinds), stretches):
                name = f"%a{len(parameters)}"
                parameters.append("ptr noalias readonly" if length else kinds[first])
                if length:
                    taken += writer.taken(name, kinds[first : first + length])
                else:
                    taken.append(Number(name, kinds[first]))
            arguments.append(value_of(form, iter(taken)))
        result = self.frame(writer, function, arguments, {}, unit).walk()
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
        return Outline("", shape, parameters, result_form), writer.text()


def passed(count: int, runs: tuple[tuple[int, int], ...]) -> list[tuple[int, int]]:
    """How registers of arguments are passed: the first of each, and how many lie in memory from there on, 0 for one that is
    passed by itself."""
    found, k, ahead = [], 0, dict(runs)
    while k < count:
        length = ahead.get(k, 0)
        found.append((k, length))
        k += length or 1
    return found


def _definition(made: Outline, body: str, linkage: str = "", more: str = "") -> str:
    parameters = ", ".join(f"{kind} %a{k}" for k, kind in enumerate(made.parameters))
    return f"define {linkage}{made.type} {made.name or '@shared'}({parameters}) {more}nounwind {{\n{body}\n}}"
