"""When particles are born: bursts and rate merged into one sequence of births, numbered from 0."""

from __future__ import annotations

import math

import numpy as np

from particlesim.emitters.emitter import Emitter
from particlesim.model.arrays import Floats
from particlesim.sampling.random_streams import Streams


class Schedule:
    """Birth times of an emitter in order; number k has the same time however often and in whatever intervals births are
    asked for.

    Birth j of the rate is due at start + j/rate, or with jitter at start + (j + u_j)/rate; all births of a burst at its
    time, before births of the rate at the same time.
    """

    def __init__(self, emitter: Emitter, streams: Streams) -> None:
        self._emitter = emitter
        self._stream = streams["timing"]
        self._bursts = sorted((burst.at, burst.count) for burst in emitter.bursts())

    def before(self, time: float) -> int:
        """How many births are due before a time [s]."""
        return sum(count for at, count in self._bursts if at < time) + self._of_rate(time)

    def times(self, first: int, last: int) -> Floats:
        """Times of the births first … last − 1 [s], shape [last − first], ascending."""
        if last <= first:
            return np.empty(0)
        times = np.empty(last - first)
        # Births of the rate and bursts are merged by counting how many bursts precede each.
        filled, k = 0, first
        while filled < len(times):
            shot, rest = self._segment(k)
            take = min(rest, len(times) - filled)
            if shot is not None:
                times[filled : filled + take] = shot
            else:
                j = k - self._bursts_before_birth(k)
                times[filled : filled + take] = self._rate_times(j, take)
            filled += take
            k += take
        return times

    def total(self, duration: float) -> int:
        """Number of births in a run."""
        return self.before(duration)

    def _rate_times(self, first: int, count: int) -> Floats:
        emitter = self._emitter
        assert emitter.rate is not None
        index = np.arange(first, first + count, dtype=float)
        if emitter.timing == "jittered":
            index = index + self._stream.uniform(first, count)
        return np.asarray(emitter.start + index / emitter.rate)

    def _of_rate(self, time: float) -> int:
        """Births of the rate due before a time."""
        emitter = self._emitter
        if emitter.rate is None:
            return 0
        end = time if emitter.stop is None else min(time, emitter.stop)
        guess = max(math.ceil((end - emitter.start) * emitter.rate) + 2, 0)
        # Exact to the comparison of the very numbers that `times` gives.
        low = max(guess - 5, 0)
        near = self._rate_times(low, guess - low)
        return low + int(np.searchsorted(near, end, side="left"))

    def _starts(self) -> list[tuple[int, float, int]]:
        """Number of the first birth of each burst, its time, its count."""
        starts, earlier = [], 0
        for at, count in self._bursts:
            starts.append((self._of_rate(at) + earlier, at, count))
            earlier += count
        return starts

    def _segment(self, k: int) -> tuple[float | None, int]:
        """The burst that birth k belongs to (None: the rate), and how many births are left of this segment."""
        for first, at, count in self._starts():
            if k < first:
                return None, first - k
            if k < first + count:
                return at, first + count - k
        return None, 1 << 62

    def _bursts_before_birth(self, k: int) -> int:
        return sum(count for first, _, count in self._starts() if first + count <= k)
