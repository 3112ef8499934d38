"""`[render] styles`: only what exists can be drawn, and only as what it is."""

from __future__ import annotations

from pathlib import Path

import pytest

import particlesim as ps

SCENE = """
[simulation]
duration = 1.0
dt = 0.01

[[particles]]
name = "sheet"
layout = { type = "cloth", size = [1, 1], resolution = [3, 3] }
springs = { structural = 1.0 }

[[particles]]
name = "dust"
layout = { type = "points", position = [[0, 1, 0]] }

[[springs]]
name = "tie"
on = "sheet"
pairs = [[0, 8]]
stiffness = 1.0

[render]
"""


@pytest.mark.parametrize(
    "styles",
    ["{}", '{ sheet = "lines", tie = "hidden" }', '{ sheet = "surface", dust = "hidden", tie = "lines" }'],
)
def test_styles_of_what_there_is(styles: str) -> None:
    scenario = ps.loads(SCENE + f"styles = {styles}\n")
    assert all(name in ("sheet", "dust", "tie") for name in scenario.render.styles)


def test_looks_by_name_are_of_what_there_is() -> None:
    looks = 'colors = { dust = [1, 0, 0], tie = [0, 1, 0] }\nline_radius = { tie = "2 mm", sheet = 0.001 }\n'
    render = ps.loads(SCENE + looks).render
    assert render.colors == {"dust": (1, 0, 0), "tie": (0, 1, 0)}
    assert render.line_radius == {"tie": 0.002, "sheet": 0.001}


@pytest.mark.parametrize(
    ("look", "says"),
    [
        ("colors = { shet = [1, 0, 0] }", "no group, springs or rods are called 'shet'"),
        ("colors = { sheet = [2, 0, 0] }", "must be at most 1"),
        ("line_radius = { tye = 0.1 }", "no group, springs or rods are called 'tye'"),
        ("line_radius = { dust = 0.1 }", "no springs or rods join the particles of 'dust'"),
    ],
)
def test_looks_of_what_there_is_not(look: str, says: str) -> None:
    with pytest.raises(ps.ScenarioError) as caught:
        ps.loads(SCENE + look + "\n")
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("styles", "says"),
    [
        ('{ shet = "lines" }', "no group, springs or rods are called 'shet'"),
        ('{ dust = "surface" }', "'dust' has no surface"),
        ('{ dust = "lines" }', "no springs or rods join"),
        ('{ tie = "surface" }', "springs and rods are lines or hidden"),
        ('{ sheet = "wool" }', "wool"),
    ],
)
def test_styles_of_what_there_is_not(styles: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE + f"styles = {styles}\n")
    with pytest.raises(ps.ScenarioError) as caught:
        ps.load(path)
    assert says in str(caught.value)
    assert f"scene.toml:{SCENE.count(chr(10)) + 1}:" in str(caught.value)
