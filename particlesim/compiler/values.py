"""The values of the walker: numbers and arrays that are known at run time only, and Python objects known while compiling.

A value is one of
- a `Number`: an LLVM register with its kind,
- an `Array`: a pointer with lengths and strides, each a `Number` or known,
- any Python object: a number, None, a type, a function, or a tuple of values (a NamedTuple keeps its class).

A value consists of a *form*, all that is known about it while compiling, and its registers. Two values of one form are
interchangeable: in a variable, as arguments and results of a function.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

FLOATS = {"double": np.float64, "float": np.float32}
KINDS: dict[str, type] = {**FLOATS, "i64": int, "i1": bool}
"""Kinds of numbers in registers, by LLVM's names, and the Python type that each stands for."""

ELEMENTS = {
    "float64": ("double", 8),
    "float32": ("float", 4),
    "int64": ("i64", 8),
    "int32": ("i32", 4),
    "int16": ("i16", 2),
    "int8": ("i8", 1),
    "uint64": ("i64", 8),
    "uint32": ("i32", 4),
    "uint16": ("i16", 2),
    "uint8": ("i8", 1),
    "bool": ("i8", 1),
}
"""How elements of arrays lie in memory: LLVM's type and size [bytes] by NumPy's name. All integers are i64 in registers."""


class Unsupported(Exception):
    """A kernel does something that the compiler does not know; the walker adds the place."""


@dataclass(frozen=True, slots=True, eq=False)
class Number:
    """A number that is known when the kernel runs: an LLVM register (or constant) and its kind."""

    ref: str
    kind: str

    def __bool__(self) -> bool:
        raise Unsupported("this decision needs a number that is only known when the kernel runs")

    @property
    def dtype(self) -> np.dtype[Any]:
        """NumPy's type of the number."""
        return np.dtype(KINDS[self.kind])


@dataclass(frozen=True, slots=True, eq=False)
class Array:
    """An array: pointer to its first element, lengths and strides (in elements) by axis, each a `Number` or a known int."""

    data: Number
    element: str
    lengths: tuple[Any, ...]
    strides: tuple[Any, ...]

    @property
    def ndim(self) -> int:
        """How many axes it has."""
        return len(self.lengths)

    @property
    def dtype(self) -> np.dtype[Any]:
        """NumPy's type of its elements."""
        return np.dtype(self.element)


class ArrayForm(tuple):  # type: ignore[type-arg]
    """(element, lengths, strides), with None for what is in registers."""


class TupleForm(tuple):  # type: ignore[type-arg]
    """(class, forms of the parts)."""


class KnownForm(tuple):  # type: ignore[type-arg]
    """(object,): not a number, the same at any time."""


# Written as `A | B`, each test would make the union of the classes anew, and these are made a million times.
_NUMBERS = (Number, float, int, np.number, np.bool_)
_TRUTHS = (bool, np.bool_)
_WHOLE = (int, np.integer)


_KINDS_OF = {
    float: "double",
    np.float64: "double",
    np.float32: "float",
    int: "i64",
    bool: "i1",
    np.bool_: "i1",
}
"""Kinds by class of the most frequent known numbers: a look is faster than a row of tests."""


def is_number(value: Any) -> bool:
    """Whether a value is one number, in a register or known."""
    cls = value.__class__
    return cls is Number or cls in _KINDS_OF or isinstance(value, _NUMBERS)


def kind_of(value: Any) -> str:
    """The kind of a number, in a register or known."""
    cls = value.__class__
    if cls is Number:
        return value.kind
    if (kind := _KINDS_OF.get(cls)) is not None:
        return kind
    if isinstance(value, _TRUTHS):
        return "i1"
    if isinstance(value, _WHOLE):
        return "i64"
    if isinstance(value, np.float32):
        return "float"
    if isinstance(value, float):
        return "double"
    raise Unsupported(f"{value!r} is no number")


def form_of(value: Any, registers: list[Any]) -> Any:
    """The form of a value; appends the numbers that it holds to `registers`, pointers among them."""
    if value.__class__ is Number:
        registers.append(value)
        return value.kind
    if is_number(value):
        registers.append(value)
        return kind_of(value)
    if isinstance(value, Array):
        registers.append(value.data)
        registers += (each for each in (*value.lengths, *value.strides) if isinstance(each, Number))
        return ArrayForm(
            (
                value.element,
                *(
                    tuple(None if isinstance(n, Number) else n for n in part)
                    for part in (value.lengths, value.strides)
                ),
            )
        )
    if isinstance(value, tuple):
        return TupleForm((type(value), tuple(form_of(each, registers) for each in value)))
    return KnownForm((value,))


def kinds_in(form: Any) -> list[str]:
    """The kinds of the registers of a form, in order."""
    if isinstance(form, str):
        return [form]
    if isinstance(form, ArrayForm):
        unknown = sum(n is None for part in form[1:] for n in part)
        return ["ptr"] + ["i64"] * unknown
    if isinstance(form, TupleForm):
        return [kind for each in form[1] for kind in kinds_in(each)]
    return []


def value_of(form: Any, registers: Iterator[Any]) -> Any:
    """The value of a form that holds these registers: the inverse of `form_of`."""
    if isinstance(form, str):
        return next(registers)
    if isinstance(form, ArrayForm):
        data = next(registers)
        element, lengths, strides = form
        parts = [tuple(next(registers) if n is None else n for n in part) for part in (lengths, strides)]
        return Array(data, element, *parts)
    if isinstance(form, TupleForm):
        parts = [value_of(each, registers) for each in form[1]]
        return tuple(parts) if form[0] is tuple else tuple.__new__(form[0], parts)
    return form[0]


def wider(a: str, b: str) -> str:
    """The kind that can hold numbers of two kinds, as in NumPy: an integer with a float of any size is a double."""
    if a == b:
        return a
    if {a, b} == {"i1", "i64"}:
        return "i64"
    if "ptr" in (a, b):
        raise Unsupported("an array is no number")
    return "double"


def joined(a: Any, b: Any) -> Any:
    """The form that can hold values of two forms. Raises Unsupported when there is none."""
    if isinstance(a, str) and isinstance(b, str):
        return wider(a, b)
    if isinstance(a, TupleForm) and isinstance(b, TupleForm) and a[0] is b[0] and len(a[1]) == len(b[1]):
        return TupleForm((a[0], tuple(joined(x, y) for x, y in zip(a[1], b[1], strict=True))))
    if isinstance(a, ArrayForm) and isinstance(b, ArrayForm) and a[0] == b[0] and len(a[1]) == len(b[1]):
        return a if a == b else ArrayForm((a[0], (None,) * len(a[1]), (None,) * len(a[2])))
    if type(a) is type(b) and a == b:
        return a
    raise Unsupported(f"{words(a)} in one branch, {words(b)} in another")


def words(form: Any) -> str:
    """A form as people read it."""
    if isinstance(form, str):
        return {"double": "a float64", "float": "a float32", "i64": "an integer", "i1": "a truth value"}[form]
    if isinstance(form, ArrayForm):
        return f"an array of {form[0]} with {len(form[1])} axes"
    if isinstance(form, TupleForm):
        return form[0].__name__ if form[0] is not tuple else f"a tuple of {len(form[1])}"
    return repr(form[0])
