"""Joints, rods and springs of rigid bodies against closed forms and conservation laws."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ellipk
from simulate import EPS, G, record, simulate, table

import particlesim as ps
from particlesim.engine.rigid.rotation import matrix
from particlesim.engine.simulation import Simulation
from particlesim.engine.snapshot import restore, snapshot
from particlesim.engine.world import World
from particlesim.runs.first_state import stiff
from particlesim.scenario.dump import dump

Array = NDArray[np.float64]
GRAVITY = [{"type": "gravity"}]
BAR = {"type": "box", "size": [0.1, 1.0, 0.06]}


def rotation(q: Any) -> Array:
    return np.reshape(matrix(q), (3, 3))


def at(frame: Any, body: int, point: Any) -> Array:
    """A point of a body in the world."""
    return np.asarray(frame.position[body] + rotation(frame["orientation"][body]) @ np.array(point))


def energies(trajectory: Any) -> Array:
    rows = trajectory.ledger
    return sum(
        np.asarray(v) for name, v in rows.items() if name == "kinetic" or name.startswith("potential.")
    )  # type: ignore[return-value]


# ---- hinges


def swing(tmp_path: Path, h: float) -> ps.Trajectory:
    """A bar on a hinge at its upper end that starts at rest, 1 rad from where it hangs."""
    s, c = math.sin(1.0), math.cos(1.0)
    bar = {
        "name": "bar",
        "shape": BAR,
        "mass": 2.0,
        "position": [0.5 * s, -0.5 * c, 0.3],
        "orientation": {"axis": [0, 0, 1], "angle": math.degrees(1.0)},
    }
    hinge = {"type": "hinge", "between": ["bar", "world"], "anchor": [0, 0, 0.2], "axis": [0, 0, 2]}
    return record(
        tmp_path / f"{h}.vtkhdf",
        4.8,
        h,
        bodies=[bar],
        joints=[hinge],
        forces=GRAVITY,
        output={"every": 3, "ledger": True},
    )


def test_a_bar_on_a_hinge_swings_with_its_period(tmp_path: Path) -> None:
    # T = 4 √(I/(m g d)) K(sin² θ/2), with I = m (a² + b²)/12 + m d² about the axis (Landau and Lifshitz, § 11).
    inertia, d = (0.1**2 + 1.0**2) / 12 + 0.25, 0.5
    period = 4 * math.sqrt(inertia / (G * d)) * ellipk(math.sin(0.5) ** 2)
    errors, swings = [], []
    for h in (8e-3, 4e-3):
        frames = swing(tmp_path, h)
        x = np.array([frame.position[0, 0] for frame in frames])
        k = np.flatnonzero((x[:-1] > 0) & (x[1:] <= 0))
        times = (k + x[k] / (x[k] - x[k + 1])) * 3 * h
        errors.append(abs((times[-1] - times[0]) / (len(times) - 1) / period - 1))
        for frame in frames:
            assert np.linalg.norm(at(frame, 0, [0, 0.5, -0.1]) - [0, 0, 0.2]) < 1e-13
        energy = energies(frames)
        swings.append(np.abs(energy - energy[0]).max() / np.asarray(frames.ledger["kinetic"]).max())
    assert errors[1] < (math.pi * 4e-3 / period) ** 2  # second order in h ω/2
    assert 3.7 < errors[0] / errors[1] < 4.3
    assert 3.8 < swings[0] / swings[1] < 4.2


def four_bars() -> dict[str, Any]:
    """A parallelogram of three bars on hinges, which depend on each other: all axes are along z."""
    bars = [
        {"name": "left", "shape": BAR, "position": [-1, -0.5, 0], "angular_velocity": [0, 0, 3.0]},
        {"name": "right", "shape": BAR, "position": [1, -0.5, 0], "angular_velocity": [0, 0, 3.0]},
        {"name": "coupler", "shape": {"type": "box", "size": [2.0, 0.1, 0.06]}, "position": [0, -1, 0]},
    ]
    bars[0]["velocity"] = bars[1]["velocity"] = [1.5, 0, 0]
    bars[2]["velocity"] = [3.0, 0, 0]
    hinges = [
        ("left", "world", [-1, 0, 0]),
        ("right", "world", [1, 0, 0]),
        ("left", "coupler", [-1, -1, 0]),
        ("right", "coupler", [1, -1, 0]),
    ]
    joints = [
        {"type": "hinge", "name": f"{a}_{b}", "between": [a, b], "anchor": place, "axis": [0, 0, 1]}
        for a, b, place in hinges
    ]
    return {"bodies": bars, "joints": joints, "forces": GRAVITY}


def test_a_loop_of_hinges_that_depend_on_each_other_holds(tmp_path: Path) -> None:
    frames = record(tmp_path / "loop.vtkhdf", 2.0, 2e-3, output={"every": 10, "ledger": True}, **four_bars())
    for frame in frames:
        for side, body in ((-1, 0), (1, 1)):
            assert np.linalg.norm(at(frame, body, [0, 0.5, 0]) - [side, 0, 0]) < 1e-13
            assert np.linalg.norm(at(frame, body, [0, -0.5, 0]) - at(frame, 2, [side, 0, 0])) < 1e-13
        assert rotation(frame["orientation"][2])[1, 0] == pytest.approx(0.0, abs=1e-12)  # stays level
    energy = energies(frames)
    swings = np.abs(energy - energy[0]).max() / np.asarray(frames.ledger["kinetic"]).max()
    assert swings < (2e-3 * 6.0) ** 2  # it turns by up to 6 rad/s


# ---- ball joints


def chain(count: int, **other: Any) -> dict[str, Any]:
    """Bars joined end to end along x, that turn about each other."""
    bars = {
        "name": "bars",
        "shape": {"type": "box", "size": [0.4, 0.1, 0.06]},
        "layout": {"type": "points", "position": [[0.2 + 0.4 * k, 0, 0] for k in range(count)]},
    }
    joint = {
        "type": "ball",
        "on": "bars",
        "pairs": [[k, k + 1] for k in range(count - 1)],
        "anchor": [[0.4 * (k + 1), 0, 0] for k in range(count - 1)],
    }
    return {"bodies": [bars | other], "joints": [joint]}


def test_a_free_chain_keeps_momentum_angular_momentum_and_energy(tmp_path: Path) -> None:
    h, count = 2e-3, 6
    parts = chain(count, angular_velocity=[1.0, 2.0, 4.0])
    parts["bodies"][0]["layout"]["velocity"] = [
        np.cross([1.0, 2.0, 4.0], [0.2 + 0.4 * k, 0, 0]).tolist() for k in range(count)
    ]
    # A kick of one of its ends bends it.
    parts["bodies"][0]["layout"]["velocity"][0] = [0.0, 0.8, -0.4]
    scenario = {"output": {"every": 20, "ledger": True}, **parts}
    frames = record(tmp_path / "chain.vtkhdf", 4.0, h, **scenario)
    rows = frames.ledger
    kinetic = np.asarray(rows["kinetic"])
    mass = 1000 * 0.4 * 0.1 * 0.06 * count
    for axis in "xyz":
        for name, scale in (("momentum", mass * 10.0), ("angular_momentum", mass * 20.0)):
            values = np.asarray(rows[f"{name}.{axis}"])
            assert np.abs(values - values[0]).max() < 2000 * EPS * scale, name  # rounding in 2000 steps
    assert np.abs(kinetic / kinetic[0] - 1).max() < (h * 20) ** 2
    for frame in frames:
        for k in range(count - 1):
            assert np.linalg.norm(at(frame, k, [0.2, 0, 0]) - at(frame, k + 1, [-0.2, 0, 0])) < 1e-13
        assert np.ptp(frame["orientation"], axis=0).max() < 2


def test_a_double_pendulum_of_bodies_keeps_its_energy(tmp_path: Path) -> None:
    swings = []
    for h in (2e-3, 1e-3):
        parts = chain(2)
        parts["joints"].append({"type": "ball", "between": ["bars", "world"], "anchor": [0, 0, 0]})
        frames = record(
            tmp_path / f"{h}.vtkhdf",
            6.0,
            h,
            forces=GRAVITY,
            output={"every": round(0.04 / h), "ledger": True},
            **parts,
        )
        energy = energies(frames)
        swings.append(np.abs(energy - energy[0]) / np.asarray(frames.ledger["kinetic"]).max())
        opened = [np.linalg.norm(at(frame, 0, [-0.2, 0, 0])) for frame in frames]
        opened += [np.linalg.norm(at(f, 0, [0.2, 0, 0]) - at(f, 1, [-0.2, 0, 0])) for f in frames]
        assert max(opened) < 1e-13
    # The motion is chaotic: only the size of swings tells the order. They do not grow.
    early, late = (part.max() for part in np.array_split(swings[1], 2))
    assert swings[1].max() < (1e-3 * 20) ** 2
    assert late < 2 * early
    assert swings[0].max() > 2 * swings[1].max()


def test_a_heavy_top_precesses_steadily() -> None:
    # I₁ Ω² cos θ − I₃ ω₃ Ω + m g d = 0 (Goldstein, § 5.7), with ω₃ along the axis, I₁ and I₃ about the tip.
    mass, side, height, tilt, spin = 1.0, 0.2, 0.05, 0.5, 150.0
    d = 0.2
    own = mass / 12 * np.array([side**2 + height**2, 2 * side**2])
    i1, i3 = own[0] + mass * d * d, own[1]
    a, b, c = i1 * math.cos(tilt), -i3 * spin, mass * G * d
    precession = (-b - math.sqrt(b * b - 4 * a * c)) / (2 * a)
    axis = np.array([math.sin(tilt), math.cos(tilt), 0.0])
    # ω = Ω y + ψ̇ axis, with ω₃ = ψ̇ + Ω cos θ
    turning = precession * np.array([0, 1, 0]) + (spin - precession * math.cos(tilt)) * axis
    errors = []
    for h in (5e-4, 2.5e-4):
        top = {
            "name": "top",
            "shape": {"type": "box", "size": [side, height, side]},
            "mass": mass,
            "position": (d * axis).tolist(),
            "velocity": np.cross(turning, d * axis).tolist(),
            "orientation": {"axis": [0, 0, 1], "angle": -math.degrees(tilt)},
            "angular_velocity": turning.tolist(),
        }
        tip = {"type": "ball", "between": ["top", "world"], "anchor": [0, 0, 0]}
        time = 1.0
        end = simulate(time, h, bodies=[top], joints=[tip], forces=GRAVITY).final
        x, y, z = end["position"][0]
        assert math.hypot(x, y, z) == pytest.approx(d, abs=1e-13)
        turned = math.atan2(-z, x)
        errors.append(abs((turned - precession * time + math.pi) % (2 * math.pi) - math.pi))
        assert math.acos(y / d) == pytest.approx(tilt, abs=(spin * h) ** 2)
    assert errors[1] < (spin * 2.5e-4) ** 2 * precession
    assert 3.5 < errors[0] / errors[1] < 4.5


# ---- rods


def test_a_weight_on_a_rod_circles_as_a_conical_pendulum() -> None:
    # ω² = g/(L cos θ); the rod goes to the centre of the weight, which does not turn.
    length, tilt = 1.2, 0.6
    omega = math.sqrt(G / (length * math.cos(tilt)))
    x, y = length * math.sin(tilt), -length * math.cos(tilt)
    errors = []
    for h in (1e-2, 5e-3):
        weight = {
            "name": "weight",
            "shape": {"type": "sphere", "radius": 0.1},
            "position": [x, y, 0],
            "velocity": [0, 0, -omega * x],
        }
        rod = {"between": ["weight", "world"], "points": [[0, 0, 0], [0, 0, 0]]}
        end = simulate(2.0, h, bodies=[weight], rods=[rod], forces=GRAVITY).final
        assert np.linalg.norm(end["position"][0]) == pytest.approx(length, abs=1e-13)
        assert np.abs(end["angular_velocity"]).max() == 0
        place = [x * math.cos(2 * omega), y, x * math.sin(-2 * omega)]
        errors.append(np.linalg.norm(end["position"][0] - place))
    assert 3.7 < errors[0] / errors[1] < 4.3
    assert errors[1] < (omega * 5e-3) ** 2 * x


def test_a_plate_on_two_rods_swings_without_turning() -> None:
    # Parallel rods of one length: the plate moves as a point on a rod of that length would, T = 2π √(L/g) (1 + θ²/16).
    length, tilt = 0.8, 0.05
    s, c = length * math.sin(tilt), length * math.cos(tilt)
    plate = {"name": "plate", "shape": {"type": "box", "size": [1.0, 0.05, 0.3]}, "position": [s, -c, 0]}
    rods = [
        {"name": f"rod{k}", "between": ["plate", "world"], "points": [[x, 0.0, z], [x, 0.0, z]]}
        for k, (x, z) in enumerate([(-0.4, 0.1), (-0.4, -0.1), (0.4, 0.1), (0.4, -0.1)])
    ]
    period = 2 * math.pi * math.sqrt(length / G) * (1 + tilt**2 / 16)
    end = simulate(period, period / 1000, bodies=[plate], rods=rods, forces=GRAVITY).final
    assert end["position"][0] == pytest.approx([s, -c, 0], abs=2e-5 * s)
    assert end["orientation"][0] == pytest.approx([1, 0, 0, 0], abs=1e-12)


# ---- springs


def test_a_spring_at_corners_swings_with_its_frequency(tmp_path: Path) -> None:
    # Small changes of its length: 1/μ = Σ 1/m + (r × e)·I⁻¹(r × e) over both bodies; a frequency is meant for that mass.
    f, amplitude, h = 2.0, 1e-5, 1e-3
    bodies = [
        {"name": "one", "shape": {"type": "box", "size": [0.2, 0.3, 0.4]}, "position": [0, 0, 0]},
        {"name": "two", "shape": {"type": "box", "size": [0.3, 0.2, 0.2]}, "position": [1, 0.2, 0.1]},
    ]
    points = [[0.1, 0.15, 0.2], [-0.15, 0.1, -0.1]]
    rest = float(np.linalg.norm(np.array([1, 0.2, 0.1]) + points[1] - np.array(points[0])))
    spring = {"between": ["one", "two"], "points": points, "frequency": f, "rest_length": rest - amplitude}
    frames = record(
        tmp_path / "corners.vtkhdf",
        3.0,
        h,
        bodies=bodies,
        springs=[spring],
        output={"every": 20, "ledger": True},
    )
    stretch = np.array([np.linalg.norm(at(k, 0, points[0]) - at(k, 1, points[1])) for k in frames])
    stretch -= rest - amplitude
    t = np.arange(len(stretch)) * 20 * h
    assert stretch == pytest.approx(amplitude * np.cos(2 * math.pi * f * t), abs=2e-3 * amplitude)
    rows = frames.ledger
    energy = energies(frames)
    assert energy == pytest.approx(np.full_like(energy, energy[0]), rel=(math.pi * f * h) ** 2)
    for name in ("momentum", "angular_momentum"):
        for axis in "xyz":
            assert np.abs(rows[f"{name}.{axis}"]).max() < 1e-15


def test_a_damped_spring_is_of_second_order() -> None:
    # A weight on a spring to the world: x = A e^(−γt) cos(ωt + φ) with γ = c/2m, about its place of rest.
    mass, k, c, rest = 2.0, 50.0, 3.0, 0.5
    gamma = c / (2 * mass)
    omega = math.sqrt(k / mass - gamma**2)
    errors = []
    for h in (1e-2, 5e-3):
        weight = {
            "name": "weight",
            "shape": {"type": "sphere", "radius": 0.1},
            "mass": mass,
            "position": [0, -rest, 0],
        }
        spring = {
            "between": ["weight", "world"],
            "points": [[0, 0, 0], [0, 0, 0]],
            "stiffness": k,
            "damping": c,
            "rest_length": rest,
        }
        time = 1.0
        end = simulate(time, h, bodies=[weight], springs=[spring], forces=GRAVITY).final["position"][0]
        sag = mass * G / k
        decay = math.exp(-gamma * time) * (math.cos(omega * time) + gamma / omega * math.sin(omega * time))
        errors.append(abs(end[1] - (-rest - sag + sag * decay)))
    assert 3.7 < errors[0] / errors[1] < 4.3


@pytest.mark.parametrize(("k", "c"), [(5e3, 0.0), (0.0, 500.0), (5e3, 200.0)])
def test_steps_too_long_for_springs_are_told(k: float, c: float) -> None:
    # Two springs at the ends of a rod of mass m turn it: 1/μ = 1/m + r² m/(m² (4 r²)/12) = 4/m for each of them.
    def scene(h: float, steps: int = 400) -> ps.Scenario:
        bar = {"name": "bar", "shape": {"type": "box", "size": [1e-3, 1.0, 1e-3]}, "mass": 2.0}
        springs = [
            {
                "between": ["bar", "world"],
                "points": [[0, y, 0], [1, y + 1e-3, 0]],
                "stiffness": k,
                "damping": c,
                "rest_length": 1.0,
            }
            for y in (-0.5, 0.5)
        ]
        bar["angular_velocity"] = [0, 0, 1e-4]
        return ps.from_table(table(steps * h, h, bodies=[bar], springs=springs, output={"every": steps}))

    # Both ends together turn it, 12/m, or move it, 2/m: the larger ones count, ω² = 6 k/m and γ = 6 c/m.
    square, rate = 6 * k / 2.0, 6 * c / 2.0
    limit = 2 * (math.sqrt(rate**2 / 4 + square) - rate / 2) / square if k else 2 / rate
    calm = ps.run(scene(0.95 * limit))
    assert not any("springs at rigid bodies" in text for text in calm.warnings)
    assert np.abs(calm.final["position"]).max() < 1e-2
    assert "stable step under springs at rigid bodies" in stiff(World(scene(1.05 * limit)))[0]
    with pytest.raises(ps.DivergenceError):
        ps.run(scene(1.3 * limit, steps=2000))


def test_a_string_does_nothing_while_it_is_slack() -> None:
    ball = {"name": "ball", "shape": {"type": "sphere", "radius": 0.1}}
    spring = {
        "between": ["ball", "world"],
        "points": [[0, 0.1, 0], [0, 0.1, 0]],
        "stiffness": 1e3,
        "rest_length": 1.0,
        "tension_only": True,
    }
    end = simulate(0.3, 1e-3, bodies=[ball], springs=[spring], forces=GRAVITY).final
    assert end["position"][0] == pytest.approx([0, -0.5 * G * 0.09, 0], rel=1e-9)


# ---- work


def test_work_on_bodies_is_booked(tmp_path: Path) -> None:
    # Energy changes by the work of drag, dampers and contact, and by nothing else but the swings of the method: O(h²) where
    # nothing hits anything, less than a thousandth of what contact takes where something does.
    air = {"type": "drag", "density": 50.0, "coefficient": 1.0}
    slow = {"type": "field", "name": "push", "force": ["2*sin(9*t)", "0", "0"]}
    left = []
    for h in (2e-3, 1e-3):
        parts = bridge()
        parts["bodies"] = parts["bodies"][:1]
        parts["forces"] = [*GRAVITY, air, slow]
        output = {"every": round(0.1 / h), "ledger": True, "work": True}
        rows = record(tmp_path / f"{h}.vtkhdf", 0.5, h, output=output, **parts).ledger
        left.append(np.abs(rows["balance"]).max())
        assert rows["work.drag"][-1] < -0.1
        assert rows["work.springs"][-1] < -0.1
        assert abs(rows["work.contact"][-1]) < 1e-12
        assert abs(rows["work.push"][-1]) > 1e-3
    assert 3.5 < left[0] / left[1] < 4.5
    parts = bridge()
    output = {"every": 100, "ledger": True, "work": True}
    rows = record(tmp_path / "hit.vtkhdf", 0.6, 1e-3, output=output, **parts).ledger
    assert rows["work.contact"][-1] < -1.0
    assert np.abs(rows["balance"]).max() < 1e-3 * -rows["work.contact"][-1]


# ---- joints and contact


def bridge() -> dict[str, Any]:
    """Planks on hinges between two places, and a ball that falls on them."""
    count = 8
    planks = {
        "name": "planks",
        "shape": {"type": "box", "size": [0.2, 0.03, 0.4]},
        "density": 600,
        "layout": {"type": "points", "position": [[0.2 * k, 0, 0] for k in range(count)]},
    }
    ball = {"name": "ball", "shape": {"type": "sphere", "radius": 0.15}, "position": [0.6, 0.5, 0.05]}
    joints = [
        {
            "type": "hinge",
            "on": "planks",
            "pairs": [[k, k + 1] for k in range(count - 1)],
            "axis": [0, 0, 1],
        },
        {
            "type": "hinge",
            "name": "bank",
            "between": ["planks", "world"],
            "anchor": [-0.1, 0, 0],
            "axis": [0, 0, 1],
        },
    ]
    spring = {
        "between": ["planks", "world"],
        "pairs": [[count - 1, 0]],
        "points": [[0.1, 0, 0], [0.2 * count - 0.1, 0.4, 0]],
        "stiffness": 2000.0,
        "damping": 20.0,
    }
    return {"bodies": [planks, ball], "joints": joints, "springs": [spring], "forces": GRAVITY}


def test_joints_hold_under_contact_and_no_energy_is_gained(tmp_path: Path) -> None:
    frames = record(tmp_path / "bridge.vtkhdf", 1.0, 1e-3, output={"every": 10, "ledger": True}, **bridge())
    for frame in frames:
        assert np.linalg.norm(at(frame, 0, [-0.1, 0, 0]) - [-0.1, 0, 0]) < 1e-13
        for k in range(7):
            gap = at(frame, k, [0.1, 0, 0]) - at(frame, k + 1, [-0.1, 0, 0])
            assert np.linalg.norm(gap) < 1e-13
    energy = energies(frames)
    scale = np.asarray(frames.ledger["kinetic"]).max()
    assert np.diff(energy).max() < 1e-3 * scale
    assert frames[-1].position[8, 1] < 0.2  # the ball has met the planks
    assert energy[-1] < energy[0] - 0.1 * scale


def test_the_same_bits_for_any_number_of_threads_and_in_any_text() -> None:
    scenario = ps.from_table(table(0.5, 1e-3, output={"every": 50, "ledger": True}, **bridge()))
    one, two = (ps.run(scenario, threads=n) for n in (1, 2))
    for field in ("position", "orientation", "angular_velocity"):
        assert one.final[field].tobytes() == two.final[field].tobytes()
    assert ps.loads(dump(scenario)) == scenario


def test_the_same_bits_after_a_resume() -> None:
    scenario = ps.from_table(
        table(0.6, 1e-3, output={"every": 100, "ledger": True, "work": True}, **bridge())
    )
    whole, first, second = (Simulation(scenario, threads=1) for _ in range(3))
    for each in (whole, first):
        each.ledger()  # from which balances count
    whole.advance_to(300)  # in pieces that end where the other two part
    whole.advance_to(600)
    first.advance_to(300)
    restore(second, snapshot(first))
    second.advance_to(600)
    assert whole.ledger() == second.ledger()
    for name in ("x", "v", "turn", "spin"):
        one, two = (getattr(each.islands[0].bodies(), name) for each in (whole, second))  # type: ignore[attr-defined]
        assert one.tobytes() == two.tobytes()


# ---- mistakes

BODY = {"name": "body", "shape": BAR}
BALL = {"type": "ball", "between": ["body", "world"]}
HINGE = BALL | {"type": "hinge", "axis": [0, 0, 1]}
SPRING = {"between": ["body", "world"], "points": [[0, 0, 0], [0, 1, 0]], "stiffness": 1.0}
DUST = {"name": "dust", "layout": {"type": "points", "position": [[0, 0, 0]]}}
ROD = {"between": ["body", "world"], "points": [[0, 0, 0], [0, 1, 0]]}


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"joints": [BALL | {"between": ["bdoy", "world"]}]}, "unknown body 'bdoy'"),
        ({"joints": [BALL | {"between": ["world", "body"]}]}, '"world" must be the second'),
        ({"joints": [BALL | {"pairs": [[1, 0]]}]}, "has no body 1"),
        ({"joints": [BALL | {"pairs": [[0, 1]]}]}, "the index of the world is 0"),
        ({"joints": [BALL | {"anchor": [[0, 0, 0], [0, 1, 0]]}]}, "2 places for 1"),
        ({"joints": [BALL | {"between": None, "on": "body"}]}, "which bodies"),
        ({"joints": [HINGE | {"axis": [0, 0, 0]}]}, "needs a direction"),
        ({"springs": [SPRING | {"between": ["body", "bdoy"]}]}, "unknown body 'bdoy'"),
        ({"springs": [{"between": ["body", "world"], "pairs": [[0, 0]], "stiffness": 1.0}]}, '"world" needs points'),
        ({"rods": [ROD | {"pairs": [[2, 0]]}]}, "has no body 2"),
        ({"springs": [SPRING | {"between": ["dust", "world"]}], "particles": [DUST]}, "'dust' are particles"),
    ],
)  # fmt: skip
def test_joints_that_cannot_be_are_refused(parts: dict[str, Any], message: str) -> None:
    with pytest.raises(ps.ScenarioError, match=message):
        ps.from_table(table(1.0, 1e-2, bodies=[BODY], **parts))


@pytest.mark.parametrize(
    ("body", "joint", "message"),
    [
        ({}, {"rods": [ROD | {"length": 0.9}]}, "1 m apart"),
        ({"velocity": [1, 0, 0]}, {"joints": [BALL]}, "move apart at 1 m/s"),
        ({"angular_velocity": [1, 0, 0]}, {"joints": [HINGE]}, "across the axis"),
    ],
)
def test_starts_that_do_not_fit_joints_are_refused(
    body: dict[str, Any], joint: dict[str, Any], message: str
) -> None:
    with pytest.raises(ps.UsageError, match=message):
        simulate(1.0, 1e-2, bodies=[BODY | body], **joint)


OPENING = """format = 1
[simulation]
duration = 0.1
dt = 0.001
[[bodies]]
name = "door"
shape = { type = "box", size = [0.2, 0.2, 0.2] }
layout = { type = "points", position = [[0, 0, 0], [1, 0, 0]] }
angular_velocity = [0, 0, 3]
[[joints]]
type = "ball"
TABLE
"""


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        (
            'between = ["door", "world"]\npairs = [[1, 0]]\nanchor = [0.5, 0, 0]',
            "body 1 of 'door' and the world move apart at 1.5 m/s at the start where they are joined, at (0.5, 0, 0) m, "
            "0.5 m from the centre of body 1 of 'door'",
        ),
        (
            'on = "door"\npairs = [[0, 1]]',
            "body 0 of 'door' and body 1 of 'door' move apart at 3 m/s at the start where they are joined, at "
            "(0.5, 0, 0) m, 0.5 m from the centre of body 0 of 'door' and 0.5 m from the centre of body 1 of 'door'",
        ),
    ],
)
def test_a_joint_that_would_open_is_told_with_its_place_and_its_bodies(joint: str, message: str) -> None:
    with pytest.raises(ps.ScenarioError) as error:
        ps.run(ps.loads(OPENING.replace("TABLE", joint)))
    (told,) = error.value.diagnostics
    assert message in told.message
    assert told.span is not None
    assert (told.span.line, told.span.column) == (10, 1)


def test_a_joint_between_the_world_and_itself_is_told_as_such() -> None:
    with pytest.raises(ps.ScenarioError, match="the world is joined to itself") as error:
        ps.from_table(table(1, 0.01, joints=[{"type": "ball", "between": ["world", "world"]}]))
    (told,) = [each for each in error.value.diagnostics if "world" in each.message]
    assert told.allowed == 'a group of bodies and "world", or two groups of bodies'


def test_a_joint_of_a_body_with_itself_speaks_of_a_body() -> None:
    with pytest.raises(ps.ScenarioError, match="joins body 0 to itself"):
        ps.from_table(table(1, 0.01, joints=[{"type": "ball", "on": "bar", "pairs": [[0, 0]]}]))


@pytest.mark.parametrize("length", [1e-320, 1e-200, 1e200])
def test_the_axis_of_a_hinge_may_have_any_length(length: float) -> None:
    """The square of its length had been 0 or infinite, and its direction none."""
    spun = BODY | {"angular_velocity": [0, 0, 1]}
    ends = [
        simulate(0.1, 1e-2, bodies=[spun], joints=[HINGE | {"axis": [0, 0, size]}]).final["orientation"]
        for size in (1.0, length)
    ]
    assert abs(ends[0][0, 3]) > 0.04
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-12, atol=1e-15)


def pulled_chain(h: float, steps: int) -> Any:
    """A chain of 20 links that bears a load, and gravity a little aside."""
    shape = {"type": "capsule", "radius": 0.01, "length": 0.08}
    turned = {"axis": [1, 0, 0], "angle": 90}
    at = {"type": "points", "position": [[0, -0.05 - 0.1 * k, 0] for k in range(20)]}
    link = {"name": "link", "shape": shape, "mass": 0.2, "orientation": turned, "layout": at}
    load = {"name": "load", "shape": {"type": "sphere", "radius": 0.1}, "mass": 30.0, "position": [0, -2, 0]}
    joints = [
        {"type": "ball", "on": "link", "pairs": [[k, k + 1] for k in range(19)]},
        {"type": "ball", "between": ["link", "world"], "anchor": [0, 0, 0]},
        {"type": "ball", "between": ["link", "load"], "pairs": [[19, 0]], "anchor": [0, -2, 0]},
    ]
    pull = [{"type": "gravity", "acceleration": [0.5, -G, 0.2]}]
    output = {"every": 1, "ledger": True}
    return table(steps * h, h, bodies=[link, load], joints=joints, forces=pull, output=output)


@pytest.mark.slow
def test_what_is_pulled_along_limits_the_step_as_it_swings_across(tmp_path: Path) -> None:
    # Links between others that swing against each other turn by θ about their middles, with T l θ²/2 and m l² ω² θ²/24.
    limit = math.sqrt(0.2 * 0.1 / (3 * 30.0 * G))
    ps.run(ps.from_table(pulled_chain(0.9 * limit, 400)), tmp_path / "chain.vtkhdf")
    found = energies(ps.open(tmp_path / "chain.vtkhdf"))
    assert found.max() - found[0] < 1e-6 * 30.0 * G * 2
    with pytest.raises(ps.DivergenceError, match=r"had gained|could not be held"):
        ps.run(ps.from_table(pulled_chain(1.3 * limit, 400)))
