"""Teaches the compiler the generics of `particlesim.laws`: the record's type selects the law, which is inlined.

The forces are imported here so that their generics and helpers are declared before they are taught, whichever module a
program imports first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit, types
from numba.extending import overload

import particlesim.bonds
import particlesim.forces
import particlesim.motions  # noqa: F401
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
        if len(f) == 0:
            return _zeros(p, generic.size)
        if len(f) == 1:
            return lambda f, p: function(f[0], p)
        # By halves: the compiler recurses, and would run out of stack on a long chain.
        half = len(f) // 2
        if generic.size == 1:
            return lambda f, p: function(f[:half], p) + function(f[half:], p)
        return lambda f, p: add(function(f[:half], p), function(f[half:], p))

    overload(function, jit_options=INLINE, strict=False)(select)


def stub(*_: Any) -> Any:
    """Body of a function whose implementations are chosen by types."""
    raise TypeError("this function exists only inside kernels")


def _zeros(p: types.Type, size: int) -> Callable[..., Any]:
    zero = precision(p)
    if size == 1:
        return lambda f, p: zero(0)
    if size == 3:
        return lambda f, p: (zero(0), zero(0), zero(0))
    return lambda f, p: (zero(0), zero(0), zero(0), zero(0), zero(0), zero(0), zero(0), zero(0), zero(0))


def add(a: Any, b: Any) -> Any:
    """Sum of two vectors or two matrices."""
    return stub()


def outline(stub: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorator like `inline` for what is rarely called: compiled as a function of its own."""

    def register(select: Callable[..., Any]) -> Callable[..., Any]:
        overload(stub, jit_options={**INLINE, "forceinline": False}, strict=False)(select)
        return select

    return register


def inline(stub: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorator: `select(types...)` returns the implementation of `stub` for these types; it is inlined."""

    def register(select: Callable[..., Any]) -> Callable[..., Any]:
        overload(stub, jit_options=INLINE, strict=False)(select)
        return select

    return register


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator for a function of one implementation that kernels call by its name."""
    overload(function, jit_options=INLINE, strict=False)(lambda *_: function)
    return function


def outlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator like `inlined` for what is long or called in many places: compiled as a function of its own."""
    overload(function, jit_options={**INLINE, "forceinline": False}, strict=False)(lambda *_: function)
    return function


def spliced(function: Callable[..., Any]) -> Any:
    """Decorator for what is long and called once: its statements become those of the caller before anything is compiled.

    An outlined function is optimised and turned into machine code once by itself and again in every caller, along with all
    that it calls. Choosing by types works in what is called, not in a spliced function itself.
    """
    return njit(inline="always", **{key: INLINE[key] for key in ("fastmath", "error_model")})(function)


@inlined
def times(a: Any, x: Any, y: Any, z: Any) -> Any:
    """Matrix times vector."""
    return (
        a[0] * x + a[1] * y + a[2] * z,
        a[3] * x + a[4] * y + a[5] * z,
        a[6] * x + a[7] * y + a[8] * z,
    )


@inline(add)
def _add(a: Any, b: Any) -> Callable[..., Any]:
    if len(a) == 3:
        return lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2])
    return lambda a, b: (
        a[0] + b[0],
        a[1] + b[1],
        a[2] + b[2],
        a[3] + b[3],
        a[4] + b[4],
        a[5] + b[5],
        a[6] + b[6],
        a[7] + b[7],
        a[8] + b[8],
    )


for _helper in HELPERS:
    inlined(_helper)
for _generic in GENERICS.values():
    _teach(_generic)
