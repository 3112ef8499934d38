"""Random numbers by address: every attribute of every emitter or layout has a stream of its own.

A stream is a counter-based generator (Philox 4×64, Salmon et al., SC 2011) keyed by the scenario's seed and the stream's
name, so that number k can be drawn without drawing the ones before it. Results therefore do not depend on threads,
output intervals or block sizes, and a resumed run goes on with the same numbers.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray


class Stream:
    """Uniform random numbers in (0, 1), addressed by their position in the stream."""

    def __init__(self, seed: int, *name: str) -> None:
        digest = hashlib.sha256("\0".join((str(seed), *name)).encode()).digest()
        self._key = np.frombuffer(digest[:16], dtype="<u8").astype(np.uint64)

    def uniform(self, first: int, count: int) -> NDArray[np.float64]:
        """Numbers first … first + count − 1, shape [count], never 0 or 1."""
        generator = np.random.Philox(key=self._key)
        generator.advance(first // 4)  # each step of the counter gives four numbers
        raw = generator.random_raw(count + first % 4)[first % 4 :]
        return np.asarray((raw >> np.uint64(11)) * 2.0**-53 + 2.0**-54)


class Streams:
    """The streams of one named thing: `streams["speed"]`."""

    def __init__(self, seed: int, *name: str) -> None:
        self._seed = seed
        self._name = name

    def __getitem__(self, attribute: str) -> Stream:
        return Stream(self._seed, *self._name, attribute)
