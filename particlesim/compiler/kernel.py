"""`@kernel`: functions that Python calls. They are compiled at the first call with arguments of a new structure, and kept on
disk."""

from __future__ import annotations

import ctypes
import functools
import os
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import numpy as np

from particlesim.compiler import store
from particlesim.compiler.values import (
    ELEMENTS,
    KINDS,
    Array,
    Number,
    Unsupported,
    form_of,
    kinds_in,
    value_of,
)
from particlesim.errors import UsageError

_CALL = ctypes.CFUNCTYPE(None, ctypes.c_char_p, ctypes.c_char_p)  # releases the GIL
_LOCK = threading.RLock()
_BUSY: list[Callable[[bool], None]] = []
_spent = 0.0
_began = 0.0
ENTRY = "kernel"
MOST_KEPT = 1 << 23
"""Bytes of the arrays of tuples that a kernel may keep alive after a call, to know the tuples when they come again."""
MOST_KNOWN = 32
"""Tuples that a kernel knows."""


# Arguments


def _array(x: np.ndarray[Any, Any], key: list[Any], numbers: list[Any]) -> None:
    shape = x.shape
    if x.flags.c_contiguous:
        try:  # takes a tenth of the time of the array interface, but must be able to write to an element
            numbers.append(ctypes.addressof(ctypes.c_char.from_buffer(x.data)))
        except (TypeError, ValueError):
            numbers.append(x.__array_interface__["data"][0])
        numbers += shape
        key.append((x.dtype, len(shape)))
    else:
        numbers.append(x.__array_interface__["data"][0])
        numbers += shape
        size = x.dtype.itemsize
        key.append((x.dtype, len(shape), True))
        for stride in x.strides:
            if stride % size:
                raise TypeError("kernels take arrays whose strides are whole elements")
            numbers.append(stride // size)


def _number(kind: str) -> Callable[[Any, list[Any], list[Any]], None]:
    def put(x: Any, key: list[Any], numbers: list[Any]) -> None:
        key.append(kind)
        numbers.append(x)

    return put


_TAKE: dict[type, Callable[[Any, list[Any], list[Any]], None]] = {
    np.ndarray: _array,
    float: _number("double"),
    np.float64: _number("double"),
    np.float32: _number("float"),
    bool: _number("i1"),
    np.bool_: _number("i1"),
    int: _number("i64"),
    **{getattr(np, name): _number("i64") for name in ELEMENTS if name.startswith(("int", "uint"))},
}


def _take(x: Any, key: list[Any], numbers: list[Any]) -> None:
    """The structure of an argument as a key, and the numbers in it."""
    cls = x.__class__
    take = _TAKE.get(cls)
    if take is not None:
        take(x, key, numbers)
    elif isinstance(x, tuple):
        key.append((cls, len(x)))
        for each in x:
            if each.__class__ is np.ndarray:
                _array(each, key, numbers)
            else:
                _take(each, key, numbers)
    elif isinstance(x, np.ndarray):
        _array(x, key, numbers)
    elif x is None or isinstance(x, str | type) or callable(x):
        key.append(x)
    else:
        raise TypeError(
            f"kernels take numbers, arrays, None, functions, and tuples of them, not {cls.__name__}"
        )


def _value(x: Any, registers: Iterator[Number], w: Any) -> Any:
    """An argument as the walker sees it."""
    if isinstance(x, np.ndarray):
        element = x.dtype.name
        if element not in ELEMENTS or not x.dtype.isnative:
            raise TypeError(f"kernels do not take arrays of {x.dtype}")
        data = next(registers)
        lengths = tuple(next(registers) for _ in x.shape)
        if not x.flags.c_contiguous:
            return Array(data, element, lengths, tuple(next(registers) for _ in x.shape))
        strides: tuple[Any, ...] = (1,) if lengths else ()
        for length in lengths[:0:-1]:
            strides = (w.binary("Mult", length, strides[0]), *strides)
        return Array(data, element, lengths, strides)
    if isinstance(x, tuple):
        parts = [_value(each, registers, w) for each in x]
        return tuple(parts) if type(x) is tuple else tuple.__new__(type(x), parts)
    return next(registers) if x.__class__ in _TAKE else x


def _kinds(x: Any) -> list[str]:
    if isinstance(x, np.ndarray):
        return ["ptr"] + ["i64"] * (x.ndim if x.flags.c_contiguous else 2 * x.ndim)
    if isinstance(x, tuple):
        return [kind for each in x for kind in _kinds(each)]
    if x.__class__ not in _TAKE:
        return []
    key: list[Any] = []
    _take(x, key, [])
    return key


_FORMAT = {"ptr": "P", "i64": "q", "double": "d", "float": "d", "i1": "q"}
"""Every argument and result takes eight bytes; single precision comes as double."""


@dataclass(eq=False)
class Form:
    """The structure of a tuple of arguments. There is one for each structure, found faster than its long key."""

    pack: Callable[..., bytes]


_FORMS: dict[tuple[Any, ...], Form] = {}


def _taken(x: tuple[Any, ...]) -> tuple[tuple[Any, ...], Form, bytes]:
    """A tuple of arguments, its form, and the numbers in it."""
    parts: list[Any] = []
    numbers: list[Any] = []
    _take(x, parts, numbers)
    form = _FORMS.get(key := tuple(parts))
    if form is None:
        form = _FORMS.setdefault(key, Form(struct.Struct(_format(x)).pack))
    return x, form, form.pack(*numbers)


def _format(x: Any) -> str:
    """How the numbers in an argument are packed."""
    return "".join(_FORMAT[kind] for kind in _kinds(x))


def _weight(x: tuple[Any, ...]) -> int:
    """Bytes that a tuple keeps alive; arrays that are stretches of something unknown are taken for too many."""
    total = 0
    for each in x:
        if each.__class__ is np.ndarray:
            whole = each if each.base is None else each.base
            total += whole.nbytes if isinstance(whole, np.ndarray) else MOST_KEPT
        elif isinstance(each, tuple):
            total += _weight(each)
    return total


@dataclass
class Compiled:
    """A kernel for arguments of one structure."""

    call: Callable[[bytes, Any], None]
    pack: Callable[..., bytes]
    results: list[str]
    form: Any
    code: Any  # keeps the machine code

    def __call__(self, numbers: list[Any]) -> Any:
        if not self.results:
            self.call(self.pack(*numbers), None)
            return value_of(self.form, iter(()))
        room = ctypes.create_string_buffer(8 * len(self.results))
        self.call(self.pack(*numbers), room)
        got = struct.unpack("".join(_FORMAT[kind] for kind in self.results), room)
        return value_of(
            self.form,
            iter(
                [KINDS[kind](n) if kind != "double" else n for n, kind in zip(got, self.results, strict=True)]
            ),
        )


# Compilation


def write(function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[str, Any, Any]:
    """The module of a kernel for such arguments: its text, the form of its result, and the unit with what went in.

    Raises CompileError with file, line and reason.
    """
    from particlesim.compiler.calls import DEEPEST
    from particlesim.compiler.unit import Unit, again

    unit = Unit(checked=CHECKED, quick=_quick)
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, DEEPEST * 20))  # a call in a kernel takes a dozen calls here
    try:
        return again(lambda: _write(function, arguments, unit))
    finally:
        sys.setrecursionlimit(limit)


def _write(function: Callable[..., Any], arguments: tuple[Any, ...], unit: Any) -> tuple[str, Any, Any]:
    from particlesim.compiler.unit import CompileError
    from particlesim.compiler.walker import Frame
    from particlesim.compiler.writer import HELD, Writer

    w = Writer(unit.declared, unit.constants)
    if getattr(function, "exact", False):
        w.fast = ""
    taken = iter(w.taken("%arguments", [kind for each in arguments for kind in _kinds(each)]))
    try:
        values = [_value(each, taken, w) for each in arguments]
        result = Frame(unit, w, function, values, {}).walk()
    except Unsupported as error:
        code = function.__code__
        raise CompileError(
            str(error), [(code.co_filename, code.co_firstlineno, 0, function.__name__)]
        ) from error
    numbers: list[Any] = []
    form = form_of(result, numbers)
    kinds = kinds_in(form)
    if "ptr" in kinds:
        raise TypeError(f"{function.__name__} returns an array: kernels return numbers")
    for k, (number, kind) in enumerate(zip(numbers, kinds, strict=True)):
        held = HELD.get(kind, kind)
        place = w.emit(f"getelementptr inbounds i64, ptr %results, i64 {k}")
        w.do(f"store {held} {w.ref(w.cast(number, kind), held)}, ptr {place}")
    w.finish("ret void")
    body = f"define void @{ENTRY}(ptr noalias %arguments, ptr noalias %results) nounwind {{\n{w.text()}\n}}"
    return unit.module(body), form, unit


class Kernel:
    """A compiled function; `python` is the same in plain Python."""

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self.python = function
        self._made: dict[Any, Compiled] = {}
        self._count = function.__code__.co_argcount
        self._known: dict[int, tuple[tuple[Any, ...], Form, bytes]] = {}
        self._kept = 0  # bytes of the arrays of known tuples

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        """Run compiled; arrays are changed in place. Raises CompileError, and TypeError for what kernels do not take."""
        if keywords or len(arguments) != self._count:
            import inspect

            bound = inspect.signature(self.python).bind(*arguments, **keywords)
            bound.apply_defaults()
            arguments = bound.args
        if PLAIN:
            return self._in_python(arguments)
        key: list[Any] = [_quick]
        numbers: list[Any] = []
        for each in arguments:
            if isinstance(each, tuple):
                taken = self._known.get(id(each)) or self._get_to_know(each)
                key.append(taken[1])
                numbers.append(taken[2])
            else:
                _take(each, key, numbers)
        made = self._made.get(found := tuple(key))
        if made is None:
            made = self._compile(found, arguments)
            if made is None:
                return self._in_python(arguments)
        return made(numbers)

    def _get_to_know(self, x: tuple[Any, ...]) -> tuple[tuple[Any, ...], Form, bytes]:
        """Take a tuple. Neither the numbers in it change nor the places of its arrays: it is known when it comes again,
        unless that would keep much in memory."""
        taken, weight = _taken(x), _weight(x)
        if weight < MOST_KEPT:
            if len(self._known) >= MOST_KNOWN or self._kept + weight > MOST_KEPT:
                self._known.clear()
                self._kept = 0
            self._known[id(x)] = taken
            self._kept += weight
        return taken

    def _compile(self, key: Any, arguments: tuple[Any, ...]) -> Compiled | None:
        with _LOCK, _timed():
            if key not in self._made and (made := _compiled(self.python, arguments)) is not None:
                self._made[key] = made
            return self._made.get(key)

    def _in_python(self, arguments: tuple[Any, ...]) -> Any:
        with np.errstate(all="ignore"):
            return self.python(*map(_scalars, arguments))


def _scalars(x: Any) -> Any:
    """An argument with NumPy's floats in place of Python's, which raise errors where IEEE 754 gives infinity or NaN."""
    if isinstance(x, tuple):
        parts = [_scalars(each) for each in x]
        return tuple(parts) if type(x) is tuple else tuple.__new__(type(x), parts)
    return np.float64(x) if type(x) is float else x


def _compiled(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Compiled | None:
    from particlesim.compiler import machine

    key: list[Any] = []
    for each in arguments:
        _take(each, key, [])
    entry = None if CHECKED else store.entry(function, tuple(key), machine.identity(_quick))
    kept = store.read(entry)
    if kept is None and not _compiling.get():
        if _much.get():
            raise NotKept(function.__name__)
        return None
    if kept is None:
        text, form, unit = write(function, arguments)
        shared = [_shared(part.text) for part in unit.parts.values()]
        code = machine.object_code(text, _quick)
        store.write(entry, code, form, unit, [path for path, _ in shared])
        codes = [*(made for _, made in shared), code]
    else:
        codes, form = kept
    loaded = machine.Code(codes, ENTRY)
    # Tuples come packed: so many bytes.
    parts = (f"{8 * len(_kinds(x))}s" if isinstance(x, tuple) else _format(x) for x in arguments)
    return Compiled(_CALL(loaded.address), struct.Struct("".join(parts)).pack, kinds_in(form), form, loaded)


def _shared(text: str) -> tuple[Any, bytes]:
    """The code of a shared function, and where it is kept: on disk from another kernel that calls it, or made now."""
    from particlesim.compiler import machine

    path = None if CHECKED else store.shared(text, machine.identity(_quick))
    kept = store.read_code(path)
    if kept is not None:
        return path, kept[1]
    code = machine.object_code(text, _quick)
    store.write_code(path, {}, code)
    return path, code


def kernel(function: Callable[..., Any]) -> Any:
    """Decorator: compile a function for the hot path. It releases the GIL and is kept on disk.

    It takes numbers, arrays, None, functions and (named) tuples of them, and returns numbers. It cannot allocate arrays: the
    caller passes scratch.
    """
    return Kernel(function)


_MODE = os.environ.get("PSIM_KERNELS", "")
if _MODE not in ("", "python", "checked", "quick"):
    raise UsageError(
        f"PSIM_KERNELS is {_MODE!r}",
        hint="python runs kernels uncompiled, checked looks at every index, quick compiles sooner what runs slower",
    )
PLAIN = _MODE == "python"
"""Whether kernels run as plain Python: slow, for finding mistakes."""
CHECKED = _MODE == "checked"
"""Whether kernels look at every index (`bounds`)."""
_quick = _MODE == "quick"
"""Whether kernels are hardly optimised. They may differ from others in the last bits, so neither is taken for the other."""

_compiling = ContextVar("compiling", default=True)
_much = ContextVar("much", default=False)


class NotKept(Exception):
    """A kernel that is not on disk is called where nothing is compiled, and would be too slow in plain Python."""


@contextmanager
def uncompiled() -> Iterator[None]:
    """In this thread nothing is compiled: kernels that are not kept on disk run as plain Python, or raise NotKept within
    `much(True)`."""
    before = _compiling.set(False)
    try:
        yield
    finally:
        _compiling.reset(before)


@contextmanager
def quickly(really: bool = True) -> Iterator[None]:
    """In this process, if `really`, kernels compile in an eighth of the time and run slower: for many short runs."""
    global _quick
    before, _quick = _quick, really or _quick
    try:
        yield
    finally:
        _quick = before


@contextmanager
def much(really: bool) -> Iterator[None]:
    """In this thread, if `really`, the work is too much for plain Python: see `uncompiled`."""
    before = _much.set(really or _much.get())
    try:
        yield
    finally:
        _much.reset(before)


# How long it takes


@contextmanager
def _timed() -> Iterator[None]:
    global _spent, _began
    _began = time.perf_counter()
    for listener in tuple(_BUSY):
        listener(True)
    try:
        yield
    finally:
        _spent += time.perf_counter() - _began
        _began = 0.0
        for listener in tuple(_BUSY):
            listener(False)


def compiling_seconds() -> float:
    """Wall-clock time that this process has spent on compiling so far [s]."""
    return _spent + (time.perf_counter() - _began if _began else 0.0)


@contextmanager
def told_of_compiling(listener: Callable[[bool], None]) -> Iterator[None]:
    """Calls `listener` with True when this process begins to compile and with False when it ends, in whatever thread."""
    _BUSY.append(listener)
    try:
        yield
    finally:
        _BUSY.remove(listener)
