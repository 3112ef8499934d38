"""Scenarios of many kinds, stopping them, and comparing files."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import particlesim as ps

Table = dict[str, Any]

FOUNTAIN: Table = {
    "simulation": {"duration": 2.0, "dt": 0.01, "seed": 3},
    "output": {"every": 7},
    "emitters": [
        {
            "name": "drops",
            "rate": 300,
            "timing": "jittered",
            "shape": {"type": "disc", "center": [0, 0.1, 0], "radius": 0.1, "normal": [0, 1, 0]},
            "direction": [0, 1, 0],
            "spread": 15,
            "speed": {"type": "normal", "mean": 4, "std": 0.5},
            "lifetime": {"type": "uniform", "low": 0.3, "high": 1.2},
            "mass": 0.01,
            "radius": 0.01,
            "temperature": 400,
            "charge": {"type": "normal", "mean": 0, "std": 1e-6},
            "cooling": {"rate": 0.5, "ambient": 300},
            "limit": 120,
        },
        {
            "name": "waiting",
            "rate": 100,
            "shape": {"type": "point", "position": [1, 1, 0]},
            "direction": [1, 0, 0],
            "speed": 1.0,
            "lifetime": 0.5,
            "mass": 0.01,
            "limit": 20,
            "when_full": "wait",
        },
    ],
    "forces": [{"type": "gravity"}],
    "planes": [{"normal": [0, 1, 0], "restitution": 0.6}],
    "impulses": [{"on": ["drops"], "impulse": [0.01, 0, 0], "at": 1.0}],
    "checks": [
        {"quantity": "count", "max": 100000},
        {"quantity": "position.y", "statistic": "max", "max": 0.5},
    ],
}

CLOTH: Table = {
    "simulation": {"duration": 0.6, "dt": 0.001, "integrator": "rk4"},
    "output": {"every": 30, "precision": "double"},
    "particles": [
        {
            "name": "flag",
            "layout": {
                "type": "cloth",
                "size": [1.0, 1.0],
                "resolution": [12, 10],
                "pinned": "top",
            },
            "mass": 0.5,
            "springs": {"structural": 40.0, "shear": 10.0, "damping": 0.01, "break_strain": 0.05},
        }
    ],
    "forces": [{"type": "gravity"}],
}

MEMORY: Table = {
    "simulation": {"duration": 1.0, "dt": 0.005, "integrator": "stormer_verlet"},
    "output": {"every": 10, "compression": "none"},
    "particles": [
        {
            "name": "dust",
            "layout": {
                "type": "random",
                "count": 300,
                "shape": {"type": "box", "min": [0, 0, 0], "max": [1, 1, 1]},
            },
            "mass": 0.1,
        }
    ],
    "forces": [{"type": "gravity"}, {"type": "point_spring", "anchor": [0, 2, 0], "stiffness": 2.0}],
    "planes": [{"normal": [0, 1, 0], "contact": "kill"}],
}

ADAPTIVE: Table = {
    **MEMORY,
    "simulation": {"duration": 1.0, "dt": 0.05, "integrator": {"method": "rk45", "tolerance": 1e-6}},
    "output": {"every": 1},
}

IMPLICIT: Table = {
    "simulation": {"duration": 0.3, "dt": 0.01, "integrator": "backward_euler"},
    "output": {"every": 2, "precision": "double"},
    "particles": [
        {
            "name": "flag",
            "layout": {
                "type": "cloth",
                "size": [1, 1],
                "resolution": [8, 8],
                "pinned": "top",
                "up": [0, 0, 1],
            },
            "mass": 0.5,
            "springs": {"structural": 400.0, "shear": 100.0, "damping": 0.01},
        }
    ],
    "forces": [{"type": "gravity"}],
}

RODS: Table = {
    "simulation": {"duration": 1.2, "dt": 0.005, "integrator": "velocity_verlet"},
    "output": {"every": 10, "precision": "double", "work": True},
    "particles": [
        {
            "name": "frame",
            "layout": {
                "type": "points",
                "position": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0.4, 1.5, 0.3], [1.8, 0.2, 0.5]],
            },
            "mass": 0.5,
            "pinned": [0],
        }
    ],
    # A triangle that hangs on a led pin, and a pendulum on each of its other corners.
    "rods": [{"on": "frame", "pairs": [[0, 1], [1, 2], [0, 2], [2, 3], [1, 4]]}],
    "forces": [{"type": "gravity"}],
    "motions": [{"on": "frame", "path": ["x + 0.2*(1 - cos(5*t))", "y", "z"]}],
    "impulses": [{"impulse": [0.2, 0.1, 0.3], "at": 0.42}],
}

PAIRS: Table = {
    "simulation": {"duration": 0.5, "dt": 0.005, "integrator": "velocity_verlet", "seed": 4},
    "output": {"every": 7, "work": True},
    "particles": [
        {
            "name": "cloud",
            "mass": 0.02,
            "layout": {"type": "random", "count": 50, "shape": {"type": "ball", "radius": 1}},
        },
        {"name": "star", "layout": {"type": "points", "position": [[3, 0, 0]]}, "mass": 1.0},
    ],
    "interactions": [
        {"type": "gravity", "constant": 1.0, "softening": 0.05},
        {"type": "soft_sphere", "epsilon": 0.05, "sigma": 0.4, "method": "neighbours"},
    ],
}

BODIES: Table = {
    "simulation": {"duration": 0.8, "dt": 0.002, "seed": 4},
    "output": {"every": 20, "work": True},
    "particles": [  # on a spring that breaks on its way up
        {
            "name": "bead",
            "mass": 2.0,
            "layout": {"type": "points", "position": [[0.2, 2.2, 0.2]], "velocity": [[0, 5, 1]]},
        },
    ],
    "springs": [
        {
            "between": ["bead", "ball"],
            "pairs": [[0, 0]],
            "points": [[0, 0, 0], [0, 0.1, 0.1]],
            "stiffness": 400.0,
            "damping": 2.0,
            "break_force": 100.0,
        },
    ],
    "bodies": [
        {
            "name": "bricks",
            "shape": {"type": "box", "size": [0.1, 0.2, 0.4]},
            "orientation": "random",
            "layout": {"type": "lattice", "spacing": 0.4, "counts": [2, 3, 2], "origin": [0, 0.3, 0]},
        },
        {"name": "ball", "shape": {"type": "sphere", "radius": 0.2}, "position": [0.2, 1.8, 0.2]},
    ],
    "forces": [{"type": "gravity"}],
    "planes": [{"normal": [0, 1, 0], "restitution": 0.3, "friction": 0.5}],
}

GRAINS: Table = {
    "simulation": {"duration": 0.4, "dt": 0.001, "seed": 2},
    "output": {"every": 20, "precision": "double"},
    "emitters": [
        {
            "name": "grains",
            "radius": 0.01,
            "mass": 0.01,
            "shape": {"type": "box", "min": [0, 0.01, 0], "max": [0.1, 0.11, 0.1]},
            "burst": {"count": 90, "at": 0},
            "lifetime": {"type": "uniform", "low": 0.05, "high": 0.8},
        }
    ],
    "forces": [{"type": "gravity"}],
    "planes": [{"friction": 0.4}],
    "interactions": [
        {"type": "contact", "model": "linear", "stiffness": 100.0, "friction": 0.4, "rolling_friction": 0.1}
    ],
}

# Hard grains of two kinds, some of which lie when a run stops, and are held by what three tables of contact have given them.
HARD: Table = GRAINS | {
    "emitters": [
        {**GRAINS["emitters"][0], "name": name, "mass": mass, "burst": {"count": 45, "at": at}}
        for name, mass, at in (("grains", 0.01, 0), ("shot", 0.03, 0.05))
    ],
    "planes": [{"restitution": 0.2, "friction": 0.4}],
    "interactions": [
        {"type": "contact", "on": ["grains"], "restitution": 0.2, "friction": 0.4, "rolling_friction": 0.2},
        {"type": "contact", "on": ["shot"], "restitution": 0.5},
        {"type": "contact", "between": ["grains", "shot"], "restitution": 0.3, "friction": 0.2},
    ],
}

# Marbles in the tip of a pyramid, which tremble, fall asleep at 0.45 s, and wake up when something pushes them.
ASLEEP: Table = {
    "simulation": {"duration": 1.0, "dt": 0.001, "seed": 2},
    "output": {"every": 50, "precision": "double"},
    "particles": [
        {
            "name": "marbles",
            "radius": 0.01,
            "density": 2500.0,
            "layout": {"type": "points", "position": [[0.004, 0.03, 0.003], [-0.006, 0.06, 0.002]]},
        }
    ],
    "forces": [{"type": "field", "force": ["20*m*max(t - 0.8, 0)", "-9.81*m", "0"]}],
    "planes": [
        {"normal": [x, 0.65, z], "restitution": 0.3}
        for x, z in ((0.73, 0.22), (-0.22, 0.73), (-0.73, -0.22), (0.22, -0.73))
    ],
    "interactions": [{"type": "contact", "restitution": 0.3}],
}

# Grains deep in each other have more pairs than there is room for at first.
CRUSHED: Table = {
    "simulation": {"duration": 0.4, "dt": 0.001, "seed": 2},
    "output": {"every": 20, "precision": "double"},
    "particles": [
        {
            "name": "grains",
            "radius": 0.1,
            "mass": 1.0,
            "layout": {
                "type": "random",
                "count": 200,
                "shape": {"type": "ball", "radius": 0.4},
            },
        }
    ],
    "forces": [{"type": "point_spring", "stiffness": 40.0}],
    "interactions": [
        {
            "type": "contact",
            "model": "hertz",
            "young_modulus": 1000.0,
            "friction": 0.4,
            "rolling_friction": 0.1,
            "overlap": "keep",
        }
    ],
}

# Bricks that pass each other and walls by their own size in a step, but for what they meet.
SWIFT: Table = {
    "simulation": {"duration": 0.2, "dt": 0.001, "seed": 2},
    "output": {"every": 10, "precision": "double", "work": True},
    "bodies": [
        {
            "name": "bricks",
            "shape": {"type": "box", "size": [0.1, 0.15, 0.2]},
            "orientation": "random",
            "restitution": 0.95,
            "layout": {
                "type": "points",
                "position": [[-0.3, 0, 0], [0, 0, 0], [0.3, 0, 0]],
                "velocity": [[150, 40, 0], [0, 0, 0], [0, -90, 70]],
            },
        },
    ],
    "forces": [{"type": "gravity"}],
    "colliders": [{"type": "box", "size": [1, 1, 1], "inside": True, "restitution": 0.95}],
}

KINDS = {
    "bodies": BODIES,
    "swift": SWIFT,
    "fountain": FOUNTAIN,
    "cloth": CLOTH,
    "memory": MEMORY,
    "adaptive": ADAPTIVE,
    "implicit": IMPLICIT,
    "rods": RODS,
    "pairs": PAIRS,
    "grains": GRAINS,
    "hard": HARD,
    "asleep": ASLEEP,
    "crushed": CRUSHED,
}


def stop_at(frames: int) -> Callable[[ps.Progress], None]:
    """A progress function that interrupts the process at the first safe point after so many frames."""

    def progress(now: ps.Progress) -> None:
        if now.frames >= frames:
            os.kill(os.getpid(), signal.SIGINT)

    return progress


def contents(path: Path) -> dict[str, np.ndarray]:
    """Every dataset of a trajectory but where it comes from."""
    found: dict[str, np.ndarray] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("psim/provenance"):
            found[name] = item[()]

    with h5py.File(path, "r") as file:
        file.visititems(visit)
        found["NSteps"] = file["VTKHDF/Steps"].attrs["NSteps"]
    return found


def assert_same(one: Path, other: Path) -> None:
    """The same bytes in every dataset."""
    first, second = contents(one), contents(other)
    assert first.keys() == second.keys()
    for name, values in first.items():
        one_bytes, other_bytes = (
            repr(v.tolist()).encode() if v.dtype == object else v.tobytes()
            for v in (np.asarray(values), np.asarray(second[name]))
        )
        assert one_bytes == other_bytes, name


class Resume:
    """The helpers above (tests are imported without packages)."""

    kinds = KINDS
    stop_at = staticmethod(stop_at)
    same = staticmethod(assert_same)


@pytest.fixture(scope="session")
def resume() -> type[Resume]:
    return Resume


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The trajectory of a run that was not interrupted."""
    folder = tmp_path_factory.mktemp("whole")

    def path_of(kind: str) -> Path:
        path = folder / f"{kind}.vtkhdf"
        if not path.exists():
            ps.run(ps.from_table(KINDS[kind]), path)
        return path

    return path_of
