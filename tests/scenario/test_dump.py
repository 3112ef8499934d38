"""load → dump → load gives an equal scenario, to the last bit of each float."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from particlesim.scenario.dump import dump, to_table

from .toy import GOOD, Drag, Gravity, Lattice, Normal, Particles, Points, Scenario, Simulation, Uniform, load

finite = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(min_value=0, exclude_min=True, allow_infinity=False)
names = st.text(st.characters(blacklist_categories=("Cs",)), max_size=6)
vectors = st.tuples(finite, finite, finite)
speeds = (
    finite
    | st.builds(Normal, mean=finite, std=st.floats(min_value=0, allow_infinity=False))
    | st.builds(lambda a, b: Uniform(low=min(a, b), high=max(a, b)), finite, finite)
)
layouts = st.builds(Points, position=st.lists(vectors, min_size=1, max_size=3).map(tuple)) | st.builds(
    Lattice, count=st.integers(1, 2**62)
)
groups = st.builds(
    Particles,
    name=st.from_regex(r"\A[a-z_][a-z0-9_-]{0,5}\Z"),
    layout=layouts,
    mass=positive,
    speed=speeds,
    pinned=st.booleans() | st.lists(st.integers(0, 9), max_size=3),
)
forces = st.builds(Gravity, name=names, acceleration=vectors) | st.builds(
    Drag, name=names, coefficient=positive, on=st.none()
)
scenarios = st.builds(
    Scenario,
    title=names,
    simulation=st.builds(Simulation, duration=positive, dt=positive, seed=st.integers(-(2**63), 2**63 - 1)),
    particles=st.lists(groups, max_size=3),
    forces=st.lists(forces, max_size=3),
)


@given(scenarios, st.booleans())
def test_round_trip(scenario: Scenario, defaults: bool) -> None:
    text = dump(scenario, defaults=defaults)
    assert load(text) == scenario
    assert dump(load(text), defaults=defaults) == text


@pytest.mark.parametrize("defaults", [True, False])
def test_text_of_the_good_scenario(defaults: bool) -> None:
    table = tomllib.loads(dump(load(GOOD), defaults=defaults))
    assert table["forces"][0]["type"] == "gravity"
    assert table["particles"][0]["mass"] == 0.145
    assert ("seed" in table["simulation"]) == defaults
    assert "on" not in table["forces"][0]


def test_tables_hold_what_toml_has() -> None:
    assert to_table(Gravity(acceleration=(0, 1, 2))) == {"type": "gravity", "acceleration": [0.0, 1.0, 2.0]}
