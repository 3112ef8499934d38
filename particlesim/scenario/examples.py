"""Where the shipped scenarios are."""

from __future__ import annotations

from pathlib import Path

from particlesim.errors import UsageError


def examples_folder() -> Path:
    """The folder of the shipped scenarios: inside of an installed package, or beside the package in a checkout.

    Raises UsageError when there is none.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "examples", package.parent / "scenarios"):
        if folder.is_dir():
            return folder
    raise UsageError("the shipped scenarios are missing", "Install particlesim again.")
