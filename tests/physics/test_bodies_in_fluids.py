"""Fluids act through the surface of rigid bodies: floating, and falling against drag."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulate import G, simulate

from particlesim.bodies import Bodies
from particlesim.engine.rigid.fluids import act, stored, through_surface
from particlesim.engine.rigid.rotation import matrix
from particlesim.forces.buoyancy import Buoyancy
from particlesim.forces.drag import Drag
from particlesim.laws.registry import Particle
from particlesim.model.attributes import FURTHER

FLOAT = [
    {"type": "gravity", "acceleration": [0, -G, 0]},
    {"type": "buoyancy", "density": 1000, "surface": 0.0, "acceleration": [0, -G, 0]},
]
WATER = {"type": "buoyancy", "density": 1000, "surface": 0.0}


def acting(law: Any, shape: dict[str, Any], **other: Any) -> Any:
    """Force and torque of a law on a body, and its energy, by the place, the velocity, the turn and the turning."""
    made = Bodies.model_validate({"shape": shape})
    record = through_surface(law.record(), made.shape)

    def at(x: Any, v: Any = (0, 0, 0), q: Any = (1, 0, 0, 0), w: Any = (0, 0, 0)) -> tuple[np.ndarray, float]:
        p = Particle(*x, *v, made.weight, made.ball, 0.0, 0.0, 1 / made.weight, *[0.0 for _ in FURTHER])
        out = np.zeros((1, 6))
        act(record, p, matrix(q), w, out)
        return out[0], float(stored(record, p, matrix(q)))

    return at


SHAPES = [
    {"type": "sphere", "radius": 0.1},
    {"type": "box", "size": [0.2, 0.3, 0.1]},
    {"type": "cone", "radius": 0.1, "length": 0.3},
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape["type"])
def test_what_is_displaced_carries(shape: dict[str, Any]) -> None:
    at = acting(Buoyancy.model_validate(WATER), shape)
    volume = Bodies.model_validate({"shape": shape}).shape.volume()
    q = np.array([0.8, 0.2, -0.4, 0.3]) / np.linalg.norm([0.8, 0.2, -0.4, 0.3])
    total, energy = at((0.3, -1.0, 0.2), q=q)
    lift = 1000 * 9.80665 * volume
    assert total[:3] == pytest.approx([0, lift, 0], abs=1e-9 * lift)
    assert total[3:] == pytest.approx([0, 0, 0], abs=1e-9 * lift)  # it acts in the centre of the volume
    assert energy == pytest.approx(lift * 1.0, rel=1e-9)
    assert not np.any(at((0, 1.0, 0), q=q)[0])
    # Between, force and torque are the slopes of the energy.
    h = 1e-6
    for y in (-0.05, 0.0, 0.04):
        here = at((0, y, 0), q=q)[0]
        slope = (at((0, y + h, 0), q=q)[1] - at((0, y - h, 0), q=q)[1]) / (2 * h)
        assert here[1] == pytest.approx(-slope, rel=1e-6, abs=1e-6)
        for axis in range(3):
            half = np.zeros(3)
            half[axis] = 0.5 * h
            w, (a, b, c) = q[0], q[1:]
            ends = []
            for sign in (1, -1):
                e = sign * half
                turned = np.array(
                    [
                        w - e @ [a, b, c],
                        *(np.array([a, b, c]) + w * e + np.cross(e, [a, b, c])),
                    ]
                )
                ends.append(at((0, y, 0), q=turned / np.linalg.norm(turned))[1])
            assert here[3 + axis] == pytest.approx(-(ends[0] - ends[1]) / (2 * h), rel=1e-5, abs=1e-5)


@pytest.mark.parametrize(
    ("turn", "area"),
    [((1, 0, 0, 0), 0.2 * 0.1), ((math.sqrt(0.5), math.sqrt(0.5), 0, 0), 0.2 * 0.3)],
)
def test_drag_is_that_of_the_frontal_area(turn: Any, area: float) -> None:
    at = acting(Drag.model_validate({"type": "drag", "density": 1.2, "coefficient": 1.05}), SHAPES[1])
    total, _ = at((0, 0, 0), v=(0, -7, 0), q=turn)
    assert total == pytest.approx([0, 0.5 * 1.2 * 1.05 * area * 49, 0, 0, 0, 0], abs=1e-12)
    # Askew the flow sees Σ A |n·u|/|u| of the three pairs of faces.
    q = np.array([0.9, 0.1, 0.3, -0.2])
    q /= np.linalg.norm(q)
    down = np.reshape(matrix(q), (3, 3)).T @ [0, -1, 0]
    seen = np.abs(down) @ [0.3 * 0.1, 0.2 * 0.1, 0.2 * 0.3]
    total, _ = at((0, 0, 0), v=(0, -7, 0), q=q)
    assert total[1] == pytest.approx(0.5 * 1.2 * 1.05 * seen * 49, rel=1e-12)
    # What turns is braked.
    assert at((0, 0, 0), w=(0, 0, 3.0))[0][5] < 0


def test_a_box_floats_as_deep_as_it_is_heavy_and_rights_itself() -> None:
    # Its draught is ρ/ρ_w of its height; what it is lifted by changes the force by ρ_w g A, and a lean of φ gives the torque
    # −m g (I/V − c) φ, with the second moment I of its water line about the axis, V what it displaces and c the height of
    # its centre of mass over that of V.
    at = acting(Buoyancy.model_validate(WATER), {"type": "box", "size": [0.4, 0.1, 0.6]})
    g, mass = 9.80665, 600 * 0.4 * 0.1 * 0.6
    assert at((0, -0.01, 0))[0] == pytest.approx([0, mass * g, 0, 0, 0, 0], abs=1e-9)
    assert at((0, 0.0, 0))[0][1] == pytest.approx(mass * g - 1000 * g * 0.4 * 0.6 * 0.01, abs=1e-9)
    lean, displaced = 1e-4, 0.4 * 0.6 * 0.06
    metacentre = 0.6 * 0.4**3 / 12 / displaced - 0.02
    torque = at((0, -0.01, 0), q=(math.cos(lean / 2), 0, 0, math.sin(lean / 2)))[0][5]
    assert torque == pytest.approx(-mass * g * metacentre * lean, rel=1e-6)


def test_the_drag_of_round_bodies_is_that_of_their_sections() -> None:
    # A cylinder that moves along its axis shows π r², across it 2 r l; polygons of 24 corners are wider by 0.3 % at most.
    r, length = 0.05, 0.1
    law = Drag.model_validate({"type": "drag", "density": 1.2, "coefficient": 0.8})
    at = acting(law, {"type": "cylinder", "radius": r, "length": length})
    per_area = 0.5 * 1.2 * 0.8 * 49
    assert at((0, 0, 0), v=(0, 0, 7))[0][2] == pytest.approx(-per_area * math.pi * r * r, rel=1e-12)
    assert at((0, 0, 0), v=(7, 0, 0))[0][0] == pytest.approx(-per_area * 2 * r * length, rel=1e-2)


def test_the_work_of_drag_through_the_surface_is_booked() -> None:
    # What is left of the balance is the error of the method, of second order.
    box = {
        "name": "box",
        "shape": {"type": "box", "size": [0.2, 0.3, 0.1]},
        "density": 400,
        "position": [0, 0.3, 0],
        "angular_velocity": [1, 2, 3],
    }
    forces = [*FLOAT, {"type": "drag", "density": 500, "coefficient": 1.0}]
    left = []
    for dt in (4e-3, 2e-3):
        output = {"ledger": True, "work": True, "every": round(0.02 / dt)}
        rows = simulate(1.0, dt, bodies=[box], forces=forces, output=output).ledger
        assert rows["work.drag"][-1] < -5
        left.append(np.abs(rows["balance"]).max() / -rows["work.drag"][-1])
    assert left[1] < 1e-3
    assert 3.0 < left[0] / left[1] < 5.0
