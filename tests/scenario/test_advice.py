"""Doubtful choices are told, others are not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulate import points
from simulate import table as stated

import particlesim as ps
from particlesim.preflight.advice import advice, sliding
from particlesim.scenario.reach import meetings_of
from particlesim.scenario.subject import subject


def table(method: str, force: dict[str, Any], **plane: Any) -> dict[str, Any]:
    """A ball over a plane."""
    return {
        "simulation": {"duration": 1.0, "dt": 0.01, "integrator": method},
        "particles": [{"layout": {"type": "points", "position": [[0, 1, 0]]}, "radius": 0.1}],
        "forces": [force],
        "planes": [plane],
    }


@pytest.mark.parametrize(
    ("method", "force", "told"),
    [
        ("velocity_verlet", {"type": "drag", "fluid": "air"}, True),
        ("yoshida4", {"type": "field", "force": ["-vx", "0", "0"]}, True),
        ("velocity_verlet", {"type": "gravity"}, False),
        ("symplectic_euler", {"type": "drag", "fluid": "air"}, False),  # first order anyway
        ("rk4", {"type": "drag", "fluid": "air"}, False),
    ],
)
def test_order_lost_to_velocity(method: str, force: dict[str, Any], told: bool) -> None:
    said = advice(ps.from_table(table(method, force)))
    assert any("only first order" in line for line in said) is told


def test_lively_projection() -> None:
    gravity = {"type": "gravity"}
    lively = advice(ps.from_table(table("rk4", gravity, restitution=1.0, detection="discrete")))
    assert any("can add energy" in line for line in lively)
    assert advice(ps.from_table(table("rk4", gravity, restitution=0.5, detection="discrete"))) == ()
    assert advice(ps.from_table(table("rk4", gravity, restitution=1.0))) == ()


def test_gravity_twice_and_a_burst_that_never_comes() -> None:
    gravity = {"type": "gravity"}
    copied = table("rk4", gravity) | {"forces": [gravity, gravity]}
    copied["emitters"] = [
        {
            "name": "late",
            "burst": [{"count": 1, "at": 0.9}, {"count": 1, "at": 1.0}],
            "shape": {"type": "point", "position": [0, 1, 0]},
        }
    ]
    said = advice(ps.from_table(copied))
    assert sum("gravity adds up" in line for line in said) == 2  # one for each group
    assert sum("is never born" in line for line in said) == 1
    assert "at 1 s" in next(line for line in said if "never born" in line)


@pytest.mark.parametrize(("height", "told"), [(0.098, None), (0.05, "its contact pushes them out")])
def test_a_soft_grain_that_lies_in_a_plane(height: float, told: str | None) -> None:
    scene = table("rk4", {"type": "gravity"}) | {"planes": [{"name": "floor"}]}
    scene["simulation"] |= {"dt": 1e-3, "duration": 0.01}
    scene["interactions"] = [{"type": "contact", "model": "hertz", "young_modulus": 1e5}]
    scene["particles"][0] |= {"radius": 0.1, "mass": 0.1}
    scene["particles"][0]["layout"]["position"] = [[0, height, 0], [0, 2, 0]]
    inside = [line for line in ps.run(ps.from_table(scene)).warnings if "start inside" in line]
    assert [told in line for line in inside] == ([] if told is None else [True])


@pytest.mark.parametrize(("height", "told"), [(1.0, False), (0.1, False), (0.05, True), (-3.0, True)])
def test_a_start_inside_a_plane(height: float, told: bool) -> None:
    scene = table("rk4", {"type": "gravity"}) | {"planes": [{"name": "floor"}]}
    scene["particles"][0]["layout"]["position"] = [[0, height, 0], [0, 2, 0]]
    warnings = ps.run(ps.from_table(scene)).warnings
    assert any("start inside plane floor" in line for line in warnings) is told
    scene["particles"][0]["pinned"] = True
    assert not ps.run(ps.from_table(scene)).warnings


def test_bodies_without_springs_and_springs_stated_twice() -> None:
    cloth = {"type": "cloth", "size": [1, 1], "resolution": [3, 3]}
    parts = {
        "simulation": {"duration": 1.0, "dt": 0.01},
        "particles": [{"name": "rag", "layout": cloth}, {"name": "wall", "layout": cloth, "pinned": True}],
    }
    assert len(found := advice(ps.from_table(parts))) == 1
    assert "nothing joins the particles of 'rag'" in found[0]
    one = {"name": "one", "on": "rag", "pairs": [[0, 1], [1, 2], [2, 5]], "stiffness": 1.0}
    others = [
        {**one, "name": "string", "tension_only": True},
        {**one, "name": "damper", "stiffness": 0.0, "damping": 1.0},
        {**one, "name": "two", "pairs": [[2, 1], [1, 0], [3, 4]]},
    ]
    assert advice(ps.from_table({**parts, "springs": [one, *others]})) == (
        "one and two both join particles 2 and 1, and 1 more pairs: their stiffness adds up",
    )


def test_sliding_is_no_friction() -> None:
    """A block on a slope of 30° with k = 0.3 creeps at about g sin θ dt/k: ten times dt, ten times as far."""
    block = table("symplectic_euler", {"type": "gravity"}, restitution=0.0, tangential_loss=0.3)
    block["planes"][0] |= {"normal": [0.5, 0.8660254, 0], "name": "slope"}
    block["particles"] = [{"layout": {"type": "points", "position": [[0, 0, 0]]}}]
    crept = []
    for dt in (0.01, 0.001):
        block["simulation"]["dt"] = dt
        crept.append(float(np.linalg.norm(ps.run(ps.from_table(block)).final.position)))
        assert crept[-1] == pytest.approx(9.80665 / 2 * dt / 0.3, rel=0.1)
    assert crept[0] / crept[1] == pytest.approx(10, rel=0.1)
    (said,) = sliding(ps.from_table(block))
    assert said.startswith("plane slope: tangential_loss")
    assert "depends on dt" in said
    assert said.endswith("friction = 0.4 is")
    for silent in ({"tangential_loss": 0.0}, {"restitution": 1.0}):
        block["planes"] = [{"restitution": 0.0, "tangential_loss": 0.3} | silent]
        assert sliding(ps.from_table(block)) == ()


def test_friction_that_is_seldom_meant() -> None:
    block = table("velocity_verlet", {"type": "gravity"}, friction={"static": 0.2, "kinetic": 0.3})
    (said,) = advice(ps.from_table(block))
    assert said.startswith("plane 0: kinetic friction 0.3 is above static friction 0.2")
    block["planes"] = [{"friction": {"static": 0.3, "kinetic": 0.3}}]
    assert advice(ps.from_table(block)) == ()
    block["particles"][0]["dynamics"] = {"type": "first_order", "drag": 1.0}
    (said,) = advice(ps.from_table(block))
    assert "no inertia" in said


@pytest.mark.parametrize(
    ("layout", "gravity", "told"),
    [
        ({"constant": 1}, [{"type": "gravity", "constant": 1}], False),
        ({}, [{"type": "gravity"}], False),
        ({}, [{"type": "gravity", "constant": 1}], True),
        ({"constant": 1}, [], True),
    ],
)
def test_speeds_that_balance_another_gravity_are_told(
    layout: dict[str, Any], gravity: list[dict[str, Any]], told: bool
) -> None:
    sphere = {"type": "plummer", "count": 10, "mass": 2, "radius": 1, **layout}
    scenario = ps.from_table(
        {
            "simulation": {"duration": 1, "dt": 0.1},
            "particles": [{"name": "stars", "layout": sphere}],
            "interactions": gravity,
        }
    )
    assert any("balance gravity" in sentence for sentence in advice(scenario)) is told


def test_the_mass_of_a_sphere_of_stars_is_given_once() -> None:
    sphere = {"type": "plummer", "count": 10, "mass": 2, "radius": 1}
    for given in ({"mass": 1}, {"radius": 1, "density": 3}):
        with pytest.raises(ps.UsageError, match="gives its particles their mass"):
            ps.from_table(
                {"simulation": {"duration": 1, "dt": 0.1}, "particles": [{"layout": sphere, **given}]}
            )
    ball = {"shape": {"type": "sphere", "radius": 1}}
    with pytest.raises(ps.UsageError, match="which bodies have from their shape"):
        ps.from_table({"simulation": {"duration": 1, "dt": 0.1}, "bodies": [{**ball, "layout": sphere}]})


@pytest.mark.parametrize(
    ("radius", "interactions", "told"),
    [
        ({"radius": 0.1}, [], True),
        ({}, [], False),  # points
        ({"radius": 0.1}, [{"type": "contact", "on": ["sand", "box"]}], False),
        ({"radius": 0.1}, [{"type": "contact", "on": ["sand"]}], True),
        ({"radius": 0.1}, [{"type": "contact"}], False),
    ],
)
def test_particles_that_pass_through_bodies_are_told(
    radius: dict[str, float], interactions: list[dict[str, Any]], told: bool
) -> None:
    sand = {"name": "sand", "layout": {"type": "points", "position": [[0, 1, 0]]}, **radius}
    scenario = ps.from_table(
        {
            "simulation": {"duration": 1, "dt": 0.1},
            "particles": [sand],
            "bodies": [{"name": "box", "shape": {"type": "box", "size": [1, 1, 1]}}],
            "interactions": interactions,
        }
    )
    assert any("pass through rigid bodies" in sentence for sentence in advice(scenario)) is told


def test_grains_on_springs_touch_bodies_by_what_is_advised() -> None:
    # Springs touch no bodies, and impulses among the same grains would be a second contact.
    ball = {"name": "box", "shape": {"type": "sphere", "radius": 1.0}, "position": [0, 5, 0]}
    sand = {
        "name": "sand",
        "layout": {"type": "points", "position": [[0, 1, 0]]},
        "radius": 0.1,
        "mass": 1.0,
    }
    soft = {"type": "contact", "model": "linear", "stiffness": 1e3}
    table = {"simulation": {"duration": 1, "dt": 0.1}, "particles": [sand], "bodies": [ball]}
    (text,) = (each for each in advice(ps.from_table({**table, "interactions": [soft]})) if "bodies" in each)
    assert 'between = ["sand", "box"] does' in text
    hard = {"type": "contact", "between": ["sand", "box"]}
    scenario = ps.from_table({**table, "interactions": [soft, hard]})
    assert not any("bodies" in each or "add up" in each for each in advice(scenario))
    (meeting,) = meetings_of(scenario)
    assert meeting.label == "contact_2"


WRITTEN = """format = 1
[simulation]
duration = 1.0
dt = 0.01
[[particles]]
name = "dt"
layout = { type = "rope", start = [0, 0, 0], end = [1, 0, 0], count = 5 }
springs = { structural = 100.0 }
[[particles]]
name = "a"
layout = { type = "points", position = [[0, 1, 0]] }
radius = 0.1
[[forces]]
type = "gravity"
[[forces]]
type = "gravity"
[[interactions]]
name = "pull"
type = "gravity"
[[planes]]
name = "floor"
[[colliders]]
type = "sphere"
radius = 0.1
center = [0, -5, 0]
"""


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("pull: it is near", 17),
        ("the pulley of 'a' and 'dt'", 9),
        ('particles of "a" pass', 9),
        ("dt = 0.01 s is beyond the largest stable step for 'a'", 4),
        ("gravity and gravity_2 act together on 'a'", 13),
        ("gravity_2 acts", 15),
        ("dt.structural alone", 5),
        ("5 particles of 'a' start inside plane floor", 9),
        ("plane floor: friction", 20),
        ("sphere 1 with discrete detection", 22),
        ("sphere colliders.0: nobody", 22),
        ("nothing that has a name", None),
    ],
)
def test_a_warning_has_the_place_of_what_it_names_first(text: str, line: int | None) -> None:
    found = subject(ps.loads(WRITTEN), text)
    assert (None if found is None or found.span is None else found.span.line) == line
    assert subject(ps.from_table(table("rk4", {"type": "gravity"})), "gravity") is None


def pairs(*interactions: dict[str, Any], **simulation: Any) -> dict[str, Any]:
    """Two groups of balls, and what acts between them."""
    groups = [
        {
            "name": name,
            "layout": {"type": "points", "position": [[0.2, 0.2, k]]},
            "radius": 0.01,
            "charge": 1e-9,
        }
        for k, name in enumerate("ab")
    ]
    return {
        "simulation": {"duration": 1e-5, "dt": 1e-6, **simulation},
        "particles": groups,
        "interactions": list(interactions),
    }


def test_what_acts_twice_between_the_same_groups_is_told() -> None:
    def told(*interactions: dict[str, Any]) -> list[str]:
        return [text for text in advice(ps.from_table(pairs(*interactions))) if "add up" in text]

    pull, push = {"type": "gravity"}, {"type": "coulomb"}
    assert told(pull, pull) == ["gravity_2 acts on pairs of 'a' as gravity does: they add up"]
    assert told({**pull, "on": ["b"]}, {**pull, "between": ["b", "a"]}) == []
    (both,) = told(pull, {**pull, "between": ["b", "a"]})
    assert "pairs of 'a' and 'b'" in both
    assert told(pull, push) == []
    well = {"type": "yukawa", "strength": 1.0, "screening_length": 1.0}
    assert told(well, well) == []


def test_grains_that_stretch_by_a_part_of_their_radius_are_told() -> None:
    def told(cohesion: float) -> list[str]:
        touch = {"type": "contact", "model": "hertz", "young_modulus": 1e7, "adhesion": "jkr"}
        return [
            text
            for text in advice(ps.from_table(pairs({**touch, "cohesion": cohesion})))
            if "stretch" in text
        ]

    assert told(1.0) == []
    (text,) = told(1e5)
    assert text.startswith("contact: the smallest grains stretch by ")


@pytest.mark.parametrize("softening", [99.0, 1e200])
def test_a_softening_far_beyond_the_box_is_refused(softening: float) -> None:
    scenario = pairs({"type": "gravity", "softening": softening}, box={"size": [1, 1, 1.5]})
    if softening == 99.0:
        ps.from_table(scenario)
        return
    with pytest.raises(
        ps.ScenarioError, match=r"a softening of 1e\+200 m in a box of 1\.5 m leaves no force"
    ):
        ps.from_table(scenario)


def test_a_box_where_numbers_are_far_apart_is_refused() -> None:
    box: dict[str, Any] = {"size": [1, 1, 1], "origin": [0, 1e9, 0]}
    ps.from_table(pairs(box=box))
    box["origin"][1] = 1e17
    with pytest.raises(
        ps.ScenarioError, match=r"at 1e\+17 m numbers are 16 m apart, too far for a box of 1 m"
    ):
        ps.from_table(pairs(box=box))


def test_a_formula_without_numbers_is_read_without_a_word_of_numpy() -> None:
    ps.from_table(pairs({"type": "formula", "potential": "1/(r - r)"}))


def test_colliders_that_turn_by_much_in_a_step_are_told() -> None:
    def told(rate: float) -> list[str]:
        scenario = {
            "simulation": {"duration": 0.1, "dt": 1e-3},
            "particles": [{"layout": {"type": "points", "position": [[0, 5, 0]]}, "radius": 0.1}],
            "colliders": [{"name": "table", "type": "box", "size": [1, 1, 1]}],
            "motions": [{"collider": "table", "spin": {"axis": [0, 1, 0], "rate": rate}}],
        }
        return [text for text in advice(ps.from_table(scenario)) if "rad in a step" in text]

    assert told(499.0) == []
    (text,) = told(-1000.0)
    assert text.startswith("box table: it turns by 1 rad in a step of dt = 0.001 s")
    assert "dt = 0.0005 s" in text


def test_bodies_that_turn_by_much_in_a_step_are_told() -> None:
    def told(rate: float, shape: dict[str, Any]) -> list[str]:
        scenario = {
            "simulation": {"duration": 0.1, "dt": 1e-3},
            "bodies": [{"name": "top", "shape": shape, "angular_velocity": [0, rate, 0]}],
        }
        return [text for text in advice(ps.from_table(scenario)) if "rad in a step" in text]

    box = {"type": "box", "size": [1, 2, 3]}
    assert told(499.0, box) == []
    assert told(1000.0, {"type": "sphere", "radius": 1}) == []
    (text,) = told(-1000.0, box)
    assert text.startswith("bodies 'top' turn by 1 rad in a step of dt = 0.001 s at the start")
    assert "dt = 0.0005 s" in text


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("reach", "radius", "told"),
    [
        (0.01, 0.1, True),
        (0.19, 0.1, True),
        (0.21, 0.1, False),
        (0.01, 0.004, False),
        (0.01, 1e-30, False),
        (0.01, None, False),
    ],
)
def test_cuts_that_end_too_close_for_balls_are_told(reach: float, radius: float | None, told: bool) -> None:
    # A ball of 10 cm rests in the middle of a hole of 1 m where the cylinder reaches less than 20 cm beyond the slab.
    top = 0.1 + reach
    sized = {} if radius is None else {"radius": radius}
    scenario = ps.from_table(
        {
            "simulation": {"duration": 1, "dt": 1e-3},
            "particles": [{"name": "ball", "layout": {"type": "points", "position": [[0, 1, 0]]}, **sized}],
            "forces": [{"type": "gravity"}],
            "colliders": [
                {
                    "type": "difference",
                    "of": [
                        {"type": "box", "size": [4, 0.2, 4]},
                        {"type": "cylinder", "start": [0, -top, 0], "end": [0, top, 0], "radius": 0.5},
                    ],
                }
            ],
        }
    )
    assert any("too early where what is taken off ends" in each for each in advice(scenario)) is told


def test_edges_that_a_cut_makes_sharp_are_not_told() -> None:
    # A bowl in a slab: the ball of the cut leaves an edge of 82°, which is no end of it.
    scenario = ps.from_table(
        {
            "simulation": {"duration": 1, "dt": 1e-3},
            "particles": [
                {"name": "p", "layout": {"type": "points", "position": [[0, 1, 0]]}, "radius": 0.1}
            ],
            "forces": [{"type": "gravity"}],
            "colliders": [
                {
                    "type": "difference",
                    "of": [{"type": "box", "size": [4, 0.2, 4]}, {"type": "sphere", "radius": 0.7}],
                }
            ],
        }
    )
    assert not any("too early" in each for each in advice(scenario))


@pytest.mark.parametrize(("wide", "told"), [(1.1, True), (1.5, False)])
def test_balls_that_meet_the_ends_of_parts_of_a_container_are_told(wide: float, told: bool) -> None:
    # Two boxes whose middles are 0.9 m apart: they overlap by 0.2 and 0.6 m, which is what a ball of 0.3 m needs.
    halves = [{"type": "box", "center": [x, 0, 0], "size": [wide, 2, 2]} for x in (-0.45, 0.45)]
    scenario = ps.from_table(
        stated(
            1,
            0.01,
            particles=[points((-0.5, 0, 0), radius=0.3, mass=1.0)],
            colliders=[{"type": "union", "inside": True, "of": halves}],
        )
    )
    assert any("too early where its parts meet" in each for each in advice(scenario)) is told
