"""Rods that no scenario may have: each is told with its place and what to do, before anything is computed."""

from __future__ import annotations

from pathlib import Path

import pytest
from simulate import points, table

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.graph.graph import build_graph

SCENE = """format = 1
[simulation]
duration = 1.0
dt = 0.01
integrator = "velocity_verlet"

[[particles]]
name = "chain"
layout = { type = "points", position = [[0, 0, 0], [1, 0, 0], [2, 0, 0]], velocity = VELOCITY }
pinned = PINNED

[[particles]]
name = "dust"
layout = { type = "points", position = [[5, 5, 5]] }
DYNAMICS

[[rods]]
name = "links"
RODS

"""

GOOD = {
    "DYNAMICS": "",
    "VELOCITY": "[[0, 0, 0], [0, 1, 0], [0, 2, 0]]",
    "PINNED": "[0]",
    "RODS": 'on = "chain"\npairs = [[0, 1], [1, 2]]',
}
CHAIN = 'on = "chain"\n'
BODY = """[[particles]]
name = "rope"
mass = 1
layout = { type = "LAYOUT", WHERE }
springs = { SPRINGS }
"""
ROPE = ("rope", "start = [0, 0, 0], end = [1, 0, 0], count = 5")
JELLY = ("jelly", "size = [1, 1, 1], resolution = [3, 3, 3]")


def body(kind: tuple[str, str], springs: str) -> str:
    return BODY.replace("LAYOUT", kind[0]).replace("WHERE", kind[1]).replace("SPRINGS", springs)


def text(more: str = "", method: str = "velocity_verlet", **changes: str) -> str:
    found = SCENE.replace("velocity_verlet", method)
    for key, value in (GOOD | changes).items():
        found = found.replace(key, value)
    return found + more


def refused(tmp_path: Path, written: str) -> ps.UsageError:
    path = tmp_path / "scene.toml"
    path.write_text(written)
    with pytest.raises(ps.UsageError) as caught:
        Simulation(ps.load(path), threads=1).close()
    assert caught.value.exit_code == 2
    return caught.value


def emitted() -> str:
    return (
        '[[emitters]]\nname = "drops"\nrate = 10\nshape = { type = "point", position = [0, 0, 0] }\n'
        "direction = [0, 1, 0]\nspeed = 1\n"
    )


CASES = [
    (text(RODS="pairs = [[0, 1]]"), "joins one group or two", None),
    (text(RODS='on = "chain"'), "pairs", None),
    (text(RODS='between = ["dust", "chain"]'), "which particles are joined?", "[[rods]]"),
    (text(RODS=CHAIN + "pairs = [[1, 1]]"), "joins particle 1 to itself", "[1, 1]"),
    (text(RODS=CHAIN + "pairs = [[0, 1], [1, 0]]"), "this pair is already joined", "[1, 0]"),
    (text(RODS=CHAIN + "pairs = [[0, 3]]"), "'chain' has no particle 3", "3"),
    (text(RODS=CHAIN + "pairs = [[0, 1]]\nlength = 0"), "greater than 0", "0"),
    (text(RODS='on = "chian"\npairs = [[0, 1]]'), "unknown group 'chian'", '"chian"'),
    (
        text(RODS=CHAIN + "pairs = [[0, 1], [0, 2]]\nlength = 1.0"),
        "2 m apart at the start, and this rod is 1 m long",
        "[0, 2]",
    ),
    (text(PINNED="[0, 1]"), "particles 0 and 1 are both pinned", "[0, 1]"),
    (
        text('[[rods]]\nname = "again"\non = "chain"\npairs = [[2, 1]]\n'),
        "a rod joins these particles already",
        "[2, 1]",
    ),
    (
        text(VELOCITY="[[0, 0, 0], [0.25, 1, 0], [0.25, 2, 0]]"),
        "particles 0 and 1 at the start change the length of the rod between them by 0.25 m/s",
        "[0, 1]",
    ),
    (text(method="rk4"), "rk4 cannot hold rods", '"rk4"'),
    (text(method="stormer_verlet"), "stormer_verlet cannot hold rods", '"stormer_verlet"'),
    (text(method="backward_euler"), "backward_euler cannot hold rods", '"backward_euler"'),
    (text(method="rk45"), "rk45 cannot hold rods", '"rk45"'),
    (
        text('[[planes]]\ncontact = "stick"\n'),
        "a plane cannot hold on to particles of rods",
        '"stick"',
    ),
    (
        text('[[planes]]\ncontact = "kill"\n'),
        "a plane cannot kill particles that are joined by rods",
        '"kill"',
    ),
    (
        text(emitted(), RODS='between = ["chain", "drops"]\npairs = [[0, 0]]'),
        "rods join particles that are there from the start",
        "[[rods]]",
    ),
    (
        text(
            '[[springs]]\nbetween = ["chain", "dust"]\npairs = [[2, 0]]\nstiffness = 1.0\n',
            DYNAMICS='dynamics = { type = "first_order", drag = 1.0 }',
        ),
        "rods need particles with inertia, also among those that are joined to theirs by springs",
        "[[rods]]",
    ),
    (text(body(JELLY, "rigid = true")), "a jelly of rods could hardly move", "true"),
    (text(body(ROPE, "rigid = true, structural = 10.0")), "neighbours are joined by rods already", "10.0"),
    (text(body(ROPE, "bend = 10.0")), "what joins neighbours?", None),
    (text(body(ROPE, "rigid = true, damping = 0.1")), "there are only rods here", "0.1"),
    (text('[render]\nstyles = { links = "surface" }\n'), "springs and rods are lines or hidden", '"surface"'),
]


@pytest.mark.parametrize(("written", "message", "under"), CASES, ids=[case[1][:40] for case in CASES])
def test_refused(tmp_path: Path, written: str, message: str, under: str | None) -> None:
    error = refused(tmp_path, written)
    assert message in str(error)
    if under is not None:
        (found,) = error.diagnostics  # type: ignore[attr-defined]
        assert found.span is not None
        line = written.splitlines()[found.span.line - 1]
        assert line[found.span.column - 1 : found.span.column - 1 + found.span.length] == under


def test_groups_of_one_particle_need_no_pairs() -> None:
    ends = [points((0, 0, 0), name="a"), points((1, 0, 0), name="b")]
    link = {"between": ["a", "b"]}
    scenario = ps.from_table(
        table(0.1, 0.1, particles=ends, rods=[link], springs=[{**link, "stiffness": 1.0}])
    )
    (rods,), (bonds,) = scenario.rod_sets, scenario.bonds
    assert rods.find().tolist() == [[0, 0]]
    assert bonds.count == 1


def test_particles_at_the_same_place(tmp_path: Path) -> None:
    written = text(VELOCITY="[[0, 0, 0]]").replace("[1, 0, 0], [2", "[0, 0, 0], [2")
    assert "are at the same place: a rod between them has no direction" in str(refused(tmp_path, written))


def test_lengths_that_do_not_fit_each_other(tmp_path: Path) -> None:
    # 1 m and 1 m in a row, and 2.0001 m from end to end: each is within its tolerance, all three are impossible.
    rods = CHAIN + 'pairs = [[0, 1], [1, 2]]\nlength = 1.0\n\n[[rods]]\nname = "whole"\n'
    rods += CHAIN + "pairs = [[0, 2]]\nlength = 2.0001"
    assert "rods do not fit each other at the start" in str(refused(tmp_path, text(RODS=rods)))


def test_methods_that_hold_rods_are_named(tmp_path: Path) -> None:
    error = refused(tmp_path, text(method="rk4"))
    assert "symplectic_euler, velocity_verlet, yoshida4" in str(error)


def test_what_is_told_of_rods() -> None:
    scenario = ps.from_table(
        {
            "simulation": {"duration": 1.0, "dt": 0.01},
            "particles": [
                {
                    "name": "hair",
                    "layout": {
                        "type": "hair",
                        "strands": 3,
                        "count": 4,
                        "length": 0.3,
                        "roots": {"type": "disc", "center": [0, 0, 0], "radius": 0.1, "normal": [0, 1, 0]},
                        "direction": [0, 1, 0],
                        "pinned": "clamped",
                    },
                    "mass": 0.1,
                    "springs": {"rigid": True},
                },
                {"name": "ball", "layout": {"type": "points", "position": [[1, 0, 0], [1, 1, 0]]}},
            ],
            "springs": [{"on": "ball", "pairs": [[0, 1]], "stiffness": 1.0}],
            "rods": [
                {"name": "springs", "on": "ball", "pairs": [[0, 1]], "length": 1.0},
            ],
            "render": {"styles": {"hair": "lines"}},
        }
    )
    assert [each.name for each in scenario.rod_sets] == ["springs_2", "hair.structural"]
    assert "rods springs_2: 1 rods, 1 m" in build_graph(scenario).as_text()


def test_a_rod_of_no_length_at_the_world_is_told_with_its_place() -> None:
    text = """format = 1
[simulation]
duration = 0.1
dt = 1e-3
[[bodies]]
name = "b"
shape = { type = "sphere", radius = 0.1 }
density = 1000
layout = { type = "points", position = [[0, 1, 0]] }
[[rods]]
between = ["b", "world"]
points = [[0, 0, 0], [0, 1, 0]]
"""
    with pytest.raises(ps.ScenarioError, match="its ends are 0 m apart") as caught:
        ps.run(ps.loads(text))
    place = caught.value.diagnostics[0]
    assert place.span is not None
    assert (place.span.line, place.span.column) == (10, 1)
    assert place.hint == "a ball joint holds two places together"
