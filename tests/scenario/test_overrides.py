"""Overrides: addressing by name, type and index, TOML values, and errors that list what there is."""

from copy import deepcopy
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from particlesim.errors import ScenarioError, UsageError
from particlesim.scenario.text.overrides import (
    apply_overrides,
    dotted_path,
    overrides_from_mapping,
    parse_override,
    resolve_path,
)
from particlesim.scenario.text.source import parse_source

from .toy import GOOD


def changed(*arguments: str, text: str = GOOD) -> dict[str, Any]:
    return apply_overrides(parse_source(text), [parse_override(a) for a in arguments]).raw


def test_addresses() -> None:
    raw = changed(
        "simulation.dt=1e-3",
        "forces.air.coefficient = 0.3",
        "forces.gravity.acceleration=[0, -1, 0]",
        "particles.0.layout.position.0.1='3 cm'",
        "particles.ball.speed={type='uniform', low=1, high=2}",
        'title="a=b"',
        "output.fps=60",
    )
    assert raw["simulation"]["dt"] == 1e-3
    assert raw["forces"][1]["coefficient"] == 0.3
    assert raw["forces"][0]["acceleration"] == [0, -1, 0]
    assert raw["particles"][0]["layout"]["position"] == [[0, "3 cm", 0]]
    assert raw["particles"][0]["speed"] == {"type": "uniform", "low": 1, "high": 2}
    assert raw["title"] == "a=b"
    assert raw["output"] == {"fps": 60}


def test_the_source_is_left_as_it_was() -> None:
    source = parse_source(GOOD)
    before = deepcopy(source.raw)
    value = {"type": "uniform", "low": [1]}
    after = apply_overrides(source, overrides_from_mapping({"particles.ball.speed": value}))
    after.raw["particles"][0]["speed"]["low"].append(2)
    assert source.raw == before
    assert value == {"type": "uniform", "low": [1]}


def test_the_last_override_wins_and_later_ones_see_earlier_ones() -> None:
    raw = changed("simulation.dt=1", "simulation.dt=2", "forces.air.name='wind'", "forces.wind.coefficient=5")
    assert raw["simulation"]["dt"] == 2
    assert raw["forces"][1]["coefficient"] == 5


def test_a_name_comes_before_a_type_and_an_index() -> None:
    raw = {"forces": [{"type": "drag", "name": "a"}, {"type": "x", "name": "drag"}, {"name": "0"}]}
    assert resolve_path(raw, "forces.drag.k") == ("forces", 1, "k")
    assert resolve_path(raw, "forces.0.k") == ("forces", 2, "k")
    assert resolve_path(raw, "forces.1") == ("forces", 1)
    assert resolve_path({"a": {"b c": 1}}, 'a."b c"') == ("a", "b c")


@pytest.mark.parametrize(
    ("argument", "message", "allowed", "hint"),
    [
        ("forces.iar.x=1", "forces has no entry 'iar'", "gravity, air", 'did you mean "air"?'),
        ("forces.2.x=1", "forces has no entry '2'", "gravity, air", None),
        ("forces.-1.x=1", "forces has no entry '-1'", "gravity, air", None),
        ("simulation.dt.x=1", "simulation.dt is 0.002, it has no 'x'", None, None),
        ("a..b=1", "'a..b' is not a key", None, "for example"),
        ("simulation.dt=abc", "the value is not valid TOML", None, "--set 'simulation.dt=\"abc\"'"),
        ("simulation.dt=", "the value is not valid TOML", None, "give a value"),
        ("simulation.dt=1\nx = 2", "the value is not a single TOML value", None, None),
        ("simulation.dt=[1, 2", "this '[' is not closed", None, None),
        ("simulation.dt=" + "[" * 5000, "the value is not a TOML value", None, None),
    ],
)
def test_mistakes(argument: str, message: str, allowed: str | None, hint: str | None) -> None:
    with pytest.raises(ScenarioError) as caught:
        changed(argument)
    (found,) = caught.value.diagnostics
    assert found.message == message
    assert found.allowed == allowed
    assert (hint or "") in (found.hint or "")


def test_an_ambiguous_type_asks_for_a_name() -> None:
    text = '[[forces]]\ntype = "drag"\n[[forces]]\ntype = "drag"\n'
    with pytest.raises(ScenarioError, match="2 entries of forces have the type 'drag'"):
        changed("forces.drag.k=1", text=text)


@pytest.mark.parametrize("argument", ["simulation.dt", "=3", " = 3"])
def test_not_an_assignment(argument: str) -> None:
    with pytest.raises(UsageError, match="not of the form key=value"):
        parse_override(argument)


@given(st.text(max_size=30) | st.from_regex(r"\A[a-f0.\"']{1,10}=[\[\]{}\"'a-e0-9.,=\n]{0,12}\Z"))
def test_any_argument_is_applied_or_explained(argument: str) -> None:
    try:
        changed(argument)
    except UsageError as error:
        assert str(error)  # noqa: PT017


@pytest.mark.parametrize(
    "path",
    [
        ("forces", 1, "coefficient"),
        ("forces", 0),
        ("particles", 0, "layout", "position", 0, 2),
        ("simulation",),
    ],
)
def test_dotted_path_is_the_inverse(path: tuple[str | int, ...]) -> None:
    raw = parse_source(GOOD).raw
    assert resolve_path(raw, dotted_path(raw, path)) == path
