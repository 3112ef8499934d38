"""Functions of Python and NumPy that kernels may call, and the instructions that they become."""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from particlesim.compiler import elementary, intrinsics
from particlesim.compiler.calls import Method
from particlesim.compiler.expressions import Lanes, Sequence
from particlesim.compiler.values import (
    ELEMENTS,
    FLOATS,
    KINDS,
    Array,
    Number,
    Unsupported,
    is_number,
    kind_of,
)
from particlesim.compiler.walker import Frame

Rule = Callable[..., Any]
RULES: dict[Any, Rule] = {}


def rule(*functions: Any) -> Callable[[Rule], Rule]:
    """Register what calls of these functions become; it is called with the frame and the arguments."""

    def register(how: Rule) -> Rule:
        for each in functions:
            RULES[each] = how
        return how

    return register


# Structure: decided while walking


@rule(range)
def _range(frame: Frame, *borders: Any) -> Sequence:
    if any(kind_of(each) != "i64" for each in borders):
        raise Unsupported("range counts integers")
    return Sequence(((0, borders[0], 1), (*borders, 1), borders)[len(borders) - 1])


@rule(intrinsics.lanes)
def _lanes(frame: Frame, count: Any, abreast: Any = 1) -> Lanes:
    found = Lanes(_range(frame, count))
    found.abreast = abreast
    return found


@rule(len)
def _len(frame: Frame, value: Any) -> Any:
    if isinstance(value, Array):
        return value.lengths[0]
    return len(value)


def _written_out(values: Any) -> Any:
    """The turns of a `range`, one by one; anything else as it is."""
    if not isinstance(values, Sequence):
        return values
    if any(isinstance(each, Number) for each in values):
        raise Unsupported("the numbers of this range are only known when the kernel runs")
    return tuple(range(*values))


@rule(enumerate)
def _enumerate(frame: Frame, values: Any) -> Any:
    return tuple(enumerate(_written_out(values)))


@rule(zip)
def _zip(frame: Frame, *values: Any, strict: bool = False) -> Any:
    return tuple(zip(*map(_written_out, values), strict=strict))


@rule(reversed)
def _reversed(frame: Frame, values: Any) -> Any:
    return tuple(reversed(_written_out(values)))


@rule(tuple, list)
def _tuple(frame: Frame, values: Any = ()) -> Any:
    return tuple(_written_out(values))


@rule(type)
def _type(frame: Frame, value: Any) -> Any:
    if isinstance(value, Number):
        return KINDS[value.kind]
    return np.ndarray if isinstance(value, Array) else builtins.type(value)


@rule(isinstance)
def _isinstance(frame: Frame, value: Any, classes: Any) -> bool:
    if isinstance(value, Number | Array):
        wanted = classes if isinstance(classes, tuple) else (classes,)
        return any(issubclass(_type(frame, value), each) for each in wanted)
    return isinstance(value, classes)


def _folded(name: str, nothing: bool) -> Rule:
    def combine(frame: Frame, values: Any) -> Any:
        result: Any = nothing
        for each in values:
            result = frame.w.binary(name, result, frame.w.truth(each)) if is_number(each) else result
        return result

    return combine


RULES[any], RULES[all] = _folded("BitOr", False), _folded("BitAnd", True)


@rule(sum)
def _sum(frame: Frame, values: Any, start: Any = 0) -> Any:
    for each in values:
        start = frame.w.binary("Add", start, each)
    return start


# Numbers


@rule(min)
def _min(frame: Frame, *values: Any) -> Any:
    return frame.w.extreme("Lt", values[0] if len(values) == 1 else values)


@rule(max)
def _max(frame: Frame, *values: Any) -> Any:
    return frame.w.extreme("Gt", values[0] if len(values) == 1 else values)


@rule(abs, np.abs, math.fabs, np.fabs)
def _abs(frame: Frame, x: Any) -> Any:
    if not isinstance(x, Number):
        return abs(x)
    if x.kind in FLOATS:
        return frame.w.intrinsic("fabs", [x])
    return frame.w.choose(frame.w.binary("Lt", x, 0), frame.w.negative(x), x)


def _cast(kind: str) -> Rule:
    return lambda frame, x: frame.w.cast(x, kind)


for _types, _kind in (((float, np.float64), "double"), ((np.float32,), "float"), ((bool, np.bool_), "i1")):
    for _each in _types:
        RULES[_each] = _cast(_kind)
for _each in (int, *(getattr(np, name) for name in ELEMENTS if name.startswith(("int", "uint")))):
    RULES[_each] = _cast("i64")


def _by_llvm(name: str, function: Callable[..., Any]) -> Rule:
    def emit(frame: Frame, *values: Any) -> Any:
        if not any(isinstance(each, Number) for each in values):
            return function(*values)
        return frame.w.intrinsic(name, list(values))

    return emit


_BY_LLVM: dict[str, tuple[Any, ...]] = {
    "sqrt": (np.sqrt, math.sqrt, intrinsics.sqrt),
    "floor": (np.floor, intrinsics.floor),
    "ceil": (np.ceil,),
    "rint": (np.rint, intrinsics.nearest),
    "copysign": (np.copysign, math.copysign, intrinsics.copysign),
    "fma": (intrinsics.fma,),
}
for _name, _functions in _BY_LLVM.items():
    for _function in _functions:
        RULES[_function] = _by_llvm(_name, _function)


@rule(math.floor)
def _whole_floor(frame: Frame, x: Any) -> Any:
    return frame.w.cast(frame.w.intrinsic("floor", [x]), "i64") if isinstance(x, Number) else math.floor(x)


@rule(np.isnan, math.isnan)
def _isnan(frame: Frame, x: Any) -> Any:
    return frame.w.binary("NotEq", x, x)


@rule(np.isfinite, math.isfinite)
def _isfinite(frame: Frame, x: Any) -> Any:
    return frame.w.binary("Lt", _abs(frame, x), math.inf)


@rule(np.sign)
def _sign(frame: Frame, x: Any) -> Any:
    if not isinstance(x, Number):
        return np.sign(x)
    w = frame.w
    one = w.cast(1, x.kind)
    return w.choose(w.binary("Gt", x, 0), one, w.choose(w.binary("Lt", x, 0), w.negative(one), x))


@rule(intrinsics.bits_of)
def _bits_of(frame: Frame, x: Any) -> Any:
    if not isinstance(x, Number):
        return intrinsics.bits_of(x)
    return Number(frame.w.emit(f"bitcast double {frame.w.ref(x, 'double')} to i64"), "i64")


@rule(intrinsics.number_of)
def _number_of(frame: Frame, bits: Any) -> Any:
    if not isinstance(bits, Number):
        return intrinsics.number_of(bits)
    return Number(frame.w.emit(f"bitcast i64 {bits.ref} to double"), "double")


def _elementary(function: Callable[..., float], other: Any) -> None:
    """Calls of a function of NumPy or Python are those of ours, in double precision: the same bits on every machine."""

    def emit(frame: Frame, *values: Any) -> Any:
        if not any(isinstance(each, Number) for each in values):
            return function(*(float(each) for each in values))
        single = all(kind_of(each) == "float" for each in values)
        result = frame.call(function, [frame.w.cast(each, "double") for each in values], {})
        return frame.w.cast(result, "float") if single else result

    RULES[other] = emit


for _other, _own in elementary.ELEMENTARY.items():
    _elementary(_own, _other)
_elementary(elementary.power, pow)


# Memory


@rule(intrinsics.on_stack)
def _on_stack(frame: Frame, rows: Any, columns: Any, dtype: Any) -> Array:
    if isinstance(rows, Number) or isinstance(columns, Number):
        raise Unsupported("the size of an array on the stack is known")
    element = np.dtype(dtype).name
    place = frame.w.place(ELEMENTS[element][0], rows * columns, intrinsics.LINE)
    return Array(Number(place, "ptr"), element, (rows, columns), (columns, 1))


_EXCHANGES = ((0, 8, 2, 10, 4, 12, 6, 14), (0, 1, 8, 9, 4, 5, 12, 13), (0, 1, 2, 3, 8, 9, 10, 11))
"""Which numbers of two vectors make a new one: pairs of neighbours, then of twos, then of fours."""


@rule(intrinsics.transpose)
def _transpose(frame: Frame, source: Array, rows: Any, column: Any, into: Array, at: Any) -> None:
    w, size = frame.w, intrinsics.BLOCK
    for array in (source, into):
        if array.element != "float64" or array.ndim != 2 or array.strides[1] != 1:
            raise Unsupported("transpose takes arrays [rows, columns] of float64, rows contiguous")
    if not isinstance(rows, tuple) or len(rows) != size:
        raise Unsupported(f"transpose takes {size} rows")

    def place(array: Array, row: Any, first: Any) -> str:
        if frame.unit.checked:
            frame.view(array, (row, w.binary("Add", first, size - 1)))
        return w.offset(array, frame.view(array, (row, first))).ref

    vectors = [w.emit(f"load <8 x double>, ptr {place(source, row, column)}, align 8") for row in rows]
    for step, low in zip((1, 2, 4), _EXCHANGES, strict=True):
        high = tuple(k + step for k in low)
        for j in (j for j in range(size) if not j & step):
            pair = f"<8 x double> {vectors[j]}, <8 x double> {vectors[j + step]}"
            masks = ("<" + ", ".join(f"i32 {k}" for k in each) + ">" for each in (low, high))
            vectors[j], vectors[j + step] = [
                w.emit(f"shufflevector {pair}, <8 x i32> {mask}") for mask in masks
            ]
    for k, vector in enumerate(vectors):
        row = w.binary("Add", at, k)
        w.do(f"store <8 x double> {vector}, ptr {place(into, row, 0)}, align 8")


@rule(intrinsics.atomic_add)
def _atomic_add(frame: Frame, array: Array, index: Any, value: Any) -> Number:
    w = frame.w
    return Number(
        w.emit(f"atomicrmw add ptr {w.offset(array, [index]).ref}, i64 {w.whole(value)} seq_cst"), "i64"
    )


@rule(intrinsics.atomic_load)
def _atomic_load(frame: Frame, array: Array, index: Any) -> Number:
    w = frame.w
    return Number(w.emit(f"load atomic i64, ptr {w.offset(array, [index]).ref} acquire, align 8"), "i64")


@rule(intrinsics.prefetch)
def _prefetch(frame: Frame, array: Array, *indices: Any) -> None:
    w = frame.w
    w.declared["llvm.prefetch"] = "declare void @llvm.prefetch.p0(ptr, i32, i32, i32)"
    w.do(f"call void @llvm.prefetch.p0(ptr {w.offset(array, list(indices)).ref}, i32 0, i32 3, i32 1)")


@rule(intrinsics.pause)
def _pause(frame: Frame) -> None:
    if intrinsics.PAUSE:
        name, kind = intrinsics.PAUSE.removesuffix(")").split("(")
        frame.w.declared[name] = f"declare void @{name}({kind[:3]})"
        frame.w.do(f"call void @{intrinsics.PAUSE}")


@rule(intrinsics.let_others_run)
def _let_others_run(frame: Frame) -> None:
    name, kind = intrinsics.SLEEP.removesuffix(")").split("(")
    frame.w.declared[name] = f"declare i32 @{name}({kind[:3]})"
    frame.w.emit(f"call i32 @{intrinsics.SLEEP}")


def array_method(frame: Frame, method: Method, *arguments: Any) -> Any:
    """Methods of arrays: `sum` of one axis, element after element."""
    array, w = method.array, frame.w
    if method.name != "sum" or arguments or array.ndim != 1:
        raise Unsupported(f"arrays have no {method.name} in kernels; write the loop")
    kind = "double" if array.element == "float64" else "float" if array.element == "float32" else "i64"
    place = w.place(kind)
    w.do(f"store {kind} {w.ref(0, kind)}, ptr {place}")
    for turn in frame.counted(array.lengths[0]):
        total = w.binary("Add", Number(w.emit(f"load {kind}, ptr {place}"), kind), w.load(array, [turn]))
        w.do(f"store {kind} {total.ref}, ptr {place}")
    return Number(w.emit(f"load {kind}, ptr {place}"), kind)
