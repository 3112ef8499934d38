"""The grid of time: which step, how many of them, and which of them are frames."""

from __future__ import annotations

import math
from dataclasses import dataclass

from particlesim.model.mistakes import Invalid
from particlesim.scenario.time_and_output import Output, SimulationSettings

FRAMES_BY_DEFAULT = 300
MOST_STEPS = 10**15
TOLERANCE = 1e-9
"""Relative difference up to which a ratio of times counts as a whole number."""


@dataclass(frozen=True)
class TimeGrid:
    """Step k begins at k · dt; frames are steps 0, every, 2 every ... and the last step."""

    dt: float
    steps: int
    every: int
    asked: float | None
    """The dt of the scenario when a shorter one is used, else None."""

    @property
    def frames(self) -> int:
        """Number of frames, with the one at the start."""
        return -(-self.steps // self.every) + 1

    @property
    def duration(self) -> float:
        """Time of the last step's end [s]."""
        return self.steps * self.dt

    def frame_steps(self, after: int = 0) -> range | list[int]:
        """Steps at which frames are taken, beyond step `after`."""
        inner = range((after // self.every + 1) * self.every, self.steps, self.every)
        return [*inner, self.steps] if after < self.steps else []


def time_grid(simulation: SimulationSettings, output: Output) -> TimeGrid | Invalid:
    """The grid of a scenario, or why there is none."""
    period = output.period()
    asked = simulation.dt
    if period is None:
        if asked is None:
            return Invalid(
                "substeps counts steps per frame, and no time between frames is given",
                at=("simulation", "substeps"),
                allowed="[output] fps = 30, or interval = 0.05",
            )
        dt, every = asked, output.every
    else:
        every = simulation.substeps or _whole_steps(period, asked or period)
        fits = asked is not None and math.isclose(every * asked, period, rel_tol=TOLERANCE)
        dt = asked if fits and asked is not None else period / every
    ratio = simulation.duration / dt
    if not ratio <= MOST_STEPS:
        return Invalid(f"{ratio:.3g} steps are too many", at=_step(simulation))
    steps = round(ratio)
    if steps < 1 or not math.isclose(steps * dt, simulation.duration, rel_tol=TOLERANCE):
        return _not_reached(simulation, output, dt, every, ratio)
    if every is None:
        every = max(1, math.ceil(steps / FRAMES_BY_DEFAULT))
    return TimeGrid(dt, steps, every, asked if asked is not None and dt != asked else None)


def _whole_steps(period: float, dt: float) -> int:
    """Steps per frame: as few as possible, none longer than dt."""
    ratio = min(period / dt, float(MOST_STEPS))
    nearest = max(round(ratio), 1)
    return nearest if math.isclose(ratio, nearest, rel_tol=TOLERANCE) else math.ceil(ratio)


def _step(simulation: SimulationSettings) -> tuple[str, str]:
    return ("simulation", "dt" if simulation.dt is not None else "substeps")


def _not_reached(
    simulation: SimulationSettings, output: Output, dt: float, every: int | None, ratio: float
) -> Invalid:
    """The duration is no whole number of steps: say which durations and steps would be."""
    below, above = max(math.floor(ratio), 1) * dt, math.ceil(ratio) * dt
    durations = f"{below:.10g}" if math.isclose(below, above) else f"{below:.10g} or {above:.10g}"
    also = [(_step(simulation), f"a step of {dt:.6g} s")]
    hint = f"a duration of {durations} s is reached"
    if output.period() is None:
        hint += f", or dt = {simulation.duration / math.ceil(ratio):.10g}"
    else:
        name = "fps" if output.fps is not None else "interval"
        also.append((("output", name), f"{every} steps in a frame of {output.period():.6g} s"))
        if (fitting := _fitting_steps(simulation.duration, output.period() or dt, every or 1)) is not None:
            hint += f", or substeps = {fitting} instead of dt"
    return Invalid(
        f"{simulation.duration:g} s are not a whole number of steps ({ratio:.6g})",
        at=("simulation", "duration"),
        also=tuple(also),
        hint=hint,
    )


def _fitting_steps(duration: float, period: float, least: int) -> int | None:
    """The fewest steps per frame, not fewer than `least`, that reach the duration; None if there are none near."""
    for every in range(least, min(4 * least, least + 900) + 100):
        ratio = duration * every / period
        if math.isclose(round(ratio) * period / every, duration, rel_tol=TOLERANCE):
            return every
    return None
