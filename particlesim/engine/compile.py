"""Teaches the compiler the generics of `particlesim.laws`: the record's type selects the law, which is inlined."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import overload

from particlesim.engine.cache import INLINE
from particlesim.laws import GENERICS, HELPERS, Generic


def is_record(t: types.Type) -> bool:
    """Whether a compiler type is a record (a NamedTuple), not a plain tuple of records."""
    return isinstance(t, types.NamedTuple | types.NamedUniTuple)


def precision(particle: types.Type) -> types.Type:
    """The floating-point type of a particle's position."""
    return particle.types[0] if hasattr(particle, "types") else particle.dtype


def _teach(generic: Generic) -> None:
    function = generic.function

    def select(f: Any, p: Any) -> Callable[..., Any] | None:
        if is_record(f):
            return generic.laws.get(f.instance_class)
        return _sum(f, p)

    def _sum(f: Any, p: Any) -> Callable[..., Any] | None:
        if generic.size == 0 or not isinstance(f, types.BaseTuple):
            return None
        if len(f) == 1:
            return lambda f, p: function(f[0], p)
        if generic.size == 1:
            if len(f) == 0:
                return _zero_scalar(p)
            return lambda f, p: function(f[0], p) + function(f[1:], p)
        if generic.size == 3:
            if len(f) == 0:
                return _zero_vector(p)
            return lambda f, p: add3(function(f[0], p), function(f[1:], p))
        return None

    overload(function, jit_options=INLINE, strict=False)(select)


def stub(*_: Any) -> Any:
    """Body of a function whose implementations are chosen by types."""
    raise TypeError("this function exists only inside kernels")


def _zero_scalar(p: types.Type) -> Callable[..., Any]:
    zero = precision(p)
    return lambda f, p: zero(0)


def _zero_vector(p: types.Type) -> Callable[..., Any]:
    zero = precision(p)
    return lambda f, p: (zero(0), zero(0), zero(0))


def add3(a: Any, b: Any) -> Any:
    """Sum of two vectors."""
    return stub()


def inline(stub: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorator: `select(types...)` returns the implementation of `stub` for these types; it is inlined."""

    def register(select: Callable[..., Any]) -> Callable[..., Any]:
        overload(stub, jit_options=INLINE, strict=False)(select)
        return select

    return register


@inline(add3)
def _add3(a: Any, b: Any) -> Callable[..., Any]:
    return lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _teach_helper(function: Callable[..., Any]) -> None:
    overload(function, jit_options=INLINE, strict=False)(lambda *_: function)


for _helper in HELPERS:
    _teach_helper(_helper)
for _generic in GENERICS.values():
    _teach(_generic)
