"""What workers of the tests do; a module of its own, because workers import it."""

from __future__ import annotations

import os
import time
from pathlib import Path


def fragile(number: int) -> int:
    """Squares; run 3 takes its worker down the first time, run 5 always."""
    mark = Path(os.environ["PSIM_TEST_MARK"])
    if number == 5 or (number == 3 and not mark.exists()):
        mark.touch()
        os._exit(9)
    return number * number


def endless(number: int) -> int:
    """Run 0 ends, the others do not."""
    if number:
        time.sleep(60)
    return number
