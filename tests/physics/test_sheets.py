"""Thin sheets that meet edge to edge: in their creases and corners particles move as between planes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from simulate import points, table, way

import particlesim as ps
from particlesim.engine.simulation import Simulation

H, STEPS = 0.02, 80
G = (-3.0, -9.0, 2.0)
PLACES = np.random.default_rng(5).uniform(-0.2, 0.2, (12, 3))
TURNED = {"axis": [2.0, -1.0, 3.0], "angle": 40.0}


def turn(v: Any) -> NDArray[np.float64]:
    """Vectors turned as `TURNED` says, by Rodrigues' formula."""
    axis = np.array(TURNED["axis"]) / np.linalg.norm(TURNED["axis"])
    angle = math.radians(float(TURNED["angle"]))  # type: ignore[arg-type]
    v = np.asarray(v, float)
    along = (v @ axis)[..., None] * axis
    return along + math.cos(angle) * (v - along) + math.sin(angle) * np.cross(axis, v)


def walls(thickness: float, **response: Any) -> list[dict[str, Any]]:
    """Three sheets of 1 m that meet edge to edge: normal to x and y below, to z above; turned all together."""
    made = []
    for center, axis, angle in (
        ((-0.5, 0, 0), (0, 0, 1), -90.0),
        ((0, -0.5, 0), (0, 0, 1), 0.0),
        ((0, 0, 0.5), (1, 0, 0), 90.0),
    ):
        # first turned in place, then with the others: two turns are one, by the product of quaternions
        first = _quaternion(axis, angle)
        whole = _product(_quaternion(TURNED["axis"], TURNED["angle"]), first)
        size = np.linalg.norm(whole[1:])
        turned = {
            "axis": (whole[1:] / size).tolist(),
            "angle": math.degrees(2 * math.atan2(size, whole[0])),
        }
        made.append(
            {
                "type": "rectangle",
                "center": turn(center).tolist(),
                "size": [1, 1],
                "thickness": thickness,
                "orientation": turned,
                **response,
            }
        )
    return made


def _quaternion(axis: Any, angle: Any) -> NDArray[np.float64]:
    n, half = np.asarray(axis, float), math.radians(angle) / 2
    return np.array([math.cos(half), *(math.sin(half) * n / np.linalg.norm(n))])


def _product(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def bounced(x: float, g: float, wall: float, e: float, t: float) -> tuple[float, float]:
    """Place and velocity of what falls from rest at x with g onto a wall, and rebounds with e: parabolas, until they end
    after the time of Zeno, t₁ (1 + 2 e/(1 − e))."""
    fall = math.sqrt(2 * (wall - x) / g)
    if t < fall:
        return x + 0.5 * g * t * t, g * t
    t, speed = t - fall, g * fall * e
    while abs(speed) > 1e-12 and t >= 2 * speed / g:
        t, speed = t - 2 * speed / g, speed * e
    if abs(speed) <= 1e-12:
        return wall, 0.0
    return wall - speed * t + 0.5 * g * t * t, g * t - speed


def moved(thickness: float, radius: float, method: str, **response: Any) -> tuple[NDArray[np.float64], ...]:
    """All places and velocities along the sheets' axes, shapes [times, n, 3]."""
    x, v = way(
        1,
        STEPS * H,
        H,
        method,
        particles=[points(*turn(PLACES), velocity=(0 * PLACES).tolist(), radius=radius)],
        forces=[{"type": "gravity", "acceleration": turn(G).tolist()}],
        colliders=walls(thickness, **response),
    )
    axes = turn(np.eye(3))
    return x @ axes.T, v @ axes.T


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("radius", [0.0, 0.01])
@pytest.mark.parametrize("thickness", [1e-5, 1e-2])
def test_coordinates_bounce_each_by_itself_between_sheets(
    thickness: float, radius: float, restitution: float
) -> None:
    """A step at rest leads points far behind sheets, and beside their edges. Without friction all coordinates are
    independent, and a uniform force is exact at any step."""
    x, v = moved(thickness, radius, "velocity_verlet", restitution=restitution, friction=0.0)
    wall = 0.5 - thickness / 2 - radius
    walls = (-wall, -wall, wall)
    for i in range(len(PLACES)):
        for k in range(3):
            place, speed = bounced(PLACES[i, k], G[k], walls[k], restitution, STEPS * H)
            # Hops shorter than a step are rest; they rise by g h²/8, and their speed is up to g h/2.
            rest = restitution > 0 and abs(speed) <= abs(G[k]) * H / 2
            assert x[-1, i, k] == pytest.approx(place, abs=abs(G[k]) * H * H if rest else 1e-9)
            assert v[-1, i, k] == pytest.approx(speed, abs=abs(G[k]) * H if rest else 1e-8)


@pytest.mark.parametrize("method", ["velocity_verlet", "symplectic_euler"])
def test_friction_acts_along_a_crease_of_sheets(method: str) -> None:
    """Both sheets press, with g_x and g_y: along the crease a = g_z − μ (|g_x| + |g_y|), until the third one."""
    mu = 0.1
    x, v = moved(1e-4, 0.0, method, restitution=0.0, friction=mu)
    wall = 0.5 - 1e-4 / 2
    a = G[2] - mu * (abs(G[0]) + abs(G[1]))
    lies = (np.abs(x[:-1, :, 0] + wall) < 1e-12) & (np.abs(x[:-1, :, 1] + wall) < 1e-12)
    slides = lies & (x[:-1, :, 2] < wall - 0.03) & (np.abs(v[1:, :, 2]) > 1e-9)
    gained = (v[1:, :, 2] - v[:-1, :, 2])[slides]
    assert slides.sum() > 50
    assert gained == pytest.approx(a * H, abs=1e-12)
    assert np.all((x <= wall + 1e-12) | (np.arange(3) < 2))
    assert np.all(x[..., :2] >= -wall - 1e-12)


def test_fast_points_do_not_pass_where_a_sheet_leans_on_a_floor() -> None:
    """They bounce in the wedge, ever faster, and come to rest at its tip, which reaches 8 µm into the floor."""
    tilt, thickness, n = math.radians(-10), 1e-3, 300
    along = np.array([math.cos(tilt), math.sin(tilt), 0.0])
    up = np.array([-math.sin(tilt), math.cos(tilt), 0.0])
    sheet = {"type": "rectangle", "thickness": thickness, "restitution": 0.5, "friction": 0.0}
    leans = np.array([1.0, 0.0, 0.0]) - along * 0.5 + up * thickness / 2
    x, _ = way(
        1,
        0.03,
        0.03,
        "velocity_verlet",
        particles=[
            points(
                *[(0.4, 0.0, 0.0)] * n,
                velocity=np.stack([np.linspace(20, 100, n), np.zeros(n), np.zeros(n)], axis=1).tolist(),
                radius=0.0,
            )
        ],
        forces=[{"type": "gravity", "acceleration": [0, -9.8, 0]}],
        colliders=[
            {**sheet, "center": [1.0, -thickness / 2, 0.0], "size": [4, 4]},
            {
                **sheet,
                "center": leans.tolist(),
                "size": [1, 4],
                "orientation": {"axis": [0, 0, 1], "angle": -10},
            },
        ],
    )
    assert x[-1, :, 0].max() <= 1 + 1e-9


def sides(scenario: dict[str, Any], normal: Any, led: Any) -> NDArray[np.float64]:
    """How far particles are in front of a sheet that began at `led(0)`, on the side on which they began, step by step; the
    normal is that at time t."""
    simulation, found = Simulation(ps.from_table(scenario)), []
    (state,) = simulation.states
    dt = simulation.scenario.grid.dt
    begin = np.sign((state.x.T - led(0.0)) @ normal(0.0))
    for step in range(1, simulation.scenario.grid.steps + 1):
        simulation.advance_to(step)
        found.append(((state.x.T - led(step * dt)) @ normal(step * dt)) * begin)
    return np.array(found)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("rate", [0.0, 4.0], ids=["led", "turned"])
@pytest.mark.parametrize(("radius", "dt"), [(0.0, 2e-3), (5e-3, 2e-3), (0.0, 1e-2)])
def test_a_sheet_that_moves_in_a_ball_passes_none_that_it_drives_into_the_crease(
    radius: float, dt: float, rate: float
) -> None:
    # In the crease of both, particles of 100 m/s and more have more impacts in a step than are followed, and the sheet goes
    # over the place where they stay by several times its thickness.
    rng = np.random.default_rng(3)
    x = rng.uniform(-1, 1, (40, 3))
    x = x[np.abs(x[:, 1]) > 0.05]
    speed = 10 ** rng.uniform(-1, 3, (len(x), 1))
    v = speed * np.array([way / np.linalg.norm(way) for way in rng.normal(size=x.shape)])
    turned = {"spin": {"axis": [0, 0, 1], "rate": rate}} if rate else {}
    scenario = table(
        0.6,
        dt,
        particles=[
            {"radius": radius, "layout": {"type": "points", "position": x.tolist(), "velocity": v.tolist()}}
        ],
        forces=[{"type": "gravity"}],
        colliders=[
            {"type": "sphere", "inside": True, "radius": 2.0, "restitution": 0.9},
            {"name": "sheet", "type": "rectangle", "size": [12, 12], "restitution": 0.9},
        ],
        motions=[{"collider": "sheet", "path": ["x", "y + 0.5*sin(9*t)", "z"], **turned}],
    )

    def normal(t: float) -> Any:
        return np.array([-math.sin(rate * t), math.cos(rate * t), 0.0])

    def led(t: float) -> Any:
        return np.array([0.0, 0.5 * math.sin(9 * t), 0.0])

    # half of the thickness, and the radius
    assert sides(scenario, normal, led).min() > 6e-4 + radius - 1e-9


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_what_slides_into_a_corner_of_walls_and_a_very_thin_sheet_stays_on_its_side(e: float) -> None:
    # A wall that puts it back moves it by more than the sheet is thick.
    rng = np.random.default_rng(1)
    axis, angle, center = [0.108, 0.0, -0.436], 26.7, np.array([0.22, 0.02, 0.2])
    q = _quaternion(axis, angle)
    n = _product(_product(q, np.array([0, 0, 1.0, 0])), q * [1, -1, -1, -1])[1:]
    x = rng.uniform(-0.9, 0.9, (80, 3))
    x = x[(x - center) @ n > 0.05]
    scenario = table(
        2.0,
        1e-2,
        particles=[{"radius": 0.0, "layout": {"type": "points", "position": x.tolist()}}],
        forces=[{"type": "gravity"}],
        colliders=[
            {
                "type": "box",
                "inside": True,
                "size": [3, 3, 3],
                "orientation": {"axis": [-0.151, 0.898, -0.414], "angle": 146.4},
                "restitution": e,
            },
            {
                "type": "rectangle",
                "size": [12, 12],
                "thickness": 1e-6,
                "center": center.tolist(),
                "orientation": {"axis": axis, "angle": angle},
                "restitution": e,
            },
        ],
    )
    assert sides(scenario, lambda t: n, lambda t: center).min() > 5e-7 - 1e-9
