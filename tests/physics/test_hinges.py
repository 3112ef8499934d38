"""Angles, dihedrals and drag on surfaces inside a run: frequencies, conservation, terminal velocity, the ledger."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulate import EPS, G, points, simulate

import particlesim as ps
from particlesim.bonds.hinge import angles_at

K, M, L = 3.0, 0.4, 0.5


@pytest.mark.parametrize("form", ["harmonic", "cosine"])
def test_an_angle_swings_with_its_frequency(form: str) -> None:
    # The end of an arm of length L feels k d/L across it: ω = √(k/m)/L. After half a period the angle has changed its side.
    # The swing of 10⁻⁵ rad changes ω by d²/16 and the length by d², rounding of positions by EPS per step.
    small, omega, steps = 1e-5, math.sqrt(K / M) / L, 1000
    t = math.pi / omega
    end = (L * math.cos(small), L * math.sin(small), 0.0)
    result = simulate(
        t,
        t / steps,
        particles=[points((-1, 0, 0), (0, 0, 0), end, mass=M, pinned=[0, 1], name="arm")],
        angles=[{"on": "arm", "triples": [[0, 1, 2]], "stiffness": K, "rest_angle": 180, "form": form}],
        output={"ledger": True},
    )
    assert result.final.position[2] == pytest.approx(
        [L, -L * small, 0], abs=L * small * (math.pi / steps) ** 2 + L * small**2 * 4
    )
    assert result.ledger["potential.angles"][0] == pytest.approx(K * small**2 / 2, rel=1e-9)


def test_a_fold_swings_with_its_frequency() -> None:
    # The free corner, h away from the edge, feels k d/h: ω = √(k/m)/h.
    small, h, steps = 1e-5, 0.6, 1000
    t = math.pi / (math.sqrt(K / M) / h)
    corner = (h * math.cos(small), 0.3, h * math.sin(small))
    result = simulate(
        t,
        t / steps,
        particles=[points((-1, 0, 0), (0, 0, 0), (0, 1, 0), corner, mass=M, pinned=[0, 1, 2], name="flap")],
        dihedrals=[{"on": "flap", "quadruples": [[0, 1, 2, 3]], "stiffness": K, "rest_angle": 0}],
    )
    assert result.final.position[3] == pytest.approx(
        [h, 0.3, -h * small], abs=h * small * (math.pi / steps) ** 2 + 4 * h * small**2
    )


def test_bending_keeps_energy_momentum_and_angular_momentum() -> None:
    # Velocity Verlet: energy oscillates by (ωh)² of what is stored; the others are kept to rounding, which grows with the
    # steps and the forces. A cloth creased by random velocities, free in space.
    normal = {"type": "normal", "mean": 0, "std": 0.05}
    steps, dt = 400, 5e-4
    rope = {"type": "rope", "start": [0, 1, 0], "end": [1, 1, 0], "count": 12, "velocity": [0, 0.1, 0]}
    result = simulate(
        steps * dt,
        dt,
        particles=[
            {
                "name": "sheet",
                "layout": {"type": "cloth", "size": [1, 1], "resolution": [6, 6]},
                "mass": 0.3,
                "springs": {"structural": 40.0, "shear": 20.0, "dihedral": 0.02},
            },
            {"name": "rope", "layout": rope, "mass": 0.1, "springs": {"structural": 40.0, "angle": 0.05}},
            {
                "name": "crease",
                "layout": {
                    "type": "random",
                    "count": 8,
                    "shape": {"type": "ball", "radius": 1},
                    "velocity": [normal] * 3,
                },
                "mass": 0.02,
            },
        ],
        springs=[
            {
                "name": "pull",
                "between": ["sheet", "crease"],
                "pairs": [[4 * k, k] for k in range(8)],
                "stiffness": 5.0,
            },
            {"name": "tug", "between": ["rope", "crease"], "pairs": [[3, 0], [7, 1]], "stiffness": 5.0},
        ],
        angles=[{"on": "crease", "triples": [[0, 1, 2], [3, 4, 5]], "stiffness": 0.1, "rest_angle": 90}],
        output={"ledger": True, "every": 20},
    )
    energy = result.energy
    for name in ("sheet.dihedral", "rope.angle", "angles"):
        assert np.ptp(result.ledger[f"potential.{name}"]) > 1e-5, f"{name} bends"
    assert np.ptp(energy) < 2e-4 * energy.max()
    for axis in "xyz":
        for name in ("momentum", "angular_momentum"):
            assert np.ptp(result.ledger[f"{name}.{axis}"]) < steps * 40 * EPS


def test_wind_on_a_flat_sail_is_wind_on_a_plate(tmp_path: Path) -> None:
    # ½ ρ A (c_n |u_n| u_n + c_t |u_t| u_t) for the whole sail, however it is cut into triangles.
    u = np.array([3.0, 0.5, -4.0])
    table: dict[str, Any] = {
        "simulation": {"duration": 1e-3, "dt": 1e-3},
        "output": {"fields": ["force"], "every": 1, "precision": "double"},
        "particles": [
            {
                "name": "sail",
                "layout": {"type": "cloth", "size": [2, 3], "resolution": [5, 4]},
                "springs": {"structural": 1.0},
            }
        ],
        "forces": [
            {
                "type": "sheet_drag",
                "density": 1.3,
                "normal_coefficient": 1.1,
                "tangential_coefficient": 0.2,
                "flow": [{"type": "uniform", "velocity": u.tolist()}],
            }
        ],
    }
    ps.run(ps.from_table(table), tmp_path / "sail.vtkhdf")
    with ps.open(tmp_path / "sail.vtkhdf") as trajectory:
        found = trajectory[0]["force"].sum(axis=0)
    along = np.array([u[0], u[1], 0])
    wanted = 0.5 * 1.3 * 6 * (1.1 * abs(u[2]) * np.array([0, 0, u[2]]) + 0.2 * np.linalg.norm(along) * along)
    np.testing.assert_allclose(found, wanted, rtol=20 * EPS)


def test_a_falling_plate_reaches_its_terminal_velocity(tmp_path: Path) -> None:
    # A triangle: every corner has a third of the drag and of the mass. v = v_t tanh(g t/v_t), v_t² = 2 m g/ρ c A.
    (tmp_path / "plate.obj").write_text("v 0 0 0\nv 0 0 1\nv 1 0 0\nf 1 2 3\n")
    mass, rho, c, t = 0.05, 1.2, 1.3, 0.8
    terminal = math.sqrt(2 * mass * G / (rho * c * 0.5))
    (tmp_path / "s.toml").write_text(
        f"""
[simulation]
duration = {t}
dt = 0.002
integrator = "rk4"
[[particles]]
layout = {{ type = "mesh", path = "plate.obj" }}
mass = {mass}
[[forces]]
type = "gravity"
[[forces]]
type = "sheet_drag"
density = {rho}
normal_coefficient = {c}
"""
    )
    final = ps.run(ps.load(tmp_path / "s.toml")).final
    # RK4 with g h/v_t = 0.004: h⁴ of it.
    assert final.velocity[:, 1] == pytest.approx([-terminal * math.tanh(G * t / terminal)] * 3, rel=1e-9)


ARM = points((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 1), name="arm")
DUST = {"name": "dust", "rate": 10, "shape": {"type": "point", "position": [0, 0, 0]}}


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"angles": [{"on": "arm", "triples": [[0, 1, 4]], "stiffness": 1.0}]}, "no particle 4"),
        ({"angles": [{"on": "arm", "triples": [[0, 1, 0]], "stiffness": 1.0}]}, "particle 0 twice"),
        ({"angles": [{"on": "arm", "triples": [[0, 1, 2], [2, 1, 0]], "stiffness": 1.0}]}, "there already"),
        ({"angles": [{"on": "arm", "triples": [[0, 1, 2]], "stiffness": -1.0}]}, "at least 0"),
        ({"angles": [{"on": "amr", "triples": [[0, 1, 2]], "stiffness": 1.0}]}, "unknown group 'amr'"),
        ({"angles": [{"on": "arm", "triples": [[0, 1]], "stiffness": 1.0}]}, "expected 3 elements"),
        (
            {"angles": [{"on": "arm", "triples": [[0, 1, 2]], "stiffness": 1.0, "rest_angle": 200}]},
            "at most 180",
        ),
        (
            {"angles": [{"on": "dust", "triples": [[0, 1, 2]], "stiffness": 1.0}], "emitters": [DUST]},
            "'dust' is emitted",
        ),
        ({"dihedrals": [{"on": "arm", "quadruples": [[0, 1, 2, 9]], "stiffness": 1.0}]}, "no particle 9"),
        ({"forces": [{"type": "sheet_drag", "fluid": "air", "on": ["arm"]}]}, "acts on surfaces"),
        ({"forces": [{"type": "sheet_drag"}]}, "fluid's density"),
        ({"forces": [{"type": "sheet_drag", "fluid": "air"}]}, "no group has one"),
    ],
)
def test_hinges_that_cannot_be(parts: dict[str, Any], message: str) -> None:
    with pytest.raises(ps.UsageError, match=message):
        simulate(0.1, 0.05, particles=[ARM], **parts)


def test_an_angle_needs_two_arms() -> None:
    # Particles 1 and 2 are at one place: there is no direction from one to the other.
    with pytest.raises(
        ps.UsageError, match="particles 0, 1 and 2 has no size, as 2 and 1 are at the same place"
    ):
        simulate(
            0.1,
            0.05,
            particles=[points((-1, 0, 0), (0, 0, 0), (0, 0, 0), name="arm")],
            angles=[{"on": "arm", "triples": [[0, 1, 2]], "stiffness": K}],
        )


def test_a_fold_without_triangles_rests_as_it_is() -> None:
    # Four particles in a row have no normals: the fold counts as 0, at rest and at the start.
    row = np.arange(12.0).reshape(3, 4) * [[1.0], [0], [0]]
    assert angles_at(row, np.array([[0, 1, 2, 3]])).tolist() == [0.0]
