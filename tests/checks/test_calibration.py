"""The time of a run is known before it."""

from __future__ import annotations

import time

import particlesim as ps
from particlesim.preflight.run_time import estimated_seconds

SCENARIO = """
[simulation]
duration = 20.0
dt = 1e-4
[output]
every = 100000
[[particles]]
name = "balls"
layout = { type = "random", count = 300, shape = { type = "ball", radius = 1.0 } }
[[forces]]
type = "gravity"
"""


def test_the_estimate_is_of_the_right_size() -> None:
    """60 million particle-steps. Load of the machine may change by a factor of some, in either direction."""
    scenario = ps.loads(SCENARIO)
    ps.run(
        ps.loads(SCENARIO, {"simulation.duration": 1e-3}), threads=1
    )  # compile what the estimate leaves out
    estimate = estimated_seconds(scenario, threads=1, budget=0.05)
    assert estimate is not None
    began = time.perf_counter()
    ps.run(scenario, threads=1)
    took = time.perf_counter() - began
    assert took / 10 < estimate < 10 * took


def test_a_short_run_is_measured_as_a_whole() -> None:
    short = ps.loads(SCENARIO, {"simulation.duration": 1e-3})
    estimate = estimated_seconds(short, threads=1)
    assert estimate is not None
    assert 0 < estimate < 1


def test_what_does_not_tell() -> None:
    late = """
    [simulation]
    duration = 1000.0
    dt = 1e-6
    [[emitters]]
    name = "sparks"
    rate = 1
    start = 900
    shape = { type = "point", position = [0, 0, 0] }
    """
    assert estimated_seconds(ps.loads(late), budget=0.01) is None
    broken = SCENARIO + '[[forces]]\ntype = "field"\nforce = ["exp(1e6*(t + 1))", "0", "0"]\n'
    assert estimated_seconds(ps.loads(broken)) is None
