"""From a scenario to the look of its pictures."""

import pytest

import particlesim as ps
from particlesim.render.film import ball_shapes, look_of, mesh_shapes

CONTACT = """
[simulation]
duration = 1
dt = 0.1
[[particles]]
name = "balls"
radius = 0.1
layout = { type = "points", position = [[0, 0, 0], [0.3, 0, 0], [0.6, 0, 0]] }
[[springs]]
name = "touch"
on = "balls"
pairs = [[0, 1]]
stiffness = 1
rest_length = 0.2
compression_only = true
[[springs]]
name = "link"
on = "balls"
pairs = [[1, 2]]
stiffness = 1
"""
SHEET = """
[simulation]
duration = 1
dt = 0.1
[[particles]]
name = "sheet"
layout = { type = "cloth", size = [1, 1], resolution = [3, 3] }
[[particles]]
name = "ball"
layout = { type = "points", position = [[0, 1, 0]] }
"""


def test_springs_that_only_push_are_contact_and_not_drawn() -> None:
    assert look_of(ps.loads(CONTACT)).styles == {"touch": "hidden"}
    asked = ps.loads(CONTACT, {"render.styles": {"touch": "lines"}})
    assert look_of(asked).styles == {"touch": "lines"}


@pytest.mark.parametrize(
    ("opacity", "said"),
    [
        ({"ball": 0.5}, "'ball' has no surface"),
        ({"shet": 0.5}, 'did you mean "sheet"'),
        ({"sheet": 1.5}, "must be at most 1"),
    ],
)
def test_only_surfaces_can_be_seen_through(opacity: dict[str, float], said: str) -> None:
    assert ps.loads(SHEET, {"render.opacity": {"sheet": 0.5}}).render.opacity == {"sheet": 0.5}
    glass = '[[colliders]]\nname = "glass"\ntype = "sphere"\nradius = 1.0\n'
    scenario = ps.loads(SHEET + glass, {"render.opacity": {"glass": 0.3}})
    assert ball_shapes(scenario) == ()
    assert [each.opacity for each in mesh_shapes(scenario)] == [0.3]
    with pytest.raises(ps.ScenarioError, match=said):
        ps.loads(SHEET, {"render.opacity": opacity})
