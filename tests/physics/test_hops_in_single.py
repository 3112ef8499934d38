"""Hops in single precision: what bounces without loss neither gains nor drifts up, however much its places are rounded.

u is the distance of two neighbouring places. A step rounds the place by u/2 at most, which changes the energy over mass by
g u/2. Where these are independent (a step changes the speed by so much that h v goes past many u), their sum over n steps
is g u √(n/12) or so. Where they are not, they lead the speed to the nearest one for which h v is midway between two
multiples of u: it changes by u/h at most. So E − E₀ ≤ v u/h + (u/h)²/2 + 4 g u √(n/12), at four standard deviations; the
last term is there only where g h² > u, or for a few hops.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import particlesim as ps
from particlesim.engine.simulation import Simulation
from tests.simulate import G, points

RADIUS = 0.01
HALF = 20.0
"""Half the size of a collider [m]; its centre is so far off that places are rounded in all directions."""
CENTER = (6.6, 15.4, -3.4)
TOP = (CENTER[0], CENTER[1] + HALF, CENTER[2])
BOTTOM = (CENTER[0], CENTER[1] - HALF, CENTER[2])


def files(folder: Path) -> None:
    """A cube, a flat field and a sampled ball as files."""
    corners = [[x, y, z] for x in (-HALF, HALF) for y in (-HALF, HALF) for z in (-HALF, HALF)]
    faces = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    lines = ["v {} {} {}".format(*np.add(corner, CENTER)) for corner in corners] + [f"f {f}" for f in faces]
    (folder / "cube.obj").write_text("\n".join(lines))
    np.save(folder / "flat.npy", np.ones((3, 3)))
    axis = np.linspace(-1.5 * HALF, 1.5 * HALF, 25)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    np.save(folder / "slab.npy", np.maximum(y, -y) - HALF + 0 * x * z)


AXIS = {
    "start": [CENTER[0] - HALF, *CENTER[1:]],
    "end": [CENTER[0] + HALF, *CENTER[1:]],
    "radius": HALF,
}
STANDING = {"start": list(BOTTOM), "end": list(TOP)}
SOLIDS: dict[str, dict[str, Any]] = {
    "box": {"type": "box", "size": [2 * HALF] * 3, "center": list(CENTER)},
    "sphere": {"type": "sphere", "radius": HALF, "center": list(CENTER)},
    "cylinder": {"type": "cylinder", **AXIS},
    "capsule": {"type": "capsule", **AXIS},
    "cone": {"type": "cone", **STANDING, "radius": 2 * HALF, "end_radius": HALF},
    "torus": {"type": "torus", "radius": HALF, "tube": HALF / 4, "center": list(CENTER)},
    "mesh": {"type": "mesh", "path": "cube.obj"},
    "formula": {
        "type": "formula",
        "distance": f"max(abs(x), max(abs(y), abs(z))) - {HALF}",
        "center": list(CENTER),
        "size": [3 * HALF] * 3,
    },
    "distance_grid": {
        "type": "distance_grid",
        "path": "slab.npy",
        "origin": [x - 1.5 * HALF for x in CENTER],
        "spacing": 3 * HALF / 24,
    },
}
OPEN: dict[str, dict[str, Any]] = {
    "plane": {"type": "plane", "point": list(TOP)},
    "height_field": {
        "type": "height_field",
        "path": "flat.npy",
        "size": [2 * HALF] * 2,
        "height": HALF,
        "center": list(CENTER),
    },
}
MARKS = {"formula": pytest.mark.optimised, "height_field": pytest.mark.slow}
CASES = [
    pytest.param(name, inside, marks=MARKS.get(name, ()))
    for name, inside in [(name, False) for name in OPEN | SOLIDS]
    + [(name, True) for name in SOLIDS if name != "distance_grid"]
]


def hops(
    collider: dict[str, Any],
    place: tuple[float, float, float],
    drop: float,
    dt: float,
    steps: int,
    method: str = "velocity_verlet",
    number: int = 8,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Heights above a place and velocities at 64 times, [times, balls], of balls let go about `drop` above it."""
    starts = [(place[0], place[1] + RADIUS + drop * (1 + 0.2 * k / number), place[2]) for k in range(number)]
    every = steps // 64
    told = {
        "simulation": {"duration": 64 * every * dt, "dt": dt, "integrator": method, "precision": "single"},
        "output": {"every": every, "ledger": False},
        "particles": [points(*starts, radius=RADIUS, mass=1.0)],
        "forces": [{"type": "gravity"}],
        "colliders": [{**collider, "restitution": 1}],
    }
    simulation = Simulation(ps.from_table(told), threads=1)
    state, heights, speeds = simulation.states[0], [], []
    for k in range(65):
        simulation.advance_to(k * every)
        heights.append(state.x[1].astype(float) - RADIUS - place[1])
        speeds.append(state.v[1].astype(float))
    simulation.close()
    return np.array(heights), np.array(speeds)


def bound(speed: Any, ulp: float, dt: float, steps: int) -> Any:
    """See above [J/kg]."""
    return speed * ulp / dt + 0.5 * (ulp / dt) ** 2 + 4 * G * ulp * np.sqrt(steps / 12)


@pytest.mark.sampled(38)
@pytest.mark.parametrize(
    "method", ["velocity_verlet", pytest.param("symplectic_euler", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(("shape", "inside"), CASES)
def test_hops_on_what_is_large_gain_nothing(shape: str, inside: bool, method: str, tmp_path: Path) -> None:
    """Balls that drop 1 mm. They fell in by 16 rounding errors of all coordinates, 1e-4 m, before a step saw it, and were
    put back: after 80 hops they had five times their energy."""
    files(tmp_path)
    collider = dict((OPEN | SOLIDS)[shape])
    if "path" in collider:
        collider["path"] = str(tmp_path / collider["path"])
    place = BOTTOM if inside else TOP
    if shape == "torus":  # the top, or the bottom, of its tube
        place = (CENTER[0] + HALF, CENTER[1] + (-HALF if inside else HALF) / 4, CENTER[2])
    if inside:
        collider["inside"] = True
    dt, steps = 1e-4, 80 * 286
    height, v = hops(collider, place, 1e-3, dt, steps, method)
    ulp = float(np.spacing(np.float32(max(map(abs, place)))))
    # symplectic Euler keeps v²/2 + g y − g h v/2 in free flight, and loses g h v in a hop
    energy = 0.5 * v**2 + G * height - (0.5 * G * dt * v if method == "symplectic_euler" else 0)
    most = bound(np.sqrt(2 * energy[0]), ulp, dt, steps)
    assert (energy - energy[0] <= most).all()
    if method == "velocity_verlet":
        assert (energy - energy[0] >= -most).all()
    assert height.min() >= -2 * ulp


@pytest.mark.slow
@pytest.mark.optimised
@pytest.mark.parametrize(("shape", "drop", "dt"), [("box", 1e-3, 1e-4), ("plane", 1e-2, 1e-3)])
def test_ten_thousand_hops_do_not_drift_up(shape: str, drop: float, dt: float) -> None:
    """No ball is beyond the bound, and their mean is less above the start: that of 16 has a quarter of the deviation of one.
    On the box they had a hundred times their energy."""
    steps = round(20_000 * np.sqrt(2 * drop / G) / dt)
    height, v = hops((OPEN | SOLIDS)[shape], TOP, drop, dt, steps, number=16)
    energy, ulp = 0.5 * v**2 + G * height, float(np.spacing(np.float32(TOP[1])))
    independent = G * dt**2 > ulp
    most = bound(np.sqrt(2 * energy[0]), ulp, dt, steps if independent else 0)
    assert (energy - energy[0] <= most).all()
    assert (energy[-16:] - energy[0]).mean() <= 0.5 * most.mean()


def test_hops_at_fine_places_keep_their_energy() -> None:
    """Places near y = 0 are rounded by nothing, gaps from a box of 40 m by 2e-6 m. A step rounds the speed v by 2⁻²⁴ v at
    most, twice. It had been six times as much after 100 hops."""
    steps = 100 * 286
    box = {**SOLIDS["box"], "center": [0, -HALF, 0]}
    height, v = hops(box, (0.0, 0.0, 0.0), 1e-3, 1e-4, steps)
    energy = 0.5 * v**2 + G * height
    assert (abs(energy / energy[0] - 1) <= 2 * 2 * steps * 2.0**-24).all()


def test_impacts_with_leaning_planes_keep_the_speed() -> None:
    """Between two parallel planes without forces: 4000 impacts, each of which rounds each component by 2⁻²⁴ of the speed.
    With a normal whose length is off by a rounding error all of them gained that, to the same side."""
    normals = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.linspace(0.3, 1.2, 200)]
    n = max(normals, key=lambda n: float((n.astype(np.float32).astype(float) ** 2).sum()))
    far = 0.2 * n
    told = {
        "simulation": {"duration": 40.0, "dt": 0.01, "integrator": "velocity_verlet", "precision": "single"},
        "output": {"every": 4000, "ledger": False},
        "particles": [points((0.1 * n[0], 0.1 * n[1], 0.0), velocity=[(*(20 * n[:2]), 0.0)], radius=0.0)],
        "planes": [
            {"point": [0, 0, 0], "normal": n.tolist(), "restitution": 1},
            {"point": far.tolist(), "normal": (-n).tolist(), "restitution": 1},
        ],
    }
    ended = ps.run(ps.from_table(told))
    speed = float(np.linalg.norm(ended.final.velocity[0]))
    # independent roundings of two components: 2⁻²⁴ √(4000/6), four standard deviations of it
    assert abs(speed / 20 - 1) <= 4 * 2.0**-24 * np.sqrt(4000 / 6)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("speed", [1.0, 5.0, 20.0])
@pytest.mark.parametrize("shape", ["cone", "cylinder"])
def test_what_slides_around_a_rim_is_as_fast_as_in_double_precision(shape: str, speed: float) -> None:
    """A ball between the floor and the wall of a bowl, with friction. A step bends by (v h)²/2R, which was less than what
    counts as touching: the wall took v (v h/R)²/2 in each step (a fifth at 5 m/s in a second), and the ball was 8e-6 m
    inside. Places are rounded by up to 6e-8 m, an eighth of that bend at 1 m/s, which presses as much more now and less
    then: of the 40 % that friction takes in 200 steps 1 % at √200 eighths of 1/200."""
    bowl = {"end_radius": 0.5} if shape == "cone" else {}
    lean = np.arctan2(0.5, 2.0) if bowl else 0.0
    r = 0.05
    start = 1.0 - np.tan(lean) * r - r / np.cos(lean)

    def run(precision: str) -> ps.Result:
        told: dict[str, Any] = {
            "simulation": {
                "duration": 0.2,
                "dt": 1e-3,
                "integrator": "velocity_verlet",
                "precision": precision,
            },
            "output": {"every": 1, "ledger": False},
            "particles": [points((start, r, 0), velocity=[(0, 0, speed)], radius=r, mass=1.0)],
            "forces": [{"type": "gravity"}],
            "colliders": [
                {
                    "type": shape,
                    "start": [0, 0, 0],
                    "end": [0, 2, 0],
                    "radius": 1.0,
                    **bowl,
                    "inside": True,
                    "restitution": 0,
                    "friction": 0.2,
                }
            ],
        }
        return ps.run(ps.from_table(told))

    single, double = (run(precision).final for precision in ("single", "double"))
    speeds = [float(np.linalg.norm(each.velocity[0])) for each in (single, double)]
    assert speeds[0] == pytest.approx(speeds[1], rel=4e-3)
    assert speeds[1] < 0.99 * speed
    assert single.position[0, 1] >= r - 2 * float(np.spacing(np.float32(1.0)))
