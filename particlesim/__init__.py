"""psim: particle simulations from declarative files.

import particlesim as ps

scenario = ps.load("scenarios/fountain.toml", overrides={"simulation.dt": 1e-3})
result = ps.run(scenario, output="fountain.vtkhdf")
result.final.position  # [m], shape [n, 3]
with ps.open("fountain.vtkhdf") as trajectory:
    frame = trajectory[-1]
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from particlesim.version import __version__

if TYPE_CHECKING:
    from particlesim.analysis.stability import stability
    from particlesim.errors import (
        DivergenceError,
        InputOutputError,
        Interrupted,
        PsimError,
        ScenarioError,
        UsageError,
    )
    from particlesim.render.film import film
    from particlesim.runs.runner import Progress, Result, run
    from particlesim.scenario.load import from_table, load, loads
    from particlesim.scenario.scenario import Scenario
    from particlesim.trajectory.frame import Frame
    from particlesim.trajectory.reader import Trajectory, open

# Names are imported when they are first used: reading a file needs nothing of what runs a scenario.
_HOME = {
    "DivergenceError": "particlesim.errors",
    "InputOutputError": "particlesim.errors",
    "Interrupted": "particlesim.errors",
    "PsimError": "particlesim.errors",
    "ScenarioError": "particlesim.errors",
    "UsageError": "particlesim.errors",
    "film": "particlesim.render.film",
    "Progress": "particlesim.runs.runner",
    "Result": "particlesim.runs.runner",
    "run": "particlesim.runs.runner",
    "from_table": "particlesim.scenario.load",
    "load": "particlesim.scenario.load",
    "loads": "particlesim.scenario.load",
    "Scenario": "particlesim.scenario.scenario",
    "Frame": "particlesim.trajectory.frame",
    "Trajectory": "particlesim.trajectory.reader",
    "open": "particlesim.trajectory.reader",
    "stability": "particlesim.analysis.stability",
}

__all__ = [
    "DivergenceError",
    "Frame",
    "InputOutputError",
    "Interrupted",
    "Progress",
    "PsimError",
    "Result",
    "Scenario",
    "ScenarioError",
    "Trajectory",
    "UsageError",
    "__version__",
    "film",
    "from_table",
    "load",
    "loads",
    "open",
    "run",
    "stability",
]


def __dir__() -> list[str]:
    return sorted(__all__)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'particlesim' has no attribute {name!r}")
    import gc
    import importlib

    # Imports make a hundred thousand objects that stay: looking through them again and again takes a fifth of the time.
    collecting = gc.isenabled()
    gc.disable()
    try:
        value = getattr(importlib.import_module(_HOME[name]), name)
    finally:
        if gc.get_freeze_count() == 0:  # all that there is becomes old, which spares two looks through it
            gc.freeze()
            gc.unfreeze()
        if collecting:
            gc.enable()
    globals()[name] = value
    return value
