"""What a run will need, before it starts: particles, steps, memory and disk."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from particlesim.bodies import Bodies
from particlesim.bonds.base import Ties
from particlesim.emitters import Emitter, Schedule
from particlesim.errors import ResourceError
from particlesim.graph.graph import methods_of
from particlesim.groups.group import Group, Particles
from particlesim.integrators import Method, RungeKutta
from particlesim.memory import available_memory
from particlesim.model.arrays import Floats
from particlesim.model.attributes import ATTRIBUTES
from particlesim.sampling.distributions import largest
from particlesim.scenario.reach import mortal, ties
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.timegrid import TimeGrid
from particlesim.trajectory.chunks import chunk_rows, padded
from particlesim.trajectory.fields import FIELDS, select_fields
from particlesim.trajectory.layout import EVENT, TABLE_ROWS, TOPOLOGY_ROWS

ANYWAY = "if you know better, --yes (must_fit=False) runs it anyway"
BASE_MEMORY = 192 << 20
"""Python, its libraries and compiled kernels from the cache [bytes]; measured. Compiling takes some 80 MB more."""
FILE_BYTES = 60_000
"""An empty trajectory [bytes]: the scenario, where it comes from, and HDF5's own tables."""
ROW_BYTES = 88
"""Bookkeeping of a frame in a trajectory [bytes], beside its ledger."""
CHUNK_BYTES = 24
"""HDF5's index of a chunk [bytes]."""
EVENT_BYTES = EVENT.itemsize
"""A birth or a death."""
TOPOLOGY_RATIO = 0.003
"""Size of the table of vertices, 0, 1, 2, ..., over its plain size; measured."""
GZIP = {"float": 0.93, "integer": 0.2}
"""Size of compressed columns over their plain size, at most: that of random numbers, of ascending ones; measured."""
BODY_BYTES = 17_000
"""Memory of a rigid body beside that of a particle: room for 16 contacts of 592 bytes, up to 64 places of 48 bytes for what
is remembered of them, twice, and the solver's scratch; counted from the sizes of these arrays."""
BODY_SAVED = 64 * 48 + 64
"""What a checkpoint keeps of a rigid body: impulses of contacts, orientation, angular momentum."""
CLOCK_BYTES = 26
"""Birth, start and stop of a particle that may be born or pinned, and what became of it."""
IN_SPACE_BYTES, IN_SPACE_NUMBERS = 48, 9
"""Bytes, and numbers, of a particle that is stepped in another order, beside its state: rows and places of the island and in
lists; its spin, and what laws know of it by rows."""
LEDGER_COLUMNS = 8
"""Motion and a potential."""
POOL = 1.125
"""Memory of a frame's buffers over their content: they are a little larger than asked."""
BIRTH_MEMORY = 250
"""What a particle takes while it is born: the random numbers of its attributes, and what is made of them."""


@dataclass(frozen=True)
class Needs:
    """Most particles alive at once, births, steps, frames, particle-steps at most, and bytes of memory and disk.

    `disk` is an upper bound if the trajectory is `compressed`, as the size then depends on what the numbers will be.
    """

    particles: int
    births: int
    steps: int
    frames: int
    particle_steps: float
    memory: int
    disk: int
    compressed: bool


def needs(scenario: Scenario, *, recorded: bool = True) -> Needs:
    """What a run needs, with a trajectory unless it is not `recorded`.

    Raises UsageError when a file of particles cannot be read.
    """
    grid = scenario.grid
    times = np.linspace(0, grid.duration, min(grid.frames, 500))
    alive, stepped = np.zeros(len(times)), np.zeros(len(times))
    births = deaths = 0
    memory = float(BASE_MEMORY)
    checkpoint = 0.0
    numbers: dict[str, float] = {}
    methods = methods_of(scenario)
    for group in scenario.groups:
        if isinstance(group, Particles):
            here = held = np.full(len(times), float(scenario.opened(group).number() or 0))
        else:
            assert isinstance(group, Emitter)
            schedule = Schedule(group, scenario.streams(group))
            here = _alive(group, schedule, times)
            born = _born_between_frames(group, schedule, times, grid)
            held = here + born
            memory += born.max() * BIRTH_MEMORY
            total = schedule.total(grid.duration)
            births, deaths = births + total, deaths + max(total - int(here[-1]), 0)
        memory += held.max() * _particle_bytes(scenario, group, methods[group.name])
        numbers[group.name] = float(held.max())
        checkpoint += here.max() * _saved_bytes(scenario, group, methods[group.name])
        alive += here
        stepped += held
    most = int(alive.max())
    memory += sum(each.memory(_width(scenario), mortal=_mortal(scenario, each)) for each in ties(scenario))
    memory += _pair_bytes(scenario, numbers)
    if recorded:
        # At the end a column at a time is made for the digest, while the last checkpoint may still be on its way.
        memory += 2 * POOL * most * sum(_stored(scenario).values()) + checkpoint + 3 * _width(scenario) * most
    disk = _file_size(scenario, alive, births + deaths)
    work = float(stepped.mean() * grid.steps)
    compressed = scenario.output.compression == "gzip"
    return Needs(most, births, grid.steps, grid.frames, work, int(memory), int(disk), compressed)


def _width(scenario: Scenario) -> int:
    """Bytes of a number."""
    return 8 if scenario.simulation.precision == "double" else 4


def _particle_bytes(scenario: Scenario, group: Group, method: Method) -> float:
    """Memory of a particle of a group while it is stepped."""
    number = _width(scenario)
    size: float = 7 * number + 8  # position, velocity, mass; id
    size += _attribute_bytes(group, number)
    size += method.memory * number
    if isinstance(group, Emitter):
        return 1.5 * (size + CLOCK_BYTES)  # room to grow
    assert isinstance(group, Particles)
    if isinstance(group, Bodies):
        return 2 * size + BODY_BYTES
    if group.pinned:
        size += CLOCK_BYTES
    if any(group.name in each.groups for each in ties(scenario)):
        stages = method.evaluations if isinstance(method, RungeKutta) else 0
        size = 2 * size + 9 * number + 6 * number * stages  # placed, then joined; forces and slopes
    return size


def _pair_bytes(scenario: Scenario, numbers: Mapping[str, float]) -> float:
    """Memory of interactions of pairs, and of the copies in which particles in their lists are stepped."""
    if not scenario.interactions:
        return 0.0
    from particlesim.preflight.pair_memory import in_lists, pair_bytes  # and all kernels of pairs

    listed = in_lists(scenario, numbers)
    return pair_bytes(scenario, numbers, _width(scenario)) + _in_space_bytes(scenario, numbers, listed)


def _in_space_bytes(scenario: Scenario, numbers: Mapping[str, float], listed: frozenset[str]) -> float:
    """Memory of the copies in which many particles in lists are stepped, in an order of neighbours in space."""
    if not listed:
        return 0.0
    from particlesim.engine.islands.in_space import WORTH_PARTICLES, WORTH_STEPS  # and its kernels

    if scenario.grid.every < WORTH_STEPS or sum(numbers[name] for name in listed) < WORTH_PARTICLES:
        return 0.0
    beside = IN_SPACE_BYTES + IN_SPACE_NUMBERS * _width(scenario)
    groups = (group for group in scenario.groups if group.name in listed)
    methods = methods_of(scenario)
    return sum(
        numbers[group.name] * (_saved_bytes(scenario, group, methods[group.name]) + beside)
        for group in groups
    )


def _saved_bytes(scenario: Scenario, group: Group, method: Method) -> float:
    """Memory of a particle of a group in a checkpoint, which is a copy of the state until it is written."""
    number = _width(scenario)
    clocked = isinstance(group, Emitter) or (isinstance(group, Particles) and bool(group.pinned))
    size = (7 + method.memory) * number + 8  # position, velocity, mass; id
    size += number * (not group.has("radius"))  # stored in any case
    if isinstance(group, Bodies):
        size += BODY_SAVED
    return size + CLOCK_BYTES * bool(clocked) + _attribute_bytes(group, number)


def _attribute_bytes(group: Group, number: int) -> float:
    """Bytes of the attributes of a particle beside its mass; temperatures are in double precision in any case."""
    mine = (name for name in ATTRIBUTES if name != "mass" and group.has(name))
    return sum(8 if name == "temperature" else number for name in mine)


def _mortal(scenario: Scenario, each: Ties) -> bool:
    """Whether particles that something joins may die."""
    return any(mortal(scenario, name) for name in each.groups)


def _stored(scenario: Scenario) -> dict[str, int]:
    """Bytes of a particle in a frame, by field."""
    fields = select_fields(scenario.recorded_fields())
    return {f.name: f.components * f.dtype(scenario.output.precision).itemsize for f in fields}


def _file_size(scenario: Scenario, alive: Floats, events: int) -> float:
    """Size of the trajectory; frames fill whole chunks, and tables whole blocks of rows."""
    frames, stored = scenario.grid.frames, _stored(scenario)
    most = max(int(alive.max()), 1)
    rows = chunk_rows(most)
    chunks = np.ceil(alive / rows)
    if scenario.output.compression == "gzip":
        data = alive.mean() * sum(size * GZIP[FIELDS[name].kind] for name, size in stored.items())
    else:
        data = chunks.mean() * rows * sum(stored.values())
    index = chunks.mean() * CHUNK_BYTES * len(stored)
    ledger = 8 * LEDGER_COLUMNS * scenario.output.ledger
    tables = padded(frames, TABLE_ROWS) * (ROW_BYTES + ledger)
    topology = 2 * 8 * padded(2 * most, TOPOLOGY_ROWS) * TOPOLOGY_RATIO
    springs = sum(each.stored(mortal=_mortal(scenario, each)) for each in ties(scenario))
    return float(FILE_BYTES + frames * (data + index) + tables + topology + springs + events * EVENT_BYTES)


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


def check_fits(required: Needs, output: Path | None) -> None:
    """Refuse a run that cannot fit. Raises ResourceError with what is needed and what there is."""
    memory = available_memory()
    if memory is not None and required.memory > memory:
        hint = 'fewer particles, a limit on emitters, or precision = "single" need less'
        if required.births > 2 * required.particles:
            hint = "a lower rate needs less, and so do more frames: all births between two frames are in memory together"
        raise ResourceError(
            f"the run needs about {size(required.memory)} of memory for {required.particles:,} particles"
            + (f" at once and {required.births:,} births" if required.births else "")
            + f", and {size(memory)} are free",
            f"{hint}; {ANYWAY}",
        )
    if output is not None:
        folder = output.resolve().parent
        while not folder.exists():
            folder = folder.parent
        free = shutil.disk_usage(folder).free
        if required.disk > free:
            bound = "up to" if required.compressed else "about"
            raise ResourceError(
                f"the trajectory needs {bound} {size(required.disk)} on disk for {required.frames:,} frames, "
                f"and {size(free)} are free in {folder}",
                f"fewer frames (output.fps), fewer fields (output.fields) or compression need less; {ANYWAY}",
            )


def size(count: float) -> str:
    """Bytes in words: '3.2 GB'."""
    if count < 1000:
        return f"{count:.0f} B"
    for unit in ("kB", "MB", "GB", "TB", "PB", "EB"):
        count /= 1000
        if count < 1000:
            return f"{count:.1f} {unit}"
    return f"{count:.3g} EB"
