"""Packages with forces and flows, installed into a folder: a module, and the metadata that pip would write."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from particlesim.extensions import packages
from particlesim.scenario.extensions import UNIONS

AXIS_PULL = '''\
"""Pull of constant size towards the y axis: f = −F ρ̂, with ρ the distance from the axis."""

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from annotated_types import Ge

from particlesim.forces import Force
from particlesim.laws.registry import force, force_dv, force_dx, law, potential, ZERO_MATRIX
from particlesim.model.units import Newtons


class AxisPull(Force):
    """A pull of the same size everywhere, towards the y axis."""

    type: Literal["axis_pull"] = "axis_pull"
    pull: Annotated[Newtons, Ge(0)]
    """Size of the force F."""

    formula: ClassVar[str] = "f = −F ρ̂"
    energy: ClassVar[str] = "U = F ρ"

    def record(self):
        return AxisPullRecord(self.pull)


class AxisPullRecord(NamedTuple):
    pull: float


@law(force, AxisPullRecord)
def axis_pull_force(f, p):
    k = -f.pull / np.sqrt(p.x * p.x + p.z * p.z)
    return k * p.x, p.y - p.y, k * p.z


@law(potential, AxisPullRecord)
def axis_pull_potential(f, p):
    return f.pull * np.sqrt(p.x * p.x + p.z * p.z)


@law(force_dx, AxisPullRecord)
def axis_pull_dx(f, p):
    rho = np.sqrt(p.x * p.x + p.z * p.z)
    k = f.pull / (rho * rho * rho)
    return -k * p.z * p.z, 0.0, k * p.x * p.z, 0.0, 0.0, 0.0, k * p.x * p.z, 0.0, -k * p.x * p.x


@law(force_dv, AxisPullRecord)
def axis_pull_dv(f, p):
    return ZERO_MATRIX
'''

SHEAR = '''\
"""Shear: w = (γ y, 0, 0)."""

from typing import Literal, NamedTuple

from particlesim.flows import Flow
from particlesim.laws.registry import law, velocity, velocity_dx
from particlesim.model.units import PerSecond


class Shear(Flow):
    """Wind that grows with height, w = (γ y, 0, 0)."""

    type: Literal["shear"] = "shear"
    rate: PerSecond
    """Shear rate γ."""

    def record(self):
        return ShearRecord(self.rate)


class ShearRecord(NamedTuple):
    rate: float


@law(velocity, ShearRecord)
def shear_velocity(f, p):
    return f.rate * p.y, p.y - p.y, p.y - p.y


@law(velocity_dx, ShearRecord)
def shear_gradient(f, p):
    return 0.0, f.rate, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
'''

BORN_MAYER = '''\
"""Born and Mayer's repulsion: U = A e^(−B r)."""

from typing import ClassVar, Literal, NamedTuple

import numpy as np

from particlesim.interactions import PairInteraction
from particlesim.laws.pair import by_distance, central_law
from particlesim.model.units import Joules, PerMetre


class BornMayer(PairInteraction):
    """Repulsion of closed shells."""

    type: Literal["born_mayer"] = "born_mayer"
    size: Joules
    """Energy A."""
    rate: PerMetre
    """B."""

    formula: ClassVar[str] = "f = A B e^(−B r) l/r"
    energy: ClassVar[str] = "U = A e^(−B r)"

    def record(self):
        return BornMayerRecord(self.size, self.rate)

    def singular(self):
        return False


class BornMayerRecord(NamedTuple):
    size: float
    rate: float


@central_law(BornMayerRecord)
def born_mayer(f, p, s):
    r = np.sqrt(s)
    u = f.size * np.exp(-f.rate * r)
    return by_distance(u, -f.rate * u, f.rate * f.rate * u, r)
'''

SCENARIO = """\
format = 1

[simulation]
duration = 0.5
dt = 0.01

[[particles]]
name = "balls"
layout = { type = "points", position = [[1, 0, 0], [0, 0, 2]] }
mass = 0.5

[[forces]]
type = "axis_pull"
pull = "2 N"
"""

Install = Callable[..., Path]


def write_package(
    folder: Path, package: str, module: str, source: str, entries: str, version: str = "1.2"
) -> Path:
    """Write a package as pip would install it into `folder`: `entries` is the text of its entry_points.txt."""
    (folder / f"{module}.py").write_text(source, encoding="utf-8")
    for old in folder.glob(f"{package.replace('-', '_')}-*.dist-info"):
        for file in old.iterdir():
            file.unlink()
        old.rmdir()
    info = folder / f"{package.replace('-', '_')}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n")
    (info / "entry_points.txt").write_text(entries)
    return folder


def forget() -> None:
    """Look at installed packages anew, as a new process would."""
    packages.installed.cache_clear()
    for union in UNIONS:
        union._added.clear()


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on the search path of this process and its children, for packages; modules from there are forgotten."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("PYTHONPATH", str(folder), prepend=":")
    forget()
    yield folder
    forget()
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", "")).startswith(str(folder)):
            del sys.modules[name]


@pytest.fixture
def axis_forces(site: Path) -> Path:
    """The package axis-forces 1.2 with the force "axis_pull"."""
    entries = "[particlesim.forces]\naxis_pull = axis_forces:AxisPull\n"
    return write_package(site, "axis-forces", "axis_forces", AXIS_PULL, entries)


@pytest.fixture
def wind_models(site: Path) -> Path:
    """The package wind-models 0.3 with the flow "shear"."""
    entries = "[particlesim.flows]\nshear = wind_models:Shear\n"
    return write_package(site, "wind-models", "wind_models", SHEAR, entries, "0.3")


@pytest.fixture
def shell_models(site: Path) -> Path:
    """The package shell-models 0.1 with the interaction "born_mayer"."""
    entries = "[particlesim.interactions]\nborn_mayer = shell_models:BornMayer\n"
    return write_package(site, "shell-models", "shell_models", BORN_MAYER, entries, "0.1")
