"""Walks the syntax tree of a function and writes its instructions.

What is known while walking is decided in Python: tuples and their parts, None, types, functions, dictionaries, numbers of
the source. An `if` whose test is known walks one branch only, a loop over a tuple is walked once for each part. What is not
known becomes instructions. Calls of Python functions are walked in place, unless they are marked `@outlined`.
"""

from __future__ import annotations

import ast
import builtins
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from particlesim.compiler.source import Source, source_of
from particlesim.compiler.values import (
    FLOATS,
    Array,
    ArrayForm,
    Number,
    TupleForm,
    Unsupported,
    form_of,
    is_number,
    joined,
    kind_of,
    kinds_in,
    value_of,
    wider,
    words,
)
from particlesim.compiler.writer import FOLDED, Block, Writer

DEEPEST = 200
"""Calls within calls; more are a recursion without end."""


class Again(Exception):
    """What was found while walking changes what was written before: the walk begins anew, with it in `Unit.learned`."""


class CompileError(Exception):
    """A kernel that cannot be compiled: the reason, and the places in files that led there, innermost first."""

    def __init__(self, reason: str, places: list[tuple[str, int, int, str]]) -> None:
        self.reason, self.places = reason, places
        super().__init__(reason)

    def __str__(self) -> str:
        import linecache

        file, line, column, name = self.places[0]
        text = linecache.getline(file, line).rstrip()
        lines = [f"{file}:{line}:{column + 1}: in {name}: {self.reason}", f"    {text}", "    " + " " * column + "^"]
        lines += [f"  called from {name} at {file}:{line}" for file, line, _, name in self.places[1:]]
        return "\n".join(lines)


@dataclass
class Outline:
    """A function compiled by itself: its LLVM name and the form of its result."""

    name: str
    result: Any


@dataclass
class Unit:
    """All that is compiled together: one kernel, with the functions that it calls by themselves."""

    declared: dict[str, str] = field(default_factory=dict)
    constants: dict[str, str] = field(default_factory=dict)
    bodies: list[str] = field(default_factory=list)
    outlines: dict[Any, Outline] = field(default_factory=dict)
    learned: dict[Any, Any] = field(default_factory=dict)
    modules: set[str] = field(default_factory=set)
    numbers: set[tuple[str, str]] = field(default_factory=set)
    nameless: bool = False  # functions took something from around them, that no name tells to other processes

    def learn(self, key: Any, value: Any) -> None:
        """Remember for the next walk, and begin it."""
        self.learned[key] = value
        raise Again

    def fresh(self) -> Unit:
        """The same with nothing written yet."""
        return Unit(learned=self.learned)


class Cells:
    """A variable, or a result, that several assignments can reach: its form, and a place for every register."""

    def __init__(self, form: Any, places: list[tuple[str, str]]) -> None:
        self.form, self.places = form, places


class Lost:
    """What a name holds after a branch that may or may not have set it."""


class Sequence(tuple):  # type: ignore[type-arg]
    """The turns of a `for` over `range`: start, stop, step."""


@dataclass(frozen=True)
class Method:
    """A method of an array, on its way to being called."""

    array: Array
    name: str


class Frame:
    """One call: its names, its result, and where the walk is."""

    def __init__(
        self,
        unit: Unit,
        writer: Writer,
        function: Callable[..., Any],
        arguments: list[Any],
        keywords: dict[str, Any],
        caller: Frame | None = None,
    ) -> None:
        self.unit, self.w, self.function, self.caller = unit, writer, function, caller
        self.depth = caller.depth + 1 if caller else 0
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
        return str(self.function.__name__)

    def _bind(self, arguments: list[Any], keywords: dict[str, Any]) -> None:
        code, defaults = self.function.__code__, self.function.__defaults__ or ()
        names = code.co_varnames[: code.co_argcount]
        given = dict(zip(names[len(names) - len(defaults) :], defaults, strict=True))
        given.update(zip(names, arguments, strict=False))
        given.update(keywords)
        if len(arguments) > len(names) or set(given) != set(names) or code.co_flags & 12 or code.co_kwonlyargcount:
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
            cells = self._cells((self.function.__code__, name, _shape(form)), form)
        self._fill(cells, value, (self.function.__code__, name, _shape(cells.form)))
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
        for (place, kind), number in zip(cells.places, _fitted(value, cells.form), strict=True):
            self.w.do(f"store {kind} {self.w.ref(number, kind) if kind != 'ptr' else number.ref}, ptr {place}")

    def _read(self, cells: Cells) -> Any:
        registers = [Number(self.w.emit(f"load {kind}, ptr {place}"), kind) for place, kind in cells.places]
        return value_of(cells.form, iter(registers))

    def get(self, name: str) -> Any:
        """The value of a name: of the function, of what is around it, of its module, of Python."""
        if name in self.names:
            value = self.names[name]
            if isinstance(value, Lost):
                raise Unsupported(f"{name} is set in a branch that may not have run")
            return self._read(value) if isinstance(value, Cells) else value
        code, closure = self.function.__code__, self.function.__closure__
        if closure and name in code.co_freevars:
            self.unit.nameless |= self.caller is not None
            return closure[code.co_freevars.index(name)].cell_contents
        if name in self.function.__globals__:
            value = self.function.__globals__[name]
            if is_number(value) or isinstance(value, str | np.ndarray | tuple):
                self.unit.numbers.add((self.function.__module__, name))
            return value
        if hasattr(builtins, name):
            return getattr(builtins, name)
        raise Unsupported(f"{name} is not set")

    # Statements

    def run(self) -> Any:
        """Walk the function; its result."""
        tree = self.source.tree
        if isinstance(tree, ast.Lambda):
            return self.eval(tree.body)
        ended = self.body(tree.body)
        if self.exit is None:
            return self.result
        if not ended:
            self._leave(None)
        self.w.at = self.exit
        return self._read(self.result) if isinstance(self.result, Cells) else self.result

    def body(self, statements: list[Any]) -> bool:
        """Walk statements; whether nothing after them is reached."""
        for each in statements:  # no any(): calls through C take room on the stack of the thread
            if self.statement(each):
                return True
        return False

    def statement(self, node: Any) -> bool:
        """Walk a statement; whether nothing after it is reached."""
        before, self.node = self.node, node
        method = getattr(self, f"_{type(node).__name__}", None)
        if method is None:
            raise Unsupported(f"{type(node).__name__} is not in the language of kernels")
        ended = bool(method(node))
        self.node = before
        return ended

    def _Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.eval(node.value)

    def _Pass(self, node: ast.Pass) -> None:
        pass

    def _Assert(self, node: ast.Assert) -> None:
        """Assertions hold for plain Python; known ones here too."""
        test = self.eval(node.test)
        if not isinstance(test, Number) and not test:
            raise Unsupported("an assertion fails" + (f": {self.eval(node.msg)}" if node.msg else ""))

    def _Raise(self, node: ast.Raise) -> None:
        if self.runtime:
            raise Unsupported("kernels cannot raise; return what is wrong")
        error = self.eval(node.exc)
        raise Unsupported(f"{type(error).__name__}: {error}")

    def _Assign(self, node: ast.Assign) -> None:
        value = self.eval(node.value)
        for target in node.targets:
            self.assign(target, value)

    def _AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.assign(node.target, self.eval(node.value))

    def _AugAssign(self, node: ast.AugAssign) -> None:
        target = node.target
        if isinstance(target, ast.Subscript):
            array, index = self.eval(target.value), self.eval(target.slice)
            value = self.binary(type(node.op).__name__, self.item(array, index), self.eval(node.value))
            self.set_item(array, index, value)
            return
        assert isinstance(target, ast.Name)
        self.set(target.id, self.binary(type(node.op).__name__, self.get(target.id), self.eval(node.value)))

    def assign(self, target: Any, value: Any) -> None:
        """Assign to a name, to an element, or part by part to a tuple of them."""
        match target:
            case ast.Name():
                self.set(target.id, value)
            case ast.Tuple() | ast.List():
                if not isinstance(value, tuple) or len(value) != len(target.elts):
                    raise Unsupported(f"{len(target.elts)} names for {words(form_of(value, []))}")
                for one, part in zip(target.elts, value, strict=True):
                    self.assign(one, part)
            case ast.Subscript():
                self.set_item(self.eval(target.value), self.eval(target.slice), value)
            case _:
                raise Unsupported("kernels assign to names and to elements of arrays")

    def _If(self, node: ast.If) -> bool:
        test = self.condition(node.test)
        if not isinstance(test, Number):
            return self.body(node.body if test else node.orelse)
        w = self.w
        yes, no, after = w.block("then"), w.block("else"), w.block("after")
        w.fork(test, yes, no)
        before, made = self.names, {}
        reached = []
        for block, part in ((yes, node.body), (no, node.orelse)):
            w.at = block
            self.names = {**before, **made}
            self.runtime += 1
            ended = self.body(part)
            self.runtime -= 1
            w.branch(after)
            made = {name: value for name, value in self.names.items() if isinstance(value, Cells)}
            if not ended:
                reached.append(self.names)
        w.at = after
        self.names = _merged(reached) if reached else before
        return not reached

    def _While(self, node: ast.While) -> bool:
        w = self.w
        head, inside, after = w.block("while"), w.block("turn"), w.block("after")
        w.branch(head)
        w.at = head
        self.runtime += 1
        before = dict(self.names)
        test = self.condition(node.test)
        if isinstance(test, Number):
            w.fork(test, inside, after)
        else:
            w.branch(inside if test else after)
        self.loops.append((head, after))
        w.at = inside
        self.body(node.body)
        w.branch(head)
        self.loops.pop()
        self.runtime -= 1
        self._after_loop(before)
        w.at = after
        return test is True and not any(isinstance(each, ast.Break) for each in ast.walk(node))

    def _For(self, node: ast.For) -> None:
        over = self.eval(node.iter)
        if isinstance(over, Sequence):
            key = (self.function.__code__, node.lineno, node.col_offset)
            if key not in self.unit.learned:
                self._count(node, over, key)
                return
            over = tuple(range(*over))
        _check_known(over)
        after = self.w.block("after")
        for part in over:
            following = self.w.block("next")
            self.assign(node.target, part)
            self.loops.append((following, after))
            ended = self.body(node.body)
            self.loops.pop()
            if not ended:
                self.w.branch(following)
            self.w.at = following
        self.w.branch(after)
        self.w.at = after

    def _count(self, node: ast.For, over: Sequence, key: Any) -> None:
        """A loop that the machine counts."""
        w = self.w
        start, stop, step = over
        if isinstance(step, Number):
            up = True  # documented: a step that is not known is positive
        else:
            up = step > 0
        counter = w.place("i64")
        if not isinstance(target := node.target, ast.Name):
            raise Unsupported("one name counts")
        stop_ref, step_ref = w.whole(stop), w.whole(step)
        w.do(f"store i64 {w.whole(start)}, ptr {counter}")
        head, inside, following, after = (w.block(name) for name in ("for", "turn", "next", "after"))
        w.branch(head)
        w.at = head
        turn = Number(w.emit(f"load i64, ptr {counter}"), "i64")
        w.fork(Number(w.emit(f"icmp {'slt' if up else 'sgt'} i64 {turn.ref}, {stop_ref}"), "i1"), inside, after)
        w.at = inside
        before = dict(self.names)
        self.runtime += 1
        self.loops.append((following, after))
        self.set(target.id, turn)
        try:
            self.body(node.body)
        except _NeedsKnown as need:
            if need.number is turn and all(isinstance(each, int) for each in over):
                self.unit.learn(key, True)
            raise
        self.loops.pop()
        self.runtime -= 1
        w.branch(following)
        w.at = following
        w.do(f"store i64 {w.emit(f'add nsw i64 {turn.ref}, {step_ref}')}, ptr {counter}")
        w.branch(head)
        self._after_loop(before)
        w.at = after

    def _after_loop(self, before: dict[str, Any]) -> None:
        """Names that a loop has set are lost after it, but for those that have places of their own."""
        for name, value in self.names.items():
            old = before.get(name)
            if value is old or isinstance(value, Cells):
                continue
            if name in before and name in self.source.cells and not isinstance(old, Lost) and not _same(old, value):
                raise Unsupported(f"{name} becomes something else in a loop")
            self.names[name] = value if name in before and _same(old, value) else Lost()

    def _Break(self, node: ast.Break) -> bool:
        self.w.branch(self.loops[-1][1])
        return True

    def _Continue(self, node: ast.Continue) -> bool:
        self.w.branch(self.loops[-1][0])
        return True

    def _Return(self, node: ast.Return) -> bool:
        value = self.eval(node.value) if node.value else None
        if not self.runtime and self.exit is None:
            self.result = value
        else:
            self._leave(value)
        return True

    def _leave(self, value: Any) -> None:
        """Return from within a branch or a loop, or after one that may have returned."""
        if self.w.at.ended:
            return
        registers: list[Any] = []
        form = form_of(value, registers)
        key = (self.function.__code__, "return", _shape(form))
        if self.exit is None:
            self.exit = self.w.block("exit")
            self.result = self._cells(key, form)
        self._fill(self.result, value, (self.function.__code__, "return", _shape(self.result.form)))
        self.w.branch(self.exit)

    # Expressions

    def eval(self, node: Any) -> Any:
        """The value of an expression."""
        method = getattr(self, f"_{type(node).__name__}", None)
        if method is None:
            raise Unsupported(f"{type(node).__name__} is not in the language of kernels")
        if isinstance(node, ast.Constant | ast.Name | ast.Attribute):
            return method(node)
        before, self.node = self.node, node
        value = method(node)
        self.node = before
        return value

    def condition(self, node: Any) -> Any:
        """A truth value, known or in a register."""
        value = self.eval(node)
        if isinstance(value, Number):
            return self.w.truth(value)
        if isinstance(value, Array):
            raise Unsupported("an array is neither true nor false")
        return bool(value)

    def _Constant(self, node: ast.Constant) -> Any:
        return node.value

    def _JoinedStr(self, node: ast.JoinedStr) -> str:
        parts = (each.value if isinstance(each, ast.Constant) else self.eval(each.value) for each in node.values)  # type: ignore[attr-defined]
        return "".join(str(each) for each in parts)

    def _Name(self, node: ast.Name) -> Any:
        return self.get(node.id)

    def _Tuple(self, node: ast.Tuple) -> Any:
        values: list[Any] = []
        for each in node.elts:
            if isinstance(each, ast.Starred):
                values += self.eval(each.value)
            else:
                values.append(self.eval(each))
        return tuple(values)

    _List = _Tuple

    def _Dict(self, node: ast.Dict) -> Any:
        return {self.eval(key): self.eval(value) for key, value in zip(node.keys, node.values, strict=True)}

    def _Slice(self, node: ast.Slice) -> slice:
        if node.step is not None:
            raise Unsupported("slices without a step")
        return slice(*(None if each is None else self.eval(each) for each in (node.lower, node.upper)))

    def _Attribute(self, node: ast.Attribute) -> Any:
        value = self.eval(node.value)
        if isinstance(value, Array):
            match node.attr:
                case "size":
                    total = value.lengths[0]
                    for length in value.lengths[1:]:
                        total = self.w.binary("Mult", total, length)
                    return total
                case "shape":
                    return value.lengths
                case "ndim" | "dtype":
                    return getattr(value, node.attr)
            return Method(value, node.attr)
        if isinstance(value, Number) and node.attr != "dtype":
            raise Unsupported(f"a number has no {node.attr}")
        try:
            return getattr(value, node.attr)
        except AttributeError as error:
            raise Unsupported(str(error)) from None

    def _Subscript(self, node: ast.Subscript) -> Any:
        return self.item(self.eval(node.value), self.eval(node.slice))

    def _BinOp(self, node: ast.BinOp) -> Any:
        return self.binary(type(node.op).__name__, self.eval(node.left), self.eval(node.right))

    def binary(self, name: str, a: Any, b: Any) -> Any:
        """An operation on two values."""
        if is_number(a) and is_number(b):
            if name == "Pow" and (isinstance(a, Number) or isinstance(b, Number)):
                if type(b) is not int or abs(b) > 64:
                    return self.call(pow, [a, b], {})
            if name == "Mod" and wider(kind_of(a), kind_of(b)) in FLOATS:
                return self.call(np.mod, [a, b], {})
            return self.w.binary(name, a, b)
        if isinstance(a, tuple) and isinstance(b, tuple) and name == "Add":
            return (*a, *b)
        if isinstance(a, tuple) and isinstance(b, int) and name == "Mult":
            return a * b
        if any(isinstance(each, Array | Number | tuple) or each is None for each in (a, b)):
            raise Unsupported(f"{name} of {words(form_of(a, []))} and {words(form_of(b, []))}")
        return FOLDED[name](a, b)

    def _UnaryOp(self, node: ast.UnaryOp) -> Any:
        if isinstance(node.op, ast.Not):
            value = self.condition(node.operand)
            if isinstance(value, Number):
                return Number(self.w.emit(f"xor i1 {value.ref}, true"), "i1")
            return not value
        value = self.eval(node.operand)
        if not is_number(value):
            raise Unsupported("a sign belongs to a number")
        match node.op:
            case ast.USub():
                return self.w.negative(value)
            case ast.UAdd():
                return value
        return self.w.binary("BitXor", value, -1)

    def _Compare(self, node: ast.Compare) -> Any:
        left, result = self.eval(node.left), True
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            right = self.eval(right_node)
            one = self._compared(op, left, right)
            if isinstance(one, Number) and isinstance(result, Number):
                result = self.w.binary("BitAnd", result, one)
            elif isinstance(one, Number):
                result = one if result else False
            elif not one:
                result = False
            left = right
        return result

    def _compared(self, op: Any, left: Any, right: Any) -> Any:
        match op:
            case ast.Is():
                return left is right
            case ast.IsNot():
                return left is not right
            case ast.In():
                return left in right
            case ast.NotIn():
                return left not in right
        if is_number(left) and is_number(right):
            return self.w.binary(type(op).__name__, left, right)
        registers: list[Any] = []
        form_of((left, right), registers)
        if any(isinstance(each, Number) for each in registers):
            raise Unsupported("only numbers are compared while a kernel runs")
        return left == right if isinstance(op, ast.Eq) else left != right

    def _BoolOp(self, node: ast.BoolOp) -> Any:
        """Later parts are only looked at where the earlier ones leave the result open, as in Python."""
        w, stops = self.w, isinstance(node.op, ast.Or)
        done: Block | None = None
        place = ""
        for each in node.values:
            value = self.condition(each)
            last = each is node.values[-1]
            if not isinstance(value, Number):
                if value is stops or last:
                    if done is None:
                        return value
                    w.do(f"store i1 {w.ref(value)}, ptr {place}")
                    break
                continue
            if last and done is None:
                return value
            if done is None:
                done, place = w.block("known"), w.place("i1")
            w.do(f"store i1 {value.ref}, ptr {place}")
            if not last:
                more = w.block("more")
                w.fork(value, *((done, more) if stops else (more, done)))
                w.at = more
        if done is None:
            return not stops
        w.branch(done)
        w.at = done
        return Number(w.emit(f"load i1, ptr {place}"), "i1")

    def _IfExp(self, node: ast.IfExp) -> Any:
        test = self.condition(node.test)
        if not isinstance(test, Number):
            return self.eval(node.body if test else node.orelse)
        w = self.w
        yes, no, after = w.block("then"), w.block("else"), w.block("after")
        origin = w.at
        self.runtime += 1
        ends = []
        for block, part in ((yes, node.body), (no, node.orelse)):
            w.at = block
            value = self.eval(part)
            ends.append((value, w.at))
        self.runtime -= 1
        (a, end_a), (b, end_b) = ends
        form = joined(form_of(a, []), form_of(b, []))
        if end_a is yes and end_b is no and not yes.lines and not no.lines and "ptr" not in kinds_in(form):
            for block in (yes, no, after):
                w.blocks.remove(block)
            w.at = origin
            chosen = (w.choose(test, x, y) for x, y in zip(_fitted(a, form), _fitted(b, form), strict=True))
            return value_of(form, chosen)
        w.at = origin
        w.fork(test, yes, no)
        sides = []
        for value, end in ends:
            w.at = end
            numbers = [w.ref(n, k) if k != "ptr" else n.ref for n, k in zip(_fitted(value, form), kinds_in(form), strict=True)]
            sides.append((numbers, end.label))
            w.branch(after)
        w.at = after
        registers = [
            Number(w.emit(f"phi {kind} [{x}, %{sides[0][1]}], [{y}, %{sides[1][1]}]"), kind)
            for kind, x, y in zip(kinds_in(form), sides[0][0], sides[1][0], strict=True)
        ]
        return value_of(form, iter(registers))

    def _GeneratorExp(self, node: ast.GeneratorExp) -> Any:
        (one,) = node.generators
        over = self.eval(one.iter)
        if isinstance(over, Sequence):
            over = tuple(range(*over))
        _check_known(over)
        outer = dict(self.names)
        values = []
        for part in over:
            _unpack(self.names, one.target, part)
            if all(self.eval(test) for test in one.ifs):
                values.append(self.eval(node.elt))
        self.names = outer
        return tuple(values)

    _ListComp = _GeneratorExp

    def _Call(self, node: ast.Call) -> Any:
        function = self.eval(node.func)
        arguments: list[Any] = []
        for each in node.args:
            if isinstance(each, ast.Starred):
                arguments += self.eval(each.value)
            else:
                arguments.append(self.eval(each))
        keywords = {str(each.arg): self.eval(each.value) for each in node.keywords}
        return self.call(function, arguments, keywords)

    def call(self, function: Any, arguments: list[Any], keywords: dict[str, Any]) -> Any:
        """The result of a call: by the compiler's own rule, by itself, or walked here."""
        from particlesim.compiler.builtin import RULES, array_method

        if isinstance(function, Method):
            return array_method(self, function, *arguments)
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
            raise Unsupported(f"{getattr(function, '__name__', function)!r} is not in the language of kernels")
        return function(*arguments, **keywords)

    def inline(self, function: Any, arguments: list[Any], keywords: dict[str, Any]) -> Any:
        """The result of a function whose instructions are written here."""
        if self.depth >= DEEPEST:
            raise Unsupported(f"calls of {function.__name__} without end")
        fast = self.w.fast
        if getattr(function, "exact", False):
            self.w.fast = ""
        result = Frame(self.unit, self.w, function, arguments, keywords, self).walk()
        self.w.fast = fast
        return result

    def _call_outlined(self, function: Any, arguments: list[Any]) -> Any:
        registers: list[Any] = []
        form = form_of(tuple(arguments), registers)
        kinds = kinds_in(form)
        key = (function, form)
        made = self.unit.outlines.get(key)
        if made is None:
            made = compile_outlined(self.unit, function, form, self)
            self.unit.outlines[key] = made
        w = self.w
        given = ", ".join(f"{kind} {w.ref(n, kind) if kind != 'ptr' else n.ref}" for n, kind in zip(registers, kinds, strict=True))
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

    def walk(self) -> Any:
        """`run`, with the places of errors."""
        try:
            return self.run()
        except Unsupported as error:
            raise CompileError(str(error), [self.where()]) from error
        except CompileError as error:
            error.places.append(self.where())
            raise

    def where(self) -> tuple[str, int, int, str]:
        """The place that is walked: file, line, column, function."""
        node = self.node or self.source.tree
        return self.source.file, node.lineno, node.col_offset, self.name

    # Elements

    def item(self, value: Any, index: Any) -> Any:
        """`value[index]`."""
        if isinstance(value, np.ndarray):
            value = self.w.fixed(value)
        if not isinstance(value, Array):
            if isinstance(index, Number):
                raise _NeedsKnown(index)
            try:
                return value[index]
            except (IndexError, KeyError, TypeError) as error:
                raise Unsupported(f"{type(error).__name__}: {error}") from None
        view = self.view(value, index)
        if isinstance(view, Array):
            return view
        return self.w.load(value, view)

    def view(self, array: Array, index: Any) -> Any:
        """The part of an array that an index means, or the list of indices when that is one element."""
        indices = list(index) if isinstance(index, tuple) else [index]
        if len(indices) > array.ndim:
            raise Unsupported(f"{len(indices)} indices for {words(form_of(array, []))}")
        if len(indices) == array.ndim and not any(isinstance(each, slice) for each in indices):
            return indices
        w = self.w
        starts, lengths, strides = [], [], []
        indices += [slice(None)] * (array.ndim - len(indices))
        for each, length, stride in zip(indices, array.lengths, array.strides, strict=True):
            if not isinstance(each, slice):
                starts.append(each)
                continue
            start = self._border(each.start, length, 0)
            stop = self._border(each.stop, length, length)
            starts.append(start)
            size = stop if not isinstance(start, Number) and start == 0 else w.binary("Sub", stop, start)
            whole = each.start is None or each.stop is None
            lengths.append(size if whole else w.extreme("Gt", [size, 0]))
            strides.append(stride)
        return Array(w.offset(array, starts), array.element, tuple(lengths), tuple(strides))

    def _border(self, value: Any, length: Any, default: Any) -> Any:
        """A border of a slice: within the array, as in Python."""
        if value is None:
            return default
        if not isinstance(value, Number):
            if value == 0:
                return 0
            if value < 0:
                return self.w.extreme("Gt", [self.w.binary("Add", length, value), 0])
        return self.w.extreme("Lt", [value, length])

    def set_item(self, array: Any, index: Any, value: Any) -> None:
        """`array[index] = value`; a number fills a part, an array is copied element by element."""
        if not isinstance(array, Array):
            raise Unsupported("only elements of arrays can be set")
        target = self.view(array, index)
        if not isinstance(target, Array):
            if not is_number(value):
                raise Unsupported(f"an element cannot hold {words(form_of(value, []))}")
            self.w.store(array, target, value)
            return
        self._copy(target, value, [])

    def _copy(self, target: Array, value: Any, indices: list[Any]) -> None:
        axis = len(indices)
        if axis == target.ndim:
            self.w.store(target, indices, self.w.load(value, indices[-value.ndim :]) if isinstance(value, Array) else value)
            return
        for turn in self.counted(target.lengths[axis]):
            self._copy(target, value, [*indices, turn])

    def counted(self, length: Any) -> Iterator[Number]:
        """A loop of the machine from 0 to a length; what the caller writes in its one turn here is the body."""
        w = self.w
        counter = w.place("i64")
        w.do(f"store i64 0, ptr {counter}")
        head, inside, after = (w.block(name) for name in ("fill", "turn", "after"))
        w.branch(head)
        w.at = head
        turn = Number(w.emit(f"load i64, ptr {counter}"), "i64")
        w.fork(w.binary("Lt", turn, length), inside, after)
        w.at = inside
        yield turn
        w.do(f"store i64 {w.emit(f'add nsw i64 {turn.ref}, 1')}, ptr {counter}")
        w.branch(head)
        w.at = after


class _NeedsKnown(Unsupported):
    """A part of a tuple was asked for by a number that only the machine knows."""

    def __init__(self, number: Number) -> None:
        self.number = number
        super().__init__("a part of a tuple is chosen by a number that is only known when the kernel runs")


def _check_known(over: Any) -> None:
    if isinstance(over, Number | Array) or not hasattr(over, "__iter__"):
        raise Unsupported("a loop goes over a range, or over what is known, such as a tuple")


def _same(a: Any, b: Any) -> bool:
    """Whether two values are known and equal."""
    registers: list[Any] = []
    return form_of(a, registers) == form_of(b, registers) and not registers


def _merged(ways: list[dict[str, Any]]) -> dict[str, Any]:
    """Names after branches that come together: what differs is lost."""
    first, *others = ways
    merged = dict(first)
    for other in others:
        for name, value in other.items():
            if name not in merged:
                merged[name] = value if isinstance(value, Cells) else Lost()
            elif merged[name] is not value:
                known = not isinstance(merged[name], Lost | Cells) and not isinstance(value, Lost | Cells)
                merged[name] = value if known and _same(merged[name], value) else Lost()
        for name in merged:
            if name not in other and not isinstance(merged[name], Cells):
                merged[name] = Lost()
    return merged


def _unpack(names: dict[str, Any], target: Any, value: Any) -> None:
    if isinstance(target, ast.Name):
        names[target.id] = value
    else:
        for one, part in zip(target.elts, value, strict=True):
            _unpack(names, one, part)


def _shape(form: Any) -> Any:
    """A form without what may become wider."""
    if isinstance(form, str):
        return ""
    if isinstance(form, TupleForm):
        return (form[0], tuple(_shape(each) for each in form[1]))
    return len(form)


def _fitted(value: Any, form: Any) -> list[Any]:
    """The registers of a value for the places of a wider form: known lengths of arrays become registers."""
    if isinstance(form, ArrayForm):
        registers = [value.data]
        for numbers, known in ((value.lengths, form[1]), (value.strides, form[2])):
            registers += [n for n, k in zip(numbers, known, strict=True) if k is None]
        return registers
    if isinstance(form, TupleForm):
        return [n for part, each in zip(value, form[1], strict=True) for n in _fitted(part, each)]
    return [value] if isinstance(form, str) else []


def compile_outlined(unit: Unit, function: Any, form: Any, caller: Frame | None) -> Outline:
    """A function of its own for arguments of one form."""
    name = f"{function.__name__}.{len(unit.outlines)}.{len(unit.bodies)}"
    writer = Writer(unit.declared, unit.constants)
    kinds = kinds_in(form)
    arguments = value_of(form, iter([Number(f"%a{k}", kind) for k, kind in enumerate(kinds)]))
    frame = Frame(unit, writer, function, list(arguments), {}, caller)
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
            made = writer.emit(f"insertvalue {shape} {made}, {kind} {_operand(writer, number, kind)}, {k}")
        writer.finish(f"ret {shape} {made}")
    parameters = ", ".join(f"{kind} %a{k}" for k, kind in enumerate(kinds))
    unit.bodies.append(f"define internal {shape} @{name}({parameters}) noinline nounwind {{\n{writer.text()}\n}}")
    return Outline(name, result_form)


def _operand(writer: Writer, number: Any, kind: str) -> str:
    return number.ref if kind == "ptr" else writer.ref(number, kind)

