"""Expressions: values known while compiling are computed, all others become instructions."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from typing import Any, cast

import numpy as np

from particlesim.compiler import bounds
from particlesim.compiler.calls import Calls, Method
from particlesim.compiler.names import fitted
from particlesim.compiler.values import (
    FLOATS,
    Array,
    Number,
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
from particlesim.compiler.writer import FOLDED, Block

LARGEST_POWER = 64
"""Exponents up to this, if known and whole, become products."""


class Sequence(tuple):  # type: ignore[type-arg]
    """The turns of a `for` over `range`: start, stop, step."""


class Lanes(Sequence):
    """The turns of a `for` over `lanes`, and how many vectors are worked on at a time."""

    abreast: int = 1


class NeedsKnown(Unsupported):
    """A part of a tuple was asked for by a number that only the machine knows."""

    def __init__(self, number: Number) -> None:
        self.number = number
        super().__init__("a part of a tuple is chosen by a number that is only known when the kernel runs")


METHODS: dict[type, Callable[[Any, Any], Any]] = {}
"""How frames walk the nodes of a class, of those that came already."""


class Expressions(Calls):
    """A frame that can compute."""

    def eval(self, node: Any) -> Any:
        """The value of an expression."""
        kind = type(node)
        if kind is ast.Name:
            return self.get(node.id)
        if kind is ast.Constant:
            return node.value
        method = METHODS.get(kind) or self.method(kind)
        if kind is ast.Attribute:
            return method(self, node)
        before, self.node = self.node, node
        value = method(self, node)
        self.node = before
        return value

    def method(self, kind: type) -> Callable[[Any, Any], Any]:
        """How frames walk the nodes of a class. Raises Unsupported for what is not in the language."""
        found: Callable[[Any, Any], Any] | None = getattr(self.__class__, "_" + kind.__name__, None)
        if found is None:
            raise Unsupported(f"{kind.__name__} is not in the language of kernels")
        METHODS[kind] = found
        return found

    def condition(self, node: Any) -> Any:
        """A truth value, known or in a register."""
        value = self.eval(node)
        if isinstance(value, Number):
            return self.w.truth(value)
        if isinstance(value, Array):
            raise Unsupported("an array is neither true nor false")
        return bool(value)

    def _JoinedStr(self, node: ast.JoinedStr) -> str:
        return "".join(str(self.eval(each)) for each in node.values)

    def _FormattedValue(self, node: ast.FormattedValue) -> Any:
        return self.eval(node.value)

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
            known = not isinstance(a, Number) and not isinstance(b, Number)
            if name == "Pow" and not known and (type(b) is not int or abs(b) > LARGEST_POWER):
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
        left, result = self.eval(node.left), cast(Any, True)
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
                return self._is_in(left, right)
            case ast.NotIn():
                return self.w.binary("Eq", self._is_in(left, right), False)
        if is_number(left) and is_number(right):
            return self.w.binary(type(op).__name__, left, right)
        registers: list[Any] = []
        form_of((left, right), registers)
        if any(isinstance(each, Number) for each in registers):
            raise Unsupported("only numbers are compared while a kernel runs")
        return left == right if isinstance(op, ast.Eq) else left != right

    def _is_in(self, left: Any, right: Any) -> Any:
        """Whether something is among others: what is not known yet is compared with each of them."""
        registers: list[Any] = []
        form_of((left, right), registers)
        if not any(isinstance(each, Number) for each in registers):
            return left in right
        if not (is_number(left) and isinstance(right, tuple) and all(is_number(each) for each in right)):
            raise Unsupported("numbers are looked for in tuples of numbers while a kernel runs")
        found: Any = False
        for each in right:
            found = self.w.binary("BitOr", found, self.w.binary("Eq", left, each))
        return found

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
            chosen = (w.choose(test, x, y) for x, y in zip(fitted(a, form), fitted(b, form), strict=True))
            return value_of(form, chosen)
        w.at = origin
        w.fork(test, yes, no)
        sides = []
        for value, end in ends:
            w.at = end
            numbers = [
                w.ref(n, k) if k != "ptr" else n.ref
                for n, k in zip(fitted(value, form), kinds_in(form), strict=True)
            ]
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
        check_known(over)
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

    # Elements

    def item(self, value: Any, index: Any) -> Any:
        """`value[index]`."""
        if isinstance(value, np.ndarray):
            value = self.w.fixed(value)
        if not isinstance(value, Array):
            if isinstance(index, Number):
                raise NeedsKnown(index)
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
        if self.unit.checked:
            for each, length in zip(indices, array.lengths, strict=False):
                if not isinstance(each, slice):
                    bounds.check(self, each, length)
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
        elif self.unit.checked:
            bounds.check(self, value)
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
            self.w.store(
                target,
                indices,
                self.w.load(value, indices[-value.ndim :]) if isinstance(value, Array) else value,
            )
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


def check_known(over: Any) -> None:
    """Raise Unsupported for what a loop cannot go over while walking."""
    if isinstance(over, Number | Array) or not hasattr(over, "__iter__"):
        raise Unsupported("a loop goes over a range, or over what is known, such as a tuple")


def _unpack(names: dict[str, Any], target: Any, value: Any) -> None:
    if isinstance(target, ast.Name):
        names[target.id] = value
    else:
        for one, part in zip(target.elts, value, strict=True):
            _unpack(names, one, part)
