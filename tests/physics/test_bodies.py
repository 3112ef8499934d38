"""Cloth, rope and jelly: where their particles are, which are joined, and how they hang, swing and hold together."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from simulate import EPS, G, points, simulate, table

import particlesim as ps
from particlesim.layouts import Cloth, Jelly, Rope


def body(layout: dict[str, Any], **group: Any) -> dict[str, Any]:
    return {"name": "body", "layout": layout, "springs": {"structural": 100.0}, **group}


def test_a_cloth_has_the_springs_of_its_grid() -> None:
    w, h = 5, 4
    cloth = Cloth(size=(4.0, 6.0), resolution=(w, h))
    assert len(cloth.edges("structural")) == (w - 1) * h + w * (h - 1)
    assert len(cloth.edges("shear")) == 2 * (w - 1) * (h - 1)
    assert len(cloth.edges("bend")) == (w - 2) * h + w * (h - 2)
    x = cloth.place(None, 0, w * h).position  # type: ignore[arg-type]
    for kind, lengths in {"structural": {1.0, 2.0}, "shear": {math.sqrt(5)}, "bend": {2.0, 4.0}}.items():
        i, j = cloth.edges(kind).T
        assert set(np.linalg.norm(x[:, i] - x[:, j], axis=0).round(12)) == {
            round(length, 12) for length in lengths
        }
        assert len({frozenset(pair) for pair in cloth.edges(kind).tolist()}) == len(i)


def test_a_jelly_has_the_springs_of_its_lattice() -> None:
    # Cells: 3 × 2 × 1, cubes. Face diagonals: 2 per square; space diagonals: 4 per cell.
    jelly = Jelly(size=(3.0, 2.0, 1.0), resolution=(4, 3, 2))
    x = jelly.place(None, 0, 24).position  # type: ignore[arg-type]
    i, j = jelly.edges("shear").T
    length = np.linalg.norm(x[:, i] - x[:, j], axis=0)
    squares = 3 * 2 * 2 + 3 * 1 * 3 + 2 * 1 * 4
    assert np.isclose(length, math.sqrt(2)).sum() == 2 * squares
    assert np.isclose(length, math.sqrt(3)).sum() == 4 * 6
    assert len(length) == 2 * squares + 24
    assert len(jelly.edges("structural")) == 3 * 3 * 2 + 4 * 2 * 2 + 4 * 3 * 1
    assert len(jelly.edges("bend")) == 2 * 3 * 2 + 4 * 1 * 2


@pytest.mark.parametrize(
    ("pinned", "where"),
    [
        ("left", lambda x, y: x == 0),
        ("right", lambda x, y: x == 3),
        ("top", lambda x, y: y == 2),
        ("bottom", lambda x, y: y == 0),
        ("corners", lambda x, y: np.isin(x, (0, 3)) & np.isin(y, (0, 2))),
        (["top_left", "bottom_right"], lambda x, y: ((x == 0) & (y == 2)) | ((x == 3) & (y == 0))),
    ],
)
def test_pins_by_name(pinned: Any, where: Any) -> None:
    layout = {"type": "cloth", "size": [3, 2], "resolution": [4, 3], "pinned": pinned}
    final = simulate(0.1, 0.01, particles=[body(layout)], forces=[{"type": "gravity"}]).final
    x, y = np.indices((3, 4))[::-1].reshape(2, -1)
    still = where(x, y)
    assert ((final.velocity == 0).all(axis=1) == still).all()


def test_the_mass_is_that_of_the_whole_body() -> None:
    layout = {"type": "jelly", "size": [1, 1, 1], "resolution": [3, 3, 3]}
    result = simulate(0.1, 0.1, particles=[body(layout, mass=0.54)], output={"fields": ["mass"]})
    assert result.final["mass"] == pytest.approx(0.02, rel=2 * EPS)


def test_a_falling_body_keeps_its_shape_and_momentum() -> None:
    # Nothing stretches it: every particle falls by g t²/2, and springs give no momentum. In each of the steps, forces that
    # cancel leave a rounding of k L EPS.
    layout = {"type": "jelly", "size": [1, 1, 1], "resolution": [4, 4, 4], "velocity": [1, 0, 0]}
    springs = {"structural": 500.0, "shear": 200.0, "bend": 50.0, "damping_ratio": 0.2}
    t, steps = 0.5, 500
    result = simulate(
        t,
        t / steps,
        particles=[body(layout, mass=2.0, springs=springs)],
        forces=[{"type": "gravity"}],
        output={"ledger": True},
    )
    fallen = result.final.position.mean(axis=0) - [0.5 + t, 0.5 - G * t**2 / 2, 0.5]
    assert np.abs(fallen).max() < steps * 10 * EPS
    assert result.ledger["momentum.y"][-1] == pytest.approx(-2 * G * t, rel=steps * 10 * EPS)
    assert result.ledger["potential.body.structural"][-1] < 1e-20


def test_a_hanging_rope_is_a_catenary() -> None:
    # y = a cosh((x − ½)/a) + const, with 2 a sinh(1/2a) the length of the rope; here nearly inextensible. Replacing the
    # chain by straight links of length s misses the sag by (s/a)²/24 of itself at most, the stretch T/ks by its part.
    number, span, length, mass, k = 41, 1.0, 1.3, 0.2, 2e5
    link = length / (number - 1)
    a = brentq(lambda a: 2 * a * math.sinh(span / 2 / a) - length, 0.1, 10)
    x = np.linspace(0, span, number)
    sag = a * (math.cosh(span / 2 / a) - 1)
    position = [(float(u), 4 * 0.4 * float(u * (u - 1)), 0.0) for u in x]  # a parabola to start from
    pairs = [[i, i + 1] for i in range(number - 1)]
    t = 2.0
    result = simulate(
        t,
        1e-4,
        "symplectic_euler",
        particles=[points(*position, name="rope", mass=mass / number, pinned=[0, number - 1])],
        springs=[{"on": "rope", "pairs": pairs, "stiffness": k, "rest_length": link, "damping": 2.0}],
        forces=[{"type": "gravity"}, {"type": "linear_drag", "coefficient": 0.05}],
    )
    lowest = result.final.position[:, 1].min()
    tension = mass * G * math.cosh(span / 2 / a) * a / length
    tolerance = (link / a) ** 2 / 24 + tension / (k * link) + 2e-4
    assert lowest == pytest.approx(-sag, rel=tolerance)
    form = a * np.cosh((result.final.position[:, 0] - span / 2) / a) - a - sag
    assert result.final.position[:, 1] == pytest.approx(form, abs=2 * tolerance * sag)


def test_a_string_sounds_its_first_five_modes() -> None:
    # A taut chain of n links of length d under tension T: ω_p = 2 √(T/m d) sin(pπ/2n) across, for transverse swings so
    # small that the tension stays. A mode started alone keeps its form; after half a period it is upside down.
    # Velocity Verlet turns too fast by (ωh)²/24; the tension changes by k/T (slope)²/4.
    n, length, mass, k, stretch = 20, 1.0, 0.01, 400.0, 1.25
    d, rest = length / n, length / n / stretch
    tension = k * (d - rest)
    for mode in range(1, 6):
        omega = 2 * math.sqrt(tension / (mass * d)) * math.sin(mode * math.pi / 2 / n)
        t, steps, height = math.pi / omega, 600, 1e-6
        shape = height * np.sin(mode * math.pi * np.arange(n + 1) / n)
        result = simulate(
            t,
            t / steps,
            particles=[
                points(
                    *((i * d, float(shape[i]), 0.0) for i in range(n + 1)),
                    name="string",
                    mass=mass,
                    pinned=[0, n],
                )
            ],
            springs=[
                {"on": "string", "pairs": [[i, i + 1] for i in range(n)], "stiffness": k, "rest_length": rest}
            ],
        )
        phase = math.pi * (math.pi / steps) ** 2 / 24
        bound = height * (phase + (k * d / tension) * (mode * math.pi * height) ** 2 + 1e-9)
        assert result.final.position[:, 1] == pytest.approx(-shape, abs=bound + 1e-16 * steps)


@pytest.mark.parametrize(
    ("group", "message"),
    [
        ({"layout": {"type": "cloth", "size": [1, 1], "resolution": [5, 1]}}, "layout.resolution.1"),
        ({"layout": {"type": "cloth", "size": [1, 0], "resolution": [5, 5]}}, "layout.size.1"),
        (
            {"layout": {"type": "cloth", "size": [1, 1], "resolution": [5, 5], "up": [1, 1, 0]}},
            "not at a right angle",
        ),
        (
            {"layout": {"type": "cloth", "size": [1, 1], "resolution": [5, 5], "pinned": "lefft"}},
            "layout.pinned",
        ),
        ({"layout": {"type": "points", "position": [[0, 0, 0]]}}, "brings no springs"),
        (
            {"layout": {"type": "rope", "start": [0, 0, 0], "end": [0, 0, 0], "count": 4}},
            "has no length",
        ),
        (
            {
                "layout": {"type": "rope", "start": [0, 0, 0], "end": [1, 0, 0], "count": 4},
                "springs": {"structural": 1.0, "shear": 1.0},
            },
            "no shear springs",
        ),
        (
            {
                "layout": {"type": "rope", "start": [0, 0, 0], "end": [1, 0, 0], "count": 4},
                "springs": {"structural": -1.0},
            },
            "springs.structural",
        ),
        (
            {
                "layout": {"type": "rope", "start": [0, 0, 0], "end": [1, 0, 0], "count": 4},
                "mass": {"type": "uniform", "low": 1, "high": 2},
            },
            "whole body",
        ),
        (
            {
                "layout": {"type": "rope", "start": [0, 0, 0], "end": [1, 0, 0], "count": 4},
                "springs": {"structural": 1.0, "damping": 1.0},
                "dynamics": {"type": "first_order", "drag": 1.0},
            },
            "has no inertia",
        ),
    ],
)
def test_bodies_that_cannot_be(group: dict[str, Any], message: str) -> None:
    with pytest.raises(ps.UsageError, match=message):
        simulate(0.1, 0.1, particles=[{"name": "body", "springs": {"structural": 1.0}, **group}])


def test_a_rope_is_a_row() -> None:
    rope = Rope(start=(0, 0, 0), end=(2, 0, 0), count=5, pinned="both")
    assert rope.edges("structural").tolist() == [[0, 1], [1, 2], [2, 3], [3, 4]]
    assert rope.edges("bend").tolist() == [[0, 2], [1, 3], [2, 4]]
    assert rope.pins().tolist() == [0, 4]


def test_the_smallest_bodies_lack_some_springs() -> None:
    # Two particles have nobody beyond the next one: no bend springs and no angles, and the others work.
    rope = {"type": "rope", "start": [0, 0, 0], "end": [1, 0, 0], "count": 2}
    result = simulate(
        0.1,
        0.05,
        particles=[body(rope, springs={"structural": 10.0, "bend": 1.0, "angle": 1.0})],
        output={"ledger": True},
    )
    assert result.ledger["potential.body.bend"][-1] == result.ledger["potential.body.angle"][-1] == 0.0


@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.parametrize(
    ("pinned", "where"),
    [
        ("row 1", [4, 5, 6, 7]),
        ("row -1", [8, 9, 10, 11]),
        (["column -1", "bottom_left"], [0, 3, 7, 11]),
    ],
)
def test_pins_by_row_and_column(pinned: Any, where: list[int], inside: bool) -> None:
    cloth = {"type": "cloth", "size": [1, 1], "resolution": [4, 3]}
    group = {"layout": {**cloth, "pinned": pinned}} if inside else {"layout": cloth, "pinned": pinned}
    (made,) = ps.from_table(table(0.1, 0.1, particles=[group])).particles
    assert made.pins(np.zeros((3, 12))).tolist() == where


def test_rows_of_a_net_are_those_of_its_links() -> None:
    # Two meshes of two links each: 5, 3, 5, 3 and 5 particles from the bottom.
    net = {"type": "net", "size": [1, 1], "meshes": [2, 2], "segments": 2, "pinned": ["row 1", "column 0"]}
    (made,) = ps.from_table(table(0.1, 0.1, particles=[{"layout": net}])).particles
    assert made.pins(np.zeros((3, 21))).tolist() == [0, 5, 6, 7, 8, 13, 16]


@pytest.mark.parametrize(
    ("group", "message"),
    [
        ({"pinned": "row 3"}, "row 0 .the bottom. to row 2 or -1"),
        ({"pinned": "rwo 1"}, "no part called 'rwo 1'"),
        ({"pinned": []}, "an empty list names no particle"),
        (
            {"pinned": {"type": "ball", "center": [9, 9, 9], "radius": 1}},
            "pinned holds no particle of 'body'",
        ),
    ],
)
def test_pins_that_hold_nothing(group: dict[str, Any], message: str) -> None:
    cloth = {"type": "cloth", "size": [1, 1], "resolution": [4, 3]}
    with pytest.raises(ps.UsageError, match=message):
        simulate(0.1, 0.1, particles=[body(cloth, **group)])
    if isinstance(group["pinned"], str):
        with pytest.raises(ps.UsageError, match=r"there is no row 3|unknown value"):
            simulate(0.1, 0.1, particles=[body({**cloth, **group})])
