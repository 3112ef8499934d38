"""Shapes that particles bounce off at any speed: boxes, capsules, cylinders, cones, tori and thin sheets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from simulate import EPS
from support import careful, columns, position, program, run, velocity

from particlesim.colliders import (
    BoxCollider,
    CapsuleCollider,
    ConeCollider,
    CylinderCollider,
    DiscCollider,
    RectangleCollider,
    TorusCollider,
)
from particlesim.colliders.pose import Orientation
from particlesim.forces import Drag, Gravity
from particlesim.laws.registry import Particle, gap

GRAVITY = [{"type": "gravity"}]
TURN = Orientation(axis=(1.0, 2.0, -1.0), angle=40.0)


# Nothing gets through


SOLIDS = {
    "box": BoxCollider(size=(1.2, 0.02, 1.0), orientation=TURN),
    "capsule": CapsuleCollider(start=(-0.5, 0.1, 0.2), end=(0.6, -0.3, 0.4), radius=0.05),
    "cylinder": CylinderCollider(start=(0, 0, 0), end=(0, 0.01, 0), radius=0.7),
    "cone": ConeCollider(start=(0.1, -0.5, 0), end=(0, 0.5, 0.2), radius=0.4),
    "torus": TorusCollider(axis=(0.3, 1, 0.2), radius=0.6, tube=0.05),
    "rectangle": RectangleCollider(size=(1.5, 1.0), orientation=TURN),
    "disc": DiscCollider(normal=(1, 2, 3), radius=0.8),
}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", SOLIDS)
@given(
    seed=st.integers(0, 2**32 - 1),
    speed=st.sampled_from([0.1, 10.0, 1e3, 1e5]),
    e=st.sampled_from([0.0, 0.5, 1.0]),
    radius=st.sampled_from([0.0, 0.02]),
    force=st.sampled_from(["none", "weight", "drag"]),
)
@settings(max_examples=25)
def test_what_is_aimed_at_a_shape_comes_back_from_it(
    name: str, seed: int, speed: float, e: float, radius: float, force: str
) -> None:
    # From a place outside towards a place inside: the way of one long step is through the shape, unless it comes back. Which
    # side it is on shows where it would be without the shape, on a straight line: beyond it.
    collider = SOLIDS[name].model_copy(update={"restitution": e})
    record, shape = collider.record(), collider.shape()
    rng = np.random.default_rng(seed)
    surface = collider.triangles()
    n = 12
    chosen = surface.faces[rng.integers(len(surface.faces), size=n)]
    target = np.einsum("ij,ijk->ik", rng.dirichlet(np.ones(3), n), surface.corners[chosen])
    x = rng.normal(size=(n, 3))
    x *= rng.uniform(1.5, 3, n)[:, None] / np.linalg.norm(x, axis=1)[:, None]
    way = target - x
    v = speed * way / np.linalg.norm(way, axis=1)[:, None]
    forces: dict[str, Any] = {
        "none": (),
        "weight": (Gravity().record(),),
        "drag": (Drag(density=1.2, area=1e-3).record(),),  # a = 3·10⁻⁴ v²: no parabola at 10⁵ m/s
    }
    c = columns(x, v, radius=radius)
    contacts = careful(continuous=[record], reach=collider.reach(), tolerance=16 * EPS)
    h = 20.0 / speed
    assert not run(program("velocity_verlet", forces[force], contacts), c, 1, h).any()
    now = position(c)
    for k in range(n):
        p = Particle(*now[k], 0, 0, 0, 1.0, radius, 0.0, 0.0)
        assert gap(shape, p) >= -1e-10 * max(1, np.abs(now[k]).max())
        assert np.isfinite(now[k]).all()
    if force == "none":
        fast = np.linalg.norm(velocity(c), axis=1)
        assert (fast <= speed * (1 + 1e-12)).all()
        if e == 1:
            np.testing.assert_allclose(fast, speed, rtol=1e-12)
        # nobody is where the straight way would have led
        unhindered = x + 20 * way / np.linalg.norm(way, axis=1)[:, None]
        kept = np.linalg.norm(now - unhindered, axis=1) < 1e-6
        skimmed = np.array([grazes(shape, x[k], way[k], radius) for k in range(n)])
        assert not (kept & ~skimmed).any()


def grazes(shape: Any, x: NDArray[Any], way: NDArray[Any], radius: float) -> bool:
    """Whether a straight way only grazes a shape, or misses it by the coarseness of its triangles."""
    s = np.linspace(0, 2, 4001)
    deep = min(float(gap(shape, Particle(*(x + k * way), 0, 0, 0, 1, radius, 0, 0))) for k in s[1800:2200])
    return deep > -2e-5


@pytest.mark.parametrize("e", [0.0, 0.6])
@pytest.mark.parametrize("h", [0.1, 0.05, 0.013])
def test_what_slides_over_an_edge_within_a_step_falls_from_there_on(e: float, h: float) -> None:
    # It lies on the box for 0.05 s, at 4 m/s, and falls freely after that, in whatever steps.
    box = BoxCollider(size=(1.0, 1.0, 1.0), restitution=e)
    c = columns([[0.3, 0.5, 0.0]], [[4.0, 0.0, 0.0]])
    contacts = careful(continuous=[box.record()], tolerance=16 * EPS, reach=box.reach())
    steps = round(0.1 / h)
    run(program("velocity_verlet", (Gravity(acceleration=(0, -10, 0)).record(),), contacts), c, steps, h)
    fallen = steps * h - 0.05
    assert position(c)[0] == pytest.approx([0.3 + 4 * steps * h, 0.5 - 5 * fallen**2, 0], abs=1e-6)
    assert velocity(c)[0] == pytest.approx([4, -10 * fallen, 0], abs=1e-6)
