"""Writes the text of LLVM functions: blocks, instructions, stack variables, and the arithmetic of numbers.

Numbers follow NumPy: literals are float64 and int64, a float32 with an integer is a float64, `/` makes floats, `//` and `%`
round down. Integers do not overflow: there is no check.
"""

from __future__ import annotations

import math
import operator
import re
import struct
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from particlesim.compiler.values import (
    ELEMENTS,
    FLOATS,
    Array,
    Number,
    Unsupported,
    is_number,
    kind_of,
    wider,
)

# contract: a·b + c in one rounding; nsz: −0 may become 0; arcp: x/m, y/m, z/m share one reciprocal.
# Never nnan or ninf: a NaN must stay visible. Never reassoc: sums keep the order in which they are written.
FAST = "contract nsz arcp "

RUN = 12
"""Numbers that lie in memory one after the other, from which on a function is given the place of the first, not all."""

HELD = {"float": "double", "i1": "i64"}
"""Kinds of numbers in the arguments of a kernel, where each takes eight bytes, if not their own."""

COMPARISONS = {"Lt": "lt", "LtE": "le", "Gt": "gt", "GtE": "ge", "Eq": "eq", "NotEq": "ne"}
_IN_MEMORY = re.compile(r"%m\d+\b")
FOLDED: dict[str, Callable[[Any, Any], Any]] = {
    "Add": operator.add,
    "Sub": operator.sub,
    "Mult": operator.mul,
    "Div": operator.truediv,
    "FloorDiv": operator.floordiv,
    "Mod": operator.mod,
    "Pow": operator.pow,
    "BitAnd": operator.and_,
    "BitOr": operator.or_,
    "BitXor": operator.xor,
    "LShift": operator.lshift,
    "RShift": operator.rshift,
    "Lt": operator.lt,
    "LtE": operator.le,
    "Gt": operator.gt,
    "GtE": operator.ge,
    "Eq": operator.eq,
    "NotEq": operator.ne,
}
_BITS = {"BitAnd": "and", "BitOr": "or", "BitXor": "xor", "LShift": "shl", "RShift": "ashr"}
_PLAIN = {"Add": "add", "Sub": "sub", "Mult": "mul"}


def constant(value: Any, kind: str) -> str:
    """A known number as LLVM writes it: floats by their bits."""
    if kind == "i1":
        return "true" if value else "false"
    if kind == "i64":
        return str(int(value))
    rounded = float(np.float32(value)) if kind == "float" else float(value)
    return f"0x{struct.unpack('<Q', struct.pack('<d', rounded))[0]:016X}"


class Block:
    """Instructions without a branch between them."""

    def __init__(self, label: str) -> None:
        self.label = label
        self.lines: list[str] = []
        self.ended = False


class Writer:
    """One LLVM function as it is written. `declared` collects what the module has to declare."""

    def __init__(self, declared: dict[str, str], constants: dict[str, str]) -> None:
        self.declared, self.constants = declared, constants
        self.count = 0
        self.places: list[str] = []
        self.blocks: list[Block] = []
        self.fast = FAST
        self.memory: dict[str, tuple[str, int, str]] = {}
        self.known: dict[int, Any] = {}
        self.rooms: dict[tuple[int, int], str] = {}
        self.full: dict[str, tuple[Block, Any]] = {}
        self.start = self.block("start")
        self.at = self.start

    # Blocks and instructions

    def block(self, name: str) -> Block:
        """A new block, not yet the one that is written."""
        self.count += 1
        made = Block(f"{name}{self.count}")
        self.blocks.append(made)
        return made

    def emit(self, text: str) -> str:
        """An instruction with a result: its register."""
        self.count += 1
        self.at.lines.append(f"%r{self.count} = {text}")
        return f"%r{self.count}"

    def do(self, text: str) -> None:
        """An instruction without a result."""
        self.at.lines.append(text)

    def branch(self, target: Block, mark: str = "") -> None:
        """End the block: go on at `target`."""
        if not self.at.ended:
            self.do(f"br label %{target.label}{mark}")
            self.at.ended = True

    def fork(self, condition: Number, yes: Block, no: Block) -> None:
        """End the block: go on at one of two."""
        self.do(f"br i1 {condition.ref}, label %{yes.label}, label %{no.label}")
        self.at.ended = True

    def kept_whole(self, abreast: int = 1) -> str:
        """A mark for the way back of a loop that is not to be written out turn by turn, but in some vectors at a time."""
        marks = [self._note('"llvm.loop.unroll.disable"')]
        if abreast > 1:
            marks.append(self._note(f'"llvm.loop.interleave.count", i32 {abreast}'))
        own = self._next_note()
        self.declared[own] = f"{own} = distinct !{{{', '.join([own, *marks])}}}"
        return f", !llvm.loop {own}"

    def _note(self, text: str) -> str:
        """The name of a note of the module."""
        if text not in self.declared:
            self.declared[text] = f"{self._next_note()} = !{{!{text}}}"
        return self.declared[text].split()[0]

    def _next_note(self) -> str:
        return f"!{sum(each.startswith('!') for each in self.declared.values())}"

    def finish(self, text: str) -> None:
        """End the block with a return."""
        self.do(text)
        self.at.ended = True

    def place(self, kind: str, count: int = 1, align: int = 8) -> str:
        """Room on the stack that lives as long as the function."""
        self.count += 1
        size = f", i64 {count}" if count > 1 else ""
        self.places.append(f"%p{self.count} = alloca {kind}{size}, align {align}")
        return f"%p{self.count}"

    def text(self) -> str:
        """The body of the function."""
        body: list[str] = []
        for block in self.blocks:
            body.append(f"{block.label}:")
            body += (f"  {each}" for each in block.lines)
            if not block.ended:
                body.append("  unreachable")
        text = "\n".join(body)
        lines = ["entry:", *(f"  {each}" for each in self.places)]
        for name in dict.fromkeys(_IN_MEMORY.findall(text)):
            lines += self._loaded(name)
        return "\n".join([*lines, f"  br label %{self.start.label}", text])

    # Arguments in memory: those of the kernel, of which functions that it calls get stretches

    def taken(self, base: str, kinds: list[str]) -> list[Number]:
        """Numbers that lie in memory from a place on, eight bytes each. They never change, and are loaded if used."""
        made = []
        for k, kind in enumerate(kinds):
            name = f"%m{len(self.memory)}"
            self.memory[name] = base, k, kind
            made.append(Number(name, kind))
        return made

    def _loaded(self, name: str) -> list[str]:
        """How a number comes from memory."""
        base, k, kind = self.memory[name]
        held, place = HELD.get(kind, kind), f"%at{name[1:]}"
        load = f"load {held}, ptr {place}, !invariant.load !{{}}"
        lines = [f"  {place} = getelementptr inbounds i64, ptr {base}, i64 {k}"]
        if held == kind:
            return [*lines, f"  {name} = {load}"]
        got = f"%held{name[1:]}"
        narrowed = f"fptrunc double {got} to float" if kind == "float" else f"icmp ne i64 {got}, 0"
        return [*lines, f"  {got} = {load}", f"  {name} = {narrowed}"]

    def runs(self, registers: list[Any]) -> tuple[tuple[int, int], ...]:
        """Where among some registers numbers begin that lie in memory one after the other, and how many, if many."""
        found, first, before = [], 0, None
        for k, each in enumerate([*registers, None]):
            base, slot, _ = (
                self.memory.get(each.ref, ("", 0, "")) if isinstance(each, Number) else ("", 0, "")
            )
            if not base or (base, slot - 1) != before:
                if k - first >= RUN and before is not None:
                    found.append((first, k - first))
                first = k
            before = (base, slot) if base else None
        return tuple(found)

    def stretch(self, first: Number) -> str:
        """The place in memory of a number."""
        base, slot, _ = self.memory[first.ref]
        return self.emit(f"getelementptr inbounds i64, ptr {base}, i64 {slot}") if slot else base

    def put(self, position: int, value: Any, registers: list[Any], runs: tuple[tuple[int, int], ...]) -> str:
        """Put registers in a row in memory, as `taken` takes them, for an argument at this position of a call; the place.

        `runs` tells which of them are in a row elsewhere. Other calls use the room again; what this block has put there last
        is there still.
        """
        room = self.rooms.get((position, len(registers)))
        if room is None:
            room = self.rooms[position, len(registers)] = self.place("i64", len(registers))
        block, known = self.full.get(room, (None, None))
        if block is self.at and known is value:
            return room
        ahead, k = dict(runs), 0
        while k < len(registers):
            place = self.emit(f"getelementptr inbounds i64, ptr {room}, i64 {k}")
            if length := ahead.get(k, 0):
                self.declared["llvm.memcpy"] = "declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)"
                source = self.stretch(registers[k])
                self.do(
                    f"call void @llvm.memcpy.p0.p0.i64(ptr {place}, ptr {source}, i64 {8 * length}, i1 false)"
                )
            else:
                self._hold(registers[k], place)
            k += length or 1
        self.full[room] = self.at, value
        return room

    def _hold(self, value: Any, place: str) -> None:
        """Write a number, or a pointer, to eight bytes."""
        if isinstance(value, Number) and value.kind == "ptr":
            self.do(f"store ptr {value.ref}, ptr {place}")
            return
        held = HELD.get(kind := kind_of(value), kind)
        self.do(f"store {held} {self.ref(value, held)}, ptr {place}")

    # Numbers

    def ref(self, value: Any, kind: str | None = None) -> str:
        """A number as an operand, cast to `kind` if it has another."""
        if value.__class__ is Number:
            return value.ref if kind is None or value.kind == kind else self._cast(value, kind)
        own = kind_of(value)
        return constant(value, kind or own)

    def cast(self, value: Any, kind: str) -> Any:
        """A number in another kind; floats become integers by dropping their fraction."""
        if kind_of(value) == kind:
            return value
        if isinstance(value, Number):
            return Number(self._cast(value, kind), kind)
        if kind in FLOATS:
            return FLOATS[kind](value) if kind == "float" else float(value)
        return bool(value) if kind == "i1" else int(value)

    def _cast(self, value: Number, kind: str) -> str:
        own = value.kind
        if kind == "i1":
            zero = constant(0, own)
            return self.emit(
                f"fcmp une {own} {value.ref}, {zero}" if own in FLOATS else f"icmp ne {own} {value.ref}, 0"
            )
        if own in FLOATS:
            if kind in FLOATS:
                return self.emit(f"{'fpext' if kind == 'double' else 'fptrunc'} {own} {value.ref} to {kind}")
            return self.emit(f"fptosi {own} {value.ref} to {kind}")
        if kind in FLOATS:
            return self.emit(f"{'uitofp' if own == 'i1' else 'sitofp'} {own} {value.ref} to {kind}")
        return self.emit(f"zext {own} {value.ref} to {kind}")

    def truth(self, value: Any) -> Any:
        """A number as a condition."""
        return self.cast(value, "i1")

    def binary(self, name: str, a: Any, b: Any) -> Any:
        """An operation on two numbers, by the name of its node in the syntax tree."""
        if a.__class__ is not Number and b.__class__ is not Number:
            with np.errstate(all="ignore"):
                return FOLDED[name](a, b)
        if name in COMPARISONS:
            return self._compare(COMPARISONS[name], a, b)
        if name == "Pow":
            return self._whole_power(a, b)
        kind = wider(kind_of(a), kind_of(b))
        if name in _BITS:
            return self._bits(_BITS[name], a, b, kind)
        if kind == "i1":
            kind = "i64"
        if name == "Div" and kind not in FLOATS:
            kind = "double"
        x, y = self.ref(a, kind), self.ref(b, kind)
        if name in ("FloorDiv", "Mod"):
            return self._floored(name, x, y, kind, b)
        if kind in FLOATS:
            return Number(self.emit(f"f{_PLAIN.get(name, 'div')} {self.fast}{kind} {x}, {y}"), kind)
        return Number(self.emit(f"{_PLAIN[name]} nsw {kind} {x}, {y}"), kind)

    def _compare(self, how: str, a: Any, b: Any) -> Number:
        kind = wider(kind_of(a), kind_of(b))
        x, y = self.ref(a, kind), self.ref(b, kind)
        if kind in FLOATS:
            return Number(self.emit(f"fcmp {'u' if how == 'ne' else 'o'}{how} {kind} {x}, {y}"), "i1")
        sign = "" if how in ("eq", "ne") else "u" if kind == "i1" else "s"
        return Number(self.emit(f"icmp {sign}{how} {kind} {x}, {y}"), "i1")

    def _bits(self, how: str, a: Any, b: Any, kind: str) -> Number:
        if kind in FLOATS:
            raise Unsupported("bits of floats: bits_of(x) gives them")
        if kind == "i1" and how in ("shl", "ashr"):
            kind = "i64"
        return Number(self.emit(f"{how} {kind} {self.ref(a, kind)}, {self.ref(b, kind)}"), kind)

    def _floored(self, name: str, x: str, y: str, kind: str, divisor: Any) -> Number:
        if kind in FLOATS:
            raise Unsupported("// of floats: np.floor(a / b)")
        rest = self.emit(f"srem {kind} {x}, {y}")
        if isinstance(divisor, int) and divisor > 0:
            off = self.emit(f"icmp slt {kind} {rest}, 0")
        else:
            differ = self.emit(f"icmp slt {kind} {self.emit(f'xor {kind} {rest}, {y}')}, 0")
            off = self.emit(f"and i1 {differ}, {self.emit(f'icmp ne {kind} {rest}, 0')}")
        if name == "Mod":
            moved = self.emit(f"add nsw {kind} {rest}, {y}")
            return Number(self.emit(f"select i1 {off}, {kind} {moved}, {kind} {rest}"), kind)
        quotient = self.emit(f"sdiv {kind} {x}, {y}")
        less = self.emit(f"sub nsw {kind} {quotient}, 1")
        return Number(self.emit(f"select i1 {off}, {kind} {less}, {kind} {quotient}"), kind)

    def _whole_power(self, a: Any, exponent: int) -> Any:
        """a to a small known integer, by squaring."""
        result, factor, left = None, a, abs(exponent)
        while left:
            if left & 1:
                result = factor if result is None else self.binary("Mult", result, factor)
            left >>= 1
            factor = self.binary("Mult", factor, factor) if left else factor
        if result is None:
            return self.cast(1, kind_of(a))
        return self.binary("Div", self.cast(1, kind_of(a)), result) if exponent < 0 else result

    def negative(self, a: Any) -> Any:
        """−a."""
        if not isinstance(a, Number):
            return -a
        if a.kind in FLOATS:
            return Number(self.emit(f"fneg {self.fast}{a.kind} {a.ref}"), a.kind)
        return Number(self.emit(f"sub nsw i64 0, {self.ref(a, 'i64')}"), "i64")

    def choose(self, condition: Any, a: Any, b: Any) -> Any:
        """`a if condition else b` of numbers that are there already."""
        if not isinstance(condition, Number):
            return a if condition else b
        kind = wider(kind_of(a), kind_of(b))
        return Number(
            self.emit(f"select i1 {condition.ref}, {kind} {self.ref(a, kind)}, {kind} {self.ref(b, kind)}"),
            kind,
        )

    def extreme(self, how: str, values: Iterable[Any]) -> Any:
        """The smallest ("Lt") or largest ("Gt") number, the first of equal ones as in Python."""
        best, *others = values
        if not isinstance(best, Number) and not any(isinstance(each, Number) for each in others):
            return (min if how == "Lt" else max)(best, *others)
        for each in others:
            kind = wider(kind_of(best), kind_of(each))
            best, each = self.cast(best, kind), self.cast(each, kind)
            best = self.choose(self.binary(how, each, best), each, best)
        return best

    def intrinsic(self, name: str, values: list[Any]) -> Number:
        """A function that LLVM knows for floats, such as sqrt."""
        kind = kind_of(values[0])
        if kind not in FLOATS:
            kind = "double"
        short = "f64" if kind == "double" else "f32"
        arguments = ", ".join(f"{kind} {self.ref(each, kind)}" for each in values)
        types = ", ".join([kind] * len(values))
        self.declared[f"llvm.{name}.{short}"] = f"declare {kind} @llvm.{name}.{short}({types})"
        return Number(self.emit(f"call {self.fast}{kind} @llvm.{name}.{short}({arguments})"), kind)

    # Arrays

    def whole(self, value: Any) -> str:
        """An integer operand."""
        if not is_number(value) or kind_of(value) in FLOATS:
            raise Unsupported("an index is an integer")
        return self.ref(value, "i64")

    def offset(self, array: Array, indices: list[Any]) -> Number:
        """Pointer to the element with these first indices."""
        total: Any = 0
        for index, stride, length in zip(indices, array.strides, array.lengths, strict=False):
            if not isinstance(index, Number) and index < 0:
                index = self.binary("Add", length, index)
            known_one = not isinstance(stride, Number) and stride == 1
            step = index if known_one else self.binary("Mult", index, stride)
            known_zero = not isinstance(total, Number) and total == 0
            total = step if known_zero else self.binary("Add", total, step)
        if not isinstance(total, Number) and total == 0:
            return array.data
        kind = ELEMENTS[array.element][0]
        return Number(
            self.emit(f"getelementptr inbounds {kind}, ptr {array.data.ref}, i64 {self.whole(total)}"), "ptr"
        )

    def load(self, array: Array, indices: list[Any]) -> Number:
        """An element; integers come as int64."""
        kind, size = ELEMENTS[array.element]
        got = self.emit(f"load {kind}, ptr {self.offset(array, indices).ref}, align {size}")
        if array.element == "bool":
            return Number(self.emit(f"trunc i8 {got} to i1"), "i1")
        if kind in FLOATS or kind == "i64":
            return Number(got, kind)
        return Number(
            self.emit(f"{'zext' if array.element[0] == 'u' else 'sext'} {kind} {got} to i64"), "i64"
        )

    def store(self, array: Array, indices: list[Any], value: Any) -> None:
        """Set an element; the number is cast to what the array holds."""
        kind, size = ELEMENTS[array.element]
        target = self.offset(array, indices).ref
        if array.element == "bool":
            text = (
                self.emit(f"zext i1 {self.ref(value, 'i1')} to i8")
                if isinstance(value, Number)
                else str(int(bool(value)))
            )
        elif kind in FLOATS or kind == "i64":
            text = self.ref(value, kind)
        elif isinstance(value, Number):
            text = self.emit(f"trunc i64 {self.ref(value, 'i64')} to {kind}")
        else:
            text = str(int(value))
        self.do(f"store {kind} {text}, ptr {target}, align {size}")

    def fixed(self, values: np.ndarray[Any, Any]) -> Array:
        """A known array: its numbers become a constant of the module."""
        element = values.dtype.name
        if element not in ELEMENTS:
            raise Unsupported(f"arrays of {element}")
        data = np.ascontiguousarray(values).tobytes()
        name = self.constants.setdefault(
            "".join(f"\\{byte:02X}" for byte in data), f"@fixed{len(self.constants)}"
        )
        lengths = values.shape
        strides = tuple(math.prod(lengths[axis + 1 :]) for axis in range(values.ndim))
        return Array(Number(name, "ptr"), element, lengths, strides)
