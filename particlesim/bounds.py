"""What a run will need, before it starts: particles, steps, memory and disk."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from particlesim.distributions import largest
from particlesim.emitters import Emitter, Schedule
from particlesim.errors import UsageError
from particlesim.groups import Particles
from particlesim.integrators import method_for
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.timegrid import TimeGrid
from particlesim.trajectory.fields import select_fields

Floats = NDArray[np.float64]

BASE_MEMORY = 250 << 20
"""Python, its libraries and the compiler [bytes]."""
GZIP_RATIO = 0.75
"""Size of compressed single-precision columns over their plain size; measured between 0.6 and 0.8."""
FRAME_BYTES = 500
"""Bookkeeping of a frame in a trajectory."""
EVENT_BYTES = 17
"""A birth or a death in a trajectory: id, time, cause."""
BIRTH_MEMORY = 250
"""What a particle takes while it is born: the random numbers of its attributes, and what is made of them."""


@dataclass(frozen=True)
class Needs:
    """Most particles alive at once, births, steps, frames, particle-steps at most, and bytes of memory and disk."""

    particles: int
    births: int
    steps: int
    frames: int
    particle_steps: float
    memory: int
    disk: int


def needs(scenario: Scenario) -> Needs:
    """An upper estimate of what a run needs. Raises UsageError when a file of particles cannot be read."""
    grid = scenario.grid
    times = np.linspace(0, grid.duration, min(grid.frames, 500))
    alive, stepped = np.zeros(len(times)), np.zeros(len(times))
    births = 0
    memory = BASE_MEMORY
    number = 8 if scenario.simulation.precision == "double" else 4
    fields = select_fields(scenario.recorded_fields())
    stored = sum(f.components * f.dtype(scenario.output.precision).itemsize for f in fields)
    for group in scenario.groups:
        if isinstance(group, Particles):
            here = np.full(len(times), float(scenario.opened(group).number() or 0))
            held = here
            per_particle = 8 * number + 8
        else:
            assert isinstance(group, Emitter)
            schedule = Schedule(group, scenario.streams(group))
            here = _alive(group, schedule, times)
            born = _born_between_frames(group, schedule, times, grid)
            held = here + born
            per_particle = 8 * number + 8 + 26
            memory += int(born.max() * BIRTH_MEMORY)
            births += schedule.total(grid.duration)
        remembered = method_for(group.integrator or scenario.simulation.integrator).memory
        memory += int(
            held.max() * (per_particle + remembered * number) * (1.5 if group in scenario.emitters else 1)
        )
        alive += here
        stepped += held
    ratio = GZIP_RATIO if scenario.output.compression == "gzip" else 1.0
    disk = int(grid.frames * (alive.mean() * stored * ratio + FRAME_BYTES) + 65536)
    disk += 2 * EVENT_BYTES * births
    memory += int(min(3, grid.frames) * alive.max() * stored)
    particle_steps = float(stepped.mean() * grid.steps)
    return Needs(int(alive.max()), births, grid.steps, grid.frames, particle_steps, memory, disk)


def _alive(emitter: Emitter, schedule: Schedule, times: Floats) -> Floats:
    """Most particles of an emitter alive at some times."""
    longest = largest(emitter.lifetime) if emitter.lifetime is not None else np.inf
    born = np.array([schedule.before(float(t)) for t in times], dtype=float)
    if np.isfinite(longest):
        born -= np.array([schedule.before(float(t - longest)) for t in times], dtype=float)
    return born if emitter.limit is None else np.minimum(born, emitter.limit)


def _born_between_frames(emitter: Emitter, schedule: Schedule, times: Floats, grid: TimeGrid) -> Floats:
    """Births in the interval that begins at each of some times: the dead of an interval leave at its end, so that all of
    them are in memory together. A burst counts at the sampled time before it."""
    if emitter.when_full == "wait":
        return np.zeros(len(times))
    interval = grid.every * grid.dt
    born = np.array([schedule.before(float(t + interval)) - schedule.before(float(t)) for t in times])
    for burst in emitter.bursts():
        k = int(np.searchsorted(times, burst.at, side="right")) - 1
        if burst.at >= times[k] + interval:
            born[k] += burst.count
    return born.astype(float)


def available_memory() -> int | None:
    """Bytes of memory that a process can still take, None where the system does not tell."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return min(int(line.split()[1]) * 1024, _cgroup_limit())
    except (OSError, ValueError, IndexError):
        pass
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return None


def _cgroup_limit() -> int:
    """Bytes that a container may use, beyond what it uses; very many without a limit."""
    try:
        limit = Path("/sys/fs/cgroup/memory.max").read_text().strip()
        used = int(Path("/sys/fs/cgroup/memory.current").read_text())
        return 1 << 62 if limit == "max" else max(int(limit) - used, 0)
    except (OSError, ValueError):
        return 1 << 62


def check_fits(required: Needs, output: Path | None) -> None:
    """Refuse a run that cannot fit. Raises UsageError with what is needed and what there is."""
    memory = available_memory()
    if memory is not None and required.memory > memory:
        hint = 'fewer particles, a limit on emitters, or precision = "single" need less'
        if required.births > 2 * required.particles:
            hint = "a lower rate needs less, and so do more frames: all births between two frames are in memory together"
        raise UsageError(
            f"the run needs about {size(required.memory)} of memory for {required.particles:,} particles"
            + (f" at once and {required.births:,} births" if required.births else "")
            + f", and {size(memory)} are free",
            hint,
        )
    if output is not None:
        folder = output.resolve().parent
        while not folder.exists():
            folder = folder.parent
        free = shutil.disk_usage(folder).free
        if required.disk > free:
            raise UsageError(
                f"the trajectory needs about {size(required.disk)} on disk for {required.frames:,} frames, "
                f"and {size(free)} are free in {folder}",
                "fewer frames (output.fps), fewer fields (output.fields) or compression need less",
            )


def size(count: float) -> str:
    """Bytes in words: '3.2 GB'."""
    for unit in ("B", "kB", "MB", "GB", "TB", "PB"):
        if count < 1000 or unit == "PB":
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000
    raise AssertionError
