"""Elementary functions against 40 digits, special values, exact identities, and the same bits everywhere."""

from __future__ import annotations

import ast
import hashlib
import inspect
import itertools
import math
import random
import struct
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

from particlesim.compiler import elementary, polynomials

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))
import derive_polynomials  # noqa: E402

INF, NAN = math.inf, math.nan
COUNT = 400

TRUTH: dict[str, Callable[..., Any]] = {
    **{name: getattr(mpmath, name) for name in ("exp", "expm1", "log", "sin", "cos", "tan", "asin", "acos")},
    **{name: getattr(mpmath, name) for name in ("atan", "atan2", "sinh", "cosh", "tanh", "power")},
}


def values(name: str, *columns: Iterable[float]) -> list[float]:
    """The function at every row of arguments."""
    function = getattr(elementary, name)
    return [function(*row) for row in zip(*columns, strict=True)]


def worst(name: str, *columns: list[float]) -> float:
    """Largest error in units of the last place of the true value."""
    errors = []
    with mpmath.workdps(40):
        for found, *row in zip(values(name, *columns), *columns, strict=True):
            truth = TRUTH[name](*map(mpmath.mpf, row))
            ulp = mpmath.mpf(2) ** max(mpmath.frexp(truth)[1] - 53, -1074)
            assert math.isfinite(found), f"{name}{tuple(row)} = {found}"
            errors.append(float(abs(found - truth) / ulp))
    return max(errors)


def uniform(low: float, high: float, seed: int = 1) -> list[float]:
    return np.random.default_rng(seed).uniform(low, high, COUNT).tolist()


def wide(low: int, high: int, *, signed: bool = True, seed: int = 2) -> list[float]:
    """Numbers of both signs and of magnitudes from 2**low to 2**high."""
    rng = np.random.default_rng(seed)
    signs = rng.choice([-1.0, 1.0], COUNT) if signed else np.ones(COUNT)
    return np.ldexp(signs * rng.uniform(1, 2, COUNT), rng.integers(low, high, COUNT)).tolist()


def beside(points: Iterable[float]) -> list[float]:
    """Points with their neighbours."""
    return [y for x in points for y in (x, math.nextafter(x, INF), math.nextafter(x, -INF))]


def multiples(limit: int) -> list[float]:
    """The numbers next to multiples of π/2, where sine or cosine loses all digits of a careless reduction."""
    rng = random.Random(3)
    return beside(float(rng.randrange(1, limit) * mpmath.mpf(math.pi / 2)) for _ in range(COUNT))


CIRCLE = [uniform(-0.8, 0.8), uniform(-100, 100), wide(-1074, 30), uniform(-(2.0**30), 2.0**30), multiples(2**29)]
ARC = [uniform(-1, 1), wide(-1074, -1), [1 - x for x in wide(-53, -2, signed=False)], [0.5 + x for x in wide(-50, -5)]]
HYPERBOLIC = [uniform(-1, 1), uniform(-25, 25), wide(-1074, 8)]

ONE_ARGUMENT = {
    # Results that are nearly subnormal are rounded twice.
    "exp": (0.76, [uniform(-1, 1), uniform(-745.1, 709.78), wide(-60, 9), uniform(709.7, 709.78)]),
    "expm1": (0.62, [uniform(-1, 1), uniform(-60, 709.78), uniform(20, 80), wide(-1074, 9)]),
    "log": (0.65, [uniform(0.5, 2), [1 + x for x in wide(-52, -2)], wide(-1074, 1023, signed=False)]),
    "sin": (0.75, CIRCLE),
    "cos": (0.75, CIRCLE),
    "tan": (0.92, CIRCLE),
    "asin": (0.67, ARC),
    "acos": (0.67, ARC),
    "atan": (0.67, [uniform(-1, 1), uniform(-5, 5), wide(-1074, 1023), beside([math.sqrt(2) - 1, 1.0])]),
    "sinh": (0.65, [*HYPERBOLIC, uniform(709, 710.47)]),
    "cosh": (0.55, [*HYPERBOLIC, uniform(709, 710.47)]),
    "tanh": (0.62, HYPERBOLIC),
}


@pytest.mark.parametrize("name", ONE_ARGUMENT)
def test_errors_stay_below_one_ulp(name: str) -> None:
    bound, ranges = ONE_ARGUMENT[name]
    for x in ranges:
        assert worst(name, [a for a in x if math.isfinite(a)]) <= bound


@pytest.mark.parametrize(
    ("x", "bound"),
    [
        (wide(-1074, 1023, signed=False), 0.76),
        ([1 + x for x in wide(-52, -2)], 0.76),
        (uniform(1.40, 1.42), 0.76),
        (uniform(0.70, 0.71), 0.76),
    ],
)
def test_powers_stay_below_one_ulp_up_to_overflow_and_underflow(x: list[float], bound: float) -> None:
    logarithms = uniform(-744, 709.7, seed=5)
    y = [logarithm / math.log(a) for a, logarithm in zip(x, logarithms, strict=True)]
    assert worst("power", x, y) <= bound


def test_powers_of_every_day_stay_near_half_an_ulp() -> None:
    assert worst("power", uniform(0, 10), uniform(-5, 5, seed=6)) <= 0.54
    signed = uniform(-10, 10)
    exponents = [float(n) for n in np.random.default_rng(7).integers(-20, 20, COUNT)]
    assert worst("power", signed, exponents) <= 0.54


def test_angles_stay_below_one_ulp() -> None:
    assert worst("atan2", uniform(-1, 1), uniform(-1, 1, seed=8)) <= 0.67
    assert worst("atan2", wide(-1074, 1023, seed=9), wide(-1074, 1023, seed=10)) <= 0.76
    for low, high in ((-1074, -1020), (1000, 1023)):
        assert worst("atan2", wide(low, high, seed=11), wide(low, high, seed=12)) <= 0.76
    x = uniform(0.1, 1)
    for slope in (1.0, math.sqrt(2) - 1, math.sqrt(2) + 1):
        y = [a * slope * (1 + d) for a, d in zip(x, wide(-50, -5), strict=True)]
        assert worst("atan2", y, x) <= 0.7


# Special values.

SPECIAL = [0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 2.0, -2.0, 3.0, -3.0, 5e-324, -5e-324, 2.0**-1022, 1.7976931348623157e308]
SPECIAL += [-1.7976931348623157e308, 2.0**53 - 1, -(2.0**53 - 1), 1e17, -1e17, 1 + 2.0**-52, 1 - 2.0**-53, INF, -INF, NAN]


def same(a: float, b: float) -> bool:
    """Equal with the sign of zero, both NaN, or neighbours."""
    if math.isnan(a) or math.isnan(b):
        return math.isnan(a) and math.isnan(b)
    if a == 0 or b == 0 or math.isinf(a) or math.isinf(b):
        return a == b and math.copysign(1, a) == math.copysign(1, b)
    return abs(a - b) <= math.ulp(b)


NUMPY = {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2}


def compare(name: str, *columns: Iterable[float]) -> None:
    """Special values are those of the C library, which NumPy passes on."""
    rows = list(zip(*columns, strict=True))
    with np.errstate(all="ignore"):
        for found, row in zip(values(name, *zip(*rows, strict=True)), rows, strict=True):
            truth = float(NUMPY.get(name, getattr(np, name, None))(*map(np.float64, row)))
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
    assert values("exp", [709.782712893384, 709.7827128933841]) == [1.797693134862273e308, INF]
    assert values("exp", [-745.1332191019411, -745.1332191019412]) == [5e-324, 0.0]
    assert values("expm1", [709.7827128933841, -40.0, -1e300]) == [INF, -1.0, -1.0]
    assert values("cosh", [710.4758600739439, 710.475860073944]) == [1.7976931348621744e308, INF]
    assert values("sinh", [-710.4758600739439, -710.475860073944]) == [-1.7976931348621744e308, -INF]
    assert values("power", [2.0, 2.0, 2.0, 2.0], [1023.0, 1024.0, -1074.0, -1076.0]) == [2.0**1023, INF, 5e-324, 0.0]
    assert values("tanh", [19.1, -25.0, 1e300]) == [1.0, -1.0, 1.0]


# Identities that hold to the last bit.


def test_whole_powers_are_exact_where_they_fit() -> None:
    rows = [(b, n) for b in range(-30, 31) for n in range(40) if b and abs(b**n) < 2**53]
    found = values("power", [float(b) for b, _ in rows], [float(n) for _, n in rows])
    assert found == [float(b**n) for b, n in rows]
    n = [float(k) for k in range(-1074, 1024)]
    assert values("power", [2.0] * len(n), n) == [math.ldexp(1.0, int(k)) for k in n]
    x = wide(-1074, 1023)
    assert values("power", x, [1.0] * COUNT) == x
    assert values("power", x, [-0.0] * COUNT) == [1.0] * COUNT


def test_symmetries_are_exact() -> None:
    x = wide(-1074, 40)
    minus = [-a for a in x]
    for name in ("sin", "tan", "atan", "sinh", "tanh"):
        assert values(name, minus) == [-a for a in values(name, x)]
    for name in ("cos", "cosh"):
        assert values(name, minus) == values(name, x)
    inside = uniform(-1, 1)
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
    quarter_turns = multiples(2**20)
    assert max(map(abs, values("sin", quarter_turns) + values("cos", quarter_turns))) <= 1.0
    tiny = wide(-1074, -900, signed=False)
    assert max(values("atan2", tiny, [-1.0] * COUNT)) <= math.pi
    assert max(map(abs, values("tanh", uniform(15, 23)))) <= 1.0
    assert min(values("cosh", wide(-60, 0))) >= 1.0
    assert max(map(abs, values("asin", [1.0, -1.0, 1 - 2.0**-53]))) <= math.pi / 2


def test_circular_functions_far_out_are_bounded_and_then_at_rest() -> None:
    far = wide(30, 50)
    with mpmath.workdps(60):
        for name in ("sin", "cos"):
            for found, x in zip(values(name, far), far, strict=True):
                assert abs(found - TRUTH[name](mpmath.mpf(x))) < 2.0**-52
    beyond = wide(50, 1023)
    assert set(values("sin", beyond)) == {0.0}
    assert set(values("cos", beyond)) == {1.0}
    assert set(values("tan", beyond)) == {0.0}


def test_modulo_is_that_of_python() -> None:
    x, y = wide(-40, 40), wide(-10, 30, seed=13)
    x += [5.0, -5.0, 6.0, -6.0, 0.0, -0.0, -1e-20, 3.0, -3.0]
    y += [3.0, 3.0, -3.0, 3.0, -2.0, 2.0, 1.0, INF, INF]
    found = values("modulo", x, y)
    assert [struct.pack("<d", a) for a in found] == [struct.pack("<d", a % b) for a, b in zip(x, y, strict=True)]
    assert all(map(math.isnan, values("modulo", [1.0, INF, NAN, 1.0], [0.0, 1.0, 1.0, NAN])))
    assert values("modulo", [1e300, -1e300], [1.0, 3.0]) == [0.0, 0.0]


# The same bits everywhere.


def digest() -> str:
    """A hash of all functions at arguments that are made of random bits."""
    rng = random.Random(20)

    def argument(low: int, high: int) -> float:
        return math.ldexp(rng.choice([-1.0, 1.0]) * (2**52 + rng.getrandbits(52)), rng.randrange(low, high) - 52)

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
    assert digest() == "@DIGEST@"


def test_functions_have_no_branches_and_no_loops_but_over_coefficients() -> None:
    tree = ast.parse(inspect.getsource(elementary))
    assert not [n for n in ast.walk(tree) if isinstance(n, ast.If | ast.While | ast.Try | ast.BoolOp)]
    loops = [n for n in ast.walk(tree) if isinstance(n, ast.For)]
    assert [ast.unparse(n.iter) for n in loops] == ["coefficients[1:]"]


def test_public_functions_are_exact() -> None:
    assert all(function.exact for function in elementary.ELEMENTARY.values())  # type: ignore[attr-defined]


def test_polynomials_are_what_their_derivation_gives() -> None:
    assert inspect.getsource(polynomials) == derive_polynomials.module()
