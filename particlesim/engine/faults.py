"""Why steps could not go on: what an island reports, and `engine/diagnosis/` explains."""

from __future__ import annotations

from dataclasses import dataclass

from particlesim.laws.registry import Particle


@dataclass(frozen=True)
class Fault:
    """Where a number stopped being finite: the group's position in the island, the row, and the step that did it.

    The state is that of the step's beginning. Adaptive methods also tell where inside the step they could not go on,
    implicit ones that they found no solution.
    """

    member: int
    row: int
    step: int
    stop: Stop | None = None
    unsolved: Unsolved | None = None
    unheld: Unheld | None = None
    unclosed: Unclosed | None = None


@dataclass(frozen=True)
class Unsolved:
    """Equations of a step that were not solved: the method, the relative residual, Newton and linear iterations."""

    method: str
    residual: float
    iterations: int
    linear: int = 0


@dataclass(frozen=True)
class Unheld:
    """A rod that could not be held: its set, indices and groups of both ends, its length [m], and by which part of that it
    is too long or too short."""

    name: str
    particles: tuple[int, int]
    groups: tuple[str, str]
    length: float
    misfit: float


@dataclass(frozen=True)
class Unclosed:
    """A joint of rigid bodies that could not be held: its name."""

    name: str


@dataclass(frozen=True)
class Stop:
    """Where a particle was when its own steps could not go on.

    Why (a code of `engine/step/step_size.py`), when [s], the particle, and the shortest step that was allowed [s].
    """

    why: int
    time: float
    particle: Particle
    least: float
