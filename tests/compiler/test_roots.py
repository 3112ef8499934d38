"""The reciprocal root by products: near enough, and with the bits of plain Python."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from typing import Any

import numpy as np

from particlesim.compiler import kernel
from particlesim.compiler.roots import inverse_sqrt, root


@kernel
def roots_of(x: Any, y: Any) -> None:
    for i in range(x.size):
        y[i] = inverse_sqrt(x[i])


def numbers() -> np.ndarray:
    rng = np.random.default_rng(3)
    return np.concatenate([np.exp(rng.uniform(-700, 700, 1000)), rng.uniform(1, 4, 1000), [1.0, 4.0, 0.25]])


def test_compiled_roots_have_the_bits_of_python() -> None:
    x = numbers()
    found = np.empty_like(x)
    roots_of(x, found)
    assert found.tolist() == [float(inverse_sqrt(each)) for each in x]


def test_roots_are_within_11_tenths_of_the_last_place() -> None:
    with localcontext(prec=40):
        for x in numbers().tolist():
            expected = 1 / Decimal(x).sqrt()
            assert abs(Decimal(inverse_sqrt(x)) - expected) <= Decimal(1.1 * math.ulp(float(expected)))


def test_a_nan_stays_one() -> None:
    assert math.isnan(inverse_sqrt(math.nan))


def test_a_root_is_within_two_units_of_the_last_place() -> None:
    for x in numbers().tolist():
        assert abs(root(x) - math.sqrt(x)) <= 2 * math.ulp(math.sqrt(x))
    assert root(0.0) == 0
    assert root(np.float32(2)) == np.sqrt(np.float32(2))
