"""Kernels with parts that are called for in another order than they are linked in."""

from typing import Any

import numba

from particlesim.engine.cache import INLINE, kernel
from particlesim.engine.compile import inline, outline, stub


def inner(x: Any) -> Any:
    return stub()


def unused(x: Any) -> Any:
    return stub()


def outer(x: Any) -> Any:
    return stub()


@outline(inner)
def _inner(x):
    return lambda x: 3 * x


@outline(unused)
def _unused(x):
    return lambda x: inner(x) + 1


@inline(outer)
def _outer(x):
    return lambda x: inner(x) - 1


def calls_one_for_nothing(x, n):
    if n * 0 != 0:  # which the compiler of Python does not see, and LLVM does
        return unused(x)
    return outer(x)


def test_parts_that_nobody_calls_take_nothing_with_them():
    # `unused` is linked first, with `inner`, and its call is gone by then: `inner` must not be left out with it.
    assert kernel(calls_one_for_nothing)(2.0, 1) == 5


def test_functions_that_are_compiled_in_the_ordinary_way_can_call_parts():
    assert numba.njit(error_model=INLINE["error_model"])(calls_one_for_nothing)(2.0, 1) == 5
