"""How long a run will take, from a fraction of a second of it."""

from __future__ import annotations

import time

from particlesim.engine.simulation import Simulation
from particlesim.errors import DivergenceError
from particlesim.preflight.advice import direct_seconds
from particlesim.preflight.resources import needs
from particlesim.process.threads import available_cores
from particlesim.scenario.scenario import Scenario

BUDGET = 0.3
"""Seconds of stepping that are measured; kernels that have to be compiled come on top."""

LONG_STEP = 1.0
"""Seconds of sums of pairs one by one in a step beyond which no step is tried."""

MOST_EMPTY_STEPS = 1 << 16
"""Steps without particles after which a scenario is taken not to tell."""


def estimated_seconds(
    scenario: Scenario, *, threads: int | None = None, budget: float = BUDGET
) -> float | None:
    """Seconds that the steps of a run take, without the writing of frames; None where its beginning does not tell.

    Nothing is written. The first step, in which kernels are compiled or loaded, does not count; then pieces of twice as many
    steps are measured until the budget is spent, and the speed of the last, in particle-steps, is taken for all. A scenario
    that begins without particles does not tell, nor does one that diverges at once. Sums of pairs one by one that take long
    are not tried: their number tells.
    """
    if (step := direct_seconds(scenario)) > LONG_STEP:
        return step * scenario.grid.steps / (threads or available_cores())
    simulation = Simulation(scenario, threads=threads)
    steps, piece = scenario.grid.steps, 1
    spent = speed = 0.0
    try:
        simulation.advance_to(1)
        while simulation.step < steps and spent < budget:
            before, began = simulation.particle_steps, time.perf_counter()
            simulation.advance_to(min(simulation.step + piece, steps))
            simulation.take_events()
            took = time.perf_counter() - began
            spent += took
            speed = (simulation.particle_steps - before) / took if took > 0 else speed
            piece *= 2
            if not speed and piece > MOST_EMPTY_STEPS:
                return None
    except DivergenceError:
        return None
    finally:
        simulation.close()
    if simulation.step >= steps:
        return spent
    return needs(scenario).particle_steps / speed if speed > 0 else None
