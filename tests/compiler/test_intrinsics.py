"""The plain meaning of the intrinsics: rounded once, and IEEE 754's results where Python would raise an error."""

from __future__ import annotations

import math
import random
import struct
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from particlesim.compiler import kernel, transpose
from particlesim.compiler.intrinsics import bits_of, copysign, exact, floor, fma, nearest, number_of, sqrt
from particlesim.compiler.unit import CompileError


def number(rng: random.Random) -> float:
    return math.ldexp(rng.choice([-1.0, 1.0]) * (2**52 + rng.getrandbits(52)), rng.randrange(-60, 0))


def test_fma_rounds_once() -> None:
    rng = random.Random(1)
    for _ in range(500):
        a, b = number(rng), number(rng)
        c = -a * b + number(rng) * 2.0**-60
        assert fma(a, b, c) == float(Fraction(a) * Fraction(b) + Fraction(c))
    assert fma(1 + 2.0**-52, 1 - 2.0**-52, -1.0) == -(2.0**-104)


def test_nothing_raises() -> None:
    assert fma(1e300, 1e300, 0.0) == math.inf
    assert all(map(math.isnan, (fma(math.inf, 0.0, 1.0), sqrt(-1.0), nearest(math.nan), floor(math.nan))))
    assert (nearest(math.inf), floor(-math.inf), sqrt(math.inf)) == (math.inf, -math.inf, math.inf)


def test_nearest_takes_the_even_of_two_and_keeps_signs() -> None:
    assert [nearest(x) for x in (0.5, 1.5, 2.5, -0.5, -1.5, 2.4999)] == [0.0, 2.0, 2.0, 0.0, -2.0, 2.0]
    assert [math.copysign(1, x) for x in (nearest(-0.3), floor(-0.0), sqrt(-0.0))] == [-1.0, -1.0, -1.0]
    assert (floor(-0.5), floor(2.7), copysign(3.0, -0.0)) == (-1.0, 2.0, -3.0)


def test_bits_come_and_go() -> None:
    assert (bits_of(1.0), bits_of(-0.0), bits_of(2.0**-1074)) == (1023 << 52, -(2**63), 1)
    for x in (0.0, -1.5, math.pi, 5e-324, math.inf, -math.inf, math.nan):
        assert struct.pack("<d", number_of(bits_of(x))) == struct.pack("<d", x)
    assert number_of(bits_of(1.0) + 2**64) == 1.0


def test_exact_marks_a_function_and_leaves_it_as_it_is() -> None:
    def double(x: float) -> float:
        return 2 * x

    assert exact(double) is double
    assert double.exact  # type: ignore[attr-defined]


def test_transpose_turns_rows_from_anywhere_into_columns() -> None:
    @kernel
    def turned(source: Any, which: Any, into: Any) -> None:
        rows = tuple(which[k] for k in range(8))
        transpose(source, rows, 3, into, 1)
        transpose(into, (1, 2, 3, 4, 5, 6, 7, 8), 0, into, 9)

    rng = np.random.default_rng(1)
    source, which = rng.random((20, 12)), np.array([7, 0, 19, 3, 3, 11, 2, 5])
    expected = source[which, 3:11].T
    for work in (turned, turned.python):
        into = np.zeros((18, 8))
        work(source, which, into)
        assert (into[1:9] == expected).all()
        assert (into[9:17] == expected.T).all()
        assert not into[[0, 17]].any()
    with pytest.raises(CompileError, match="rows contiguous"):
        turned(source.T, which, np.zeros((18, 8)))
