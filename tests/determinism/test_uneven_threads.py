"""Threads that are behind others, as on busy machines, see what these have written for them and nothing later."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCENARIOS = Path(__file__).parents[2] / "scenarios"
PROGRAM = """
import sys
from particlesim.engine import barrier
barrier.UNEVEN = True
import particlesim as ps
from particlesim.compiler import quickly
bits = set()
with quickly(True):
    for threads in (1, 2):
        scenario = ps.load(sys.argv[1], {"checks": [], "simulation.duration": float(sys.argv[2])})
        final = ps.run(scenario, threads=threads).final
        bits.add(final.position.tobytes() + final.velocity.tobytes())
assert len(bits) == 1
"""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "duration"), [("balls_on_a_trampoline", 0.6)])
def test_threads_that_are_behind_change_no_bit(name: str, duration: float, tmp_path: Path) -> None:
    """One that came late to candidates of surfaces saw that they were stale, or no longer so, by what the first thread had
    done since: they then waited for each other at different barriers."""
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(SCENARIOS / f"{name}.toml"), str(duration)],
        env={"PSIM_CACHE_DIR": str(tmp_path), "PYTHONPATH": ":".join(filter(None, sys.path))},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert ended.returncode == 0, ended.stderr[-2000:]
