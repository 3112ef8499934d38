"""Laps of a piece of an interval: steps that an island makes in one call, with places at which it may stop.

To begin a piece costs an island of many particles as much as some steps: a copy of its state, and an order in memory. Laps
share them. A piece that stops after some of its laps has the bits of one that goes on, as every lap ends in the same way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class Laps:
    """`steps`: those of a lap. `asked`: told the step after each, it says whether somebody wants the state there. `stopped`:
    the step where it did, None if nowhere."""

    steps: int
    asked: Callable[[int], bool]
    stopped: int | None = None

    def goes_on(self, step: int) -> bool:
        """Whether the next lap may begin."""
        if not self.asked(step):
            return True
        self.stopped = step
        return False
