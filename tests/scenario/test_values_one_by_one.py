"""A mass, radius or temperature for each particle, as a list."""

import math

import numpy as np
import pytest

import particlesim as ps
from particlesim.scenario.dump import dump

TWO = """
[simulation]
duration = 0.25
dt = 0.01
[[particles]]
name = "two"
layout = { type = "points", position = [[0, 0, 0], [1, 0, 0]] }
mass = [1, "3 kg"]
[[springs]]
on = "two"
pairs = [[0, 1]]
rest_length = 0.5
stiffness = 3
"""


def test_a_list_gives_each_particle_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    # The centre of mass rests at (1·0 + 3·1)/4; the light end starts to move three times as fast as the heavy one.
    monkeypatch.setattr("particlesim.engine.islands.initial.CHUNK", 1)
    final = ps.run(ps.loads(TWO)).final
    moved = final.position[:, 0] - [0.0, 1.0]
    assert moved[0] == pytest.approx(-3 * moved[1], rel=1e-12)
    assert np.dot([1, 3], final.position[:, 0]) / 4 == pytest.approx(0.75, abs=1e-12)
    assert moved[0] > 0


def test_radii_and_a_density_give_masses() -> None:
    text = TWO.replace(
        'mass = [1, "3 kg"]', 'radius = ["1 cm", 0.02]\ndensity = 1000\ntemperature = [300, "40 degC"]'
    )
    scenario = ps.loads(text, {"output.fields": ["mass", "radius", "temperature"]})
    final = ps.run(scenario).final
    assert final["radius"] == pytest.approx([0.01, 0.02])
    assert final["mass"] == pytest.approx([4 / 3 * math.pi * 1000 * r**3 for r in (0.01, 0.02)])
    assert final["temperature"] == pytest.approx([300, 313.15])
    assert ps.loads(dump(scenario)) == scenario


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"3 kg"', '"3 kg", 4', "3 values for 2 particles"),
        ('"3 kg"', "0", "must be greater than 0"),
        ('[1, "3 kg"]', "[]", "must have at least 1 element"),
        ('[1, "3 kg"]', "[1, 2]\nradius = 1\ndensity = 2", "the third follows from two"),
        ('[1, "3 kg"]', "1\nradius = [0, 1]\ndensity = 2", "mass, radius and density are given"),
        ('mass = [1, "3 kg"]', "radius = [0, 1]\ndensity = 2", "the radius must be greater than 0"),
        (
            '{ type = "points", position = [[0, 0, 0], [1, 0, 0]] }',
            '{ type = "rope", start = [0, 0, 0], end = [1, 0, 0], count = 2 }',
            "the mass of a rope is that of the whole body",
        ),
        (
            '{ type = "points", position = [[0, 0, 0], [1, 0, 0]] }',
            '{ type = "file", path = "a.csv" }',
            "its file may have a column mass",
        ),
    ],
)
def test_lists_that_do_not_fit(old: str, new: str, said: str) -> None:
    with pytest.raises(ps.ScenarioError, match=said):
        ps.loads(TWO.replace(old, new))


def test_emitters_take_distributions() -> None:
    text = '[simulation]\nduration = 1\ndt = 0.1\n[[emitters]]\nrate = 3\nshape = { type = "point" }\nmass = [1, 2]'
    with pytest.raises(ps.ScenarioError, match='type = "choice", values'):
        ps.loads(text)
