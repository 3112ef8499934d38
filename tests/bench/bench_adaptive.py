"""Adaptive methods through `Simulation`, against SciPy, and REBOUND where it is installed.

    python tests/bench/bench_adaptive.py [--threads 2] [--rounds 3]

1. A Kepler orbit of eccentricity 0.9, 100 periods: `dop853` at the energy error of SciPy's DOP853 (rtol 10⁻¹², atol 10⁻¹⁴)
   or less; and `ias15`, about a fixed centre and with both bodies free, against REBOUND's.
2. Ten thousand particles on orbits of all eccentricities up to 0.9, one period, `rk45` with steps of their own, against
   `solve_ivp(RK45)` of the same system at equal tolerance.

Contenders run in turn, several rounds; the best of each is compared. Errors are against the closed form.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import particlesim as ps
from particlesim.engine.simulation import Simulation

Floats = NDArray[np.float64]
ORBITS, ECCENTRICITY, PERIOD = 100, 0.9, 2 * math.pi
PERIHELION, SPEED = 1 - ECCENTRICITY, math.sqrt((1 + ECCENTRICITY) / (1 - ECCENTRICITY))
CROWD, TOLERANCE = 10_000, 1e-6


def scenario(duration: float, integrator: dict[str, Any], layout: dict[str, Any], **more: Any) -> ps.Scenario:
    """Particles about μ = 1 m³/s², in one frame; or with `more` tables in place of that force."""
    return ps.from_table(
        {
            "simulation": {"duration": duration, "dt": duration, "integrator": integrator},
            "output": {"every": 1, "ledger": False},
            "particles": [{"layout": layout} | more.pop("each", {})],
        }
        | (more or {"forces": [{"type": "attractor", "strength": 1.0}]})
    )


def timed(scenario: ps.Scenario, threads: int) -> tuple[float, Floats]:
    """Seconds to the end of the only frame (of the processor, with one thread), and final position and velocity [n, 6]."""
    clock = time.process_time if threads == 1 else time.perf_counter
    simulation = Simulation(scenario, threads=threads)
    begin = clock()
    simulation.advance_to(1)
    took = clock() - begin
    (state,) = simulation.states
    found = np.hstack([state.position, state.velocity])
    simulation.close()
    return took, found


def best(rounds: int, *contenders: Callable[[], tuple[float, Any]]) -> list[tuple[float, Any]]:
    """The fastest of some rounds of each, in turn."""
    runs = [[contender() for contender in contenders] for _ in range(rounds)]
    return [min((run[k] for run in runs), key=lambda found: found[0]) for k in range(len(contenders))]


def orbit_errors(y: Floats) -> str:
    """Relative error of the energy, and distance from the perihelion."""
    energy = abs(y[3:] @ y[3:] - 2 / np.linalg.norm(y[:3]) + 1)
    return f"energy {energy:.1e}, place {np.linalg.norm(y[:3] - (PERIHELION, 0, 0)):.1e} m"


def scipy_orbit() -> tuple[float, Floats]:
    """As in the usual benchmark: the plane problem, so that SciPy has no third component to carry."""

    def rhs(t: float, s: Floats) -> tuple[float, float, float, float]:
        r3 = (s[0] * s[0] + s[1] * s[1]) ** -1.5
        return s[2], s[3], -s[0] * r3, -s[1] * r3

    begin = time.process_time()
    y = solve_ivp(
        rhs, (0, ORBITS * PERIOD), (PERIHELION, 0, 0, SPEED), method="DOP853", rtol=1e-12, atol=1e-14
    ).y[:, -1]
    return time.process_time() - begin, np.array([y[0], y[1], 0, y[2], y[3], 0])


def rebound_orbit() -> tuple[float, Floats]:
    """IAS15 with its own settings."""
    import rebound

    sim = rebound.Simulation()
    sim.add(m=1.0)
    sim.add(m=0.0, x=PERIHELION, vy=SPEED)
    sim.integrator, sim.dt = "ias15", 1e-3
    begin = time.process_time()
    sim.integrate(ORBITS * PERIOD)
    took = time.process_time() - begin
    q, c = sim.particles[1], sim.particles[0]
    return took, np.array([q.x - c.x, q.y - c.y, q.z - c.z, q.vx - c.vx, q.vy - c.vy, q.vz - c.vz])


def orbits(rounds: int) -> None:
    """The first comparison."""
    layout = {"type": "points", "position": [[PERIHELION, 0, 0]], "velocity": [[0, SPEED, 0]]}
    print(f"Kepler, e = {ECCENTRICITY}, {ORBITS} periods")
    for tolerance in (1e-12, 1e-13):
        ours = scenario(ORBITS * PERIOD, {"method": "dop853", "tolerance": tolerance}, layout)
        timed(ours, 1)  # compiles
        (took, end), (theirs, reference) = best(rounds, lambda case=ours: timed(case, 1), scipy_orbit)
        print(f"  psim dop853, {tolerance:g}  {took * 1e3:9.2f} ms  {orbit_errors(end[0])}")
        print(
            f"  SciPy DOP853         {theirs * 1e3:9.2f} ms  {orbit_errors(reference)}   ratio {theirs / took:.0f}"
        )
    radau(rounds, layout)


def radau(rounds: int, layout: dict[str, Any]) -> None:
    """`ias15` of one body about a fixed centre, and of two that are free, and REBOUND's where it is installed."""
    bodies = {
        "type": "points",
        "position": [[0, 0, 0], *layout["position"]],
        "velocity": [[0, 0, 0], *layout["velocity"]],
    }
    method, gravity = {"method": "ias15"}, [{"type": "gravity", "constant": 1.0}]
    fixed = scenario(ORBITS * PERIOD, method, layout)
    free = scenario(ORBITS * PERIOD, method, bodies, each={"mass": [1.0, 1e-30]}, interactions=gravity)
    contenders = [lambda: timed(fixed, 1), lambda: timed(free, 1)]
    best(1, *contenders)  # compiles
    if importlib.util.find_spec("rebound"):
        contenders.append(rebound_orbit)
    found = best(max(rounds, 9), *contenders)
    names = ("psim ias15, fixed", "psim ias15, free", "REBOUND IAS15")
    for name, (took, end) in zip(names, found, strict=False):
        y = end if end.ndim == 1 else end[-1] - (end[0] if len(end) > 1 else 0)
        ratio = f"   of REBOUND's time: {took / found[-1][0]:.2f}" if len(found) > 2 else ""
        print(f"  {name:<20} {took * 1e3:9.2f} ms  {orbit_errors(y)}{ratio}")


def crowd(rounds: int, threads: int) -> None:
    """The second comparison."""
    speed = {"type": "uniform", "low": math.sqrt(0.1), "high": math.sqrt(1.9)}  # e up to 0.9 on both sides
    layout = {
        "type": "random",
        "count": CROWD,
        "shape": {"type": "point", "position": [1, 0, 0]},
        "velocity": [0, speed, 0],
    }
    ours = scenario(PERIOD, {"method": "rk45", "tolerance": TOLERANCE}, layout)
    simulation = Simulation(ours, threads=1)
    (state,) = simulation.states
    start = np.concatenate([state.position.T.ravel(), state.velocity.T.ravel()])
    simulation.close()

    def rhs(t: float, y: Floats) -> Floats:
        x = y[: 3 * CROWD].reshape(3, CROWD)
        square = (x * x).sum(axis=0)
        return np.concatenate([y[3 * CROWD :], (x * (-1 / (square * np.sqrt(square)))).ravel()])

    def scipy_crowd() -> tuple[float, Floats]:
        begin = time.perf_counter()
        end = solve_ivp(rhs, (0, PERIOD), start, method="RK45", rtol=TOLERANCE, atol=TOLERANCE).y[:, -1]
        return time.perf_counter() - begin, end.reshape(6, CROWD).T

    exact = timed(scenario(PERIOD, {"method": "dop853", "tolerance": 1e-13}, layout), threads)[1]
    timed(ours, threads)  # compiles
    (took, end), (theirs, reference) = best(rounds, lambda: timed(ours, threads), scipy_crowd)
    print(f"{CROWD} orbits of their own, one period, tolerance {TOLERANCE:g}, {threads} threads")
    for name, seconds, found in (("psim rk45", took, end), ("SciPy RK45", theirs, reference)):
        miss = np.linalg.norm(found[:, :3] - exact[:, :3], axis=1)
        print(
            f"  {name:<12} {seconds * 1e3:9.1f} ms  worst {miss.max():.1e} m, median {np.median(miss):.1e} m"
        )
    print(f"  ratio {theirs / took:.0f}")


def main() -> None:
    """Print both comparisons."""
    parser = argparse.ArgumentParser(description="Adaptive methods against SciPy and REBOUND.")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    orbits(given.rounds)
    crowd(given.rounds, given.threads)


if __name__ == "__main__":
    main()
