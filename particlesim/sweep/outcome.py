"""How one run of a sweep ended."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

Status = Literal["done", "check_failed", "bad_scenario", "diverged", "failed"]

EXIT_CODES: dict[Status, int] = {
    "done": 0,
    "check_failed": 1,
    "bad_scenario": 2,
    "diverged": 3,
    "failed": 4,
}


@dataclass(frozen=True)
class Outcome:
    """Number of the run (from 1), its parameters, how it ended and why, wall time [s].

    `quantities` are the final totals by name, `checks` the values of the checks by name (None: not finite); `state` is
    a digest of the final particles, the same for a single run of the same scenario. `files` are digests of the files that
    the scenario names, by those names; empty for one that could not be read.
    """

    run: int
    parameters: dict[str, Any]
    status: Status
    cause: str
    seconds: float
    quantities: dict[str, float | None] = field(default_factory=dict)
    checks: dict[str, float | None] = field(default_factory=dict)
    state: str = ""
    files: dict[str, str] = field(default_factory=dict)

    def as_data(self) -> dict[str, Any]:
        """As plain data, for JSON."""
        return asdict(self)

    @classmethod
    def from_data(cls, data: Any) -> Outcome | None:
        """The inverse of `as_data`; None for anything else."""
        try:
            outcome = cls(**data)
        except TypeError:
            return None
        return outcome if outcome.status in get_args(Status) else None
