"""Work: the energy that particles gain and lose other than by exchange between kinetic energy and potentials, by cause.

Between the beginning and the end of a step a particle is taken to move on the Hermite curve of both states and
accelerations; with x̄ = (x₀ + x₁)/2 + h (v₀ − v₁)/8 and v̄ = (v₀ + v₁)/2 + h (a₀ − a₁)/8 in the middle, the work of a force
is W = h (P₀ + 4 P̄ + P₁)/6, P = f·v, by Simpson's rule: of fourth order, so that the residual of the balance

    E(t) − E(0) − Σ W

is the error of the integrator. A step of an adaptive method may be long, and brings its own quadrature: with the weights b
of the method and the power at its stages, W = h Σ bᵢ Pᵢ is what the method would make of dW/dt = P, to its order.

A step in which a particle may touch something is taken twice, with and without contact (an adaptive method gives the end
without contact itself); the difference of the energies at its end is the work of contact. Nothing here changes the motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from particlesim.engine.ledger.sums import each_energy, each_force, each_power
from particlesim.engine.state.columns import Columns
from particlesim.engine.step.records import as_precision
from particlesim.forces import Force
from particlesim.graph.graph import Island
from particlesim.scenario.ledger_columns import causes, has_potential
from particlesim.scenario.scenario import Scenario

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Books:
    """The accounts of an island: `names` of the causes, `totals` [J] in the same order, and `turned` [J], what has
    been turned over: the sum of all amounts without their signs."""

    def __init__(self, scenario: Scenario, structure: Island, dtype: np.dtype[Any]) -> None:
        self.names = causes(scenario, [group.name for group in structure.groups])
        self.totals, self.turned = np.zeros((2, len(self.names)))
        self.jolts: list[tuple[Ints, Floats]] = []
        """What springs and rods at bodies have done to particles just before their own step: rows of the island, and the
        changes of places and velocities [6, n]."""
        named = list(zip(scenario.labels.forces, scenario.forces, strict=True))
        self._spent = [_chosen(named, mine, dtype, conservative=False) for mine in structure.forces]
        self._stored = [_chosen(named, mine, dtype, conservative=True) for mine in structure.forces]

    @property
    def spent(self) -> list[tuple[tuple[str, ...], tuple[Any, ...]]]:
        """For every group, labels and records of the forces without a potential."""
        return self._spent

    @property
    def stored(self) -> list[tuple[tuple[str, ...], tuple[Any, ...]]]:
        """The same of those with one."""
        return self._stored

    def add(self, name: str, joule: float) -> None:
        """Book an amount of energy [J]."""
        cause = self.names.index(name)
        self.totals[cause] += joule
        self.turned[cause] += abs(joule)

    def work_of(self, name: str) -> float:
        """The work of a cause so far [J]; 0 for unknown causes."""
        return float(self.totals[self.names.index(name)]) if name in self.names else 0.0

    def spends(self, member: int) -> bool:
        """Whether a group feels forces without a potential."""
        return bool(self._spent[member][0])

    def energies(self, member: int, columns: Columns, times: Floats) -> Floats:
        """Kinetic and potential energy of every particle of a group at its time [J], without that of springs, shape [n]."""
        records = self._stored[member][1]
        out = np.zeros((1 + len(records), len(times)))
        each_energy(records, columns, times, out)
        return np.asarray(out.sum(axis=0))

    def powers(self, member: int, columns: Columns, times: Floats) -> Floats:
        """Power of every force without a potential on every particle of a group [W], shape [forces, n]."""
        records = self._spent[member][1]
        out = np.zeros((len(records), len(times)))
        each_power(records, columns, times, out)
        return out

    def book_powers(
        self, member: int, powers: Sequence[Floats], weights: Sequence[float], h: Floats
    ) -> Floats:
        """Book the work of forces in steps of lengths h [s], shape [n], from powers at moments and their weights.

        Returns what they did on every particle together [J], shape [n].
        """
        work = np.where(h > 0, h * weighted(weights, powers), 0.0)
        for label, joule in zip(self._spent[member][0], work.sum(axis=1), strict=True):
            self.add(label, float(joule))
        return np.asarray(work.sum(axis=0))


def total_energy(row: Mapping[str, float]) -> float:
    """Kinetic plus all potential energy of a row of the ledger [J]."""
    return float(sum(value for key, value in row.items() if is_energy(key)))


def is_energy(column: str) -> bool:
    """Whether a column of the ledger is an energy that particles have."""
    return column == "kinetic" or column.startswith("potential.")


def _chosen(
    named: Sequence[tuple[str, Force]], mine: Sequence[Force], dtype: np.dtype[Any], *, conservative: bool
) -> tuple[tuple[str, ...], tuple[Any, ...]]:
    """Labels and records of the forces on a group that have a potential, or of those that have none."""
    here = [
        (label, as_precision(law.record(), dtype))
        for label, law in named
        if has_potential(law) is conservative and any(law is other for other in mine)
    ]
    return tuple(label for label, _ in here), tuple(record for _, record in here)


def unjolted(columns: Columns, jolts: Sequence[tuple[Ints, Floats]]) -> Columns:
    """Particles as they were before jolts: their velocities go from there to where they are in the end, and forces work on
    that way, however soon after the jolt they take it back."""
    for rows, change in jolts:
        parts = {}
        for name, by in zip(("x", "y", "z", "vx", "vy", "vz"), change, strict=True):
            parts[name] = getattr(columns, name).copy()
            parts[name][rows] -= by.astype(parts[name].dtype)
        columns = columns._replace(**parts)
    return columns


def met_jolts(before: Columns, after: Columns, jolts: Sequence[tuple[Ints, Floats]], h: Floats) -> float:
    """What contact, which has changed the places at the end of steps of h [s], gives of what acts by jolts [J]: f·d with
    f = m Δv/h and its displacement d."""
    total = 0.0
    for rows, change in jolts:
        for name, by in zip(("x", "y", "z"), change[3:], strict=True):
            gone = (getattr(after, name)[rows] - getattr(before, name)[rows]).astype(float)
            total += float((after.m[rows] * gone * by / h[rows]).sum())
    return total


SIMPSON = (1 / 6, 4 / 6, 1 / 6)
"""Weights of the beginning, the middle and the end of a step."""


def weighted(weights: Sequence[float], values: Sequence[Floats]) -> Floats:
    """Σ weights[k] values[k]."""
    total = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        total = total + weight * value
    return np.asarray(total)


def halfway(before: Columns, after: Columns, a0: Floats, a1: Floats, h: Floats) -> Columns:
    """The state in the middle of steps of lengths h [s] from one state to another; accelerations have shape [3, n]."""
    moved: dict[str, Any] = {}
    for axis, (x, v) in enumerate((("x", "vx"), ("y", "vy"), ("z", "vz"))):
        x0, x1, v0, v1 = (getattr(c, name).astype(float) for name in (x, v) for c in (before, after))
        moved[x] = (0.5 * (x0 + x1) + h * (v0 - v1) / 8).astype(before.x.dtype)
        moved[v] = (0.5 * (v0 + v1) + h * (a0[axis] - a1[axis]) / 8).astype(before.x.dtype)
    return after._replace(**moved)


def halfway_between(before: Columns, after: Columns, h: Floats) -> Columns:
    """The same from both states alone, v̄ = 3 (x₁ − x₀)/(2h) − (v₀ + v₁)/4, where accelerations are not known."""
    made: dict[str, Any] = {}
    moves = h > 0
    length = np.where(moves, h, 1.0)
    for x, v in (("x", "vx"), ("y", "vy"), ("z", "vz")):
        x0, x1, v0, v1 = (getattr(c, name).astype(float) for name in (x, v) for c in (before, after))
        made[x] = (0.5 * (x0 + x1) + h * (v0 - v1) / 8).astype(before.x.dtype)
        between = np.where(moves, 1.5 * (x1 - x0) / length - 0.25 * (v0 + v1), v1)
        made[v] = between.astype(before.x.dtype)
    return after._replace(**made)


def turned(before: Columns, after: Columns, h: Floats) -> tuple[Columns, Columns]:
    """Two states in the middle and at the end of steps of lengths h [s], the second of which is `after`, with the angles by
    which particles have turned since the beginning, as contacts need them: on the Hermite curve of both, as places are."""
    if before.spin is None:
        return after, after
    kind = before.x.dtype
    middle, end = {}, {}
    for axis in "xyz":
        w0, w1 = (getattr(c.spin, f"w{axis}").astype(float) for c in (before, after))
        angle = 0.5 * h * (w0 + w1)
        middle[f"w{axis}"] = (0.5 * (w0 + w1)).astype(kind)
        middle[f"a{axis}"] = (0.5 * angle + h * (w0 - w1) / 8).astype(kind)
        end[f"a{axis}"] = angle.astype(kind)
    return after._replace(spin=after.spin._replace(**middle)), after._replace(spin=after.spin._replace(**end))


def moved(before: Columns, start: Floats, change: Floats) -> Columns:
    """Columns with the positions and velocities `start` + `change`, shape [6, n]."""
    now = (start + change).astype(before.x.dtype)
    return before._replace(**dict(zip(("x", "y", "z", "vx", "vy", "vz"), now, strict=True)))


def accelerations(forces: Any, columns: Columns, times: Floats) -> Floats:
    """Accelerations of single particles, each at its time [m/s²], shape [3, n]."""
    out = np.zeros((3, len(times)))
    each_force(forces, columns, times, out)
    return np.asarray(out / columns.m)
