"""Sweeps: parameter sets → runs, by workers on this machine."""

from particlesim.sweep.axes import Listed, Sampled, parse_axis
from particlesim.sweep.design import Design
from particlesim.sweep.executor import Executor, InProcess, LocalWorkers
from particlesim.sweep.outcome import Outcome
from particlesim.sweep.sweep import Sweep, SweepProgress, SweepResult

__all__ = [
    "Design",
    "Executor",
    "InProcess",
    "Listed",
    "LocalWorkers",
    "Outcome",
    "Sampled",
    "Sweep",
    "SweepProgress",
    "SweepResult",
    "parse_axis",
]
