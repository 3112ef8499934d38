"""Which runs a sweep has: every combination of the values, values side by side, or samples."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from particlesim.errors import UsageError
from particlesim.model.spelling import did_you_mean
from particlesim.sweep.axes import MOST_VALUES, Listed, Sampled

Method = Literal["sobol", "lhs", "random"]
MOST_RUNS = 10**12
"""Runs of a sweep: more than any cluster does, and few enough to be numbered."""


@dataclass(frozen=True)
class Design:
    """Runs 0 … len − 1 and the settings of each; the last key varies fastest.

    With `zipped`, the k-th values of all lists make a run. Sampled keys take `samples` points by `method` (scrambled
    Sobol sequence, Latin hypercube, independent), and every combination of the lists is run with all of them.
    Raises UsageError when that makes no sense.
    """

    axes: tuple[Listed | Sampled, ...]
    zipped: bool = False
    samples: int | None = None
    method: Method = "sobol"
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.axes:
            raise UsageError("there is nothing to vary", "Name a key: --vary simulation.dt=1e-3,2e-3")
        times = Counter(self.keys)
        if times and max(times.values()) > 1:
            twice = times.most_common(1)[0][0]
            raise UsageError(f"{twice} is varied twice", "Give all its values in one --vary.")
        if self.method not in get_args(Method):
            known = get_args(Method)
            hint = did_you_mean(self.method, known) or "There are: " + ", ".join(known)
            raise UsageError(f"there is no method {self.method!r}", hint)
        self._check_samples()
        lengths = {axis.key: len(axis.values) for axis in self._listed}
        if self.zipped and len(set(lengths.values())) > 1:
            told = ", ".join(f"{key} has {count}" for key, count in lengths.items())
            raise UsageError(f"lists to be zipped must have the same length: {told}")
        if (runs := prod(self._lengths)) > MOST_RUNS:
            raise UsageError(
                f"these are {runs:.3g} runs, and a sweep has at most {MOST_RUNS:,}",
                "Vary less, or draw samples.",
            )

    def _check_samples(self) -> None:
        if self._sampled and self.samples is None:
            raise UsageError(
                f"{self._sampled[0].key} is to be drawn, and it is not said how often", "--samples 100"
            )
        if self.samples is not None and not self._sampled:
            raise UsageError(
                "there is nothing to draw samples of", "--vary 'forces.air.coefficient=uniform(0.1, 0.5)'"
            )
        if self.samples is not None and self.samples < 1:
            raise UsageError(f"the number of samples must be 1 or more, got {self.samples}", "--samples 100")
        if self.samples is not None and self.samples > MOST_VALUES:
            raise UsageError(f"{self.samples:,} samples are more than {MOST_VALUES:,}", "Draw fewer.")
        if self.seed < 0:
            raise UsageError(f"the seed must be 0 or more, got {self.seed}")

    @property
    def keys(self) -> tuple[str, ...]:
        """What is varied, as it was named."""
        return tuple(axis.key for axis in self.axes)

    @property
    def _listed(self) -> list[Listed]:
        return [axis for axis in self.axes if isinstance(axis, Listed)]

    @property
    def _sampled(self) -> list[Sampled]:
        return [axis for axis in self.axes if isinstance(axis, Sampled)]

    @cached_property
    def _points(self) -> NDArray[np.float64]:
        """Points of the unit cube, shape [samples, keys]."""
        count, dimensions = self.samples or 1, len(self._sampled)
        if self.method == "random":
            return np.random.default_rng(self.seed).random((count, dimensions))
        from scipy.stats import qmc

        with warnings.catch_warnings():
            # Of Sobol sequences whose length is no power of two: any length may be asked for.
            warnings.simplefilter("ignore", UserWarning)
            engine = qmc.Sobol if self.method == "sobol" else qmc.LatinHypercube
            return np.asarray(engine(dimensions, seed=self.seed).random(count))

    @cached_property
    def _lengths(self) -> list[int]:
        lengths = [len(axis.values) for axis in self._listed]
        if self.zipped and lengths:
            lengths = lengths[:1]
        return [*lengths, self.samples or 1]

    def __len__(self) -> int:
        return prod(self._lengths)

    def settings(self, run: int) -> dict[str, object]:
        """The value of every key in a run."""
        if not 0 <= run < len(self):
            raise IndexError(run)
        at = [int(k) for k in np.unravel_index(run, self._lengths)]
        listed = at[:-1] if not self.zipped else at[:1] * len(self._listed)
        values: dict[str, object] = {
            axis.key: axis.values[k] for axis, k in zip(self._listed, listed, strict=True)
        }
        if self._sampled:
            point = self._points[at[-1]]
            values |= {axis.key: axis.at(float(u)) for axis, u in zip(self._sampled, point, strict=True)}
        return {key: values[key] for key in self.keys}
