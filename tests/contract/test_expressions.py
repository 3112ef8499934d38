"""Expressions of scenario files: grammar, slopes, and texts that mean harm or nothing."""

from __future__ import annotations

import ast
import math
from typing import Any

import numpy as np
import pytest
from contract.cases import EXPRESSIONS, particles
from hypothesis import given, settings
from hypothesis import strategies as st

from particlesim.expressions.discontinuities import creased, jumping
from particlesim.expressions.operations import (
    FUNCTIONS,
    VARIABLES,
    VX,
    Constant,
    Radius,
    Ray,
    Square,
    X,
    slope,
    value,
)
from particlesim.expressions.parser import (
    BUILTIN_CONSTANTS,
    MAX_DEPTH,
    MAX_LENGTH,
    ExpressionError,
    parse,
    reads,
)
from particlesim.forces import Field
from particlesim.laws.registry import Particle, force, force_dx

PARTICLES = particles(8)
P = PARTICLES[0]
EPS = np.finfo(float).eps


def at(text: str, p: Particle = P, **constants: float) -> float:
    return float(value(parse(text, constants), p))


def failure(text: str, **constants: float) -> ExpressionError:
    with pytest.raises(ExpressionError) as caught:
        parse(text, constants)
    return caught.value


# Grammar


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 + 2*3", 7),
        ("(1 + 2)*3", 9),
        ("2**3**2", 512),
        ("-2**2", -4),
        ("2**-1", 0.5),
        ("8/4/2", 1),
        ("7 - 4 - 2", 1),
        ("-3*-2", 6),
        ("+-+2", -2),
        ("1e-3*.5e3", 0.5),
        ("16 + 1_000", 1016),
        ("2 if 1 < 2 else 3", 2),
        ("2 if 1 > 2 else 3", 3),
        ("2 if 2 <= 2 else 3", 2),
        ("2 if 2 >= 3 else 3 if 1 < 0 else 4", 4),
        ("min(2, 3) + 10*max(2, 3)", 32),
        ("sign(-0.3) + abs(-2)", 1),
        ("atan2(0, -1)", math.pi),
        ("hypot(3, 4)", 5),
        ("log(e**2) + cos(pi)", 1),
        ("(1 +\n 2)", 3),
        ("  1 + 1\t", 2),
        ("1 if 1<2else 3", 1),
    ],
)
def test_meaning(text: str, expected: float) -> None:
    assert at(text) == pytest.approx(expected, rel=4 * EPS)


@pytest.mark.parametrize("name", VARIABLES)
def test_variables(name: str) -> None:
    assert at(name) == getattr(P, name)
    assert reads(parse(f"2*sin({name})", {}), type(VARIABLES[name]))


def test_given_constants_and_their_precedence() -> None:
    assert at("k*x", k=3.0) == 3 * P.x
    assert at("e", e=1.602e-19) == 1.602e-19, "a given constant hides a built-in one"
    assert at("e") == math.e == BUILTIN_CONSTANTS["e"]


def test_constants_are_folded() -> None:
    assert parse("2*pi*50", {}) == Constant(2 * math.pi * 50)
    assert parse("sin(k)**2 + 1", {"k": 0.0}) == Constant(1.0)
    assert parse("x**2", {}) == Square(X())
    assert parse("x**(3 - 2)", {}) == X()
    assert parse("x**0", {}) == Constant(1.0)
    assert not reads(parse("x**(1 - 1) * r", {}), X)


def test_reads() -> None:
    assert not reads(parse("x + y*t", {}), VX)
    assert reads(parse("x if r < 1 else y", {}), Radius)


# Slopes: five-point central difference with h = 10⁻³; the cases have fifth derivatives below 10³ of their scale.


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_slopes(text: str) -> None:
    node = parse(text, {})
    for p in PARTICLES:
        for name in Particle._fields:
            h = 1e-3
            f = [value(node, p._replace(**{name: getattr(p, name) + k * h})) for k in (-2, -1, 1, 2)]
            expected = (8 * (f[2] - f[1]) - (f[3] - f[0])) / (12 * h)
            direction = Particle(*(float(n == name) for n in Particle._fields))
            scale = max(1.0, *(abs(v) for v in f), abs(expected))
            assert slope(node, Ray(p, direction)) == pytest.approx(expected, abs=1e-8 * scale)


def test_slopes_are_linear_in_the_direction() -> None:
    d = Particle(0.3, -0.5, 0.7, 0.2, 0.1, -0.4, 0.5, 0.6, 0.7, 0.8)
    for text in EXPRESSIONS:
        node = parse(text, {})
        parts = [slope(node, Ray(P, Particle(*(d[k] * (j == k) for k in range(10))))) for j in range(10)]
        assert slope(node, Ray(P, d)) == pytest.approx(sum(parts), abs=1e-13 * max(1.0, *map(abs, parts)))


@pytest.mark.parametrize(
    "text",
    [
        "hypot(x, y)**2",
        "sqrt(x**2 + y**2)",
        "hypot(x, y)**3",
        "(x**2 + y**2)**0.5",
        "abs(x) + abs(y)",
        "(x**2)**(1+t)",
    ],
)
def test_a_particle_at_the_center_of_a_potential_feels_no_force(text: str) -> None:
    p = P._replace(x=0.0, y=0.0)
    fx, fy, fz = force(Field(potential=text).record(), p)
    assert (fx, fy, fz) == (0, 0, 0)


def test_a_negative_base_may_have_a_variable_exponent_that_stands_still() -> None:
    node = parse("x**(2 + 0*y)", {})
    p = P._replace(x=-3.0)
    assert slope(node, Ray(p, Particle(1.0, *[0.0] * 9))) == -6


def test_jacobian_of_a_potential() -> None:
    # U = ½ k x² y: F = (−k x y, −½ k x², 0)
    record = Field(potential="k/2*x**2*y", constants={"k": 3.0}).record()
    expected = [[-3 * P.y, -3 * P.x, 0], [-3 * P.x, 0, 0], [0, 0, 0]]
    np.testing.assert_allclose(np.reshape(force_dx(record, P), (3, 3)), expected, rtol=0, atol=1e-9 * 10)


# Texts that are no expressions


@pytest.mark.parametrize(
    ("text", "offset"),
    [
        ("__import__('os')", 0),
        ("x + __import__('os').system('true')", 4),
        ("x.__class__", 0),
        ("1 + (1).real", 4),
        ("sin.__globals__", 0),
        ("lambda: x", 0),
        ("2*(lambda: x)()", 3),
        ("[x for x in (1, 2)]", 0),
        ("x + 'abc'", 4),
        ('x + b"a"', 4),
        ("(y := 3)", 1),
        ("x[0]", 0),
        ("x + f'{x}'", 4),
        ("{1: 2}", 0),
        ("x, y", 0),
        ("x and y", 0),
        ("not x", 0),
        ("~x", 0),
        ("x < y", 0),
        ("1 if x else 2", 5),
        ("1 if x < y < z else 2", 5),
        ("1 if x == y else 2", 5),
        ("1 if x in y else 2", 5),
        ("x // 2", 0),
        ("y + x % 2", 4),
        ("x @ y", 0),
        ("x ^ 2", 0),
        ("x << 2", 0),
        ("await x", 0),
        ("True", 0),
        ("None", 0),
        ("...", 0),
        ("1j", 0),
        ("3 + sin", 4),
        ("sin()", 0),
        ("2*sin(x, y)", 2),
        ("sin(a=x)", 0),
        ("sin(*x)", 0),
        ("hypot(x)", 0),
        ("eval(x)", 0),
        ("x + foo", 4),
        ("µ + foo", 0),
        ("x*ж", 2),
        ('"жжж"', 1),
        ("(x +\n foo)", 6),
        ("(x +\r\n foo)", 7),
        ("  x + foo", 6),
        ("x +", 2),
        ("x + * y", 4),
        ("(x + y", 0),
        ("x y", 2),
        ("x\ny", 2),
        ("x; y", 1),
        ("1e", 0),
        ("x = 3", 2),
        ("x\0", 1),
        ("жx + \0", 0),
        ("x\ud800", 1),
        ("x + \u200by", 4),
        ("1/0", 0),
        ("x + log(0)", 4),
        ("x*sqrt(-1)", 2),
        ("(-8)**(1/3)*x", 0),
        ("9**9**9", 0),
        ("x + 9**9**9**9", 7),
        ("x*1e999", 2),
        ("9" * 1000, 0),
        ("0x" + "f" * 1000, 0),
        ("", 0),
        ("   ", 0),
        ("# x", 0),
        ("x + y # both", 6),
        ("x + 0x10", 4),
        ("0b1*x", 0),
        ("ｘ + y", 0),
        ("x² + y", 1),
    ],
)
def test_refused_with_its_place(text: str, offset: int) -> None:
    error = failure(text)
    assert error.offset == offset
    assert error.length >= 1
    assert error.offset + error.length <= max(len(text), 1)


def test_other_letters_are_refused_even_for_constants() -> None:
    # Python takes the micro sign for the Greek letter; an expression takes neither.
    error = failure("k + (µ_ж*2 + eval)", k=1.0, μ_ж=2.0)
    assert (error.offset, error.length) == (5, 1)
    assert failure("x²").hint == "write **2"


@pytest.mark.parametrize(
    "text",
    [
        "(" * 10**5 + "x" + ")" * 10**5,
        "(" * 900 + "x" + ")" * 900,
        "-" * (MAX_LENGTH - 1) + "x",
        "+" * (MAX_LENGTH - 1) + "x",
        "sin(" * 300 + "x" + ")" * 300,
        "x-(" * 400 + "x" + ")" * 400,
        "**".join(["x"] * 600),
        "**".join(["9"] * 600),
        "x if x < 1 else " * 120 + "x",
        "[" * 500,
        "x." * 900,
        "x" * (MAX_LENGTH + 1),
    ],
)
def test_monsters_are_refused(text: str) -> None:
    failure(text)


def test_depth_is_bounded_and_the_bound_is_usable() -> None:
    parse("sin(" * MAX_DEPTH + "x" + ")" * MAX_DEPTH, {})
    error = failure("sin(" * (MAX_DEPTH + 1) + "x" + ")" * (MAX_DEPTH + 1))
    assert error.offset == 4 * (MAX_DEPTH + 1)


@pytest.mark.parametrize("signs", ["+", "-", "+-", "-++"])
def test_a_long_sum_or_product_is_no_deep_one(signs: str) -> None:
    """Twenty terms with operations inside them, and as many as there is room for, against sums from left to right; rounding
    is in the last bits of the largest. Inside of a function, each is one level deeper."""

    def term(k: int) -> str:
        return f"abs(x - {k}*{k})"

    for many in (17, 20, 100):
        text = term(0) + "".join(signs[k % len(signs)] + term(k) for k in range(1, many))
        known = abs(P.x) + sum(
            (1 if signs[k % len(signs)] == "+" else -1) * abs(P.x - k * k) for k in range(1, many)
        )
        assert at(text) == pytest.approx(known, rel=1e-13, abs=1e-9)
        assert at(f"cos(sin({text}))") == pytest.approx(math.cos(math.sin(known)), abs=1e-8)
    assert at("+".join(["x"] * 1000)) == pytest.approx(1000 * P.x, rel=1e-12)
    product = "*".join(f"(x + {k})" for k in range(40))
    assert at(product) == pytest.approx(math.prod(P.x + k for k in range(40)), rel=1e-13)
    failure("sin(" * (MAX_DEPTH - 3) + "+".join(["x"] * 20) + ")" * (MAX_DEPTH - 3))


def test_sums_that_are_not_deep_keep_their_bits() -> None:
    """(a + b) + c and a + (b + c) round differently: only what would be too deep is cut in halves."""
    text = "+".join(["x"] + ["1e-17"] * MAX_DEPTH)
    node = parse(text, {})
    for _ in range(MAX_DEPTH):
        node = node[0]
    assert node == parse("x", {})


def test_suggestions() -> None:
    assert "'sin'" in (failure("sinn(x)").hint or "")
    assert "'stiffness'" in (failure("stifness*x", stiffness=1.0).hint or "")
    assert "**" in (failure("x^2").hint or "")


@given(st.text(max_size=60))
def test_any_text_is_an_expression_or_an_expression_error(text: str) -> None:
    check_harmless(text)


@given(
    st.lists(
        st.sampled_from(
            [
                *VARIABLES,
                *FUNCTIONS,
                *"()+-*/<>=,.:[]{}'\"\\\n# ~^%@;!é",
                "**",
                "if",
                "else",
                "lambda",
                "9",
                "1e5",
                "_",
                "\r\n",
            ]
        ),
        max_size=25,
    ).map("".join)
)
@settings(max_examples=300)
def test_almost_expressions_are_expressions_or_errors(text: str) -> None:
    check_harmless(text)


def check_harmless(text: str) -> None:
    try:
        node = parse(text, {"k": 2.0})
    except ExpressionError as error:
        assert 0 <= error.offset <= max(len(text) - 1, 0)  # noqa: PT017
    else:
        assert isinstance(node, tuple)


# Random trees against Python's own arithmetic


PYTHON: dict[str, Any] = {name: getattr(math, name, None) for name in FUNCTIONS} | {
    "abs": abs,
    "min": min,
    "max": max,
    "sign": lambda a: float((a > 0) - (a < 0)),
}

leaves = st.one_of(
    st.sampled_from([*VARIABLES, "pi", "k"]),
    st.floats(0, 1e6, allow_subnormal=False).map(repr),
    st.integers(0, 10**6).map(str),
)


def deeper(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    one = [name for name in FUNCTIONS if len(FUNCTIONS[name]._fields) == 1]  # type: ignore[attr-defined]
    two = [name for name in FUNCTIONS if name not in one]
    return st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/", " + ", "**"]), inner).map("".join),
        st.tuples(st.just("("), inner, st.just(")")).map("".join),
        st.tuples(st.sampled_from("-+"), inner).map("".join),
        st.tuples(st.sampled_from(one), inner).map(lambda t: f"{t[0]}({t[1]})"),
        st.tuples(st.sampled_from(two), inner, inner).map(lambda t: f"{t[0]}({t[1]}, {t[2]})"),
        st.tuples(inner, inner, st.sampled_from(["<", "<=", ">", ">="]), inner, inner).map(
            lambda t: f"({t[0]} if {t[1]} {t[2]} {t[3]} else {t[4]})"
        ),
    )


@given(st.recursive(leaves, deeper, max_leaves=8))
@settings(max_examples=400)
def test_random_expressions_mean_what_python_means(text: str) -> None:
    # Printed without more parentheses than the tree asks for, so that precedence is tried as well.
    names = {**{n: getattr(P, n) for n in VARIABLES}, "pi": math.pi, "k": 2.5}
    try:
        tree = ast.parse(text, mode="eval")
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant):
                node.value = float(node.value)  # type: ignore[arg-type]
        expected = eval(compile(tree, "", "eval"), {"__builtins__": {}}, names | PYTHON)
    except (ArithmeticError, ValueError, TypeError):
        expected = math.nan
    if isinstance(expected, complex) or not math.isfinite(expected):
        return
    try:
        actual = at(text, k=2.5)
    except ExpressionError:  # a constant part is no number, though the whole is: 1/(1/0) is not 0 here
        return
    except (ArithmeticError, TypeError):
        return
    # The same operations in the same order; a² is a·a, hypot is √(a² + b²): compare loosely, precedence is what counts.
    assert actual == pytest.approx(expected, rel=1e-6, abs=1e-6 * (1 + abs(expected)))


# Fields


@pytest.mark.parametrize("name", ["x", "vx", "T", "sin", "hypot", "if", "lambda", "a-b"])
def test_constants_that_no_expression_could_name_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        Field(force=("0", "0", "0"), constants={name: 3.0})


def test_a_field_needs_one_of_force_and_potential() -> None:
    with pytest.raises(ValueError, match="either"):
        Field()
    with pytest.raises(ValueError, match="either"):
        Field(force=("0", "0", "0"), potential="x")
    with pytest.raises(ValueError, match="velocity"):
        Field(potential="vx**2")


def test_a_field_knows_what_it_reads() -> None:
    field = Field(force=("r", "T*m", "vx"))
    assert field.needs() == {"radius", "temperature"}
    assert field.needs_velocity()
    plain = Field(potential="x**2")
    assert plain.needs() == frozenset()
    assert Field(potential="-q*x").needs() == {"charge"}
    assert not plain.needs_velocity()


@pytest.mark.parametrize(
    ("force", "cause"),
    [
        ("-5*sign(vx) + 1", "sign"),
        ("-5 if x > 0 else 5", "a condition"),
        ("1e-3*y if x > 20 else 0", "a condition"),
        ("sign(x - 0.3)*z", "sign"),
        ("sign(sin(x))", "sign"),
        ("-0.1*sign(vx)*vx**2", None),
        ("-100*(y - 1) if y < 1 else 0", None),
        ("-5*abs(vx) + max(x, y) - min(x, 2)", None),
        ("sign(t - 1)", None),
        ("5 if t < 1 else x", None),
        ("-0.1*hypot(vx, vy)*vx", None),
    ],
)
def test_forces_that_jump_are_told_from_those_that_have_a_kink(force: str, cause: str | None) -> None:
    # v |v| and a wall's spring are continuous, whatever they are written with; a change in time alone is no jump in space.
    assert jumping([parse("0", {}), parse(force, {})]) == (None if cause is None else (1, cause))


@pytest.mark.parametrize(
    ("potential", "cause"),
    [
        ("10*abs(x)", "abs"),
        ("max(x, 0)", "max"),
        ("0.5*x**2 + abs(y - 2)", "abs"),
        ("abs(x)**3", None),
        ("max(x, 0)**2", None),
        ("x*abs(x) + sin(y)", None),
    ],
)
def test_potentials_with_a_crease_give_forces_that_jump(potential: str, cause: str | None) -> None:
    assert creased(parse(potential, {})) == cause
