"""Elementary functions against 40 digits, special values, exact identities, and the same bits everywhere."""

from __future__ import annotations

import ast
import hashlib
import inspect
import itertools
import math
import random
import struct
from collections.abc import Callable, Iterable
from typing import Any

import mpmath
import numpy as np
import pytest
from bench import derive_polynomials
from bench.accuracy_elementary import CASES, Case, Source, values, worst

from particlesim.compiler import elementary, polynomials, roots

INF, NAN = math.inf, math.nan
COUNT = 300
SOURCE = Source(COUNT, seed=2)

ONE_ARGUMENT = ("exp", "expm1", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")


@pytest.mark.parametrize("case", CASES, ids=[f"{c.name} {c.bound}" for c in CASES])
def test_errors_stay_below_one_ulp(case: Case) -> None:
    for sample in case.samples(Source(COUNT, seed=1)):
        found = values(case.name, *(a.tolist() for a in sample.arguments))
        error, where = worst(sample, found, case.truth)
        assert error <= case.bound, f"{sample.range}: {case.name}{where}"


# Special values.

SPECIAL = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    -0.5,
    2.0,
    -2.0,
    3.0,
    -3.0,
    5e-324,
    -5e-324,
    2.0**-1022,
    1.7976931348623157e308,
]
SPECIAL += [
    -1.7976931348623157e308,
    2.0**53 - 1,
    -(2.0**53 - 1),
    1e17,
    -1e17,
    1 + 2.0**-52,
    1 - 2.0**-53,
    INF,
    -INF,
    NAN,
]


def same(a: float, b: float) -> bool:
    """Equal with the sign of zero, both NaN, or neighbours."""
    if math.isnan(a) or math.isnan(b):
        return math.isnan(a) and math.isnan(b)
    if a == 0 or b == 0 or math.isinf(a) or math.isinf(b):
        return a == b and math.copysign(1, a) == math.copysign(1, b)
    return abs(a - b) <= math.ulp(b)


def c_power(x: float, y: float) -> float:
    """pow of the C library, without Python's errors."""
    sign = math.copysign(1, x) if y % 2 == 1 else 1.0
    try:
        return math.pow(x, y)
    except OverflowError:
        return sign * INF
    except ValueError:
        return sign * INF if x == 0 else NAN


OTHERS: dict[str, Callable[..., Any]] = {
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "atan2": math.atan2,
    "power": c_power,
}


def compare(name: str, *columns: Iterable[float]) -> None:
    """Special values are those of the C library."""
    rows = list(zip(*columns, strict=True))
    with np.errstate(all="ignore"):
        for found, row in zip(values(name, *zip(*rows, strict=True)), rows, strict=True):
            truth = float(OTHERS.get(name, getattr(np, name, None))(*row))
            assert same(found, truth), f"{name}{row} = {found}, not {truth}"


@pytest.mark.parametrize("name", ONE_ARGUMENT)
def test_special_values_are_those_of_the_standard(name: str) -> None:
    # The circle has its own answer far out.
    far = 2.0**50 if name in ("sin", "cos", "tan") else INF
    compare(name, [x for x in SPECIAL if abs(x) < far or not math.isfinite(x)])


@pytest.mark.parametrize("name", ["power", "atan2"])
def test_special_values_of_two_arguments_are_those_of_the_standard(name: str) -> None:
    compare(name, *zip(*itertools.product(SPECIAL, SPECIAL), strict=True))


def test_overflow_and_underflow_begin_where_they_must() -> None:
    assert values("exp", [709.782712893384, 709.7827128933841]) == [1.7976931348622732e308, INF]
    assert values("exp", [-745.1332191019411, -745.1332191019412]) == [5e-324, 0.0]
    assert values("expm1", [709.7827128933841, -40.0, -1e300]) == [INF, -1.0, -1.0]
    assert values("cosh", [710.4758600739439, 710.475860073944]) == [1.7976931348621744e308, INF]
    assert values("sinh", [-710.4758600739439, -710.475860073944]) == [-1.7976931348621744e308, -INF]
    assert values("power", [2.0, 2.0, 2.0, 2.0], [1023.0, 1024.0, -1074.0, -1076.0]) == [
        2.0**1023,
        INF,
        5e-324,
        0.0,
    ]
    assert values("tanh", [19.1, -25.0, 1e300]) == [1.0, -1.0, 1.0]


# Identities that hold to the last bit.


def test_whole_powers_are_exact_where_they_fit() -> None:
    rows = [(b, n) for b in range(-30, 31) for n in range(40) if b and abs(b**n) < 2**53]
    found = values("power", [float(b) for b, _ in rows], [float(n) for _, n in rows])
    assert found == [float(b**n) for b, n in rows]
    n = [float(k) for k in range(-1074, 1024)]
    assert values("power", [2.0] * len(n), n) == [math.ldexp(1.0, int(k)) for k in n]
    x = SOURCE.wide(-1074, 1023).tolist()
    assert values("power", x, [1.0] * COUNT) == x
    assert values("power", x, [-0.0] * COUNT) == [1.0] * COUNT


def test_symmetries_are_exact() -> None:
    x = SOURCE.wide(-1074, 40).tolist()
    minus = [-a for a in x]
    for name in ("sin", "tan", "atan", "sinh", "tanh"):
        assert values(name, minus) == [-a for a in values(name, x)]
    for name in ("cos", "cosh"):
        assert values(name, minus) == values(name, x)
    inside = SOURCE.uniform(-1, 1).tolist()
    assert values("asin", [-a for a in inside]) == [-a for a in values("asin", inside)]


def test_landmarks_are_exact() -> None:
    assert values("exp", [0.0, -0.0, 1.0]) == [1.0, 1.0, math.e]
    assert values("log", [1.0, math.e, 2.0]) == [0.0, 1.0, math.log(2.0)]
    assert values("acos", [1.0, -1.0, 0.0]) == [0.0, math.pi, math.pi / 2]
    assert values("asin", [1.0, 0.0]) == [math.pi / 2, 0.0]
    assert values("atan", [1.0, INF]) == [math.pi / 4, math.pi / 2]
    assert values("atan2", [0.0, -0.0, 1.0, 1.0], [-1.0, -1.0, -1.0, 0.0]) == [
        math.pi,
        -math.pi,
        3 * math.pi / 4,
        math.pi / 2,
    ]
    assert values("log", [math.ldexp(1.0, k) for k in range(-1074, 1024)]) == pytest.approx(
        [k * math.log(2.0) for k in range(-1074, 1024)], rel=3e-16
    )


@pytest.mark.parametrize(
    ("name", "centre", "rises"),
    [
        ("exp", 0.0, True),
        ("exp", math.log(2.0) / 2, True),  # where the exponent steps
        ("expm1", math.log(2.0) / 2, True),
        ("log", 1.0, True),
        ("log", math.sqrt(2.0), True),
        ("log", 2.0, True),
        ("sin", math.pi / 4, True),
        ("cos", math.pi / 4, False),
        ("tan", math.pi / 4, True),
        ("atan", math.sqrt(2.0) - 1, True),
        ("atan", 1.0, True),
        ("asin", 0.5, True),
        ("acos", -0.5, False),
        ("sinh", 0.5, True),
        ("tanh", 0.5, True),
    ],
)
def test_functions_are_monotone_across_their_seams(name: str, centre: float, rises: bool) -> None:
    # A few ulps apart, so that half an ulp of rounding on either side cannot be seen: a jump at the seam would be.
    step = 4 * max(math.ulp(centre), 2.0**-52)
    found = values(name, [centre + k * step for k in range(-100, 101)])
    assert found == sorted(found, reverse=not rises)


def test_results_stay_in_their_ranges() -> None:
    quarter_turns = SOURCE.quarter_turns(2**20).tolist()
    assert max(map(abs, values("sin", quarter_turns) + values("cos", quarter_turns))) <= 1.0
    tiny = SOURCE.positive(-1074, -900).tolist()
    assert max(values("atan2", tiny, [-1.0] * COUNT)) <= math.pi
    assert max(map(abs, values("tanh", SOURCE.uniform(15, 23).tolist()))) <= 1.0
    assert min(values("cosh", SOURCE.wide(-60, 0).tolist())) >= 1.0
    assert max(map(abs, values("asin", [1.0, -1.0, 1 - 2.0**-53]))) <= math.pi / 2


def test_circular_functions_far_out_are_bounded_and_then_at_rest() -> None:
    far = SOURCE.wide(30, 50).tolist()
    with mpmath.workdps(60):
        for name in ("sin", "cos"):
            for found, x in zip(values(name, far), far, strict=True):
                assert abs(found - getattr(mpmath, name)(mpmath.mpf(x))) < 2.0**-52
    beyond = SOURCE.wide(50, 1023).tolist()
    assert set(values("sin", beyond)) == {0.0}
    assert set(values("cos", beyond)) == {1.0}
    assert set(values("tan", beyond)) == {0.0}


def test_modulo_is_that_of_python() -> None:
    x, y = SOURCE.wide(-40, 40).tolist(), SOURCE.wide(-10, 30).tolist()
    x += [5.0, -5.0, 6.0, -6.0, 0.0, -0.0, -1e-20, 3.0, -3.0]
    y += [3.0, 3.0, -3.0, 3.0, -2.0, 2.0, 1.0, INF, INF]
    found = values("modulo", x, y)
    assert [struct.pack("<d", a) for a in found] == [
        struct.pack("<d", a % b) for a, b in zip(x, y, strict=True)
    ]
    assert all(map(math.isnan, values("modulo", [1.0, INF, NAN, 1.0], [0.0, 1.0, 1.0, NAN])))
    assert values("modulo", [1e300, -1e300], [1.0, 3.0]) == [0.0, 0.0]


# The same bits everywhere.


def digest() -> str:
    """A hash of all functions at arguments that are made of random bits."""
    rng = random.Random(20)

    def argument(low: int, high: int) -> float:
        return math.ldexp(
            rng.choice([-1.0, 1.0]) * (2**52 + rng.getrandbits(52)), rng.randrange(low, high) - 52
        )

    digest = hashlib.sha256()
    for name in (*ONE_ARGUMENT, "power", "atan2", "modulo"):
        count = 1 if name in ONE_ARGUMENT else 2
        low, high = (-20, 0) if name in ("asin", "acos") else (-20, 9)
        columns = [[argument(low, high) for _ in range(200)] for _ in range(count)]
        if name in ("log", "power"):
            columns[0] = [abs(x) for x in columns[0]]
        digest.update(struct.pack("<200d", *values(name, *columns)))
    return digest.hexdigest()


def test_bits_are_those_of_every_other_machine() -> None:
    assert digest() == "9b86161b6bc568dc9771027cf563c9e877ddc2e0c2bafef2b47c31cff028f31a"


def test_functions_have_no_branches_and_no_loops_but_over_coefficients() -> None:
    tree = ast.parse(inspect.getsource(elementary) + inspect.getsource(roots.polynomial))
    assert not [n for n in ast.walk(tree) if isinstance(n, ast.If | ast.While | ast.Try | ast.BoolOp)]
    loops = [n for n in ast.walk(tree) if isinstance(n, ast.For)]
    assert [ast.unparse(n.iter) for n in loops] == ["coefficients[1:]"]


def test_public_functions_are_exact() -> None:
    assert all(function.exact for function in elementary.ELEMENTARY.values())  # type: ignore[attr-defined]


def test_polynomials_are_what_their_derivation_gives() -> None:
    assert inspect.getsource(polynomials) == derive_polynomials.module()
