"""Which runs a sweep has: lists, functions, zips, samples; and what makes no sense."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import qmc

from particlesim.errors import PsimError, ScenarioError, UsageError
from particlesim.sweep import Design, Listed, Sampled, parse_axis


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=1,2,5", (1, 2, 5)),
        ("a=1e-3", (1e-3,)),
        ('a="x, y",z,true', ("x, y", "z", True)),
        ("a=[1, 2],[3, 4]", ([1, 2], [3, 4])),
        ("a={ x = 1, y = 2 },3", ({"x": 1, "y": 2}, 3)),
        ("a=linspace(0, 1, 5)", (0.0, 0.25, 0.5, 0.75, 1.0)),
        ("a=linspace(1, 3, 3)", (1, 2, 3)),
        ("a=logspace(-1, 1, 3),7", (0.1, 1.0, 10.0, 7)),
    ],
)
def test_lists(text: str, values: tuple[object, ...]) -> None:
    axis = parse_axis(text)
    assert isinstance(axis, Listed)
    assert axis.values == values
    assert [type(value) for value in axis.values] == [type(value) for value in values]


def test_ranges() -> None:
    assert parse_axis("a=uniform(1, 3)") == Sampled("a", 1, 3, False)
    logarithmic = parse_axis("a=loguniform(1, 100)")
    assert isinstance(logarithmic, Sampled)
    assert logarithmic.at(0.5) == pytest.approx(10)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a", "not of the form"),
        ("=1", "not of the form"),
        ("a=", "has no values"),
        ("a=1,,2", "value"),
        ("a=linspace(0, 1)", "does not name 3"),
        ("a=linspace(0, 1, 0)", "whole number of values"),
        ("a=linspace(0, 1, 2.5)", "whole number of values"),
        ("a=linspace(0, 1, 10000001)", "from 1 to 10,000,000, not 10,000,001"),
        ("a=linspace(0, nan, 2)", "does not name 3"),
        ("a=logspace(0, 1000, 2)", "not finite"),
        ("a=linspacee(0, 1, 2)", "no function"),
        ("a=uniform(1, 1)", "is empty"),
        ("a=loguniform(0, 1)", "above 0"),
        ("a=uniform(0, 1),2", "stands alone"),
        ("a=5 mm", "TOML"),
    ],
)
def test_nonsense(text: str, message: str) -> None:
    with pytest.raises(PsimError, match=message):
        parse_axis(text)


def test_values_that_are_no_list_are_told_how_lists_are_written() -> None:
    with pytest.raises(ScenarioError) as error:
        parse_axis("a=0:1:5")
    assert "linspace(0, 1, 11)" in str(error.value.diagnostics[0].hint)


A, B = Listed("a", (1, 2)), Listed("b", ("x", "y", "z"))
U, V = Sampled("u", 0.0, 1.0, False), Sampled("v", 10.0, 20.0, False)


def test_every_combination_the_last_fastest() -> None:
    design = Design((A, B))
    runs = [tuple(design.settings(k).values()) for k in range(len(design))]
    assert runs == [(1, "x"), (1, "y"), (1, "z"), (2, "x"), (2, "y"), (2, "z")]
    with pytest.raises(IndexError):
        design.settings(6)


def test_zip() -> None:
    design = Design((A, Listed("c", (3, 4))), zipped=True)
    assert [design.settings(k) for k in range(len(design))] == [{"a": 1, "c": 3}, {"a": 2, "c": 4}]


def test_sobol_points_are_those_of_scipy() -> None:
    design = Design((U, V), samples=8, seed=5)
    points = qmc.Sobol(2, scramble=True, seed=5).random(8)  # as docs/sweeps.md says
    runs = np.array([list(design.settings(k).values()) for k in range(8)])
    assert runs.tobytes() == (points * [1, 10] + [0, 10]).tobytes()


@pytest.mark.parametrize("method", ["sobol", "lhs", "random"])
def test_samples_fill_the_range_and_depend_on_the_seed_alone(method) -> None:
    def values(seed: int) -> list[object]:
        design = Design((V, U), samples=10, method=method, seed=seed)
        return [design.settings(k)["v"] for k in range(len(design))]

    assert values(1) == values(1)
    assert values(1) != values(2)
    assert all(10 <= value < 20 for value in values(1))
    if method == "lhs":  # one in every tenth
        assert sorted(int(value) for value in values(1)) == list(range(10, 20))


def test_lists_and_samples() -> None:
    design = Design((A, U), samples=3, method="random")
    assert len(design) == 6
    drawn = [design.settings(k)["u"] for k in range(6)]
    assert drawn[:3] == drawn[3:]


def test_large_designs_are_counted_not_made() -> None:
    many = tuple(Listed(name, tuple(range(1000))) for name in "abcd")
    assert len(Design(many)) == 10**12
    assert Design(many).settings(10**12 - 1) == dict.fromkeys("abcd", 999)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"axes": ()}, "nothing to vary"),
        ({"axes": (A, A)}, "varied twice"),
        ({"axes": (A, B), "zipped": True}, "same length: a has 2, b has 3"),
        ({"axes": (U,)}, "how often"),
        ({"axes": (A,), "samples": 3}, "nothing to draw"),
        ({"axes": (U,), "samples": 0}, "must be 1 or more"),
        ({"axes": (U,), "samples": 10**7 + 1}, "samples are more than"),
        ({"axes": (U,), "samples": 2**70}, "samples are more than"),
        ({"axes": tuple(Listed(f"k{k}", (0,) * 10**4) for k in range(5))}, "these are 1e+20 runs"),
        ({"axes": (U,), "samples": 2, "method": "sobl"}, 'did you mean "sobol"'),
        ({"axes": (U,), "samples": 2, "seed": -1}, "seed"),
    ],
)
def test_wrong_designs(arguments, message: str) -> None:
    with pytest.raises(UsageError) as caught:
        Design(**arguments)
    assert message in str(caught.value)
