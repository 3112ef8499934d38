"""Energy from nothing: what an island has gained beyond all work done on it, relative to the energies that it has.

With E the sum of the kinetic energy K and all potentials, ⁰ for values at the beginning, and W the work in the ledger since
then (0 where no work is in it, as then forces without a potential can only take energy), and A what has come from moving
apart what overlaps (`interactions.lifting`), the gain is

    E − E⁰ − W − A,

and it is compared with

    max(|K⁰ + Σ U_f⁰|, K⁰ + Σ (U_f⁰ − U_f), min(K⁰, K)) + Σ (max U_g − min U_g) + Σ |W_c|,

over potentials U_f that have a natural zero (springs, attraction), potentials U_g that have none and count by their range so
far (uniform gravity), and causes c of work, of which W_c is what they have turned over: a wall that gives energy and dampers
that take it count with both. The second of the three is the kinetic energy expected at the present potential energy: it is
large where a comet passes the sun, where the same error matters little. As only the range of U_g counts, it does not matter
where heights are measured from.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from particlesim.engine.state.group_state import GroupState
from particlesim.model.arrays import Floats

ROUNDING = 64.0
"""Times the distance of floating-point numbers that rounding may change a position in a step."""
DRIFT = 1e-9
"""Part of all energies that rounding of many steps may feign in double precision."""


class Gain(NamedTuple):
    """Energy from nothing [J], what it is held against [J], and what methods and rounding may feign [J]."""

    joule: float
    scale: float
    noise: float

    @property
    def ratio(self) -> float:
        """The gain that is surely one, as a part of the energy there is; 0 where there is none yet, or more than numbers
        can hold."""
        return max(self.joule - self.noise, 0.0) / self.scale if 0 < self.scale < math.inf else 0.0


class Account:
    """The energies of an island since a beginning: `names` of all potentials, which of them have a zero of their own, and
    the number of causes whose work is booked.

    There are few of them, and Python's own numbers are faster than arrays then.
    """

    def __init__(self, names: tuple[str, ...], absolute: tuple[bool, ...], causes: int) -> None:
        self._names, self._absolute = names, absolute
        # Potentials at the beginning, when last looked at, and the least and the most so far.
        self._start, self._now, self._low, self._high = ([0.0] * len(names) for _ in range(4))
        self._kinetic = 0.0
        self._work, self._turned = [0.0] * causes, [0.0] * causes
        self._fed = 0.0
        self._first, self._last = -1, -1

    def forget(self) -> None:
        """Start anew from the next energies."""
        self._first = -1

    @property
    def first_step(self) -> int:
        """The step of the beginning; −1 before there is one."""
        return self._first

    def begin(
        self, step: int, energies: Mapping[str, float], work: Floats, turned: Floats, fed: float = 0.0
    ) -> None:
        """Start from the energies [J] at a step, the work booked and turned over up to there [J], and what moving particles
        apart has fed [J]."""
        self._fed = fed
        for values in (self._start, self._now, self._low, self._high):
            values[:] = self._potentials(energies)
        self._kinetic = energies["kinetic"]
        self._work[:], self._turned[:] = work.tolist(), turned.tolist()
        self._first = self._last = step

    def _potentials(self, energies: Mapping[str, float]) -> list[float]:
        return [energies.get(name, 0.0) for name in self._names]

    def look(
        self,
        step: int,
        energies: Mapping[str, float],
        work: Floats,
        turned: Floats,
        drift: float = DRIFT,
        fed: float = 0.0,
        roughly: bool = False,
    ) -> Gain:
        """The gain up to a step; `drift` is the part of all energies that rounding may feign. Of work that is known
        `roughly` what takes energy does not count: more than was taken may be booked."""
        kinetic = energies["kinetic"]
        joule, own, sums = kinetic - self._kinetic - (fed - self._fed), self._kinetic, abs(kinetic)
        due = self._kinetic  # at the present depth
        exchanged = recent = 0.0
        for k, now in enumerate(self._potentials(energies)):
            self._low[k], self._high[k] = min(self._low[k], now), max(self._high[k], now)
            joule += now - self._start[k]
            sums += max(abs(self._low[k]), abs(self._high[k]))
            if self._absolute[k]:
                own += self._start[k]
                due += self._start[k] - now
            else:
                exchanged += self._high[k] - self._low[k]
                recent += abs(now - self._now[k])
            self._now[k] = now
        amounts = zip(self._work, work.tolist(), self._turned, turned.tolist(), strict=True)
        for before, after, turned_before, turned_after in amounts:
            joule -= max(after - before, 0.0) if roughly else after - before
            exchanged += max(abs(after - before), turned_after - turned_before)
        # Methods of first order know the time of an energy to one step: what is turned over in it, which is twice the mean
        # of a fall from rest, is no gain.
        recent *= 2 / max(step - self._last, 1)
        self._last = step
        scale = max(abs(own), due, min(self._kinetic, kinetic)) + exchanged
        return Gain(joule, scale, recent + drift * sums)


def drift_of(precision: str) -> float:
    """Part of all energies that rounding of many steps may feign, in "single" or "double" precision."""
    return max(DRIFT, 1024 * float(np.finfo(precision).eps))


def jitter(states: Iterable[GroupState], dt: float) -> float:
    """The energy that rounding of positions gives particles in a step [J]: masses, extent and precision decide."""
    total = 0.0
    for state in states:
        if n := state.count:
            x = state.x[:, :n]
            far = max(float(x.max()), -float(x.min()))
            slip = ROUNDING * float(np.finfo(state.dtype).eps) * far / dt
            total += float(state.mass[:n].sum(dtype=float)) * slip * slip
    return total
